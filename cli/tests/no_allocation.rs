//! No built-in node allocates in `step`: counted over a whole robot in the simulated host, whose own way between two
//! steps allocates nothing either.
#![allow(clippy::unwrap_used, unsafe_code, reason = "tests; a counting allocator cannot be written without")]

use messages::{GotoGoal, Message, bytemuck};
use runtime::calls::LocalRequest;
use runtime::robot::{Embedded, Resources, Robot};
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

/// The robots that come along, and how long each is watched [s]. Together they hold every built-in node.
const ROBOTS: [(&str, Embedded, f64); 4] = [
    ("pioneer", sinew::built_in::PIONEER, 60.0),
    ("service", sinew::built_in::SERVICE, 20.0),
    ("laser", sinew::built_in::SERVICE_LASER, 10.0),
    ("jackal", sinew::built_in::JACKAL, 4.0),
];

#[test]
fn no_built_in_node_allocates_in_a_step() {
    let types = sinew::built_in::node_types(&[]);
    let mut used: Vec<&str> = Vec::new();
    let button = std::env::temp_dir().join(format!("sinew-button-{}", std::process::id()));
    std::fs::write(&button, "1").unwrap();
    for (name, files, seconds) in ROBOTS {
        let text = std::str::from_utf8(files[0].1).unwrap();
        // Every robot gets a button beside what it has: a file, as the kernel shows a line.
        let text = format!(
            "{text}\n[nodes.button]\ntype = \"estop_line\"\nperiod_ms = 20\nconfig = {{ file = {:?} }}\n",
            button.display().to_string()
        );
        // What no robot that comes along wires yet.
        let text = match name {
            "laser" => format!(
                "{text}[nodes.checked]\ntype = \"cross_check\"\ntrigger = \"rangers\"\n\
                 reads.rangers = [\"/drivers/laser/ranges\", \"/drivers/base/sonar\"]\n"
            ),
            "service" => format!(
                "{text}[nodes.near]\ntype = \"ranges\"\ntrigger = \"ranger\"\nreads.ranger = \"/drivers/base/sonar\"\n\
                 [nodes.recall]\ntype = \"recall\"\ntrigger = \"scan\"\nreads.scan = \"/perception/near/ranges\"\n\
                 reads.odometry = \"/perception/odometry/pose\"\n"
            ),
            // A governor that decides now and then.
            "pioneer" => format!(
                "{text}[nodes.governor]\ntype = \"governor\"\nperiod_ms = 50\nreads.motion = \"/motion/drive/state\"\n\
                 config.rules = [{{ when = \"danger > 0.3\", mode = \"default\", dwell_s = 0.1 }}, \
                 {{ when = \"always\", mode = \"default\", dwell_s = 0.1 }}]\n"
            ),
            _ => text,
        };
        let robot = Robot::parse(&text, name, Resources::Embedded(files), &types).unwrap();
        used.extend(robot.nodes.iter().map(|node| node.kind.name));
        let mut host = SimulatedHost::new(&robot, 5, Time::ZERO).unwrap();
        host.run_until(Time::from_seconds(3.0));
        send_off(&mut host, &robot);
        host.run_until(Time::from_seconds(5.0));
        let before = COUNT.load(Ordering::Relaxed);
        assert!(before > 0, "the allocator counts");
        let steps_of = |host: &SimulatedHost| -> u64 {
            (0..robot.nodes.len()).map(|index| host.statistics(index).unwrap().steps).sum()
        };
        let mut by_node = vec![0; robot.nodes.len()];
        let mut counted = COUNT.load(Ordering::Relaxed);
        while let Some(stepped) = host.step_until(Time::from_seconds(5.0 + seconds)) {
            let count = COUNT.load(Ordering::Relaxed);
            by_node[stepped.node] += count - counted;
            counted = count;
        }
        let steps = steps_of(&host);
        assert!(steps > 1000, "{name}: {steps} steps only");
        let guilty: Vec<_> = robot.nodes.iter().map(|node| node.path()).zip(by_node).filter(|(_, n)| *n > 0).collect();
        assert!(guilty.is_empty(), "{name}: allocations in {steps} steps: {guilty:?}");
    }
    std::fs::remove_file(&button).unwrap();
    for kind in &types {
        assert!(used.contains(&kind.name), "no robot of this test has {}: add it, or test it elsewhere", kind.name);
    }
}

/// Gives a goal to every node that takes one; nobody waits for its end.
fn send_off(host: &mut SimulatedHost, robot: &Robot) {
    let goal = GotoGoal { x_m: 8.0, y_m: 0.5, heading_rad: f64::NAN, tolerance_m: 0.0 };
    for node in robot.nodes.iter().filter(|node| ["goto", "follow_gap"].contains(&node.kind.name)) {
        let deadline = host.now().after_s(1.0);
        host.call(&LocalRequest {
            path: &node.path(),
            command: "send",
            layout_hash: GotoGoal::layout_hash(),
            body: bytemuck::bytes_of(&goal),
            priority: 128,
            deadline,
        });
    }
}
