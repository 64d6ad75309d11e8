//! The standard information packet (SIP), the encoder packet and the identity of a robot: parsed and encoded.
//!
//! Both ends use this file: the driver parses, a simulated microcontroller encodes. Numbers are raw (device units);
//! [`super::model`] has the factors. Every field after the type may be missing: P2OS ends after the digital outputs,
//! newer firmware goes on, and any prefix is legal. `None` is "the packet ended before".

use super::fields::{Fields, Text};
use super::protocol::{Builder, EncodeError, command, packet};

/// Readings that one SIP can hold at most.
pub const MAX_READINGS: usize = 77;

/// One new sonar reading.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Reading {
    /// Transducer, counted from 0.
    pub number: u8,
    /// Distance [device units, mm by default].
    pub range: u16,
}

/// The readings of one SIP: those that are new since the last one.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Readings {
    readings: [Reading; MAX_READINGS],
    count: u8,
}

impl Readings {
    /// None.
    pub const EMPTY: Readings = Readings { readings: [Reading { number: 0, range: 0 }; MAX_READINGS], count: 0 };

    /// Appends a reading; `false` when the list is full.
    pub fn push(&mut self, number: u8, range: u16) -> bool {
        match self.readings.get_mut(usize::from(self.count)) {
            Some(free) => {
                *free = Reading { number, range };
                self.count += 1;
                true
            }
            None => false,
        }
    }
}

impl Default for Readings {
    fn default() -> Readings {
        Readings::EMPTY
    }
}

impl std::ops::Deref for Readings {
    type Target = [Reading];
    fn deref(&self) -> &[Reading] {
        &self.readings[..usize::from(self.count)]
    }
}

impl std::fmt::Debug for Readings {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.debug_list().entries(self.iter()).finish()
    }
}

/// A SIP in wire order, raw. See the module's text for what `None` means.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Sip {
    /// Packet type: [`packet::SIP_STOPPED`] or [`packet::SIP_MOVING`], sometimes a neighbour.
    pub kind: u8,
    /// Position, of which 15 bits count; see [`Unwrap15`] [device units].
    pub x: Option<u16>,
    /// Position, of which 15 bits count [device units].
    pub y: Option<u16>,
    /// Heading, counter-clockwise, 4096 units per turn.
    pub heading: Option<i16>,
    /// Speed of the left wheel [device units, mm/s by default].
    pub left_speed: Option<i16>,
    /// Speed of the right wheel [device units, mm/s by default].
    pub right_speed: Option<i16>,
    /// Battery voltage [dV].
    pub battery_dv: Option<u8>,
    /// Bit 0 left wheel stalled, the others rear bumpers.
    pub stall_left: Option<u8>,
    /// Bit 0 right wheel stalled, the others front bumpers.
    pub stall_right: Option<u8>,
    /// Heading set-point [4096 units per turn].
    pub control: Option<i16>,
    /// See [`flag`](super::protocol::flag).
    pub flags: Option<u16>,
    /// Compass [2 deg].
    pub compass: Option<u8>,
    /// New sonar readings; what the packet's end cuts off is left out.
    pub sonar: Readings,
    /// Whether the packet went on to the number of readings.
    pub has_sonar: bool,
    /// Analogue port shown.
    pub analog_port: Option<u8>,
    /// Gripper state.
    pub gripper: Option<u8>,
    /// Analogue value, 0…255 for 0…5 V.
    pub analog: Option<u8>,
    /// Digital inputs.
    pub digital_in: Option<u8>,
    /// Digital outputs.
    pub digital_out: Option<u8>,
    /// Battery voltage with 16 bits [dV].
    pub battery_fine_dv: Option<u16>,
    /// 0 not charging, 1 bulk, 2 over, 3 float, 4 balance, −1 unknown.
    pub charge_state: Option<i8>,
    /// Turn rate, counter-clockwise [0.1 deg/s].
    pub turn_rate_decideg_s: Option<i16>,
    /// Fault bits.
    pub faults: Option<u16>,
    /// Sideways speed [mm/s].
    pub sideways_speed: Option<i16>,
    /// Temperature; −127 when there is no sensor [°C].
    pub temperature_c: Option<i8>,
    /// State of charge [%].
    pub charge_percent: Option<u8>,
    /// Controller's clock, newest models only [µs].
    pub clock_us: Option<u32>,
    /// More flags, newest models only.
    pub flags3: Option<u32>,
}

impl Sip {
    /// Reads a payload; `None` when its type is not a SIP's.
    pub fn parse(payload: &[u8]) -> Option<Sip> {
        let (kind, body) = payload.split_first()?;
        if !packet::is_sip(*kind) {
            return None;
        }
        let mut fields = Fields::new(body);
        let mut sip = Sip {
            kind: *kind,
            x: fields.u16(),
            y: fields.u16(),
            heading: fields.i16(),
            left_speed: fields.i16(),
            right_speed: fields.i16(),
            battery_dv: fields.u8(),
            stall_left: fields.u8(),
            stall_right: fields.u8(),
            control: fields.i16(),
            flags: fields.u16(),
            compass: fields.u8(),
            ..Sip::default()
        };
        let count = fields.u8();
        sip.has_sonar = count.is_some();
        for _ in 0..count.unwrap_or(0) {
            let (Some(number), Some(range)) = (fields.u8(), fields.u16()) else { break };
            sip.sonar.push(number, range);
        }
        Some(Sip {
            analog_port: fields.u8(),
            gripper: fields.u8(),
            analog: fields.u8(),
            digital_in: fields.u8(),
            digital_out: fields.u8(),
            battery_fine_dv: fields.u16(),
            charge_state: fields.i8(),
            turn_rate_decideg_s: fields.i16(),
            faults: fields.u16(),
            sideways_speed: fields.i16(),
            temperature_c: fields.i8(),
            charge_percent: fields.u8(),
            clock_us: fields.u32(),
            flags3: fields.u32(),
            ..sip
        })
    }

