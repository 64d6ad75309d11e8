//! Plain data that nodes exchange.
//!
//! A message is a `repr(C)` struct of numbers, arrays of numbers and other such structs: self-contained, without
//! hidden padding, valid for every bit pattern. It may end in one variable-length *tail*, an array of one further
//! plain type whose capacity is fixed when the channel is opened. [`derive(Message)`](macro@Message) checks the layout and
//! emits the [`Schema`] by which tools, recordings and other languages decode the bytes.
//!
//! Conventions: SI units, angles in radians, frames after REP-103/105 (x forward, y left, counter-clockwise positive);
//! every field carries its unit in its name and in square brackets at the end of its first doc line. There is no `bool`
//! and no enum in a message, because another process may write any bits: a flag is a number that is 0 or 1, a choice
//! a number whose values have names ([`Beam::echo`] and [`Echo`]).
//!
//! ```
//! use messages::{Message, Schema, Twist, from_json_value, to_json_value};
//!
//! let twist = Twist { linear_x_m_s: 0.3, ..Twist::default() };
//! let json = to_json_value(&twist, &[]);
//! assert_eq!(json.to_string(), r#"{"linear_x_m_s":0.3,"linear_y_m_s":0.0,"angular_z_rad_s":0.0}"#);
//! assert_eq!(from_json_value(&json), Ok((twist, vec![])));
//!
//! // A program that was built without Twist needs the schema's text only: it stands in front of every channel.
//! let schema = Schema::from_text(&Twist::schema().to_text())?;
//! assert_eq!(schema.to_json(bytemuck::bytes_of(&twist), &[]), json);
//! assert_eq!(schema.hash(), Twist::layout_hash());
//! # Ok::<(), messages::SchemaError>(())
//! ```
//!
//! To add a message: a struct in a file of this crate, its name in `tests/shipped/mod.rs`, its line in the table of
//! `tests/layouts.rs`. Layouts are a promise: a change makes recordings unreadable, so it goes into the changelog.

// A unit at the end of a doc line, `[m]`, looks like a link to rustdoc.
#![allow(rustdoc::broken_intra_doc_links)]

extern crate self as messages;

mod base;
mod image;
mod laser;
mod missions;
mod motion;
mod node;
mod plain;
mod ranges;
mod reflexes;
mod requests;
mod schema;
mod supervision;
mod tracks;
mod truth;

pub use base::{BaseState, Link};
pub use image::{Encoding, Image};
pub use laser::{LaserScan, LaserState, ScanBeam};
pub use messages_derive::Message;
pub use missions::{
    GotoGoal, GotoPath, GotoProgress, GotoResult, GotoState, MoveProgress, MoveRequest, SetPose, VIA_POINTS,
};
pub use motion::{Axis, Command, CoordinatorState, FreeSectors, MotionState, Odometry, Proposal, Stop, Twist, Wish};
pub use node::{InputCursor, NodeStatistics, StepEvents, StepInputs, StepKind, WRITTEN, path_number};
pub use plain::{Message, NoTail, Plain, tail_offset};
pub use ranges::{Beam, Echo, RangerVerdict, Ranges};
pub use reflexes::{Detour, ModeState, ProtectiveStop, Room, SetMode, Side, StopCause, WheelVelocities};
pub use requests::{Done, Sound, Switch, Trigger};
pub use schema::{
    Element, Field, JsonError, JsonProblem, Kind, Schema, SchemaError, SchemaText, from_json_value, to_json_value,
};
pub use supervision::{
    Governance, Load, NODE_NAME_BYTES, NodeLoad, NodePeriod, Notice, Periods, Shortage, SupervisorState,
};
pub use tracks::{Segment, SegmentShape, Segments, Track, TrackMotion, TrackState, Tracks};
pub use truth::{Contact, ContactCause, Truth};

// The derive's output names this crate; a user's crate that depends on `sinew` alone says `#[message(crate = sinew::messages)]`.
#[doc(hidden)]
pub use bytemuck;
