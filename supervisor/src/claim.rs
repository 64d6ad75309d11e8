//! The claim to a robot's folder: one supervisor per robot, held by a lock that the kernel frees when its holder dies.
//!
//! `<root>/.run/supervisor.lock` carries a POSIX record lock: no child inherits it and it never outlives its process. It
//! is lost when the process closes any descriptor of the file, so nothing else ever opens it; who holds it is told by
//! `supervisor.json` beside it. `<root>/.run/<instance>.pid` names the process of each node.

use std::collections::HashSet;
use std::fs::{self, File, OpenOptions};
use std::io::{self, ErrorKind};
use std::os::unix::fs::{MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use runtime::clock::wall_seconds;
use rustix::fs::{FlockOperation, fcntl_lock};
use rustix::io::Errno;

use crate::folders::{base_flaw, count_files, make_folder, own_flaw};
use crate::owner::{OWNER, Owner, RUN_FOLDER, owner};
use crate::proc;
use crate::wall::{span, utc};

const LOCK: &str = "supervisor.lock";

/// Why a robot's folder cannot be claimed.
#[derive(Debug, thiserror::Error)]
pub enum ClaimError {
    /// Another supervisor holds it.
    #[error("robot `{robot}` is already running: {}; stop it with `sinew down {robot}`, or give this one another name with `--name`", holder(.owner.as_ref()))]
    AlreadyRunning {
        /// The name that is taken.
        robot: String,
        /// Who has it, if it has said so yet.
        owner: Option<Owner>,
    },
    /// A folder on the way could be exchanged by somebody else.
    #[error("{path} is not safe to use: {why}; remove it, or choose another folder with SINEW_SHM")]
    Unsafe {
        /// The folder.
        path: PathBuf,
        /// What is wrong with it.
        why: String,
    },
    /// The folder holds files that no supervisor has made.
    #[error(
        "{path} holds files that are not Sinew's; remove them, or choose another folder with SINEW_SHM or another name with `--name`"
    )]
    Foreign {
        /// The folder.
        path: PathBuf,
    },
    /// The system refused.
    #[error("cannot claim {path}: {error}; make room there for this user, or choose another folder with SINEW_SHM")]
    Io {
        /// The folder.
        path: PathBuf,
        /// The system's reason.
        error: io::Error,
    },
}

fn holder(owner: Option<&Owner>) -> String {
    let Some(owner) = owner else { return "another supervisor is just starting it".to_owned() };
    let ago = span((wall_seconds() - owner.since_unix_s).max(0.0));
    format!("process {} holds it since {} ({ago} ago)", owner.pid, utc(owner.since_unix_s))
}

/// Roots claimed by this process: the kernel grants a process its own POSIX locks twice.
static CLAIMED: Mutex<Option<HashSet<PathBuf>>> = Mutex::new(None);

/// A held claim. `release` removes the folder; dropping it keeps the folder for the next claim to clear.
#[derive(Debug)]
pub struct Claim {
    root: PathBuf,
    /// Kept open: closing it gives up the lock. `None`: the root of the process tree holds it.
    lock: Option<File>,
    owner: Owner,
}

impl Claim {
    /// Claims `root`, creating it if need be. What an earlier owner left there is still there.
    pub fn take(root: &Path, robot: &str) -> Result<Claim, ClaimError> {
        let taken = || ClaimError::AlreadyRunning { robot: robot.to_owned(), owner: owner(root) };
        if !claimed(|roots| roots.insert(root.to_owned())) {
            return Err(taken());
        }
        let result = Self::take_lock(root, robot).and_then(|lock| {
            let lock = lock.ok_or_else(taken)?;
            // Nobody can hold it who does not hold the lock, unless the lock was lost: then better not.
            let pid = std::process::id() as i32;
            if owner(root).is_some_and(|owner| owner.is_alive() && owner.pid != pid) {
                return Err(taken());
            }
            let start_ticks = proc::start_ticks(pid).unwrap_or(0);
            let since_unix_s = wall_seconds();
            let run = format!("{pid}-{start_ticks}-{:x}", (since_unix_s * 1e6) as u64);
            let owner = Owner { robot: robot.to_owned(), pid, start_ticks, since_unix_s, run };
            Ok(Claim { root: root.to_owned(), lock: Some(lock), owner })
        });
        if result.is_err() {
            claimed(|roots| roots.remove(root));
        }
        result
    }

    /// The claim that the living root of the process tree holds.
    pub fn of_root(root: &Path) -> Option<Claim> {
        let owner = owner(root).filter(Owner::is_alive)?;
        Some(Claim { root: root.to_owned(), lock: None, owner })
    }

    /// Lets the lock stay with this process when it becomes another program.
    pub fn outlive_exec(&self) -> io::Result<()> {
        let lock = self.lock.as_ref().ok_or(ErrorKind::NotFound)?;
        Ok(rustix::io::fcntl_setfd(lock, rustix::io::FdFlags::empty())?)
    }

