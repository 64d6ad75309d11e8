//! A SCIP 2.0 scanner as paths.
//!
//! | path | type | when |
//! |---|---|---|
//! | writes `scan` | LaserScan, a [`ScanBeam`](messages::ScanBeam) per step | each scan; without one at 2.5 Hz, each beam says why |
//! | writes `ranges` | Ranges in the body frame, a [`Beam`](messages::Beam) per step | with `scan` |
//! | writes `state` | LaserState | with `scan` |
//!
//! Stamps are the scanner's own, mapped onto our clock (see [`clock`](super::clock)): a scan's time stamp is taken as the
//! instant at which the mirror passes step 0. A missing link is data, no fault: `state.link` says which, every beam says
//! `link_lost`; a scanner that reports a fault of its own, and one of another model, is a fault as well, once.

use super::session::{Event, Port, Session};
use super::settings::UrgConfig;
use crate::laser::{News, Paths, SaidOnce};
use crate::port::line_baud;
use messages::{Echo, LaserState, Link};
use runtime::{Device, Fault, Layer, Node, OpenError, Ports, Time};

const FOREIGN: Fault = Fault::new("what answers is no scanner of the wanted model, or measures nothing");
const FAULTY: Fault = Fault::new("the scanner says that it cannot measure: see `status` of the state");

/// A scanner; see the module's text.
pub struct Urg {
    device: Device,
    session: Session,
    paths: Paths,
    said: SaidOnce,
    received: Box<[u8; 4096]>,
}

impl Node for Urg {
    const TYPE: &'static str = "urg";
    const LAYER: Layer = Layer::Drivers;
    type Config = UrgConfig;

    fn open(ports: &mut Ports, settings: UrgConfig) -> Result<Urg, OpenError> {
        settings.check()?;
        let device = ports.device(&settings.device)?;
        let line_baud = line_baud(&device);
        Ok(Urg {
            session: Session::new(settings.session(line_baud)),
            paths: Paths::open(ports, settings.mount)?,
            device,
            said: SaidOnce::default(),
            received: Box::new([0; 4096]),
        })
    }

    fn step(&mut self, now: Time) -> Result<(), Fault> {
        self.session.port(now, Port::from(self.device.link()));
        loop {
            let count = self.device.receive(&mut self.received[..]);
            if count == 0 {
                break;
            }
            let arrived = self.device.arrived().min(now);
            let Urg { session, paths, received, .. } = self;
            session.receive(now, arrived, &received[..count], |event| match event {
                Event::Connected(sensor, area) => paths.sweep(sensor.sweep(&area)),
                Event::Scan(first, sensor_time_s, beams) => paths.write(now, &News { first, sensor_time_s, beams }),
            });
        }
        match self.session.tick(now) {
            Some(super::session::Demand::Reopen) => self.device.reopen(),
            Some(super::session::Demand::Baud(baud)) => self.device.set_baud(baud),
            None => {}
        }
        while let Some(request) = self.session.next_request(now) {
            // A refused request is lost as on a bad line: its time-out repeats it.
            let _ = self.device.send(request.as_bytes());
        }
        let state = self.state();
        self.paths.refresh(now, self.missing(), &state, self.session.link());
        self.fault()
    }

    fn stop(&mut self, _now: Time) {
        // The laser goes off and the stream ends; nobody listens any more when this fails.
        let _ = self.device.send(b"\nQT\n");
    }
}

impl Urg {
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

    /// What is wrong with the scanner itself, once until it changes.
    fn fault(&mut self) -> Result<(), Fault> {
        match self.session.link() {
            Link::Foreign => self.said.now(Some(FOREIGN)),
            _ if self.session.is_faulty() => self.said.now(Some(FAULTY)),
            Link::Up => self.said.now(self.paths.blind()),
            _ => Ok(()),
        }
    }
}
