//! Calls within a simulated host: the same ports and last words, on virtual time and without threads.

#![allow(clippy::unwrap_used, reason = "tests")]

mod calls_support;

use calls_support::{Goal, Number, Remaining};
use messages::Message;
use messages::bytemuck::bytes_of;
use runtime::Time;
use runtime::calls::{
    CallPort, CallState, Caller, LocalCalls, LocalRequest, Loss, OrderPort, RefusalCode, TicketState,
};
use runtime::pump::PumpBuilder;

const NODE: &str = "/tasks/mission";

struct Node {
    double: CallPort<Number, Number>,
    goto: OrderPort<Goal, Remaining, Number>,
}

fn join(calls: &LocalCalls) -> Node {
    let node = Node { double: CallPort::detached("double"), goto: OrderPort::detached("goto") };
    let mut builder = PumpBuilder::new(NODE);
    builder.attach(&node.double);
    builder.attach(&node.goto);
    builder.join(calls).unwrap();
    node
}

fn double(number: &Number, deadline_s: f64) -> LocalRequest<'_> {
    LocalRequest {
        path: NODE,
        command: "double",
        layout_hash: Number::layout_hash(),
        body: bytes_of(number),
        priority: 0,
        deadline: Time::from_seconds(deadline_s),
    }
}

#[test]
fn a_ticket_is_answered_when_the_step_has_answered() {
    let calls = LocalCalls::new();
    let mut node = join(&calls);
    let ticket = calls.request(Time::ZERO, &double(&Number { value: 4.0 }, 1.0));
    assert_eq!(calls.poll(ticket), TicketState::Pending);
    let request = node.double.take().unwrap();
    assert_eq!(request.sender.name.as_str(), "simulated host");
    node.double.answer(request, &Number { value: 8.0 });
    calls.advance(Time::from_seconds(0.1));
    assert_eq!(calls.poll(ticket), TicketState::Answered(8.0f64.to_le_bytes().to_vec()));
}

#[test]
fn a_ticket_tells_every_other_end() {
    let calls = LocalCalls::new();
    let number = Number { value: 1.0 };
    let ticket = calls.request(Time::ZERO, &double(&number, 1.0));
    assert_eq!(calls.poll(ticket), TicketState::Lost(Loss::NotRunning));
    let mut node = join(&calls);
    let unknown = calls.request(Time::ZERO, &LocalRequest { command: "halve", ..double(&number, 1.0) });
    assert!(
        matches!(calls.poll(unknown), TicketState::Refused(refusal) if refusal.code == RefusalCode::UnknownCommand)
    );
    let late = calls.request(Time::ZERO, &double(&number, 1.0));
    assert_eq!(calls.next_deadline(), Some(Time::from_seconds(1.0)));
    calls.advance(Time::from_seconds(1.0));
    assert!(matches!(calls.poll(late), TicketState::Refused(refusal) if refusal.code == RefusalCode::NotInTime));
    assert!(node.double.take().is_none());
    let cancelled = calls.request(Time::ZERO, &double(&number, 9.0));
    calls.cancel(Time::ZERO, cancelled);
    assert_eq!(calls.poll(cancelled), TicketState::Cancelled);
    let lost = calls.request(Time::ZERO, &double(&number, 9.0));
    calls.node_ended(NODE);
    assert_eq!(calls.poll(lost), TicketState::Lost(Loss::Died));
}

#[test]
fn a_long_order_runs_through_its_states() {
    let calls = LocalCalls::new();
    let mut node = join(&calls);
    let goal = Goal { x_m: 1.0, y_m: 2.0 };
    let request = LocalRequest {
        path: NODE,
        command: "goto",
        layout_hash: Goal::layout_hash(),
        body: bytes_of(&goal),
        priority: 0,
        deadline: Time::from_seconds(1.0),
    };
    let ticket = calls.request(Time::ZERO, &request);
    let mut order = node.goto.take().unwrap();
    order.accept();
    calls.advance(Time::from_seconds(0.5));
    assert_eq!(calls.poll(ticket), TicketState::Running(None));
    // Accepted orders have no deadline.
    let report = Remaining { distance_m: 1.5, report: 3 };
    order.progress(&report);
    calls.advance(Time::from_seconds(60.0));
    assert_eq!(calls.poll(ticket), TicketState::Running(Some(bytes_of(&report).to_vec())));
    order.done(&Number { value: 1.0 });
    calls.advance(Time::from_seconds(61.0));
    assert!(matches!(calls.poll(ticket), TicketState::Answered(_)));
}

#[test]
fn nodes_call_each_other_and_learn_of_deaths() {
    let calls = LocalCalls::new();
    let mut node = join(&calls);
    let mut builder = PumpBuilder::new("/actions/caller");
    let mut caller: Caller<Number, Number> = Caller::detached(format!("{NODE} double").parse().unwrap());
    builder.attach(&caller);
    builder.join(&calls).unwrap();
    caller.start(Time::ZERO, &Number { value: 2.0 }, 9, 1.0);
    calls.advance(Time::ZERO);
    let request = node.double.take().unwrap();
    assert_eq!((request.priority, request.sender.name.as_str()), (9, "/actions/caller"));
    node.double.answer(request, &Number { value: 4.0 });
    calls.advance(Time::from_seconds(0.1));
    assert_eq!(caller.poll(Time::from_seconds(0.1)), CallState::Answered(Number { value: 4.0 }));

    caller.start(Time::from_seconds(1.0), &Number { value: 2.0 }, 9, 1.0);
    calls.advance(Time::from_seconds(1.0));
    // A simulated death skips destructors: what the node holds is never answered.
    std::mem::forget(node.double.take());
    calls.node_ended(NODE);
    assert_eq!(caller.poll(Time::from_seconds(1.1)), CallState::Lost(Loss::Died));

    caller.start(Time::from_seconds(2.0), &Number { value: 2.0 }, 9, 1.0);
    calls.advance(Time::from_seconds(2.0));
    assert_eq!(caller.poll(Time::from_seconds(2.0)), CallState::Lost(Loss::NotRunning));

    let mut node = join(&calls);
    caller.start(Time::from_seconds(3.0), &Number { value: 2.0 }, 9, 1.0);
    calls.advance(Time::from_seconds(3.0));
    assert!(node.double.take().is_some());
}

#[test]
fn a_caller_that_nobody_answers_times_out_by_virtual_time() {
    let calls = LocalCalls::new();
    let mut node = join(&calls);
    let mut builder = PumpBuilder::new("/actions/caller");
    let mut caller: Caller<Number, Number> = Caller::detached(format!("{NODE} double").parse().unwrap());
    builder.attach(&caller);
    builder.join(&calls).unwrap();
    caller.start(Time::ZERO, &Number::default(), 0, 1.0);
    calls.advance(Time::ZERO);
    assert_eq!(caller.poll(Time::from_seconds(0.999)), CallState::Pending);
    calls.advance(Time::from_seconds(1.0));
    assert_eq!(caller.poll(Time::from_seconds(1.0)), CallState::TimedOut);
    assert!(node.double.take().is_none());
}
