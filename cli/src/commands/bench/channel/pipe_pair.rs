//! A pair of pipes: standard input and output of the answering process.

use super::line::{Line, Proof, proof};
use crate::exit::Failure;
use std::fs::File;
use std::io::{Read, Write};
use std::os::fd::{AsFd, OwnedFd};
use std::process::Child;

struct PipePair {
    input: File,
    output: File,
    payload: Vec<u8>,
}

/// The partner's pipes, or this process's own.
pub fn open(size: usize, partner: Option<&mut Child>) -> Result<Box<dyn Line>, Failure> {
    let (input, output) = match partner {
        Some(child) => {
            let pipes = child.stdout.take().zip(child.stdin.take());
            let (input, output) = pipes.ok_or("the partner has no pipes")?;
            (OwnedFd::from(input), OwnedFd::from(output))
        }
        // Not through `std::io`, which keeps buffers of its own.
        None => (std::io::stdin().as_fd().try_clone_to_owned()?, std::io::stdout().as_fd().try_clone_to_owned()?),
    };
    Ok(Box::new(PipePair { input: input.into(), output: output.into(), payload: vec![0; size] }))
}

impl Line for PipePair {
    fn send(&mut self, payload: &[u8]) -> Result<(), Failure> {
        Ok(self.output.write_all(payload)?)
    }

    fn receive(&mut self) -> Result<Proof, Failure> {
        self.input.read_exact(&mut self.payload)?;
        Ok(proof(&self.payload))
    }
}
