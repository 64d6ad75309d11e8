//! The records of an MCAP file one after another, without its index: so a file without its end can be read too.

use std::fs::File;
use std::io::{self, BufReader, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use mcap::records::{Record, op};

use crate::error::RecordingError;

/// Opcode and length before every record.
const HEAD_BYTES: u64 = 9;

/// A file, read record by record.
pub(crate) struct Records {
    pub file: PathBuf,
    input: BufReader<File>,
    size: u64,
    /// Where the next record begins.
    at: u64,
    body: Vec<u8>,
    ended: bool,
}

impl Records {
    /// Opens a file that begins as an MCAP file does.
    pub fn open(file: &Path) -> Result<Records, RecordingError> {
        let failed = |source| RecordingError::Io { file: file.to_owned(), source };
        let opened = File::open(file).map_err(failed)?;
        let known = opened.metadata().map_err(failed)?;
        if known.is_dir() {
            return Err(failed(io::Error::from(io::ErrorKind::IsADirectory)));
        }
        let size = known.len();
        if size == 0 {
            return Err(RecordingError::Empty { file: file.to_owned() });
        }
        let mut input = BufReader::with_capacity(1 << 18, opened);
        let mut magic = [0; mcap::MAGIC.len()];
        let got = read_up_to(&mut input, &mut magic).map_err(failed)?;
        if magic[..got] != mcap::MAGIC[..got] {
            return Err(RecordingError::NotMcap { file: file.to_owned() });
        }
        if got < magic.len() {
            return Err(RecordingError::Truncated { file: file.to_owned(), at_byte: 0 });
        }
        Ok(Records { file: file.to_owned(), input, size, at: got as u64, body: Vec::new(), ended: false })
    }

    /// Where the next record begins.
    pub fn at(&self) -> u64 {
        self.at
    }

    /// Goes back to a record.
    pub fn seek(&mut self, at: u64) -> Result<(), RecordingError> {
        self.at = at;
        self.ended = false;
        let sought = self.input.seek(SeekFrom::Start(at));
        sought.map(drop).map_err(|source| RecordingError::Io { file: self.file.clone(), source })
    }

    /// Passes over the index; a file without its footer is cut off.
    pub fn finish(&mut self) -> Result<(), RecordingError> {
        while self.next()?.is_some() {}
        Ok(())
    }

    /// The next record, with its opcode; `None` at the file's end. A file that ends before is an error, after all its
    /// whole records.
    pub fn next(&mut self) -> Result<Option<(u8, Record<'_>)>, RecordingError> {
        if self.ended {
            return Ok(None);
        }
        let (file, at) = (self.file.clone(), self.at);
        let truncated = || RecordingError::Truncated { file: file.clone(), at_byte: at };
        let corrupt = |why: String| RecordingError::Corrupt { file: file.clone(), at_byte: at, why };
        let failed = |source| RecordingError::Io { file: file.clone(), source };
        let mut head = [0; HEAD_BYTES as usize];
        if read_up_to(&mut self.input, &mut head).map_err(failed)? < head.len() {
            return Err(truncated());
        }
        let [opcode, length @ ..] = head;
        let length = u64::from_le_bytes(length);
        if !(op::HEADER..=op::DATA_END).contains(&opcode) && opcode < 0x80 {
            return Err(corrupt(format!("there is no record of kind {opcode}")));
        }
        if length > self.size.saturating_sub(at + HEAD_BYTES) {
            return Err(truncated());
        }
        self.body.resize(length as usize, 0);
        self.input.read_exact(&mut self.body).map_err(failed)?;
        self.at += HEAD_BYTES + length;
        self.ended = opcode == op::FOOTER;
        let record = mcap::parse_record(opcode, &self.body).map_err(|e| corrupt(e.to_string()))?;
        Ok(Some((opcode, record)))
    }

    /// Runs `each` over the records within a chunk; all of them, or an error before the first.
    pub fn open_chunk(
        file: &Path,
        at_byte: u64,
        header: mcap::records::ChunkHeader,
        data: &[u8],
        each: &mut dyn FnMut(Record<'_>) -> Result<(), RecordingError>,
    ) -> Result<(), RecordingError> {
        let corrupt = |e: mcap::McapError| {
            let why = format!("a chunk cannot be read: {e}");
            RecordingError::Corrupt { file: file.to_owned(), at_byte, why }
        };
        let records: Result<Vec<Record<'_>>, _> =
            mcap::read::ChunkReader::new(header, data).map_err(corrupt)?.collect();
        for record in records.map_err(corrupt)? {
            each(record)?;
        }
        Ok(())
    }
}

fn read_up_to(input: &mut impl Read, into: &mut [u8]) -> io::Result<usize> {
    let mut got = 0;
    while got < into.len() {
        match input.read(&mut into[got..]) {
            Ok(0) => break,
            Ok(count) => got += count,
            Err(e) if e.kind() == io::ErrorKind::Interrupted => {}
            Err(e) => return Err(e),
        }
    }
    Ok(got)
}
