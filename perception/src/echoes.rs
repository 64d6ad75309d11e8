//! Remembers for some seconds where echoes came from, so that what has left a sonar's beam is not forgotten while the
//! body turns past it.
//!
//! Reads `sonar` (a driver's ranges: each disc is renewed only every 320 ms, and eight cones leave gaps) and `odometry`;
//! writes `ranges`: every remembered spot as a beam from the centre of rotation, in the body frame of the stamp, with
//! its age; and every beam of the newest sample that is no spot (saw nothing, saw something far away, or has a reason
//! for no reading), so that readers still know where somebody looks. The rules are in [`crate::echo_memory`].
//!
//! Without odometry it writes nothing: its readers then see that it is silent, and choose another source. A restarted
//! node reads the rings' history first and so has its memory back.

use crate::echo_memory::{EchoMemory, MemoryConfig, Outline};
use crate::place::{Place, place_at};
use messages::{Beam, Odometry, Ranges};
use runtime::{Fault, Layer, Node, OpenError, Ports, Reader, Time, Writer};

/// Most beams of the ranger.
const BEAMS: usize = 64;
/// Two readings of one beam are farther apart in time than this [s].
const SAME_READING_S: f64 = 0.005;
/// Samples of history that a restarted node reads again.
const HISTORY: usize = 64;
/// What overlaps the body's edge by no more than this may be there in truth [m].
const UNDER_BODY_M: f64 = 0.03;

/// The node.
pub struct Echoes {
    sonar: Reader<Ranges>,
    odometry: Reader<Odometry>,
    ranges: Writer<Ranges>,
    hearing: Hearing,
    published: Vec<Beam>,
    outline: Outline,
    begun: bool,
}

impl Node for Echoes {
    const TYPE: &'static str = "echoes";
    const LAYER: Layer = Layer::Perception;
    type Config = MemoryConfig;

    fn open(ports: &mut Ports, config: MemoryConfig) -> Result<Echoes, OpenError> {
        config.check().map_err(OpenError::config)?;
        let body = ports.body();
        let outline = Outline {
            ahead_m: body.length_ahead_m - UNDER_BODY_M,
            behind_m: body.length_behind_m - UNDER_BODY_M,
            half_width_m: body.half_width_m - UNDER_BODY_M,
        };
        let room = config.capacity + BEAMS;
        Ok(Echoes {
            sonar: ports.reader("sonar")?,
            odometry: ports.reader("odometry")?,
            ranges: ports.writer_with_tail("ranges", room)?,
            hearing: Hearing::new(config),
            published: Vec::with_capacity(room),
            outline,
            begun: false,
        })
    }

    fn step(&mut self, now: Time) -> Result<(), Fault> {
        let Echoes { sonar, odometry, hearing, .. } = self;
        hearing.keep_to_frame(odometry);
        if !self.begun {
            self.begun = true;
            sonar.newest(HISTORY, |sample| hearing.take(odometry, sample.stamp, sample.message, sample.tail));
        }
        while let Some(sample) = sonar.next_unread() {
            hearing.take(odometry, sample.stamp, sample.message, sample.tail);
        }
        let Some(newest) = sonar.fresh(now) else { return Ok(()) };
        let Some(place) = place_at(odometry, newest.stamp) else { return Ok(()) };
        let memory = &mut hearing.memory;
        memory.tidy(newest.stamp, &place, &self.outline);
        self.published.clear();
        memory.each(newest.stamp, &place, |beam| self.published.push(beam));
        let others = newest.tail.iter().take(BEAMS).filter(|beam| !memory.keeps(beam));
        self.published.extend(others);
        let head = Ranges { min_range_m: 0.0, beam_width_rad: 0.0, ..*newest.message };
        self.ranges.write_with_tail(newest.stamp, &head, &self.published);
        Ok(())
    }
}

/// The memory, and what tells new readings from old ones.
struct Hearing {
    memory: EchoMemory,
    /// When each beam of the ranger was fired last.
    fired: [Time; BEAMS],
    heard_before_s: f64,
    /// Writer generation and origin of the odometry frame that the memory is in.
    frame: Option<(u64, u64)>,
}

impl Hearing {
    fn new(config: MemoryConfig) -> Hearing {
        let heard_before_s = config.heard_before_s;
        Hearing { memory: EchoMemory::new(config), fired: [Time::ZERO; BEAMS], heard_before_s, frame: None }
    }

    /// Forgets all when the odometry frame is another than before: nobody knows where the old one lies in it.
    fn keep_to_frame(&mut self, odometry: &mut Reader<Odometry>) {
        let frame = odometry.latest().map(|pose| (pose.generation, pose.origin));
        if self.frame.is_some() && frame.is_some() && frame != self.frame {
            self.memory.clear();
        }
        self.frame = frame.or(self.frame);
    }

    /// Takes in every beam of a sample that was fired since.
    fn take(&mut self, odometry: &mut Reader<Odometry>, stamp: Time, ranges: &Ranges, beams: &[Beam]) {
        let mut known: Option<(Time, Place)> = None;
        for (beam, fired) in beams.iter().zip(&mut self.fired) {
            let time = stamp.before_s(f64::from(beam.age_s));
            if beam.age_s.is_nan() || time.since(*fired) < SAME_READING_S {
                continue;
            }
            // Beams that were fired together share a pose.
            let place = match known {
                Some((at, place)) if at == time => Some(place),
                _ => place_at(odometry, time.before_s(self.heard_before_s)),
            };
            let Some(place) = place else { continue };
            known = Some((time, place));
            *fired = time;
            self.memory.hear(time, &place, ranges, beam);
        }
    }
}
