//! A node that is killed in mid-call: its callers learn so at once, from the kernel, not from a timeout.

#![allow(clippy::unwrap_used, reason = "tests")]

mod calls_support;

use std::io::{BufRead, BufReader};
use std::process::{Child, Command, Stdio};

use calls_support::*;
use runtime::calls::{CallError, CallState, Caller, Loss};
use runtime::pump::PumpBuilder;

const ROOT: &str = "SINEW_TEST_ROOT";

/// Not a test: the node that the tests kill. It tells on its standard output what its step has been given, and then
/// stays in that step.
#[test]
#[ignore = "the process that the other tests start and kill"]
fn victim() {
    let Ok(root) = std::env::var(ROOT) else { return };
    let mut node = TestNode::start(root.as_ref());
    println!("listening");
    let request = node.arrivals.until(|| node.double.take());
    println!("taken {}", request.message.value);
    // In its step for good.
    loop {
        std::thread::park();
    }
}

/// The victim, and what it tells.
struct Victim(Child, std::io::Lines<BufReader<std::process::ChildStdout>>);

impl Victim {
    fn start(root: &std::path::Path) -> Victim {
        let mut child = Command::new(std::env::current_exe().unwrap())
            .args(["--exact", "victim", "--ignored", "--nocapture"])
            .env(ROOT, root)
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let lines = BufReader::new(child.stdout.take().unwrap()).lines();
        let mut victim = Victim(child, lines);
        victim.hear("listening");
        victim
    }

    fn hear(&mut self, word: &str) {
        // The test harness of the victim prints lines of its own.
        while !self.1.next().expect("the victim ended too early").unwrap().contains(word) {}
    }
}

impl Drop for Victim {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[test]
fn a_node_killed_in_mid_call_gives_its_caller_an_error_at_once() {
    let root = root();
    let mut victim = Victim::start(root.path());
    std::thread::scope(|scope| {
        let asked = scope.spawn(|| client(root.path()).call(&double(&Number { value: 4.0 }, 0)));
        victim.hear("taken 4");
        drop(victim);
        let error = asked.join().unwrap().unwrap_err();
        assert!(matches!(error, CallError::Died { .. }), "{error}");
    });
    // Its socket file is still there; a call says all the same that nobody runs, and a successor replaces it.
    assert!(root.path().join("tasks/mission/.calls").exists());
    let _victim = Victim::start(root.path());
    assert!(client(root.path()).describe().is_ok());
}

#[test]
fn a_calling_node_learns_of_the_death_within_its_steps() {
    let root = root();
    let mut victim = Victim::start(root.path());
    let mut builder = PumpBuilder::new("/actions/caller");
    let mut caller: Caller<Number, Number> = Caller::detached(format!("{NODE} double").parse().unwrap());
    builder.attach(&caller);
    let arrivals = Arrivals::of(&mut builder);
    let _pump = builder.spawn(root.path()).unwrap();
    caller.start(now(), &Number { value: 8.0 }, 0, 600.0);
    victim.hear("taken 8");
    assert_eq!(caller.poll(now()), CallState::Pending);
    drop(victim);
    let state = arrivals.until(|| Some(caller.poll(now())).filter(|state| *state != CallState::Pending));
    assert_eq!(state, CallState::Lost(Loss::Died));
}

#[test]
fn a_stopped_process_is_not_taken_for_a_busy_node() {
    let root = root();
    let victim = Victim::start(root.path());
    let pid = rustix::process::Pid::from_child(&victim.0);
    rustix::process::kill_process(pid, rustix::process::Signal::STOP).unwrap();
    // Each of its threads has stopped when the kernel tells the parent.
    rustix::process::waitpid(Some(pid), rustix::process::WaitOptions::UNTRACED).unwrap();
    let number = Number::default();
    let request = runtime::calls::client::Request { timeout_s: 0.01, ..double(&number, 0) };
    let error = client(root.path()).call(&request).unwrap_err();
    assert!(matches!(&error, CallError::TimedOut { reason, .. } if reason.contains("process is stopped")), "{error}");
}

#[test]
fn the_end_of_a_watched_process_is_told_once() {
    let root = root();
    let victim = Victim::start(root.path());
    let pid = rustix::process::Pid::from_child(&victim.0);
    let process = rustix::process::pidfd_open(pid, rustix::process::PidfdFlags::empty()).unwrap();
    let (told, tells) = std::sync::mpsc::channel();
    let mut builder = PumpBuilder::new("/actions/orphan");
    builder.watch_process(process, move || told.send(()).unwrap());
    let _pump = builder.spawn(root.path()).unwrap();
    drop(victim);
    tells.recv_timeout(STUCK).expect("nobody told of the death");
}
