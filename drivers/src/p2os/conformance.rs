//! What every Pioneer at the other end of a byte stream must do, as a suite of checks.
//!
//! Runs against anything that can send, receive and let time pass: a simulated microcontroller on virtual time, or one
//! behind a pseudo-terminal or TCP on real time. It needs a robot of a known model with half a metre of room ahead and
//! room to turn. No check asserts how fast anything is beyond what the protocol itself says.
//!
//! ```no_run
//! # struct Wire; impl drivers::p2os::conformance::Server for Wire {
//! #   fn send(&mut self, _: &[u8]) {} fn receive(&mut self, _: &mut Vec<u8>) {} fn advance(&mut self, _: f64) {}
//! # }
//! # let mut wire = Wire;
//! drivers::p2os::conformance::check(&mut wire).unwrap();
//! ```

use super::config::ConfigPacket;
use super::framer::Framer;
use super::model::{self, Model, SONARS};
use super::protocol::{
    Argument, MAX_COMMAND_COUNT, MAX_PACKET, command, encode, encode_command, flag, pack_wheels, packet,
};
use super::sip::{EncoderTicks, Identity, Sip, Unwrap15};
use runtime::math;

/// The robot's end of a byte stream, seen from the client.
pub trait Server {
    /// Sends bytes to the robot.
    fn send(&mut self, bytes: &[u8]);
    /// Appends what the robot has sent since the last call.
    fn receive(&mut self, bytes: &mut Vec<u8>);
    /// Lets `seconds` pass, virtual or real.
    fn advance(&mut self, seconds: f64);
    /// Opens a new connection where the robot hangs up on CLOSE; nothing where the line stays.
    fn reconnect(&mut self) {}
    /// Whether the robot goes on after its watchdog has stopped it, as the firmware does at the next command.
    fn resumes_after_watchdog(&self) -> bool {
        true
    }
}

/// A check that failed.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{check}: {what}")]
pub struct Failure {
    /// Which check.
    pub check: &'static str,
    /// What was seen and what was expected.
    pub what: String,
}

type Outcome = Result<(), String>;

/// One check: a sentence and what it does.
pub type Check = (&'static str, fn(&mut Client) -> Outcome);

/// All checks in the order in which [`check`] runs them.
pub const CHECKS: &[Check] = &[
    ("says nothing before it is asked", silent_before_sync),
    ("echoes the handshake behind junk and says who it is", handshake),
    ("opens by a bare OPEN and by one with an argument", opens),
    ("sends about ten SIPs per second, 200 bytes at most", sips),
    ("brings news of all sixteen sonars within a second", sonars),
    ("switches its sonars off and on", sonar_switch),
    ("keeps its motors off until they are enabled", motors),
    ("drives forwards and backwards as VEL says and counts the way", drives),
    ("turns counter-clockwise as RVEL says, by wheels and by heading", turns),
    ("drives its wheels as VEL2 says, whichever sign the argument has", wheels),
    ("stops at STOP with its motors on", stops),
    ("sets its odometry to zero by any form of SETO", set_origin),
    ("stops when nobody speaks to it, and goes on at the next word", watchdog),
    ("answers CONFIG with what it is", configuration),
    ("sends wheel ticks once, always, or never", encoders),
    ("ignores damaged and overlong commands and takes split ones", resynchronises),
    ("takes several commands in one piece", joined),
    ("forgets its session at CLOSE", closes),
];

/// Runs all checks; stops at the first that fails.
pub fn check(server: &mut dyn Server) -> Result<(), Failure> {
    let mut client = Client::new(server);
    for (check, run) in CHECKS {
        client.leave();
        run(&mut client).map_err(|what| Failure { check, what })?;
    }
    client.leave();
    Ok(())
}

/// Step of waiting [s].
const TICK_S: f64 = 0.01;

/// A client that knows no more than the protocol.
pub struct Client<'a> {
    server: &'a mut dyn Server,
    framer: Framer,
    packets: Vec<Vec<u8>>,
    model: &'static Model,
}

