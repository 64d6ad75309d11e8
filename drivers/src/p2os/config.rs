//! The configuration packet (CONFIGpac): parsed by the driver, encoded by a simulated microcontroller.
//!
//! As with the SIP, any prefix is legal: fields that the packet ended before read as their default, zero or empty.
//! Zero means "not told", as the vendor's own client takes it.

use super::fields::{Fields, Text};
use super::protocol::{Builder, EncodeError, packet};

macro_rules! config_packet {
    ($($(#[$doc:meta])* $name:ident: $kind:ident,)*) => {
        /// The body of a CONFIGpac in wire order, raw. The sequence of the fields is the packet's.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
        pub struct ConfigPacket {
            $($(#[$doc])* pub $name: config_packet!(@type $kind),)*
        }

        impl ConfigPacket {
            /// Reads a payload; `None` when it is another packet.
            pub fn parse(payload: &[u8]) -> Option<ConfigPacket> {
                let (&packet::CONFIG, body) = payload.split_first()? else { return None };
                let mut fields = Fields::new(body);
                Some(ConfigPacket { $($name: fields.$kind().unwrap_or_default(),)* })
            }

            /// Frames the packet into `out`; returns its length.
            pub fn encode(&self, out: &mut [u8]) -> Result<usize, EncodeError> {
                let mut builder = Builder::new(out, packet::CONFIG);
                $(config_packet!(@put builder self.$name, $kind);)*
                builder.finish()
            }
        }
    };
    (@type text) => { Text };
    (@type $kind:ident) => { $kind };
    (@put $to:ident $value:expr, text) => { $to.text($value.as_str()) };
    (@put $to:ident $value:expr, $kind:ident) => { $to.$kind($value) };
}

config_packet! {
    /// Class, as in the identity.
    class: text,
    /// Subclass, as in the identity.
    subclass: text,
    /// Serial number; `SIM` for simulators.
    serial_number: text,
    /// 1 for four motors.
    four_motors: u8,
    /// Absolute cap [deg/s].
    rotation_speed_top: u16,
    /// Absolute cap [mm/s].
    translation_speed_top: u16,
    /// Absolute cap [deg/s²].
    rotation_acceleration_top: u16,
    /// Absolute cap [mm/s²].
    translation_acceleration_top: u16,
    /// Greatest motor drive.
    pwm_max: u16,
    /// Name, as in the identity.
    name: text,
    /// Time between SIPs [ms].
    sip_cycle_ms: u8,
    /// Code of the host port's speed.
    host_baud: u8,
    /// Code of AUX1's speed.
    aux1_baud: u8,
    /// 1 with a gripper.
    has_gripper: u16,
    /// 1 with a front sonar array.
    has_front_sonar: u16,
    /// 1 with a rear sonar array (a byte, not a word).
    has_rear_sonar: u8,
    /// Alarm voltage [dV].
    low_battery_dv: u16,
    /// Encoder ticks per half turn.
    revolution_count: u16,
    /// Silence after which the robot stops [ms].
    watchdog_ms: u16,
    /// Newer packets.
    p2_packets: u8,
    /// Drive at which a motionless wheel counts as stalled.
    stall_value: u16,
    /// Time that a stall lasts [ms].
    stall_count: u16,
    /// Joystick speed [mm/s].
    joystick_speed: u16,
    /// Joystick turn rate [deg/s].
    joystick_turn_rate: u16,
    /// Current cap [deg/s].
    rotation_speed_max: u16,
    /// Current cap [mm/s].
    translation_speed_max: u16,
    /// [deg/s²].
    rotation_acceleration: u16,
    /// [deg/s²].
    rotation_deceleration: u16,
    /// Gain.
    rotation_kp: u16,
    /// Gain.
    rotation_kv: u16,
    /// Gain.
    rotation_ki: u16,
    /// [mm/s²].
    translation_acceleration: u16,
    /// [mm/s²].
    translation_deceleration: u16,
    /// Gain.
    translation_kp: u16,
    /// Gain.
    translation_kv: u16,
    /// Gain.
    translation_ki: u16,
    /// Front bumper segments.
    front_bumpers: u8,
    /// Rear bumper segments.
    rear_bumpers: u8,
    /// Kind of charger.
    charger: u8,
    /// Time per ping [ms].
    sonar_cycle_ms: u8,
    /// 2: the host port's speed may be switched.
    auto_baud: u8,
    /// 1 with a gyro.
    has_gyro: u8,
    /// Difference between the wheels.
    drift_factor: i16,
    /// Code of AUX2's speed.
    aux2_baud: u8,
    /// Code of AUX3's speed.
    aux3_baud: u8,
    /// Encoder ticks per millimetre.
    ticks_per_mm: u16,
    /// Voltage at which the robot shuts down [dV].
    shutdown_dv: u16,
    /// Firmware version.
    firmware: text,
    /// Gyro calibration.
    gyro_clockwise: u16,
    /// Gyro calibration.
    gyro_counter_clockwise: u16,
    /// Kinematics delay [ms].
    kinematics_delay_ms: u8,
    /// Absolute cap of holonomic models [mm/s].
    sideways_speed_top: u16,
    /// Absolute cap of holonomic models [mm/s²].
    sideways_acceleration_top: u16,
    /// Current cap of holonomic models [mm/s].
    sideways_speed_max: u16,
    /// [mm/s²].
    sideways_acceleration: u16,
    /// [mm/s²].
    sideways_deceleration: u16,
    /// Charge threshold.
    charge_threshold: u16,
}
