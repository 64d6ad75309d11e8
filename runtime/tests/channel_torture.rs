//! A thousand writers, each killed at a random moment; readers in this and in another process never see a torn sample,
//! never wait for the dead, and meet every new writer.
#![allow(clippy::unwrap_used, reason = "tests")]

use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use runtime::channel::{Claim, Geometry, PrivateWord, RawReader, ReadError, SampleBuffer, Tree, Waiter};

const KILLS: u64 = 1000;
const PATH: &str = "/drivers/camera/image";
const ACK: &str = "/supervisor/witness/ack";
const ROLE: &str = "SINEW_TORTURE_ROLE";
const ROOT: &str = "SINEW_TORTURE_ROOT";
/// Long enough to tell "never" from a slow machine.
const LONG_NS: u64 = 120_000_000_000;

const FIXED_WORDS: usize = 8;
const TAIL_WORDS: u64 = 1024;

fn geometry() -> Geometry {
    Geometry {
        type_name: "Torture".into(),
        layout_hash: 1,
        schema: String::new(),
        fixed_bytes: FIXED_WORDS * 8,
        tail_element_bytes: 8,
        tail_capacity: TAIL_WORDS as usize,
        depth: 8,
    }
}

fn ack_geometry() -> Geometry {
    Geometry {
        type_name: "Ack".into(),
        fixed_bytes: 16,
        tail_element_bytes: 0,
        tail_capacity: 0,
        depth: 2,
        ..geometry()
    }
}

/// Word `index` of sample `sequence`: no two samples agree in any word.
fn word(sequence: u64, index: u64) -> u64 {
    (sequence << 16 | index).wrapping_mul(0x9e37_79b9_7f4a_7c15)
}

fn tail_words(sequence: u64) -> u64 {
    (word(sequence, 0) >> 40) % (TAIL_WORDS + 1)
}

/// Fixed part: two words of the writer's, then the pattern.
fn fixed(sequence: u64, generation: u64, first: u64) -> [u64; FIXED_WORDS] {
    let mut words = std::array::from_fn(|index| word(sequence, index as u64));
    (words[0], words[1]) = (generation, first);
    words
}

/// What one reader has found out.
#[derive(Default)]
struct Witness {
    generation: u64,
    head: u64,
    /// First number of the newest writer that was met.
    first: u64,
    whole: u64,
    overrun: u64,
    holes: u64,
}

impl Witness {
    /// One bounded look at the newest and at an older sample.
    fn look(&mut self, reader: &RawReader, buffer: &mut SampleBuffer) {
        let head = reader.head();
        assert!(head >= self.head, "the head went back from {} to {head}", self.head);
        self.head = head;
        let generation = reader.generation();
        assert!(generation == self.generation || generation == self.generation + 1 || self.generation == 0);
        self.generation = generation;
        assert!(!reader.retired() && !reader.unlinked());
        if head == 0 {
            return;
        }
        let older = reader.oldest() + self.whole % 8;
        for sequence in [head, older.min(head)] {
            match reader.read(sequence, buffer) {
                Ok(sample) => {
                    assert_eq!((sample.sequence, sample.stamp_ns), (sequence, sequence * 10));
                    assert!(sample.generation <= reader.generation());
                    let words: &[[u8; 8]] = buffer.fixed().as_chunks().0;
                    let first = u64::from_le_bytes(words[1]);
                    let expected = fixed(sequence, sample.generation, first).map(u64::to_le_bytes);
                    assert_eq!(words, expected, "sample {sequence} is torn in its fixed part");
                    let tail: &[[u8; 8]] = buffer.tail().as_chunks().0;
                    assert_eq!(tail.len() as u64, tail_words(sequence), "sample {sequence} is torn in its length");
                    let good =
                        tail.iter().zip(0..).all(|(&bytes, index)| u64::from_le_bytes(bytes) == word(sequence, index));
                    assert!(good, "sample {sequence} is torn in its tail");
                    self.first = self.first.max(first);
                    self.whole += 1;
                }
                Err(ReadError::Overrun) => self.overrun += 1,
                Err(ReadError::Unfinished) if sequence != head => self.holes += 1,
                Err(error) => panic!("sample {sequence} of {head}: {error}"),
            }
        }
    }
}

