//! State of a mobile base.

use crate::Message;

/// State of the link to a device.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub enum Link {
    /// Opening the port or shaking hands.
    Connecting = 0,
    /// Data flow.
    Up = 1,
    /// The port could not be opened.
    NoPort = 2,
    /// The port is open and nothing answers.
    Silent = 3,
    /// The other end closed it or it disappeared.
    Lost = 4,
    /// Something answers, but not as this device should.
    Foreign = 5,
}

/// Battery, bumpers, stalls, motor power and the health of the link.
#[derive(Debug, Clone, Copy, PartialEq, Default, Message)]
#[repr(C)]
pub struct BaseState {
    /// Battery voltage; NaN when not known [V].
    pub battery_v: f64,
    /// Battery charge 0…1; NaN when not known.
    pub charge: f64,
    /// Front bumpers, bit per segment.
    pub front_bumpers: u32,
    /// Rear bumpers, bit per segment.
    pub rear_bumpers: u32,
    /// Left wheel stalled: 1.
    pub stall_left: u32,
    /// Right wheel stalled: 1.
    pub stall_right: u32,
    /// Motor power on: 1.
    pub motors_enabled: u32,
    /// Sonar firing: 1.
    pub sonar_enabled: u32,
    /// Stop button pressed on the device: 1.
    pub stop_button: u32,
    /// The link; see [`Link`].
    #[message(values = "connecting up no_port silent lost foreign")]
    pub link: u32,
    /// Times the link came up.
    pub connections: u32,
    /// Packets received whole.
    pub packets: u32,
    /// Packets dropped for a wrong checksum.
    pub checksum_errors: u32,
    /// Bytes skipped while hunting for a header [byte].
    pub skipped_bytes: u32,
}
