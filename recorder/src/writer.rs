//! Writes a recording: chunks that are closed by time, so that a crash costs a second at most.

use std::collections::BTreeMap;
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use mcap::records::MessageHeader;
use messages::{Schema, SchemaError};
use runtime::channel::{Geometry, RawSample};

use crate::cdr::Cdr;
use crate::definition::{definition, parts_per_element, topic_type};
use crate::error::RecordError;
use crate::exact::Layout;
use crate::facts::{FILES, Facts, METADATA, ROBOT_FILE};
use crate::ros::{self, Copier, RosType};
use crate::sink::Sink;

/// A chunk ends when it is this old on the file's clock [ns].
const CHUNK_NS: u64 = 1_000_000_000;
/// A chunk ends when it is this large [byte].
const CHUNK_BYTES: u64 = 4 << 20;
/// What rosbag2 wants to know of a topic: keep the last ten, best effort, volatile.
const QOS: &str = "- history: 1\n  depth: 10\n  reliability: 2\n  durability: 2\n  deadline:\n    sec: 9223372036\n    \
                   nsec: 854775807\n  lifespan:\n    sec: 9223372036\n    nsec: 854775807\n  liveliness: 1\n  \
                   liveliness_lease_duration:\n    sec: 9223372036\n    nsec: 854775807\n  \
                   avoid_ros_namespace_conventions: false";

/// A channel of the recording, as the writer numbers them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ChannelKey(usize);

struct Channel {
    id: u16,
    path: String,
    layout: Layout,
    copier: Option<Copier>,
    /// The copies under `/ros`, by type: images change theirs.
    copies: Vec<(RosType, u16)>,
}

/// A recording in the making.
pub struct RecordingWriter {
    out: mcap::Writer<Sink>,
    file: PathBuf,
    written: Arc<AtomicU64>,
    offset_ns: u64,
    channels: Vec<Channel>,
    incidents: Option<u16>,
    /// When the open chunk's first message was taken [ns].
    chunk_ns: Option<u64>,
    cdr: Cdr,
}

