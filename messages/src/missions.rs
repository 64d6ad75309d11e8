//! Orders to reflexive actions: where to go, how to move, and how it went.

use crate::Message;

/// Orders the action `goto` to a place in the map frame.
#[derive(Debug, Clone, Copy, PartialEq, Default, Message)]
#[repr(C)]
pub struct GotoGoal {
    /// Where in the map frame [m].
    pub x_m: f64,
    /// Where in the map frame [m].
    pub y_m: f64,
    /// Heading to end with, counter-clockwise; NaN for any [rad].
    pub heading_rad: f64,
    /// How near counts as there; 0 for the node's own setting [m].
    pub tolerance_m: f64,
}

/// Most via points of a [`GotoPath`].
pub const VIA_POINTS: usize = 24;

/// Orders the action `goto` along via points to the last of them.
#[derive(Debug, Clone, Copy, PartialEq, Message)]
#[repr(C)]
pub struct GotoPath {
    /// Via points in the map frame, each x and y; those after `count` mean nothing [m].
    pub points_m: [[f64; 2]; VIA_POINTS],
    /// Number of via points, 1…24.
    pub count: u64,
    /// Heading to end with, counter-clockwise; NaN for any [rad].
    pub heading_rad: f64,
    /// How near to the last point counts as there; 0 for the node's own setting [m].
    pub tolerance_m: f64,
}

/// What `goto` is doing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub enum GotoState {
    /// Nothing is ordered.
    Idle = 0,
    /// On the way.
    Driving = 1,
    /// There; turning to the final heading.
    Turning = 2,
    /// On the way, but nobody knows where the body is: it proposes nothing.
    Lost = 3,
}

/// How far a `goto` is: the order's progress, and the node's published state.
#[derive(Debug, Clone, Copy, PartialEq, Default, Message)]
#[repr(C)]
pub struct GotoProgress {
    /// The goal in the map frame [m].
    pub goal_x_m: f64,
    /// The goal in the map frame [m].
    pub goal_y_m: f64,
    /// Distance to the goal [m].
    pub distance_m: f64,
    /// Direction of what it aims at now, in the body frame [rad].
    pub bearing_rad: f64,
    /// Final heading still to turn, in (−π, π]; NaN where any will do [rad].
    pub heading_error_rad: f64,
    /// Time since the order was accepted [s].
    pub elapsed_s: f64,
    /// What it is doing; see [`GotoState`].
    #[message(values = "idle driving turning lost")]
    pub state: u32,
    /// Counts the orders that were accepted.
    pub orders: u32,
}

/// Where a `goto` ended.
#[derive(Debug, Clone, Copy, PartialEq, Default, Message)]
#[repr(C)]
pub struct GotoResult {
    /// The body in the map frame [m].
    pub x_m: f64,
    /// The body in the map frame [m].
    pub y_m: f64,
    /// Its heading [rad].
    pub heading_rad: f64,
    /// Distance from the goal [m].
    pub distance_m: f64,
    /// Final heading still to turn, in (−π, π]; NaN where any would do [rad].
    pub heading_error_rad: f64,
    /// How long it took [s].
    pub time_s: f64,
    /// Way travelled [m].
    pub way_m: f64,
}

/// Orders the action `move` to drive at a velocity for a time.
#[derive(Debug, Clone, Copy, PartialEq, Default, Message)]
#[repr(C)]
pub struct MoveRequest {
    /// Speed of the centre, forward [m/s].
    pub speed_m_s: f64,
    /// Speed of the right wheel less that of the left: above 0 turns left [m/s].
    pub wheel_difference_m_s: f64,
    /// How long [s].
    pub duration_s: f64,
}

/// How far a `move` is, and how it ended.
#[derive(Debug, Clone, Copy, PartialEq, Default, Message)]
#[repr(C)]
pub struct MoveProgress {
    /// Time since the order was accepted [s].
    pub elapsed_s: f64,
    /// Way of the centre by odometry; NaN without odometry [m].
    pub way_m: f64,
    /// Angle turned by odometry; NaN without odometry [rad].
    pub turned_rad: f64,
}

/// Tells a node where the body is in the map frame.
#[derive(Debug, Clone, Copy, PartialEq, Default, Message)]
#[repr(C)]
pub struct SetPose {
    /// The body in the map frame [m].
    pub x_m: f64,
    /// The body in the map frame [m].
    pub y_m: f64,
    /// Its heading, counter-clockwise [rad].
    pub heading_rad: f64,
}
