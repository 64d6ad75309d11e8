//! What the tests of calls and devices share: messages, a node whose step the test plays, raw sockets, patience.

#![allow(dead_code, clippy::unwrap_used, reason = "tests; each file uses its part")]

use std::os::fd::OwnedFd;
use std::path::Path;
use std::sync::mpsc::{Receiver, channel};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use messages::Message;
use messages::bytemuck::bytes_of;
use runtime::Time;
use runtime::calls::client::{Client, Request};
use runtime::calls::wire::{self, Header, Kind, Name};
use runtime::calls::{CallPort, OrderPort, StepWatch};
use runtime::pump::{Arrival, Pump, PumpBuilder};
use rustix::net::{AddressFamily, RecvFlags, SendFlags, SocketAddrUnix, SocketFlags, SocketType};
use tempfile::TempDir;

/// A test that waits longer than this for something is stuck.
pub const STUCK: Duration = Duration::from_secs(30);

/// A number to double.
#[derive(Debug, Clone, Copy, PartialEq, Default, Message)]
#[repr(C)]
pub struct Number {
    /// The number.
    pub value: f64,
}

/// Where to go.
#[derive(Debug, Clone, Copy, PartialEq, Default, Message)]
#[repr(C)]
pub struct Goal {
    /// Forward [m].
    pub x_m: f64,
    /// To the left [m].
    pub y_m: f64,
}

/// How far it is.
#[derive(Debug, Clone, Copy, PartialEq, Default, Message)]
#[repr(C)]
pub struct Remaining {
    /// Distance to the goal [m].
    pub distance_m: f64,
    /// Which report it is.
    pub report: u64,
}

pub fn now() -> Time {
    let now = rustix::time::clock_gettime(rustix::time::ClockId::Monotonic);
    Time::from_nanos(now.tv_sec as u64 * 1_000_000_000 + now.tv_nsec as u64)
}

/// Arrivals that a pump has told, in order.
pub struct Arrivals(Receiver<Arrival>);

impl Arrivals {
    pub fn of(builder: &mut PumpBuilder) -> Arrivals {
        let (sender, receiver) = channel();
        let sender = Mutex::new(sender);
        builder.notify(Arc::new(move |arrival| {
            // The test may be over already.
            let _ = sender.lock().unwrap().send(arrival);
        }));
        Arrivals(receiver)
    }

    /// Waits for something to come.
    pub fn wait(&self) -> Arrival {
        self.0.recv_timeout(STUCK).expect("nothing came for the step")
    }

    /// Waits for what comes until `done` gives something.
    pub fn until<T>(&self, mut done: impl FnMut() -> Option<T>) -> T {
        loop {
            if let Some(value) = done() {
                return value;
            }
            self.wait();
        }
    }

    /// Whether nothing has come.
    pub fn is_empty(&self) -> bool {
        self.0.try_recv().is_err()
    }
}

/// A node with the call `double` and the order `goto`; the test plays its step.
pub struct TestNode {
    pub double: CallPort<Number, Number>,
    pub goto: OrderPort<Goal, Remaining, Number>,
    pub arrivals: Arrivals,
    pub step: Arc<StepWatch>,
    pub pump: Pump,
}

pub const NODE: &str = "/tasks/mission";

impl TestNode {
    pub fn start(root: &Path) -> TestNode {
        TestNode::start_at(root, NODE)
    }

    pub fn start_at(root: &Path, path: &str) -> TestNode {
        let mut builder = PumpBuilder::new(path);
        let double = CallPort::detached("double");
        let goto = OrderPort::detached("goto");
        builder.attach(&double);
        builder.attach(&goto);
        builder.state(|| r#"{"mood":"good"}"#.into());
        let arrivals = Arrivals::of(&mut builder);
        let step = builder.step_watch();
        let pump = builder.spawn(root).unwrap();
        TestNode { double, goto, arrivals, step, pump }
    }
}

pub fn root() -> TempDir {
    tempfile::tempdir().unwrap()
}

pub fn client(root: &Path) -> Client {
    Client::connect(root, NODE, "test").unwrap()
}

/// A request to double `number`, with the timeout that no test waits for.
pub fn double(number: &Number, priority: u8) -> Request<'_> {
    Request {
        command: "double",
        layout_hash: Number::layout_hash(),
        body: bytes_of(number),
        priority,
        timeout_s: STUCK.as_secs_f64(),
    }
}

pub fn goto(goal: &Goal) -> Request<'_> {
    let (layout_hash, body) = (Goal::layout_hash(), bytes_of(goal));
    Request { command: "goto", layout_hash, body, priority: 0, timeout_s: STUCK.as_secs_f64() }
}

/// A seqpacket socket that speaks whatever the test wants.
pub struct RawSocket(OwnedFd);

impl RawSocket {
    pub fn connect(root: &Path) -> RawSocket {
        let kind = SocketType::SEQPACKET;
        let socket = rustix::net::socket_with(AddressFamily::UNIX, kind, SocketFlags::CLOEXEC, None).unwrap();
        let path = root.join(&NODE[1..]).join(".calls");
        rustix::net::connect(&socket, &SocketAddrUnix::new(path).unwrap()).unwrap();
        RawSocket(socket)
    }

    pub fn send(&self, message: &[u8]) {
        // A message too long for the socket, or a closed one: the test goes on.
        let _ = rustix::net::send(&self.0, message, SendFlags::NOSIGNAL);
    }

    /// Sends; false when the other end has closed.
    pub fn try_send(&self, message: &[u8]) -> bool {
        !matches!(rustix::net::send(&self.0, message, SendFlags::NOSIGNAL), Err(rustix::io::Errno::PIPE))
    }

    pub fn receive(&self) -> (Header, Vec<u8>) {
        let mut buffer = vec![0; wire::MAX_MESSAGE_BYTES];
        let (length, _) = rustix::net::recv(&self.0, &mut buffer[..], RecvFlags::empty()).unwrap();
        let (header, body) = wire::parse(&buffer[..length]).unwrap();
        (header, body.to_vec())
    }

    /// Sends a request to double `value` as call `id`.
    pub fn send_double(&self, id: u64, value: f64, deadline: Option<Time>) {
        let header = Header {
            layout_hash: Number::layout_hash(),
            deadline_ns: deadline.map_or(0, Time::nanos),
            command: Name::new("double"),
            sender: Name::new("raw"),
            ..Header::new(Kind::Request, id)
        };
        self.send(&header.message(bytes_of(&Number { value })));
    }

    pub fn send_cancel(&self, id: u64) {
        self.send(&Header::new(Kind::Cancel, id).message(&[]));
    }
}
