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
//! | `SINEW_SUPERVISOR_PID` | the supervisor, in a process tree the root: a node stops by itself when it dies (pidfd) |
//! | `SINEW_RUN` | name of the run, by which a later supervisor finds what a killed one left |
//! | `SINEW_IDENTITY` | `uid:gid:group,group`: who the node is to be, where its robot is run by root |
//! | `SINEW_RESTARTS` | how many processes of this node came before in this run |
//! | descriptor 4, `SINEW_TABLE` ("4 first count") | in a process tree: the table of heartbeats and keepsakes, and the node's lines |
//! | descriptor 5 (`SINEW_LATCH_FD`) | in a process tree: the stop latch, read-only |
//! | descriptor 6 (`SINEW_STANDBY_FD`) | a standby: open everything, write one byte to descriptor 3, take no path before a byte comes; at its end without one, end |
//! | SIGTERM | stop in order; after the grace comes SIGKILL, to the whole process group |
//!
//! A node is a session leader without a controlling terminal and with no other descriptor; signal mask and handlers are
//! the default ones.
//!
//! What a run keeps: below `<root>/.run`, for others to find it, `supervisor.lock`, `supervisor.json` (the [`Owner`]),
//! `<node>.pid` and the socket `control` (Unix seqpacket; a request per packet, `status`, `down`, `start NODE`, `stop NODE`, `restart NODE`, `clear` and more, one
//! JSON object back;
//! after `down` the connection ends when nothing of the run is left). In the log folder, and there to stay, `<node>.log`,
//! `<node>.previous.log`, `incidents.jsonl` (a [`Record`] per line) and `<node>.core`, its newest core dump, where the kernel
//! writes core dumps to files and `ulimit -c` allows them.

mod backoff;
mod beats;
mod care;
mod channels;
mod claim;
mod control;
mod cores;
mod detectors;
mod errands;
mod event;
mod exit;
mod folders;
mod front;
mod host;
mod host_tree;
mod incidents;
pub mod isolation;
mod ladder;
mod leftovers;
mod load;
mod logs;
mod machine;
mod news;
mod observer;
mod owner;
mod plan;
mod policy;
mod proc;
mod processes;
mod reactions;
mod remembered;
mod requests;
mod ring;
mod robot_plan;
mod rule;
mod run;
mod saved;
mod severity;
mod signals;
mod simulated;
mod slot;
mod spawn;
mod state;
mod status;
mod supervise;
mod telling;
mod tree;
mod wall;
mod witness;

pub use backoff::{Backoff, Intensity};
pub use care::{Act, Care, Condition, Group, Reaction, Strategy, Supervision};
pub use channels::supervisor_channels;
pub use claim::ClaimError;
pub use control::{ControlError, StopHandle, ask, down};
pub use event::{Action, Event, Incident, IncidentKind, Next, Request};
pub use exit::Exit;
pub use front::{Front, front_connection, refuse, run_tree};
pub use incidents::{Record, describe};
pub use load::{NodeTask, OVERLOAD_CODE, node_tasks};
pub use logs::log_folder;
pub use news::News;
pub use observer::{Observer, Outcome, Report, StopCause};
pub use owner::{Owner, owner, owners};
pub use plan::{Plan, Program, base_folder, root_folder};
pub use policy::{Adopted, Past, Policy, RobotPast};
pub use requests::UNDO;
pub use robot_plan::{Crew, RobotPlan};
pub use rule::{Restart, Rule};
pub use run::{SuperviseError, run, run_prepared};
pub use severity::{Cause, CauseKind, Clear, Severity};
pub use simulated::{Chronicle, FaultRates, PlannedFault, SupervisedHost, When};
pub use spawn::Newcomer;
pub use state::{NodeState, RobotState};
pub use status::{NodeStatus, Status};
pub use supervise::supervise;
pub use tree::{Seed, prepare};
pub use wall::utc;
