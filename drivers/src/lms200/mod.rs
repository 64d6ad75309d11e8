//! SICK LMS 2xx (LMS 200, 211, 220, 221, 291) over a serial line, TCP or a pseudo-terminal.
//!
//! | file | what |
//! |---|---|
//! | [`protocol`], [`framer`] | telegrams: frame, sum, commands, scans |
//! | [`model`] | variants, configuration, status, and what values mean |
//! | [`clock`] | the mirror as a clock: scans on our time |
//! | [`session`] | start-up at any rate, streaming, recovery |
//! | [`settings`], [`Lms200`] | the node |
//! | [`conformance`] | what every laser at the other end must do |
//!
//! All but the node is pure. `protocol` and `model` serve both ends: a simulated laser uses the same files.

pub mod clock;
pub mod conformance;
pub mod framer;
pub mod model;
mod phases;
pub mod protocol;
pub mod session;
pub mod settings;

pub use settings::Lms200Config;

/// The node `lms200`. The laser has no clock but its mirror: stamps are arrivals less what line and mirror take, made even
/// (see [`clock`]); a scan's `sensor_time_s` is NaN.
pub type Lms200 = crate::laser::Scanner<session::Session>;
