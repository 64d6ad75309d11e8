//! A laser as paths, whatever its protocol.
//!
//! | path | type | when |
//! |---|---|---|
//! | writes `scan` | LaserScan, a [`ScanBeam`](messages::ScanBeam) per beam | each scan; without one at 2.5 Hz, each beam says why |
//! | writes `ranges` | Ranges in the body frame, a [`Beam`](messages::Beam) per beam | with `scan` |
//! | writes `state` | LaserState | with `scan` |
//!
//! A missing link is data, no fault: `state.link` says which, every beam says `link_lost`; a laser that reports a fault of
//! its own, one of another type, and one whose beams all tell the same distance is a fault as well, once.

use super::{Event, Paths, SaidOnce, Session, Settings};
use crate::port::{Demand, Port, line_baud};
use messages::{Echo, Link};
use runtime::{Device, Fault, Layer, Node, OpenError, Ports, Time};

/// Bytes that are taken from the device at once.
const RECEIVED: usize = 4096;

/// The node of a laser that speaks `S`; see the module's text.
pub struct Scanner<S> {
    device: Device,
    session: S,
    paths: Paths,
    said: SaidOnce,
    received: Box<[u8; RECEIVED]>,
}

impl<S: Session> Node for Scanner<S> {
    const TYPE: &'static str = S::TYPE;
    const LAYER: Layer = Layer::Drivers;
    type Config = S::Settings;

    fn open(ports: &mut Ports, settings: S::Settings) -> Result<Scanner<S>, OpenError> {
        settings.check()?;
        let device = ports.device(settings.device())?;
        Ok(Scanner {
            session: S::of(&settings, line_baud(&device)),
            paths: Paths::open(ports, settings.mount())?,
            device,
            said: SaidOnce::default(),
            received: Box::new([0; RECEIVED]),
        })
    }

    fn step(&mut self, now: Time) -> Result<(), Fault> {
        self.session.port(now, Port::from(self.device.link()));
        let Scanner { device, session, paths, received, .. } = self;
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
            let _ = device.send(request.as_ref());
        }
        let link = session.link();
        paths.refresh(now, missing(session), &session.state(), link);
        let fault = match link {
            Link::Foreign => Some(S::FOREIGN),
            _ if session.is_faulty() => Some(S::FAULTY),
            Link::Up => paths.blind(),
            // Why, the state says.
            _ => return Ok(()),
        };
        self.said.now(fault)
    }

    fn stop(&mut self, _now: Time) {
        // Nobody listens any more when this fails.
        let _ = self.device.send(S::FAREWELL);
    }
}

fn take(now: Time, event: Event<'_>, paths: &mut Paths) {
    match event {
        Event::Sweep(sweep) => paths.sweep(*sweep),
        Event::Scan(news) => paths.write(now, &news),
    }
}

/// Why there is no scan.
fn missing(session: &impl Session) -> Echo {
    match session.link() {
        Link::Up if session.is_faulty() => Echo::Fault,
        Link::Up | Link::Connecting => Echo::None,
        _ => Echo::LinkLost,
    }
}
