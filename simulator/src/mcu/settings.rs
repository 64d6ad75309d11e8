//! What the controller keeps in flash: limits, cycles, identity; and the packet that tells it.

use super::drive::Limits;
use drivers::p2os::Text;
use drivers::p2os::config::ConfigPacket;
use drivers::p2os::sip::Identity;
use std::f64::consts::PI;

const DEG: f64 = PI / 180.0;
const MM: f64 = 0.001;

/// Which firmware answers: they differ in what a SIP tells.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Firmware {
    /// SIPs end after the digital outputs.
    P2os,
    /// SIPs go on to the state of charge.
    Arcos,
}

/// Everything about a controller that a session cannot change for good.
#[derive(Debug, Clone, Copy)]
pub struct Flash {
    /// Name, class, subclass.
    pub identity: Identity,
    /// Serial number. Clients take `SIM` for a simulator with a laser inside its stream, which this is not.
    pub serial_number: Text,
    /// Which firmware.
    pub firmware: Firmware,
    /// Position per unit of XPOS and YPOS [m].
    pub distance_m_per_unit: f64,
    /// Silence after which the robot stops [ms].
    pub watchdog_ms: u16,
    /// Time between SIPs [ms].
    pub sip_cycle_ms: u8,
    /// Segments of the front bumper; 0: none fitted.
    pub front_bumpers: u8,
    /// Segments of the rear bumper; 0: none fitted.
    pub rear_bumpers: u8,
    /// Encoder ticks per millimetre of wheel travel.
    pub ticks_per_mm: u16,
    /// Heading per difference of the wheels' ways, (right − left)/2 × this [rad/m].
    pub turn_rad_per_m: f64,
    /// What no setting exceeds.
    pub tops: Tops,
}

/// Caps that no setting exceeds (the packet's "Top" values), in wire units.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Tops {
    /// [mm/s].
    pub translation_mm_s: u16,
    /// [deg/s].
    pub rotation_deg_s: u16,
    /// [mm/s²].
    pub translation_acceleration_mm_s2: u16,
    /// [deg/s²].
    pub rotation_acceleration_deg_s2: u16,
}

impl Tops {
    /// A Pioneer's.
    pub const PIONEER: Tops = Tops {
        translation_mm_s: 2200,
        rotation_deg_s: 500,
        translation_acceleration_mm_s2: 2000,
        rotation_acceleration_deg_s2: 600,
    };
}

/// Alarm, and the voltage at which the motors go off [dV].
pub(super) const LOW_BATTERY_DV: u16 = 110;
pub(super) const SHUTDOWN_DV: u16 = 105;
/// A wheel that is driven and does not turn goes without power for so long [ms].
pub(super) const STALL_COUNT_MS: u16 = 100;

/// What a session may change; back to these values when it ends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Settings {
    pub translation: Limits,
    pub rotation: Limits,
    pub sonar_cycle_ms: u8,
    pub bump_stall: u8,
    pub host_baud: u8,
    pub stop_button_disables: bool,
}

impl Settings {
    pub const FACTORY: Settings = Settings {
        translation: Limits { speed: 750.0 * MM, acceleration: 300.0 * MM, deceleration: 600.0 * MM },
        rotation: Limits { speed: 100.0 * DEG, acceleration: 100.0 * DEG, deceleration: 100.0 * DEG },
        sonar_cycle_ms: 40,
        bump_stall: 0,
        host_baud: 0,
        stop_button_disables: false,
    };

    /// SETV.
    pub fn set_translation_speed(&mut self, tops: &Tops, mm_s: i32) {
        set(&mut self.translation.speed, mm_s, tops.translation_mm_s, MM);
    }

    /// SETRV.
    pub fn set_rotation_speed(&mut self, tops: &Tops, deg_s: i32) {
        set(&mut self.rotation.speed, deg_s, tops.rotation_deg_s, DEG);
    }

    /// SETA: positive sets the acceleration, negative the deceleration.
    pub fn set_translation_ramp(&mut self, tops: &Tops, mm_s2: i32) {
        let Limits { acceleration, deceleration, .. } = &mut self.translation;
        let limit = if mm_s2 > 0 { acceleration } else { deceleration };
        set(limit, mm_s2, tops.translation_acceleration_mm_s2, MM);
    }

    /// SETRA: positive sets the acceleration, negative the deceleration.
    pub fn set_rotation_ramp(&mut self, tops: &Tops, deg_s2: i32) {
        let Limits { acceleration, deceleration, .. } = &mut self.rotation;
        let limit = if deg_s2 > 0 { acceleration } else { deceleration };
        set(limit, deg_s2, tops.rotation_acceleration_deg_s2, DEG);
    }
}

/// Sets a limit; zero would make a robot that never moves or never stops, and is passed over.
fn set(limit: &mut f64, value: i32, top: u16, unit: f64) {
    let magnitude = value.unsigned_abs().min(u32::from(top));
    if magnitude > 0 {
        *limit = f64::from(magnitude) * unit;
    }
}

/// The CONFIGpac.
pub(super) fn config_packet(flash: &Flash, settings: &Settings) -> ConfigPacket {
    let wire = |value: f64, unit: f64| (value / unit).round() as u16;
    ConfigPacket {
        class: flash.identity.class,
        subclass: flash.identity.subclass,
        serial_number: flash.serial_number,
        rotation_speed_top: flash.tops.rotation_deg_s,
        translation_speed_top: flash.tops.translation_mm_s,
        rotation_acceleration_top: flash.tops.rotation_acceleration_deg_s2,
        translation_acceleration_top: flash.tops.translation_acceleration_mm_s2,
        pwm_max: 500,
        name: flash.identity.name,
        sip_cycle_ms: flash.sip_cycle_ms,
        host_baud: settings.host_baud,
        has_front_sonar: 1,
        has_rear_sonar: 1,
        low_battery_dv: LOW_BATTERY_DV,
        revolution_count: 16_570,
        watchdog_ms: flash.watchdog_ms,
        p2_packets: 1,
        stall_value: 200,
        stall_count: STALL_COUNT_MS,
        rotation_speed_max: wire(settings.rotation.speed, DEG),
        translation_speed_max: wire(settings.translation.speed, MM),
        rotation_acceleration: wire(settings.rotation.acceleration, DEG),
        rotation_deceleration: wire(settings.rotation.deceleration, DEG),
        translation_acceleration: wire(settings.translation.acceleration, MM),
        translation_deceleration: wire(settings.translation.deceleration, MM),
        rotation_kp: 40,
        rotation_kv: 20,
        translation_kp: 40,
        translation_kv: 20,
        front_bumpers: flash.front_bumpers,
        rear_bumpers: flash.rear_bumpers,
        sonar_cycle_ms: settings.sonar_cycle_ms,
        // The line keeps the speed that it has: a client would otherwise switch and lose a pseudo-terminal's peer.
        auto_baud: 0,
        ticks_per_mm: flash.ticks_per_mm,
        shutdown_dv: SHUTDOWN_DV,
        firmware: Text::from(match flash.firmware {
            Firmware::P2os => "1.K",
            Firmware::Arcos => "2.8",
        }),
        ..ConfigPacket::default()
    }
}