impl<'a> Client<'a> {
    /// A client at the other end of `server`.
    pub fn new(server: &'a mut dyn Server) -> Client<'a> {
        Client { server, framer: Framer::new(), packets: Vec::new(), model: &model::MODELS[0] }
    }

    fn command(&mut self, number: u8, argument: Argument) {
        let mut out = [0; MAX_PACKET];
        let length = encode_command(&mut out, number, argument).expect("the suite sends what can be encoded");
        self.server.send(&out[..length]);
        self.wait(TICK_S);
    }

    fn integer(&mut self, number: u8, value: i32) {
        self.command(number, Argument::Integer(value));
    }

    fn wait(&mut self, seconds: f64) {
        let mut bytes = Vec::new();
        for _ in 0..(seconds / TICK_S).round().max(1.0) as usize {
            self.server.advance(TICK_S);
            self.server.receive(&mut bytes);
        }
        let mut input = &bytes[..];
        while let Some(payload) = self.framer.next(&mut input) {
            self.packets.push(payload.to_vec());
        }
    }

    /// All packets of the next `seconds`.
    fn listen(&mut self, seconds: f64) -> Vec<Vec<u8>> {
        self.packets.clear();
        self.wait(seconds);
        std::mem::take(&mut self.packets)
    }

    /// The SIPs of the next `seconds`, the watchdog kept fed.
    fn sips(&mut self, seconds: f64) -> Vec<Sip> {
        let mut all = Vec::new();
        let mut left_s = seconds;
        while left_s > 0.0 {
            self.command(command::PULSE, Argument::None);
            all.extend(self.listen(left_s.min(0.5)));
            left_s -= 0.5;
        }
        all.iter().filter_map(|payload| Sip::parse(payload)).collect()
    }

    /// The newest SIP after `seconds`.
    fn sip_after(&mut self, seconds: f64) -> Result<Sip, String> {
        self.sips(seconds).pop().ok_or_else(|| format!("no SIP in {seconds} s"))
    }

    /// The first packet of a type, within two seconds.
    fn expect(&mut self, kind: u8) -> Result<Vec<u8>, String> {
        for _ in 0..20 {
            if let Some(payload) = self.packets.iter().find(|payload| payload.first() == Some(&kind)) {
                let payload = payload.clone();
                self.packets.clear();
                return Ok(payload);
            }
            self.wait(0.1);
        }
        Err(format!("no packet of type {kind:#04x} within 2 s"))
    }

    /// Back to where the robot waits for SYNC0, whatever went before.
    fn leave(&mut self) {
        self.command(command::STOP, Argument::None);
        self.integer(command::CLOSE, 1);
        self.wait(0.3);
        self.server.reconnect();
        self.wait(0.1);
        self.framer.clear();
        self.packets.clear();
    }

    fn sync(&mut self) -> Result<Identity, String> {
        for step in [command::SYNC0, command::SYNC1, command::SYNC2] {
            self.packets.clear();
            self.command(step, Argument::None);
            let echo = self.expect(step)?;
            if step == command::SYNC2 {
                return Identity::parse(&echo).ok_or_else(|| "no identity".into());
            }
        }
        Err("unreachable: SYNC2 is the last".into())
    }

    /// A running session.
    fn open(&mut self) -> Outcome {
        let identity = self.sync()?;
        let known = model::find(identity.class.as_str(), identity.subclass.as_str());
        self.model = known.ok_or_else(|| format!("unknown model {} {}", identity.class, identity.subclass))?;
        self.integer(command::OPEN, 1);
        self.sip_after(0.5).map(drop)
    }

    /// A running session with the motors on.
    fn enable(&mut self) -> Outcome {
        self.open()?;
        self.integer(command::ENABLE, 1);
        let sip = self.sip_after(0.5)?;
        ensure(is_on(&sip), || format!("motors off after ENABLE 1: flags {:?}", sip.flags))
    }

    /// Wheel speeds left and right of a SIP [m/s].
    fn speeds(&self, sip: &Sip) -> Result<(f64, f64), String> {
        match (sip.left_speed, sip.right_speed) {
            (Some(left), Some(right)) => {
                let factor = self.model.speed_m_s_per_unit;
                Ok((f64::from(left) * factor, f64::from(right) * factor))
            }
            _ => Err("a SIP without wheel speeds".into()),
        }
    }

    fn stands(&mut self) -> Outcome {
        let sip = self.sip_after(1.5)?;
        let (left, right) = self.speeds(&sip)?;
        ensure(left.abs() < 0.02 && right.abs() < 0.02, || format!("still moves: {left} {right} m/s"))
    }
}

fn ensure(holds: bool, otherwise: impl FnOnce() -> String) -> Outcome {
    if holds { Ok(()) } else { Err(otherwise()) }
}

fn near(what: &str, value: f64, expected: f64, tolerance: f64) -> Outcome {
    ensure((value - expected).abs() <= tolerance, || {
        format!("{what} is {value:.4}, not {expected:.4} ± {tolerance:.4}")
    })
}

fn is_on(sip: &Sip) -> bool {
    sip.flags.is_some_and(|flags| flags & flag::MOTORS != 0)
}

fn silent_before_sync(client: &mut Client) -> Outcome {
    let said = client.listen(0.5);
    ensure(said.is_empty(), || format!("{} packets, the first {:02x?}", said.len(), said[0]))
}

fn handshake(client: &mut Client) -> Outcome {
    client.server.send(b"WMS2\r\xFA\xFA\xFB\x02");
    let identity = client.sync()?;
    let said = client.listen(0.5);
    ensure(said.is_empty(), || format!("says {:02x?} before OPEN", said[0]))?;
    ensure(!identity.class.as_str().is_empty(), || format!("{identity:?}"))
}

fn opens(client: &mut Client) -> Outcome {
    client.sync()?;
    client.command(command::OPEN, Argument::None);
    client.sip_after(0.5)?;
    client.leave();
    client.sync()?;
    client.integer(command::OPEN, 1);
    client.sip_after(0.5).map(drop)
}

fn sips(client: &mut Client) -> Outcome {
    client.open()?;
    let mut all = Vec::new();
    for _ in 0..8 {
        client.command(command::PULSE, Argument::None);
        all.extend(client.listen(0.5));
    }
    let sips: Vec<_> = all.iter().filter(|payload| packet::is_sip(payload[0])).collect();
    ensure((20..=90).contains(&sips.len()), || format!("{} SIPs in 4 s", sips.len()))?;
    ensure(sips.iter().all(|payload| payload.len() + 5 <= 200), || "a SIP of more than 200 bytes".into())?;
    let last = Sip::parse(sips[sips.len() - 1]).ok_or("no SIP")?;
    let volts = last.battery_dv.ok_or("no battery voltage")?;
    ensure((100..=160).contains(&volts), || format!("battery of {volts} dV"))
}

fn sonars(client: &mut Client) -> Outcome {
    client.open()?;
    let mut heard = [false; SONARS];
    for sip in client.sips(1.0) {
        for reading in sip.sonar.iter() {
            let range_m = f64::from(reading.range) * client.model.range_m_per_unit;
            ensure(usize::from(reading.number) < SONARS, || format!("sonar {}", reading.number))?;
            ensure(range_m <= client.model.max_range_m + 0.01, || format!("sonar {} at {range_m} m", reading.number))?;
            heard[usize::from(reading.number)] = true;
        }
    }
    ensure(heard.iter().all(|heard| *heard), || format!("heard {heard:?}"))
}

fn sonar_switch(client: &mut Client) -> Outcome {
    client.open()?;
    let fires = |sip: &Sip| sip.flags.is_some_and(|flags| flags & flag::SONAR_ARRAYS != 0);
    ensure(fires(&client.sip_after(0.3)?), || "sonars off after OPEN".into())?;
    client.integer(command::SONAR, 0);
    client.sip_after(0.5)?;
    let sips = client.sips(0.5);
    ensure(sips.iter().all(|sip| !fires(sip) && sip.sonar.is_empty()), || "readings or flags after SONAR 0".into())?;
    client.integer(command::SONAR, 1);
    client.sip_after(0.5)?;
    let sips = client.sips(0.5);
    ensure(sips.iter().all(fires) && sips.iter().any(|sip| !sip.sonar.is_empty()), || "quiet after SONAR 1".into())
}

fn motors(client: &mut Client) -> Outcome {
    client.open()?;
    ensure(!is_on(&client.sip_after(0.3)?), || "motors on after OPEN".into())?;
    client.integer(command::VEL, 200);
    client.stands()?;
    client.integer(command::VEL, 0);
    client.integer(command::ENABLE, 1);
    ensure(is_on(&client.sip_after(0.5)?), || "motors off after ENABLE 1".into())?;
    client.integer(command::ENABLE, 0);
    ensure(!is_on(&client.sip_after(0.5)?), || "motors on after ENABLE 0".into())
}

fn drives(client: &mut Client) -> Outcome {
    client.enable()?;
    for speed_mm_s in [200, -200] {
        let mut x = Unwrap15::default();
        let mut y = Unwrap15::default();
        let before = client.sip_after(0.3)?;
        let start = before.x.zip(before.y).ok_or("no position")?;
        x.step(start.0);
        y.step(start.1);
        client.integer(command::VEL, speed_mm_s);
        let sips = client.sips(2.0);
        let last = sips.last().ok_or("no SIP while driving")?;
        let (left, right) = client.speeds(last)?;
        near("left wheel's speed [m/s]", left, f64::from(speed_mm_s) * 1e-3, 0.03)?;
        near("right wheel's speed [m/s]", right, f64::from(speed_mm_s) * 1e-3, 0.03)?;
        let end = last.x.zip(last.y).ok_or("no position")?;
        let way_m = math::hypot(f64::from(x.step(end.0)), f64::from(y.step(end.1))) * client.model.distance_m_per_unit;
        // Two seconds less the ramp, which nobody prescribes.
        ensure((0.15..0.45).contains(&way_m), || format!("{way_m} m in 2 s at {speed_mm_s} mm/s"))?;
        let kinds = [packet::SIP_MOVING, packet::SIP_STOPPED];
        ensure(kinds.contains(&last.kind), || format!("SIP of type {:#04x}", last.kind))?;
        client.integer(command::VEL, 0);
        client.stands()?;
    }
    Ok(())
}

fn turns(client: &mut Client) -> Outcome {
    client.enable()?;
    let start = client.sip_after(0.3)?;
    client.integer(command::RVEL, 30);
    let sips = client.sips(2.0);
    client.integer(command::RVEL, 0);
    let last = sips.last().ok_or("no SIP while turning")?;
    let (left, right) = client.speeds(last)?;
    let rate = (right - left) / 2.0 * client.model.turn_rad_per_m;
    near("turn rate by the wheels [rad/s]", rate, 30f64.to_radians(), 0.06)?;
    let heading = |sip: &Sip| f64::from(sip.heading.unwrap_or(0)) * client.model.heading_rad_per_unit;
    let turned = math::wrap_angle(heading(last) - heading(&start));
    ensure((0.4..1.4).contains(&turned), || format!("turned by {turned} rad in 2 s at 30 deg/s"))?;
    client.stands()
}

fn wheels(client: &mut Client) -> Outcome {
    client.enable()?;
    for (left_mm_s, right_mm_s) in [(-100, 100), (100, -100)] {
        let word = pack_wheels(left_mm_s, right_mm_s);
        for argument in [Argument::Word(word), Argument::Integer(i32::from(word as i16))] {
            client.command(command::VEL2, argument);
            let sip = client.sip_after(1.5)?;
            let (left, right) = client.speeds(&sip)?;
            near("left wheel's speed [m/s]", left, f64::from(left_mm_s) * 1e-3, 0.03)?;
            near("right wheel's speed [m/s]", right, f64::from(right_mm_s) * 1e-3, 0.03)?;
        }
    }
    client.command(command::VEL2, Argument::Word(0));
    client.stands()
}

fn stops(client: &mut Client) -> Outcome {
    client.enable()?;
    client.integer(command::RVEL, 40);
    client.sip_after(1.0)?;
    client.command(command::STOP, Argument::None);
    client.stands()?;
    ensure(is_on(&client.sip_after(0.3)?), || "motors off after STOP".into())
}

fn set_origin(client: &mut Client) -> Outcome {
    client.enable()?;
    // Bare; with its kind byte alone; with three words.
    for form in [&[command::SETO][..], &[command::SETO, 0x3B], &[command::SETO, 0x3B, 0, 0, 0, 0, 0, 0]] {
        client.integer(command::RVEL, 40);
        client.sip_after(1.0)?;
        client.integer(command::RVEL, 0);
        client.stands()?;
        let mut out = [0; MAX_PACKET];
        let length = encode(&mut out, form).expect("the suite sends what can be encoded");
        client.server.send(&out[..length]);
        let sip = client.sip_after(0.5)?;
        ensure(sip.x == Some(0) && sip.y == Some(0) && sip.heading == Some(0), || {
            format!("at {:?} {:?} {:?} after SETO {form:02x?}", sip.x, sip.y, sip.heading)
        })?;
    }
    Ok(())
}

fn watchdog(client: &mut Client) -> Outcome {
    client.enable()?;
    client.integer(command::RVEL, 30);
    client.sip_after(0.5)?;
    // Longer than any watchdog as shipped.
    let sips: Vec<Sip> = client.listen(5.0).iter().filter_map(|payload| Sip::parse(payload)).collect();
    let (left, right) = client.speeds(sips.last().ok_or("no SIP while nobody speaks")?)?;
    ensure(left.abs() < 0.02 && right.abs() < 0.02, || format!("{left} {right} m/s after 5 s of silence"))?;
    if client.server.resumes_after_watchdog() {
        let sip = client.sip_after(1.5)?;
        let (left, right) = client.speeds(&sip)?;
        ensure(right - left > 0.05, || format!("{left} {right} m/s after PULSE: the old motion is not resumed"))?;
    }
    client.command(command::STOP, Argument::None);
    client.stands()
}

fn configuration(client: &mut Client) -> Outcome {
    client.open()?;
    for argument in [Argument::None, Argument::Integer(1)] {
        client.packets.clear();
        client.command(command::CONFIG, argument);
        let payload = client.expect(packet::CONFIG)?;
        let config = ConfigPacket::parse(&payload).ok_or("no CONFIGpac")?;
        let (class, subclass) = (config.class, config.subclass);
        ensure(class.as_str().eq_ignore_ascii_case(client.model.class), || format!("class {class}"))?;
        ensure(subclass.as_str().eq_ignore_ascii_case(client.model.subclass), || format!("subclass {subclass}"))?;
        // A client that adopts zeros makes a robot that does not move.
        let tops = [
            config.rotation_speed_top,
            config.translation_speed_top,
            config.rotation_acceleration_top,
            config.translation_acceleration_top,
            config.watchdog_ms,
        ];
        ensure(!tops.contains(&0), || format!("zeros among the tops: {tops:?}"))?;
    }
    Ok(())
}

fn encoders(client: &mut Client) -> Outcome {
    client.open()?;
    let count = |packets: Vec<Vec<u8>>| packets.iter().filter(|payload| EncoderTicks::parse(payload).is_some()).count();
    client.integer(command::ENCODER, 1);
    let once = count(client.listen(1.0));
    ensure(once == 1 || once == 0, || format!("{once} encoder packets after ENCODER 1"))?;
    client.integer(command::ENCODER, 2);
    let always = count(client.listen(1.0));
    ensure(always >= 4, || format!("{always} encoder packets in 1 s after ENCODER 2"))?;
    client.integer(command::ENCODER, 0);
    client.wait(0.3);
    let never = count(client.listen(0.5));
    ensure(never == 0, || format!("{never} encoder packets after ENCODER 0"))
}

fn resynchronises(client: &mut Client) -> Outcome {
    client.open()?;
    let mut out = [0; MAX_PACKET];
    let length = encode_command(&mut out, command::ENABLE, Argument::Integer(1)).expect("fits");
    let enable = out[..length].to_vec();
    let mut damaged = enable.clone();
    damaged[length - 1] ^= 1;
    client.server.send(&damaged);
    ensure(!is_on(&client.sip_after(0.5)?), || "obeys a command with a wrong checksum".into())?;
    let mut overlong = vec![command::ENABLE, 0x3B, 1, 0];
    overlong.resize(usize::from(MAX_COMMAND_COUNT) - 1, 0);
    let length = encode(&mut out, &overlong).expect("fits");
    client.server.send(&out[..length]);
    ensure(!is_on(&client.sip_after(0.5)?), || "obeys an overlong command".into())?;
    for piece in enable.chunks(2) {
        client.server.send(piece);
        client.wait(TICK_S);
    }
    ensure(is_on(&client.sip_after(0.5)?), || "loses a command that comes in pieces after damaged ones".into())
}

fn joined(client: &mut Client) -> Outcome {
    client.open()?;
    let mut all = Vec::new();
    for (number, value) in
        [(command::SETV, 400), (command::SETA, 300), (command::SETA, -300), (command::SETRV, 100), (command::ENABLE, 1)]
    {
        let mut out = [0; MAX_PACKET];
        let length = encode_command(&mut out, number, Argument::Integer(value)).expect("fits");
        all.extend_from_slice(&out[..length]);
    }
    client.server.send(&all);
    ensure(is_on(&client.sip_after(0.5)?), || "loses the last of five commands in one piece".into())
}

fn closes(client: &mut Client) -> Outcome {
    client.enable()?;
    client.integer(command::RVEL, 30);
    client.sip_after(0.5)?;
    client.integer(command::CLOSE, 1);
    client.wait(0.3);
    let said = client.listen(0.5);
    ensure(said.is_empty(), || format!("says {:02x?} after CLOSE", said[0]))?;
    client.server.reconnect();
    client.open()?;
    ensure(!is_on(&client.sip_after(0.3)?), || "motors on after CLOSE and OPEN".into())?;
    client.stands()
}
