//! What reflexive actions, coordinator and motion tell one another beside proposals and velocities.

use crate::Message;

/// One side of the body, or none.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub enum Side {
    /// Neither.
    None = 0,
    /// To the left (counter-clockwise).
    Left = 1,
    /// To the right (clockwise).
    Right = 2,
}

/// How much room the action `avoid` sees around the body. Frame: body, distances from its centre of rotation.
#[derive(Debug, Clone, Copy, PartialEq, Default, Message)]
#[repr(C)]
pub struct Room {
    /// The nearest thing in the region of interest ahead; +∞ when there is none [m].
    pub nearest_m: f64,
    /// Its direction; meaningful only when there is one [rad].
    pub nearest_bearing_rad: f64,
    /// Mean free distance on the left [m].
    pub left_m: f64,
    /// Mean free distance on the right [m].
    pub right_m: f64,
    /// Free distance along the way towards where the detour leads, or straight ahead without one [m].
    pub towards_m: f64,
    /// Direction that `avoid` proposes; meaningful only when it is active [rad].
    pub direction_rad: f64,
    /// Whether `avoid` proposes anything: 1.
    pub active: u32,
    /// Side on which it passes the obstacle; see [`Side`].
    #[message(values = "none left right")]
    pub side: u32,
}

/// The coordinator's word on a local minimum: leave it on this side.
#[derive(Debug, Clone, Copy, PartialEq, Default, Message)]
#[repr(C)]
pub struct Detour {
    /// Direction of the goal in the body frame [rad].
    pub bearing_rad: f64,
    /// Distance to the goal [m].
    pub distance_m: f64,
    /// Distance to the goal at which progress ended [m].
    pub from_distance_m: f64,
    /// Side on which the obstacle is passed; see [`Side`].
    #[message(values = "none left right")]
    pub side: u32,
    /// Local minima so far.
    pub minima: u32,
}

/// Why the action `emergency_stop` holds the body.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub enum StopCause {
    /// It does not.
    None = 0,
    /// A bumper is pressed, or was a moment ago.
    Bumper = 1,
    /// Something is in the danger zone, or was a moment ago.
    Zone = 2,
    /// The cause is gone; somebody must call `reset`.
    Held = 3,
}

/// State of the protective stop.
#[derive(Debug, Clone, Copy, PartialEq, Default, Message)]
#[repr(C)]
pub struct ProtectiveStop {
    /// Nearest thing in the danger zone, from the body's front edge; +∞ when it is empty [m].
    pub nearest_m: f64,
    /// How long it has held the body; 0 when it does not [s].
    pub held_s: f64,
    /// Why; see [`StopCause`].
    #[message(values = "none bumper zone held")]
    pub cause: u32,
    /// Protective stops so far.
    pub stops: u32,
}

/// Asks the coordinator for a mode.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Message)]
#[repr(C)]
pub struct SetMode {
    /// Index of the mode in the robot file, counted from 0.
    pub mode: u64,
}

/// The coordinator's mode.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Message)]
#[repr(C)]
pub struct ModeState {
    /// Index of the mode in the robot file, counted from 0.
    pub mode: u64,
    /// Number of modes in the robot file.
    pub modes: u64,
}

/// What the wheels do at a body's velocity; which fields count depends on the drive.
#[derive(Debug, Clone, Copy, PartialEq, Default, Message)]
#[repr(C)]
pub struct WheelVelocities {
    /// Differential drive: left wheel over the ground [m/s].
    pub left_m_s: f64,
    /// Differential drive: right wheel over the ground [m/s].
    pub right_m_s: f64,
    /// Synchro drive: all wheels over the ground [m/s].
    pub drive_m_s: f64,
    /// Synchro drive: turn rate of all wheels about their vertical axes [rad/s].
    pub steer_rad_s: f64,
}
