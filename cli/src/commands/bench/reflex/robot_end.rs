//! A Pioneer that stands before an obstacle which jumps from one side to the other with every SIP. The turn that it is
//! told must change its sign each time; how long that takes is the reflex.

use super::pty::Pty;
use crate::commands::bench::laser::LaserEnd;
use crate::commands::bench::timing::Times;
use crate::exit::Failure;
use drivers::p2os::Text;
use drivers::p2os::model;
use drivers::p2os::protocol::{Argument, COMMAND_SPACING_S, Framer, MAX_PACKET, Request, command, encode_command};
use drivers::p2os::sip::Identity;
use runtime::{Time, clock};
use simulator::mcu::{Felt, Firmware, Flash, Mcu, Session, Tops};

/// Which Pioneer it is.
const MODEL: &str = "p3dx-sh";
/// Sonar that looks 30° to the left, and its mirror image [from 0].
const LEFT_DISC: usize = 2;
const RIGHT_DISC: usize = 5;
/// An obstacle that these two turn away from, and none [mm].
const NEAR_MM: u16 = 370;
const FAR_MM: u16 = 5000;
/// Firing order [from 1]: both of them among any five in a row, all of the front among any ten.
const ORDER: [u8; 10] = [3, 6, 1, 8, 4, 3, 6, 2, 7, 5];
/// One ping in this time: five to a SIP [ms].
const PING_MS: i32 = 20;
/// Time between two SIPs by the controller's own clock [ms].
const SIP_MS: u64 = 100;
/// Pause after an answer before the next SIP: random, so that no grid of the nodes is always met at the same place [s].
const PAUSE_S: (f64, f64) = (0.015, 0.035);
/// An answer that has not come by then is lost [s].
const LOST_S: f64 = 0.5;
/// Time for handshake and motors [s].
const START_S: f64 = 20.0;
/// Answers between two rests; the robot's patience with obstacles that its turns do not get rid of is longer.
const ANSWERS: u64 = 60;
/// SIPs without an obstacle that make a rest, after which the robot has forgotten them, and the time between two [s].
const REST_SIPS: u32 = 40;
const REST_SIP_S: f64 = 0.01;
/// SIPs answered before the first that counts.
const WARM_UP: u64 = 20;

/// By what the robot sees the obstacle.
pub enum Stimulus {
    /// The controller's own sonars.
    Sonar,
    /// A laser beside it.
    Scans(LaserEnd),
}

impl Stimulus {
    /// What carries the news of the obstacle.
    pub fn packet(&self) -> &'static str {
        match self {
            Stimulus::Sonar => "SIP",
            Stimulus::Scans(_) => "scan",
        }
    }

    /// Driver and device beside the base's.
    pub fn device(&self) -> Option<String> {
        match self {
            Stimulus::Sonar => None,
            Stimulus::Scans(laser) => Some(format!("laser=pty:{}", laser.name())),
        }
    }
}

/// The controller, its end of the line, and what was measured.
pub struct RobotEnd {
    pty: Pty,
    stimulus: Stimulus,
    /// When the controller reports next, where it is not the stimulus.
    next_sip: Time,
    mcu: Mcu,
    framer: Framer,
    /// The controller's clock: goes on by a SIP's time per SIP, whatever the real time between them.
    virtual_now: Time,
    /// The sonar that sees an obstacle.
    near: Option<usize>,
    random: u64,
    /// Turn that was last commanded [deg/s].
    commanded_deg_s: i32,
    /// Commands that came, by VEL, RVEL, others.
    pub commands: [u64; 3],
    /// SIPs that were never answered.
    pub lost: u64,
    /// When a command last came; and the same before the bytes that were read last.
    last_command: Time,
    before_answer: Time,
    /// From the SIP's write to the answer's read.
    pub times: Times,
    /// Those of them that no other command came shortly before, or in between.
    pub direct: Times,
    /// The others.
    pub behind: Times,
}

