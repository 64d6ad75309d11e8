//! The Pioneer's microcontroller: bytes in, bytes out, clock in; it knows nothing of worlds.
//!
//! ```text
//! waiting for SYNC0 ─► SYNC1 ─► SYNC2 ─► ready ─ OPEN ─► running ─ CLOSE ─► waiting
//! ```
//!
//! Each physics step the owner calls, in this order: [`receive`](Mcu::receive) what the client sent,
//! [`drive`](Mcu::drive) for the wheels' motion, [`observe`](Mcu::observe) with what the wheels and bumpers did,
//! [`ping`](Mcu::ping) for the sonar, [`report`](Mcu::report); then it takes the bytes in [`outbox`](Mcu::outbox) away.
//!
//! As the firmware does it: motors are off after OPEN; any command feeds the watchdog, silence stops the robot, and the
//! next command *resumes the old motion*; a wheel that is driven and cannot turn is without power for a moment and
//! tries again; wrong checksums and unknown commands are ignored without a word.

mod battery;
mod drive;
mod obey;
mod odometer;
mod outbox;
mod report;
mod settings;
mod sonar;
#[cfg(test)]
mod tests;

pub use settings::{Firmware, Flash, Tops};

use battery::Battery;
use drive::{Axis, Goal};
use drivers::p2os::protocol::{Framer, MAX_COMMAND_COUNT};
use odometer::Odometer;
use outbox::Outbox;
use runtime::Time;
use settings::Settings;
use sonar::SonarUnit;

/// Deceleration of E_STOP, as hard as the tyres hold [m/s²] and [rad/s²].
const EMERGENCY_M_S2: f64 = 3.0;
const EMERGENCY_RAD_S2: f64 = 20.0;
/// Deceleration of wheels without power [m/s²] and [rad/s²].
const COAST_M_S2: f64 = 1.0;
const COAST_RAD_S2: f64 = 5.0;
/// Digital ports read high when nothing is plugged in.
const OPEN_PORTS: u8 = 0xFF;
/// Slower than this counts as standing [m/s].
const STANDING_M_S: f64 = 0.002;

/// Where a session stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Session {
    /// Waits for SYNC with this number.
    Waiting(u8),
    /// Handshake done, waits for OPEN.
    Ready,
    /// Sends SIPs and obeys.
    Running,
}

/// What the wheels are told to do in one step.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Drive {
    /// Mean forward speed over the step [m/s].
    pub speed_m_s: f64,
    /// Mean turn rate over the step, counter-clockwise [rad/s].
    pub turn_rad_s: f64,
}

/// What the wheels and the bumpers did in one step.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Felt {
    /// The encoders' counts since power-on [tick].
    pub left_ticks: i64,
    /// The encoders' counts since power-on [tick].
    pub right_ticks: i64,
    /// The left wheel was driven and could not turn as told.
    pub left_blocked: bool,
    /// The right wheel was driven and could not turn as told.
    pub right_blocked: bool,
    /// Pressed segments of the front bumper, bit 0 the leftmost.
    pub front_bumpers: u8,
    /// Pressed segments of the rear bumper, bit 0 the leftmost as seen from the driver's seat.
    pub rear_bumpers: u8,
}

/// Whether a packet goes out with every SIP.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Stream {
    Off,
    Once,
    Each,
}

/// The microcontroller.
#[derive(Debug, Clone)]
pub struct Mcu {
    flash: Flash,
    framer: Framer,
    /// All but the framer, so that a payload can be lent from there while this changes.
    core: Core,
}

#[derive(Debug, Clone)]
struct Core {
    session: Session,
    settings: Settings,
    translation: Axis,
    rotation: Axis,
    /// The goals came from VEL2 and go together.
    by_wheels: bool,
    heading_set_point_rad: f64,
    emergency: bool,
    motors: bool,
    stop_button: bool,
    odometer: Odometer,
    sonar: SonarUnit,
    battery: Battery,
    outbox: Outbox,
    felt: Felt,
    last_command: Time,
    powerless_until: Time,
    next_sip: Time,
    encoder_packets: Stream,
    io_packets: Stream,
    wants_config: bool,
    digital_out: u8,
    hung_up: bool,
}

