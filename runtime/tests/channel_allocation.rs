//! The hot path of a channel asks nothing of the allocator.
#![allow(clippy::unwrap_used, reason = "tests")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

use runtime::channel::{Claim, Geometry, Method, PrivateWord, SampleBuffer, Tree, Waiter};

struct Counting;

thread_local! {
    static ASKED: Cell<u64> = const { Cell::new(0) };
}

// SAFETY: everything is passed on to the system's allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ASKED.set(ASKED.get() + 1);
        // SAFETY: the caller's promises are passed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        ASKED.set(ASKED.get() + 1);
        // SAFETY: the caller's promises are passed on.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

#[test]
fn publishing_reading_and_waiting_allocate_nothing() {
    let folder = tempfile::tempdir_in("/dev/shm").unwrap();
    for tree in [Tree::local(), Tree::shared(&folder.path().join("robot")).unwrap()] {
        let geometry = Geometry {
            type_name: "Allocation".into(),
            layout_hash: 1,
            schema: String::new(),
            fixed_bytes: 64,
            tail_element_bytes: 8,
            tail_capacity: 100,
            depth: 4,
        };
        let mut writer = tree.writer("/a", &geometry, Claim::Continue).unwrap();
        let reader = tree.reader("/a", None).unwrap();
        let private = PrivateWord::new();
        let mut waiters = vec![Waiter::with_method(&private, vec![reader.word()], Method::Helpers).unwrap()];
        if Waiter::new(&private, Vec::new()).unwrap().method() == Method::Vector {
            waiters.push(Waiter::new(&private, vec![reader.word()]).unwrap());
        }
        let mut buffer = SampleBuffer::new(&geometry);
        let (fixed, tail) = ([1; 64], [2; 900]);

        let before = ASKED.get();
        for n in 0..100 {
            waiters.iter_mut().for_each(Waiter::snapshot);
            assert!(writer.publish(n, &fixed, &tail).cut);
            waiters.iter_mut().for_each(|waiter| {
                waiter.wait(Some(0));
            });
            private.bump();
            waiters[0].wait(Some(0));
            let head = reader.head();
            assert!(reader.read(head, &mut buffer).is_ok());
            assert!(reader.at_or_before(n, head).is_some());
            assert!(reader.read_in_place(head, |slot| slot.tail(0)).is_ok());
            assert!(!reader.retired() && !reader.unlinked());
        }
        assert_eq!(ASKED.get() - before, 0);
        let before = ASKED.get();
        drop(std::hint::black_box(Box::new(1)));
        assert!(ASKED.get() > before, "the count counts");
    }
}
