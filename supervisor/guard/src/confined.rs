//! Whether a process is confined more than this one: a node that the robot file isolates is nobody's hand.
//!
//! A node without a user of its own has the robot's. The kernel still tells it from a person: a seccomp filter is
//! inherited by everything that the node starts, and it can never be taken off. Where guard and supervisor run under
//! filters themselves (in a container, say) those are counted on both sides.

use rustix::fs::{Mode, OFlags};

/// Whether process `pid` has more seccomp filters than this one. One that has gone counts as confined.
pub fn is_confined(pid: u32) -> bool {
    match (filters(pid), filters(std::process::id())) {
        (Some(theirs), Some(own)) => theirs > own,
        _ => true,
    }
}

/// Filters of process `pid`, without an allocation.
fn filters(pid: u32) -> Option<u32> {
    let mut path = *b"/proc/0000000000/status\0";
    let mut rest = pid;
    // Leading zeros would name another process: the digits go to the end of the field and the slashes are put before.
    for place in (6..16).rev() {
        path[place] = if rest > 0 { b'0' + (rest % 10) as u8 } else { b'/' };
        rest /= 10;
    }
    let path = std::ffi::CStr::from_bytes_with_nul(&path).ok()?;
    let file = rustix::fs::open(path, OFlags::RDONLY | OFlags::CLOEXEC, Mode::empty()).ok()?;
    let (mut text, mut length) = ([0; 4096], 0);
    while let Ok(count @ 1..) = rustix::io::read(&file, &mut text[length..]) {
        length += count;
    }
    count(&text[..length])
}

/// The count in the text of a status file; before Linux 5.9 it tells only whether there are any.
fn count(status: &[u8]) -> Option<u32> {
    let value = |name: &[u8]| {
        let line = status.split(|byte| *byte == b'\n').find_map(|line| line.strip_prefix(name))?;
        std::str::from_utf8(line).ok()?.trim().parse::<u32>().ok()
    };
    let any = value(b"Seccomp:").map_or(0, |mode| u32::from(mode != 0));
    (!status.is_empty()).then(|| value(b"Seccomp_filters:").unwrap_or(any))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn this_process_is_not_confined_more_than_itself_and_one_that_is_gone_counts_as_confined() {
        assert!(!is_confined(std::process::id()));
        assert!(is_confined(u32::MAX));
    }

    #[test]
    fn the_filters_of_a_status_file_are_counted() {
        assert_eq!(count(b"Name:\tx\nSeccomp:\t2\nSeccomp_filters:\t3\n"), Some(3));
        assert_eq!(count(b"Name:\tx\nSeccomp:\t2\n"), Some(1));
        assert_eq!(count(b"Name:\tx\n"), Some(0));
        assert_eq!(count(b""), None);
    }
}
