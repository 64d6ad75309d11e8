//! The file behind a recording: bytes are handed to a thread of its own, so that a slow disk keeps nobody from reading the
//! rings in time. Only when as much waits as memory is set aside for does writing wait for the disk.

use std::fs::File;
use std::io::{self, Seek, SeekFrom, Write};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;

/// Bytes handed over at once.
const BLOCK_BYTES: usize = 256 << 10;
/// Blocks that may wait for the disk: 64 MiB.
const WAITING: usize = 256;

/// A file that is only ever appended to, and counts its bytes.
pub(crate) struct Sink {
    block: Vec<u8>,
    blocks: Option<SyncSender<Vec<u8>>>,
    thread: Option<JoinHandle<()>>,
    failure: Arc<Mutex<Option<io::Error>>>,
    written: Arc<AtomicU64>,
}

impl Sink {
    /// Appends to `file`, on a thread of its own; `written` counts what was handed over.
    pub fn new(file: File, written: Arc<AtomicU64>) -> io::Result<Sink> {
        let (blocks, waiting) = sync_channel(WAITING);
        let failure: Arc<Mutex<Option<io::Error>>> = Arc::default();
        let failed = failure.clone();
        let thread =
            std::thread::Builder::new().name("disk".into()).spawn(move || write_all(file, &waiting, &failed))?;
        Ok(Sink { block: Vec::new(), blocks: Some(blocks), thread: Some(thread), failure, written })
    }

    /// Bytes that were handed over.
    pub fn written(&self) -> u64 {
        self.written.load(Ordering::Relaxed)
    }

    /// Waits until the disk has everything; its error, if it had one.
    pub fn close(mut self) -> io::Result<()> {
        let handed = self.hand_over();
        self.blocks = None;
        if let Some(thread) = self.thread.take() {
            thread.join().map_err(|_| io::Error::other("the disk's thread panicked"))?;
        }
        self.check().and(handed)
    }

    fn check(&self) -> io::Result<()> {
        match self.failure.lock().unwrap_or_else(PoisonError::into_inner).as_ref() {
            Some(error) => Err(io::Error::new(error.kind(), error.to_string())),
            None => Ok(()),
        }
    }

    fn hand_over(&mut self) -> io::Result<()> {
        self.check()?;
        if self.block.is_empty() {
            return Ok(());
        }
        let block = std::mem::replace(&mut self.block, Vec::with_capacity(BLOCK_BYTES));
        match self.blocks.as_ref().map(|blocks| blocks.send(block)) {
            Some(Ok(())) => Ok(()),
            // The thread ended, after an error.
            _ => self.check().and(Err(io::Error::other("the disk's thread ended"))),
        }
    }
}

impl Write for Sink {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.check()?;
        self.block.extend_from_slice(bytes);
        self.written.fetch_add(bytes.len() as u64, Ordering::Relaxed);
        if self.block.len() >= BLOCK_BYTES {
            self.hand_over()?;
        }
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        self.hand_over()
    }
}

impl Seek for Sink {
    /// The writer is told not to seek; it asks where it is.
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        match to {
            SeekFrom::Current(0) => Ok(self.written()),
            _ => Err(io::Error::from(io::ErrorKind::Unsupported)),
        }
    }
}

impl Drop for Sink {
    fn drop(&mut self) {
        self.blocks = None;
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

fn write_all(mut file: File, waiting: &Receiver<Vec<u8>>, failed: &Mutex<Option<io::Error>>) {
    for block in waiting {
        if let Err(error) = file.write_all(&block) {
            *failed.lock().unwrap_or_else(PoisonError::into_inner) = Some(error);
            return;
        }
    }
}
