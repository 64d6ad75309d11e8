//! The slot algorithm under a model checker that tries every interleaving and every value that the memory model lets a
//! relaxed load return. With all six fences it holds; with any one of them deleted it must be seen to fail, or the
//! proof proves nothing.
//!
//! `RUSTFLAGS="--cfg loom" cargo test -p sinew-runtime --test channel_loom --release`
#![allow(clippy::unwrap_used, reason = "tests")]
#![cfg(loom)]

use loom::sync::Arc;
use loom::thread;

/// The very file that the runtime is built from, over the checker's atomics.
#[path = "../src/channel/ring.rs"]
#[allow(dead_code)]
mod ring;

mod atomic {
    pub use loom::sync::atomic::{AtomicU32, AtomicU64, Ordering, fence};
}

use atomic::{AtomicU32, AtomicU64, Ordering};
use ring::{DATA, Fences, Miss, Whole};

const WORDS: usize = 2;

/// Two slots of two words: a depth of one.
struct Ring {
    head: AtomicU64,
    wake: AtomicU32,
    slots: [Vec<AtomicU64>; 2],
}

impl Ring {
    fn new() -> Ring {
        let slot = || (0..DATA + WORDS).map(|_| AtomicU64::new(0)).collect();
        Ring { head: AtomicU64::new(0), wake: AtomicU32::new(0), slots: [slot(), slot()] }
    }

    fn slot(&self, sequence: u64) -> &[AtomicU64] {
        &self.slots[sequence as usize % 2]
    }

    /// Writes a sample whose words are all `value`, but does not show it.
    fn write<F: Fences>(&self, sequence: u64, value: u64) {
        ring::begin::<F>(self.slot(sequence), sequence);
        self.slot(sequence)[DATA..].iter().for_each(|word| word.store(value, Ordering::Relaxed));
        ring::commit(self.slot(sequence), sequence);
    }

    fn publish<F: Fences>(&self, sequence: u64) {
        self.write::<F>(sequence, sequence * 10);
        ring::show::<F>(&self.head, sequence);
    }

    /// The value of a sample, whose words must all have it.
    fn read<F: Fences>(&self, newest: u64, sequence: u64) -> Result<u64, Miss> {
        let words = ring::read::<F, _>(self.slot(sequence), newest, sequence, |slot| {
            let words: Vec<u64> = slot[DATA..].iter().map(|word| word.load(Ordering::Relaxed)).collect();
            words
        })?;
        assert!(words.iter().all(|&word| word == words[0]), "torn: {words:?}");
        Ok(words[0])
    }
}

/// A writer laps a reader of the older sample.
fn overwriting<F: Fences>() {
    loom::model(|| {
        let ring = Arc::new(Ring::new());
        ring.publish::<Whole>(1);
        ring.publish::<Whole>(2);
        let writer = thread::spawn({
            let ring = ring.clone();
            move || ring.publish::<F>(3)
        });
        match ring.read::<F>(2, 1) {
            Ok(value) => assert_eq!(value, 10, "torn: of another sample"),
            Err(miss) => assert_eq!(miss, Miss::Overrun),
        }
        writer.join().unwrap();
        assert_eq!(ring.read::<Whole>(3, 3), Ok(30));
    });
}

/// A reader reads whatever is the newest while two samples are published.
fn showing<F: Fences>() {
    loom::model(|| {
        let ring = Arc::new(Ring::new());
        let writer = thread::spawn({
            let ring = ring.clone();
            move || {
                ring.publish::<F>(1);
                ring.publish::<F>(2);
            }
        });
        let newest = ring::head::<F>(&ring.head);
        if newest > 0 {
            assert_eq!(ring.read::<F>(newest, newest), Ok(newest * 10), "shown and not there");
        }
        writer.join().unwrap();
    });
}

/// A reader takes a snapshot of the wake word, looks at the head, and would sleep.
fn waking<F: Fences>() {
    loom::model(|| {
        let ring = Arc::new(Ring::new());
        let writer = thread::spawn({
            let ring = ring.clone();
            move || {
                ring::show::<F>(&ring.head, 1);
                ring::bump::<F>(&ring.wake);
            }
        });
        let seen = ring::look::<F>(&ring.wake);
        let newest = ring::head::<F>(&ring.head);
        // With 0 in its hand it would not go to sleep, for the word is 1.
        assert!(seen == 0 || newest == 1, "asleep: it took the bump for an old one and missed the sample");
        writer.join().unwrap();
    });
}

