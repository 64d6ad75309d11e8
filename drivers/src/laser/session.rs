//! A laser's protocol as its node uses it: a state machine that asks, waits, reads and recovers, and does no I/O.

use super::{News, Sweep};
use crate::port::{Demand, Port};
use messages::{LaserState, Link};
use runtime::{Fault, OpenError, Time};
use schemars::JsonSchema;
use serde::de::DeserializeOwned;

/// What came from the laser.
#[derive(Debug, Clone, Copy)]
pub enum Event<'a> {
    /// Scans are such from now on.
    Sweep(&'a Sweep),
    /// A scan.
    Scan(News<'a>),
}

/// The settings of a laser in the robot file.
pub trait Settings: DeserializeOwned + JsonSchema {
    /// Checks every setting; says which is wrong, why, and what would be right.
    fn check(&self) -> Result<(), OpenError>;
    /// Where the laser is reached.
    fn device(&self) -> &str;
    /// Where it sits on the body.
    fn mount(&self) -> super::Mount;
}

/// A connection to a laser; see the module's text.
pub trait Session: Sized + 'static {
    /// The node's type in the robot file.
    const TYPE: &'static str;
    /// What ends the stream when the node ends.
    const FAREWELL: &'static [u8];
    /// What answers is another laser than wanted, or none.
    const FOREIGN: Fault;
    /// The laser says that it cannot measure.
    const FAULTY: Fault;
    /// The node's settings.
    type Settings: Settings;
    /// What goes to the laser at once.
    type Request: AsRef<[u8]>;

    /// A session whose port is closed; `line_baud` is the serial line's rate, where it has one.
    fn of(settings: &Self::Settings, line_baud: Option<u32>) -> Self;

    /// Tells what the port is doing; call it before [`receive`](Session::receive).
    fn port(&mut self, now: Time, port: Port);

    /// Takes bytes of which the last came at `arrived`, and hands on what they say.
    fn receive(&mut self, now: Time, arrived: Time, bytes: &[u8], on_event: impl FnMut(Event<'_>));

    /// Lets time pass; call it after all that has arrived was received. Says what the port should do.
    fn tick(&mut self, now: Time, on_event: impl FnMut(Event<'_>)) -> Option<Demand>;

    /// What goes out now, if something waits.
    fn next_request(&mut self, now: Time) -> Option<Self::Request>;

    /// State of the link, and why there are no data.
    fn link(&self) -> Link;

    /// The laser has said that it cannot measure.
    fn is_faulty(&self) -> bool;

    /// All that is told of it.
    fn state(&self) -> LaserState;
}
