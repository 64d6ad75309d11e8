//! No built-in node allocates in `step`: counted over a whole robot in the simulated host, whose own way between two
//! steps allocates nothing either.
#![allow(clippy::unwrap_used, unsafe_code, reason = "tests; a counting allocator cannot be written without")]

use runtime::robot::{Resources, Robot};
use runtime::{SimulatedHost, Time};
use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicU64, Ordering};

struct Counting;

static COUNT: AtomicU64 = AtomicU64::new(0);

// SAFETY: every call goes on to the system's allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        COUNT.fetch_add(1, Ordering::Relaxed);
        // SAFETY: the caller's promise, passed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        COUNT.fetch_add(1, Ordering::Relaxed);
        // SAFETY: the caller's promise, passed on.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

#[test]
fn no_built_in_node_allocates_in_a_step() {
    let types = sinew::built_in::node_types(&[]);
    let (_, text) = sinew::built_in::PIONEER[0];
    let resources = Resources::Embedded(sinew::built_in::PIONEER);
    let robot = Robot::parse(std::str::from_utf8(text).unwrap(), "robot.toml", resources, &types).unwrap();
    let used: Vec<&str> = robot.nodes.iter().map(|node| node.kind.name).collect();
    for kind in &types {
        assert!(used.contains(&kind.name), "the robot of this test has no {}: add it, or test it elsewhere", kind.name);
    }
    let mut host = SimulatedHost::new(&robot, 5, Time::ZERO).unwrap();
    host.run_until(Time::from_seconds(5.0));
    let before = COUNT.load(Ordering::Relaxed);
    assert!(before > 0, "the allocator counts");
    host.run_until(Time::from_seconds(65.0));
    let steps: u64 = (0..robot.nodes.len()).map(|index| host.statistics(index).unwrap().steps).sum();
    assert!(steps > 5000, "{steps} steps only");
    assert_eq!(COUNT.load(Ordering::Relaxed) - before, 0, "allocations in {steps} steps of {used:?}");
}
