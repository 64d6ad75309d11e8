//! Calls between processes' threads over real sockets. The test plays the called node's step.

#![allow(clippy::unwrap_used, reason = "tests")]

mod calls_support;

use std::sync::Barrier;
use std::thread;

use calls_support::*;
use messages::Message;
use runtime::calls::client::{Client, Update};
use runtime::calls::wire::Kind;
use runtime::calls::{CallError, CallState, Caller, Cancellation, Loss, PLACES, Refusal, RefusalCode, Target};
use runtime::pump::{PumpBuilder, PumpError};

#[test]
fn a_node_in_a_long_step_answers_what_it_can_at_once_and_the_rest_afterwards() {
    let root = root();
    let mut node = TestNode::start(root.path());
    node.step.begin(now().before_s(2.0));
    thread::scope(|scope| {
        let asked = scope.spawn(|| client(root.path()).call_message("double", &Number { value: 21.0 }, 0, 30.0));
        node.arrivals.wait();
        // The request waits for the step; meanwhile the pump answers.
        let ping = client(root.path()).call(&double_less("ping")).unwrap();
        let ping: serde_json::Value = serde_json::from_slice(&ping.body).unwrap();
        assert_eq!(ping["node"], NODE);
        assert!(ping["in_step_s"].as_f64().unwrap() >= 2.0, "{ping}");
        let state = client(root.path()).call(&double_less("state")).unwrap();
        assert_eq!(state.body, br#"{"mood":"good"}"#);
        assert!(!asked.is_finished());
        node.step.end(now());
        let request = node.double.take().unwrap();
        assert_eq!((request.message.value, request.sender.name.as_str()), (21.0, "test"));
        assert_eq!(request.sender.pid as u32, std::process::id());
        node.double.answer(request, &Number { value: 42.0 });
        assert_eq!(asked.join().unwrap(), Ok(Number { value: 42.0 }));
    });
}

fn double_less(command: &str) -> runtime::calls::client::Request<'_> {
    runtime::calls::client::Request { command, layout_hash: 0, body: &[], priority: 0, timeout_s: 30.0 }
}

#[test]
fn requests_are_taken_by_priority_and_then_by_arrival() {
    let root = root();
    let mut node = TestNode::start(root.path());
    thread::scope(|scope| {
        for (value, priority) in [(1.0, 10), (2.0, 200), (3.0, 10), (4.0, 200), (5.0, 11)] {
            let path = root.path();
            scope.spawn(move || client(path).call(&double(&Number { value }, priority)));
            node.arrivals.wait();
        }
        let mut order = Vec::new();
        while let Some(request) = node.double.take() {
            order.push(request.message.value);
            node.double.answer(request, &Number::default());
        }
        assert_eq!(order, [2.0, 4.0, 5.0, 1.0, 3.0]);
    });
}

#[test]
fn a_request_that_no_step_takes_in_time_is_withdrawn_and_its_caller_told_why() {
    let root = root();
    let mut node = TestNode::start(root.path());
    node.step.begin(now().before_s(1.5));
    let number = Number { value: 1.0 };
    let request = runtime::calls::client::Request { timeout_s: 0.02, ..double(&number, 0) };
    let error = client(root.path()).call(&request).unwrap_err();
    assert!(matches!(&error, CallError::TimedOut { reason, .. } if reason.contains("in a step since 15")), "{error}");
    assert!(node.double.take().is_none());
}

#[test]
fn a_request_that_the_step_took_but_did_not_answer_in_time_is_answered_only_once() {
    let root = root();
    let mut node = TestNode::start(root.path());
    let caller = RawSocket::connect(root.path());
    caller.send_double(1, 1.0, Some(now().after_s(0.5)));
    let request = node.arrivals.until(|| node.double.take());
    let (header, body) = caller.receive();
    assert_eq!(header.kind, Kind::Refused);
    let refusal = Refusal::from_bytes(&body);
    assert_eq!(refusal.code, RefusalCode::NotInTime);
    assert!(refusal.reason.contains("has taken the request"), "{}", refusal.reason);
    assert_eq!(request.cancellation(), Some(Cancellation::Asked));
    // The late answer goes nowhere; the next call's answer is the next thing that the caller hears.
    node.double.answer(request, &Number { value: -1.0 });
    caller.send_double(2, 2.0, None);
    let request = node.arrivals.until(|| node.double.take());
    node.double.answer(request, &Number { value: 4.0 });
    let (header, _) = caller.receive();
    assert_eq!((header.id, header.kind), (2, Kind::Answer));
}

