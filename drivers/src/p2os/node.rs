//! The robot resource manager (S1): owns the microcontroller of a Pioneer and offers it as paths.
//!
//! Its six duties: to establish and keep contact ([`session`](super::session)), to receive and process packets, to
//! deliver the packets of its client, to check and recover from errors, to keep its paths fresh in time, and to obey
//! the operator.
//!
//! | path or call | type | when |
//! |---|---|---|
//! | reads `command` | Command | sent on change, repeated; stale or expired: velocity zero; not finite or from the future: a fault, too |
//! | writes `sonar` | Ranges, a [`Beam`](messages::Beam) per fitted transducer | each SIP, and at least at 2.5 Hz, also without a link |
//! | writes `odometry` | Odometry | each SIP |
//! | writes `state` | BaseState | each SIP, and at least at 2.5 Hz, also without a link |
//! | writes `encoders` | Encoders, where the settings ask | each encoder packet |
//! | `enable` | Switch → Done | motor power; "on" also ends a `stop`; see [`power`](super::power) |
//! | `stop` | Trigger → Done | velocity zero until the operator's `enable` |
//! | `switch_sonar` | Switch → Done | all sonars on or off |
//! | `set_origin` | Trigger → Done | the odometry's zero is here |
//! | `sound` | Sound → Done | one tone |
//!
//! The stop latch stands above all of it: when it does not allow motion, STOP goes out at once, past the queue, and the
//! motors off after it. An operator's `stop` outlives this process: its successor is told.
//!
//! A missing link is data, no fault: `state.link` says which, every beam says `link_lost`. One command goes out per
//! step at most (the firmware loses denser ones), so the node wants a short period: 10 ms beside the triggers
//! `device` and `command`.

use super::base::Base;
use super::drive::{WireVelocity, quantize};
use super::heritage::Heritage;
use super::paths::Paths;
use super::protocol::{Argument, HALT_PACKETS, LAST_WILL, MAX_PACKET, STOP_PACKETS, command, flag};
use super::session::{Demand, Port, Session};
use super::settings::P2osConfig;
use super::sip::Identity;
use crate::port::line_baud;
use messages::{Command, Done, Message, Sound, Switch, Trigger};
use runtime::{Body, CallPort, Device, Fault, Layer, Node, OpenError, Ports, Reader, Request, StopLatch, Time};

/// A SONAR command that the robot does not follow is repeated this often [s].
const SONAR_REPEAT_S: f64 = 1.0;
/// Unit of the piezo's durations [s].
const SAY_UNIT_S: f64 = 0.02;

/// A command may be stamped this much later than the step that reads it [s].
const FUTURE_S: f64 = 0.1;
const REFUSED: Fault = Fault::new("command is not a number or comes from the future: the robot stands");

const NOT_CONNECTED: &str = "the robot is not connected: see `link` of the state";
const BUSY: &str = "too many commands wait: try again";

/// A Pioneer base; see the module's text.
pub struct P2os {
    device: Device,
    session: Session,
    base: Base,
    paths: Paths,
    command: Reader<Command>,
    calls: Calls,
    settings: P2osConfig,
    body: Body,
    /// Commands from before the connection do not count.
    connected_at: Time,
    sonar_wanted: bool,
    sonar_said: Time,
    received: [u8; 512],
    latch: StopLatch,
    /// The change of the latch that this driver has obeyed.
    latch_obeyed: Option<u32>,
    heritage: Heritage,
    /// Whom a predecessor has found at the other end of its line.
    inherits: Option<Identity>,
}

/// The operator's calls.
struct Calls {
    enable: CallPort<Switch, Done>,
    stop: CallPort<Trigger, Done>,
    sonar: CallPort<Switch, Done>,
    set_origin: CallPort<Trigger, Done>,
    sound: CallPort<Sound, Done>,
}

/// What an operator may want.
enum Order {
    Enable(bool),
    Stop,
    Sonar(bool),
    SetOrigin,
    Sound(Sound),
}

