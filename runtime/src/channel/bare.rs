//! A bare futex pair over a shared file: one word and one copy each way. No ring, no history, no marks, nothing that
//! survives a death. It carries no robot's data: it is the floor by which `sinew bench channel` judges channels.

use std::fs::File;
use std::io;
use std::path::Path;
use std::ptr;

use rustix::thread::futex::{Wait, WaitPtr};

use super::atomic::{AtomicU32, Ordering};
use super::futex::{self, Scope};
use super::memory::Memory;

/// Word indexes of the two futex words, far enough apart for no cache line to hold both.
const WAKE: [usize; 2] = [0, 16];
/// First word of the payloads.
const DATA: usize = 512;

/// One end of the pair. Whoever sends must wait for the answer before it sends again.
pub struct BarePair {
    memory: Memory,
    words: usize,
    /// 0 writes the first half and sleeps on the second, 1 the other way round.
    end: usize,
    sent: u32,
    received: u32,
    /// A second word to sleep on, that nobody bumps: what `futex_waitv` costs.
    idle: Option<Box<AtomicU32>>,
}

impl BarePair {
    /// Makes the file for payloads of `bytes` bytes.
    pub fn create(path: &Path, bytes: usize) -> io::Result<()> {
        let file = File::options().read(true).write(true).create_new(true).open(path)?;
        let length = (DATA + 2 * bytes.div_ceil(8)) * 8;
        rustix::fs::fallocate(&file, rustix::fs::FallocateFlags::empty(), 0, length as u64)?;
        Ok(())
    }

    /// Opens end 0 or 1. With `two_words` it sleeps on a second, idle word as well.
    pub fn open(path: &Path, bytes: usize, end: usize, two_words: bool) -> io::Result<BarePair> {
        let file = File::options().read(true).write(true).open(path)?;
        let words = bytes.div_ceil(8);
        let whole = DATA + 2 * words;
        if file.metadata()?.len() != whole as u64 * 8 || end > 1 {
            return Err(io::Error::other("not the file of a bare pair of this size, or no such end"));
        }
        let memory = Memory::map(&file, whole, true, true)?;
        Ok(BarePair { memory, words, end, sent: 0, received: 0, idle: two_words.then(Box::default) })
    }

    /// Copies `payload` in and wakes the other end.
    pub fn send(&mut self, payload: &[u8]) {
        let length = payload.len().min(self.words * 8);
        // SAFETY: the half of this end lies within the map and holds `length` bytes; the other end reads it only
        // between the word's release store below and its own answer, for which the caller has waited.
        unsafe { ptr::copy_nonoverlapping(payload.as_ptr(), self.half(self.end), length) };
        self.sent = self.sent.wrapping_add(1);
        let word = self.word(self.end);
        word.store(self.sent, Ordering::Release);
        futex::wake_all(word, Scope::Shared);
    }

    /// Sleeps until the other end has sent, and copies its payload out.
    pub fn receive(&mut self, payload: &mut [u8]) {
        let word = self.word(1 - self.end);
        loop {
            let value = word.load(Ordering::Acquire);
            if value != self.received {
                self.received = value;
                break;
            }
            let _ = match &self.idle {
                None => futex::wait(word, Scope::Shared, value, None),
                Some(idle) => futex::wait_any(
                    &[entry(&raw const **idle, Scope::Process, 0), entry(word, Scope::Shared, value)],
                    None,
                ),
            };
        }
        let length = payload.len().min(self.words * 8);
        // SAFETY: as in `send`; the acquire load above saw the other end's store, and it waits for our answer.
        unsafe { ptr::copy_nonoverlapping(self.half(1 - self.end), payload.as_mut_ptr(), length) };
    }

    fn half(&self, end: usize) -> *mut u8 {
        let first: *const u64 = self.memory.words()[DATA + end * self.words..].as_ptr().cast();
        first.cast_mut().cast()
    }

    fn word(&self, end: usize) -> &AtomicU32 {
        // SAFETY: in bounds, aligned to 8, lives as long as the map, and is never accessed as 8 bytes.
        unsafe { &*(&raw const self.memory.words()[WAKE[end]]).cast() }
    }
}

fn entry(word: *const AtomicU32, scope: Scope, value: u32) -> Wait {
    let mut entry = Wait::new();
    entry.uaddr = WaitPtr::new(word.cast_mut().cast());
    entry.flags = scope.wait_flags();
    entry.val = u64::from(value);
    entry
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_one_end_sends_comes_out_at_the_other() {
        for two_words in [false, true] {
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join("pair");
            BarePair::create(&path, 20).unwrap();
            let mut one = BarePair::open(&path, 20, 0, two_words).unwrap();
            let echo = std::thread::spawn({
                let mut other = BarePair::open(&path, 20, 1, two_words).unwrap();
                move || {
                    for _ in 0..100 {
                        let mut payload = [0; 20];
                        other.receive(&mut payload);
                        payload.reverse();
                        other.send(&payload);
                    }
                }
            });
            for n in 0..100 {
                let mut payload = [n; 20];
                payload[0] = 255;
                one.send(&payload);
                one.receive(&mut payload);
                assert_eq!((payload[0], payload[19]), (n, 255));
            }
            echo.join().unwrap();
        }
    }
}
