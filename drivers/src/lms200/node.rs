//! An LMS 2xx as paths.
//!
//! | path | type | when |
//! |---|---|---|
//! | writes `scan` | LaserScan, a [`ScanBeam`](messages::ScanBeam) per value | each scan; without one at 2.5 Hz, each beam says why |
//! | writes `ranges` | Ranges in the body frame, a [`Beam`](messages::Beam) per value | with `scan` |
//! | writes `state` | LaserState | with `scan` |
//!
//! The laser has no clock but its mirror: stamps are arrivals less what line and mirror take, made even (see
//! [`clock`](super::clock)); a scan's `sensor_time_s` is NaN. A missing link is data, no fault: `state.link` says which, every
//! beam says `link_lost`; a laser that reports a fault of its own, one of another type, and one whose beams all tell the same
//! distance is a fault as well, once.

use super::protocol::{command, mode};
use super::session::{Demand, Event, Port, Request, Session};
use super::settings::Lms200Config;
use crate::laser::{News, Paths, SaidOnce};
use crate::port::line_baud;
use messages::{Echo, LaserState, Link};
use runtime::{Device, Fault, Layer, Node, OpenError, Ports, Time};

const FOREIGN: Fault =
    Fault::new("what answers is no laser of the wanted type, refuses the wanted mode, or its scans are none");
const FAULTY: Fault = Fault::new("the laser says that it cannot measure: see `status` of the state");

/// A laser; see the module's text.
pub struct Lms200 {
    device: Device,
    session: Session,
    paths: Paths,
    said: SaidOnce,
    received: Box<[u8; 2048]>,
}

impl Node for Lms200 {
    const TYPE: &'static str = "lms200";
    const LAYER: Layer = Layer::Drivers;
    type Config = Lms200Config;

    fn open(ports: &mut Ports, settings: Lms200Config) -> Result<Lms200, OpenError> {
        settings.check()?;
        let device = ports.device(&settings.device)?;
        Ok(Lms200 {
            session: Session::new(settings.session(line_baud(&device))),
            paths: Paths::open(ports, settings.mount)?,
            device,
            said: SaidOnce::default(),
            received: Box::new([0; 2048]),
        })
    }

    fn step(&mut self, now: Time) -> Result<(), Fault> {
        self.session.port(now, Port::from(self.device.link()));
        let Lms200 { device, session, paths, received, .. } = self;
        loop {
            let count = device.receive(&mut received[..]);
            if count == 0 {
                break;
            }
            let arrived = device.arrived().min(now);
            session.receive(now, arrived, &received[..count], |event| take(now, event, paths));
        }
        match session.tick(now, |event| take(now, event, paths)) {
            Some(Demand::Reopen) => device.reopen(),
            Some(Demand::Baud(baud)) => device.set_baud(baud),
            None => {}
        }
        while let Some(request) = session.next_request(now) {
            // A refused request is lost as on a bad line: its time-out repeats it.
            let _ = device.send(request.as_bytes());
        }
        let (missing, state) = (self.missing(), self.state());
        self.paths.refresh(now, missing, &state, self.session.link());
        match self.session.link() {
            Link::Foreign => self.said.now(Some(FOREIGN)),
            _ if self.session.is_faulty() => self.said.now(Some(FAULTY)),
            Link::Up => self.said.now(self.paths.blind()),
            _ => Ok(()),
        }
    }

    fn stop(&mut self, _now: Time) {
        // The stream ends; nobody listens any more when this fails.
        let _ = self.device.send(Request::new(&[command::MODE, mode::REQUEST]).as_bytes());
    }
}

fn take(now: Time, event: Event, paths: &mut Paths) {
    match event {
        Event::Sweep(sweep) => paths.sweep(*sweep),
        Event::Scan(first, beams) => paths.write(now, &News { first, sensor_time_s: f64::NAN, beams }),
    }
}

impl Lms200 {
    /// Why there is no scan.
    fn missing(&self) -> Echo {
        match self.session.link() {
            Link::Up if self.session.is_faulty() => Echo::Fault,
            Link::Up | Link::Connecting => Echo::None,
            _ => Echo::LinkLost,
        }
    }

    fn state(&self) -> LaserState {
        let (connections, scans, damaged) = self.session.counts();
        LaserState {
            link: self.session.link() as u32,
            laser_on: u32::from(self.session.is_running() && !self.session.is_faulty()),
            status: self.session.status(),
            connections,
            scans,
            damaged,
            skipped_bytes: u32::try_from(self.session.framer().skipped_bytes()).unwrap_or(u32::MAX),
            clock_jumps: self.session.clock().jumps(),
        }
    }
}
