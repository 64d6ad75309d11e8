//! What /proc tells of processes: when one was started, and which belong to a run.
//!
//! A pid is recycled, a pid with its start time is not; and every process of a run carries the run's own name in its
//! environment (`SINEW_RUN`), whoever forked it.

use std::fs;
use std::os::fd::OwnedFd;

use runtime::{Time, clock};
use rustix::process::{Pid, PidfdFlags, pidfd_open};

/// Programs without an environment are looked at again for so long altogether, s, before that is believed.
const EXEC_PATIENCE_S: f64 = 1.0;
/// Time between two looks, s.
const EXEC_LOOK_S: f64 = 0.002;

/// Start of the process in clock ticks since boot; `None` if it is gone or only waits to be reaped.
pub fn start_ticks(pid: i32) -> Option<u64> {
    parse_start_ticks(&fs::read(format!("/proc/{pid}/stat")).ok()?)
}

/// The name in the second field may hold spaces and parentheses, so fields are counted from the last `)`.
fn parse_start_ticks(stat: &[u8]) -> Option<u64> {
    let after_name = stat.iter().rposition(|&byte| byte == b')')? + 1;
    let mut fields = std::str::from_utf8(&stat[after_name..]).ok()?.split_ascii_whitespace();
    if matches!(fields.next()?, "Z" | "X" | "x") {
        return None;
    }
    // The state is field 3, the start time field 22 (proc_pid_stat(5)).
    fields.nth(22 - 4)?.parse().ok()
}

/// A descriptor of the process that had this pid and start time; `None` if that one is gone.
pub fn open(pid: i32, ticks: u64) -> Option<OwnedFd> {
    let descriptor = pidfd_open(Pid::from_raw(pid)?, PidfdFlags::empty()).ok()?;
    // Looked at after the opening: from here on the descriptor cannot come to mean another process.
    (start_ticks(pid) == Some(ticks)).then_some(descriptor)
}

/// All living processes of the run, with descriptors; they are younger than its supervisor, which started at
/// `since_ticks`. Those of other users are seen by root alone.
pub fn processes_of(run: &str, since_ticks: u64) -> Vec<(i32, OwnedFd)> {
    let until = clock::now().after_s(EXEC_PATIENCE_S);
    let entries = fs::read_dir("/proc").into_iter().flatten().flatten();
    let own = std::process::id() as i32;
    let pids = entries.filter_map(|entry| entry.file_name().to_str()?.parse::<i32>().ok()).filter(|&pid| pid != own);
    let found = pids.filter_map(|pid| {
        // The descriptor first: what is learned afterwards is learned of the process that will be signalled.
        let descriptor = open(pid, start_ticks(pid).filter(|&ticks| ticks >= since_ticks)?)?;
        carries(pid, run, until).then_some((pid, descriptor))
    });
    found.collect()
}

/// Whether the process carries the name of the run in its environment.
fn carries(pid: i32, run: &str, until: Time) -> bool {
    loop {
        match fs::read(format!("/proc/{pid}/environ")) {
            Ok(environment) if !environment.is_empty() => return is_marked(&environment, run),
            // In the middle of exec the new program has no environment yet; kernel threads, which have no program
            // either, never get one.
            Ok(_) if fs::read_link(format!("/proc/{pid}/exe")).is_ok() && clock::now() < until => {
                clock::sleep_s(EXEC_LOOK_S);
            }
            _ => return false,
        }
    }
}

/// The value of a variable in the environment that the process was started with.
pub fn variable(pid: i32, name: &str) -> Option<String> {
    let environment = fs::read(format!("/proc/{pid}/environ")).ok()?;
    let value = |entry: &[u8]| {
        let rest = entry.strip_prefix(name.as_bytes())?.strip_prefix(b"=")?;
        Some(String::from_utf8_lossy(rest).into_owned())
    };
    environment.split(|&byte| byte == 0).find_map(value)
}

/// Whether the process leads its session.
pub fn is_session_leader(pid: i32) -> bool {
    let own = Pid::from_raw(pid);
    own.is_some_and(|own| rustix::process::getsid(Some(own)) == Ok(own))
}

fn is_marked(environment: &[u8], run: &str) -> bool {
    let entry = |bytes: &[u8]| bytes.strip_prefix(b"SINEW_RUN=") == Some(run.as_bytes());
    environment.split(|&byte| byte == 0).any(entry)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_start_time_is_found_behind_any_name() {
        let stat = b"7 (a) R (b) S 1 7 7 0 -1 4194560 1 2 3 4 5 6 7 8 20 0 1 0 4711 99 100";
        assert_eq!(parse_start_ticks(stat), Some(4711));
        assert_eq!(parse_start_ticks(b"7 (gone) Z 1 7 7 0 -1 4 1 2 3 4 5 6 7 8 20 0 1 0 4711 99"), None);
        assert_eq!(parse_start_ticks(b"7 (short) S 1"), None);
        assert_eq!(parse_start_ticks(b""), None);
    }

    #[test]
    fn a_pid_with_another_start_time_is_another_process() {
        let own = std::process::id() as i32;
        let ticks = start_ticks(own).unwrap();
        assert!(open(own, ticks).is_some());
        assert!(open(own, ticks + 1).is_none());
    }

    #[test]
    fn only_the_whole_name_of_a_run_marks_a_process() {
        assert!(is_marked(b"A=1\0SINEW_RUN=7-1\0B=2\0", "7-1"));
        assert!(!is_marked(b"A=1\0SINEW_RUN=7-12\0", "7-1"));
        assert!(!is_marked(b"XSINEW_RUN=7-1\0", "7-1"));
    }
}