/// A writer dies at some point of sample 2; its successor shows what was complete and goes on with `next`.
fn succeeding(complete: bool, next: u64) {
    loom::model(move || {
        let ring = Arc::new(Ring::new());
        ring.publish::<Whole>(1);
        let writers = thread::spawn({
            let ring = ring.clone();
            move || {
                ring::begin::<Whole>(ring.slot(2), 2);
                ring.slot(2)[DATA].store(20, Ordering::Relaxed);
                if complete {
                    ring.slot(2)[DATA + 1].store(20, Ordering::Relaxed);
                    ring::commit(ring.slot(2), 2);
                    ring::show::<Whole>(&ring.head, 2);
                }
                ring.write::<Whole>(next, next * 10 + 1);
                ring::show::<Whole>(&ring.head, next);
            }
        });
        let newest = ring::head::<Whole>(&ring.head);
        match ring.read::<Whole>(newest, 2) {
            Ok(value) => assert!(complete && value == 20, "torn: nobody finished sample 2 with {value}"),
            // A number that is used again is unfinished for a while, too; that is not the damage we are after.
            Err(Miss::Unfinished) => assert!(!complete || next == 2),
            Err(Miss::NotYet) => assert!(newest < 2),
            Err(Miss::Overrun) => panic!("nobody overwrites sample 2"),
        }
        writers.join().unwrap();
    });
}

/// Everything at once: a writer goes round the ring while a reader follows it. Too large to be tried whole, so only
/// with three switches of thread where none was needed.
fn following<F: Fences>() {
    let mut model = loom::model::Builder::new();
    model.preemption_bound = Some(3);
    model.check(|| {
        let ring = Arc::new(Ring::new());
        let writer = thread::spawn({
            let ring = ring.clone();
            move || (1..=3).for_each(|sequence| ring.publish::<F>(sequence))
        });
        let newest = ring::head::<F>(&ring.head);
        for sequence in newest.saturating_sub(1).max(1)..=newest {
            match ring.read::<F>(newest, sequence) {
                Ok(value) => assert_eq!(value, sequence * 10, "torn: of another sample"),
                Err(miss) => assert_eq!(miss, Miss::Overrun),
            }
        }
        writer.join().unwrap();
    });
}

macro_rules! without {
    ($name:ident, $fence:ident) => {
        struct $name;
        impl Fences for $name {
            fn $fence() {}
        }
    };
}

without!(NoAfterOdd, after_odd);
without!(NoBeforeHead, before_head);
without!(NoAfterHead, after_head);
without!(NoAfterCopy, after_copy);
without!(NoBeforeWake, before_wake);
without!(NoAfterWake, after_wake);

#[test]
fn a_sample_is_never_torn() {
    overwriting::<Whole>();
}

#[test]
fn a_sample_that_is_shown_is_there() {
    showing::<Whole>();
}

#[test]
fn a_reader_can_follow_its_writer() {
    following::<Whole>();
}

#[test]
fn a_wake_up_is_never_lost() {
    waking::<Whole>();
}

#[test]
fn a_successor_does_not_tear_what_its_predecessor_completed() {
    succeeding(true, 3);
}

#[test]
fn a_successor_leaves_what_its_predecessor_did_not_complete() {
    succeeding(false, 3);
}

#[test]
#[should_panic(expected = "torn")]
fn without_the_fence_after_the_odd_mark_a_sample_is_torn() {
    overwriting::<NoAfterOdd>();
}

#[test]
#[should_panic(expected = "torn")]
fn without_the_fence_after_the_copy_a_sample_is_torn() {
    overwriting::<NoAfterCopy>();
}

#[test]
#[should_panic(expected = "shown and not there")]
fn without_the_fence_before_the_head_a_sample_is_shown_too_early() {
    showing::<NoBeforeHead>();
}

#[test]
#[should_panic(expected = "shown and not there")]
fn without_the_fence_after_the_head_a_sample_is_looked_at_too_early() {
    showing::<NoAfterHead>();
}

#[test]
#[should_panic(expected = "asleep")]
fn without_the_fence_before_the_wake_word_a_wake_up_is_lost() {
    waking::<NoBeforeWake>();
}

#[test]
#[should_panic(expected = "asleep")]
fn without_the_fence_after_the_wake_word_a_wake_up_is_lost() {
    waking::<NoAfterWake>();
}

#[test]
#[should_panic(expected = "torn")]
fn a_successor_that_uses_a_number_again_tears_a_sample() {
    succeeding(true, 2);
}
