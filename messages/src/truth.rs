//! What only a simulator can know.

use crate::Message;

/// Who is to blame for a contact.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub enum ContactCause {
    /// The robot drove into something ahead of its path.
    Drove = 0,
    /// The robot reversed blind into something.
    ReversedBlind = 1,
    /// Something moved into the robot.
    Suffered = 2,
}

/// True pose of a simulated body and what touched it; the tail lists the contacts that began since the last sample.
#[derive(Debug, Clone, Copy, PartialEq, Default, Message)]
#[repr(C)]
#[message(tail = Contact)]
pub struct Truth {
    /// Position in the world [m].
    pub x_m: f64,
    /// Position in the world [m].
    pub y_m: f64,
    /// Heading in the world, counter-clockwise [rad].
    pub heading_rad: f64,
    /// True velocity in the body frame.
    pub velocity: crate::Twist,
    /// Least distance from the footprint to anything, now [m].
    pub clearance_m: f64,
    /// Way travelled since the start [m].
    pub distance_m: f64,
    /// Contacts by cause (drove, reversed blind, suffered) since the start.
    pub contacts: [u64; 3],
}

/// A contact that began.
#[derive(Debug, Clone, Copy, PartialEq, Default, Message)]
#[repr(C)]
pub struct Contact {
    /// Where, in the world [m].
    pub x_m: f64,
    /// Where, in the world [m].
    pub y_m: f64,
    /// Speed of approach along the contact's normal [m/s].
    pub speed_m_s: f64,
    /// Who is to blame; see [`ContactCause`].
    #[message(values = "drove reversed_blind suffered")]
    pub cause: u64,
}
