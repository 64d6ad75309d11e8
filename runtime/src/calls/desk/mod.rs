//! What a node does with calls, whatever brings them: checks them, answers what needs no step, stages the rest, and
//! gives every caller one last word.

mod bookings;
mod chronicle;

use std::sync::Arc;

use bookings::Booking;
use chronicle::Chronicle;

use super::description::{Command, CommandName, Commands};
use super::stage::{Particulars, Sender, Stage};
use super::step_watch::StepWatch;
use super::wire::{COMMAND_BYTES, Header, Kind, MAX_BODY_BYTES, Name};
use super::{Refusal, RefusalCode};
use crate::Time;
use crate::pump::Log;

/// What every node answers without a step.
pub(crate) const BUILT_IN: [&str; 2] = ["ping", "state"];

/// A caller as the transport numbers it: a connection, a ticket.
pub(crate) type CallerNumber = u64;

/// What the built-in call `state` answers.
#[derive(Clone)]
pub(crate) struct NodeState(Arc<dyn Fn() -> String + Send + Sync>);

impl NodeState {
    pub fn new(state: impl Fn() -> String + Send + Sync + 'static) -> NodeState {
        NodeState(Arc::new(state))
    }
}

impl Default for NodeState {
    fn default() -> NodeState {
        NodeState::new(|| "{}".into())
    }
}

/// A message to a caller.
#[derive(Debug)]
pub(crate) struct Reply {
    pub caller: CallerNumber,
    pub header: Header,
    pub body: Vec<u8>,
}

/// Why a node's commands cannot be served.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("command \"{command}\" of {node} {reason}")]
pub struct CommandError {
    /// The node's path.
    pub node: String,
    /// The command.
    pub command: String,
    /// What is wrong with it.
    pub reason: &'static str,
}

/// A node's calls.
pub(crate) struct Desk {
    path: String,
    stages: Vec<Arc<Stage>>,
    state: NodeState,
    step: Arc<StepWatch>,
    bookings: Vec<Booking>,
    arrivals: u64,
    replies: Vec<Reply>,
    news_for_step: bool,
    chronicle: Chronicle,
}

impl Desk {
    pub fn new(
        path: &str,
        stages: Vec<Arc<Stage>>,
        state: NodeState,
        step: Arc<StepWatch>,
    ) -> Result<Desk, CommandError> {
        for (index, stage) in stages.iter().enumerate() {
            let reason = match stage.command {
                "" => "has no name",
                name if name.len() > COMMAND_BYTES => "has a name of more than 32 bytes",
                name if BUILT_IN.contains(&name) => "has the name of a built-in call: choose another",
                name if stages[..index].iter().any(|other| other.command == name) => "is declared twice",
                _ if stage.request.bytes.max(stage.answer.bytes) > MAX_BODY_BYTES => "has a message of over 64 KiB",
                _ => continue,
            };
            return Err(CommandError { node: path.into(), command: stage.command.into(), reason });
        }
        let path = path.into();
        Ok(Desk {
            path,
            stages,
            state,
            step,
            bookings: Vec::new(),
            arrivals: 0,
            replies: Vec::new(),
            news_for_step: false,
            chronicle: Chronicle::new(Arc::new(|_| {})),
        })
    }

    /// Who hears, as one line each, what was not done.
    #[must_use]
    pub fn with_log(mut self, log: Log) -> Desk {
        self.chronicle = Chronicle::new(log);
        self
    }

    /// Takes a message of `caller`, who is `from`.
    pub fn receive(&mut self, now: Time, caller: CallerNumber, from: Sender, header: &Header, body: &[u8]) {
        match header.kind {
            Kind::Describe => self.describe(caller, from, header),
            Kind::Request => self.request(now, caller, from, header, body),
            Kind::Cancel => self.cancel(caller, header.id),
            _ => {
                let reason = format!("{:?} is a node's word, not a caller's", header.kind);
                self.refuse(caller, from, header, Refusal::new(RefusalCode::Malformed, reason));
            }
        }
    }

    /// Answers what cannot even be read.
    pub fn malformed(&mut self, caller: CallerNumber, from: Sender, reason: String) {
        self.refuse(caller, from, &Header::new(Kind::Refused, 0), Refusal::new(RefusalCode::Malformed, reason));
    }

    /// Somebody was not even heard.
    pub fn turned_away(&mut self, from: Sender, reason: &str) {
        self.chronicle.note(&from, "", Kind::Refused, reason);
    }

    /// What is to be sent, once.
    pub fn take_replies(&mut self) -> Vec<Reply> {
        std::mem::take(&mut self.replies)
    }

    /// Whether the step has a new request or cancellation to look at, once.
    pub fn take_news_for_step(&mut self) -> bool {
        std::mem::take(&mut self.news_for_step)
    }

    fn describe(&mut self, caller: CallerNumber, from: Sender, header: &Header) {
        let wanted = header.command.as_str();
        if wanted.is_empty() {
            let commands = self.stages.iter();
            let commands = commands.map(|stage| CommandName { name: stage.command.into(), kind: stage.kind }).collect();
            let built_in = BUILT_IN.map(str::to_owned).into();
            let answer = Commands { node: self.path.clone(), commands, built_in };
            self.answer_json(caller, from, header, serde_json::to_string(&answer).unwrap_or_default());
        } else if let Some(stage) = self.stages.iter().find(|stage| stage.command == wanted) {
            let answer = serde_json::to_string(&Command::of(stage)).unwrap_or_default();
            self.answer_json(caller, from, header, answer);
        } else {
            let refusal = self.unknown(wanted);
            self.refuse(caller, from, header, refusal);
        }
    }

