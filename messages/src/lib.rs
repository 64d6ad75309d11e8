//! Plain data that nodes exchange.
//!
//! A message is a `repr(C)` struct of numbers, arrays of numbers and other such structs: self-contained, without
//! hidden padding, valid for every bit pattern. It may end in one variable-length *tail*, an array of one further
//! plain type whose capacity is fixed when the channel is opened. `derive(Message)` checks the layout and emits the
//! [`Schema`] by which tools, recordings and other languages decode the bytes.
//!
//! Conventions: SI units, angles in radians, frames after REP-103/105 (x forward, y left, counter-clockwise positive);
//! every field carries its unit in its name and in square brackets at the end of its first doc line.

extern crate self as messages;

mod base;
mod image;
mod motion;
mod node;
mod plain;
mod ranges;
mod schema;
mod truth;

pub use base::{BaseState, Link};
pub use image::{Encoding, Image};
pub use messages_derive::Message;
pub use motion::{Axis, Command, CoordinatorState, FreeSectors, MotionState, Odometry, Proposal, Stop, Twist, Wish};
pub use node::{InputCursor, NodeStatistics, StepInputs};
pub use plain::{Message, NoTail, Plain, tail_offset};
pub use ranges::{Beam, Echo, Ranges};
pub use schema::{Element, Field, JsonError, JsonProblem, Kind, Schema, SchemaError, from_json_value, to_json_value};
pub use truth::{Contact, ContactCause, Truth};

// The derive's output names this crate; a user's crate that depends on `sinew` alone says `#[message(crate = sinew::messages)]`.
#[doc(hidden)]
pub use {bytemuck, plain::field_bytes};
