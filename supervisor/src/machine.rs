//! What the machine and each process take, from /proc: read by a thread of its own without real-time priority, twice a
//! second. Who asks never waits for it: it takes the newest numbers that there are.

use std::fs;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};

use messages::Load;
use runtime::{Time, clock};

/// How often it looks [s].
const LOOK_S: f64 = 0.5;

/// Numbers of the last look.
#[derive(Debug, Clone)]
struct Seen {
    /// Whom to look at.
    pids: Vec<i32>,
    load: Load,
    /// Processors used and resident bytes, in the order of `pids`.
    processes: Vec<(f64, f64)>,
}

/// The thread, and the newest that it said.
pub(crate) struct Machine {
    shared: Arc<Mutex<Seen>>,
    stop: Arc<AtomicBool>,
    newest: Seen,
}

impl Machine {
    /// Begins to look.
    pub fn start() -> Machine {
        let seen = Seen {
            pids: Vec::new(),
            load: Load {
                processors: std::thread::available_parallelism().map_or(1.0, |count| count.get() as f64),
                busy_processors: f64::NAN,
                cpu_pressure: f64::NAN,
                memory_pressure: f64::NAN,
                available_bytes: f64::NAN,
            },
            processes: Vec::new(),
        };
        let shared = Arc::new(Mutex::new(seen.clone()));
        let stop: Arc<AtomicBool> = Arc::default();
        let (theirs, ended) = (shared.clone(), stop.clone());
        // A thread of a real-time thread begins without its priority.
        let thread = std::thread::Builder::new().name("load".into()).stack_size(64 << 10);
        if let Err(error) = thread.spawn(move || watch(&theirs, &ended)) {
            eprintln!("nobody looks at the machine's load: {error}");
        }
        for (path, what) in [("/proc/pressure/cpu", "cpu"), ("/proc/pressure/memory", "memory")] {
            if let Err(error) = fs::read_to_string(path) {
                eprintln!("{what} pressure is not told: {path}: {error}");
            }
        }
        Machine { shared, stop, newest: seen }
    }

    /// Says whom to look at from now on, and takes the newest numbers over.
    pub fn ask(&mut self, pids: impl Iterator<Item = i32>) {
        // Held by the other thread only while it copies; if it is, the next look will do.
        let Ok(mut shared) = self.shared.try_lock() else { return };
        self.newest.clone_from(&shared);
        shared.pids.clear();
        shared.pids.extend(pids);
    }

    /// The machine.
    pub fn load(&self) -> Load {
        self.newest.load
    }

    /// Processors that process number `index` used and its resident bytes; NaN where nobody knows.
    pub fn process(&self, index: usize) -> (f64, f64) {
        self.newest.processes.get(index).copied().unwrap_or((f64::NAN, f64::NAN))
    }
}

impl Drop for Machine {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
    }
}

fn watch(shared: &Mutex<Seen>, stop: &AtomicBool) {
    let ticks_per_s = rustix::param::clock_ticks_per_second() as f64;
    let page_bytes = rustix::param::page_size() as f64;
    let mut machine: Option<(Time, u64)> = None;
    let mut before: Vec<(i32, u64)> = Vec::new();
    while !stop.load(Ordering::Relaxed) {
        let (pids, mut load) = match shared.lock() {
            Ok(shared) => (shared.pids.clone(), shared.load),
            Err(_) => return,
        };
        let now = clock::now();
        let busy = busy_ticks();
        let spent_s = machine.map_or(f64::NAN, |(then, _)| now.since(then));
        let rate = |now: u64, then: u64| now.saturating_sub(then) as f64 / ticks_per_s / spent_s;
        load.busy_processors = machine.zip(busy).map_or(f64::NAN, |((_, then), busy)| rate(busy, then));
        machine = busy.map(|busy| (now, busy));
        load.cpu_pressure = pressure("/proc/pressure/cpu").unwrap_or(f64::NAN);
        load.memory_pressure = pressure("/proc/pressure/memory").unwrap_or(f64::NAN);
        load.available_bytes = available_bytes().unwrap_or(f64::NAN);
        let ticks: Vec<(i32, u64)> = pids.iter().map(|&pid| (pid, process_ticks(pid).unwrap_or(0))).collect();
        let mut processes: Vec<(f64, f64)> = Vec::with_capacity(pids.len());
        for (index, &(pid, now)) in ticks.iter().enumerate() {
            let then = before.iter().find(|(other, _)| *other == pid).map(|(_, ticks)| *ticks);
            // Several nodes of one process: its time is told once.
            let first = pids.iter().position(|other| *other == pid) == Some(index);
            let used = if first { then.map_or(f64::NAN, |then| rate(now, then)) } else { 0.0 };
            let resident = resident_pages(pid).map_or(f64::NAN, |pages| pages as f64 * page_bytes);
            processes.push((used, resident));
        }
        before = ticks;
        if let Ok(mut shared) = shared.lock() {
            (shared.load, shared.processes) = (load, processes);
        }
        clock::sleep_s(LOOK_S);
    }
}

