//! A small robot for the driver's tests: the least microcontroller that the manual allows. (The simulator's is
//! another, with physics.)

use drivers::p2os::config::ConfigPacket;
use drivers::p2os::protocol::*;
use drivers::p2os::sip::{EncoderTicks, Identity, Sip};

/// State of its session.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Phase {
    Sync(u8),
    Ready,
    Running,
}

/// The robot. Time passes by [`advance`](Robot::advance).
pub struct Robot {
    pub phase: Phase,
    pub identity: Identity,
    pub motors: bool,
    pub sonar: bool,
    /// Set-points [mm/s, deg/s].
    pub velocity: i32,
    pub turn: i32,
    /// Position, heading [mm, units].
    pub x_mm: f64,
    pub heading: f64,
    pub watchdog_s: f64,
    pub config: Option<ConfigPacket>,
    pub ranges: [u16; 16],
    /// A silent robot hears and says nothing.
    pub is_mute: bool,
    pub front_bumpers: u8,
    /// All commands with their time.
    pub log: Vec<(f64, u8, i32)>,
    /// What it has sent and nobody has taken yet.
    pub out: Vec<u8>,
    pub now_s: f64,
    framer: Framer,
    heard_s: f64,
    next_sip_s: f64,
    next_sonar: u8,
    encoder_mode: i32,
    moved: bool,
}

impl Robot {
    pub fn new(subclass: &str) -> Robot {
        Robot {
            phase: Phase::Sync(0),
            identity: Identity { name: "test".into(), class: "Pioneer".into(), subclass: subclass.into() },
            motors: false,
            sonar: true,
            velocity: 0,
            turn: 0,
            x_mm: 0.0,
            heading: 0.0,
            watchdog_s: 2.0,
            config: Some(ConfigPacket {
                watchdog_ms: 2000,
                translation_speed_top: 1500,
                rotation_speed_top: 300,
                ..ConfigPacket::default()
            }),
            ranges: [2000; 16],
            is_mute: false,
            front_bumpers: 0,
            log: Vec::new(),
            out: Vec::new(),
            now_s: 0.0,
            framer: Framer::with_max_count(MAX_COMMAND_COUNT),
            heard_s: 0.0,
            next_sip_s: 0.0,
            next_sonar: 0,
            encoder_mode: 0,
            moved: false,
        }
    }

    /// Off and on: all is forgotten but the time and the log.
    pub fn power_cycle(&mut self) {
        let (now_s, log) = (self.now_s, std::mem::take(&mut self.log));
        *self = Robot { now_s, log, ..Robot::new(self.identity.subclass.as_str()) };
    }

    /// Whether the watchdog holds the wheels.
    pub fn is_watchdog_stopped(&self) -> bool {
        self.now_s - self.heard_s > self.watchdog_s
    }

    /// Speed of the wheels now [mm/s, deg/s].
    pub fn motion(&self) -> (i32, i32) {
        let moves = self.motors && self.phase == Phase::Running && !self.is_watchdog_stopped();
        if moves { (self.velocity, self.turn) } else { (0, 0) }
    }

    /// Numbers of the commands since `from_s`.
    pub fn numbers_since(&self, from_s: f64) -> Vec<u8> {
        self.log.iter().filter(|(at, ..)| *at >= from_s).map(|(_, number, _)| *number).collect()
    }

    pub fn hear(&mut self, mut bytes: &[u8]) {
        if self.is_mute {
            return;
        }
        let mut framer = std::mem::take(&mut self.framer);
        while let Some(payload) = framer.next(&mut bytes) {
            let request = Request::parse(payload).unwrap();
            self.log.push((self.now_s, request.number, request.integer()));
            self.obey(request);
        }
        self.framer = framer;
    }

