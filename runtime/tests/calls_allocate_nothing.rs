//! What a step does with devices and calls allocates nothing.

#![allow(clippy::unwrap_used, reason = "tests")]

mod calls_support;

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

use calls_support::*;
use runtime::Device;
use runtime::calls::{CallState, Caller, LocalCalls, LocalRequest};
use runtime::device::MemoryLinks;
use runtime::pump::PumpBuilder;

/// The system's allocator, which also counts what the current thread asks of it.
struct Counting;

thread_local! {
    static ALLOCATIONS: Cell<usize> = const { Cell::new(0) };
}

// SAFETY: every call goes to the system's allocator unchanged; counting touches only a thread's own cell.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.with(|count| count.set(count.get() + 1));
        // SAFETY: the caller's promise, passed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        ALLOCATIONS.with(|count| count.set(count.get() + 1));
        // SAFETY: the caller's promise, passed on.
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        ALLOCATIONS.with(|count| count.set(count.get() + 1));
        // SAFETY: the caller's promise, passed on.
        unsafe { System.realloc(pointer, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// What `step` gives, and how often it allocated or freed.
fn counted<T>(step: impl FnOnce() -> T) -> (T, usize) {
    let before = ALLOCATIONS.with(Cell::get);
    let value = step();
    (value, ALLOCATIONS.with(Cell::get) - before)
}

#[test]
fn the_counter_counts() {
    let (vector, count) = counted(|| vec![1u8; 100]);
    assert_eq!((vector.len(), count), (100, 1));
}

#[test]
fn receiving_and_sending_over_memory_and_terminals_allocate_nothing() {
    let links = MemoryLinks::new();
    let (memory_client, memory_server) = (links.client("base", Some(9600)), links.server("base", Some(9600)));
    let root = root();
    let address = format!("pty:{}", root.path().join("tty").display());
    let mut builder = PumpBuilder::new("/simulator/world");
    let server = Device::detached_server(address.parse().unwrap());
    builder.attach(&server);
    let served = Arrivals::of(&mut builder);
    let _serving = builder.spawn(root.path()).unwrap();
    served.until(|| root.path().join("tty").exists().then_some(()));
    let mut builder = PumpBuilder::new("/drivers/base");
    let client = Device::detached(address.parse().unwrap());
    builder.attach(&client);
    let used = Arrivals::of(&mut builder);
    let _using = builder.spawn(root.path()).unwrap();
    used.until(|| client.link().is_open().then_some(()));
    served.until(|| server.link().is_open().then_some(()));
    for (mut client, mut server, arrivals) in [(memory_client, memory_server, None), (client, server, Some(&served))] {
        let (sent, in_send) = counted(|| client.send(b"\xFA\xFB\x03\x00\x00\x00"));
        assert_eq!((sent, in_send), (Ok(()), 0));
        let mut buffer = [0; 64];
        let mut look = || Some(counted(|| server.receive(&mut buffer))).filter(|(count, _)| *count > 0);
        let (_, in_receive) = match arrivals {
            Some(arrivals) => arrivals.until(look),
            None => {
                links.set_now(runtime::Time::from_seconds(1.0));
                look().unwrap()
            }
        };
        assert_eq!(in_receive, 0);
    }
}

#[test]
fn taking_answering_and_refusing_allocate_nothing() {
    let root = root();
    let mut node = TestNode::start(root.path());
    let caller = RawSocket::connect(root.path());
    for id in 1..=4 {
        caller.send_double(id, 2.0, None);
        let request = node.arrivals.until(|| {
            let (request, count) = counted(|| node.double.take());
            assert_eq!(count, 0);
            request
        });
        let ((), count) = counted(|| match id {
            1 => node.double.refuse(request, "no"),
            2 => drop(request),
            _ => node.double.answer(request, &Number { value: 4.0 }),
        });
        assert_eq!(count, 0);
        caller.receive();
    }
}

#[test]
fn a_long_order_allocates_nothing_in_the_step() {
    let calls = LocalCalls::new();
    let mut goto = runtime::OrderPort::<Goal, Remaining, Number>::detached("goto");
    let mut builder = PumpBuilder::new(NODE);
    builder.attach(&goto);
    builder.join(&calls).unwrap();
    let goal = goto_request();
    calls.request(runtime::Time::ZERO, &LocalRequest { body: messages::bytemuck::bytes_of(&goal), ..local("goto") });
    let (accepted, count) = counted(|| {
        let mut order = goto.take().unwrap();
        order.accept();
        order.progress(&Remaining::default());
        let wanted = !order.is_cancelled();
        order.done(&Number::default());
        wanted
    });
    assert_eq!((accepted, count), (true, 0));
}

fn goto_request() -> Goal {
    Goal { x_m: 1.0, y_m: 1.0 }
}

fn local(command: &str) -> LocalRequest<'_> {
    LocalRequest {
        path: NODE,
        command,
        layout_hash: <Goal as messages::Message>::layout_hash(),
        body: &[],
        priority: 0,
        deadline: runtime::Time::from_seconds(1.0),
    }
}

#[test]
fn calling_others_allocates_nothing_in_the_step() {
    let root = root();
    let mut node = TestNode::start(root.path());
    let mut builder = PumpBuilder::new("/actions/caller");
    let mut caller: Caller<Number, Number> = Caller::detached(format!("{NODE} double").parse().unwrap());
    builder.attach(&caller);
    let arrivals = Arrivals::of(&mut builder);
    let _pump = builder.spawn(root.path()).unwrap();
    let time = now();
    let (_, count) = counted(|| caller.start(time, &Number { value: 1.0 }, 0, 30.0));
    assert_eq!(count, 0);
    let request = node.arrivals.until(|| node.double.take());
    node.double.answer(request, &Number { value: 2.0 });
    let state = arrivals.until(|| {
        let time = now();
        let (state, count) = counted(|| caller.poll(time));
        assert_eq!(count, 0);
        Some(state).filter(|state| *state != CallState::Pending)
    });
    assert_eq!(state, CallState::Answered(Number { value: 2.0 }));
}
