//! From proposals to wheels: what is wanted, what is allowed, what was done.

use crate::Message;

/// Velocity of a body in its own frame (geometry_msgs/Twist, planar).
#[derive(Debug, Clone, Copy, PartialEq, Default, Message)]
#[repr(C)]
pub struct Twist {
    /// Forward velocity [m/s].
    pub linear_x_m_s: f64,
    /// Velocity to the left [m/s].
    pub linear_y_m_s: f64,
    /// Turn rate, counter-clockwise [rad/s].
    pub angular_z_rad_s: f64,
}

/// Pose in the odometry frame and velocity in the body frame (nav_msgs/Odometry, planar).
#[derive(Debug, Clone, Copy, PartialEq, Default, Message)]
#[repr(C)]
pub struct Odometry {
    /// Position ahead of where the odometry was set to zero [m].
    pub x_m: f64,
    /// Position to the left of where the odometry was set to zero [m].
    pub y_m: f64,
    /// Heading, counter-clockwise, in (−π, π] [rad].
    pub heading_rad: f64,
    /// Velocity in the body frame.
    pub velocity: Twist,
    /// Row-major covariance of (x, y, heading) [m², m·rad, rad²].
    pub pose_covariance: [f64; 9],
    /// Row-major covariance of (forward, left, turn) velocity [m²/s², rad²/s²].
    pub velocity_covariance: [f64; 9],
    /// Counts the times that the frame's zero was moved (set_origin, device restart).
    pub origin: u64,
}

/// What an axis of a [`Proposal`] holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub enum Wish {
    /// No opinion; a cap still counts.
    Abstain = 0,
    /// `value` is wanted.
    Exact = 1,
    /// `word` is wanted: a linguistic value that the coordinator translates (−3 "much" … +3 "much").
    Word = 2,
}

/// One axis of a proposal. Default: no opinion and no cap.
#[derive(Debug, Clone, Copy, PartialEq, Message)]
#[repr(C)]
pub struct Axis {
    /// Wanted velocity on this axis [m/s, rad/s].
    pub value: f64,
    /// Greatest magnitude allowed towards positive; +∞ when there is no cap [m/s, rad/s].
    pub cap_positive: f64,
    /// Greatest magnitude allowed towards negative; +∞ when there is no cap [m/s, rad/s].
    pub cap_negative: f64,
    /// How to read `value` and `word`; see [`Wish`].
    #[message(values = "abstain exact word")]
    pub wish: u32,
    /// The linguistic value.
    pub word: i32,
}

impl Axis {
    /// No opinion, no cap.
    pub const NONE: Axis = Axis {
        value: 0.0,
        cap_positive: f64::INFINITY,
        cap_negative: f64::INFINITY,
        wish: Wish::Abstain as u32,
        word: 0,
    };

    /// Wants exactly `value`.
    pub const fn exact(value: f64) -> Axis {
        Axis { value, wish: Wish::Exact as u32, ..Axis::NONE }
    }

    /// Wants nothing, but forbids more than `cap` in either direction.
    pub const fn capped(cap: f64) -> Axis {
        Axis { cap_positive: cap, cap_negative: cap, ..Axis::NONE }
    }
}

impl Default for Axis {
    fn default() -> Axis {
        Axis::NONE
    }
}

/// What an action proposes, per axis. Caps always apply, whatever the weights.
#[derive(Debug, Clone, Copy, PartialEq, Default, Message)]
#[repr(C)]
pub struct Proposal {
    /// Along x [m/s].
    pub forward: Axis,
    /// Along y [m/s].
    pub sideways: Axis,
    /// Around z, counter-clockwise [rad/s].
    pub turn: Axis,
    /// How pressing it is: 0 idle … 1 must.
    pub urgency: f64,
    /// Valid for this long after the sample's stamp; afterwards it counts as absent [s].
    pub valid_for_s: f64,
}

/// How many sectors around the robot are free, for more competent behaviours.
#[derive(Debug, Clone, Copy, PartialEq, Default, Message)]
#[repr(C)]
pub struct FreeSectors {
    /// Bit i is set when sector i is free; sector 0 is the rightmost, counted counter-clockwise.
    pub mask: u32,
    /// Number of sectors looked at.
    pub sectors: u32,
    /// Number of free ones.
    pub free: u32,
    /// Length of the longest run of neighbouring free sectors.
    pub longest_run: u32,
    /// Bearing of the middle of that run [rad].
    pub run_bearing_rad: f64,
    /// Force of each sector (S1's M); unused entries are zero.
    pub force: [f64; 16],
}

/// The wanted velocity of a body for its driver, after limits and guard zones.
#[derive(Debug, Clone, Copy, PartialEq, Default, Message)]
#[repr(C)]
pub struct Command {
    /// Velocity in the body frame.
    pub velocity: Twist,
    /// Valid for this long after the sample's stamp; afterwards the driver stops the device [s].
    pub valid_for_s: f64,
    /// Whether motor power is wanted at all: 1, or 0 to let go.
    pub enable: u64,
}

/// Why motion holds the body back.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub enum Stop {
    /// It does not.
    None = 0,
    /// No wanted velocity, or a stale one.
    StaleVelocity = 1,
    /// No ranges, or stale ones: the `blind` cap applies.
    Blind = 2,
    /// Something is inside the stop zone of the swept footprint.
    Zone = 3,
    /// A bumper is pressed.
    Bumper = 4,
    /// A wheel is stalled.
    Stall = 5,
    /// The base is not ready (link lost, motors off).
    Base = 6,
    /// The stop latch does not allow motion.
    Latch = 9,
    /// The supervisor holds the robot.
    Held = 7,
    /// Limp mode: the speed is limited.
    Limp = 8,
}

/// What motion made of the wanted velocity, and why.
#[derive(Debug, Clone, Copy, PartialEq, Default, Message)]
#[repr(C)]
pub struct MotionState {
    /// What the coordinator wanted.
    pub wanted: Twist,
    /// What was sent to the driver.
    pub sent: Twist,
    /// Greatest forward speed that the clear distance allows; +∞ when nothing limits it [m/s].
    pub forward_limit_m_s: f64,
    /// Greatest backward speed that the clear distance allows; +∞ when nothing limits it [m/s].
    pub backward_limit_m_s: f64,
    /// Clear distance along the swept footprint in the wanted direction; +∞ when nothing was seen [m].
    pub clear_m: f64,
    /// Why the body is held back; see [`Stop`].
    #[message(values = "none stale_velocity blind zone bumper stall base held limp latch")]
    pub stop: u32,
    /// Protective stops so far.
    pub stops: u32,
}

/// How the coordinator decided.
#[derive(Debug, Clone, Copy, PartialEq, Default, Message)]
#[repr(C)]
pub struct CoordinatorState {
    /// Index of the mode in the robot file, counted from 0.
    pub mode: u32,
    /// Proposals that counted in this step.
    pub proposals: u32,
    /// Proposals that were too old to count.
    pub stale: u32,
    /// Bit per axis (1 forward, 2 sideways, 4 turn) on which a cap acted.
    pub capped: u32,
    /// Share of each axis (forward, sideways, turn) that the strongest proposal had, 0…1.
    pub share: [f64; 3],
}
