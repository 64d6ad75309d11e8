//! The supervisor's state in a sealed memfd: two slots, written in turn, each with number, length and checksum.
//!
//! A supervisor that is killed while it writes leaves one slot torn; the other still holds the state before. A slot whose
//! checksum does not fit is refused and named.

use std::fmt;
use std::io;
use std::os::fd::{AsFd, OwnedFd};

use crate::memory::make_memfd;

/// Most bytes of a state.
pub const MOST_BYTES: usize = 60 << 10;
const HEAD_BYTES: usize = 32;
const SLOT_BYTES: usize = MOST_BYTES + HEAD_BYTES;
const MAGIC: u64 = u64::from_le_bytes(*b"sinewst1");

/// The memfd and which slot is next.
#[derive(Debug)]
pub struct StateFile {
    memfd: OwnedFd,
    sequence: u64,
}

/// What a dead supervisor has left.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Loaded {
    /// Its newest whole state; `None`: nothing was ever written.
    pub bytes: Option<Vec<u8>>,
    /// A slot that was refused, in words for the record.
    pub refused: Option<String>,
}

/// Why no state can be had.
#[derive(Debug)]
pub enum StateError {
    /// Both slots are damaged.
    Damaged(String),
    /// The state does not fit.
    TooLong(usize),
    /// The system refused.
    Io(io::Error),
}

impl fmt::Display for StateError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            StateError::Damaged(why) => {
                write!(
                    f,
                    "the supervisor's state is damaged: {why}; the running nodes are found by their environment instead"
                )
            }
            StateError::TooLong(bytes) => write!(f, "a state of {bytes} bytes does not fit into {MOST_BYTES}"),
            StateError::Io(error) => write!(f, "the supervisor's state cannot be read or written: {error}"),
        }
    }
}

impl std::error::Error for StateError {}

impl From<rustix::io::Errno> for StateError {
    fn from(error: rustix::io::Errno) -> StateError {
        StateError::Io(error.into())
    }
}

#[derive(Debug, Clone, Copy)]
enum Slot {
    Empty,
    Whole { sequence: u64 },
    Torn { sequence: u64, found: u32, told: u32 },
}

impl StateFile {
    /// A new, empty one.
    pub fn make() -> io::Result<OwnedFd> {
        make_memfd("sinew-state", 2 * SLOT_BYTES)
    }

    /// Opens what [`make`](StateFile::make) made, and reads what it holds.
    pub fn open(memfd: OwnedFd) -> Result<(StateFile, Loaded), StateError> {
        let mut file = StateFile { memfd, sequence: 0 };
        let mut best: Option<(u64, Vec<u8>)> = None;
        let mut refused = Vec::new();
        for index in 0..2 {
            let (slot, bytes) = file.look(index)?;
            match slot {
                Slot::Empty => {}
                Slot::Torn { sequence, found, told } => {
                    file.sequence = file.sequence.max(sequence);
                    refused.push(format!("slot {index} (state {sequence}): checksum {found:08x}, {told:08x} expected"));
                }
                Slot::Whole { sequence } => {
                    file.sequence = file.sequence.max(sequence);
                    if best.as_ref().is_none_or(|(newest, _)| *newest < sequence) {
                        best = Some((sequence, bytes));
                    }
                }
            }
        }
        match (best, refused.is_empty()) {
            (None, false) => Err(StateError::Damaged(refused.join("; "))),
            (best, true) => Ok((file, Loaded { bytes: best.map(|(_, bytes)| bytes), refused: None })),
            (Some((sequence, bytes)), false) => {
                let refused = format!("{} refused; state {sequence} of the other slot is used", refused.join("; "));
                Ok((file, Loaded { bytes: Some(bytes), refused: Some(refused) }))
            }
        }
    }

    /// The same memfd with nothing believed of what it holds.
    pub fn afresh(memfd: OwnedFd) -> Result<StateFile, StateError> {
        rustix::io::pwrite(&memfd, &vec![0; 2 * SLOT_BYTES], 0)?;
        Ok(StateFile { memfd, sequence: 0 })
    }

    /// Writes a state into the older slot.
    pub fn store(&mut self, bytes: &[u8]) -> Result<(), StateError> {
        if bytes.len() > MOST_BYTES {
            return Err(StateError::TooLong(bytes.len()));
        }
        let sequence = self.sequence + 1;
        let at = (sequence % 2) * SLOT_BYTES as u64;
        let mut head = [0; HEAD_BYTES];
        head[..8].copy_from_slice(&MAGIC.to_le_bytes());
        head[8..16].copy_from_slice(&sequence.to_le_bytes());
        head[16..24].copy_from_slice(&(bytes.len() as u64).to_le_bytes());
        head[24..28].copy_from_slice(&checksum(sequence, bytes).to_le_bytes());
        // In two writes: killed between them, the checksum does not fit, and the other slot is used.
        rustix::io::pwrite(&self.memfd, &head, at)?;
        rustix::io::pwrite(&self.memfd, bytes, at + HEAD_BYTES as u64)?;
        self.sequence = sequence;
        Ok(())
    }

