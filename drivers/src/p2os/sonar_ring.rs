//! The ring of sonars: gathers the few new readings of each SIP into one set of beams, each with its age and, where
//! it has no value, the reason.

use super::model::{Model, SONARS};
use super::sip::Reading;
use messages::{Beam, Echo, Ranges};
use runtime::Time;

/// A transducer that has not been heard for this long is off: in turn each fires every 320 ms [s].
const QUIET_S: f64 = 2.0;

/// Why no beam has a value, if that is so.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Condition {
    /// The sonars fire.
    Firing,
    /// They are switched off.
    Off,
    /// The link is down.
    LinkLost,
}

/// The last reading of each transducer.
#[derive(Debug, Clone)]
pub struct SonarRing {
    /// Numbers of the transducers that are fitted, in the order of their beams.
    fitted: [usize; SONARS],
    count: usize,
    last: [Option<(Time, f64)>; SONARS],
    /// When the sonars were switched on or the link came up.
    since: Time,
    ignored: u64,
}

impl SonarRing {
    /// A ring of the front array (0…7), the rear one (8…15), or both.
    pub fn new(front: bool, rear: bool) -> SonarRing {
        let mut ring = SonarRing { fitted: [0; SONARS], count: 0, last: [None; SONARS], since: Time::ZERO, ignored: 0 };
        for number in 0..SONARS {
            if if number < SONARS / 2 { front } else { rear } {
                ring.fitted[ring.count] = number;
                ring.count += 1;
            }
        }
        ring
    }

    /// Forgets all readings: the sonars were switched on, or the link came up.
    pub fn restart(&mut self, now: Time) {
        self.last = [None; SONARS];
        self.since = now;
    }

    /// Takes the new readings of one SIP.
    pub fn update(&mut self, now: Time, readings: &[Reading], model: &Model) {
        for reading in readings {
            match self.last.get_mut(usize::from(reading.number)) {
                Some(last) => *last = Some((now, f64::from(reading.range) * model.range_m_per_unit)),
                None => self.ignored += 1,
            }
        }
    }

    /// Readings of transducers that the model does not have.
    pub fn ignored(&self) -> u64 {
        self.ignored
    }

    /// Writes a beam per fitted transducer into `beams`; returns the sample's fixed part and how many there are.
    ///
    /// Stamp of the sample: `now`. Age: since the packet that brought the reading; the ping itself is up to 100 ms older.
    pub fn beams(&self, now: Time, condition: Condition, model: &Model, beams: &mut [Beam; SONARS]) -> (Ranges, usize) {
        let (mut oldest_s, mut newest_s) = (0.0f64, f64::INFINITY);
        for (beam, number) in beams.iter_mut().zip(&self.fitted[..self.count]) {
            let pose = &model.sonar[*number];
            let last = self.last[*number];
            let age_s = now.since(last.map_or(self.since, |(at, _)| at));
            let (echo, range_m) = judge(condition, last.map(|(_, range_m)| range_m), age_s, model);
            if echo == Echo::Value || echo == Echo::Clear {
                (oldest_s, newest_s) = (oldest_s.max(age_s), newest_s.min(age_s));
            }
            *beam = Beam {
                origin_x_m: pose.x_m as f32,
                origin_y_m: pose.y_m as f32,
                bearing_rad: pose.bearing_rad as f32,
                range_m: range_m as f32,
                age_s: age_s as f32,
                echo: echo as u32,
            };
        }
        let ranges = Ranges {
            min_range_m: model.min_range_m as f32,
            max_range_m: model.max_range_m as f32,
            beam_width_rad: model.beam_width_rad as f32,
            span_s: (oldest_s - newest_s).max(0.0) as f32,
        };
        (ranges, self.count)
    }
}

