//! A minute of live wandering while somebody kills a random node process with SIGKILL every five seconds.
#![allow(clippy::unwrap_used, clippy::disallowed_methods, reason = "tests")]

use messages::{Truth, bytemuck};
use runtime::channel::{PrivateWord, RawReader, SampleBuffer, Tree, Waiter};
use runtime::{Time, clock};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

const LENGTH_S: f64 = 60.0;
const KILL_EVERY_S: f64 = 5.0;
/// Every node but the world: that one is the reality that the others live in, and dies with the test only.
const VICTIMS: [&str; 6] = [
    "/drivers/base",
    "/perception/odometry",
    "/actions/forward",
    "/actions/steer_clear",
    "/coordinator/arbiter",
    "/motion/drive",
];

/// Ends what it started, whatever the test says.
struct Run {
    child: Child,
    folder: PathBuf,
}

impl Drop for Run {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
        let _ = std::fs::remove_dir_all(&self.folder);
    }
}

fn truth_of(ring: &RawReader) -> Option<Truth> {
    let mut buffer = SampleBuffer::new(ring.geometry());
    ring.read(ring.head(), &mut buffer).ok()?;
    Some(*bytemuck::from_bytes(buffer.fixed()))
}

/// Waits for samples on `ring` until `good` is true; false at `end`.
fn wait_on(ring: &RawReader, end: Time, mut good: impl FnMut() -> bool) -> bool {
    let private = PrivateWord::new();
    let mut waiter = Waiter::new(&private, vec![ring.word()]).unwrap();
    loop {
        waiter.snapshot();
        if good() {
            return true;
        }
        if clock::now() >= end {
            return false;
        }
        waiter.wait(Some(end.nanos()));
    }
}

fn ring_when_there(root: &Path, path: &str, end: Time) -> Option<RawReader> {
    while clock::now() < end {
        if let Ok(ring) = Tree::shared(root).and_then(|tree| tree.reader(path, None)) {
            return Some(ring);
        }
        // Nothing to wait on yet: the folder itself is still being made.
        clock::sleep_s(0.02);
    }
    None
}

#[test]
fn the_robot_causes_no_contact_while_its_nodes_are_killed_and_every_node_comes_back() {
    let folder = PathBuf::from(format!("/dev/shm/sinew-test-chaos-{}", std::process::id()));
    let child = Command::new(env!("CARGO_BIN_EXE_sinew"))
        .args(["run", "--plain", "--seed", "3", "--svg", "none", "--name", "chaos"])
        .env("SINEW_SHM", &folder)
        .env("SINEW_STATE", folder.with_extension("state"))
        .stdout(Stdio::null())
        .stderr(Stdio::inherit())
        .spawn()
        .unwrap();
    let mut run = Run { child, folder: folder.clone() };
    let root = folder.join("chaos");
    let begin_by = clock::now().after_s(20.0);
    let truth = ring_when_there(&root, "/simulator/world/truth", begin_by).expect("the world comes up");
    let moving = || truth_of(&truth).is_some_and(|t| t.velocity.linear_x_m_s > 0.05);
    assert!(wait_on(&truth, begin_by, moving), "the robot begins to move");

    let begin = clock::now();
    // A fixed order of victims that looks random: xorshift from a fixed seed.
    let mut random = 0x2545_f491_4f6c_dd1d_u64;
    let mut kills = 0;
    while clock::now().since(begin) < LENGTH_S {
        random ^= random << 13;
        random ^= random >> 7;
        random ^= random << 17;
        let victim = VICTIMS[(random % VICTIMS.len() as u64) as usize];
        let next = begin.after_s(KILL_EVERY_S * f64::from(kills + 1));
        assert!(!wait_on(&truth, next, || false));
        let ring = ring_when_there(&root, &format!("{victim}/statistics"), clock::now().after_s(5.0)).unwrap();
        let generation = ring.generation();
        let pid = ring.writer_pid().and_then(|pid| rustix::process::Pid::from_raw(pid as i32)).unwrap();
        rustix::process::kill_process(pid, rustix::process::Signal::KILL).unwrap();
        kills += 1;
        // The motors stop, or the node is back: in any case it comes back.
        let back = wait_on(&truth, clock::now().after_s(20.0), || ring.generation() > generation);
        assert!(back, "{victim} is back after kill {kills}");
    }
    let last = truth_of(&truth).unwrap();
    let [drove, reversed, suffered] = last.contacts;
    eprintln!(
        "{kills} kills, {:.1} m, contacts: drove {drove}, reversed {reversed}, suffered {suffered}",
        last.distance_m
    );
    assert_eq!((drove, reversed), (0, 0), "contacts that the robot caused");
    assert!(last.distance_m > 3.0, "it went on driving: {:.1} m", last.distance_m);

    let supervisor = rustix::process::Pid::from_child(&run.child);
    rustix::process::kill_process(supervisor, rustix::process::Signal::INT).unwrap();
    assert!(run.child.wait().unwrap().success(), "an ordered stop after Ctrl-C");
    assert!(!root.exists(), "no file is left");
    let _ = std::fs::remove_dir_all(folder.with_extension("state"));
}