    fn obey(&mut self, request: Request) {
        self.heard_s = self.now_s;
        match (self.phase, request.number) {
            (Phase::Sync(step), number) if number <= command::SYNC2 => {
                if number == step && number == command::SYNC2 {
                    let identity = self.identity;
                    self.say(|out| identity.encode(out).unwrap());
                    self.phase = Phase::Ready;
                } else if number == step {
                    self.say(|out| encode(out, &[number]).unwrap());
                    self.phase = Phase::Sync(step + 1);
                } else {
                    // Out of order: from the top.
                    self.phase = Phase::Sync(0);
                    if number == 0 {
                        self.say(|out| encode(out, &[0]).unwrap());
                        self.phase = Phase::Sync(1);
                    }
                }
            }
            (Phase::Sync(_), _) => {}
            (Phase::Ready, command::OPEN) => {
                self.phase = Phase::Running;
                self.motors = false;
                self.next_sip_s = self.now_s + 0.1;
            }
            (Phase::Ready, command::SYNC0) => {
                self.say(|out| encode(out, &[0]).unwrap());
                self.phase = Phase::Sync(1);
            }
            (Phase::Ready, _) => {}
            (Phase::Running, command::CLOSE) => {
                (self.velocity, self.turn, self.motors) = (0, 0, false);
                self.phase = Phase::Sync(0);
            }
            (Phase::Running, command::ENABLE) => self.motors = request.integer() != 0,
            (Phase::Running, command::SONAR) => self.sonar = request.integer() != 0,
            (Phase::Running, command::VEL2) => {
                let (left, right) = unpack_wheels(request.integer());
                self.velocity = (left + right) / 2;
                self.turn = (f64::from(right - left) / 2.0 * 0.0056).to_degrees().round() as i32;
            }
            (Phase::Running, command::VEL) => self.velocity = request.integer(),
            (Phase::Running, command::RVEL) => self.turn = request.integer(),
            (Phase::Running, command::STOP) => (self.velocity, self.turn) = (0, 0),
            (Phase::Running, command::SETO) => (self.x_mm, self.heading) = (0.0, 0.0),
            (Phase::Running, command::ENCODER) => self.encoder_mode = request.integer(),
            (Phase::Running, command::CONFIG) => {
                if let Some(config) = self.config {
                    self.say(|out| config.encode(out).unwrap());
                }
            }
            (Phase::Running, _) => {}
        }
    }

    pub fn advance(&mut self, seconds: f64) {
        let (velocity, turn) = self.motion();
        self.moved |= velocity != 0 || turn != 0;
        self.x_mm += f64::from(velocity) * seconds;
        self.heading += f64::from(turn) * seconds * 4096.0 / 360.0;
        self.now_s += seconds;
        if self.phase == Phase::Running && !self.is_mute && self.now_s >= self.next_sip_s - 1e-9 {
            self.next_sip_s += 0.1;
            self.sip();
        }
    }

    fn sip(&mut self) {
        let (velocity, turn) = self.motion();
        let difference = (f64::from(turn).to_radians() / 0.0056) as i32;
        let moving = velocity != 0 || turn != 0;
        let mut flags = if self.motors { flag::MOTORS } else { 0 };
        if self.sonar {
            flags |= 0b0110;
        }
        let mut sip = Sip {
            kind: if moving { packet::SIP_MOVING } else { packet::SIP_STOPPED },
            x: Some(self.x_mm.round() as i32 as u16 & 0x7FFF),
            y: Some(0),
            heading: Some((self.heading.round() as i32 & 0xFFF) as i16),
            left_speed: Some((velocity - difference) as i16),
            right_speed: Some((velocity + difference) as i16),
            battery_dv: Some(125),
            stall_left: Some(0),
            stall_right: Some(self.front_bumpers << 1),
            control: Some(0),
            flags: Some(flags),
            compass: Some(0),
            has_sonar: true,
            analog_port: Some(0),
            gripper: Some(0),
            analog: Some(0),
            digital_in: Some(0),
            digital_out: Some(0),
            battery_fine_dv: Some(125),
            charge_state: Some(-1),
            turn_rate_decideg_s: Some((turn * 10) as i16),
            ..Sip::default()
        };
        if self.sonar {
            for _ in 0..3 {
                for array in [0, 8] {
                    let number = array + self.next_sonar;
                    sip.sonar.push(number, self.ranges[usize::from(number)]);
                }
                self.next_sonar = (self.next_sonar + 1) % 8;
            }
        }
        self.say(|out| sip.encode(out).unwrap());
        if self.encoder_mode > 0 {
            let ticks = EncoderTicks { left: (self.x_mm * 128.0) as i32, right: (self.x_mm * 128.0) as i32 };
            self.say(|out| ticks.encode(out).unwrap());
            self.encoder_mode = if self.encoder_mode == 1 { 0 } else { self.encoder_mode };
        }
    }

    fn say(&mut self, encode: impl FnOnce(&mut [u8; MAX_PACKET]) -> usize) {
        let mut packet = [0; MAX_PACKET];
        let length = encode(&mut packet);
        self.out.extend_from_slice(&packet[..length]);
    }
}
