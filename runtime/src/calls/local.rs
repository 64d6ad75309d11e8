//! Calls within one simulated host: the same ports, checks and last words, without sockets and on virtual time.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::call_line::{CallEnd, CallHead, CallLine};
use super::caller::Loss;
use super::desk::{CallerNumber, Desk, Reply};
use super::outgoing::end_of;
use super::refusal::Refusal;
use super::stage::Sender;
use super::wire::{Header, Kind, Name};
use crate::Time;

/// The calls of one simulated host. Cheap to clone.
#[derive(Clone, Default)]
pub struct LocalCalls {
    exchange: Arc<Mutex<Exchange>>,
}

/// A call that a test or the host made.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Ticket(CallerNumber);

/// How a ticket's call stands.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum TicketState {
    /// No word from the node yet.
    Pending,
    /// The node works on the long order; its newest progress message, if there is one.
    Running(Option<Vec<u8>>),
    /// The answer message, or the JSON of a built-in call.
    Answered(Vec<u8>),
    /// Not begun.
    Refused(Refusal),
    /// Begun, and not possible.
    Failed(Refusal),
    /// Cancelled.
    Cancelled,
    /// The node is not there.
    Lost(Loss),
}

/// What a test or the host asks of a node.
#[derive(Debug, Clone, Copy)]
pub struct LocalRequest<'a> {
    /// The node's path.
    pub path: &'a str,
    /// The command.
    pub command: &'a str,
    /// Layout hash of the request message; 0 for `ping` and `state`.
    pub layout_hash: u64,
    /// The request message's bytes.
    pub body: &'a [u8],
    /// 255 first.
    pub priority: u8,
    /// Until when the answer is wanted.
    pub deadline: Time,
}

#[derive(Default)]
struct Exchange {
    nodes: BTreeMap<String, Participant>,
    last_caller: CallerNumber,
    tickets: BTreeMap<CallerNumber, (String, TicketState)>,
}

/// A node of the simulated host.
struct Participant {
    desk: Desk,
    lines: Vec<Line>,
    /// Tells the host that the node has something to look at: a call, or a reply.
    notify_call: Box<dyn Fn() + Send>,
    notify_reply: Box<dyn Fn() + Send>,
}

/// One caller of a node.
struct Line {
    line: Arc<CallLine>,
    number: CallerNumber,
    current: Option<CallHead>,
}

impl LocalCalls {
    /// No nodes yet.
    pub fn new() -> LocalCalls {
        LocalCalls::default()
    }

    /// A node takes part from now on, in the place of its predecessor.
    pub(crate) fn join(
        &self,
        path: &str,
        desk: Desk,
        lines: Vec<Arc<CallLine>>,
        notify_call: Box<dyn Fn() + Send>,
        notify_reply: Box<dyn Fn() + Send>,
    ) {
        let mut exchange = self.lock();
        exchange.leave(path);
        let lines =
            lines.into_iter().map(|line| Line { line, number: exchange.next_caller(), current: None }).collect();
        exchange.nodes.insert(path.into(), Participant { desk, lines, notify_call, notify_reply });
    }

    /// The node has ended: whoever waits for it learns so at once.
    pub fn node_ended(&self, path: &str) {
        self.lock().leave(path);
    }

    /// Asks a node.
    pub fn request(&self, now: Time, request: &LocalRequest<'_>) -> Ticket {
        let mut exchange = self.lock();
        let number = exchange.next_caller();
        exchange.tickets.insert(number, (request.path.into(), TicketState::Pending));
        let header = Header {
            deadline_ns: request.deadline.nanos(),
            layout_hash: request.layout_hash,
            priority: request.priority,
            command: Name::new(request.command),
            ..Header::new(Kind::Request, 1)
        };
        let sender = Sender { name: Name::new("simulated host"), pid: 0, uid: 0 };
        match exchange.nodes.get_mut(request.path) {
            Some(node) => node.desk.receive(now, number, sender, &header, request.body),
            None => exchange.tell(number, TicketState::Lost(Loss::NotRunning)),
        }
        exchange.advance(now);
        Ticket(number)
    }

    /// The call is no longer wanted.
    pub fn cancel(&self, now: Time, ticket: Ticket) {
        let mut exchange = self.lock();
        let path = exchange.tickets.get(&ticket.0).map(|(path, _)| path.clone());
        if let Some(node) = path.and_then(|path| exchange.nodes.get_mut(&path)) {
            let sender = Sender { name: Name::default(), pid: 0, uid: 0 };
            node.desk.receive(now, ticket.0, sender, &Header::new(Kind::Cancel, 1), &[]);
        }
        exchange.advance(now);
    }

    /// How the call stands. A call that is over stays over.
    pub fn poll(&self, ticket: Ticket) -> TicketState {
        self.lock().tickets.get(&ticket.0).map_or(TicketState::Lost(Loss::NotRunning), |(_, state)| state.clone())
    }

    /// Carries calls and replies between the nodes. The host calls it between steps, in its fixed order of things.
    pub fn advance(&self, now: Time) {
        self.lock().advance(now);
    }

    /// The next instant at which a call will not have been answered in time: the host advances then.
    pub fn next_deadline(&self) -> Option<Time> {
        self.lock().nodes.values().filter_map(|node| node.desk.next_deadline()).min()
    }

    fn lock(&self) -> MutexGuard<'_, Exchange> {
        self.exchange.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl std::fmt::Debug for LocalCalls {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "LocalCalls({:?})", self.lock().nodes.keys())
    }
}

