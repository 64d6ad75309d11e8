//! Records a running robot, from a process of its own: polls the rings, so that no node has to wake it, runs with no
//! priority, and stops by itself when the disk is full or the robot is gone. The robot never knows.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use runtime::channel::Tree;
use runtime::clock;

use crate::error::RecordError;
use crate::facts::Facts;
use crate::incidents::Incidents;
use crate::taps::Taps;
use crate::writer::RecordingWriter;

/// How often the rings are looked at: the shallowest hold several times as much [s].
pub(crate) const POLL_S: f64 = 0.02;
/// How often new channels, incidents and changes are looked for, and chunks are closed [s].
pub(crate) const LOOK_S: f64 = 0.5;

/// What to record, and for how long.
#[derive(Debug, Clone)]
pub struct Options {
    /// The robot's folder of channels.
    pub root: PathBuf,
    /// Where to.
    pub file: PathBuf,
    /// Paths, folders or patterns; all when empty.
    pub paths: Vec<String>,
    /// Stops after this time [s].
    pub length_s: Option<f64>,
    /// Wait for a robot that is only being started, and begin with its first sample.
    pub from_start: bool,
}

/// What was recorded.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Recorded {
    /// The file.
    pub file: PathBuf,
    /// How long [s].
    pub duration_s: f64,
    /// Channels.
    pub channels: usize,
    /// Samples.
    pub samples: u64,
    /// Samples that were overwritten before they could be read.
    pub lost: u64,
    /// Size of the file [byte].
    pub bytes: u64,
    /// Processor time that recording took [s].
    pub cpu_s: f64,
}

/// Asks for an end by SIGINT and SIGTERM. SIGXFSZ, which would kill, becomes an error of the write that it is about.
pub fn stop_by_signals() -> std::io::Result<Arc<AtomicBool>> {
    let stop = Arc::new(AtomicBool::new(false));
    signal_hook::flag::register(signal_hook::consts::SIGXFSZ, Arc::default())?;
    for signal in [signal_hook::consts::SIGINT, signal_hook::consts::SIGTERM] {
        signal_hook::flag::register(signal, stop.clone())?;
    }
    Ok(stop)
}

/// Records until the time is over, `stop` is set, or the robot is gone. `ready` runs when every channel that is there is
/// followed.
pub fn record(
    options: &Options,
    facts: &Facts,
    stop: &AtomicBool,
    ready: impl FnOnce(),
) -> Result<Recorded, RecordError> {
    let tree = Tree::shared(&options.root)?;
    let mut out = RecordingWriter::create(&options.file, facts)?;
    let begun = clock::now();
    let cpu_begun_s = cpu_s();
    let mut taps = Taps::new(tree, options.paths.clone());
    let from_s = if options.from_start { begun.seconds() - 60.0 } else { begun.seconds() };
    let mut incidents = Incidents::of(&facts.robot, from_s.max(run_since_s(&options.root)));
    let launch = options.root.join(".run/launch.json");
    let mut known_launch = std::fs::read_to_string(&launch).unwrap_or_default();
    taps.look_around(&mut out)?;
    taps.drain(&mut out)?;
    ready();
    let (mut poll, mut look) = (begun, begun);
    let mut known_losses = BTreeMap::new();
    loop {
        taps.drain(&mut out)?;
        let now = clock::now();
        let over = stop.load(Ordering::Relaxed) || options.length_s.is_some_and(|length| now.since(begun) >= length);
        if over || now.since(look) >= LOOK_S {
            look = now;
            taps.look_around(&mut out)?;
            for record in incidents.iter_mut().flat_map(Incidents::take) {
                out.incident(&record)?;
            }
            let text = std::fs::read_to_string(&launch).unwrap_or_default();
            if text != known_launch && !text.is_empty() {
                out.change(now.nanos(), &text)?;
                known_launch = text;
            }
            let losses = taps.losses();
            if losses != known_losses {
                out.losses(&losses)?;
                known_losses = losses;
            }
            // The second is up: what has come is safe from a crash of this process.
            out.flush()?;
            if over || !is_there(&options.root) {
                break;
            }
        }
        poll = poll.after_s(POLL_S).max(now);
        clock::sleep_until(poll);
    }
    taps.drain(&mut out)?;
    let losses = taps.losses();
    out.losses(&losses)?;
    Ok(Recorded {
        file: options.file.clone(),
        duration_s: clock::now().since(begun),
        channels: taps.channels(),
        samples: taps.samples(),
        lost: losses.values().sum(),
        bytes: out.finish()?,
        cpu_s: cpu_s() - cpu_begun_s,
    })
}

/// Whether the robot still has its folder of channels.
pub(crate) fn is_there(root: &Path) -> bool {
    root.is_dir()
}

/// When the robot's supervisor began, on its clock; the beginning of all time without one [s].
fn run_since_s(root: &Path) -> f64 {
    let since = supervisor::owner(root).map(|owner| owner.since_unix_s);
    since.map_or(0.0, |since| clock::now().seconds() - (clock::wall_seconds() - since))
}

/// Processor time of this process so far [s].
fn cpu_s() -> f64 {
    // Fields 14 and 15 behind the name, in ticks of 10 ms; see proc(5).
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let after_name = stat.rsplit_once(')').map_or("", |(_, rest)| rest);
    let ticks = |n: usize| after_name.split_whitespace().nth(n).and_then(|text| text.parse::<f64>().ok());
    (ticks(11).unwrap_or(0.0) + ticks(12).unwrap_or(0.0)) / 100.0
}
