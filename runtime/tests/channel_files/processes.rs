//! Writers and readers in processes of their own: killed, stopped, and hit by bus errors.

use std::io::{BufRead, BufReader};
use std::os::unix::process::ExitStatusExt;
use std::path::Path;
use std::process::{Child, ChildStderr, Command, Stdio};

use runtime::channel::{ChannelError, Claim, PrivateWord, Tree, Waiter};

use super::{Ground, PATH, geometry, now_ns, read};

const ROLE: &str = "SINEW_FILES_ROLE";
pub const ROOT: &str = "SINEW_FILES_ROOT";

/// This test program again, as the process that plays `role`: one of its tests, by its path.
pub fn command(role: &str, root: &Path) -> Command {
    let mut command = Command::new(std::env::current_exe().unwrap());
    command.args(["--exact", role, "--nocapture", "--test-threads=1"]).env(ROLE, role).env(ROOT, root);
    command.env("RUST_BACKTRACE", "0").stdout(Stdio::null()).stderr(Stdio::piped());
    command
}

fn start(role: &str, root: &Path) -> (Child, BufReader<ChildStderr>) {
    let mut child = command(role, root).spawn().unwrap();
    let told = BufReader::new(child.stderr.take().unwrap());
    (child, told)
}

fn line(from: &mut BufReader<ChildStderr>) -> String {
    let mut line = String::new();
    from.read_line(&mut line).unwrap();
    line.trim_end().to_owned()
}

/// The tree, where this process plays `mine`.
pub fn role(mine: &str) -> Option<Tree> {
    let playing = std::env::var(ROLE).is_ok_and(|role| role == mine);
    playing.then(|| Tree::shared(Path::new(&std::env::var_os(ROOT).unwrap())).unwrap())
}

#[test]
fn a_writer_in_another_process_is_named_and_its_death_frees_the_place() {
    let ground = Ground::new();
    let (mut child, mut told) = start("processes::holding_process", &ground.root);
    assert_eq!(line(&mut told), "holding");
    let error = ground.tree.writer(PATH, &geometry(), Claim::Continue).err().unwrap();
    assert!(matches!(error, ChannelError::Held { holder, .. } if holder == Some(child.id())), "{error}");
    assert!(error.to_string().contains(&format!("process {}", child.id())), "{error}");
    assert!(matches!(ground.tree.prepare(PATH, &geometry()), Ok(())));
    assert_eq!(ground.reader().writer_pid(), Some(child.id()));
    child.kill().unwrap();
    child.wait().unwrap();
    assert_eq!(ground.writer().generation(), 2);
}

#[test]
fn a_stopped_writer_that_was_fenced_off_finds_out_when_it_goes_on() {
    let ground = Ground::new();
    let (mut child, mut told) = start("processes::publishing_process", &ground.root);
    assert_eq!(line(&mut told), "publishing");
    let pid = rustix::process::Pid::from_raw(child.id() as i32).unwrap();
    rustix::process::kill_process(pid, rustix::process::Signal::STOP).unwrap();
    rustix::process::waitpid(Some(pid), rustix::process::WaitOptions::UNTRACED).unwrap();

    let mut writer = ground.tree.writer(PATH, &geometry(), Claim::Fence).unwrap();
    let reader = ground.reader();
    let (head, next) = (reader.head(), writer.next_sequence());
    assert!(head > 0 && next > head && read(&reader, head).is_ok());
    rustix::process::kill_process(pid, rustix::process::Signal::CONT).unwrap();
    assert_eq!(child.wait().unwrap().code(), Some(17), "it learned that it had lost its place");

    assert_eq!(reader.head(), head);
    writer.publish(1, &[9; 20], &[]);
    assert_eq!((read(&reader, next).unwrap().generation, reader.writer_pid()), (2, Some(std::process::id())));
}

#[test]
fn a_bus_error_elsewhere_still_ends_the_process() {
    let ground = Ground::new();
    ground.tree.prepare(PATH, &geometry()).unwrap();
    let (mut child, mut told) = start("processes::faulting_process", &ground.root);
    assert_eq!(line(&mut told), "faulting");
    assert_eq!(child.wait().unwrap().signal(), Some(libc::SIGBUS));
}

#[test]
fn a_bus_error_elsewhere_goes_to_the_handler_that_was_there_before() {
    let ground = Ground::new();
    ground.tree.prepare(PATH, &geometry()).unwrap();
    let (mut child, mut told) = start("processes::handling_process", &ground.root);
    assert_eq!(line(&mut told), "faulting");
    assert_eq!(child.wait().unwrap().code(), Some(42));
}

/// In a process of its own: becomes the writer and waits to be killed.
#[test]
fn holding_process() {
    if let Some(tree) = role("processes::holding_process") {
        let _writer = tree.writer(PATH, &geometry(), Claim::Continue).unwrap();
        eprintln!("holding");
        Waiter::new(&PrivateWord::new(), Vec::new()).unwrap().wait(Some(now_ns() + 60_000_000_000));
    }
}

/// In a process of its own: publishes until it learns that it lost its place.
#[test]
fn publishing_process() {
    if let Some(tree) = role("processes::publishing_process") {
        let mut writer = tree.writer(PATH, &geometry(), Claim::Continue).unwrap();
        writer.publish(1, &[1; 20], &[2; 12_000]);
        eprintln!("publishing");
        let end = now_ns() + 60_000_000_000;
        while now_ns() < end {
            if writer.publish(1, &[1; 20], &[2; 12_000]).lost {
                std::process::exit(17);
            }
        }
    }
}

/// In a process of its own: has rings mapped, and runs into a bus error of its own.
#[test]
fn faulting_process() {
    if let Some(tree) = role("processes::faulting_process") {
        let _reader = tree.reader(PATH, None).unwrap();
        touch_a_page_that_is_gone();
    }
}

/// The same in a program with a handler of its own.
#[test]
fn handling_process() {
    extern "C" fn leave(_: libc::c_int) {
        // SAFETY: _exit is async-signal-safe.
        unsafe { libc::_exit(42) }
    }
    if let Some(tree) = role("processes::handling_process") {
        let handler = leave as extern "C" fn(libc::c_int);
        // SAFETY: a handler of the right signature, which only calls what a handler may.
        unsafe { libc::signal(libc::SIGBUS, handler as *const () as libc::sighandler_t) };
        let _reader = tree.reader(PATH, None).unwrap();
        touch_a_page_that_is_gone();
    }
}

fn touch_a_page_that_is_gone() {
    let file = tempfile::tempfile().unwrap();
    file.set_len(4096).unwrap();
    // SAFETY: a fresh mapping that nothing else uses; reading it ends the process, which is what is wanted.
    unsafe {
        use rustix::mm::{MapFlags, ProtFlags};
        let map = rustix::mm::mmap(std::ptr::null_mut(), 4096, ProtFlags::READ, MapFlags::SHARED, &file, 0).unwrap();
        file.set_len(0).unwrap();
        eprintln!("faulting");
        std::ptr::read_volatile(map.cast::<u8>());
    }
}
