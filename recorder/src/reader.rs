//! Reads a recording: what it says about its run, then sample by sample.

use std::cell::Cell;
use std::collections::BTreeMap;
use std::path::Path;

use mcap::records::Record;
use messages::Schema;
use runtime::channel::{Geometry, RawSample};

use crate::definition::parts_per_element;
use crate::error::RecordingError;
use crate::exact::Layout;
use crate::facts::{FILES, FORMAT, Facts, METADATA, ROBOT_FILE};
use crate::feed::INCIDENTS;
use crate::records::{Next, Records};
use crate::writer::{CHANGE, LOSSES};

/// A recording that is being read.
pub struct Recording {
    records: Records,
    facts: Facts,
    /// The first record behind the facts, when it has been read already.
    channels: BTreeMap<u16, ChannelFacts>,
    schemas: BTreeMap<u16, (String, String)>,
}

/// A channel of the file.
#[derive(Debug, Clone, PartialEq)]
pub struct ChannelFacts {
    /// Its number in the file.
    pub id: u16,
    /// The topic: the path, or `/ros` and the path for a copy.
    pub topic: String,
    /// The message's ROS 2 type.
    pub ros_type: String,
    /// What it holds, where it is one of the robot's own.
    pub own: Option<OwnChannel>,
}

/// A channel of the robot, with exact samples.
#[derive(Debug, Clone, PartialEq)]
pub struct OwnChannel {
    /// Its ring.
    pub geometry: Geometry,
    /// Its message.
    pub schema: Schema,
    /// 0 for the path's first ring; one more for each that began its numbers anew.
    pub ring: u32,
    layout: Layout,
}

/// One thing in a recording.
#[derive(Debug)]
pub enum Item<'a> {
    /// A channel, before its first message.
    Channel(&'a ChannelFacts),
    /// A sample of the robot, exact.
    Sample {
        /// Its channel.
        channel: &'a ChannelFacts,
        /// Stamp, number, generation.
        sample: RawSample,
        /// The message's fixed part.
        fixed: &'a [u8],
        /// Its tail.
        tail: &'a [u8],
    },
    /// A copy for ROS 2, or another message: its channel, time and size.
    Copy {
        /// Its channel.
        channel: &'a ChannelFacts,
        /// Stamp on the file's clock [ns].
        log_ns: u64,
        /// Its bytes.
        data: &'a [u8],
    },
    /// A change of the run: at which time, and the launch from then on.
    Change {
        /// On the robot's clock [ns].
        at_ns: u64,
        /// The launch, as JSON.
        launch: String,
    },
    /// Samples that the recorder lost, per path: the newest of these counts.
    Losses(BTreeMap<String, u64>),
}

impl Recording {
    /// Opens a recording and reads what it says about its run.
    pub fn open(file: &Path) -> Result<Recording, RecordingError> {
        let mut records = Records::open(file)?;
        let mut facts = Facts::default();
        let mut library = "an unnamed program".to_owned();
        let mut found = false;
        // The facts stand before the first chunk; channels only come with it.
        let begin = loop {
            let at = records.at();
            match records.next()? {
                Some(Next::Record(Record::Header(header))) => {
                    if !header.library.is_empty() {
                        library = header.library;
                    }
                }
                Some(Next::Record(Record::Metadata(record))) if record.name == METADATA => {
                    let format = facts.read_metadata(&record.metadata);
                    if format > FORMAT {
                        return Err(RecordingError::Newer { file: file.to_owned(), format, known: FORMAT });
                    }
                    found = true;
                }
                Some(Next::Record(Record::Attachment { header, data, .. })) => {
                    if header.name == ROBOT_FILE {
                        facts.robot_text = String::from_utf8_lossy(&data).into_owned();
                    } else if let Some(name) = header.name.strip_prefix(FILES) {
                        facts.files.insert(name.to_owned(), data.into_owned());
                    }
                }
                Some(Next::Record(Record::Metadata(_) | Record::Unknown { .. })) => {}
                Some(_) => break at,
                None => break at,
            }
            if !found && records.at() > (1 << 20) {
                break at;
            }
        };
        if !found {
            return Err(RecordingError::Foreign { file: file.to_owned(), library });
        }
        records.seek(begin)?;
        Ok(Recording { records, facts, channels: BTreeMap::new(), schemas: BTreeMap::new() })
    }

    /// What it says about its run.
    pub fn facts(&self) -> &Facts {
        &self.facts
    }