impl Mcu {
    /// A controller as it is after power-on.
    pub fn new(flash: Flash) -> Mcu {
        let core = Core {
            session: Session::Waiting(0),
            settings: Settings::FACTORY,
            translation: Axis::STILL,
            rotation: Axis::STILL,
            by_wheels: false,
            heading_set_point_rad: 0.0,
            emergency: false,
            motors: false,
            stop_button: false,
            odometer: Odometer::default(),
            sonar: SonarUnit::new(),
            battery: Battery::default(),
            outbox: Outbox::new(),
            felt: Felt::default(),
            last_command: Time::ZERO,
            powerless_until: Time::ZERO,
            next_sip: Time::ZERO,
            encoder_packets: Stream::Off,
            io_packets: Stream::Off,
            wants_config: false,
            digital_out: OPEN_PORTS,
            hung_up: false,
        };
        Mcu { flash, framer: Framer::with_max_count(MAX_COMMAND_COUNT), core }
    }

    /// Takes bytes from the client and obeys the commands that they complete.
    pub fn receive(&mut self, now: Time, mut bytes: &[u8]) {
        while let Some(payload) = self.framer.next(&mut bytes) {
            self.core.obey(&self.flash, now, payload);
        }
    }

    /// Moves both axes by one step of `dt_s` and says how the wheels turn meanwhile.
    pub fn drive(&mut self, now: Time, dt_s: f64) -> Drive {
        let watchdog_s = f64::from(self.flash.watchdog_ms) * 1e-3;
        self.core.drive(now, watchdog_s, dt_s)
    }

    /// Takes over what the wheels and bumpers did while driving as [`drive`](Mcu::drive) said.
    pub fn observe(&mut self, now: Time, felt: Felt, dt_s: f64) {
        let ticks_per_m = f64::from(self.flash.ticks_per_mm) * 1000.0;
        let turn_rad_per_m = self.flash.turn_rad_per_m;
        self.core.observe(now, felt, ticks_per_m, turn_rad_per_m, dt_s);
    }

    /// Fires the discs that are due. `range_units` answers the reading of a disc; its second argument is the disc of
    /// the other array that fires at the same time.
    pub fn ping(&mut self, now: Time, range_units: impl FnMut(usize, Option<usize>) -> u16) {
        if self.core.session == Session::Running {
            self.core.sonar.fire(now, self.core.settings.sonar_cycle_ms, range_units);
        }
    }

    /// Puts the SIP and its companions into the outbox when their time has come.
    pub fn report(&mut self, now: Time) {
        if self.core.session == Session::Running && now >= self.core.next_sip {
            self.core.next_sip = self.core.next_sip.after_ns(u64::from(self.flash.sip_cycle_ms) * 1_000_000);
            self.core.report(&self.flash);
        }
    }

    /// Bytes for the client, oldest first.
    pub fn outbox(&self) -> &[u8] {
        self.core.outbox.bytes()
    }

    /// Says that the first `count` bytes of the outbox are on their way.
    pub fn sent(&mut self, count: usize) {
        self.core.outbox.drop_front(count);
    }

    /// Whether the client has ended the session since the last call: over TCP the connection is then closed.
    pub fn take_hung_up(&mut self) -> bool {
        std::mem::take(&mut self.core.hung_up)
    }

    /// Restarts the controller: the session is gone, the odometry zero, the battery as it was.
    pub fn restart(&mut self) {
        let Core { battery, odometer, felt, stop_button, .. } = self.core;
        *self = Mcu::new(self.flash);
        self.core.battery = battery;
        self.core.stop_button = stop_button;
        self.core.felt = felt;
        // The encoders count on.
        self.core.odometer.left_ticks = odometer.left_ticks;
        self.core.odometer.right_ticks = odometer.right_ticks;
    }

    /// Presses or releases the red button.
    pub fn press_stop_button(&mut self, pressed: bool) {
        self.core.stop_button = pressed;
        if pressed && self.core.settings.stop_button_disables {
            self.core.set_motors(false);
        }
    }

    /// Where the session stands.
    pub fn session(&self) -> Session {
        self.core.session
    }

