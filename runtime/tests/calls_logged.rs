//! What a node does not do is told to its log: who asked, for what, and why not. The test plays the called node's step.

#![allow(clippy::unwrap_used, reason = "tests")]

mod calls_support;

use std::sync::mpsc::{Receiver, channel};
use std::sync::{Arc, Mutex};
use std::thread;

use calls_support::*;
use messages::Message;
use messages::bytemuck::bytes_of;
use runtime::Time;
use runtime::calls::client::Request;
use runtime::calls::{CallPort, LocalCalls, LocalRequest, OrderPort, RefusalCode, TicketState};
use runtime::pump::{Log, Pump, PumpBuilder};

/// A log whose lines the test reads.
fn log() -> (Log, Receiver<String>) {
    let (sender, lines) = channel();
    let sender = Mutex::new(sender);
    (Arc::new(move |line| sender.lock().unwrap().send(line.to_owned()).unwrap()), lines)
}

struct Node {
    goto: OrderPort<Goal, Remaining, Number>,
    arrivals: Arrivals,
    lines: Receiver<String>,
    _pump: Pump,
}

impl Node {
    fn start(root: &std::path::Path) -> Node {
        let mut builder = PumpBuilder::new(NODE);
        let goto = OrderPort::detached("goto");
        builder.attach(&goto);
        let arrivals = Arrivals::of(&mut builder);
        let (log, lines) = log();
        builder.log(log);
        let pump = builder.spawn(root).unwrap();
        Node { goto, arrivals, lines, _pump: pump }
    }

    fn line(&self) -> String {
        self.lines.recv_timeout(STUCK).expect("nothing is said in the log")
    }
}

fn order(goal: &Goal) -> Request<'_> {
    Request { command: "goto", layout_hash: Goal::layout_hash(), body: bytes_of(goal), priority: 0, timeout_s: 30.0 }
}

#[test]
fn an_order_that_the_node_refuses_or_cannot_do_is_in_the_log_with_its_sender_and_the_reason() {
    let root = root();
    let mut node = Node::start(root.path());
    let who = format!("test (process {}, user {})", std::process::id(), rustix::process::getuid().as_raw());
    thread::scope(|scope| {
        let asked = scope.spawn(|| client(root.path()).call(&order(&Goal::default())));
        node.arrivals.until(|| node.goto.take()).refuse("the goal is off the map");
        asked.join().unwrap().unwrap_err();
        assert_eq!(node.line(), format!("refused \"goto\" of {who}: the goal is off the map"));
        let asked = scope.spawn(|| client(root.path()).call(&order(&Goal::default())));
        let mut taken = node.arrivals.until(|| node.goto.take());
        taken.accept();
        taken.failed("something stands at the goal");
        asked.join().unwrap().unwrap_err();
        assert_eq!(node.line(), format!("failed \"goto\" of {who}: something stands at the goal"));
    });
}

#[test]
fn what_never_reaches_the_step_is_in_the_log_and_what_is_done_is_not() {
    let root = root();
    let mut node = Node::start(root.path());
    thread::scope(|scope| {
        let asked = scope.spawn(|| client(root.path()).call(&order(&Goal::default())));
        node.arrivals.until(|| node.goto.take()).done(&Number::default());
        asked.join().unwrap().unwrap();
    });
    let goal = Goal::default();
    let unknown = Request { command: "gotoo", ..order(&goal) };
    client(root.path()).call(&unknown).unwrap_err();
    let line = node.line();
    assert!(line.starts_with("refused \"gotoo\" of test (process"), "{line}");
    assert!(line.contains("nearest: \"goto\""), "{line}");
    let wrong = Request { layout_hash: 1, ..order(&goal) };
    client(root.path()).call(&wrong).unwrap_err();
    assert!(node.line().contains("takes Goal with layout"));
    let late = Request { timeout_s: 0.01, ..order(&goal) };
    client(root.path()).call(&late).unwrap_err();
    assert!(node.line().contains("not answered in time"));
    assert!(node.lines.try_recv().is_err());
}

#[test]
fn the_simulated_host_tells_the_same() {
    let mut builder = PumpBuilder::new(NODE);
    let mut double: CallPort<Number, Number> = CallPort::detached("double");
    builder.attach(&double);
    let (log, lines) = log();
    builder.log(log);
    let calls = LocalCalls::new();
    builder.join(&calls).unwrap();
    let now = Time::from_seconds(1.0);
    let number = Number { value: f64::NAN };
    let request = LocalRequest {
        path: NODE,
        command: "double",
        layout_hash: Number::layout_hash(),
        body: bytes_of(&number),
        priority: 0,
        deadline: now.after_s(1.0),
    };
    let ticket = calls.request(now, &request);
    let taken = double.take().unwrap();
    double.refuse(taken, "that is no number");
    calls.advance(now);
    assert!(matches!(calls.poll(ticket), TicketState::Refused(refusal) if refusal.code == RefusalCode::ByNode));
    assert_eq!(lines.try_recv().unwrap(), "refused \"double\" of simulated host: that is no number");
}