/// A Pioneer 3-DX of the newer firmware.
fn flash() -> Flash {
    let model = model::named(MODEL).unwrap_or(&model::MODELS[0]);
    Flash {
        identity: Identity {
            name: Text::from("bench"),
            class: Text::from(model.class),
            subclass: Text::from(model.subclass),
        },
        serial_number: Text::from("SINEW0001"),
        firmware: Firmware::Arcos,
        distance_m_per_unit: model.distance_m_per_unit,
        watchdog_ms: 2000,
        sip_cycle_ms: SIP_MS as u8,
        front_bumpers: 0,
        rear_bumpers: 0,
        ticks_per_mm: 128,
        turn_rad_per_m: model.turn_rad_per_m,
        tops: Tops::PIONEER,
    }
}

/// What ended a wait for the client.
enum Heard {
    /// The turn that was commanded, and when.
    Turn(i32, Time),
    Nothing,
}

impl RobotEnd {
    /// A controller that waits for its client.
    pub fn new(pty: Pty, stimulus: Stimulus, most: usize) -> RobotEnd {
        RobotEnd {
            pty,
            stimulus,
            next_sip: Time::ZERO,
            mcu: Mcu::new(flash()),
            framer: Framer::new(),
            virtual_now: Time::from_seconds(1.0),
            near: Some(RIGHT_DISC),
            random: 0x9E37_79B9_7F4A_7C15,
            commanded_deg_s: 0,
            commands: [0; 3],
            lost: 0,
            last_command: Time::ZERO,
            before_answer: Time::ZERO,
            times: Times::with_room_for(most),
            direct: Times::with_room_for(most),
            behind: Times::with_room_for(most),
        }
    }

    /// Path of the client's end.
    pub fn name(&self) -> &str {
        self.pty.name()
    }

    /// Answers the handshake and moves until the client steers.
    pub fn start(&mut self, over: &dyn Fn() -> Option<Failure>) -> Result<(), Failure> {
        let until = clock::now().after_s(START_S);
        let mut polled = false;
        let mut next_sip = clock::now();
        while clock::now() < until {
            if let Some(failure) = over() {
                return Err(failure);
            }
            self.listen(clock::now().after_s(0.01))?;
            if let Stimulus::Scans(laser) = &mut self.stimulus {
                laser.serve()?;
            }
            if self.mcu.session() != Session::Running {
                polled = false;
                continue;
            }
            if !polled {
                self.tell(command::POLLING, Argument::Text(&ORDER));
                self.tell(command::SONARCYCLE, Argument::Integer(PING_MS));
                polled = true;
            }
            if self.commanded_deg_s != 0 && self.mcu.motors_enabled() {
                return Ok(());
            }
            if clock::now() >= next_sip {
                next_sip = clock::now().after_s(SIP_MS as f64 * 1e-3);
                self.sip()?;
            }
            if let Stimulus::Scans(laser) = &mut self.stimulus {
                laser.scan(Some(false))?;
            }
        }
        let state = format!(
            "{:?}, motors {}, turn {} deg/s",
            self.mcu.session(),
            self.mcu.motors_enabled(),
            self.commanded_deg_s
        );
        Err(Failure::from(format!("the robot did not begin to steer within {START_S} s ({state})")))
    }

    /// Lets the obstacle jump until `until`; now and then it goes away for a moment.
    pub fn measure(&mut self, until: Time) -> Result<(), Failure> {
        let (mut answered, mut lost) = (0_u64, false);
        while clock::now() < until {
            if answered.is_multiple_of(ANSWERS) || lost {
                self.rest()?;
                lost = false;
            }
            self.pause()?;
            let (near, wanted) = if self.commanded_deg_s > 0 { (LEFT_DISC, -1) } else { (RIGHT_DISC, 1) };
            let begin = match &mut self.stimulus {
                Stimulus::Scans(laser) => laser.scan(Some(near == LEFT_DISC))?,
                Stimulus::Sonar => {
                    self.near = Some(near);
                    self.sip()?
                }
            };
            let lost_at = begin.after_s(LOST_S);
            loop {
                self.before_answer = self.last_command;
                match self.listen(lost_at)? {
                    Heard::Turn(turn_deg_s, at) if turn_deg_s.signum() == wanted => {
                        answered += 1;
                        if answered > WARM_UP {
                            self.take(begin, at);
                        }
                        break;
                    }
                    Heard::Nothing if clock::now() >= lost_at => {
                        self.lost += 1;
                        lost = true;
                        break;
                    }
                    _ => {}
                }
            }
        }
        Ok(())
    }

