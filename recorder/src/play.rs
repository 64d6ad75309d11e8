//! A recording's paths come alive: its samples go into rings under a robot's root, at the pace at which they were taken.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use runtime::channel::{ChannelError, Claim, RawSample, RawWriter, Tree};
use runtime::{Time, clock};

use crate::error::RecordingError;
use crate::pace::{Ask, Pace, Turn};
use crate::reader::{Item, Recording};

/// How to play.
#[derive(Debug, Clone)]
pub struct Options {
    /// The recording.
    pub file: PathBuf,
    /// The folder of channels to play into.
    pub root: PathBuf,
    /// Times as fast as it was.
    pub rate: f64,
    /// Begins this far into it [s].
    pub from_s: f64,
    /// Ends this far into it [s].
    pub until_s: f64,
    /// Begins again at its end.
    pub looped: bool,
}

/// Why it cannot be played.
#[derive(Debug, thiserror::Error)]
pub enum PlayError {
    /// The file cannot be read.
    #[error(transparent)]
    Read(#[from] RecordingError),
    /// A path cannot be had: a robot of this name runs, perhaps.
    #[error("{0}\nA recording is played under its robot's name; give another with --name.")]
    Channels(#[from] ChannelError),
    /// There is nothing in it.
    #[error("{file} holds no sample from {from_s} s on: it is {duration_s:.1} s long")]
    Nothing {
        /// The file.
        file: PathBuf,
        /// Where playing was to begin [s].
        from_s: f64,
        /// Its length [s].
        duration_s: f64,
    },
}

/// What was played.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Played {
    /// Samples.
    pub samples: u64,
    /// Times through the recording, begun ones included.
    pub rounds: u64,
    /// How long [s].
    pub took_s: f64,
}

/// A sample that waits for its time.
struct Waiting {
    at_ns: u64,
    path: usize,
    fixed: Vec<u8>,
    tail: Vec<u8>,
}

/// Samples are put in order over this much of the file [ns]: chunks hold a second, in any order.
const ORDER_NS: u64 = 2_000_000_000;

/// Plays until the end, or for ever where it is looped, or until `stop` is set. `asks` is asked now and then what the
/// viewer wants. Leaves nothing under the root.
pub fn play(
    options: &Options,
    stop: &AtomicBool,
    asks: &mut dyn FnMut() -> Option<Ask>,
    ready: impl FnOnce(),
) -> Result<Played, PlayError> {
    let (first_ns, last_ns) = span(&options.file)?;
    let from_ns = first_ns.saturating_add(Time::from_seconds(options.from_s).nanos());
    let until_ns = first_ns.saturating_add(Time::from_seconds(options.until_s).nanos());
    if from_ns > last_ns || first_ns > last_ns {
        let duration_s = last_ns.saturating_sub(first_ns) as f64 * 1e-9;
        return Err(PlayError::Nothing { file: options.file.clone(), from_s: options.from_s, duration_s });
    }
    let tree = Tree::shared(&options.root)?;
    let begun = clock::now();
    let mut stage = Stage { tree: tree.clone(), writers: Vec::new(), paths: BTreeMap::new(), samples: 0 };
    let opened = stage.open_all(&options.file);
    let mut rounds = 0;
    let played = opened.and_then(|()| {
        ready();
        let bounds = (first_ns, last_ns.min(until_ns));
        let mut pace = Pace::new(options.rate, bounds, from_ns, clock::now());
        rounds += 1;
        loop {
            match stage.round(&options.file, bounds.1, &mut pace, stop, asks)? {
                // Somebody wants to be elsewhere in the recording.
                Turn::Elsewhere => {}
                Turn::Stopped => return Ok(()),
                Turn::Go if options.looped => {
                    rounds += 1;
                    pace.seek(from_ns, clock::now());
                }
                Turn::Go => return Ok(()),
            }
        }
    });
    let samples = stage.samples;
    drop(stage);
    let cleared = tree.clear();
    played?;
    cleared?;
    Ok(Played { samples, rounds, took_s: clock::now().since(begun) })
}

/// First and last stamp of a recording [ns]; the first is the greater where there is none.
fn span(file: &Path) -> Result<(u64, u64), RecordingError> {
    let (mut first, mut last) = (u64::MAX, 0);
    Recording::open(file)?.read(&mut |item| {
        if let Item::Sample { sample, .. } = item {
            first = first.min(sample.stamp_ns);
            last = last.max(sample.stamp_ns);
        }
    })?;
    Ok((first, last))
}

/// The rings that are played into.
struct Stage {
    tree: Tree,
    writers: Vec<RawWriter>,
    paths: BTreeMap<String, usize>,
    samples: u64,
}

impl Stage {
    /// Every path is there before the first sample comes.
    fn open_all(&mut self, file: &Path) -> Result<(), PlayError> {
        let mut failed = None;
        Recording::open(file)?.read(&mut |item| {
            if let Item::Channel(channel) = item
                && let Some(own) = &channel.own
                && failed.is_none()
                && !self.paths.contains_key(&channel.topic)
            {
                match self.tree.writer(&channel.topic, &own.geometry, Claim::Continue) {
                    Ok(writer) => {
                        self.paths.insert(channel.topic.clone(), self.writers.len());
                        self.writers.push(writer);
                    }
                    Err(e) => failed = Some(e),
                }
            }
        })?;
        failed.map_or(Ok(()), |e| Err(e.into()))
    }

    /// Through the recording from where `pace` stands to the end, unless somebody wants to be elsewhere.
    fn round(
        &mut self,
        file: &Path,
        until_ns: u64,
        pace: &mut Pace,
        stop: &AtomicBool,
        asks: &mut dyn FnMut() -> Option<Ask>,
    ) -> Result<Turn, PlayError> {
        let from_ns = pace.at_ns();
        let mut waiting: Vec<Waiting> = Vec::new();
        let mut newest = 0;
        let mut turn = Turn::Go;
        let Stage { writers, paths, samples, .. } = self;
        let mut put = |waiting: &mut Vec<Waiting>, before_ns: u64| {
            waiting.sort_by_key(|sample| sample.at_ns);
            let count = waiting.partition_point(|sample| sample.at_ns <= before_ns);
            for sample in waiting.drain(..count) {
                match pace.wait(sample.at_ns, stop, asks) {
                    (Turn::Go, stamp) => writers[sample.path].publish(stamp.nanos(), &sample.fixed, &sample.tail),
                    (other, _) => return other,
                };
                *samples += 1;
            }
            Turn::Go
        };
        Recording::open(file)?.read_while(&mut |item| {
            let Item::Sample { channel, sample: RawSample { stamp_ns, .. }, fixed, tail } = item else { return true };
            let within = (from_ns..=until_ns).contains(&stamp_ns);
            let Some(path) = paths.get(&channel.topic).copied().filter(|_| within) else { return true };
            waiting.push(Waiting { at_ns: stamp_ns, path, fixed: fixed.to_vec(), tail: tail.to_vec() });
            if stamp_ns > newest + ORDER_NS / 2 {
                newest = stamp_ns;
                turn = put(&mut waiting, newest.saturating_sub(ORDER_NS));
            }
            turn == Turn::Go
        })?;
        if turn == Turn::Go {
            turn = put(&mut waiting, u64::MAX);
        }
        Ok(turn)
    }
}