impl Exchange {
    fn next_caller(&mut self) -> CallerNumber {
        self.last_caller += 1;
        self.last_caller
    }

    fn tell(&mut self, number: CallerNumber, state: TicketState) {
        if let Some((_, old)) = self.tickets.get_mut(&number) {
            *old = state;
        }
    }

    fn advance(&mut self, now: Time) {
        self.send_calls(now);
        // Nothing is allocated while nothing is said: this runs after every step of every node.
        let mut replies = Vec::new();
        for node in self.nodes.values_mut() {
            node.desk.advance(now);
            if node.desk.take_news_for_step() {
                (node.notify_call)();
            }
            replies.extend(node.desk.take_replies());
        }
        for reply in replies {
            self.deliver(&reply);
        }
    }

    /// What the nodes' callers want goes to the desks of those whom they call.
    fn send_calls(&mut self, now: Time) {
        if self.nodes.values().all(|node| node.lines.is_empty()) {
            return;
        }
        let paths: Vec<String> = self.nodes.keys().cloned().collect();
        for path in paths {
            let lines = self.nodes.get(&path).map_or(0, |node| node.lines.len());
            for index in 0..lines {
                for (header, body) in self.wanted(&path, index) {
                    let Some(node) = self.nodes.get(&path) else { continue };
                    let (line, number) = (Arc::clone(&node.lines[index].line), node.lines[index].number);
                    let sender = Sender { name: Name::new(&path), pid: 0, uid: 0 };
                    match self.nodes.get_mut(&line.target.path) {
                        Some(target) => target.desk.receive(now, number, sender, &header, &body),
                        None => self.end_line(&path, index, CallEnd::Lost(Loss::NotRunning), &[]),
                    }
                }
            }
        }
    }

    /// What one caller of `path` has to say: a cancellation of the call before, a call, a cancellation of this.
    fn wanted(&mut self, path: &str, index: usize) -> Vec<(Header, Vec<u8>)> {
        let Some(node) = self.nodes.get_mut(path) else { return Vec::new() };
        let line = &mut node.lines[index];
        let mut wanted = Vec::new();
        if let Some((head, body)) = line.line.fetch() {
            if let Some(old) = line.current.replace(head) {
                wanted.push((Header::new(Kind::Cancel, old.id), Vec::new()));
            }
            let header = Header {
                deadline_ns: head.deadline.nanos(),
                layout_hash: line.line.request.hash,
                priority: head.priority,
                command: Name::new(&line.line.target.command),
                sender: Name::new(path),
                ..Header::new(Kind::Request, head.id)
            };
            wanted.push((header, body));
        }
        if let Some(id) = line.line.fetch_cancel() {
            wanted.push((Header::new(Kind::Cancel, id), Vec::new()));
        }
        wanted
    }

    /// A desk's message goes to the ticket or to the caller that it is for.
    fn deliver(&mut self, reply: &Reply) {
        if let Some((_, state)) = self.tickets.get_mut(&reply.caller) {
            update(state, reply);
            return;
        }
        for node in self.nodes.values_mut() {
            let Some(line) = node.lines.iter_mut().find(|line| line.number == reply.caller) else { continue };
            let id = reply.header.id;
            match reply.header.kind {
                Kind::Accepted => line.line.accepted(id),
                Kind::Progress => line.line.progress(id, reply.header.layout_hash, &reply.body),
                _ => {
                    if let Some(end) = end_of(&line.line, &reply.header, &reply.body) {
                        line.line.ended(id, end, &reply.body);
                        line.current = line.current.filter(|current| current.id != id);
                    }
                }
            }
            (node.notify_reply)();
            return;
        }
    }

    fn end_line(&mut self, path: &str, index: usize, end: CallEnd, body: &[u8]) {
        let Some(node) = self.nodes.get_mut(path) else { return };
        if let Some(head) = node.lines[index].current.take() {
            node.lines[index].line.ended(head.id, end, body);
            (node.notify_reply)();
        }
    }

    /// The node at `path` goes: its calls to others are withdrawn, those that wait for it are lost.
    fn leave(&mut self, path: &str) {
        let Some(gone) = self.nodes.remove(path) else { return };
        for line in &gone.lines {
            if let Some(target) = self.nodes.get_mut(&line.line.target.path) {
                target.desk.caller_gone(line.number);
            }
        }
        for (target, state) in self.tickets.values_mut() {
            if target == path && matches!(state, TicketState::Pending | TicketState::Running(_)) {
                *state = TicketState::Lost(Loss::Died);
            }
        }
        for node in self.nodes.values_mut() {
            for line in node.lines.iter_mut().filter(|line| line.line.target.path == path) {
                if let Some(head) = line.current.take() {
                    line.line.ended(head.id, CallEnd::Lost(Loss::Died), &[]);
                    (node.notify_reply)();
                }
            }
        }
    }
}

/// The ticket's state after one more message.
fn update(state: &mut TicketState, reply: &Reply) {
    *state = match reply.header.kind {
        Kind::Accepted => TicketState::Running(None),
        Kind::Progress => TicketState::Running(Some(reply.body.clone())),
        Kind::Answer => TicketState::Answered(reply.body.clone()),
        Kind::Refused => TicketState::Refused(Refusal::from_bytes(&reply.body)),
        Kind::Failed => TicketState::Failed(Refusal::from_bytes(&reply.body)),
        Kind::Cancelled => TicketState::Cancelled,
        Kind::Describe | Kind::Request | Kind::Cancel => return,
    };
}