impl RecordingWriter {
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
        let failed = |error| failure(file, 0, error);
        let mut out = options.create(sink).map_err(failed)?;
        out.write_metadata(&mcap::records::Metadata { name: METADATA.into(), metadata: facts.to_metadata() })
            .map_err(failed)?;
        attach(&mut out, ROBOT_FILE, facts.robot_text.as_bytes(), facts.clock_offset_ns).map_err(failed)?;
        for (name, bytes) in &facts.files {
            attach(&mut out, &format!("{FILES}{name}"), bytes, facts.clock_offset_ns).map_err(failed)?;
        }
        out.flush().map_err(failed)?;
        Ok(RecordingWriter {
            out,
            file: file.to_owned(),
            written,
            offset_ns: facts.clock_offset_ns,
            channels: Vec::new(),
            incidents: None,
            chunk_ns: None,
            cdr: Cdr::new(),
        })
    }

    /// Bytes that were handed to the disk.
    pub fn written_bytes(&self) -> u64 {
        self.written.load(Ordering::Relaxed)
    }

    /// Adds a channel, before its samples. A channel whose ring was made anew with other sizes is added again.
    pub fn channel(&mut self, path: &str, geometry: &Geometry) -> Result<ChannelKey, RecordError> {
        let schema = match Schema::from_text(&geometry.schema) {
            Ok(schema) => schema,
            Err(error) => return Err(self.unusable(path, &error)),
        };
        let parts = parts_per_element(&schema);
        let text = definition(&schema, geometry);
        let schema_id = self.checked(|out| out.add_schema(&topic_type(&schema.name), "ros2msg", text.as_bytes()))?;
        let number = self.channels.iter().filter(|channel| channel.path == path).count();
        let words = [
            ("offered_qos_profiles", QOS.to_owned()),
            ("sinew.type", geometry.type_name.clone()),
            ("sinew.schema", geometry.schema.clone()),
            ("sinew.layout_hash", format!("{:016x}", geometry.layout_hash)),
            ("sinew.fixed_bytes", geometry.fixed_bytes.to_string()),
            ("sinew.tail_element_bytes", geometry.tail_element_bytes.to_string()),
            ("sinew.tail_capacity", geometry.tail_capacity.to_string()),
            ("sinew.depth", geometry.depth.to_string()),
            ("sinew.ring", number.to_string()),
        ];
        let words: BTreeMap<String, String> = words.into_iter().map(|(key, value)| (key.to_owned(), value)).collect();
        let id = self.checked(|out| out.add_channel(schema_id, path, "cdr", &words))?;
        let layout = Layout::new(geometry, parts);
        let copier = Copier::of(&schema);
        self.channels.push(Channel { id, path: path.into(), layout, copier, copies: Vec::new() });
        Ok(ChannelKey(self.channels.len() - 1))
    }

    /// Adds a sample, and its copy for ROS 2 where there is one.
    pub fn sample(
        &mut self,
        key: ChannelKey,
        sample: &RawSample,
        fixed: &[u8],
        tail: &[u8],
    ) -> Result<(), RecordError> {
        let Some(channel) = self.channels.get(key.0) else { return Ok(()) };
        let id = channel.id;
        let ns = sample.stamp_ns.saturating_add(self.offset_ns);
        let mut cdr = std::mem::take(&mut self.cdr);
        channel.layout.encode(sample, fixed, tail, &mut cdr);
        let mut done = self.put(id, sample.sequence, ns, cdr.bytes());
        let copier = self.channels[key.0].copier.as_ref();
        if let Some(kind) = copier.and_then(|copier| copier.encode(ns, fixed, tail, &mut cdr))
            && done.is_ok()
        {
            done = self.copy_channel(key, kind).and_then(|id| self.put(id, sample.sequence, ns, cdr.bytes()));
        }
        self.cdr = cdr;
        done?;
        self.close_old_chunk(ns)
    }

    /// Adds an incident.
    pub fn incident(&mut self, record: &supervisor::Record) -> Result<(), RecordError> {
        let id = match self.incidents {
            Some(id) => id,
            None => {
                let text = ros::INCIDENT.as_bytes();
                let schema = self.checked(|out| out.add_schema(ros::INCIDENT_TYPE, "ros2msg", text))?;
                let words = BTreeMap::from([("offered_qos_profiles".to_owned(), QOS.to_owned())]);
                self.checked(|out| out.add_channel(schema, INCIDENTS, "cdr", &words))?
            }
        };
        self.incidents = Some(id);
        let stamp_ns = runtime::Time::from_seconds(record.at_s).nanos();
        let mut cdr = Cdr::new();
        let json = serde_json::to_string(record).unwrap_or_default();
        cdr.u64(stamp_ns).string(&record.node).string(&record.event).string(&record.message).string(&json);
        self.put(id, 0, stamp_ns.saturating_add(self.offset_ns), cdr.bytes())
    }

    /// Adds a change of the run: the launch as it is from `at_ns` on.
    pub fn change(&mut self, at_ns: u64, text: &str) -> Result<(), RecordError> {
        let words = BTreeMap::from([("at_ns".to_owned(), at_ns.to_string()), ("launch".to_owned(), text.to_owned())]);
        self.checked(|out| out.write_metadata(&mcap::records::Metadata { name: CHANGE.into(), metadata: words }))
    }

    /// Samples lost and never finished so far, per path. The file's gaps in the numbers say the same, sample by sample.
    pub fn losses(&mut self, losses: &BTreeMap<String, u64>) -> Result<(), RecordError> {
        let words = losses.iter().map(|(path, count)| (path.clone(), count.to_string())).collect();
        self.checked(|out| out.write_metadata(&mcap::records::Metadata { name: LOSSES.into(), metadata: words }))
    }

    /// Ends the open chunk, and hands everything to the system.
    pub fn flush(&mut self) -> Result<(), RecordError> {
        self.chunk_ns = None;
        self.checked(mcap::Writer::flush)
    }

    /// Writes the index. Without it the file can be read all the same, after `sinew recover`.
    pub fn finish(mut self) -> Result<u64, RecordError> {
        self.checked(|out| out.finish().map(drop))?;
        let RecordingWriter { out, file, .. } = self;
        let sink = out.into_inner();
        let written = sink.written();
        sink.close().map_err(|e| failure(&file, written, e.into()))?;
        Ok(written)
    }

    /// The copy's channel, made when the first copy comes.
    fn copy_channel(&mut self, key: ChannelKey, kind: RosType) -> Result<u16, RecordError> {
        let channel = &self.channels[key.0];
        if let Some((_, id)) = channel.copies.iter().find(|(known, _)| *known == kind) {
            return Ok(*id);
        }
        let mut topic = format!("/ros{}", channel.path);
        if kind == RosType::CompressedImage {
            topic.push_str("/compressed");
        }
        let text = ros::definition(kind);
        let schema = self.checked(|out| out.add_schema(kind.name(), "ros2msg", text.as_bytes()))?;
        let words = BTreeMap::from([("offered_qos_profiles".to_owned(), QOS.to_owned())]);
        let id = self.checked(|out| out.add_channel(schema, &topic, "cdr", &words))?;
        self.channels[key.0].copies.push((kind, id));
        Ok(id)
    }

    fn put(&mut self, channel_id: u16, sequence: u64, ns: u64, data: &[u8]) -> Result<(), RecordError> {
        let header = MessageHeader { channel_id, sequence: sequence as u32, log_time: ns, publish_time: ns };
        self.checked(|out| out.write_to_known_channel(&header, data))
    }

    fn close_old_chunk(&mut self, ns: u64) -> Result<(), RecordError> {
        let begun = *self.chunk_ns.get_or_insert(ns);
        if ns.saturating_sub(begun) < CHUNK_NS {
            return Ok(());
        }
        self.flush()
    }

    fn checked<T>(
        &mut self,
        act: impl FnOnce(&mut mcap::Writer<Sink>) -> mcap::McapResult<T>,
    ) -> Result<T, RecordError> {
        act(&mut self.out).map_err(|error| failure(&self.file, self.written.load(Ordering::Relaxed), error))
    }

    fn unusable(&self, path: &str, error: &SchemaError) -> RecordError {
        let reason = format!("the schema of {path} cannot be read: {error}");
        RecordError::Write { file: self.file.clone(), reason }
    }
}

/// Topic of the incidents.
pub(crate) const INCIDENTS: &str = "/supervisor/incidents";
/// Name of the metadata records of changes.
pub(crate) const CHANGE: &str = "sinew.change";
/// Name of the metadata record of losses.
pub(crate) const LOSSES: &str = "sinew.losses";

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

fn failure(file: &Path, written_bytes: u64, error: mcap::McapError) -> RecordError {
    match error {
        mcap::McapError::Io(error)
            if matches!(error.kind(), io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded) =>
        {
            RecordError::DiskFull { file: file.to_owned(), written_bytes }
        }
        error => RecordError::Write { file: file.to_owned(), reason: error.to_string() },
    }
}
