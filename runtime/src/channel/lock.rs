//! The one writer of a path, between processes and within one.
//!
//! Between processes: a POSIX record lock on a hidden file beside the ring, readable and writable by its owner only. The
//! kernel frees it when its holder dies, whatever children the holder left, and names the holder. It is not the ring
//! itself that is locked, since whoever may read a file may hold a lock on it. Within a process the same lock would be
//! granted twice, and lost when any descriptor of the file is closed: hence the register of the files held here, which
//! are opened nowhere else.
//!
//! Under one user this keeps honest programs apart and no others; between users the file's mode does.

use std::collections::HashSet;
use std::io;
use std::os::fd::{AsFd, AsRawFd, BorrowedFd, OwnedFd};
use std::sync::{Mutex, MutexGuard, PoisonError};

use rustix::fs::{AtFlags, Mode, OFlags};
use rustix::io::Errno;

use super::error::ChannelError;

/// Device and inode of the lock files that this process holds.
static HELD: Mutex<Option<HashSet<Key>>> = Mutex::new(None);

type Key = (u64, u64);

/// A held lock; free again when dropped.
pub(super) struct Lock {
    file: Option<OwnedFd>,
    key: Key,
}

/// The name of the lock file of channel `name`.
pub(super) fn file_name(name: &str) -> String {
    format!(".{name}.lock")
}

impl Lock {
    /// Takes the lock of channel `name` in `folder`, or says who has it. `path` is for messages.
    pub fn take(folder: BorrowedFd<'_>, name: &str, path: &str) -> Result<Lock, ChannelError> {
        let lock_name = file_name(name);
        let mut held = held();
        // Another process may put a new file under the name between any two of our calls, but not for ever.
        for _ in 0..100 {
            // Asked before opening: closing a second descriptor would lose the lock.
            if key_at(folder, &lock_name).is_some_and(|key| is_held(&held, key)) {
                return Err(ChannelError::Held { path: path.into(), holder: Some(std::process::id()) });
            }
            let file = open(folder, &lock_name, OFlags::empty()).map_err(|e| system(path, "open the lock of", e))?;
            let key = key_of(&file).map_err(|e| system(path, "look at the lock of", e))?;
            match lock(&file) {
                Ok(()) if key_at(folder, &lock_name) == Some(key) => return Ok(Lock::hold(&mut held, file, key)),
                Ok(()) => continue,
                Err(e) if matches!(e.raw_os_error(), Some(libc::EAGAIN | libc::EACCES)) => match holder(&file) {
                    Some(holder) => return Err(ChannelError::Held { path: path.into(), holder }),
                    None => continue,
                },
                Err(source) => return Err(ChannelError::System { path: path.into(), doing: "lock", source }),
            }
        }
        Err(ChannelError::Held { path: path.into(), holder: None })
    }

    /// Puts a new lock in the place of one whose holder hangs; the old one stays with its holder and guards nothing.
    pub fn seize(folder: BorrowedFd<'_>, name: &str, path: &str) -> Result<Lock, ChannelError> {
        let (lock_name, fresh_name) = (file_name(name), format!(".{name}.{}.newlock", std::process::id()));
        let refused = |e| system(path, "make a new lock for", e);
        let mut held = held();
        let _ = rustix::fs::unlinkat(folder, &fresh_name, AtFlags::empty());
        let file = open(folder, &fresh_name, OFlags::EXCL).map_err(refused)?;
        let key = key_of(&file).map_err(refused)?;
        lock(&file).map_err(|source| ChannelError::System { path: path.into(), doing: "lock", source })?;
        rustix::fs::renameat(folder, &fresh_name, folder, &lock_name).map_err(refused)?;
        Ok(Lock::hold(&mut held, file, key))
    }

    fn hold(held: &mut Option<HashSet<Key>>, file: OwnedFd, key: Key) -> Lock {
        held.get_or_insert_default().insert(key);
        Lock { file: Some(file), key }
    }
}

impl Drop for Lock {
    fn drop(&mut self) {
        let mut held = held();
        drop(self.file.take());
        if let Some(held) = held.as_mut() {
            held.remove(&self.key);
        }
    }
}

fn held() -> MutexGuard<'static, Option<HashSet<Key>>> {
    HELD.lock().unwrap_or_else(PoisonError::into_inner)
}

fn is_held(held: &Option<HashSet<Key>>, key: Key) -> bool {
    held.as_ref().is_some_and(|held| held.contains(&key))
}

fn open(folder: BorrowedFd<'_>, name: &str, more: OFlags) -> Result<OwnedFd, Errno> {
    let flags = OFlags::RDWR | OFlags::CREATE | OFlags::NOFOLLOW | OFlags::CLOEXEC | OFlags::NONBLOCK | more;
    rustix::fs::openat(folder, name, flags, Mode::RUSR | Mode::WUSR)
}

fn key_of(file: &OwnedFd) -> Result<Key, Errno> {
    rustix::fs::fstat(file.as_fd()).map(|stat| (stat.st_dev, stat.st_ino))
}

fn key_at(folder: BorrowedFd<'_>, name: &str) -> Option<Key> {
    let stat = rustix::fs::statat(folder, name, AtFlags::SYMLINK_NOFOLLOW).ok()?;
    Some((stat.st_dev, stat.st_ino))
}

fn whole_file(kind: libc::c_int) -> libc::flock {
    // SAFETY: flock is plain data for which zero is a value: from the start (SEEK_SET, 0) to the end (length 0).
    let mut range: libc::flock = unsafe { std::mem::zeroed() };
    range.l_type = kind as libc::c_short;
    range
}

fn lock(file: &OwnedFd) -> io::Result<()> {
    let range = whole_file(libc::F_WRLCK);
    // SAFETY: the descriptor is open and the range a live local that the kernel only reads.
    let refused = unsafe { libc::fcntl(file.as_raw_fd(), libc::F_SETLK, &range) } != 0;
    if refused { Err(io::Error::last_os_error()) } else { Ok(()) }
}

/// Who holds the lock: `None` when it has become free, `Some(None)` when the kernel does not show the process here.
fn holder(file: &OwnedFd) -> Option<Option<u32>> {
    let mut range = whole_file(libc::F_WRLCK);
    // SAFETY: the descriptor is open and the range a live local that the kernel fills.
    let asked = unsafe { libc::fcntl(file.as_raw_fd(), libc::F_GETLK, &mut range) } == 0;
    if asked && range.l_type == libc::F_UNLCK as libc::c_short {
        return None;
    }
    Some(u32::try_from(range.l_pid).ok().filter(|&pid| asked && pid != 0))
}

fn system(path: &str, doing: &'static str, error: Errno) -> ChannelError {
    ChannelError::System { path: path.into(), doing, source: error.into() }
}