#[test]
fn a_deadline_that_has_passed_and_an_id_in_use_are_refused() {
    let root = root();
    let _node = TestNode::start(root.path());
    let caller = RawSocket::connect(root.path());
    let refusal = |id| {
        let (header, body) = caller.receive();
        assert_eq!((header.kind, header.id), (Kind::Refused, id));
        Refusal::from_bytes(&body)
    };
    caller.send_double(1, 1.0, Some(now()));
    assert_eq!(refusal(1).code, RefusalCode::NotInTime);
    caller.send_double(2, 1.0, None);
    caller.send_double(2, 1.0, None);
    assert_eq!(refusal(2).code, RefusalCode::DuplicateId);
}

#[test]
fn a_full_queue_refuses_with_its_reason_and_takes_again_when_there_is_room() {
    let root = root();
    let mut node = TestNode::start(root.path());
    let caller = RawSocket::connect(root.path());
    for id in 1..=PLACES as u64 + 1 {
        caller.send_double(id, id as f64, None);
    }
    let (header, body) = caller.receive();
    assert_eq!((header.kind, header.id), (Kind::Refused, PLACES as u64 + 1));
    let refusal = Refusal::from_bytes(&body);
    assert_eq!(refusal.code, RefusalCode::QueueFull);
    assert!(refusal.reason.contains("16 requests for \"double\""), "{}", refusal.reason);
    let request = node.double.take().unwrap();
    node.double.answer(request, &Number::default());
    assert_eq!(caller.receive().0.kind, Kind::Answer);
    caller.send_double(99, 99.0, None);
    let mut values = Vec::new();
    node.arrivals.until(|| {
        values.extend(std::iter::from_fn(|| node.double.take()).map(|request| request.message.value));
        (values.last() == Some(&99.0)).then_some(())
    });
    assert_eq!(values.len(), PLACES);
}

#[test]
fn a_request_that_the_node_drops_is_told_to_be_lost() {
    let root = root();
    let mut node = TestNode::start(root.path());
    thread::scope(|scope| {
        let asked = scope.spawn(|| client(root.path()).call(&double(&Number::default(), 0)));
        drop(node.arrivals.until(|| node.double.take()));
        let error = asked.join().unwrap().unwrap_err();
        assert!(
            matches!(&error, CallError::Failed { reason, .. } if reason.contains("dropped the request")),
            "{error}"
        );
    });
}

#[test]
fn a_refusal_carries_the_nodes_own_reason() {
    let root = root();
    let mut node = TestNode::start(root.path());
    thread::scope(|scope| {
        let asked = scope.spawn(|| client(root.path()).call(&double(&Number::default(), 0)));
        let request = node.arrivals.until(|| node.double.take());
        node.double.refuse(request, "zero cannot be doubled");
        let error = asked.join().unwrap().unwrap_err();
        assert_eq!(error.to_string(), "\"double\" of /tasks/mission refused: zero cannot be doubled");
    });
}

#[test]
fn a_wrong_command_layout_or_length_is_refused_before_the_step_sees_it() {
    let root = root();
    let mut node = TestNode::start(root.path());
    let mut client = client(root.path());
    let number = Number::default();
    let good = double(&number, 0);
    let unknown = client.call(&runtime::calls::client::Request { command: "duoble", ..good }).unwrap_err();
    assert!(matches!(&unknown, CallError::Unknown { nearest, .. } if nearest == "double"), "{unknown}");
    let layout = client.call(&runtime::calls::client::Request { layout_hash: 1, ..good }).unwrap_err();
    let expected = Number::layout_hash();
    assert!(matches!(&layout, CallError::WrongLayout { expected_hash, .. } if *expected_hash == expected), "{layout}");
    assert!(layout.to_string().contains("takes Number"), "{layout}");
    let length = client.call(&runtime::calls::client::Request { body: &[0; 7], ..good }).unwrap_err();
    assert!(length.to_string().contains("takes a message of 8 bytes, 7 came"), "{length}");
    assert!(node.double.take().is_none() && node.arrivals.is_empty());
}