fn tree() -> Tree {
    Tree::shared(Path::new(&std::env::var_os(ROOT).unwrap())).unwrap()
}

/// Runs one of the functions below in a process of its own.
fn start(role: &str, root: &Path) -> Child {
    Command::new(std::env::current_exe().unwrap())
        .args(["--exact", role, "--nocapture", "--test-threads=1"])
        .env(ROLE, role)
        .env(ROOT, root)
        .stdout(Stdio::null())
        .spawn()
        .unwrap()
}

fn has_role(role: &str) -> bool {
    std::env::var(ROLE).is_ok_and(|mine| mine == role)
}

fn parent() -> u32 {
    std::os::unix::process::parent_id()
}

/// In a process of its own: publishes until killed.
#[test]
fn writer_process() {
    if !has_role("writer_process") {
        return;
    }
    let parent_at_start = parent();
    let mut writer = tree().writer(PATH, &geometry(), Claim::Continue).unwrap();
    let (generation, first) = (writer.generation(), writer.next_sequence());
    // A test that was itself killed leaves no process behind.
    while !writer.next_sequence().is_multiple_of(1024) || parent() == parent_at_start {
        let n = writer.next_sequence();
        let fixed = fixed(n, generation, first).map(u64::to_le_bytes);
        let published = writer.publish_in_place(n * 10, fixed.as_flattened(), tail_words(n) as usize * 8, |tail| {
            (0..tail.len()).for_each(|index| {
                // Now and then preempted in the middle: on some machines death comes nearly always at such a moment.
                if index == 64 && n.is_multiple_of(4) {
                    std::thread::yield_now();
                }
                tail.set(index, word(n, index as u64));
            });
        });
        assert!(!published.lost && !published.cut);
    }
}

/// In a process of its own: reads, and tells on a channel of its own which writer it has met.
#[test]
fn reader_process() {
    if !has_role("reader_process") {
        return;
    }
    let parent_at_start = parent();
    let reader = tree().reader(PATH, None).unwrap();
    let mut ack = tree().writer(ACK, &ack_geometry(), Claim::Continue).unwrap();
    let mut buffer = SampleBuffer::new(reader.geometry());
    let mut waiter = Waiter::new(&PrivateWord::new(), vec![reader.word()]).unwrap();
    let mut witness = Witness::default();
    while parent() == parent_at_start {
        waiter.snapshot();
        let before = witness.generation;
        witness.look(&reader, &mut buffer);
        if witness.generation != before {
            let told = [witness.generation, witness.whole].map(u64::to_le_bytes);
            ack.publish(now_ns(), told.as_flattened(), &[]);
        }
        waiter.wait(Some(now_ns() + 1_000_000));
    }
}