    /// Frames the SIP into `out`; ends before the first field that is `None`. Returns the packet's length.
    pub fn encode(&self, out: &mut [u8]) -> Result<usize, EncodeError> {
        let mut builder = Builder::new(out, self.kind);
        // The chain ends at the first missing field; how far it came does not matter.
        let _ = self.put(&mut builder);
        builder.finish()
    }

    fn put(&self, to: &mut Builder) -> Option<()> {
        to.u16(self.x?).u16(self.y?).i16(self.heading?).i16(self.left_speed?).i16(self.right_speed?);
        to.u8(self.battery_dv?).u8(self.stall_left?).u8(self.stall_right?).i16(self.control?).u16(self.flags?);
        to.u8(self.compass?);
        if !self.has_sonar {
            return None;
        }
        to.u8(self.sonar.count);
        for reading in self.sonar.iter() {
            to.u8(reading.number).u16(reading.range);
        }
        to.u8(self.analog_port?).u8(self.gripper?).u8(self.analog?).u8(self.digital_in?).u8(self.digital_out?);
        to.u16(self.battery_fine_dv?).u8(self.charge_state? as u8).i16(self.turn_rate_decideg_s?);
        to.u16(self.faults?).i16(self.sideways_speed?).u8(self.temperature_c? as u8).u8(self.charge_percent?);
        to.u32(self.clock_us?).u32(self.flags3?);
        Some(())
    }

    /// Left wheel stalled.
    pub fn is_left_stalled(&self) -> bool {
        self.stall_left.is_some_and(|bits| bits & 1 != 0)
    }

    /// Right wheel stalled.
    pub fn is_right_stalled(&self) -> bool {
        self.stall_right.is_some_and(|bits| bits & 1 != 0)
    }

    /// Front bumpers, a bit per segment from bit 0.
    pub fn front_bumpers(&self) -> u32 {
        u32::from(self.stall_right.unwrap_or(0) >> 1)
    }

    /// Rear bumpers, a bit per segment from bit 0.
    pub fn rear_bumpers(&self) -> u32 {
        u32::from(self.stall_left.unwrap_or(0) >> 1)
    }
}

/// Turns a counter of 15 significant bits into steps: the shortest way from the last value to the next one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Unwrap15 {
    last: Option<u16>,
}

impl Unwrap15 {
    /// The step from the last value, −16384…16383; zero for the first value.
    pub fn step(&mut self, raw: u16) -> i32 {
        let last = self.last.replace(raw).unwrap_or(raw);
        // Shifted to the top of a word, the 15 bits wrap as the word does; the arithmetic shift brings the sign back.
        i32::from((raw.wrapping_sub(last) << 1) as i16 >> 1)
    }

    /// Makes the next value the first one.
    pub fn restart(&mut self) {
        self.last = None;
    }
}

/// Accumulated ticks of both wheels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct EncoderTicks {
    /// Left wheel [tick].
    pub left: i32,
    /// Right wheel [tick].
    pub right: i32,
}

impl EncoderTicks {
    /// Reads an ENCODERpac's payload.
    pub fn parse(payload: &[u8]) -> Option<EncoderTicks> {
        let (&packet::ENCODER, body) = payload.split_first()? else { return None };
        let mut fields = Fields::new(body);
        Some(EncoderTicks { left: fields.i32()?, right: fields.i32()? })
    }

    /// Frames an ENCODERpac into `out`; returns the packet's length.
    pub fn encode(&self, out: &mut [u8]) -> Result<usize, EncodeError> {
        Builder::new(out, packet::ENCODER).i32(self.left).i32(self.right).finish()
    }
}

/// Who the robot says it is, in the echo of SYNC2.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Identity {
    /// Name given by the owner.
    pub name: Text,
    /// `Pioneer` and the like.
    pub class: Text,
    /// `p3dx-sh` and the like; with the class it chooses the parameters.
    pub subclass: Text,
}

impl Identity {
    /// Reads the payload of SYNC2's echo; texts that are missing are empty.
    pub fn parse(payload: &[u8]) -> Option<Identity> {
        let (&command::SYNC2, body) = payload.split_first()? else { return None };
        let mut fields = Fields::new(body);
        let mut text = || fields.text().unwrap_or_default();
        Some(Identity { name: text(), class: text(), subclass: text() })
    }

    /// Frames the echo of SYNC2 into `out`; returns the packet's length.
    pub fn encode(&self, out: &mut [u8]) -> Result<usize, EncodeError> {
        Builder::new(out, command::SYNC2)
            .text(self.name.as_str())
            .text(self.class.as_str())
            .text(self.subclass.as_str())
            .finish()
    }
}