#[test]
fn a_description_is_enough_to_call_without_the_compiled_types() {
    let root = root();
    let mut node = TestNode::start(root.path());
    let mut client = client(root.path());
    let commands = client.describe().unwrap();
    let names: Vec<_> = commands.commands.iter().map(|command| command.name.as_str()).collect();
    assert_eq!((names, commands.built_in.len()), (vec!["double", "goto"], 2));
    let command = client.describe_command("double").unwrap();
    let schema = messages::Schema::from_text(&command.request.schema).unwrap();
    assert_eq!((schema.hash(), schema.size), (command.request.hash, command.request.bytes));
    assert!(client.describe_command("goto").unwrap().progress.is_some());
    assert!(
        matches!(client.describe_command("dubble"), Err(CallError::Unknown { nearest, .. }) if nearest == "double")
    );
    // As `sinew call` does: bytes by the described layout alone.
    let body = 5.0f64.to_le_bytes();
    thread::scope(|scope| {
        let request = runtime::calls::client::Request {
            command: "double",
            layout_hash: command.request.hash,
            body: &body,
            priority: 0,
            timeout_s: 30.0,
        };
        let asked = scope.spawn(move || client.call(&request));
        let request = node.arrivals.until(|| node.double.take());
        assert_eq!(request.message.value, 5.0);
        node.double.answer(request, &Number { value: 10.0 });
        let reply = asked.join().unwrap().unwrap();
        assert_eq!((reply.layout_hash, reply.body), (command.answer.hash, 10.0f64.to_le_bytes().to_vec()));
    });
}

#[test]
fn a_long_order_is_accepted_reports_and_is_done() {
    let root = root();
    let mut node = TestNode::start(root.path());
    thread::scope(|scope| {
        let (heard, hears) = std::sync::mpsc::channel();
        let path = root.path();
        let asked = scope.spawn(move || {
            let mut client = client(path);
            // The timeout is for being accepted; the order itself takes as long as it takes.
            let order = runtime::calls::client::Request { timeout_s: 5.0, ..goto(&Goal { x_m: 3.0, y_m: 4.0 }) };
            client.call_with(&order, |update| {
                let update = match update {
                    Update::Accepted => None,
                    Update::Progress { layout_hash, body } => {
                        assert_eq!(layout_hash, Remaining::layout_hash());
                        Some(f64::from_le_bytes(std::array::from_fn(|index| body[index])))
                    }
                };
                heard.send(update).unwrap();
            })
        });
        let mut order = node.arrivals.until(|| node.goto.take());
        assert_eq!(order.message, Goal { x_m: 3.0, y_m: 4.0 });
        order.accept();
        assert_eq!(hears.recv_timeout(STUCK), Ok(None));
        order.progress(&Remaining { distance_m: 5.0, report: 1 });
        assert_eq!(hears.recv_timeout(STUCK), Ok(Some(5.0)));
        order.progress(&Remaining { distance_m: 2.5, report: 2 });
        assert_eq!(hears.recv_timeout(STUCK), Ok(Some(2.5)));
        order.done(&Number { value: 7.0 });
        assert_eq!(asked.join().unwrap().unwrap().body, 7.0f64.to_le_bytes());
    });
}

#[test]
fn an_order_is_cancelled_before_the_step_takes_it_or_by_the_node_afterwards() {
    let root = root();
    let mut node = TestNode::start(root.path());
    thread::scope(|scope| {
        for taken in [false, true] {
            let mut client = client(root.path());
            let canceller = client.canceller();
            let asked = scope.spawn(move || client.call(&goto(&Goal::default())));
            let mut order = None;
            match taken {
                true => order = Some(node.arrivals.until(|| node.goto.take())),
                false => drop(node.arrivals.wait()),
            }
            canceller.cancel();
            if let Some(order) = order {
                node.arrivals.until(|| order.is_cancelled().then_some(()));
                assert_eq!(order.cancellation(), Some(Cancellation::Asked));
                order.cancelled();
            }
            assert!(matches!(asked.join().unwrap(), Err(CallError::Cancelled { .. })));
            assert!(node.goto.take().is_none());
        }
    });
}