/// What one transducer says, and its distance [m]: the greatest where nothing answered.
fn judge(condition: Condition, range_m: Option<f64>, age_s: f64, model: &Model) -> (Echo, f64) {
    match (condition, range_m) {
        (Condition::LinkLost, _) => (Echo::LinkLost, 0.0),
        (Condition::Off, _) => (Echo::Off, 0.0),
        // Fitted, powered, and not in the firing order or broken.
        (Condition::Firing, _) if age_s > QUIET_S => (Echo::Off, 0.0),
        (Condition::Firing, None) => (Echo::None, 0.0),
        (Condition::Firing, Some(range_m)) if range_m >= model.max_range_m => (Echo::Clear, model.max_range_m),
        (Condition::Firing, Some(range_m)) if range_m < model.min_range_m => (Echo::TooNear, range_m),
        (Condition::Firing, Some(range_m)) => (Echo::Value, range_m),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::p2os::model;

    const BLANK: Beam = Beam { origin_x_m: 0.0, origin_y_m: 0.0, bearing_rad: 0.0, range_m: 0.0, age_s: 0.0, echo: 0 };

    fn beams(ring: &SonarRing, now: Time, condition: Condition) -> (Ranges, Vec<Beam>) {
        let model = model::named("p3dx-sh").unwrap();
        let mut beams = [BLANK; SONARS];
        let (ranges, count) = ring.beams(now, condition, model, &mut beams);
        (ranges, beams[..count].to_vec())
    }

    fn reading(number: u8, range: u16) -> Reading {
        Reading { number, range }
    }

    #[test]
    fn readings_of_several_packets_make_one_ring_with_their_ages() {
        let model = model::named("p3dx-sh").unwrap();
        let mut ring = SonarRing::new(true, true);
        let start = Time::from_seconds(10.0);
        ring.restart(start);
        ring.update(start, &[reading(0, 1000), reading(8, 5000)], model);
        ring.update(start.after_s(0.1), &[reading(1, 99), reading(9, 0)], model);
        let (ranges, beams) = beams(&ring, start.after_s(0.15), Condition::Firing);
        assert_eq!(beams.len(), 16);
        let said: Vec<(u32, f32)> = [0, 8, 1, 9, 2].map(|at| (beams[at].echo, beams[at].range_m)).to_vec();
        assert_eq!(
            said,
            [
                (Echo::Value as u32, 1.0),
                (Echo::Clear as u32, 5.0),
                (Echo::TooNear as u32, 0.099),
                (Echo::TooNear as u32, 0.0),
                (Echo::None as u32, 0.0)
            ]
        );
        assert!((beams[0].age_s - 0.15).abs() < 1e-6 && (beams[1].age_s - 0.05).abs() < 1e-6);
        assert_eq!((ranges.max_range_m, ranges.min_range_m), (5.0, 0.1));
        assert_eq!((beams[3].origin_x_m, beams[3].origin_y_m), (0.166, 0.027));
    }

    #[test]
    fn beams_without_a_value_say_why() {
        let model = model::named("p3dx-sh").unwrap();
        let mut ring = SonarRing::new(true, false);
        let start = Time::from_seconds(10.0);
        ring.restart(start);
        ring.update(start, &[reading(3, 1500)], model);
        let all = |condition| beams(&ring, start.after_s(0.1), condition).1;
        assert!(all(Condition::Off).iter().all(|beam| beam.echo == Echo::Off as u32));
        assert!(all(Condition::LinkLost).iter().all(|beam| beam.echo == Echo::LinkLost as u32));
        assert_eq!(all(Condition::Firing)[3].echo, Echo::Value as u32);
        let late = beams(&ring, start.after_s(2.5), Condition::Firing).1;
        assert!(late.iter().all(|beam| beam.echo == Echo::Off as u32), "a quiet transducer is off");
    }

    #[test]
    fn one_array_has_eight_beams_and_unknown_transducers_are_counted() {
        let model = model::named("p3dx-sh").unwrap();
        let mut rear = SonarRing::new(false, true);
        rear.update(Time::from_seconds(1.0), &[reading(8, 400), reading(16, 400), reading(255, 1)], model);
        let (_, beams) = beams(&rear, Time::from_seconds(1.0), Condition::Firing);
        assert_eq!((beams.len(), rear.ignored()), (8, 2));
        assert_eq!((beams[0].range_m, beams[0].origin_x_m), (0.4, -0.157));
    }

    #[test]
    fn readings_from_before_a_loss_are_forgotten() {
        let model = model::named("p3dx-sh").unwrap();
        let mut ring = SonarRing::new(true, true);
        ring.update(Time::from_seconds(1.0), &[reading(0, 400)], model);
        ring.restart(Time::from_seconds(1.1));
        assert_eq!(beams(&ring, Time::from_seconds(1.2), Condition::Firing).1[0].echo, Echo::None as u32);
    }
}
