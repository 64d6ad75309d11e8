//! The packets that the controller sends by itself: SIP, and after it CONFIGpac, ENCODERpac, IOpac as asked.

use super::settings::{Firmware, Flash, config_packet};
use super::sonar::ARRAYS;
use super::{Core, OPEN_PORTS};
use drivers::p2os::protocol::{Builder, MAX_PACKET, flag, packet};
use drivers::p2os::sip::{EncoderTicks, Readings, Sip};
use runtime::math::wrap_angle;
use std::f64::consts::{PI, TAU};

/// Heading units per radian.
const UNITS_PER_RAD: f64 = 4096.0 / TAU;
/// Wheel speed unit [m/s].
const SPEED_UNIT_M_S: f64 = 0.001;
/// Turn rate unit [rad/s].
const TURN_UNIT_RAD_S: f64 = 0.1 * PI / 180.0;
/// "No sensor" of the temperature field.
const NO_TEMPERATURE: i8 = -127;
/// Position words have so many significant bits.
const POSITION_MASK: i64 = 0x7FFF;

impl Core {
    pub(super) fn report(&mut self, flash: &Flash) {
        let mut out = [0; MAX_PACKET];
        // None of these can fail: every packet is far smaller than the buffer.
        let length = self.sip(flash).encode(&mut out).unwrap_or(0);
        self.outbox.push(&out[..length]);
        self.sonar.fresh = Readings::EMPTY;
        if std::mem::take(&mut self.wants_config) {
            let length = config_packet(flash, &self.settings).encode(&mut out).unwrap_or(0);
            self.outbox.push(&out[..length]);
        }
        if self.encoder_packets.take() {
            let ticks = EncoderTicks { left: self.odometer.left_ticks as i32, right: self.odometer.right_ticks as i32 };
            let length = ticks.encode(&mut out).unwrap_or(0);
            self.outbox.push(&out[..length]);
        }
        if self.io_packets.take() {
            // One bank of inputs, one of outputs, no analogue channel.
            let mut builder = Builder::new(&mut out, packet::IO);
            let length = builder.u8(1).u8(OPEN_PORTS).u8(1).u8(self.digital_out).u8(0).finish().unwrap_or(0);
            self.outbox.push(&out[..length]);
        }
    }

    pub(super) fn sip(&self, flash: &Flash) -> Sip {
        let position = |metres: f64| Some(((metres / flash.distance_m_per_unit).round() as i64 & POSITION_MASK) as u16);
        let speed = |m_s: f64| Some((m_s / SPEED_UNIT_M_S).round() as i16);
        let odometer = &self.odometer;
        let turn_rad_s = 0.5 * (odometer.right_m_s - odometer.left_m_s) * flash.turn_rad_per_m;
        let mut sip = Sip {
            kind: if self.moves() { packet::SIP_MOVING } else { packet::SIP_STOPPED },
            x: position(odometer.x_m),
            y: position(odometer.y_m),
            heading: heading_units(odometer.heading_rad),
            left_speed: speed(odometer.left_m_s),
            right_speed: speed(odometer.right_m_s),
            battery_dv: Some(self.battery.decivolts().min(255) as u8),
            stall_left: Some(u8::from(self.felt.left_blocked) | self.felt.rear_bumpers << 1),
            stall_right: Some(u8::from(self.felt.right_blocked) | self.felt.front_bumpers << 1),
            control: heading_units(self.heading_set_point_rad),
            flags: Some(self.flags()),
            compass: Some(0),
            sonar: self.sonar.fresh,
            has_sonar: true,
            analog_port: Some(0),
            gripper: Some(0),
            analog: Some(0),
            digital_in: Some(OPEN_PORTS),
            digital_out: Some(self.digital_out),
            ..Sip::default()
        };
        if flash.firmware == Firmware::Arcos {
            sip.battery_fine_dv = Some(self.battery.decivolts());
            sip.charge_state = Some(0);
            sip.turn_rate_decideg_s = Some((turn_rad_s / TURN_UNIT_RAD_S).round() as i16);
            sip.faults = Some(0);
            sip.sideways_speed = Some(0);
            sip.temperature_c = Some(NO_TEMPERATURE);
            sip.charge_percent = Some(self.battery.charge_percent());
        }
        sip
    }

    fn flags(&self) -> u16 {
        let mut flags = 0;
        if self.motors {
            flags |= flag::MOTORS;
        }
        for array in 0..ARRAYS {
            if self.sonar.is_on(array) {
                flags |= 1 << (1 + array);
            }
        }
        if self.stop_button {
            flags |= flag::STOP_BUTTON;
            if self.settings.stop_button_disables {
                flags |= flag::E_STALL;
            }
        }
        flags
    }
}

/// −2048…2047.
fn heading_units(heading_rad: f64) -> Option<i16> {
    let units = (wrap_angle(heading_rad) * UNITS_PER_RAD).round() as i16;
    Some(if units == 2048 { -2048 } else { units })
}
