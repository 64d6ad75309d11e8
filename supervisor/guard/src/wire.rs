//! What is said on the guard's socket: one packet of a Unix seqpacket socket is one request or one answer.
//!
//! The socket is `.guard` in the robot's folder. A request is a line of words, then, after a line feed, what belongs to it:
//!
//! | request | who may | answer |
//! |---|---|---|
//! | `stop SOURCE⏎REASON` | anyone | `ok STATE` |
//! | `hold SOURCE⏎REASON` | the robot's user, root, nodes (whose group is that of this socket's file) | `ok STATE` |
//! | `lower SOURCE` | the same; a node that has a user of its own lowers only what that user has raised | `ok STATE` |
//! | `reset`, `resume` | the robot's user and root, but no confined process | `ok STATE`, or `no STATE⏎WHY` |
//! | `look` | anyone | `latch`, with a read-only descriptor of the latch's memory |
//! | `attach NODE` | the robot's user, root, nodes | none; the process is watched from now on |
//! | `will REPEAT SPACING_US ADDRESS⏎BYTES`, with the device's descriptor | who has attached | none |
//! | `drop ADDRESS` | the same | none: the device is closed in order |
//! | `claim ADDRESS` | the same, if the same user has left it | `kept`, with the descriptor that a predecessor left, or `none` |
//! | `stopped WORD` | the same | none: the driver has obeyed this word of the latch |
//!
//! In a shell: `printf 'stop me\nsmoke' | socat - UNIX-CONNECT:/dev/shm/sinew/pioneer/.guard,type=5`.

use std::os::fd::OwnedFd;

/// Longest packet [byte].
pub(crate) const PACKET_BYTES: usize = 1024;
/// Longest last will [byte].
pub(crate) const WILL_BYTES: usize = 256;
/// Longest device address [byte].
pub(crate) const ADDRESS_BYTES: usize = 128;
/// Longest name of a node [byte].
pub(crate) const NODE_BYTES: usize = 64;

/// What stops a device when its driver cannot.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Will {
    /// Written as a whole; it should stop the device whatever came before.
    pub bytes: &'static [u8],
    /// How often: more bytes in all than the longest packet that the driver may have left half-written.
    pub repeat: u32,
    /// Time between two [µs].
    pub spacing_us: u32,
}

/// The answer to `claim`.
#[derive(Debug)]
pub struct Kept(pub Option<OwnedFd>);

/// A request, taken apart.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Request<'a> {
    Stop { source: &'a [u8], reason: &'a [u8] },
    Hold { source: &'a [u8], reason: &'a [u8] },
    Lower { source: &'a [u8] },
    Reset,
    Resume,
    Look,
    Attach { node: &'a [u8] },
    Will { address: &'a [u8], repeat: u32, spacing_us: u32, bytes: &'a [u8] },
    Drop { address: &'a [u8] },
    Claim { address: &'a [u8] },
    Stopped { word: u32 },
}

/// Takes a packet apart; `None` for what is none of them.
pub(crate) fn parse(packet: &[u8]) -> Option<Request<'_>> {
    let line_end = packet.iter().position(|byte| *byte == b'\n').unwrap_or(packet.len());
    let (line, rest) = (&packet[..line_end], packet.get(line_end + 1..).unwrap_or_default());
    let (verb, argument) = split(line);
    let named = |most: usize| Some(argument).filter(|name| !name.is_empty() && name.len() <= most);
    Some(match verb {
        b"stop" => Request::Stop { source: named(PACKET_BYTES).unwrap_or(b"unnamed"), reason: rest },
        b"hold" => Request::Hold { source: named(NODE_BYTES)?, reason: rest },
        b"lower" => Request::Lower { source: named(NODE_BYTES)? },
        b"reset" if argument.is_empty() => Request::Reset,
        b"resume" if argument.is_empty() => Request::Resume,
        b"look" if argument.is_empty() => Request::Look,
        b"attach" => Request::Attach { node: named(NODE_BYTES)? },
        b"will" => {
            let (repeat, argument) = split(argument);
            let (spacing, address) = split(argument);
            if address.is_empty() || address.len() > ADDRESS_BYTES || rest.is_empty() || rest.len() > WILL_BYTES {
                return None;
            }
            let repeat = number(repeat)?.clamp(1, 1000);
            Request::Will { address, repeat, spacing_us: number(spacing)?.clamp(5_000, 1_000_000), bytes: rest }
        }
        b"drop" => Request::Drop { address: named(ADDRESS_BYTES)? },
        b"claim" => Request::Claim { address: named(ADDRESS_BYTES)? },
        b"stopped" => Request::Stopped { word: number(argument)? },
        _ => return None,
    })
}

fn split(line: &[u8]) -> (&[u8], &[u8]) {
    match line.iter().position(|byte| *byte == b' ') {
        Some(at) => (&line[..at], &line[at + 1..]),
        None => (line, &[]),
    }
}

fn number(digits: &[u8]) -> Option<u32> {
    std::str::from_utf8(digits).ok()?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn requests_are_taken_apart() {
        assert_eq!(
            parse(b"stop the operator\nsmoke\n!"),
            Some(Request::Stop { source: b"the operator", reason: b"smoke\n!" })
        );
        assert_eq!(parse(b"stop"), Some(Request::Stop { source: b"unnamed", reason: b"" }));
        assert_eq!(parse(b"reset"), Some(Request::Reset));
        assert_eq!(
            parse(b"will 4 5000 pty:/a b\n\xFA\xFB\n\x03"),
            Some(Request::Will { address: b"pty:/a b", repeat: 4, spacing_us: 5000, bytes: b"\xFA\xFB\n\x03" })
        );
        assert_eq!(parse(b"stopped 77"), Some(Request::Stopped { word: 77 }));
    }

    #[test]
    fn a_stop_is_never_refused_for_its_form_and_a_will_is() {
        let long = [b"stop ".to_vec(), vec![b'x'; 900]].concat();
        assert!(matches!(parse(&long), Some(Request::Stop { .. })));
        for packet in [&b"will 4 5000 a\n"[..], b"will x 5000 a\nb", b"will 4 5000 \nb", b"hold \nwhy", b"explode", b""]
        {
            assert_eq!(parse(packet), None, "{}", packet.escape_ascii());
        }
    }

    #[test]
    fn repetitions_are_at_least_five_milliseconds_apart() {
        let Some(Request::Will { spacing_us, repeat, .. }) = parse(b"will 0 1 a\nb") else { panic!("no will") };
        assert_eq!((spacing_us, repeat), (5_000, 1));
    }
}
