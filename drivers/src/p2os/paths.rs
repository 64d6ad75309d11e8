//! What the driver writes: `sonar`, `odometry`, `state` and, where asked for, `encoders`.

use super::encoders::Encoders;
use super::model::{Model, SONARS};
use super::protocol::flag;
use super::session::Session;
use super::sip::Sip;
use super::sonar_ring::{Condition, SonarRing};
use messages::{BaseState, Beam, Link, Odometry, Ranges};
use runtime::{OpenError, Ports, Time, Writer};

/// Paths are written at least this often [s].
const REFRESH_S: f64 = 0.4;
/// The written paths. Stamps never go back.
pub struct Paths {
    sonar: Writer<Ranges>,
    odometry: Writer<Odometry>,
    state: Writer<BaseState>,
    encoders: Option<Writer<Encoders>>,
    beams: [Beam; SONARS],
    /// Newest stamp written.
    written: Time,
    /// Whether a SIP came in this step.
    has_news: bool,
    link: Option<Link>,
}

const NO_BEAM: Beam = Beam { origin_x_m: 0.0, origin_y_m: 0.0, bearing_rad: 0.0, range_m: 0.0, age_s: 0.0, echo: 0 };

impl Paths {
    /// Declares them.
    pub fn open(ports: &mut Ports, encoders: bool) -> Result<Paths, OpenError> {
        Ok(Paths {
            sonar: ports.writer_with_tail("sonar", SONARS)?,
            odometry: ports.writer("odometry")?,
            state: ports.writer("state")?,
            encoders: if encoders { Some(ports.writer("encoders")?) } else { None },
            beams: [NO_BEAM; SONARS],
            written: Time::ZERO,
            has_news: false,
            link: None,
        })
    }

    /// Newest stamp written.
    pub fn written(&self) -> Time {
        self.written
    }

    /// Writes what one SIP says.
    pub fn write_sip(&mut self, at: Time, sip: &Sip, odometry: Option<&Odometry>, ring: &SonarRing, model: &Model) {
        if let Some(odometry) = odometry {
            self.odometry.write(at, odometry);
        }
        self.write_sonar(at, condition(Some(sip)), ring, model);
        self.has_news = true;
    }

    /// Writes wheel ticks, where the settings ask for them.
    pub fn write_encoders(&mut self, at: Time, ticks: &Encoders) {
        if let Some(encoders) = &mut self.encoders {
            encoders.write(at, ticks);
        }
    }

    /// Writes the state after a SIP; without one, all that can be written, where it is time or the link has changed.
    pub fn refresh(&mut self, now: Time, sip: Option<&Sip>, ring: &SonarRing, model: &Model, session: &Session) {
        let link = session.link();
        let has_news = std::mem::take(&mut self.has_news);
        if !has_news && self.link == Some(link) && now.since(self.written) < REFRESH_S {
            return;
        }
        if !has_news || link != Link::Up {
            let condition = if link == Link::Up { condition(sip) } else { Condition::LinkLost };
            self.write_sonar(now, condition, ring, model);
        }
        self.link = Some(link);
        self.state.write(self.written, &state(sip, session));
    }

    fn write_sonar(&mut self, at: Time, condition: Condition, ring: &SonarRing, model: &Model) {
        let (ranges, count) = ring.beams(at, condition, model, &mut self.beams);
        self.sonar.write_with_tail(at, &ranges, &self.beams[..count]);
        self.written = at;
    }
}

/// Whether the sonars fire, as far as the newest SIP of a living link says.
pub fn condition(sip: Option<&Sip>) -> Condition {
    match sip.and_then(|sip| sip.flags) {
        Some(flags) if flags & flag::SONAR_ARRAYS == 0 => Condition::Off,
        _ => Condition::Firing,
    }
}

/// The state as the newest SIP tells it; without a link only the link's own words.
fn state(sip: Option<&Sip>, session: &Session) -> BaseState {
    let count = |value: u64| u32::try_from(value).unwrap_or(u32::MAX);
    let framer = session.framer();
    let blank = BaseState {
        battery_v: f64::NAN,
        charge: f64::NAN,
        link: session.link() as u32,
        connections: session.connections(),
        packets: count(framer.packets()),
        checksum_errors: count(framer.checksum_errors()),
        skipped_bytes: count(framer.skipped_bytes()),
        ..BaseState::default()
    };
    let Some(sip) = sip else { return blank };
    let is_set = |bits: u16| u32::from(sip.flags.unwrap_or(0) & bits != 0);
    let coarse_dv = sip.battery_dv.map(u16::from);
    let battery_dv = sip.battery_fine_dv.filter(|dv| *dv > 0).or(coarse_dv);
    BaseState {
        battery_v: battery_dv.map_or(f64::NAN, |dv| f64::from(dv) * 0.1),
        // Simulators and older boards leave it at zero.
        charge: sip
            .charge_percent
            .filter(|percent| (1..=100).contains(percent))
            .map_or(f64::NAN, |p| f64::from(p) * 0.01),
        front_bumpers: sip.front_bumpers(),
        rear_bumpers: sip.rear_bumpers(),
        stall_left: u32::from(sip.is_left_stalled()),
        stall_right: u32::from(sip.is_right_stalled()),
        motors_enabled: is_set(flag::MOTORS),
        sonar_enabled: is_set(flag::SONAR_ARRAYS),
        stop_button: is_set(flag::STOP_BUTTON),
        ..blank
    }
}
