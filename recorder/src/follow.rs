//! Follows a robot's channels into any outlet, from a process of its own, until the robot is gone: what a live view does.

use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};

use runtime::channel::Tree;
use runtime::clock;

use crate::error::RecordError;
use crate::feed::{Feed, Outlet};
use crate::incidents::Incidents;
use crate::live::{LOOK_S, POLL_S, is_there};
use crate::taps::Taps;

/// What to follow.
#[derive(Debug, Clone)]
pub struct Options {
    /// The robot's folder of channels.
    pub root: PathBuf,
    /// The robot's name.
    pub robot: String,
    /// Paths, folders or patterns; all when empty.
    pub paths: Vec<String>,
}

/// What was followed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
pub struct Followed {
    /// Channels.
    pub channels: usize,
    /// Samples that were read.
    pub samples: u64,
    /// Samples that were overwritten before they could be read.
    pub lost: u64,
}

/// Follows until `stop` is set or the robot is gone. `each_round` runs after each look at the rings, with the feed.
pub fn follow<O: Outlet>(
    options: &Options,
    feed: &mut Feed<O>,
    stop: &AtomicBool,
    mut each_round: impl FnMut(&mut Taps, &mut Feed<O>) -> Result<(), O::Error>,
) -> Result<Followed, O::Error> {
    let tree = Tree::shared(&options.root).map_err(RecordError::from)?;
    let mut taps = Taps::new(tree, options.paths.clone()).without_history();
    let begun = clock::now();
    let mut incidents = Incidents::of(&options.robot, begun.seconds());
    let (mut poll, mut look) = (begun, begun.before_s(LOOK_S));
    while !stop.load(Ordering::Relaxed) {
        let now = clock::now();
        if now.since(look) >= LOOK_S {
            look = now;
            if !is_there(&options.root) {
                break;
            }
            taps.look_around(feed)?;
            for record in incidents.iter_mut().flat_map(Incidents::take) {
                feed.incident(&record)?;
            }
        }
        taps.drain(feed)?;
        each_round(&mut taps, feed)?;
        poll = poll.after_s(POLL_S).max(now);
        clock::sleep_until(poll);
    }
    Ok(Followed { channels: taps.channels(), samples: taps.samples(), lost: taps.losses().values().sum() })
}
