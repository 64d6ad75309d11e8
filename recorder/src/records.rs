//! The records of an MCAP file one after another, without its index: so a file without its end can be read too.

use std::fs::File;
use std::io::{self, BufReader, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use mcap::records::{Record, op};
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};

use crate::error::RecordingError;

/// Opcode and length before every record.
const HEAD_BYTES: u64 = 9;

/// Chunks and records beyond this are damage [byte].
const MOST_BYTES: usize = 256 << 20;

/// What stands next in a file.
pub(crate) enum Next<'a> {
    /// A chunk, unopened.
    Chunk(&'a [u8]),
    /// Any other record.
    Record(Record<'a>),
}

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

    /// The next record; `None` at the file's end. A file that ends before is an error, after all its
    /// whole records.
    pub fn next(&mut self) -> Result<Option<Next<'_>>, RecordingError> {
        let (file, at) = (self.file.clone(), self.at);
        let truncated = || RecordingError::Truncated { file: file.clone(), at_byte: at };
        if self.ended {
            // Behind the footer stand the first bytes once more.
            return if self.size >= at + mcap::MAGIC.len() as u64 { Ok(None) } else { Err(truncated()) };
        }
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
        if opcode == op::CHUNK {
            return Ok(Some(Next::Chunk(&self.body)));
        }
        let record = mcap::parse_record(opcode, &self.body).map_err(|e| corrupt(e.to_string()))?;
        Ok(Some(Next::Record(record)))
    }

    /// Runs `each` over the records within a chunk, once its checksum has been found right.
    pub fn open_chunk(
        file: &Path,
        at_byte: u64,
        body: &[u8],
        each: &mut dyn FnMut(Record<'_>) -> Result<(), RecordingError>,
    ) -> Result<(), RecordingError> {
        let corrupt = |e: mcap::McapError| {
            let why = format!("a chunk cannot be read: {e}");
            RecordingError::Corrupt { file: file.to_owned(), at_byte, why }
        };
        let options = LinearReaderOptions::default()
            .with_skip_start_magic(true)
            .with_skip_end_magic(true)
            .with_prevalidate_chunk_crcs(true)
            .with_record_length_limit(MOST_BYTES);
        let mut reader = LinearReader::new_with_options(options);
        let length = (body.len() as u64).to_le_bytes();
        let mut rest: Vec<&[u8]> = vec![body, &length, &[op::CHUNK]];
        while let Some(event) = reader.next_event() {
            match event.map_err(corrupt)? {
                LinearReadEvent::ReadRequest(wanted) => {
                    let part = rest.pop().unwrap_or_default();
                    let (now, later) = part.split_at(part.len().min(wanted));
                    reader.insert(now.len()).copy_from_slice(now);
                    reader.notify_read(now.len());
                    if !later.is_empty() {
                        rest.push(later);
                    }
                }
                LinearReadEvent::Record { data, opcode } => {
                    each(mcap::parse_record(opcode, data).map_err(corrupt)?)?;
                }
            }
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