/// Time of all processors that was not idle [ticks].
fn busy_ticks() -> Option<u64> {
    parse_busy(&fs::read_to_string("/proc/stat").ok()?)
}

/// User, nice and system, interrupts and what a host took; not idle and not waiting for a disk (proc_stat(5)).
fn parse_busy(text: &str) -> Option<u64> {
    let line = text.lines().next()?.strip_prefix("cpu ")?;
    let fields: Vec<u64> = line.split_ascii_whitespace().map_while(|word| word.parse().ok()).collect();
    Some(fields.iter().take(8).enumerate().filter(|(index, _)| !matches!(index, 3 | 4)).map(|(_, ticks)| ticks).sum())
}

/// The share of the last ten seconds in which some task was held up, 0…1.
fn pressure(path: &str) -> Option<f64> {
    parse_pressure(&fs::read_to_string(path).ok()?)
}

fn parse_pressure(text: &str) -> Option<f64> {
    let some = text.lines().find(|line| line.starts_with("some "))?;
    let percent = some.split_ascii_whitespace().find_map(|word| word.strip_prefix("avg10="))?;
    percent.parse::<f64>().ok().map(|percent| percent / 100.0)
}

fn available_bytes() -> Option<f64> {
    let text = fs::read_to_string("/proc/meminfo").ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix("MemAvailable:"))?;
    line.split_ascii_whitespace().next()?.parse::<f64>().ok().map(|kib| kib * 1024.0)
}

/// Time of all threads of a process [ticks].
fn process_ticks(pid: i32) -> Option<u64> {
    let stat = fs::read(format!("/proc/{pid}/stat")).ok()?;
    let after_name = stat.iter().rposition(|&byte| byte == b')')? + 1;
    let fields = std::str::from_utf8(&stat[after_name..]).ok()?;
    // The state is field 3; user and system time are fields 14 and 15 (proc_pid_stat(5)).
    let mut times = fields.split_ascii_whitespace().skip(14 - 3).map_while(|word| word.parse::<u64>().ok());
    Some(times.next()? + times.next()?)
}

fn resident_pages(pid: i32) -> Option<u64> {
    let text = fs::read_to_string(format!("/proc/{pid}/statm")).ok()?;
    text.split_ascii_whitespace().nth(1)?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_waits_is_not_busy() {
        assert_eq!(parse_busy("cpu  10 1 5 1000 300 2 3 4 7 0\ncpu0 1 2 3\n"), Some(25));
        assert_eq!(parse_busy("intr 1"), None);
    }

    #[test]
    fn pressure_is_a_share_and_absent_where_the_kernel_does_not_tell() {
        let text =
            "some avg10=12.50 avg60=3.00 avg300=1.00 total=123\nfull avg10=0.00 avg60=0.00 avg300=0.00 total=0\n";
        assert_eq!(parse_pressure(text), Some(0.125));
        assert_eq!(parse_pressure(""), None);
    }

    #[test]
    fn this_process_has_computed_and_has_memory() {
        let own = std::process::id() as i32;
        assert!(process_ticks(own).is_some() && resident_pages(own).is_some_and(|pages| pages > 0));
        assert_eq!(process_ticks(0), None);
    }
}
