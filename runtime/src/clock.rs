//! The live host's clock: CLOCK_MONOTONIC, the same for all processes of the machine. The only clock of the project.

use crate::time::Time;
use rustix::time::{ClockId, Timespec, clock_gettime};

/// Now, on CLOCK_MONOTONIC.
pub fn now() -> Time {
    let now = clock_gettime(ClockId::Monotonic);
    Time::from_nanos(now.tv_sec as u64 * 1_000_000_000 + now.tv_nsec as u64)
}

/// Sleeps until `time`. For hosts and tools; a node waits on its triggers.
pub fn sleep_until(time: Time) {
    let request =
        Timespec { tv_sec: (time.nanos() / 1_000_000_000) as i64, tv_nsec: (time.nanos() % 1_000_000_000) as i64 };
    while let Err(rustix::io::Errno::INTR) = rustix::thread::clock_nanosleep_absolute(ClockId::Monotonic, &request) {}
}

/// Sleeps for `seconds`. For hosts and tools.
pub fn sleep_s(seconds: f64) {
    sleep_until(now().after_s(seconds));
}

/// Seconds since the Unix epoch, for file names and logs of people; never for control.
pub fn wall_seconds() -> f64 {
    let now = clock_gettime(ClockId::Realtime);
    now.tv_sec as f64 + now.tv_nsec as f64 * 1e-9
}
