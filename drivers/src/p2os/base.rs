//! What the driver knows of the base: fed with events, asked by the node.

use super::dead_reckoning::DeadReckoning;
use super::drive::Drive;
use super::encoders::Encoders;
use super::model::{self, Model};
use super::paths::{Paths, condition};
use super::power::Power;
use super::protocol::flag;
use super::session::Event;
use super::settings::{P2osConfig, SonarArray};
use super::sip::Sip;
use super::sonar_ring::{Condition, SonarRing};
use runtime::Time;

/// What is known of the base.
pub struct Base {
    /// Its figures.
    pub model: Model,
    /// Its odometry.
    pub reckoning: DeadReckoning,
    /// Its sonars.
    pub ring: SonarRing,
    /// Its wheels.
    pub drive: Drive,
    /// Cap of model and firmware [m/s].
    pub max_speed_m_s: f64,
    /// Cap of model and firmware [rad/s].
    pub max_turn_rad_s: f64,
    /// The newest SIP of a living link.
    pub sip: Option<Sip>,
    /// A handshake was done in this step.
    pub has_connected: bool,
    connections: u32,
}

impl Base {
    /// Nothing known but the settings.
    pub fn new(settings: &P2osConfig) -> Base {
        let has = |array| settings.sonar_arrays.contains(&array);
        let model = settings.model();
        Base {
            reckoning: DeadReckoning::new(settings.drift),
            ring: SonarRing::new(has(SonarArray::Front), has(SonarArray::Rear)),
            drive: Drive::new(settings.repeat_ms * 1e-3, Power::new(settings.after_loss)),
            max_speed_m_s: model.max_speed_m_s,
            max_turn_rad_s: model.max_turn_rad_s,
            model,
            sip: None,
            has_connected: false,
            connections: 0,
        }
    }

    /// Takes what came from the robot at `at`; writes what can be written at once.
    pub fn take(&mut self, at: Time, event: Event, settings: &P2osConfig, paths: &mut Paths) {
        match event {
            Event::Connected(identity) => {
                if settings.is_auto()
                    && let Some(known) = model::find(identity.class.as_str(), identity.subclass.as_str())
                {
                    self.model = settings.adapt(known);
                }
                let first = self.connections == 0;
                self.connections = self.connections.saturating_add(1);
                self.max_speed_m_s = self.model.max_speed_m_s;
                self.max_turn_rad_s = self.model.max_turn_rad_s;
                self.reckoning.connected(first);
                self.ring.restart(at);
                self.drive.connected(first);
                self.has_connected = true;
            }
            Event::Sip(sip) => {
                let was_off = self.sip.and_then(|last| last.flags).is_some_and(|flags| flags & flag::SONAR_ARRAYS == 0);
                if was_off && condition(Some(sip)) == Condition::Firing {
                    self.ring.restart(at);
                }
                self.sip = Some(*sip);
                self.ring.update(at, &sip.sonar, &self.model);
                if let Some(flags) = sip.flags {
                    self.drive.power.device(flags & flag::MOTORS != 0);
                }
                let odometry = self.reckoning.update(at, sip, &self.model);
                paths.write_sip(at, sip, odometry.as_ref(), &self.ring, &self.model);
            }
            Event::Config(config) => {
                // Zero means "not told".
                if config.translation_speed_top > 0 {
                    let top_m_s = f64::from(config.translation_speed_top) * 1e-3;
                    self.max_speed_m_s = self.model.max_speed_m_s.min(top_m_s);
                }
                if config.rotation_speed_top > 0 {
                    let top_rad_s = f64::from(config.rotation_speed_top).to_radians();
                    self.max_turn_rad_s = self.model.max_turn_rad_s.min(top_rad_s);
                }
            }
            Event::Encoder(ticks) => {
                let ticks = Encoders { left_ticks: ticks.left.into(), right_ticks: ticks.right.into() };
                paths.write_encoders(at, &ticks);
            }
            Event::Other(_) => {}
        }
    }
}
