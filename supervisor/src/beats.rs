//! Hangs by heartbeat, told apart from starvation.
//!
//! A node counts in its line of the table at every step and every idle wake. A line that stands still for a third of its
//! limit has missed a beat. What has not run because it got no processor is *starved*, not hung: its run delay grew
//! (schedstat), or it is ready to run and does not get to, or the whole machine stood still, which the witnesses and the
//! checker's own lateness tell. A stopped process is hung whatever the machine does.

use std::fs;

use guard::{Line, Phase, Table};
use runtime::Time;

use crate::event::Event;
use crate::witness::Witnesses;

/// Beats per limit: a node is hung when it has missed so many.
pub const BEATS_PER_LIMIT: u32 = 3;
/// A share of the silence from which on something else than the node explains it.
const EXPLAINS: f64 = 0.4;

/// All lines of a run.
pub(crate) struct BeatWatch {
    watched: Vec<Watched>,
    looked: Option<Time>,
}

struct Watched {
    node: usize,
    line: Line,
    beats: u64,
    /// When the beats were last seen to change, put off by what the checker itself was late.
    since: Time,
    /// The thread's account at the first miss.
    before: Option<(Account, Time)>,
    told: u32,
}

/// What the kernel says of a thread.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Account {
    /// Time on a processor [ns].
    pub ran_ns: u64,
    /// Time ready to run and waiting for a processor [ns].
    pub waited_ns: u64,
    /// `R`, `S`, `D`, `T` and so on.
    pub state: u8,
}

impl BeatWatch {
    /// Watches the lines of the nodes: `lines[node]` of them each, in the order of the table.
    pub fn new(table: &Table, lines: &[usize], now: Time) -> BeatWatch {
        let mut watched = Vec::new();
        let mut next = 0;
        for (node, &count) in lines.iter().enumerate() {
            for _ in 0..count {
                if let Some(line) = table.line(next) {
                    watched.push(Watched { node, line, beats: line.beats(), since: now, before: None, told: 0 });
                }
                next += 1;
            }
        }
        BeatWatch { watched, looked: None }
    }

    /// Lines that are watched.
    pub fn lines(&self) -> usize {
        self.watched.len()
    }

    /// Watches the next line, of a node that was not there before.
    pub fn add(&mut self, table: &Table, node: usize, now: Time) {
        if let Some(line) = table.line(self.watched.len()) {
            self.watched.push(Watched { node, line, beats: line.beats(), since: now, before: None, told: 0 });
        }
    }

    /// Counts the node as having beaten just now.
    pub fn heal(&mut self, node: usize, now: Time) {
        for watched in self.watched.iter_mut().filter(|watched| watched.node == node) {
            (watched.since, watched.before, watched.told) = (now, None, 0);
        }
    }

    /// Looks at all lines at `now`, which was meant to be `meant_s` after the last look. `process` tells a node's
    /// process, if it has one.
    pub fn look(
        &mut self,
        now: Time,
        meant_s: f64,
        witnesses: &Witnesses,
        process: impl Fn(usize) -> Option<i32>,
        events: &mut Vec<Event>,
    ) {
        let late_s = self.looked.map_or(0.0, |last| (now.since(last) - meant_s).max(0.0));
        self.looked = Some(now);
        for watched in &mut self.watched {
            let (pid, tid) = watched.line.writer();
            let alive = process(watched.node).is_some_and(|process| process as u32 == pid);
            let beating = !matches!(watched.line.phase(), Phase::Absent | Phase::Ended);
            let beats = watched.line.beats();
            if !alive || !beating || beats != watched.beats {
                if watched.told > 0 && alive && beating {
                    events.push(Event::Beat { node: watched.node });
                }
                (watched.beats, watched.since, watched.before, watched.told) = (beats, now, None, 0);
                continue;
            }
            // A checker that slept longer than it wanted would blame the node for it.
            watched.since = watched.since.after_s(late_s).min(now);
            let interval_s = watched.line.limit_ns() as f64 * 1e-9 / f64::from(BEATS_PER_LIMIT);
            let missed = (now.since(watched.since) / interval_s.max(1e-3)) as u32;
            if missed <= watched.told {
                continue;
            }
            watched.told = missed;
            let account = account(pid, tid);
            if watched.before.is_none() {
                watched.before = account.map(|account| (account, now));
            }
            let starved = watched.before.is_some_and(|(before, since)| {
                let stalled_s = witnesses.stalled_s(since, now);
                missed > 1 && is_starved(before, account, now.since(since), stalled_s, watched.line.limit_ns())
            });
            events.push(Event::Missed { node: watched.node, beats: missed, starved });
        }
    }
}

/// Whether something else than the thread itself explains that it did nothing for `window_s`.
pub(crate) fn is_starved(before: Account, now: Option<Account>, window_s: f64, stalled_s: f64, limit_ns: u64) -> bool {
    let Some(now) = now else { return false };
    // A stopped process waits for nobody; and one that has computed for all of its limit is a runaway, however little of
    // the processors it got.
    if matches!(now.state, b'T' | b't') || now.ran_ns.saturating_sub(before.ran_ns) >= limit_ns {
        return false;
    }
    let share = |ns: u64| ns as f64 * 1e-9 / window_s.max(1e-6);
    let ran = share(now.ran_ns.saturating_sub(before.ran_ns));
    let waited = share(now.waited_ns.saturating_sub(before.waited_ns));
    waited >= EXPLAINS || (now.state == b'R' && ran < EXPLAINS) || stalled_s / window_s.max(1e-6) >= EXPLAINS
}

