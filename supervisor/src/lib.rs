//! The supervisor: starts, watches, restarts and stops node processes. It knows nothing of robots.
//!
//! `Policy` decides (pure, the same in both hosts), `run` carries out. What a node process finds:
//!
//! | what | meaning |
//! |---|---|
//! | descriptor 0 | /dev/null |
//! | descriptors 1, 2 | its log file, for appending |
//! | descriptor 3 (`SINEW_READY_FD`) | write one byte and close it: the node is ready; shell: `echo >&3; exec 3>&-` |
//! | `SINEW_ROBOT`, `SINEW_NODE` | name of the robot, name of the node in the plan |
//! | `SINEW_ROOT` | the robot's shared-memory folder, which the supervisor removes at the end |
//! | `SINEW_SUPERVISOR_PID` | the supervisor: a node stops by itself when it dies (pidfd; then compare with getppid) |
//! | `SINEW_RUN` | name of the run, by which a later supervisor finds what a killed one left |
//! | `SINEW_RESTARTS` | how many processes of this node came before in this run |
//! | SIGTERM | stop in order; after the grace comes SIGKILL, to the whole process group |
//!
//! A node is a session leader without a controlling terminal and with no other descriptor; signal mask and handlers are
//! the default ones.
//!
//! What a run keeps: below `<root>/.run`, for others to find it, `supervisor.lock`, `supervisor.json` (the [`Owner`]),
//! `<node>.pid` and the socket `control` (Unix seqpacket; one word per packet, `status` or `down`, one JSON object back;
//! after `down` the connection ends when nothing of the run is left). In the log folder, and there to stay, `<node>.log`,
//! `<node>.previous.log` and `incidents.jsonl` (a [`Record`] per line).

mod backoff;
mod claim;
mod control;
mod event;
mod exit;
mod folders;
mod host;
mod incidents;
mod leftovers;
mod logs;
mod observer;
mod owner;
mod plan;
mod policy;
mod proc;
mod processes;
mod rule;
mod run;
mod signals;
mod slot;
mod state;
mod status;
mod wall;

pub use backoff::{Backoff, Intensity};
pub use claim::ClaimError;
pub use control::{ControlError, StopHandle, ask, down};
pub use event::{Action, Event, Incident, IncidentKind, Next};
pub use exit::Exit;
pub use incidents::{Record, describe};
pub use logs::log_folder;
pub use observer::{Observer, Outcome, Report, StopCause};
pub use owner::{Owner, owner, owners};
pub use plan::{Plan, Program, base_folder, root_folder};
pub use policy::Policy;
pub use rule::{Restart, Rule};
pub use run::{SuperviseError, run, run_prepared};
pub use state::{NodeState, RobotState};
pub use status::{NodeStatus, Status};
pub use wall::utc;