    /// Hands all that follows to `each`, in the file's order. In a file that is cut off or damaged all that is whole
    /// before the damage is handed over, then comes the error.
    pub fn read(&mut self, each: &mut dyn FnMut(Item<'_>)) -> Result<(), RecordingError> {
        self.read_while(&mut |item| {
            each(item);
            true
        })
    }

    /// The same as long as `each` says that it wants more.
    pub fn read_while(&mut self, each: &mut dyn FnMut(Item<'_>) -> bool) -> Result<(), RecordingError> {
        let more = Cell::new(true);
        let each = &mut |item: Item<'_>| more.set(more.get() && each(item));
        let Recording { records, channels, schemas, .. } = self;
        while more.get() {
            let (file, at) = (records.file.clone(), records.at());
            let Some(next) = records.next()? else { return Ok(()) };
            let mut take = |record: Record<'_>| take(record, &file, channels, schemas, each);
            match next {
                // The index repeats what has been read.
                Next::Record(Record::DataEnd(_)) => return records.finish(),
                Next::Chunk(body) => Records::open_chunk(&file, at, body, &mut take)?,
                Next::Record(record) => take(record)?,
            }
        }
        Ok(())
    }
}

fn take(
    record: Record<'_>,
    file: &Path,
    channels: &mut BTreeMap<u16, ChannelFacts>,
    schemas: &mut BTreeMap<u16, (String, String)>,
    each: &mut dyn FnMut(Item<'_>),
) -> Result<(), RecordingError> {
    let broken = |path: &str, why: &str| RecordingError::Channel {
        file: file.to_owned(),
        path: path.to_owned(),
        why: why.to_owned(),
    };
    match record {
        Record::Schema { header, .. } => {
            schemas.insert(header.id, (header.name, header.encoding));
        }
        Record::Channel(channel) if !channels.contains_key(&channel.id) => {
            let (ros_type, _) = schemas
                .get(&channel.schema_id)
                .cloned()
                .ok_or_else(|| broken(&channel.topic, "the file has no schema for it"))?;
            let copy = channel.topic.starts_with("/ros/") || channel.topic == INCIDENTS;
            let own = match copy {
                true => None,
                false => Some(own_channel(&channel.metadata).map_err(|why| broken(&channel.topic, &why))?),
            };
            let facts = ChannelFacts { id: channel.id, topic: channel.topic, ros_type, own };
            each(Item::Channel(channels.entry(channel.id).or_insert(facts)));
        }
        Record::Message { header, data } => {
            let channel = channels
                .get(&header.channel_id)
                .ok_or_else(|| broken(&format!("number {}", header.channel_id), "the file does not describe it"))?;
            match &channel.own {
                Some(own) => {
                    let decoded = own.layout.decode(&data);
                    let (sample, fixed, tail) =
                        decoded.ok_or_else(|| broken(&channel.topic, "a message is not as long as its schema says"))?;
                    each(Item::Sample { channel, sample, fixed, tail });
                }
                None => each(Item::Copy { channel, log_ns: header.log_time, data: &data }),
            }
        }
        Record::Metadata(metadata) if metadata.name == CHANGE => {
            let word = |key: &str| metadata.metadata.get(key).cloned().unwrap_or_default();
            each(Item::Change { at_ns: word("at_ns").parse().unwrap_or_default(), launch: word("launch") });
        }
        Record::Metadata(metadata) if metadata.name == LOSSES => {
            let losses = metadata.metadata.into_iter().filter_map(|(path, count)| Some((path, count.parse().ok()?)));
            each(Item::Losses(losses.collect()));
        }
        _ => {}
    }
    Ok(())
}

/// The ring and message that a channel's words describe, or what is wrong with them.
fn own_channel(words: &BTreeMap<String, String>) -> Result<OwnChannel, String> {
    let word = |key: &str| words.get(key).ok_or_else(|| format!("its {key} is missing"));
    let number = |key: &str| word(key)?.parse::<usize>().map_err(|_| format!("its {key} is no number"));
    let text = word("sinew.schema")?.clone();
    let schema = Schema::from_text(&text).map_err(|e| format!("its schema is damaged: {e}"))?;
    let geometry = Geometry {
        type_name: word("sinew.type")?.clone(),
        layout_hash: schema.hash(),
        schema: text,
        fixed_bytes: number("sinew.fixed_bytes")?,
        tail_element_bytes: number("sinew.tail_element_bytes")?,
        tail_capacity: number("sinew.tail_capacity")?,
        depth: number("sinew.depth")?.max(1),
    };
    let tail_bytes = schema.tail.as_ref().map_or(0, messages::Element::size);
    if (schema.size, tail_bytes) != (geometry.fixed_bytes, geometry.tail_element_bytes) {
        return Err("its schema and its sizes contradict each other".into());
    }
    if geometry.depth > 1 << 24 || geometry.tail_capacity > 1 << 32 {
        return Err("its ring has sizes beyond any memory".into());
    }
    let layout = Layout::new(&geometry, parts_per_element(&schema));
    Ok(OwnChannel { geometry, schema, ring: number("sinew.ring")? as u32, layout })
}