impl Node for P2os {
    const TYPE: &'static str = "p2os";
    const LAYER: Layer = Layer::Drivers;
    type Config = P2osConfig;

    fn open(ports: &mut Ports, settings: P2osConfig) -> Result<P2os, OpenError> {
        settings.check()?;
        let device = ports.device(&settings.device)?;
        device.will(LAST_WILL);
        let line_baud = line_baud(&device);
        Ok(P2os {
            session: Session::new(settings.session(line_baud)),
            base: Base::new(&settings),
            paths: Paths::open(ports, settings.encoders)?,
            command: ports.reader("command")?,
            calls: Calls {
                enable: ports.call("enable")?,
                stop: ports.call("stop")?,
                sonar: ports.call("switch_sonar")?,
                set_origin: ports.call("set_origin")?,
                sound: ports.call("sound")?,
            },
            body: *ports.body(),
            device,
            connected_at: Time::ZERO,
            sonar_wanted: settings.sonar_on,
            sonar_said: Time::ZERO,
            received: [0; 512],
            latch: ports.stop_latch(),
            latch_obeyed: None,
            heritage: Heritage::new(ports.keepsake()),
            inherits: None,
            settings,
        })
    }

    fn start(&mut self, _now: Time) -> Result<(), Fault> {
        if let Some((orders, identity)) = self.heritage.read() {
            self.base.drive.power.restore(orders);
            self.inherits = Some(identity).filter(|identity| *identity != Identity::default());
        }
        Ok(())
    }

    fn step(&mut self, now: Time) -> Result<(), Fault> {
        self.obey_latch(now);
        self.receive(now);
        if std::mem::take(&mut self.base.has_connected) {
            self.connected(now);
        }
        self.obey_operator(now);
        let obeyed = self.obey_command(now);
        self.keep_sonar(now);
        self.send(now);
        let Base { sip, ring, model, .. } = &self.base;
        self.paths.refresh(now, sip.as_ref(), ring, model, &self.session);
        self.heritage.write(self.base.drive.power.orders(), self.session.identity());
        obeyed
    }

    fn stop(&mut self, _now: Time) {
        // Nobody listens any more when this fails; the controller's watchdog is the last resort.
        let _ = self.device.send(&STOP_PACKETS);
    }
}

impl P2os {
    /// Says STOP at once when the latch does not allow motion, whatever else is due, and that it has said so.
    fn obey_latch(&mut self, now: Time) {
        if self.latch.allows_motion() {
            self.latch_obeyed = None;
        } else if self.latch_obeyed != Some(self.latch.change()) && self.device.send(&HALT_PACKETS).is_ok() {
            self.latch_obeyed = Some(self.latch.change());
            self.latch.obeyed();
            self.session.sent_aside(now, HALT_PACKETS.len());
        }
    }

    fn receive(&mut self, now: Time) {
        if self.device.is_kept()
            && self.device.link().is_open()
            && let Some(identity) = self.inherits.take()
        {
            self.session.inherit(identity);
        }
        self.session.port(now, Port::from(self.device.link()));
        loop {
            let count = self.device.receive(&mut self.received);
            if count == 0 {
                break;
            }
            let at = self.device.arrived().max(self.paths.written()).min(now);
            let P2os { session, base, paths, settings, received, .. } = self;
            session.receive(now, &received[..count], |event| base.take(at, event, settings, paths));
        }
        let P2os { session, base, paths, settings, .. } = self;
        match session.tick(now, |event| base.take(now, event, settings, paths)) {
            Some(Demand::Reopen) => self.device.reopen(),
            Some(Demand::Baud(baud)) => self.device.set_baud(baud),
            None => {}
        }
        if !self.session.is_running() {
            self.base.sip = None;
        }
    }

