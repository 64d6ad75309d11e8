//! A running robot before a person's eyes: a live map on a terminal, one line a second elsewhere, JSON for programs.
//!
//! Everything shown is read from the robot's channels, beside it, without anybody noticing; what the supervisor has to
//! say comes as [`News`].

mod farewell;
mod json;
mod line;
mod map;
mod news;
mod nodes;
pub mod panel;
mod screen;
mod source;
mod watch;

pub use farewell::farewell;
pub use map::{Extent, Map};
pub use news::News;
pub use screen::Terminal;
pub use watch::{Picture, Watch};

use crate::exit::Failure;
use crate::output::Out;
use crate::simulation::TrackPoint;
use nodes::Nodes;
use runtime::robot::Robot;
use runtime::{Time, clock};
use std::io::IsTerminal;
use std::path::Path;
use std::sync::mpsc::Receiver;
use supervisor::StopHandle;

/// In which way a run is shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Face {
    /// A live map.
    Screen,
    /// A line a second.
    Lines,
    /// A JSON object a second.
    Json,
}

impl Face {
    /// The map where standard output is a terminal that can show it, unless something else is wished.
    pub fn choose(json: bool, plain: bool) -> Face {
        let terminal = std::io::stdout().is_terminal() && std::io::stdin().is_terminal();
        let able = crossterm::terminal::size().is_ok_and(|(columns, rows)| columns >= 40 && rows >= 12);
        let dumb = std::env::var_os("TERM").is_none_or(|term| term == "dumb");
        match (json, plain) {
            (true, _) => Face::Json,
            (_, true) => Face::Lines,
            _ if terminal && able && !dumb => Face::Screen,
            _ => Face::Lines,
        }
    }
}

/// What was seen of a run.
#[derive(Debug, Clone, Default)]
pub struct Seen {
    /// Pose about every tenth of a second: the truth where the robot is simulated, else the odometry.
    pub track: Vec<TrackPoint>,
    /// Contacts by cause (drove, reversed blind, suffered); none are known without a simulator.
    pub contacts: Option<[u64; 3]>,
    /// Way travelled [m].
    pub distance_m: f64,
    /// Mean speed while moving [m/s].
    pub mean_speed_m_s: f64,
    /// Least clearance; infinite where it is not known [m].
    pub least_clearance_m: f64,
}

/// Readings are collected this often, so that no contact slips out of its ring [s].
const COLLECT_S: f64 = 0.05;

/// Shows the robot in `root` until its supervisor has ended (`over`). A person's wish to stop, and `until`, are passed on
/// to `stop`; a person's second wish ends the run at once.
pub fn show(
    face: Face,
    robot: &Robot,
    root: &Path,
    inbox: Receiver<News>,
    until: Option<Time>,
    stop: &StopHandle,
    over: &dyn Fn() -> bool,
) -> Result<Seen, Failure> {
    let mut watch = Watch::open(root, robot)?;
    let mut nodes = Nodes::new(robot);
    let mut run = Run { inbox, until, stop, over, stopping: false };
    match face {
        Face::Screen => screen::screen(&mut watch, &mut nodes, &mut run)?,
        Face::Lines => talk(&mut watch, &mut nodes, &mut run, &mut |out, picture, nodes, news| {
            news.iter().filter_map(news::sentence).try_for_each(|sentence| out.line(format!("         {sentence}")))?;
            picture.map_or(Ok(()), |picture| out.line(line::status(picture, nodes)))
        })?,
        Face::Json => talk(&mut watch, &mut nodes, &mut run, &mut |out, picture, nodes, news| {
            news.iter().filter_map(json::of_news).try_for_each(|value| out.json(&value))?;
            picture.map_or(Ok(()), |picture| out.json(&json::of_picture(picture, nodes)))
        })?,
    }
    Ok(watch.seen())
}

/// What belongs to a run beside what its channels tell.
struct Run<'a> {
    inbox: Receiver<News>,
    until: Option<Time>,
    stop: &'a StopHandle,
    over: &'a dyn Fn() -> bool,
    stopping: bool,
}

impl Run<'_> {
    /// News that have come since the last look; the time limit is looked after.
    fn news(&mut self, now: Time) -> Vec<News> {
        if !self.stopping && self.until.is_some_and(|until| now >= until) {
            self.stop();
        }
        self.inbox.try_iter().collect()
    }

    /// Asks for the ordered stop; a second time for the immediate one.
    fn stop(&mut self) {
        self.stop.stop();
        self.stopping = true;
    }

    fn over(&self) -> bool {
        (self.over)()
    }
}

type Say<'a> = &'a mut dyn FnMut(&mut Out, Option<&Picture>, &Nodes, &[News]) -> Result<(), Failure>;

/// Tells once a second, and news at once, until the run is over.
fn talk(watch: &mut Watch, nodes: &mut Nodes, run: &mut Run<'_>, say: Say<'_>) -> Result<(), Failure> {
    let mut out = Out::stdout();
    let mut next = clock::now().after_s(1.0);
    // A reader that has gone is no reason to leave a robot unattended: it is stopped in order.
    let mut broken = None;
    loop {
        let over = run.over();
        let now = clock::now();
        let news = run.news(now);
        nodes.hear(&news);
        watch.collect(now);
        let due = now >= next && !over;
        if now >= next {
            next = now.after_s(1.0);
            nodes.read(watch.tree(), now);
        }
        if broken.is_none() && (due || !news.is_empty()) {
            let said = say(&mut out, due.then(|| watch.picture()), nodes, &news).and_then(|()| out.flush());
            if let Err(failure) = said {
                run.stop();
                broken = Some(failure);
            }
        }
        if over {
            return broken.map_or(Ok(()), Err);
        }
        clock::sleep_s(COLLECT_S);
    }
}