    fn request(&mut self, now: Time, caller: CallerNumber, from: Sender, header: &Header, body: &[u8]) {
        match header.command.as_str() {
            "ping" => {
                let in_step_s = self.step.in_step_s(now);
                let pong = serde_json::json!({"node": self.path, "pid": std::process::id(), "in_step_s": in_step_s});
                self.answer_json(caller, from, header, pong.to_string());
            }
            "state" => {
                let state = (self.state.0)();
                self.answer_json(caller, from, header, state);
            }
            _ => {
                if let Err(refusal) = self.stage(now, caller, from, header, body) {
                    self.refuse(caller, from, header, refusal);
                }
            }
        }
    }

    /// Checks a request and lets it wait for the step.
    fn stage(
        &mut self,
        now: Time,
        caller: CallerNumber,
        from: Sender,
        header: &Header,
        body: &[u8],
    ) -> Result<(), Refusal> {
        let command = header.command.as_str();
        let Some(index) = self.stages.iter().position(|stage| stage.command == command) else {
            return Err(self.unknown(command));
        };
        let stage = &self.stages[index];
        check_layout(&self.path, stage, header, body)?;
        let deadline = (header.deadline_ns != 0).then(|| Time::from_nanos(header.deadline_ns));
        if deadline.is_some_and(|deadline| deadline <= now) {
            let reason = "the deadline had passed when the request came: allow more time";
            return Err(Refusal::new(RefusalCode::NotInTime, reason));
        }
        if self.bookings.iter().any(|booking| booking.caller == caller && booking.id == header.id) {
            let reason = format!("call {} is under way already: give every call another id", header.id);
            return Err(Refusal::new(RefusalCode::DuplicateId, reason));
        }
        let particulars = Particulars {
            sender: from,
            priority: header.priority,
            deadline: deadline.unwrap_or(Time::from_nanos(u64::MAX)),
        };
        self.arrivals += 1;
        let Some(place) = stage.admit(particulars, self.arrivals, body) else {
            let reason = format!(
                "{} requests for \"{command}\" of {} wait already and {}: call less often, or try again later",
                super::PLACES,
                self.path,
                self.step.describe(now)
            );
            return Err(Refusal::new(RefusalCode::QueueFull, reason));
        };
        let (accepted, settled) = (false, false);
        self.bookings.push(Booking { caller, from, id: header.id, stage: index, place, deadline, accepted, settled });
        self.news_for_step = true;
        Ok(())
    }

    fn unknown(&self, command: &str) -> Refusal {
        let names = || self.stages.iter().map(|stage| stage.command).chain(BUILT_IN);
        let nearest = names().min_by_key(|name| strsim::damerau_levenshtein(command, name)).unwrap_or("");
        let list = names().collect::<Vec<_>>().join(", ");
        let reason = format!("{} has no command \"{command}\"; nearest: \"{nearest}\"; commands: {list}", self.path);
        Refusal { nearest: Name::new(nearest), ..Refusal::new(RefusalCode::UnknownCommand, reason) }
    }

    fn answer_json(&mut self, caller: CallerNumber, from: Sender, header: &Header, json: String) {
        match json.len() <= MAX_BODY_BYTES {
            true => self.reply(caller, Kind::Answer, header.id, 0, json.into_bytes()),
            false => {
                let reason = "the answer is longer than 64 KiB: a defect of the node";
                self.refuse(caller, from, header, Refusal::new(RefusalCode::ByNode, reason));
            }
        }
    }

    fn refuse(&mut self, caller: CallerNumber, from: Sender, header: &Header, refusal: Refusal) {
        self.chronicle.note(&from, header.command.as_str(), Kind::Refused, &refusal.reason);
        self.reply(caller, Kind::Refused, header.id, 0, refusal.to_bytes());
    }

    fn reply(&mut self, caller: CallerNumber, kind: Kind, id: u64, layout_hash: u64, body: Vec<u8>) {
        let header = Header { layout_hash, sender: Name::new(&self.path), ..Header::new(kind, id) };
        self.replies.push(Reply { caller, header, body });
    }
}

/// Whether the request is the message that the command takes.
fn check_layout(path: &str, stage: &Stage, header: &Header, body: &[u8]) -> Result<(), Refusal> {
    let (command, expected) = (stage.command, &stage.request);
    if header.layout_hash != expected.hash {
        let reason = format!(
            "\"{command}\" of {path} takes {} with layout {:016x}, the caller sent layout {:016x}: use programs of one \
             release, or let `sinew call` encode JSON",
            (expected.schema)().name,
            expected.hash,
            header.layout_hash
        );
        return Err(Refusal { expected_hash: expected.hash, ..Refusal::new(RefusalCode::WrongLayout, reason) });
    }
    if body.len() != expected.bytes {
        let reason = format!(
            "\"{command}\" of {path} takes a message of {} bytes, {} came: send the fixed part, without a tail",
            expected.bytes,
            body.len()
        );
        return Err(Refusal::new(RefusalCode::WrongLength, reason));
    }
    Ok(())
}
