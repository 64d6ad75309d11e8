//! Hokuyo scanners that speak SCIP 2.0 (URG-04LX, UTM-30LX, UST-10LX and their relatives) over TCP, USB, a serial line or
//! a pseudo-terminal.
//!
//! | file | what |
//! |---|---|
//! | [`protocol`], [`framer`] | lines, sums, numbers, scans |
//! | [`model`] | figures of a scanner, and what its values mean |
//! | [`clock`] | the scanner's time on ours |
//! | [`session`] | start-up, streaming, recovery |
//! | [`settings`], [`Urg`] | the node |
//! | [`conformance`] | what every scanner at the other end must do |
//!
//! All but the node is pure. `protocol` and `model` serve both ends: a simulated scanner uses the same files.

pub mod clock;
pub mod conformance;
pub mod framer;
pub mod model;
mod phases;
pub mod protocol;
pub mod session;
pub mod settings;

pub use settings::UrgConfig;

/// The node `urg`. Stamps are the scanner's own, mapped onto our clock (see [`clock`]): a scan's time stamp is taken as the
/// instant at which the mirror passes step 0.
pub type Urg = crate::laser::Scanner<session::Session>;