    /// `None`: somebody else holds it.
    fn take_lock(root: &Path, robot: &str) -> Result<Option<File>, ClaimError> {
        let at = |path: &Path| {
            let path = path.to_owned();
            move |error| ClaimError::Io { path, error }
        };
        // A supervisor that is just leaving removes folders and lock under our hands: then they are made anew.
        for _ in 0..16 {
            match Self::try_lock(root) {
                Ok(Attempt::Locked(lock)) => return Ok(Some(lock)),
                Ok(Attempt::Held) => return Ok(None),
                Ok(Attempt::Refused(error)) => return Err(error),
                Ok(Attempt::Vanished) => {}
                Err(error) if error.kind() == ErrorKind::NotFound => {}
                Err(error) => return Err(at(root)(error)),
            }
        }
        let error =
            io::Error::other(format!("the folder of `{robot}` keeps vanishing; is it being removed in a loop?"));
        Err(at(root)(error))
    }

    fn try_lock(root: &Path) -> io::Result<Attempt> {
        let base = root.parent().unwrap_or(Path::new("/"));
        make_folder(base, 0o755, true)?;
        if let Some(refused) = base_flaw(base)? {
            return Ok(Attempt::Refused(refused));
        }
        let new = make_folder(root, 0o755, false)?;
        if let Some(refused) = own_flaw(root)? {
            return Ok(Attempt::Refused(refused));
        }
        let run = root.join(RUN_FOLDER);
        if !new && !run.exists() && fs::read_dir(root)?.next().is_some() && !run.exists() {
            return Ok(Attempt::Refused(ClaimError::Foreign { path: root.to_owned() }));
        }
        make_folder(&run, 0o700, false)?;
        if let Some(refused) = own_flaw(&run)? {
            return Ok(Attempt::Refused(refused));
        }
        let path = run.join(LOCK);
        let no_follow = rustix::fs::OFlags::NOFOLLOW.bits() as i32;
        let lock =
            OpenOptions::new().read(true).write(true).create(true).mode(0o600).custom_flags(no_follow).open(&path)?;
        match fcntl_lock(&lock, FlockOperation::NonBlockingLockExclusive) {
            Ok(()) => {}
            Err(Errno::AGAIN | Errno::ACCESS) => return Ok(Attempt::Held),
            Err(error) => return Err(error.into()),
        }
        // The holder before may have removed the file between our opening and our lock.
        let same = fs::metadata(&path).is_ok_and(|file| lock.metadata().is_ok_and(|own| own.ino() == file.ino()));
        Ok(if same { Attempt::Locked(lock) } else { Attempt::Vanished })
    }

    /// Writes who holds the claim: from now on others can say so.
    pub fn announce(&self) -> Result<(), ClaimError> {
        let run = self.run_folder();
        let announced = || -> io::Result<()> {
            let new = run.join("supervisor.json.new");
            fs::write(&new, serde_json::to_vec(&self.owner)?)?;
            fs::rename(new, run.join(OWNER))
        };
        announced().map_err(|error| ClaimError::Io { path: run.clone(), error })
    }

    /// The claimed folder.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// The supervisor's own folder below it.
    pub fn run_folder(&self) -> PathBuf {
        self.root.join(RUN_FOLDER)
    }

    /// Who holds it: this process.
    pub fn owner(&self) -> &Owner {
        &self.owner
    }

    /// Removes everything below the root but the lock; tells how many files that were.
    pub fn clear(&self) -> io::Result<usize> {
        let mut files = 0;
        for folder in [self.root.clone(), self.run_folder()] {
            for entry in fs::read_dir(folder)? {
                let entry = entry?;
                if entry.file_name() == RUN_FOLDER || entry.file_name() == LOCK {
                    continue;
                }
                // Links are removed, never followed.
                if entry.file_type()?.is_dir() {
                    files += count_files(&entry.path());
                    fs::remove_dir_all(entry.path())?;
                } else {
                    files += 1;
                    fs::remove_file(entry.path())?;
                }
            }
        }
        Ok(files)
    }

    /// Removes the root with all that is in it; the lock goes last, so that no half-removed folder is ever unclaimed.
    pub fn release(self) -> io::Result<()> {
        self.clear()?;
        let run = self.run_folder();
        fs::remove_file(run.join(LOCK))?;
        // From here on a successor may have moved in; then the folders are its own.
        for folder in [run.as_path(), self.root.as_path(), self.root.parent().unwrap_or(Path::new("/"))] {
            if fs::remove_dir(folder).is_err() {
                break;
            }
        }
        Ok(())
    }
}

impl Drop for Claim {
    fn drop(&mut self) {
        claimed(|roots| roots.remove(&self.root));
    }
}

enum Attempt {
    Locked(File),
    Held,
    Vanished,
    Refused(ClaimError),
}

fn claimed(change: impl FnOnce(&mut HashSet<PathBuf>) -> bool) -> bool {
    change(CLAIMED.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert_default())
}
