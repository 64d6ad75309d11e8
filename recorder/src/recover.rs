//! Saves what is whole in a recording that was cut off or damaged into a new one, with an index.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use mcap::records::{MessageHeader, Record};

use crate::error::{RecordError, RecordingError};
use crate::records::{Next, Records};

/// A chunk ends when it holds this much time [ns].
const CHUNK_NS: u64 = 1_000_000_000;

/// Why nothing was saved.
#[derive(Debug, thiserror::Error)]
pub enum RecoverError {
    /// The damaged file cannot be read at all.
    #[error(transparent)]
    Read(#[from] RecordingError),
    /// The new one cannot be written.
    #[error(transparent)]
    Write(#[from] RecordError),
}

/// What was saved.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Recovered {
    /// The new file.
    pub file: PathBuf,
    /// Messages in it.
    pub messages: u64,
    /// Time from the first to the last message [s].
    pub duration_s: f64,
    /// Chunks within the file that were damaged and left out.
    pub damaged_chunks: u64,
    /// What was wrong with the end, if anything.
    pub damage: Option<String>,
}

/// Copies what is whole in `from` to `to`, which must not exist.
pub fn recover(from: &Path, to: &Path) -> Result<Recovered, RecoverError> {
    let mut records = Records::open(from)?;
    if to.exists() {
        return Err(RecordError::Exists { file: to.to_owned() }.into());
    }
    let create = |source| RecordError::Create { file: to.to_owned(), source };
    let sink = BufWriter::new(File::create_new(to).map_err(create)?);
    let mut copy = Copy {
        out: None,
        sink: Some(sink),
        file: to.to_owned(),
        schemas: BTreeMap::new(),
        channels: BTreeMap::new(),
        messages: 0,
        span: None,
        chunk_ns: 0,
    };
    let (mut damaged_chunks, mut damage) = (0, None);
    loop {
        let at = records.at();
        match records.next() {
            Ok(None) => break,
            Ok(Some(Next::Chunk(body))) => {
                let mut failed = None;
                let whole = Records::open_chunk(from, at, body, &mut |record| {
                    if failed.is_none() {
                        failed = copy.take(record).err();
                    }
                    Ok(())
                });
                if let Some(e) = failed {
                    return Err(e.into());
                }
                if let Err(e) = whole {
                    damaged_chunks += 1;
                    damage = Some(e.to_string());
                }
            }
            // What follows is the index: it is made anew.
            Ok(Some(Next::Record(Record::DataEnd(_)))) => {
                if let Err(e) = records.finish() {
                    damage = Some(e.to_string());
                }
                break;
            }
            Ok(Some(Next::Record(record))) => copy.take(record)?,
            Err(e @ RecordingError::Io { .. }) => return Err(e.into()),
            Err(e) => {
                damage = Some(e.to_string());
                break;
            }
        }
    }
    let (messages, span) = (copy.messages, copy.span.unwrap_or((0, 0)));
    copy.finish()?;
    Ok(Recovered { file: to.to_owned(), messages, duration_s: (span.1 - span.0) as f64 * 1e-9, damaged_chunks, damage })
}

/// The new file in the making.
struct Copy {
    out: Option<mcap::Writer<BufWriter<File>>>,
    sink: Option<BufWriter<File>>,
    file: PathBuf,
    schemas: BTreeMap<u16, u16>,
    channels: BTreeMap<u16, u16>,
    messages: u64,
    /// First and last time [ns].
    span: Option<(u64, u64)>,
    chunk_ns: u64,
}

impl Copy {
    fn take(&mut self, record: Record<'_>) -> Result<(), RecordError> {
        let Copy { out, sink, file, schemas, channels, .. } = self;
        let failed = |e: mcap::McapError| RecordError::Write { file: file.clone(), reason: e.to_string() };
        if let (Record::Header(header), Some(sink)) = (&record, sink.take()) {
            let options = mcap::WriteOptions::new()
                .profile(header.profile.clone())
                .library(header.library.clone())
                .compression(Some(mcap::Compression::Lz4))
                .disable_seeking(true);
            *out = Some(options.create(sink).map_err(failed)?);
        }
        let Some(out) = out else { return Ok(()) };
        match record {
            Record::Schema { header, data } => {
                schemas.insert(header.id, out.add_schema(&header.name, &header.encoding, &data).map_err(failed)?);
            }
            Record::Channel(channel) => {
                let schema = schemas.get(&channel.schema_id).copied().unwrap_or(0);
                let id = out
                    .add_channel(schema, &channel.topic, &channel.message_encoding, &channel.metadata)
                    .map_err(failed)?;
                channels.insert(channel.id, id);
            }
            Record::Message { header, data } => {
                let Some(id) = channels.get(&header.channel_id) else { return Ok(()) };
                let time = header.log_time;
                out.write_to_known_channel(&MessageHeader { channel_id: *id, ..header }, &data).map_err(failed)?;
                self.messages += 1;
                let (first, last) = self.span.unwrap_or((time, time));
                self.span = Some((first.min(time), last.max(time)));
                if time.saturating_sub(self.chunk_ns) >= CHUNK_NS {
                    self.chunk_ns = time;
                    out.flush().map_err(failed)?;
                }
            }
            Record::Attachment { header, data, .. } => out
                .attach(&mcap::Attachment {
                    log_time: header.log_time,
                    create_time: header.create_time,
                    name: header.name,
                    media_type: header.media_type,
                    data,
                })
                .map_err(failed)?,
            Record::Metadata(metadata) => out.write_metadata(&metadata).map_err(failed)?,
            _ => {}
        }
        Ok(())
    }

    fn finish(self) -> Result<(), RecordError> {
        let Copy { out, file, .. } = self;
        let Some(mut out) = out else { return Ok(()) };
        let failed = |reason: String| RecordError::Write { file: file.clone(), reason };
        out.finish().map_err(|e| failed(e.to_string()))?;
        out.into_inner().flush().map_err(|e| failed(e.to_string()))
    }
}