#[test]
fn a_thousand_killed_writers_tear_nothing_and_hold_nobody_up() {
    let folder = tempfile::tempdir_in("/dev/shm").unwrap();
    let root = folder.path().join("robot");
    let tree = Tree::shared(&root).unwrap();
    tree.prepare(PATH, &geometry()).unwrap();
    tree.prepare(ACK, &ack_geometry()).unwrap();
    let mut far_reader = start("reader_process", &root);

    let done = AtomicBool::new(false);
    // Per reader in this process: rounds looked, newest writer met.
    let near: [[AtomicU64; 2]; 2] = Default::default();
    let words = [PrivateWord::new(), PrivateWord::new()];
    let mut interrupted = 0;
    let mut unborn = 0;
    std::thread::scope(|scope| {
        let finish = Finish(&done, &words);
        let threads: Vec<_> = (0..2)
            .map(|index| {
                let (tree, near, words, done) = (&tree, &near, &words, &done);
                scope.spawn(move || read_on(tree, index == 0, &near[index], &words[index], done))
            })
            .collect();

        let reader = tree.reader(PATH, None).unwrap();
        let acks = tree.reader(ACK, None).unwrap();
        let (mut mine, mut buffer) = (Witness::default(), SampleBuffer::new(reader.geometry()));
        let mut random = Random(0x5eed);
        for _ in 0..KILLS {
            let (head, generation) = (reader.head(), reader.generation());
            let mut writer = start("writer_process", &root);
            // One in eight dies at any moment from its birth on, the others at work.
            if random.below(8) == 0 {
                spin(random.below(4_000_000));
            } else {
                let enough = head + 1 + random.below(40);
                until("the writer publishes", || reader.head() > enough || writer.try_wait().unwrap().is_some());
                spin(random.below(100_000));
            }
            assert_eq!(writer.try_wait().unwrap(), None, "the writer ended by itself");
            writer.kill().unwrap();
            writer.wait().unwrap();

            // Whatever the writer was at, the readers read on.
            let rounds: Vec<u64> = near.iter().map(|[rounds, _]| rounds.load(Ordering::SeqCst)).collect();
            words.iter().for_each(PrivateWord::bump);
            until("a reader looks again", || {
                near.iter().zip(&rounds).all(|([now, _], before)| now.load(Ordering::SeqCst) > *before + 1)
            });
            mine.look(&reader, &mut buffer);
            if mine.generation == generation {
                unborn += 1;
                continue;
            }
            until("every reader meets the new writer", || {
                let far = acks.head() > 0 && {
                    let mut told = SampleBuffer::new(acks.geometry());
                    acks.read(acks.head(), &mut told).is_ok() && told.fixed()[..8] == mine.generation.to_le_bytes()
                };
                far && near.iter().all(|[_, met]| met.load(Ordering::SeqCst) == mine.generation)
            });
            if mine.first > head + 1 {
                interrupted += 1;
            }
        }
        let ended = far_reader.try_wait().unwrap();
        assert_eq!(ended, None, "the reader in the other process failed");
        drop(finish);
        for witness in threads.into_iter().map(|thread| thread.join().unwrap()) {
            println!("whole {} overrun {} holes {}", witness.whole, witness.overrun, witness.holes);
            assert!(witness.whole > KILLS);
        }
        println!("{} samples, {interrupted} deaths within a publication, {unborn} before the first", mine.head);
    });
    far_reader.kill().unwrap();
    far_reader.wait().unwrap();
    assert!(interrupted > 20, "only {interrupted} writers died within a publication: this has tested little");
    assert!(unborn < KILLS / 4);
    tree.clear().unwrap();
    assert!(!root.exists());
}

/// Lets the readers go, also when the test fails.
struct Finish<'a>(&'a AtomicBool, &'a [PrivateWord]);

impl Drop for Finish<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::SeqCst);
        self.1.iter().for_each(PrivateWord::bump);
    }
}

/// A reader in a thread: polling, or sleeping on the channel.
fn read_on(tree: &Tree, polls: bool, told: &[AtomicU64; 2], word: &PrivateWord, done: &AtomicBool) -> Witness {
    let reader = tree.reader(PATH, None).unwrap();
    let mut buffer = SampleBuffer::new(reader.geometry());
    let mut waiter = Waiter::new(word, vec![reader.word()]).unwrap();
    let mut witness = Witness::default();
    while !done.load(Ordering::SeqCst) {
        waiter.snapshot();
        // Twice, so that one whole look falls after any moment of which the parent asks.
        for _ in 0..2 {
            witness.look(&reader, &mut buffer);
            told[1].store(witness.generation, Ordering::SeqCst);
            told[0].fetch_add(1, Ordering::SeqCst);
        }
        if polls {
            std::thread::yield_now();
        } else {
            waiter.wait(None);
        }
    }
    witness
}

fn now_ns() -> u64 {
    let now = rustix::time::clock_gettime(rustix::time::ClockId::Monotonic);
    now.tv_sec as u64 * 1_000_000_000 + now.tv_nsec as u64
}

fn spin(ns: u64) {
    let end = now_ns() + ns;
    while now_ns() < end {
        std::thread::yield_now();
    }
}

fn until(what: &str, condition: impl FnMut() -> bool) {
    let mut condition = condition;
    let end = now_ns() + LONG_NS;
    while !condition() {
        assert!(now_ns() < end, "waited in vain: {what}");
        std::thread::yield_now();
    }
}

/// A small generator (splitmix64): the moments of death need no quality, only variety.
struct Random(u64);

impl Random {
    fn below(&mut self, limit: u64) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mixed = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        (mixed ^ (mixed >> 27)) % limit
    }
}