    /// Whether the motors have power.
    pub fn motors_enabled(&self) -> bool {
        self.core.motors
    }

    /// Whether the low-battery alarm sounds.
    pub fn low_battery(&self) -> bool {
        self.core.battery.decivolts() < settings::LOW_BATTERY_DV
    }

    /// The host port's rate that the client asked for with HOSTBAUD; `None` when it never did [baud].
    pub fn requested_baud(&self) -> Option<u32> {
        let code = usize::from(self.core.settings.host_baud);
        drivers::p2os::protocol::BAUDS.get(code).copied().filter(|_| code > 0)
    }

    /// What it keeps in flash.
    pub fn flash(&self) -> &Flash {
        &self.flash
    }
}

impl Core {
    fn drive(&mut self, now: Time, watchdog_s: f64, dt_s: f64) -> Drive {
        let (speed_m_s, turn_rad_s) = if self.emergency {
            let both = (self.translation.brake(EMERGENCY_M_S2, dt_s), self.rotation.brake(EMERGENCY_RAD_S2, dt_s));
            self.emergency = self.translation.speed != 0.0 || self.rotation.speed != 0.0;
            both
        } else if !self.motors || now < self.powerless_until {
            (self.translation.brake(COAST_M_S2, dt_s), self.rotation.brake(COAST_RAD_S2, dt_s))
        } else {
            // A client that fell silent is gone: stand still until it comes back, then go on as it had wished.
            let hold = now.since(self.last_command) > watchdog_s;
            let Settings { translation, rotation, .. } = &self.settings;
            let forward = self.translation.advance(translation, self.odometer.way_m, hold, dt_s);
            (forward, self.rotation.advance(rotation, self.odometer.heading_rad, hold, dt_s))
        };
        self.battery.drain(dt_s, speed_m_s != 0.0 || turn_rad_s != 0.0);
        Drive { speed_m_s, turn_rad_s }
    }

    fn observe(&mut self, now: Time, felt: Felt, ticks_per_m: f64, turn_rad_per_m: f64, dt_s: f64) {
        self.odometer.update(felt.left_ticks, felt.right_ticks, ticks_per_m, turn_rad_per_m, dt_s);
        let bumped = (self.settings.bump_stall & 1 != 0 && felt.front_bumpers != 0 && self.translation.speed > 0.0)
            || (self.settings.bump_stall & 2 != 0 && felt.rear_bumpers != 0 && self.translation.speed < 0.0);
        let tried = self.motors && now >= self.powerless_until;
        if tried && (felt.left_blocked || felt.right_blocked || bumped) {
            self.powerless_until = now.after_ns(u64::from(settings::STALL_COUNT_MS) * 1_000_000);
            self.felt.left_blocked = felt.left_blocked || bumped;
            self.felt.right_blocked = felt.right_blocked || bumped;
        } else if tried || !self.motors {
            (self.felt.left_blocked, self.felt.right_blocked) = (false, false);
        }
        if felt.left_blocked || felt.right_blocked {
            // The ramps go on from what the wheels really did.
            let (left, right) = (self.odometer.left_m_s, self.odometer.right_m_s);
            self.translation.speed = 0.5 * (left + right);
            self.rotation.speed = 0.5 * (right - left) * turn_rad_per_m;
        }
        (self.felt.front_bumpers, self.felt.rear_bumpers) = (felt.front_bumpers, felt.rear_bumpers);
        if self.motors && self.battery.decivolts() < settings::SHUTDOWN_DV {
            self.set_motors(false);
        }
    }

    fn set_motors(&mut self, on: bool) {
        self.motors = on && !(self.stop_button && self.settings.stop_button_disables);
        // Goals of before never act after a change of power.
        self.stand_still();
    }

    fn stand_still(&mut self) {
        self.translation.goal = Goal::Speed(0.0);
        self.rotation.goal = Goal::Speed(0.0);
        self.by_wheels = false;
        self.heading_set_point_rad = self.odometer.heading_rad;
    }

    fn moves(&self) -> bool {
        self.odometer.left_m_s.abs() > STANDING_M_S
            || self.odometer.right_m_s.abs() > STANDING_M_S
            || !self.translation.rests()
            || self.rotation.speed != 0.0
    }
}
