//! Waiters and what wakes them.

use runtime::channel::{Claim, Method, PrivateWord, RawReader, RawWriter, Waiter, Woken};

use super::{Ground, PATH, geometry, publish};

suite! {
    a_waiter_returns_for_what_changed_after_its_snapshot
    a_waiter_says_which_of_its_words_changed
    a_waiter_times_out_at_its_time_and_not_before
    two_threads_wake_each_other_a_thousand_times
    a_waiting_reader_is_woken_by_retirement_and_by_a_new_writer
    a_waiter_may_have_more_words_than_one_call_takes
}

/// Long enough to tell a lost wake-up from a slow machine.
const LONG_NS: u64 = 60_000_000_000;

fn now_ns() -> u64 {
    let now = rustix::time::clock_gettime(rustix::time::ClockId::Monotonic);
    now.tv_sec as u64 * 1_000_000_000 + now.tv_nsec as u64
}

/// Both ways of waiting, as far as this kernel has them.
fn methods() -> Vec<Method> {
    let best = Waiter::new(&PrivateWord::new(), Vec::new()).unwrap().method();
    if best == Method::Helpers {
        println!("this kernel has no futex_waitv: only the fallback is tested");
        return vec![Method::Helpers];
    }
    vec![Method::Vector, Method::Helpers]
}

fn a_waiter_returns_for_what_changed_after_its_snapshot(ground: &Ground) {
    let mut writer = ground.writer(&geometry(4, 8));
    for method in methods() {
        let private = PrivateWord::new();
        let reader = ground.reader();
        let mut waiter = Waiter::with_method(&private, vec![reader.word()], method).unwrap();
        for _ in 0..100 {
            waiter.snapshot();
            publish(&mut writer);
            assert_eq!(waiter.wait(Some(now_ns() + LONG_NS)), Woken::Word(0), "{method:?}");
            waiter.snapshot();
            private.bump();
            assert_eq!(waiter.wait(Some(now_ns() + LONG_NS)), Woken::Private, "{method:?}");
        }
    }
}

fn a_waiter_says_which_of_its_words_changed(ground: &Ground) {
    let mut writers: Vec<RawWriter> = ["/a", "/b", "/c"]
        .iter()
        .map(|path| ground.tree.writer(path, &geometry(2, 0), Claim::Continue).unwrap())
        .collect();
    let words = || ["/a", "/b", "/c"].iter().map(|path| ground.tree.reader(path, None).unwrap().word()).collect();
    for method in methods() {
        let mut waiter = Waiter::with_method(&PrivateWord::new(), words(), method).unwrap();
        for index in [0, 1, 2, 2, 0, 1] {
            waiter.snapshot();
            writers[index].publish(1, &[], &[]);
            assert_eq!(waiter.wait(None), Woken::Word(index), "{method:?}");
        }
    }
}

fn a_waiter_times_out_at_its_time_and_not_before(ground: &Ground) {
    let mut writer = ground.writer(&geometry(4, 8));
    for method in methods() {
        publish(&mut writer);
        let mut waiter = Waiter::with_method(&PrivateWord::new(), vec![ground.reader().word()], method).unwrap();
        // A helper may still pass on what happened before.
        let mut timed_out = |until| {
            waiter.snapshot();
            while waiter.wait(Some(until)) == Woken::Spurious {
                waiter.snapshot();
            }
            assert_eq!(waiter.wait(Some(until)), Woken::Timeout, "{method:?}");
            assert!(now_ns() >= until);
        };
        timed_out(0);
        timed_out(now_ns());
        timed_out(now_ns() + 3_000_000);
    }
}

fn two_threads_wake_each_other_a_thousand_times(ground: &Ground) {
    let mut ping = ground.tree.writer("/ping", &geometry(2, 0), Claim::Continue).unwrap();
    let mut pong = ground.tree.writer("/pong", &geometry(2, 0), Claim::Continue).unwrap();
    for method in methods() {
        let (pings, pongs) = ["/ping", "/pong"].map(|path| ground.tree.reader(path, None).unwrap()).into();
        let (ping_begin, pong_begin) = (pings.head(), pongs.head());
        let await_head = |waiter: &mut Waiter, reader: &RawReader, head: u64| {
            while reader.head() < head {
                assert_ne!(waiter.wait(Some(now_ns() + LONG_NS)), Woken::Timeout, "a wake-up was lost ({method:?})");
                waiter.snapshot();
            }
        };
        std::thread::scope(|scope| {
            let (pong, pings) = (&mut pong, &pings);
            scope.spawn(move || {
                let mut waiter = Waiter::with_method(&PrivateWord::new(), vec![pings.word()], method).unwrap();
                for round in 1..=1000 {
                    await_head(&mut waiter, pings, ping_begin + round);
                    pong.publish(round, &[], &[]);
                }
            });
            let mut waiter = Waiter::with_method(&PrivateWord::new(), vec![pongs.word()], method).unwrap();
            for round in 1..=1000 {
                ping.publish(round, &[], &[]);
                await_head(&mut waiter, &pongs, pong_begin + round);
            }
        });
    }
}

fn a_waiting_reader_is_woken_by_retirement_and_by_a_new_writer(ground: &Ground) {
    for method in methods() {
        let writer = ground.writer(&geometry(4, 8));
        let reader = ground.reader();
        let mut waiter = Waiter::with_method(&PrivateWord::new(), vec![reader.word()], method).unwrap();
        drop(writer);
        waiter.snapshot();
        let writer = ground.writer(&geometry(4, 8));
        assert_eq!(waiter.wait(Some(now_ns() + LONG_NS)), Woken::Word(0), "{method:?}");
        waiter.snapshot();
        let fencing = ground.tree.writer(PATH, &geometry(4, 8), Claim::Fence).unwrap();
        assert_eq!(waiter.wait(Some(now_ns() + LONG_NS)), Woken::Word(0), "{method:?}");
        assert!(reader.retired());
        drop((writer, fencing));
    }
}

fn a_waiter_may_have_more_words_than_one_call_takes(ground: &Ground) {
    let mut writer = ground.writer(&geometry(4, 8));
    for count in [126, 127, 128, 200] {
        let reader = ground.reader();
        let words = (0..count).map(|_| reader.word()).collect();
        let mut waiter = Waiter::new(&PrivateWord::new(), words).unwrap();
        waiter.snapshot();
        publish(&mut writer);
        assert_eq!(waiter.wait(Some(now_ns() + LONG_NS)), Woken::Word(0), "{count}");
    }
}