/// The kernel's account of thread `tid` of process `pid`.
pub(crate) fn account(pid: u32, tid: u32) -> Option<Account> {
    let folder = format!("/proc/{pid}/task/{tid}");
    let text = fs::read_to_string(format!("{folder}/schedstat")).ok()?;
    let mut numbers = text.split_ascii_whitespace().map(|word| word.parse::<u64>());
    let (ran_ns, waited_ns) = (numbers.next()?.ok()?, numbers.next()?.ok()?);
    let stat = fs::read(format!("{folder}/stat")).ok()?;
    let state = *stat.get(stat.iter().rposition(|&byte| byte == b')')? + 2)?;
    Some(Account { ran_ns, waited_ns, state })
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    fn account_of(ran_ms: u64, waited_ms: u64, state: u8) -> Account {
        Account { ran_ns: ran_ms * MS, waited_ns: waited_ms * MS, state }
    }

    fn judged(now: Account, stalled_s: f64) -> bool {
        is_starved(account_of(100, 100, b'S'), Some(now), 0.1, stalled_s, 100 * MS)
    }

    #[test]
    fn a_thread_that_waits_for_a_processor_is_starved_and_one_that_spins_or_sleeps_is_hung() {
        assert!(judged(account_of(101, 160, b'R'), 0.0), "got no processor for most of the time");
        assert!(judged(account_of(101, 101, b'R'), 0.0), "is ready and has not run: the wait is not yet accounted");
        assert!(!judged(account_of(195, 102, b'R'), 0.0), "spins");
        assert!(!judged(account_of(100, 100, b'S'), 0.0), "waits for something that does not come");
        assert!(!judged(account_of(100, 100, b'D'), 0.0), "hangs in the kernel");
    }

    #[test]
    fn a_runaway_on_a_busy_machine_is_hung_once_it_has_computed_for_its_whole_limit() {
        let after = |ran_ms: u64, waited_ms: u64| {
            let now = Some(account_of(100 + ran_ms, 100 + waited_ms, b'R'));
            is_starved(account_of(100, 100, b'R'), now, 1.0, 0.0, 100 * MS)
        };
        assert!(after(90, 910));
        assert!(!after(110, 890));
    }

    #[test]
    fn a_machine_that_stood_still_explains_a_sleeper_but_not_a_stopped_process() {
        assert!(judged(account_of(100, 100, b'S'), 0.08));
        assert!(!judged(account_of(100, 100, b'T'), 0.08));
        assert!(!is_starved(account_of(0, 0, b'S'), None, 0.1, 0.1, 100 * MS), "a thread that is gone");
    }

    #[test]
    fn the_kernels_account_of_this_thread_is_found() {
        let own = account(std::process::id(), rustix::thread::gettid().as_raw_nonzero().get() as u32).unwrap();
        assert_eq!(own.state, b'R');
    }

    /// A table with one node of 84 ms, watched every 10 ms of virtual time.
    struct Watching(BeatWatch, Line, Time, Witnesses);

    impl Watching {
        fn new() -> Watching {
            let line = Line::local();
            line.begin(7, 7, 84 * MS);
            line.beat(0, Phase::Waiting);
            let start = Time::from_seconds(100.0);
            let watched = Watched { node: 0, line, beats: line.beats(), since: start, before: None, told: 0 };
            Watching(BeatWatch { watched: vec![watched], looked: Some(start) }, line, start, Witnesses::none())
        }

        fn after_ms(&mut self, ms: u64) -> Vec<Event> {
            self.2 = self.2.after_ns(ms * MS);
            let mut events = Vec::new();
            self.0.look(self.2, 0.01, &self.3, |_| Some(7), &mut events);
            events
        }
    }

    #[test]
    fn three_missed_beats_are_told_one_by_one_and_then_the_beat_that_comes() {
        let mut watching = Watching::new();
        let mut told = Vec::new();
        for _ in 0..10 {
            told.extend(watching.after_ms(10));
        }
        let missed = |beats| Event::Missed { node: 0, beats, starved: false };
        assert_eq!(told, [missed(1), missed(2), missed(3)]);
        watching.1.beat(1, Phase::Waiting);
        assert_eq!(watching.after_ms(10), [Event::Beat { node: 0 }]);
        assert_eq!(watching.after_ms(10), []);
    }

    #[test]
    fn a_checker_that_was_late_itself_blames_nobody() {
        let mut watching = Watching::new();
        assert_eq!(watching.after_ms(500), []);
        assert_eq!(watching.after_ms(10), []);
        assert_eq!(watching.after_ms(10), [Event::Missed { node: 0, beats: 1, starved: false }]);
    }

    #[test]
    fn neither_a_node_that_has_not_begun_nor_one_that_has_ended_is_watched() {
        let mut watching = Watching::new();
        watching.1.beat(0, Phase::Ended);
        for _ in 0..50 {
            assert_eq!(watching.after_ms(10), []);
        }
        watching.1.begin(8, 8, 84 * MS);
        watching.1.beat(0, Phase::Waiting);
        for _ in 0..50 {
            assert_eq!(watching.after_ms(10), [], "another process writes the line");
        }
    }
}
