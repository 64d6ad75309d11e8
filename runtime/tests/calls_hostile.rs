//! A node's socket under hostile bytes: whatever comes, the node goes on answering others.

#![allow(clippy::unwrap_used, reason = "tests")]

mod calls_support;

use calls_support::*;
use messages::Message;
use proptest::prelude::*;
use runtime::calls::wire::{HEADER_BYTES, Header, Kind, MAX_MESSAGE_BYTES, Name};
use runtime::calls::{CallError, Refusal, RefusalCode};

fn message() -> impl Strategy<Value = Vec<u8>> {
    let noise = prop::collection::vec(any::<u8>(), 1..300);
    let kinds = prop::sample::select(vec![Kind::Describe, Kind::Request, Kind::Cancel, Kind::Accepted, Kind::Answer]);
    let commands = prop::sample::select(vec!["", "double", "goto", "ping", "state", "dubble"]);
    let body = prop::collection::vec(any::<u8>(), 0..40);
    let near = (kinds, commands, any::<u64>(), any::<u64>(), any::<bool>(), body).prop_map(
        |(kind, command, id, deadline_ns, right, body)| {
            let layout_hash = if right { Number::layout_hash() } else { 7 };
            let header = Header { deadline_ns, layout_hash, command: Name::new(command), ..Header::new(kind, id) };
            header.message(&body)
        },
    );
    let damaged = (near.clone(), 0..HEADER_BYTES, any::<u8>()).prop_map(|(mut message, offset, value)| {
        message[offset] = value;
        message
    });
    prop_oneof![noise, near, damaged]
}

#[test]
fn no_bytes_keep_a_node_from_answering_others() {
    let root = root();
    let node = std::cell::RefCell::new(TestNode::start(root.path()));
    proptest!(ProptestConfig::with_cases(64), |(messages in prop::collection::vec(message(), 1..12))| {
        let attacker = RawSocket::connect(root.path());
        for message in &messages {
            attacker.send(message);
        }
        drop(attacker);
        prop_assert!(client(root.path()).describe().is_ok());
        // Whatever was a call among them is withdrawn or answered; no place stays lost.
        let mut node = node.borrow_mut();
        while let Some(request) = node.double.take() {
            node.double.answer(request, &Number::default());
        }
        while let Some(order) = node.goto.take() {
            order.cancelled();
        }
    });
    assert!(!node.borrow().pump.has_ended());
}

#[test]
fn what_is_no_call_is_told_so() {
    let root = root();
    let _node = TestNode::start(root.path());
    let caller = RawSocket::connect(root.path());
    let told = |bytes: &[u8]| {
        caller.send(bytes);
        let (header, body) = caller.receive();
        assert_eq!(header.kind, Kind::Refused);
        let refusal = Refusal::from_bytes(&body);
        assert_eq!(refusal.code, RefusalCode::Malformed);
        refusal.reason
    };
    assert!(told(b"GET / HTTP/1.1\r\n\r\n").contains("too few"));
    assert!(told(&[b'x'; 200]).contains("no call of Sinew's"));
    assert!(told(&vec![0; MAX_MESSAGE_BYTES + 1]).contains("at most"));
    assert!(told(&Header::new(Kind::Progress, 1).message(&[])).contains("a node's word"));
}

#[test]
fn a_caller_that_does_not_read_is_dropped_and_others_are_served() {
    let root = root();
    let _node = TestNode::start(root.path());
    let deaf = RawSocket::connect(root.path());
    // Its receive buffer fills with refusals, then the node's patience ends: the socket closes, and sends come back.
    let gone = (0..100_000).any(|_| !deaf.try_send(&[b'x'; 200]));
    assert!(gone, "the node kept a caller that never reads");
    assert!(client(root.path()).describe().is_ok());
}

#[test]
fn too_many_callers_are_told_so_and_served_when_others_have_gone() {
    let root = root();
    let _node = TestNode::start(root.path());
    let crowd: Vec<_> = (0..64).map(|_| client(root.path())).collect();
    // Often, because the node's word and the caller's may cross on the way.
    for _ in 0..100 {
        let error = client(root.path()).describe().unwrap_err();
        assert!(matches!(&error, CallError::Refused { reason, .. } if reason.contains("64 callers")), "{error}");
    }
    drop(crowd);
    let served = (0..1000).any(|_| client(root.path()).describe().is_ok());
    assert!(served);
}
