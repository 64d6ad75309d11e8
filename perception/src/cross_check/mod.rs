//! Rangers that see the same are cross-checked: one that disagrees is named and left out.
//!
//! Reads `rangers` (a set, each in the body frame); writes `ranges` (the newest sample of the most trusted ranger that is
//! not left out, as that wrote it) and `verdict` (who is left out and why, with every comparison). Who compares with whom,
//! and who is meant, is [`judge`]'s affair. When all are silent or left out nothing is written, and readers' own ages tell.
//!
//! *What this does not do*: among two that disagree the less trusted is left out of `ranges`, which may be the one that is
//! right. So motion goes on reading the set itself, where the nearest thing counts, unless a third ranger decides.
//!
//! ```toml
//! [nodes.rangers]
//! type = "cross_check"
//! trigger = "rangers"
//! deadline_ms = 20
//! priority = 61
//! reads.rangers = ["/drivers/laser/ranges", "/drivers/rear/ranges", "/drivers/base/sonar"]
//! config = { trust = ["/drivers/laser/ranges", "/drivers/rear/ranges"] }
//! ```

mod config;
pub mod judge;

pub use config::CrossCheckConfig;

use judge::{Judge, MOST, Profile};
use messages::{Beam, RangerVerdict, Ranges, path_number};
use runtime::{Fault, Layer, Node, OpenError, Ports, Set, Time, Writer};
use std::fmt::Write;

/// Longest path that is named in full [byte].
const LONGEST_PATH: usize = 96;
/// Longest verdict in words [byte].
const LONGEST_WORDS: usize = 512;

/// One ranger, at its place in the order of trust.
struct Ranger {
    path: String,
    number: u32,
    head: Ranges,
    beams: Vec<Beam>,
    stamp: Time,
    profile: Profile,
}

/// The node.
pub struct CrossCheck {
    rangers: Set<Ranges>,
    out: Writer<Ranges>,
    verdict: Writer<RangerVerdict>,
    /// The rangers that were seen so far, the most trusted first, then the others as they came.
    known: Vec<Ranger>,
    count: usize,
    judge: Judge,
    words: String,
    /// What was written last: from whom, and its stamp.
    written: (u32, Time),
    config: CrossCheckConfig,
}

impl Node for CrossCheck {
    const TYPE: &'static str = "cross_check";
    const LAYER: Layer = Layer::Perception;
    type Config = CrossCheckConfig;

    fn open(ports: &mut Ports, config: CrossCheckConfig) -> Result<CrossCheck, OpenError> {
        config.check().map_err(OpenError::config)?;
        let empty = |_| Ranger {
            path: String::with_capacity(LONGEST_PATH),
            number: 0,
            head: Ranges::default(),
            beams: Vec::with_capacity(config.most_beams),
            stamp: Time::ZERO,
            profile: Profile::default(),
        };
        let mut known: Vec<Ranger> = (0..MOST).map(empty).collect();
        for (ranger, path) in known.iter_mut().zip(&config.trust) {
            ranger.path.push_str(path);
            ranger.number = path_number(path);
        }
        Ok(CrossCheck {
            rangers: ports.set("rangers")?,
            out: ports.writer_with_tail("ranges", config.most_beams)?,
            verdict: ports.writer_with_tail("verdict", LONGEST_WORDS)?,
            count: config.trust.len(),
            known,
            judge: Judge::default(),
            words: String::with_capacity(LONGEST_WORDS),
            written: (0, Time::ZERO),
            config,
        })
    }

    fn step(&mut self, now: Time) -> Result<(), Fault> {
        let CrossCheck { rangers, known, count, config, .. } = self;
        rangers.each(|path, sample| {
            let number = path_number(path);
            let place = known[..*count].iter().position(|ranger| ranger.number == number);
            let Some(place) = place.or_else(|| newcomer(known, count, path, number)) else { return };
            let ranger = &mut known[place];
            if ranger.stamp == sample.stamp {
                return;
            }
            (ranger.stamp, ranger.head) = (sample.stamp, *sample.message);
            ranger.beams.clear();
            ranger.beams.extend(sample.tail.iter().take(config.most_beams));
            ranger.profile.take(&ranger.head, &ranger.beams);
        });
        let mut seen = [None; MOST];
        for (place, ranger) in self.known[..self.count].iter().enumerate() {
            let fresh = ranger.stamp > Time::ZERO && now.since(ranger.stamp) <= self.config.max_age_ms * 1e-3;
            seen[place] = fresh.then_some(&ranger.profile);
        }
        self.judge.judge(now, &seen[..self.count], &self.config);
        let used = (0..self.count).find(|&place| seen[place].is_some() && !self.judge.opinion(place).left_out);
        let fresh = seen.iter().flatten().count() as u32;
        if let Some(ranger) = used.map(|place| &self.known[place])
            && self.written != (ranger.number, ranger.stamp)
        {
            self.written = (ranger.number, ranger.stamp);
            self.out.write_with_tail(ranger.stamp, &ranger.head, &ranger.beams);
        }
        self.tell(now, used, fresh);
        Ok(())
    }
}

/// A place for a ranger that nobody has named.
fn newcomer(known: &mut [Ranger], count: &mut usize, path: &str, number: u32) -> Option<usize> {
    let ranger = known.get_mut(*count)?;
    ranger.number = number;
    // No longer than there is room for: a step does not ask for memory.
    let end = (0..=path.len().min(LONGEST_PATH)).rev().find(|&end| path.is_char_boundary(end)).unwrap_or(0);
    ranger.path.clear();
    ranger.path.push_str(&path[..end]);
    *count += 1;
    Some(*count - 1)
}

impl CrossCheck {
    /// Says who is left out and why.
    fn tell(&mut self, now: Time, used: Option<usize>, fresh: u32) {
        self.words.clear();
        let mut left_out = 0;
        for place in 0..self.count {
            let opinion = self.judge.opinion(place);
            if !opinion.left_out {
                continue;
            }
            left_out += 1;
            let path = &self.known[place].path;
            if self.words.len() + path.len() + 64 < LONGEST_WORDS {
                let comma = if self.words.is_empty() { "" } else { ", " };
                let (unequal, compared) = (opinion.unequal, opinion.compared);
                let _ = write!(self.words, "{comma}{path} is left out: {unequal} of {compared} comparisons unequal");
            }
        }
        let (compared, unequal) =
            used.map_or((0, 0), |place| (self.judge.opinion(place).compared, self.judge.opinion(place).unequal));
        let verdict = RangerVerdict {
            used: used.map_or(0, |place| self.known[place].number),
            rangers: fresh,
            left_out,
            compared,
            unequal,
            places: self.count as u32,
        };
        self.verdict.write_with_tail(now, &verdict, self.words.as_bytes());
    }
}