#[test]
fn an_order_whose_caller_has_gone_is_cancelled_and_a_waiting_request_withdrawn() {
    let root = root();
    let mut node = TestNode::start(root.path());
    let caller = RawSocket::connect(root.path());
    caller.send_double(1, 1.0, None);
    let taken = node.arrivals.until(|| node.double.take());
    caller.send_double(2, 2.0, None);
    node.arrivals.wait();
    drop(caller);
    node.arrivals.until(|| taken.is_cancelled().then_some(()));
    assert_eq!(taken.cancellation(), Some(Cancellation::CallerGone));
    assert!(node.double.take().is_none());
    node.double.answer(taken, &Number::default());
    // All its places are free again.
    let caller = RawSocket::connect(root.path());
    (1..=PLACES as u64).for_each(|id| caller.send_double(id, 1.0, None));
    let mut count = 0;
    node.arrivals.until(|| {
        count += std::iter::from_fn(|| node.double.take()).map(std::mem::forget).count();
        (count == PLACES).then_some(())
    });
}

#[test]
fn a_failed_order_says_why() {
    let root = root();
    let mut node = TestNode::start(root.path());
    thread::scope(|scope| {
        let asked = scope.spawn(|| client(root.path()).call(&goto(&Goal::default())));
        let mut order = node.arrivals.until(|| node.goto.take());
        order.accept();
        order.failed("the way is blocked");
        let error = asked.join().unwrap().unwrap_err();
        assert_eq!(error.to_string(), "\"goto\" of /tasks/mission failed: the way is blocked");
    });
}

#[test]
fn a_node_that_stops_in_mid_call_gives_its_caller_an_error_at_once() {
    let root = root();
    let node = TestNode::start(root.path());
    thread::scope(|scope| {
        let asked = scope.spawn(|| client(root.path()).call(&double(&Number::default(), 0)));
        node.arrivals.wait();
        node.pump.stop();
        assert!(matches!(asked.join().unwrap(), Err(CallError::Died { .. })));
    });
    assert!(!root.path().join("tasks/mission/.calls").exists());
    assert!(matches!(Client::connect(root.path(), NODE, "test"), Err(CallError::NodeNotRunning { .. })));
}

#[test]
fn the_answers_of_the_last_step_go_out_before_a_node_stops() {
    // Often, because the pump may already have sent the answer before it is told to stop.
    for _ in 0..50 {
        let root = root();
        let mut node = TestNode::start(root.path());
        thread::scope(|scope| {
            let asked = scope.spawn(|| client(root.path()).call_message("double", &Number { value: 2.0 }, 0, 30.0));
            let request = node.arrivals.until(|| node.double.take());
            node.double.answer(request, &Number { value: 4.0 });
            node.pump.stop();
            assert_eq!(asked.join().unwrap(), Ok(Number { value: 4.0 }));
        });
    }
}

#[test]
fn two_nodes_that_call_each_other_within_their_steps_both_get_their_answers() {
    let root = root();
    let both_have_called = Barrier::new(2);
    thread::scope(|scope| {
        for (own, other) in [("/tasks/alice", "/tasks/bob double"), ("/tasks/bob", "/tasks/alice double")] {
            let (root, both_have_called) = (root.path(), &both_have_called);
            scope.spawn(move || {
                let mut builder = PumpBuilder::new(own);
                let mut port = runtime::CallPort::<Number, Number>::detached("double");
                let target: Target = other.parse().unwrap();
                let mut caller: Caller<Number, Number> = Caller::detached(target);
                builder.attach(&port);
                builder.attach(&caller);
                let arrivals = Arrivals::of(&mut builder);
                let _pump = builder.spawn(root).unwrap();
                both_have_called.wait();
                // First step: call. Neither answers before both have called.
                caller.start(now(), &Number { value: 3.0 }, 0, 30.0);
                both_have_called.wait();
                // Further steps: answer what has come, look what has been answered.
                let (mut answered, mut answer) = (false, None);
                arrivals.until(|| {
                    while let Some(request) = port.take() {
                        let doubled = Number { value: 2.0 * request.message.value };
                        port.answer(request, &doubled);
                        answered = true;
                    }
                    match caller.poll(now()) {
                        CallState::Answered(number) => answer = Some(number.value),
                        state => assert!(matches!(state, CallState::Pending | CallState::Idle), "{state:?}"),
                    }
                    (answered && answer.is_some()).then_some(())
                });
                assert_eq!(answer, Some(6.0));
                assert_eq!(caller.poll(now()), CallState::Idle);
                both_have_called.wait();
            });
        }
    });
}

