//! Wheel ticks as a message.

use messages::Message;

/// Accumulated ticks of the wheel encoders, as the controller counts them; they wrap at 32 bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Message)]
#[repr(C)]
pub struct Encoders {
    /// Left wheel, forward positive [tick].
    pub left_ticks: i64,
    /// Right wheel, forward positive [tick].
    pub right_ticks: i64,
}
