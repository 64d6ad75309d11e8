//! The process tree on the side of the supervisor: what the root holds for it, and how it comes to be.
//!
//! `prepare` runs in the process that becomes the root: it claims the robot's folder, clears and fills it, makes the
//! memory and the sockets that must outlive every supervisor and guard, and becomes the root's program. The lock of the
//! claim stays with the process, and so with the root.

use std::convert::Infallible;
use std::ffi::{CString, OsString};
use std::fs;
use std::io;
use std::os::fd::{AsFd, OwnedFd};
use std::os::unix::ffi::OsStrExt;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};

use guard::latch::State;
use guard::{LatchPage, ROOT_WORD, StateFile, Table, fds, inherited, make_memfd, place};
use runtime::clock;
use rustix::net::{self, AddressFamily, SocketAddrUnix, SocketFlags, SocketType};
use rustix::process::{Pid, PidfdFlags, pidfd_open};

use crate::claim::Claim;
use crate::control::Control;
use crate::leftovers::{self, Leftovers};
use crate::plan::Plan;
use crate::remembered;
use crate::run::{SuperviseError, system};
use crate::saved::{Keeper, Saved};

/// How a tree begins.
#[derive(Debug, Clone)]
pub struct Seed {
    /// The program that contains root and guard: `sinew-guard`, or the robot's own.
    pub guard: PathBuf,
    /// The supervisor's program and arguments.
    pub supervisor: Vec<OsString>,
    /// Nothing moves before a person resumes.
    pub stand: bool,
}

/// What the root holds for a supervisor.
pub(crate) struct Tree {
    pub keeper: Keeper,
    pub saved: Option<Saved>,
    /// What was wrong with the state of the predecessor.
    pub flaw: Option<String>,
    pub latch: LatchPage,
    /// The latch's memory for nodes, read-only.
    pub latch_memory: OwnedFd,
    pub table: Table,
    pub table_memory: OwnedFd,
    pub front: OwnedFd,
    /// A pidfd of the root.
    pub root: OwnedFd,
}

impl Tree {
    /// Adopts what the root holds; refused outside a tree.
    pub fn adopt() -> Result<(Tree, Control), SuperviseError> {
        let lost = |what: &'static str| system(what);
        let take =
            |number| inherited(number).map_err(lost("find the process tree; supervisors are started by `sinew run`"));
        let state = take(fds::STATE)?;
        let latch_memory = take(fds::LATCH)?;
        let table_memory = take(fds::TABLE)?;
        let control = Control::adopt(take(fds::CONTROL)?);
        let front = take(fds::FRONT)?;
        let root = take(fds::ROOT)?;
        let latch = LatchPage::map(&latch_memory).map_err(lost("map the stop latch"))?;
        let table = Table::map(&table_memory).map_err(lost("map the table of heartbeats"))?;
        let (keeper, saved, flaw) = Keeper::open(state).map_err(|error| SuperviseError::Fill(error.to_string()))?;
        let flags = rustix::fs::OFlags::RDONLY | rustix::fs::OFlags::CLOEXEC;
        let path = format!("/proc/self/fd/{}", fds::LATCH);
        let latch_memory = rustix::fs::open(path, flags, rustix::fs::Mode::empty()).unwrap_or(latch_memory);
        for descriptor in [&table_memory, &front, &root] {
            // Nodes get what is theirs under other numbers.
            rustix::io::fcntl_setfd(descriptor, rustix::io::FdFlags::CLOEXEC)
                .map_err(|e| lost("keep a descriptor")(e.into()))?;
        }
        Ok((Tree { keeper, saved, flaw, latch, latch_memory, table, table_memory, front, root }, control))
    }
}

/// Becomes the root of a new tree for `plan`; returns only why not. `front` is the connection to the program that started
/// this one, `fill` puts into the robot's folder what the nodes need to find.
pub fn prepare(
    plan: &Plan,
    seed: &Seed,
    front: OwnedFd,
    fill: impl FnOnce(&Path) -> Result<(), String>,
) -> Result<Infallible, SuperviseError> {
    if let Some(flaw) = plan.flaw() {
        return Err(SuperviseError::Plan(flaw));
    }
    let claim = Claim::take(&plan.root, &plan.robot)?;
    let found = leftovers::clear(&claim).map_err(system("remove what an earlier run left"))?;
    let failed = match make(plan, seed, &front, &claim, found.as_ref(), fill) {
        Ok(never) => match never {},
        Err(error) => error,
    };
    claim.release().map_err(system("remove the robot's folder"))?;
    Err(failed)
}