/// A node that calls [`NODE`].
struct CallingNode {
    double: Caller<Number, Number>,
    goto: Caller<Goal, Number>,
    arrivals: Arrivals,
    _pump: runtime::pump::Pump,
}

impl CallingNode {
    fn start(root: &std::path::Path) -> CallingNode {
        let mut builder = PumpBuilder::new("/actions/caller");
        let double = Caller::detached(format!("{NODE} double").parse().unwrap());
        let goto = Caller::detached(format!("{NODE} goto").parse().unwrap()).with_progress::<Remaining>();
        builder.attach(&double);
        builder.attach(&goto);
        let arrivals = Arrivals::of(&mut builder);
        CallingNode { double, goto, arrivals, _pump: builder.spawn(root).unwrap() }
    }
}

#[test]
fn a_caller_learns_every_way_that_a_call_can_end() {
    let root = root();
    let mut caller = CallingNode::start(root.path());
    let ended = |caller: &mut CallingNode| {
        let CallingNode { double, arrivals, .. } = caller;
        arrivals.until(|| Some(double.poll(now())).filter(|state| *state != CallState::Pending))
    };
    let number = Number { value: 1.0 };
    caller.double.start(now(), &number, 0, 30.0);
    assert_eq!(ended(&mut caller), CallState::Lost(Loss::NotRunning));

    let mut node = TestNode::start(root.path());
    caller.double.start(now(), &number, 7, 30.0);
    let request = node.arrivals.until(|| node.double.take());
    assert_eq!((request.priority, request.sender.name.as_str()), (7, "/actions/caller"));
    node.double.refuse(request, "not today");
    assert!(matches!(ended(&mut caller), CallState::Refused(reason) if reason.as_str() == "not today"));

    caller.double.start(now(), &number, 0, 0.02);
    assert_eq!(ended(&mut caller), CallState::TimedOut);

    // The step may be quicker than the pump to take what has just run out of time.
    let next = |node: &mut TestNode, value: f64| {
        let TestNode { double, arrivals, .. } = node;
        arrivals.until(|| double.take().filter(|request| request.message.value == value))
    };
    caller.double.start(now(), &Number { value: 2.0 }, 0, 30.0);
    drop(next(&mut node, 2.0));
    assert!(matches!(ended(&mut caller), CallState::Failed(reason) if reason.code == RefusalCode::Forgotten));

    caller.double.start(now(), &Number { value: 3.0 }, 0, 30.0);
    std::mem::forget(next(&mut node, 3.0));
    drop(node);
    assert_eq!(ended(&mut caller), CallState::Lost(Loss::Died));

    // A successor is found without further ado.
    let mut node = TestNode::start(root.path());
    caller.double.start(now(), &number, 0, 30.0);
    let request = node.arrivals.until(|| node.double.take());
    node.double.answer(request, &Number { value: 2.0 });
    assert_eq!(ended(&mut caller), CallState::Answered(Number { value: 2.0 }));
    assert_eq!(caller.double.poll(now()), CallState::Idle);
}

#[test]
fn a_caller_follows_a_long_order_and_cancels_it() {
    let root = root();
    let mut node = TestNode::start(root.path());
    let mut caller = CallingNode::start(root.path());
    caller.goto.start(now(), &Goal { x_m: 1.0, y_m: 0.0 }, 0, 30.0);
    let mut order = node.arrivals.until(|| node.goto.take());
    order.accept();
    order.progress(&Remaining { distance_m: 1.0, report: 1 });
    let CallingNode { goto, arrivals, .. } = &mut caller;
    let progress: Remaining = arrivals.until(|| {
        goto.poll(now());
        goto.progress()
    });
    assert_eq!((progress.distance_m, goto.poll(now())), (1.0, CallState::Running));
    goto.cancel();
    node.arrivals.until(|| order.is_cancelled().then_some(()));
    order.cancelled();
    arrivals.until(|| (goto.poll(now()) == CallState::Cancelled).then_some(()));
}

