//! What a laser driver writes: `scan`, `ranges` and `state`.
//!
//! A scan whose beams all tell one and the same distance is none: its scanner is covered, or its electronics repeat a word.
//! Its beams say `fault`.

use super::Mount;
use messages::{Beam, Echo, LaserScan, LaserState, Link, Ranges, ScanBeam};
use runtime::{Fault, OpenError, Ports, Time, Writer};

/// More beams than any known scanner sends in one scan.
pub const MAX_BEAMS: usize = 2048;
/// Paths are written at least this often [s].
const REFRESH_S: f64 = 0.4;

/// So many beams that all tell the same distance are no room: none is round to the last digit about the scanner.
const BLIND_BEAMS: usize = 64;
const BLIND: Fault = Fault::new("every beam tells the same distance: the scanner is covered or broken");

/// Directions and times of the beams of a scan.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Sweep {
    /// Number of beams.
    pub beams: usize,
    /// Direction of the first one in the sensor's frame [rad].
    pub angle_min_rad: f64,
    /// From one beam to the next, counter-clockwise [rad].
    pub angle_increment_rad: f64,
    /// Time of one turn of the mirror [s].
    pub turn_s: f64,
    /// Turns that make a scan: beam k is taken in turn k modulo this.
    pub turns: usize,
    /// Time from a turn's first direction to the next beam's direction [s].
    pub step_s: f64,
    /// Shortest distance that can be reported [m].
    pub range_min_m: f64,
    /// Longest distance that can be reported [m].
    pub range_max_m: f64,
}

impl Sweep {
    /// When beam `index` is taken after the first one [s].
    pub fn delay_s(&self, index: usize) -> f64 {
        let turns = self.turns.max(1);
        (index % turns) as f64 * self.turn_s + index as f64 * self.step_s
    }

    /// Time from the first beam to the newest one [s].
    pub fn span_s(&self) -> f64 {
        let turns = self.turns.max(1);
        (self.beams.saturating_sub(turns)..self.beams).map(|index| self.delay_s(index)).fold(0.0, f64::max)
    }

    /// Time from one scan to the next [s].
    pub fn scan_s(&self) -> f64 {
        self.turn_s * self.turns.max(1) as f64
    }
}

/// One measured scan.
#[derive(Debug, Clone, Copy)]
pub struct News<'a> {
    /// When the first beam was taken.
    pub first: Time,
    /// The same by the sensor's own clock; NaN without one [s].
    pub sensor_time_s: f64,
    /// All beams in order.
    pub beams: &'a [ScanBeam],
}

/// The written paths. Stamps never go back.
pub struct Paths {
    scan: Writer<LaserScan>,
    ranges: Writer<Ranges>,
    state: Writer<LaserState>,
    mount: Mount,
    sweep: Sweep,
    bearings_rad: Vec<f32>,
    ages_s: Vec<f32>,
    missing: Vec<ScanBeam>,
    beams: Vec<Beam>,
    span_s: f64,
    /// Newest stamps written.
    scan_written: Time,
    written: Time,
    has_news: bool,
    is_blind: bool,
    said: Option<(Link, Echo)>,
}

impl Paths {
    /// Declares them.
    pub fn open(ports: &mut Ports, mount: Mount) -> Result<Paths, OpenError> {
        mount.check()?;
        Ok(Paths {
            scan: ports.writer_with_tail("scan", MAX_BEAMS)?,
            ranges: ports.writer_with_tail("ranges", MAX_BEAMS)?,
            state: ports.writer("state")?,
            mount,
            sweep: Sweep::default(),
            bearings_rad: Vec::with_capacity(MAX_BEAMS),
            ages_s: Vec::with_capacity(MAX_BEAMS),
            missing: Vec::with_capacity(MAX_BEAMS),
            beams: Vec::with_capacity(MAX_BEAMS),
            span_s: 0.0,
            scan_written: Time::ZERO,
            written: Time::ZERO,
            has_news: false,
            is_blind: false,
            said: None,
        })
    }

    /// From now on scans are such.
    pub fn sweep(&mut self, sweep: Sweep) {
        if sweep == self.sweep {
            return;
        }
        let beams = sweep.beams.min(MAX_BEAMS);
        self.sweep = Sweep { beams, ..sweep };
        self.span_s = self.sweep.span_s();
        let frame = self.frame(f64::NAN);
        self.bearings_rad.clear();
        self.bearings_rad.extend((0..beams).map(|index| frame.bearing_rad(index) as f32));
        self.ages_s.clear();
        self.ages_s.extend((0..beams).map(|index| (self.span_s - self.sweep.delay_s(index)) as f32));
    }

