//! sinew-supervisor
mod backoff;
mod event;
mod exit;
mod policy;
mod rule;
mod state;

pub use backoff::{Backoff, Intensity};
pub use event::{Action, Event, Incident, IncidentKind, Next};
pub use exit::Exit;
pub use policy::Policy;
pub use rule::{Restart, Rule};
pub use state::{NodeState, RobotState};