    /// Tells a robot that has just come up how it is to behave.
    fn connected(&mut self, now: Time) {
        self.connected_at = now;
        self.sonar_said = now;
        let session = &mut self.session;
        let mut tell = |number, value| session.enqueue(number, Argument::Integer(value));
        tell(command::SONAR, i32::from(self.sonar_wanted));
        if let Some(mode) = self.settings.bumper_stop {
            tell(command::BUMPSTALL, i32::from(mode));
        }
        if self.settings.sends_limits {
            for (number, value) in limits(&self.body).into_iter().filter(|(_, value)| *value != 0) {
                tell(number, value);
            }
        }
        if self.settings.encoders {
            tell(command::ENCODER, 2);
        }
    }

    fn obey_operator(&mut self, now: Time) {
        while let Some(request) = self.calls.enable.take() {
            let result = self.operate(now, Order::Enable(request.message.on != 0));
            reply(&mut self.calls.enable, request, now, result);
        }
        while let Some(request) = self.calls.stop.take() {
            let result = self.operate(now, Order::Stop);
            reply(&mut self.calls.stop, request, now, result);
        }
        while let Some(request) = self.calls.sonar.take() {
            let result = self.operate(now, Order::Sonar(request.message.on != 0));
            reply(&mut self.calls.sonar, request, now, result);
        }
        while let Some(request) = self.calls.set_origin.take() {
            let result = self.operate(now, Order::SetOrigin);
            reply(&mut self.calls.set_origin, request, now, result);
        }
        while let Some(request) = self.calls.sound.take() {
            let result = self.operate(now, Order::Sound(request.message));
            reply(&mut self.calls.sound, request, now, result);
        }
    }

    /// Does what the operator wants, or says why not.
    fn operate(&mut self, now: Time, order: Order) -> Result<(), &'static str> {
        let is_running = self.session.is_running();
        let mut tell = |number, argument| match is_running {
            false => Err(NOT_CONNECTED),
            true if self.session.enqueue(number, argument) => Ok(()),
            true => Err(BUSY),
        };
        match order {
            Order::Enable(true) if !is_running => Err(NOT_CONNECTED),
            Order::Enable(on) => {
                self.base.drive.power.operator(on);
                Ok(())
            }
            Order::Stop => {
                self.base.drive.power.halt();
                Ok(())
            }
            Order::Sonar(on) => {
                self.sonar_wanted = on;
                self.sonar_said = Time::ZERO;
                Ok(())
            }
            Order::SetOrigin => {
                tell(command::SETO, Argument::None)?;
                self.base.reckoning.set_origin(now);
                Ok(())
            }
            Order::Sound(sound) => {
                let pair = tone(&sound)?;
                tell(command::SAY, Argument::Text(&pair))
            }
        }
    }

    fn obey_command(&mut self, now: Time) -> Result<(), Fault> {
        let Base { drive, max_speed_m_s, max_turn_rad_s, .. } = &mut self.base;
        let sample = self.command.fresh(now).filter(|sample| sample.stamp >= self.connected_at);
        let wish = sample.map_or(Wish::Nothing, |sample| judge(now, sample.stamp, sample.message));
        if !self.latch.allows_motion() {
            // Power, too, is asked for anew when the latch lets go.
            drive.power.command(false);
            drive.want(WireVelocity::default());
        } else if let Wish::Move { forward_m_s, turn_rad_s, enable } = wish {
            drive.power.command(enable);
            drive.want(quantize(forward_m_s, turn_rad_s, *max_speed_m_s, *max_turn_rad_s));
        } else {
            drive.want(WireVelocity::default());
        }
        if wish == Wish::Refused { Err(REFUSED) } else { Ok(()) }
    }

    /// Says SONAR again where the robot's flags do not show what is wanted.
    fn keep_sonar(&mut self, now: Time) {
        let Some(flags) = self.base.sip.and_then(|sip| sip.flags) else { return };
        let is_on = flags & flag::SONAR_ARRAYS != 0;
        if is_on != self.sonar_wanted && now.since(self.sonar_said) >= SONAR_REPEAT_S {
            self.sonar_said = now;
            self.session.enqueue(command::SONAR, Argument::Integer(i32::from(self.sonar_wanted)));
        }
    }

    fn send(&mut self, now: Time) {
        let mut packet = [0; MAX_PACKET];
        while self.session.may_send(now) {
            let drive = &mut self.base.drive;
            let is_running = self.session.is_running();
            // Decelerations first, then what waits, then velocities.
            let length = if let Some((number, value)) = is_running.then(|| drive.urgent(now)).flatten() {
                self.session.next_direct(now, number, Argument::Integer(value), &mut packet)
            } else if let Some(length) = self.session.next_queued(now, &mut packet) {
                Some(length)
            } else if let Some((number, value)) = is_running.then(|| drive.next(now)).flatten() {
                self.session.next_direct(now, number, Argument::Integer(value), &mut packet)
            } else {
                self.session.next_pulse(now, &mut packet)
            };
            let Some(length) = length else { break };
            // A refused packet is lost as on a bad line; all that matters is repeated.
            let _ = self.device.send(&packet[..length]);
        }
    }
}

