//! The session's start-ups: any rate, any state in which an earlier client has left the laser.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking, also in its helpers")]

mod support;

use drivers::laser::{News, Session as _};
use drivers::lms200::model::{MEASURING_MODE, Reach, UNIT, Variant};
use drivers::lms200::session::{Demand, Event, Port, Session, SessionConfig};
use messages::{Link, ScanBeam};
use runtime::Time;
use support::lasers::{Lms, Scanner};

const STEP_S: f64 = 0.01;

/// Session and laser on a serial line: what is said at another rate than the listener's arrives as junk.
struct Rig {
    session: Session,
    laser: Lms,
    line_baud: u32,
    now: Time,
    generation: u64,
    scans: Vec<Vec<ScanBeam>>,
    reopened: u32,
}

fn config() -> SessionConfig {
    SessionConfig {
        variant: Variant::of(180, 50),
        line_baud: Some(9600),
        fast_baud: Some(38_400),
        hunt_bauds: vec![9600, 38_400, 19_200, 500_000],
        ..SessionConfig::default()
    }
}

fn garbled(bytes: &[u8]) -> Vec<u8> {
    bytes.iter().map(|byte| byte.rotate_left(3) ^ 0xA5).collect()
}

impl Rig {
    fn new(laser: Lms, config: SessionConfig) -> Rig {
        let now = Time::from_seconds(10.0);
        let mut session = Session::new(config);
        session.port(now, Port::Open(1));
        Rig { session, laser, line_baud: 9600, now, generation: 1, scans: Vec::new(), reopened: 0 }
    }

    fn run(&mut self, seconds: f64) {
        for k in 0..(seconds / STEP_S).round() as u32 {
            self.now = self.now.after_s(STEP_S);
            let Rig { session, laser, line_baud, now, generation, scans, reopened } = self;
            let mut said = Vec::new();
            let rate_before = laser.baud;
            while let Some(request) = session.next_request(*now) {
                let matches = *line_baud == laser.baud;
                said.extend(laser.hear(&if matches {
                    request.as_bytes().to_vec()
                } else {
                    garbled(request.as_bytes())
                }));
            }
            if k % 20 == 0 {
                let values: Vec<u32> = (0..laser.count() as u32).map(|beam| 1000 + beam).collect();
                said.extend(laser.scan(k, &values));
            }
            // An answer to a change of rate comes at the old one.
            let said = if *line_baud == rate_before { said } else { garbled(&said) };
            session.receive(*now, *now, &said, |event| {
                if let Event::Scan(News { beams, .. }) = event {
                    scans.push(beams.to_vec());
                }
            });
            match session.tick(*now, |_| {}) {
                Some(Demand::Baud(baud)) => *line_baud = baud,
                Some(Demand::Reopen) => {
                    (*line_baud, *reopened) = (9600, *reopened + 1);
                    *generation += 1;
                    session.port(*now, Port::Opening);
                    session.port(*now, Port::Open(*generation));
                }
                None => {}
            }
        }
    }

    fn commands(&self) -> Vec<u8> {
        self.laser.log.iter().map(|body| body[0]).collect()
    }
}

#[test]
fn a_laser_is_found_at_whatever_rate_it_was_left_streaming_or_not() {
    for baud in [9600, 19_200, 38_400, 500_000] {
        for streams in [false, true] {
            let mut rig = Rig::new(Lms { baud, streams, ..Lms::default() }, config());
            rig.run(60.0);
            assert_eq!(rig.session.link(), Link::Up, "left at {baud}, streams {streams}");
            assert_eq!((rig.laser.baud, rig.line_baud), (38_400, 38_400));
            assert_eq!(rig.scans.last().unwrap().len(), 361);
            assert!((rig.scans.last().unwrap()[5].range_m - 1.005).abs() < 1e-6);
        }
    }
}

#[test]
fn the_configuration_is_written_only_where_it_differs() {
    for (reach, writes) in [(Reach::Keep, 0), (Reach::Eight, 0), (Reach::ThirtyTwo, 1), (Reach::Eighty, 1)] {
        let mut rig = Rig::new(Lms::default(), SessionConfig { reach, ..config() });
        rig.run(20.0);
        assert_eq!(rig.session.link(), Link::Up, "{reach:?}");
        assert_eq!(rig.commands().iter().filter(|command| **command == 0x77).count(), writes, "{reach:?}");
        let codes = (rig.laser.config[MEASURING_MODE], rig.laser.config[UNIT]);
        assert!(reach.codes().is_none_or(|wanted| wanted == codes), "{codes:?}");
        let wanted_m = if reach == Reach::Eighty { 10.05 } else { 1.005 };
        assert!((rig.scans.last().unwrap()[5].range_m - wanted_m).abs() < 1e-5);
    }
}

#[test]
fn a_refused_telegram_is_sent_again() {
    let mut rig = Rig::new(Lms { refuses: 2, ..Lms::default() }, config());
    rig.run(1.0);
    assert_eq!(rig.commands()[..3], [0x20, 0x20, 0x20]);
    assert_eq!(rig.session.link(), Link::Up);
}

#[test]
fn an_acknowledged_question_is_waited_for_longer_than_one_that_nobody_heard() {
    let mut rig = Rig::new(Lms { only_acknowledges: true, ..Lms::default() }, config());
    rig.run(2.8);
    assert_eq!(rig.laser.log.len(), 1, "{:02X?}", rig.commands());
    rig.run(1.0);
    assert!(rig.laser.log.len() > 1);
}

#[test]
fn a_laser_that_was_switched_off_and_on_is_set_up_again() {
    let mut rig = Rig::new(Lms::default(), config());
    rig.run(20.0);
    assert_eq!(rig.session.state().connections, 1);
    // Power-on: 9600 baud, one degree, no stream.
    rig.laser = Lms::default();
    rig.run(60.0);
    assert_eq!((rig.session.link(), rig.session.state().connections), (Link::Up, 2));
    assert_eq!(rig.laser.variant, [180, 0, 50, 0]);
}

#[test]
fn a_dead_line_is_opened_anew_and_says_that_it_is_silent() {
    let mut rig = Rig::new(Lms { baud: 1, ..Lms::default() }, config());
    rig.run(60.0);
    assert!(rig.reopened >= 1);
    assert_eq!(rig.session.link(), Link::Silent);
    rig.session.port(rig.now, Port::Closed);
    assert_eq!(rig.session.link(), Link::Lost);
}