    fn look(&self, index: usize) -> Result<(Slot, Vec<u8>), StateError> {
        let mut slot = vec![0; SLOT_BYTES];
        let read = rustix::io::pread(self.memfd.as_fd(), &mut slot[..], (index * SLOT_BYTES) as u64)?;
        slot.truncate(read);
        let word = |at: usize| slot.get(at..at + 8).map_or(0, |b| u64::from_le_bytes(b.try_into().unwrap_or_default()));
        let (magic, sequence, length) = (word(0), word(8), word(16) as usize);
        if magic == 0 && sequence == 0 {
            return Ok((Slot::Empty, Vec::new()));
        }
        let told = word(24) as u32;
        let bytes = slot.get(HEAD_BYTES..HEAD_BYTES.saturating_add(length)).unwrap_or_default().to_vec();
        let found = checksum(sequence, &bytes);
        match magic == MAGIC && bytes.len() == length && found == told {
            true => Ok((Slot::Whole { sequence }, bytes)),
            false => Ok((Slot::Torn { sequence, found, told }, Vec::new())),
        }
    }
}

/// CRC-32 (IEEE 802.3, reflected) of the state's number and bytes.
fn checksum(sequence: u64, bytes: &[u8]) -> u32 {
    !sequence.to_le_bytes().iter().chain(bytes).fold(!0_u32, |crc, byte| {
        (0..8).fold(crc ^ u32::from(*byte), |crc, _| (crc >> 1) ^ (0xEDB8_8320 & (crc & 1).wrapping_neg()))
    })
}

/// CRC-32 of bytes alone, for what else is kept.
pub(crate) fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0_u32, |crc, byte| {
        (0..8).fold(crc ^ u32::from(*byte), |crc, _| (crc >> 1) ^ (0xEDB8_8320 & (crc & 1).wrapping_neg()))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn clone(memfd: &OwnedFd) -> OwnedFd {
        memfd.try_clone().unwrap()
    }

    #[test]
    fn the_checksum_is_the_one_of_ieee_802_3() {
        assert_eq!(crc32(b"123456789"), 0xCBF4_3926);
    }

    #[test]
    fn a_successor_finds_the_newest_state() {
        let memfd = StateFile::make().unwrap();
        let (mut file, empty) = StateFile::open(clone(&memfd)).unwrap();
        assert_eq!(empty, Loaded { bytes: None, refused: None });
        for state in [&b"one"[..], b"two", b"three"] {
            file.store(state).unwrap();
        }
        let (mut file, loaded) = StateFile::open(clone(&memfd)).unwrap();
        assert_eq!(loaded, Loaded { bytes: Some(b"three".to_vec()), refused: None });
        file.store(b"four").unwrap();
        assert_eq!(StateFile::open(memfd).unwrap().1.bytes.unwrap(), b"four");
    }

    #[test]
    fn every_flipped_byte_of_the_newest_slot_is_refused_and_the_older_state_used() {
        let memfd = StateFile::make().unwrap();
        let (mut file, _) = StateFile::open(clone(&memfd)).unwrap();
        file.store(b"older").unwrap();
        file.store(b"newer").unwrap();
        // Number 2 lies in slot 0. Its unused last head bytes carry nothing.
        for at in (0..28).chain(HEAD_BYTES..HEAD_BYTES + 5) {
            let mut byte = [0];
            rustix::io::pread(&memfd, &mut byte[..], at as u64).unwrap();
            rustix::io::pwrite(&memfd, &[byte[0] ^ 0x10], at as u64).unwrap();
            let (_, loaded) = StateFile::open(clone(&memfd)).unwrap();
            assert_eq!(loaded.bytes.as_deref(), Some(&b"older"[..]), "byte {at}");
            assert!(loaded.refused.unwrap().contains("checksum"), "byte {at}");
            rustix::io::pwrite(&memfd, &byte, at as u64).unwrap();
        }
    }

    #[test]
    fn two_damaged_slots_are_refused_by_name_and_can_be_begun_afresh() {
        let memfd = StateFile::make().unwrap();
        let (mut file, _) = StateFile::open(clone(&memfd)).unwrap();
        file.store(b"older").unwrap();
        file.store(b"newer").unwrap();
        for slot in [0, SLOT_BYTES] {
            rustix::io::pwrite(&memfd, b"?", (slot + HEAD_BYTES) as u64).unwrap();
        }
        let error = StateFile::open(clone(&memfd)).unwrap_err().to_string();
        assert!(error.contains("slot 0") && error.contains("slot 1") && error.contains("checksum"), "{error}");
        let mut file = StateFile::afresh(clone(&memfd)).unwrap();
        file.store(b"new").unwrap();
        assert_eq!(StateFile::open(memfd).unwrap().1.bytes.unwrap(), b"new");
    }

    #[test]
    fn a_state_that_does_not_fit_is_refused_and_the_last_one_stays() {
        let memfd = StateFile::make().unwrap();
        let (mut file, _) = StateFile::open(clone(&memfd)).unwrap();
        file.store(b"small").unwrap();
        assert!(matches!(file.store(&vec![1; MOST_BYTES + 1]), Err(StateError::TooLong(_))));
        assert_eq!(StateFile::open(memfd).unwrap().1.bytes.unwrap(), b"small");
    }

    #[test]
    fn nobody_can_cut_the_memory_off() {
        let memfd = StateFile::make().unwrap();
        assert!(rustix::fs::ftruncate(&memfd, 0).is_err());
    }
}
