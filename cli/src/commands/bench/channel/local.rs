//! What the two ends of a channel cost by themselves: publishing while nobody waits, and reading the newest sample.

use super::sinew_channels::{geometry, parts};
use crate::commands::bench::timing::Times;
use crate::exit::Failure;
use runtime::channel::{Claim, SampleBuffer, Tree};
use runtime::clock;
use std::path::Path;

/// Payload [byte], names of its rows, times taken.
const SIZES: [(usize, &str, &str, usize); 3] = [
    (64, "publish_64", "latest_64", 100_000),
    (3 * 1024, "publish_3072", "latest_3072", 50_000),
    (230 * 1024, "publish_235520", "latest_235520", 5_000),
];
/// Takes after which the core rests for a moment.
const REST_EVERY: usize = 10_000;
/// That moment [s].
const REST_S: f64 = 0.002;

/// Times of publishing and of reading, and of the clock that took them.
pub fn measure(folder: &Path, part: f64) -> Result<Vec<(&'static str, usize, Times)>, Failure> {
    let tree = Tree::shared(&folder.join("channels"))?;
    let mut rows = Vec::new();
    for (size, publish, latest, count) in SIZES {
        let count = ((count as f64 * part) as usize).max(100);
        let path = format!("/bench/{publish}/payload");
        let mut writer = tree.writer(&path, &geometry(size), Claim::Continue)?;
        let reader = tree.reader(&path, None)?;
        let mut buffer = SampleBuffer::new(reader.geometry());
        let payload = vec![0x5A; size];
        let (fixed, tail) = parts(&payload);
        let (mut published, mut read) = (Times::with_room_for(count), Times::with_room_for(count));
        for k in 0..count {
            let begin = clock::now();
            let done = writer.publish(begin.nanos(), fixed, tail);
            let between = clock::now();
            let sample = reader.read(reader.head(), &mut buffer)?;
            let end = clock::now();
            if sample.sequence != done.sequence {
                return Err("the newest sample is not the one just published".into());
            }
            published.push(begin, between);
            read.push(between, end);
            if k % REST_EVERY == REST_EVERY - 1 {
                clock::sleep_s(REST_S);
            }
        }
        rows.push((publish, size, published));
        rows.push((latest, size, read));
    }
    let mut clock_times = Times::with_room_for(REST_EVERY);
    for _ in 0..REST_EVERY {
        let begin = clock::now();
        clock_times.push(begin, clock::now());
    }
    rows.push(("clock", 0, clock_times));
    Ok(rows)
}
