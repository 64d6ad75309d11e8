//! Writes a recording: chunks that are closed by time, so that a crash costs a second at most.

use std::collections::BTreeMap;
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use mcap::records::MessageHeader;

use crate::error::RecordError;
use crate::facts::{FILES, Facts, METADATA, ROBOT_FILE};
use crate::feed::{Feed, Outlet, Topic, TopicMessage};
use crate::sink::Sink;

/// A chunk ends when it is this old on the file's clock [ns].
const CHUNK_NS: u64 = 1_000_000_000;
/// A chunk ends when it is this large [byte].
const CHUNK_BYTES: u64 = 4 << 20;

/// Name of the metadata records of changes.
pub(crate) const CHANGE: &str = "sinew.change";
/// Name of the metadata record of losses.
pub(crate) const LOSSES: &str = "sinew.losses";

/// A recording in the making.
pub type RecordingWriter = Feed<McapFile>;

/// The file of a recording.
pub struct McapFile {
    out: mcap::Writer<Sink>,
    file: PathBuf,
    written: Arc<AtomicU64>,
    /// When the open chunk's first message was taken [ns].
    chunk_ns: Option<u64>,
}

impl Feed<McapFile> {
    /// A new recording in `file`, which must not exist yet, unless it is a device.
    pub fn create(file: &Path, facts: &Facts) -> Result<RecordingWriter, RecordError> {
        let create = |source| RecordError::Create { file: file.to_owned(), source };
        let is_device = std::fs::metadata(file).is_ok_and(|known| !known.is_file());
        if file.exists() && !is_device {
            return Err(RecordError::Exists { file: file.to_owned() });
        }
        if let Some(folder) = file.parent().filter(|folder| !folder.as_os_str().is_empty()) {
            std::fs::create_dir_all(folder).map_err(create)?;
        }
        let opened = File::options().write(true).create(true).truncate(false).open(file).map_err(create)?;
        let written = Arc::new(AtomicU64::new(0));
        let sink = Sink::new(opened, written.clone()).map_err(create)?;
        let options = mcap::WriteOptions::new()
            .profile("ros2")
            .library(format!("sinew {}", env!("CARGO_PKG_VERSION")))
            .compression(Some(mcap::Compression::Lz4))
            .chunk_size(Some(CHUNK_BYTES))
            .disable_seeking(true);
        let failed = |error| failure(file, error);
        let mut out = options.create(sink).map_err(failed)?;
        out.write_metadata(&mcap::records::Metadata { name: METADATA.into(), metadata: facts.to_metadata() })
            .map_err(failed)?;
        attach(&mut out, ROBOT_FILE, facts.robot_text.as_bytes(), facts.clock_offset_ns).map_err(failed)?;
        for (name, bytes) in &facts.files {
            attach(&mut out, &format!("{FILES}{name}"), bytes, facts.clock_offset_ns).map_err(failed)?;
        }
        out.flush().map_err(failed)?;
        Ok(Feed::new(McapFile { out, file: file.to_owned(), written, chunk_ns: None }, facts.clock_offset_ns))
    }

    /// Bytes that were handed to the disk.
    pub fn written_bytes(&self) -> u64 {
        self.out.written.load(Ordering::Relaxed)
    }

    /// Adds a change of the run: the launch as it is from `at_ns` on.
    pub fn change(&mut self, at_ns: u64, text: &str) -> Result<(), RecordError> {
        let words = BTreeMap::from([("at_ns".to_owned(), at_ns.to_string()), ("launch".to_owned(), text.to_owned())]);
        self.out.checked(|out| out.write_metadata(&mcap::records::Metadata { name: CHANGE.into(), metadata: words }))
    }

    /// Samples lost and never finished so far, per path. The file's gaps in the numbers say the same, sample by sample.
    pub fn losses(&mut self, losses: &BTreeMap<String, u64>) -> Result<(), RecordError> {
        let words = losses.iter().map(|(path, count)| (path.clone(), count.to_string())).collect();
        self.out.checked(|out| out.write_metadata(&mcap::records::Metadata { name: LOSSES.into(), metadata: words }))
    }

    /// Ends the open chunk, and hands everything to the system.
    pub fn flush(&mut self) -> Result<(), RecordError> {
        self.out.flush()
    }

    /// Writes the index. Without it the file can be read all the same, after `sinew recover`.
    pub fn finish(mut self) -> Result<u64, RecordError> {
        self.out.checked(|out| out.finish().map(drop))?;
        let McapFile { out, file, .. } = self.out;
        let sink = out.into_inner();
        let written = sink.written();
        sink.close().map_err(|e| failure(&file, e.into()))?;
        Ok(written)
    }
}

impl Outlet for McapFile {
    type Id = u16;
    type Error = RecordError;

    fn topic(&mut self, topic: Topic<'_>) -> Result<u16, RecordError> {
        let Topic { name, ros_type, definition, words } = topic;
        let schema = self.checked(|out| out.add_schema(ros_type, "ros2msg", definition.as_bytes()))?;
        self.checked(|out| out.add_channel(schema, name, "cdr", &words))
    }

    fn wants(&self, _: u16) -> bool {
        true
    }

    fn message(&mut self, channel_id: u16, message: TopicMessage<'_>) -> Result<(), RecordError> {
        let TopicMessage { sequence, ns, data } = message;
        // A message that comes a second after its chunk's first begins the next one.
        if self.chunk_ns.is_some_and(|begun| ns.saturating_sub(begun) >= CHUNK_NS) {
            self.flush()?;
        }
        self.chunk_ns.get_or_insert(ns);
        let header = MessageHeader { channel_id, sequence: sequence as u32, log_time: ns, publish_time: ns };
        self.checked(|out| out.write_to_known_channel(&header, data))
    }
}

impl McapFile {
    fn flush(&mut self) -> Result<(), RecordError> {
        self.chunk_ns = None;
        self.checked(mcap::Writer::flush)
    }

    fn checked<T>(
        &mut self,
        act: impl FnOnce(&mut mcap::Writer<Sink>) -> mcap::McapResult<T>,
    ) -> Result<T, RecordError> {
        act(&mut self.out).map_err(|error| failure(&self.file, error))
    }
}

fn attach(out: &mut mcap::Writer<Sink>, name: &str, bytes: &[u8], ns: u64) -> mcap::McapResult<()> {
    let media_type = if name.ends_with(".toml") { "application/toml" } else { "application/octet-stream" };
    out.attach(&mcap::Attachment {
        log_time: ns,
        create_time: ns,
        name: name.into(),
        media_type: media_type.into(),
        data: bytes.into(),
    })
}

fn failure(file: &Path, error: mcap::McapError) -> RecordError {
    let mcap::McapError::Io(error) = error else {
        return RecordError::Write { file: file.to_owned(), reason: error.to_string() };
    };
    // What was handed over last may not have reached the disk: the file itself knows.
    let written_bytes = std::fs::metadata(file).map_or(0, |known| known.len());
    let file = file.to_owned();
    match error.kind() {
        io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => RecordError::DiskFull { file, written_bytes },
        io::ErrorKind::FileTooLarge => RecordError::TooLarge { file, written_bytes },
        _ => RecordError::Write { file, reason: error.to_string() },
    }
}
