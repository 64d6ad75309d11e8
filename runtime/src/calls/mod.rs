//! Calls: a request to a node with one answer, or a long order with progress, cancel and result.
//!
//! Every live node listens on a Unix seqpacket socket in its folder of the robot's tree ([`target`], [`wire`]). Its
//! pump takes the requests, checks them, answers what needs no step, and stages the rest for the step by priority,
//! then arrival. So a node in a long step still answers what it can, no caller blocks a node, and two nodes may call
//! each other. A call is answered at most once; it ends by its deadline, or at once when either side ends.
//!
//! The step's ends are [`CallPort`], [`OrderPort`] and [`Caller`]; people's end is [`client::Client`].

mod call_error;
mod call_line;
mod caller;
pub mod client;
mod description;
mod desk;
mod local;
mod open;
mod order;
mod outgoing;
mod port;
mod refusal;
mod server;
mod socket;
mod stage;
mod step_watch;
pub mod target;
pub mod wire;

pub use call_error::CallError;
pub(crate) use call_line::CallLine;
pub use caller::{CallId, CallState, Caller, Loss};
pub use description::{Command, CommandName, Commands, Layout};
pub use desk::CommandError;
pub(crate) use desk::{Desk, NodeState};
pub use local::{LocalCalls, LocalRequest, Ticket, TicketState};
pub use order::{Order, OrderPort};
pub(crate) use outgoing::Outgoing;
pub use port::{CallPort, Request};
pub use refusal::{Reason, Refusal, RefusalCode};
pub(crate) use server::Server;
pub use socket::ServeError;
pub(crate) use stage::Stage;
pub use stage::{Cancellation, CommandKind, PLACES, Sender};
pub use step_watch::StepWatch;
pub use target::{Target, TargetError};