/// What a sample of `command` asks for.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Wish {
    /// It is too old: stand.
    Nothing,
    /// It holds numbers that are none, or its stamp lies ahead, so that it would never become stale: stand.
    Refused,
    /// A velocity and whether the motors are wanted.
    Move { forward_m_s: f64, turn_rad_s: f64, enable: bool },
}

/// Reads one command. A body of this kind cannot move sideways; what asks for it is ignored.
fn judge(now: Time, stamp: Time, command: &Command) -> Wish {
    let velocity = command.velocity;
    let numbers = [velocity.linear_x_m_s, velocity.angular_z_rad_s, command.valid_for_s];
    if numbers.iter().any(|number| !number.is_finite()) || stamp.since(now) > FUTURE_S {
        return Wish::Refused;
    }
    if now.since(stamp) > command.valid_for_s {
        return Wish::Nothing;
    }
    Wish::Move { forward_m_s: velocity.linear_x_m_s, turn_rad_s: velocity.angular_z_rad_s, enable: command.enable != 0 }
}

/// SAY's pair of duration and tone, or why there is none.
fn tone(sound: &Sound) -> Result<[u8; 2], &'static str> {
    let units = (sound.duration_s / SAY_UNIT_S).round();
    if sound.note > 127 {
        return Err("note is 0 for a rest or 1 to 127 after MIDI");
    }
    if !(1.0..=255.0).contains(&units) {
        return Err("duration_s lies between 0.02 and 5.1");
    }
    Ok([units as u8, sound.note as u8])
}

/// What the robot is told of its body: caps and ramps as (command, argument); zero where the body does not say.
fn limits(body: &Body) -> [(u8, i32); 6] {
    let whole = |value: f64| if value.is_finite() { value.round().clamp(0.0, 32_767.0) as i32 } else { 0 };
    let speed = whole(body.max_forward_m_s.max(body.max_backward_m_s) * 1e3);
    let turn = whole(body.max_turn_rad_s.to_degrees().ceil());
    let turn_ramp = whole(body.turn_acceleration_rad_s2.to_degrees());
    [
        (command::SETV, speed),
        (command::SETA, whole(body.acceleration_m_s2 * 1e3)),
        (command::SETA, -whole(body.deceleration_m_s2 * 1e3)),
        (command::SETRV, turn),
        (command::SETRA, turn_ramp),
        (command::SETRA, -turn_ramp),
    ]
}

fn reply<Q: Message>(port: &mut CallPort<Q, Done>, request: Request<Q>, now: Time, result: Result<(), &'static str>) {
    match result {
        Ok(()) => port.answer(request, &Done { at_ns: now.nanos() }),
        Err(reason) => port.refuse(request, reason),
    }
}