#[test]
fn a_new_call_withdraws_the_one_before() {
    let root = root();
    let mut node = TestNode::start(root.path());
    let mut caller = CallingNode::start(root.path());
    caller.double.start(now(), &Number { value: 1.0 }, 0, 30.0);
    let first = node.arrivals.until(|| node.double.take());
    caller.double.start(now(), &Number { value: 2.0 }, 0, 30.0);
    let second = node.arrivals.until(|| node.double.take());
    assert!(first.is_cancelled());
    node.double.answer(first, &Number { value: -1.0 });
    node.double.answer(second, &Number { value: 4.0 });
    let CallingNode { double, arrivals, .. } = &mut caller;
    let state = arrivals.until(|| Some(double.poll(now())).filter(|state| *state != CallState::Pending));
    assert_eq!(state, CallState::Answered(Number { value: 4.0 }));
}

#[test]
fn a_second_node_at_the_same_path_is_refused_and_a_dead_ones_socket_replaced() {
    let root = root();
    let node = TestNode::start(root.path());
    let error = PumpBuilder::new(NODE).spawn(root.path()).unwrap_err();
    assert!(error.to_string().contains("another process answers calls"), "{error}");
    // What a killed node leaves: a socket file on which nobody listens.
    let socket = root.path().join("tasks/mission/.calls");
    std::fs::hard_link(&socket, root.path().join("kept")).unwrap();
    drop(node);
    std::fs::rename(root.path().join("kept"), &socket).unwrap();
    assert!(matches!(Client::connect(root.path(), NODE, "test"), Err(CallError::NodeNotRunning { .. })));
    let _node = TestNode::start(root.path());
    client(root.path()).describe().unwrap();
}

#[test]
fn a_successor_takes_the_socket_over_from_a_predecessor_that_hangs() {
    let root = root();
    let hanging = TestNode::start(root.path());
    let mut builder = PumpBuilder::new(NODE);
    builder.state(|| "\"successor\"".into());
    builder.take_over();
    let _successor = builder.spawn(root.path()).unwrap();
    // The old one must not take the new one's socket away when it ends at last.
    drop(hanging);
    assert_eq!(client(root.path()).call(&double_less("state")).unwrap().body, b"\"successor\"");
}

#[test]
fn what_cannot_be_served_is_refused_when_the_node_starts() {
    let root = root();
    let spawn = |commands: &[&'static str]| {
        let mut builder = PumpBuilder::new(NODE);
        for command in commands {
            builder.attach(&runtime::CallPort::<Number, Number>::detached(command));
        }
        builder.spawn(root.path()).unwrap_err().to_string()
    };
    assert!(spawn(&["ping"]).contains("built-in"));
    assert!(spawn(&["go", "go"]).contains("declared twice"));
    assert!(spawn(&["a_name_of_more_than_thirty_two_bytes"]).contains("32 bytes"));
    let deep = root.path().join("x".repeat(100));
    let error = PumpBuilder::new(NODE).spawn(&deep).unwrap_err();
    assert!(matches!(error, PumpError::Calls(_)) && error.to_string().contains("bytes long"), "{error}");
    assert!(std::fs::read_dir(root.path()).unwrap().next().is_none(), "a refused node left something behind");
}

#[test]
fn a_declared_node_touches_nothing() {
    let root = root();
    let mut builder = PumpBuilder::new(NODE);
    builder.attach(&runtime::CallPort::<Number, Number>::detached("double"));
    let link = root.path().join("tty");
    builder.attach(&runtime::Device::detached_server(format!("pty:{}", link.display()).parse().unwrap()));
    drop(builder);
    assert!(std::fs::read_dir(root.path()).unwrap().next().is_none());
}