fn make(
    plan: &Plan,
    seed: &Seed,
    front: &OwnedFd,
    claim: &Claim,
    found: Option<&Leftovers>,
    fill: impl FnOnce(&Path) -> Result<(), String>,
) -> Result<Infallible, SuperviseError> {
    claim.announce()?;
    fill(claim.root()).map_err(SuperviseError::Fill)?;
    if let Some(ownership) = &plan.ownership {
        ownership.share_out(claim.root()).map_err(system("give the nodes' folders to their users"))?;
    }
    if let Some(found) = found {
        fs::write(claim.run_folder().join(FOUND), found.sentence()).map_err(system("write into the robot's folder"))?;
    }
    let state = StateFile::make().map_err(system("make the supervisor's memory"))?;
    let latch = make_memfd("sinew-latch", LatchPage::BYTES).map_err(system("make the latch's memory"))?;
    // Not even its owner opens it for writing once more: the guard has it open.
    rustix::fs::fchmod(&latch, rustix::fs::Mode::RUSR).map_err(|e| system("close the latch's memory")(e.into()))?;
    let table = make_memfd("sinew-table", Table::BYTES).map_err(system("make the table of heartbeats"))?;
    begin_latch(plan, seed, &latch).map_err(system("begin the stop latch"))?;
    let socket = claim.root().join(guard::SOCKET);
    let guard = listen(&socket).map_err(system("listen for the guard"))?;
    // Anyone may stop a robot.
    fs::set_permissions(&socket, fs::Permissions::from_mode(0o666))
        .map_err(system("open the guard's socket to all"))?;
    let control = Control::listen(claim.root()).map_err(system("listen for requests"))?;
    let own =
        Pid::from_raw(claim.owner().pid).ok_or_else(|| system("name this process")(io::ErrorKind::NotFound.into()))?;
    let root = pidfd_open(own, PidfdFlags::empty()).map_err(|error| system("watch the root")(error.into()))?;
    claim.outlive_exec().map_err(system("keep the lock"))?;
    let _ = rustix::process::setsid();
    quiet(plan.log_folder.as_deref()).map_err(system("open /dev/null"))?;
    for (descriptor, number) in [
        (state.as_fd(), fds::STATE),
        (latch.as_fd(), fds::LATCH),
        (table.as_fd(), fds::TABLE),
        (guard.as_fd(), fds::GUARD),
        (control.listener(), fds::CONTROL),
        (front.as_fd(), fds::FRONT),
        (root.as_fd(), fds::ROOT),
    ] {
        place(descriptor, number).map_err(system("place a descriptor"))?;
    }
    let text = |word: &std::ffi::OsStr| CString::new(word.as_bytes()).unwrap_or_default();
    let program = text(seed.guard.as_os_str());
    let mut arguments = vec![CString::from(c"sinew-root"), CString::new(ROOT_WORD).unwrap_or_default()];
    arguments.extend(seed.supervisor.iter().map(|word| text(word)));
    Err(system("become the root of the process tree")(guard::become_program(&program, &arguments)))
}

/// File of the run's folder with the sentence about what an earlier run left.
pub(crate) const FOUND: &str = "found";

/// A robot that was stopped when it was last seen stands, and says why.
fn begin_latch(plan: &Plan, seed: &Seed, memfd: &OwnedFd) -> io::Result<()> {
    let page = LatchPage::map_writable(memfd)?;
    let now_ns = clock::now().nanos();
    match plan.log_folder.as_deref().and_then(remembered::read) {
        Some(stop) => page.begin_stopped(stop.state(), &stop.sources(), now_ns),
        None if seed.stand => page.set(State::Armed, now_ns),
        None => {}
    }
    Ok(())
}

fn listen(path: &Path) -> io::Result<OwnedFd> {
    let address = SocketAddrUnix::new(path)?;
    let flags = SocketFlags::CLOEXEC | SocketFlags::NONBLOCK;
    let listener = net::socket_with(AddressFamily::UNIX, SocketType::SEQPACKET, flags, None)?;
    net::bind(&listener, &address)?;
    net::listen(&listener, 64)?;
    Ok(listener)
}

/// What the tree says goes to a file or nowhere, never to the terminal or the pipe of whoever started it.
fn quiet(folder: Option<&Path>) -> io::Result<()> {
    let null = fs::File::options().read(true).write(true).open("/dev/null")?;
    let log = folder.and_then(|folder| {
        fs::create_dir_all(folder).ok()?;
        fs::File::options().append(true).create(true).open(folder.join("supervisor.log")).ok()
    });
    let log = log.as_ref().unwrap_or(&null);
    for (descriptor, number) in [(&null, 0), (log, 1), (log, 2)] {
        place(descriptor.as_fd(), number)?;
    }
    Ok(())
}
