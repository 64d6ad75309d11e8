//! The labelled legs: scans of a real laser and where people's legs are in them.

use super::runs::{Contestant, Way};
use crate::exit::Failure;
use messages::{Beam, Echo, SegmentShape, Twist};
use perception::place::Place;
use runtime::{Time, math};
use std::path::Path;
use std::process::Command;

/// Direction of the first beam, and spacing [rad].
const FIRST_RAD: f64 = -2.356_194;
const STEP_RAD: f64 = 0.006_135_92;
/// The laser's reach [m].
const REACH_M: f64 = 11.0;
/// About the rate of the scans [Hz]; the file has no times.
const RATE_HZ: f64 = 7.5;
/// Noise of this laser, about [m].
const SIGMA_M: f64 = 0.01;
/// What has fewer points is no leg.
const LEAST_POINTS: u32 = 3;

/// One scan with its labels.
#[derive(Debug, Clone, PartialEq)]
pub struct Labelled {
    sequence: u64,
    index: u64,
    pub legs: Vec<(f64, f64)>,
    /// The beams.
    pub beams: Vec<Beam>,
}

/// Legs found, of all that are labelled.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Recall {
    labels: u64,
    segments: u64,
    tracks: u64,
}

impl Recall {
    /// Share of labels at which a segment is a thing.
    pub fn in_segments(&self) -> f64 {
        self.segments as f64 / self.labels.max(1) as f64
    }

    /// Share of labels at which a confirmed track was seen.
    pub fn in_tracks(&self) -> f64 {
        self.tracks as f64 / self.labels.max(1) as f64
    }
}

/// Number of labels.
pub fn labels(scans: &[Labelled]) -> usize {
    scans.iter().map(|scan| scan.legs.len()).sum()
}

/// Reads `labelled.txt.gz`, with the help of the program gzip.
pub fn read(file: &Path) -> Result<Vec<Labelled>, Failure> {
    let text = unpack(file)?;
    let scans: Option<Vec<Labelled>> = text.lines().map(parse).collect();
    scans.ok_or_else(|| Failure::from(format!("{}: a line is not \"sequence index n x y … | ranges\"", file.display())))
}

/// The text of a `.gz` file.
pub fn unpack(file: &Path) -> Result<String, Failure> {
    let unpacked = Command::new("gzip").arg("-dc").arg(file).output();
    let unpacked = unpacked.map_err(|e| Failure::from(format!("cannot run gzip: {e}")))?;
    if !unpacked.status.success() {
        let reason = String::from_utf8_lossy(&unpacked.stderr).trim().to_owned();
        return Err(Failure::from(format!("cannot read {}: {reason}", file.display())));
    }
    String::from_utf8(unpacked.stdout).map_err(|_| Failure::from(format!("{} is no text", file.display())))
}

fn parse(line: &str) -> Option<Labelled> {
    let (head, ranges) = line.split_once('|')?;
    let mut numbers = head.split_whitespace();
    let (sequence, index) = (numbers.next()?.parse().ok()?, numbers.next()?.parse().ok()?);
    let count: usize = numbers.next()?.parse().ok()?;
    let places: Vec<f64> = numbers.map_while(|n| n.parse().ok()).collect();
    let legs: Vec<(f64, f64)> = places.chunks_exact(2).map(|xy| (xy[0], xy[1])).collect();
    let ranges: Vec<f64> = ranges.split_whitespace().map_while(|n| n.parse().ok()).collect();
    (legs.len() == count).then(|| Labelled { sequence, index, legs, beams: beams(&ranges, FIRST_RAD, REACH_M) })
}

/// Ranges of a laser like this one as beams.
pub fn beams(ranges: &[f64], first_rad: f64, reach_m: f64) -> Vec<Beam> {
    let beam = |(k, &range_m): (usize, &f64)| Beam {
        bearing_rad: (first_rad + STEP_RAD * k as f64) as f32,
        range_m: if range_m.is_finite() { range_m as f32 } else { 0.0 },
        echo: match range_m {
            r if r >= reach_m => Echo::Clear,
            r if r > 0.02 => Echo::Value,
            _ => Echo::Fault,
        } as u32,
        ..Beam::default()
    };
    ranges.iter().enumerate().map(beam).collect()
}

/// How many of the legs `way` finds within `near_m`.
pub fn recall(scans: &[Labelled], way: Way, near_m: f64) -> Recall {
    let mut recall = Recall::default();
    let mut running: Option<(u64, Contestant)> = None;
    let (mut seen, place) = (Vec::new(), Place::new(0.0, 0.0, 0.0));
    for scan in scans {
        if running.as_ref().is_none_or(|(sequence, _)| *sequence != scan.sequence) {
            running = Some((scan.sequence, Contestant::new(way, SIGMA_M)));
        }
        let Some((_, contestant)) = &mut running else { continue };
        let now = Time::from_seconds(1.0 + scan.index as f64 / RATE_HZ);
        contestant.take(now, &scan.beams, &place, &Twist::default());
        contestant.seen(now, &mut seen);
        let segments = contestant.segmenter().segments().iter();
        let things: Vec<(f64, f64)> = segments
            .filter(|s| s.points >= LEAST_POINTS && s.shape != SegmentShape::Straight as u32)
            .map(|s| (s.centre_x_m, s.centre_y_m))
            .collect();
        let tracks: Vec<(f64, f64)> = seen.iter().filter(|t| t.now).map(|t| (t.x_m, t.y_m)).collect();
        recall.labels += scan.legs.len() as u64;
        recall.segments += matched(&scan.legs, &things, near_m);
        recall.tracks += matched(&scan.legs, &tracks, near_m);
    }
    recall
}

/// Pairs of places no farther apart than `near_m`, each used once, nearest first.
fn matched(legs: &[(f64, f64)], things: &[(f64, f64)], near_m: f64) -> u64 {
    let mut pairs = Vec::new();
    for (i, leg) in legs.iter().enumerate() {
        for (j, thing) in things.iter().enumerate() {
            let off_m = math::hypot(leg.0 - thing.0, leg.1 - thing.1);
            if off_m <= near_m {
                pairs.push((off_m, i, j));
            }
        }
    }
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (mut used, mut taken, mut count) = (vec![false; legs.len()], vec![false; things.len()], 0);
    for (_, i, j) in pairs {
        if !used[i] && !taken[j] {
            (used[i], taken[j]) = (true, true);
            count += 1;
        }
    }
    count
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_labelled_scan_is_read_with_its_legs_and_the_reason_for_every_missing_beam() {
        let scan = parse("4 45 2 1.5 0.25 2.0 -1.0 | 0.158 0.000 11.000 inf").unwrap();
        assert_eq!((scan.sequence, scan.index, scan.legs), (4, 45, vec![(1.5, 0.25), (2.0, -1.0)]));
        let echoes: Vec<u32> = scan.beams.iter().map(|beam| beam.echo).collect();
        assert_eq!(echoes, [Echo::Value, Echo::Fault, Echo::Clear, Echo::Clear].map(|echo| echo as u32));
        assert_eq!(parse("4 45 2 1.5 0.25 | 1.0"), None);
    }

    #[test]
    fn one_thing_cannot_be_two_legs() {
        assert_eq!(matched(&[(1.0, 0.0), (1.1, 0.0)], &[(1.05, 0.0)], 0.2), 1);
        assert_eq!(matched(&[(1.0, 0.0), (1.1, 0.0)], &[(1.05, 0.0), (1.2, 0.0)], 0.2), 2);
    }
}
