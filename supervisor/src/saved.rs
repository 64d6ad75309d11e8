//! What a supervisor leaves its successor, in the root's memory: which processes are whose, and how far the run is.

use std::os::fd::OwnedFd;

use guard::{StateError, StateFile};
use runtime::Time;
use serde::{Deserialize, Serialize};

use crate::observer::StopCause;
use crate::plan::{Plan, Program};
use crate::policy::{Adopted, Past, Policy, RobotPast};
use crate::slot::Slot;
use crate::state::NodeState;

/// One node.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SavedNode {
    /// Its name in the plan.
    pub instance: String,
    /// Its process and when that was started, in clock ticks since boot.
    pub process: Option<(i32, u64)>,
    /// Processes so far.
    pub starts: u32,
    /// When the newest was started [ns].
    pub started_ns: u64,
    /// `waiting`, `alive`, `ready`, `pausing`, `regrouping`, `finished`, `failed`, `given up` or `stopped`.
    pub state: String,
    /// When its pause ends [ns].
    #[serde(default)]
    pub until_ns: u64,
    /// What happened to it before.
    #[serde(default)]
    pub past: Past,
    /// Its program, where that is not the plan's.
    #[serde(default)]
    pub program: Option<String>,
    /// The program to go back to when the present one fails its trial, where that is not the plan's.
    #[serde(default)]
    pub program_before: Option<String>,
}

/// The run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Saved {
    /// When it began [ns].
    pub begun_ns: u64,
    /// Supervisors before this one.
    pub takeovers: u32,
    /// Whether the robot is being stopped, and why.
    pub stopping: Option<StopCause>,
    /// Requests that a second one turns into an immediate end.
    pub interrupts: u32,
    /// The nodes, in the order of the plan.
    pub nodes: Vec<SavedNode>,
    /// What holds the robot back.
    #[serde(default)]
    pub past: RobotPast,
}

impl Saved {
    /// A run of which only the plan is known: every node may live under a number that nobody has written down.
    pub fn nameless(plan: &Plan) -> Saved {
        let node = |program: &Program| SavedNode {
            instance: program.instance.clone(),
            process: None,
            starts: 1,
            started_ns: 0,
            state: "alive".to_owned(),
            until_ns: 0,
            past: Past::default(),
            program: None,
            program_before: None,
        };
        Saved {
            begun_ns: 0,
            takeovers: 0,
            stopping: None,
            interrupts: 0,
            nodes: plan.programs.iter().map(node).collect(),
            past: RobotPast::default(),
        }
    }
}

/// The memory that holds it.
#[derive(Debug)]
pub struct Keeper {
    file: StateFile,
    last: Vec<u8>,
}

impl Keeper {
    /// Opens the memory; also what a predecessor left there, and what was wrong with it.
    pub fn open(memfd: OwnedFd) -> Result<(Keeper, Option<Saved>, Option<String>), StateError> {
        let again = memfd.try_clone().map_err(StateError::Io)?;
        match StateFile::open(memfd) {
            Ok((file, loaded)) => {
                let keeper = Keeper { file, last: Vec::new() };
                let saved = loaded.bytes.map(|bytes| serde_json::from_slice(&bytes));
                match saved.transpose() {
                    Ok(saved) => Ok((keeper, saved, loaded.refused)),
                    Err(error) => {
                        Ok((keeper, None, Some(format!("the supervisor's state is not understood: {error}"))))
                    }
                }
            }
            Err(damaged @ StateError::Damaged(_)) => {
                let keeper = Keeper { file: StateFile::afresh(again)?, last: Vec::new() };
                Ok((keeper, None, Some(damaged.to_string())))
            }
            Err(error) => Err(error),
        }
    }

    /// Writes the state if it is another than the last one.
    pub fn keep(&mut self, saved: &Saved) -> Result<(), StateError> {
        let bytes = serde_json::to_vec(saved).unwrap_or_default();
        if bytes == self.last {
            return Ok(());
        }
        self.file.store(&bytes)?;
        self.last = bytes;
        Ok(())
    }
}

impl SavedNode {
    /// The node in `slot`.
    pub fn of(slot: &Slot, state: NodeState, past: Past) -> SavedNode {
        let until = match state {
            NodeState::Pausing { until } | NodeState::Regrouping { until } => until,
            _ => Time::ZERO,
        };
        let word = match state {
            NodeState::Pausing { .. } => "pausing",
            NodeState::Regrouping { .. } => "regrouping",
            NodeState::Running { .. } => "ready",
            NodeState::Ended { success: true } => "finished",
            NodeState::Ended { success: false } => "failed",
            NodeState::GivenUp => "given up",
            NodeState::Stopped => "stopped",
            NodeState::Waiting => "waiting",
            _ => "alive",
        };
        SavedNode {
            instance: slot.instance.clone(),
            process: slot.process.as_ref().and_then(|process| Some((process.pid(), slot.ticks?))),
            starts: slot.starts(),
            started_ns: slot.started().nanos(),
            state: word.to_owned(),
            until_ns: until.nanos(),
            past,
            program: slot.program(),
            program_before: slot.program_before(),
        }
    }

    /// Tells `policy` about it.
    pub fn teach(&self, policy: &mut Policy, node: usize) {
        let (started, until) = (Time::from_nanos(self.started_ns), Time::from_nanos(self.until_ns));
        policy.adopt(
            node,
            match self.state.as_str() {
                "waiting" if self.process.is_none() => Adopted::Waiting,
                "finished" => Adopted::Ended { success: true },
                "failed" => Adopted::Ended { success: false },
                "given up" => Adopted::GivenUp,
                "stopped" => Adopted::Stopped,
                "pausing" => Adopted::Pausing { until },
                "regrouping" => Adopted::Regrouping { until },
                "ready" => Adopted::Alive { ready: true, started },
                _ => Adopted::Alive { ready: false, started },
            },
            &self.past,
        );
    }
}
