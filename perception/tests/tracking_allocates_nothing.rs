//! Taking a scan asks nothing of the allocator.
#![allow(unsafe_code, clippy::unwrap_used, reason = "a counting allocator; tests")]

use messages::{Beam, Echo, Twist};
use perception::place::Place;
use perception::tracks::config::{FilterKind, TracksConfig};
use perception::tracks::tracker::Tracker;
use runtime::{Time, math};
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

struct Counting;

thread_local! {
    static ASKED: Cell<u64> = const { Cell::new(0) };
}

// SAFETY: every call goes to the system's allocator unchanged; counting touches only a thread's own cell.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        let _ = ASKED.try_with(|asked| asked.set(asked.get() + 1));
        // SAFETY: the caller's promises are the system allocator's.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: as above.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// A crowd that comes, goes and hides, seen from a body that drives.
fn beams(t: f64, out: &mut Vec<Beam>) {
    out.clear();
    for k in 0..1081 {
        let bearing = -2.35 + 0.00435 * f64::from(k);
        let wave = math::sin(9.0 * bearing + t) + math::sin(31.0 * bearing - 2.0 * t);
        let echo = if wave > 1.6 { Echo::Clear } else { Echo::Value };
        let range = 3.0 + (2.0 * wave).round();
        out.push(Beam { bearing_rad: bearing as f32, range_m: range as f32, echo: echo as u32, ..Beam::default() });
    }
}

#[test]
fn scans_are_tracked_without_allocation() {
    for filter in [FilterKind::Polar, FilterKind::Cartesian] {
        let mut tracker = Tracker::new(TracksConfig { filter, ..TracksConfig::default() });
        let mut scan = Vec::with_capacity(1081);
        let mut most = 0;
        for k in 0..300 {
            let t = 0.05 * f64::from(k);
            beams(t, &mut scan);
            let place = Place::new(0.02 * f64::from(k), 0.0, 0.3 * math::sin(t));
            let before = ASKED.with(Cell::get);
            tracker.take(Time::from_seconds(1.0 + t), &scan, &place, &Twist::default());
            assert_eq!(ASKED.with(Cell::get), before, "scan {k} with {} tracks", tracker.tracks().len());
            most = most.max(tracker.tracks().len());
        }
        assert!(most > 5, "there was something to track: {most}");
    }
}
