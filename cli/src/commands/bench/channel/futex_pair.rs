//! The bare futex pair behind a line.

use super::line::{End, Line, Proof, proof};
use crate::exit::Failure;
use runtime::channel::BarePair;
use std::path::{Path, PathBuf};

/// One end.
pub struct FutexPair {
    pair: BarePair,
    payload: Vec<u8>,
}

/// Makes the shared file.
pub fn prepare(folder: &Path, size: usize) -> Result<(), Failure> {
    Ok(BarePair::create(&file(folder), size)?)
}

fn file(folder: &Path) -> PathBuf {
    folder.join("futex-pair")
}

impl FutexPair {
    /// Opens one end.
    pub fn open(folder: &Path, size: usize, end: End, two_words: bool) -> Result<FutexPair, Failure> {
        let pair = BarePair::open(&file(folder), size, usize::from(end == End::Answering), two_words)?;
        Ok(FutexPair { pair, payload: vec![0; size] })
    }
}

impl Line for FutexPair {
    fn send(&mut self, payload: &[u8]) -> Result<(), Failure> {
        self.pair.send(payload);
        Ok(())
    }

    fn receive(&mut self) -> Result<Proof, Failure> {
        self.pair.receive(&mut self.payload);
        Ok(proof(&self.payload))
    }
}
