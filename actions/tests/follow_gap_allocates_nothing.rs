//! A step of the planner allocates nothing, with and without memory, among posts and movers.
#![allow(clippy::unwrap_used, unsafe_code, reason = "tests; an allocator that counts")]

use actions::follow_gap::FollowGapConfig;
use actions::follow_gap::planner::{Planner, Sight};
use actions::follow_gap::pose::{Point, Pose};
use actions::follow_gap::rollout::Mover;
use messages::{Beam, Echo};
use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicUsize, Ordering};

struct Counting;

static ALLOCATIONS: AtomicUsize = AtomicUsize::new(0);

// SAFETY: hands everything on to the system's allocator.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.fetch_add(1, Ordering::Relaxed);
        // SAFETY: the caller's promise is handed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the caller's promise is handed on.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static COUNTING: Counting = Counting;

#[test]
fn a_step_allocates_nothing_however_much_is_around() {
    let body = runtime::Body { max_forward_m_s: 2.0, max_turn_rad_s: 2.5, ..runtime::Body::default() };
    let beams: Vec<Beam> = (0..720)
        .map(|k| Beam {
            bearing_rad: (-135.0 + 0.375 * k as f32).to_radians(),
            range_m: if k % 90 < 30 { 1.5 } else { 6.0 + 0.01 * k as f32 },
            echo: Echo::Value as u32,
            ..Beam::default()
        })
        .collect();
    let movers: Vec<Mover> = (0..40)
        .map(|id| Mover {
            id,
            seen: true,
            place: Point::new(2.0 + 0.1 * id as f64, 1.0),
            velocity: Point::new(0.0, -0.8),
            radius_m: 0.3,
        })
        .collect();
    for memory_s in [20.0, 0.0] {
        let setup = FollowGapConfig { memory_s, ..FollowGapConfig::default() }.setup(&body);
        let mut planner = Planner::new(setup);
        let before = ALLOCATIONS.load(Ordering::Relaxed);
        for step in 0..50 {
            let pose = Pose::new(0.05 * f64::from(step), 0.0, 0.01 * f64::from(step));
            let wish = planner.step(&Sight {
                pose,
                velocity: (1.0, 0.1),
                scan_pose: pose,
                beams: &beams,
                movers: &movers,
                goal: Point::new(20.0, 3.0),
                tolerance_m: 0.3,
                time_s: 0.02 * f64::from(step),
            });
            assert!(wish.forward_m_s.is_finite());
        }
        assert_eq!(ALLOCATIONS.load(Ordering::Relaxed) - before, 0, "memory_s = {memory_s}");
    }
}