    /// Lets the robot go on in the open until it has forgotten the obstacles.
    fn rest(&mut self) -> Result<(), Failure> {
        self.near = None;
        for _ in 0..REST_SIPS {
            let next = self.sip()?.after_s(REST_SIP_S);
            if let Stimulus::Scans(laser) = &mut self.stimulus {
                laser.scan(None)?;
            }
            while clock::now() < next {
                self.listen(next)?;
            }
        }
        Ok(())
    }

    fn take(&mut self, begin: Time, answered: Time) {
        self.times.push(begin, answered);
        let spaced = begin.before_s(COMMAND_SPACING_S) < self.before_answer;
        (if spaced { &mut self.behind } else { &mut self.direct }).push(begin, answered);
    }

    /// Sends the next SIP; when its bytes were handed to the terminal.
    fn sip(&mut self) -> Result<Time, Failure> {
        let dt_s = SIP_MS as f64 * 1e-3;
        self.virtual_now = self.virtual_now.after_s(dt_s);
        let now = self.virtual_now;
        self.mcu.drive(now, dt_s);
        // The wheels do not turn: a robot on blocks.
        self.mcu.observe(now, Felt::default(), dt_s);
        let near = self.near;
        self.mcu.ping(now, |disc, _| if Some(disc) == near { NEAR_MM } else { FAR_MM });
        self.mcu.report(now);
        let begin = clock::now();
        self.flush()?;
        Ok(begin)
    }

    /// Hands the controller a command that the client did not send.
    fn tell(&mut self, number: u8, argument: Argument<'_>) {
        let mut packet = [0; MAX_PACKET];
        if let Ok(length) = encode_command(&mut packet, number, argument) {
            self.mcu.receive(self.virtual_now, &packet[..length]);
        }
    }

    fn flush(&mut self) -> Result<(), Failure> {
        let bytes = self.mcu.outbox();
        let count = bytes.len();
        if count > 0 {
            self.pty.write(bytes)?;
            self.mcu.sent(count);
        }
        Ok(())
    }

    /// Sleeps until the client says something or until `until`, and obeys it.
    fn listen(&mut self, until: Time) -> Result<Heard, Failure> {
        let mut buffer = [0; 256];
        let count = self.pty.read(&mut buffer, clock::now(), until)?;
        let at = clock::now();
        let mut heard = Heard::Nothing;
        if count > 0 {
            self.last_command = at;
        }
        let mut bytes = &buffer[..count];
        while let Some(payload) = self.framer.next(&mut bytes) {
            let Some(request) = Request::parse(payload) else { continue };
            match request.number {
                command::RVEL => {
                    self.commanded_deg_s = request.integer();
                    self.commands[1] += 1;
                    heard = Heard::Turn(self.commanded_deg_s, at);
                }
                command::VEL => self.commands[0] += 1,
                _ => self.commands[2] += 1,
            }
        }
        self.mcu.receive(self.virtual_now, &buffer[..count]);
        // Answers to the handshake; a SIP goes out by `sip` alone.
        self.flush()?;
        Ok(heard)
    }

    /// Obeys the client for a random time.
    fn pause(&mut self) -> Result<(), Failure> {
        // xorshift64: nothing depends on its quality.
        self.random ^= self.random << 13;
        self.random ^= self.random >> 7;
        self.random ^= self.random << 17;
        let part = (self.random >> 11) as f64 / (1_u64 << 53) as f64;
        if let Stimulus::Scans(_) = self.stimulus
            && clock::now() >= self.next_sip
        {
            self.near = None;
            self.next_sip = self.sip()?.after_s(SIP_MS as f64 * 1e-3);
        }
        let until = clock::now().after_s(PAUSE_S.0 + part * (PAUSE_S.1 - PAUSE_S.0));
        while clock::now() < until {
            self.listen(until)?;
        }
        Ok(())
    }
}
