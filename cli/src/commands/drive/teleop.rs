//! The action `teleop`: a writer of /actions/teleop/proposal, the one way from the keys to the wheels.
//!
//! The coordinator reads the typed set `/actions/*/proposal`; this ring is one more member of it, for as long as it is
//! there. A thread writes a proposal every [`PERIOD_S`], whatever the screen or the terminal does: the wish while it
//! counts, otherwise to stand. Its urgency is 1 (must), so the robot's other actions do not count beside it on these axes;
//! their caps still do, and so do motion's limits and stop zones. A proposal is valid for [`VALID_S`]: if this process
//! is killed, the robot's own actions go on after that.

use crate::exit::{FAILED, Failure};
use messages::bytemuck::bytes_of;
use messages::{Axis, Message, Proposal};
use runtime::channel::{ChannelError, Claim, Geometry, RawWriter, Tree};
use runtime::{Time, clock};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;

/// The one path that it writes.
pub const PATH: &str = "/actions/teleop/proposal";
/// Time between two proposals [s].
const PERIOD_S: f64 = 0.05;
/// How long a proposal counts [s].
const VALID_S: f64 = 0.3;
/// Samples of history.
const DEPTH: usize = 64;

/// What the person wants, until when.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Wish {
    /// Ahead [m/s].
    pub forward_m_s: f64,
    /// Counter-clockwise [rad/s].
    pub turn_rad_s: f64,
    /// Afterwards the robot is to stand.
    pub until: Time,
}

/// The writing thread. Dropping it removes the ring: the robot's own actions go on.
pub struct Teleop {
    wish: Arc<Mutex<Wish>>,
    stop: Arc<AtomicBool>,
    lost: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
    tree: Tree,
}

impl Teleop {
    /// Becomes the writer of [`PATH`]; from now on the robot stands until it is told otherwise.
    pub fn start(tree: &Tree) -> Result<Teleop, Failure> {
        let writer = open(tree).map_err(|e| match e {
            ChannelError::Held { holder: Some(pid), .. } => {
                Failure::new(FAILED, format!("somebody drives this robot already, process {pid}: only one can"))
            }
            e => Failure::from(e),
        })?;
        let (wish, stop, lost) = (Arc::new(Mutex::new(Wish::default())), Arc::default(), Arc::default());
        let thread = std::thread::Builder::new().name("teleop".into()).spawn({
            let (wish, stop, lost) = (Arc::clone(&wish), Arc::clone(&stop), Arc::clone(&lost));
            move || write(writer, &wish, &stop, &lost)
        })?;
        Ok(Teleop { wish, stop, lost, thread: Some(thread), tree: tree.clone() })
    }

    /// Whether nobody can read the proposals any more: the robot was stopped, and perhaps started anew. A new ring
    /// would be made in a folder that its owner has cleared.
    pub fn is_lost(&self) -> bool {
        self.lost.load(Ordering::Acquire)
    }

    /// What the person wants from now on.
    pub fn wish(&self, wish: Wish) {
        *self.wish.lock().unwrap_or_else(PoisonError::into_inner) = wish;
    }
}

impl Drop for Teleop {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Release);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
        // What was lost is gone already, or somebody else's by now.
        if !self.is_lost() {
            let _ = self.tree.remove(PATH);
        }
    }
}

fn open(tree: &Tree) -> Result<RawWriter, ChannelError> {
    let schema = Proposal::schema();
    let geometry = Geometry {
        type_name: Proposal::NAME.into(),
        layout_hash: schema.hash(),
        schema: schema.to_text(),
        fixed_bytes: size_of::<Proposal>(),
        tail_element_bytes: 0,
        tail_capacity: 0,
        depth: DEPTH,
    };
    tree.writer(PATH, &geometry, Claim::Continue)
}

fn write(mut writer: RawWriter, wish: &Mutex<Wish>, stop: &AtomicBool, lost: &AtomicBool) {
    let mut next = clock::now();
    while !stop.load(Ordering::Acquire) {
        let now = clock::now();
        let proposal = proposal(*wish.lock().unwrap_or_else(PoisonError::into_inner), now);
        if writer.publish(now.nanos(), bytes_of(&proposal), &[]).lost {
            lost.store(true, Ordering::Release);
            return;
        }
        next = next.after_s(PERIOD_S).max(clock::now());
        clock::sleep_until(next);
    }
}

/// The proposal for a wish: what it says while it counts, otherwise to stand.
fn proposal(wish: Wish, now: Time) -> Proposal {
    let Wish { forward_m_s, turn_rad_s, .. } = if now < wish.until { wish } else { Wish::default() };
    Proposal {
        forward: Axis::exact(forward_m_s),
        sideways: Axis::NONE,
        turn: Axis::exact(turn_rad_s),
        urgency: 1.0,
        valid_for_s: VALID_S,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wish_counts_until_its_end_and_then_the_robot_stands() {
        let wish = Wish { forward_m_s: 0.2, turn_rad_s: -0.5, until: Time::from_seconds(5.0) };
        let before = proposal(wish, Time::from_seconds(4.9));
        assert_eq!((before.forward.value, before.turn.value, before.urgency), (0.2, -0.5, 1.0));
        let after = proposal(wish, Time::from_seconds(5.0));
        assert_eq!((after.forward, after.turn, after.urgency), (Axis::exact(0.0), Axis::exact(0.0), 1.0));
    }

    #[test]
    fn the_ring_is_there_while_somebody_drives_and_gone_afterwards() {
        let tree = Tree::local();
        let teleop = Teleop::start(&tree).unwrap();
        let ring = tree.reader(PATH, None).unwrap();
        while ring.head() < 2 {
            std::thread::yield_now();
        }
        assert_eq!(tree.members("/actions/*/proposal").unwrap(), [PATH]);
        drop(teleop);
        assert!(tree.members("/actions/*/proposal").unwrap().is_empty());
    }

    #[test]
    fn a_robot_that_was_stopped_is_not_given_a_new_ring() {
        let tree = Tree::local();
        let teleop = Teleop::start(&tree).unwrap();
        tree.remove(PATH).unwrap();
        while !teleop.is_lost() {
            std::thread::yield_now();
        }
        assert!(tree.list().unwrap().is_empty());
    }

    #[test]
    fn only_one_can_drive() {
        let tree = Tree::local();
        let _first = Teleop::start(&tree).unwrap();
        let refused = Teleop::start(&tree).err().unwrap();
        assert!(refused.message.contains("drives this robot already"), "{}", refused.message);
    }
}