    /// Writes one scan. Stamps that would go back or lie ahead of `now` are moved to where they may be.
    pub fn write(&mut self, now: Time, news: &News) {
        self.is_blind = is_blind(news.beams);
        if self.is_blind {
            return self.say_all(now, news.first, news.sensor_time_s, Echo::Fault);
        }
        self.write_beams(now, news);
    }

    /// What is wrong with the newest scan as a whole.
    pub fn blind(&self) -> Option<Fault> {
        self.is_blind.then_some(BLIND)
    }

    fn write_beams(&mut self, now: Time, news: &News) {
        let first = news.first.min(now).max(self.scan_written);
        let frame = self.frame(news.sensor_time_s);
        self.beams.clear();
        let (x_m, y_m) = (self.mount.x_m as f32, self.mount.y_m as f32);
        let places = self.bearings_rad.iter().zip(&self.ages_s);
        self.beams.extend(news.beams.iter().zip(places).map(|(beam, (bearing_rad, age_s))| Beam {
            origin_x_m: x_m,
            origin_y_m: y_m,
            bearing_rad: *bearing_rad,
            range_m: beam.range_m,
            age_s: *age_s,
            echo: u32::from(beam.echo),
        }));
        let newest = first.after_s(self.span_s).min(now).max(self.written);
        let ranges = Ranges {
            min_range_m: frame.range_min_m,
            max_range_m: frame.range_max_m,
            beam_width_rad: 0.0,
            span_s: self.span_s as f32,
        };
        // What others wait for goes first.
        self.ranges.write_with_tail(newest, &ranges, &self.beams);
        self.written = newest;
        self.scan.write_with_tail(first, &frame, news.beams);
        self.scan_written = first;
        self.has_news = true;
    }

    /// Writes the state after a scan; without one, all paths, where it is time or something has changed: every beam
    /// says `missing`.
    pub fn refresh(&mut self, now: Time, missing: Echo, state: &LaserState, link: Link) {
        let has_news = std::mem::take(&mut self.has_news);
        let said = Some((link, missing));
        if !has_news && self.said == said && now.since(self.written) < REFRESH_S {
            return;
        }
        if !has_news {
            self.say_missing(now, missing);
        }
        self.said = said;
        self.state.write(self.written, state);
    }

    fn say_missing(&mut self, now: Time, missing: Echo) {
        self.say_all(now, now.before_s(self.span_s), f64::NAN, missing);
        self.has_news = false;
    }

    /// Writes a scan whose beams all say the same reason.
    fn say_all(&mut self, now: Time, first: Time, sensor_time_s: f64, echo: Echo) {
        let mut beams = std::mem::take(&mut self.missing);
        beams.clear();
        let beam = ScanBeam { range_m: 0.0, intensity: 0, echo: echo as u16 };
        beams.extend(std::iter::repeat_n(beam, self.sweep.beams));
        self.write_beams(now, &News { first, sensor_time_s, beams: &beams });
        self.missing = beams;
    }

    fn frame(&self, sensor_time_s: f64) -> LaserScan {
        let Sweep { angle_min_rad, angle_increment_rad, step_s, range_min_m, range_max_m, .. } = self.sweep;
        LaserScan {
            sensor_time_s,
            angle_min_rad: angle_min_rad as f32,
            angle_increment_rad: angle_increment_rad as f32,
            time_increment_s: step_s as f32,
            scan_time_s: self.sweep.scan_s() as f32,
            range_min_m: range_min_m as f32,
            range_max_m: range_max_m as f32,
            x_m: self.mount.x_m as f32,
            y_m: self.mount.y_m as f32,
            heading_rad: self.mount.heading_deg.to_radians() as f32,
            upside_down: u32::from(self.mount.upside_down),
        }
    }
}

/// Whether all beams tell the same distance.
fn is_blind(beams: &[ScanBeam]) -> bool {
    let [first, others @ ..] = beams else { return false };
    beams.len() >= BLIND_BEAMS
        && first.echo == Echo::Value as u16
        && others.iter().all(|beam| beam.echo == first.echo && beam.range_m == first.range_m)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn interlaced_beams_have_their_own_times() {
        // 180° at half a degree: two turns of 75 Hz, a turn sees every whole degree first, then every half one.
        let turn_s = 1.0 / 75.0;
        let sweep = Sweep { beams: 361, turn_s, turns: 2, step_s: turn_s / 720.0, ..Sweep::default() };
        assert_eq!(sweep.delay_s(0), 0.0);
        assert!((sweep.delay_s(1) - (turn_s + turn_s / 720.0)).abs() < 1e-12);
        assert!((sweep.delay_s(360) - turn_s / 2.0).abs() < 1e-12);
        assert!((sweep.span_s() - sweep.delay_s(359)).abs() < 1e-12);
        assert!((sweep.scan_s() - 2.0 / 75.0).abs() < 1e-12);
    }
}
