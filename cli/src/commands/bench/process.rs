//! What the kernel tells of a process: CPU time, wake-ups, memory by what it is for.

use std::fs::{read_dir, read_to_string};
use std::path::Path;

/// CPU time and wake-ups of all threads of a process since they began.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Activity {
    /// utime + stime, in the kernel's ticks of 10 ms.
    pub ticks: u64,
    /// Time on a core, as the scheduler counts it [ns].
    pub on_core_ns: u64,
    /// Times that a thread went to sleep by itself.
    pub voluntary_switches: u64,
    /// Times that a thread was made to wait.
    pub involuntary_switches: u64,
}

impl Activity {
    /// What process `pid` has done so far; `None` when it is gone.
    pub fn of(pid: u32) -> Option<Activity> {
        let mut sum = Activity::default();
        for thread in read_dir(format!("/proc/{pid}/task")).ok()?.flatten() {
            let read = |file: &str| read_to_string(thread.path().join(file)).unwrap_or_default();
            let (stat, status) = (read("stat"), read("status"));
            sum.ticks += number(after_name(&stat).nth(11)) + number(after_name(&stat).nth(12));
            sum.on_core_ns += number(read("schedstat").split(' ').next());
            sum.voluntary_switches += value(&status, "voluntary_ctxt_switches");
            sum.involuntary_switches += value(&status, "nonvoluntary_ctxt_switches");
        }
        Some(sum)
    }

    /// What was done since `earlier`.
    pub fn since(self, earlier: Activity) -> Activity {
        Activity {
            ticks: self.ticks - earlier.ticks,
            on_core_ns: self.on_core_ns - earlier.on_core_ns,
            voluntary_switches: self.voluntary_switches - earlier.voluntary_switches,
            involuntary_switches: self.involuntary_switches - earlier.involuntary_switches,
        }
    }
}

/// Time that the calling thread has spent on a core [ns]; 0 where the kernel does not count it.
pub fn own_thread_ns() -> u64 {
    number(read_to_string("/proc/thread-self/schedstat").unwrap_or_default().split(' ').next())
}

/// Resident memory of a process by what it is for [byte].
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Memory {
    /// Anonymous and written pages: heap, stacks, statics.
    pub private: u64,
    /// Clean pages of the program and its libraries, which all processes share.
    pub program: u64,
    /// Maps of the robot's channels.
    pub rings: u64,
    /// Of all these, locked.
    pub locked: u64,
}

impl Memory {
    /// Memory of process `pid`, whose channels are below `root`; `None` when it is gone.
    pub fn of(pid: u32, root: &Path) -> Option<Memory> {
        let text = read_to_string(format!("/proc/{pid}/smaps")).ok().filter(|text| !text.is_empty())?;
        Some(Memory::parse(&text, &root.display().to_string()))
    }

    /// Everything but the channels.
    pub fn without_rings(&self) -> u64 {
        self.private + self.program
    }

    fn parse(smaps: &str, root: &str) -> Memory {
        let mut sum = Memory::default();
        let mut in_ring = false;
        let mut resident = 0;
        for line in smaps.lines() {
            let Some((key, rest)) = line.split_once(' ') else { continue };
            if !key.ends_with(':') {
                // The line of a mapping: addresses, rights, offset, device, inode, file.
                in_ring = rest.splitn(5, ' ').nth(4).is_some_and(|file| file.contains(root));
                continue;
            }
            let bytes = number(rest.split_whitespace().next()) * 1024;
            match key {
                "Rss:" => resident = bytes,
                "Anonymous:" => {
                    sum.private += bytes;
                    *(if in_ring { &mut sum.rings } else { &mut sum.program }) += resident - bytes.min(resident);
                }
                "Locked:" => sum.locked += bytes,
                _ => {}
            }
        }
        sum
    }
}

/// Names of the threads of `pid` that run under SCHED_FIFO, and of those that do not.
pub fn threads(pid: u32) -> (Vec<String>, Vec<String>) {
    let (mut fifo, mut other) = (Vec::new(), Vec::new());
    for thread in read_dir(format!("/proc/{pid}/task")).into_iter().flatten().flatten() {
        let stat = read_to_string(thread.path().join("stat")).unwrap_or_default();
        let name = stat.split_once('(').and_then(|(_, rest)| rest.rsplit_once(')')).map_or("", |(name, _)| name);
        let policy = number(after_name(&stat).nth(38));
        (if policy == 1 { &mut fifo } else { &mut other }).push(name.to_owned());
    }
    (fifo, other)
}

/// The fields of a stat line behind the name, which may hold blanks itself; the first is the state.
fn after_name(stat: &str) -> impl Iterator<Item = &str> {
    stat.rsplit_once(')').map_or("", |(_, rest)| rest).split_whitespace()
}

fn number(text: Option<&str>) -> u64 {
    text.and_then(|text| text.trim().parse().ok()).unwrap_or(0)
}

fn value(status: &str, key: &str) -> u64 {
    number(status.lines().find_map(|line| line.strip_prefix(key)?.strip_prefix(':')))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn this_process_has_memory_threads_and_has_done_something() {
        let pid = std::process::id();
        let memory = Memory::of(pid, Path::new("/nowhere/at/all")).unwrap();
        assert!(memory.private > 0 && memory.program > 0 && memory.rings == 0, "{memory:?}");
        let (fifo, other) = threads(pid);
        assert!(!fifo.is_empty() || !other.is_empty());
        assert!(Activity::of(pid).is_some_and(|activity| activity.on_core_ns > 0));
        assert_eq!(Activity::of(u32::MAX), None);
    }

    #[test]
    fn maps_are_told_apart_by_their_files() {
        let smaps = "\
7f00-7f01 r--s 00000000 00:1a 42                         /dev/shm/sinew/x/a
Size:                  8 kB
Rss:                   8 kB
Anonymous:             0 kB
Locked:                8 kB
5500-5501 r-xp 00001000 08:01 77                         /usr/bin/sinew
Rss:                 100 kB
Anonymous:             4 kB
Locked:              100 kB
7fff-8000 rw-p 00000000 00:00 0 
Rss:                  12 kB
Anonymous:            12 kB
Locked:                0 kB
";
        let memory = Memory::parse(smaps, "/dev/shm/sinew/x");
        let wanted = Memory { private: 16 * 1024, program: 96 * 1024, rings: 8 * 1024, locked: 108 * 1024 };
        assert_eq!(memory, wanted);
    }
}
