//! From a robot's channels to the topics that others see: each channel under its own name as CDR, and a copy under `/ros`
//! where ROS 2 has a message for the same thing. Where they go to is an [`Outlet`]: a file, or the clients of a live view.

use std::collections::BTreeMap;

use messages::Schema;
use runtime::channel::{Geometry, RawSample};

use crate::cdr::Cdr;
use crate::definition::{definition, parts_per_element, topic_type};
use crate::error::RecordError;
use crate::exact::Layout;
use crate::ros::{self, Copier, RosType};

/// What rosbag2 wants to know of a topic: keep the last ten, best effort, volatile.
const QOS: &str = "- history: 1\n  depth: 10\n  reliability: 2\n  durability: 2\n  deadline:\n    sec: 9223372036\n    \
                   nsec: 854775807\n  lifespan:\n    sec: 9223372036\n    nsec: 854775807\n  liveliness: 1\n  \
                   liveliness_lease_duration:\n    sec: 9223372036\n    nsec: 854775807\n  \
                   avoid_ros_namespace_conventions: false";

/// Topic of the incidents.
pub(crate) const INCIDENTS: &str = "/supervisor/incidents";

/// A topic as an outlet is told of it.
#[derive(Debug)]
pub struct Topic<'a> {
    /// Its name.
    pub name: &'a str,
    /// Its ROS 2 type.
    pub ros_type: &'a str,
    /// The definition of that type, and of all that it is made of (`ros2msg`).
    pub definition: &'a str,
    /// What else is known of it.
    pub words: BTreeMap<String, String>,
}

/// One message on a topic.
#[derive(Debug, Clone, Copy)]
pub struct TopicMessage<'a> {
    /// Number of the sample on its channel; 0 for what has none.
    pub sequence: u64,
    /// Stamp on the outlet's clock [ns].
    pub ns: u64,
    /// CDR.
    pub data: &'a [u8],
}

/// Where topics and their messages go.
pub trait Outlet {
    /// How the outlet names a topic.
    type Id: Copy;
    /// What can go wrong.
    type Error: From<RecordError>;

    /// Adds a topic, before its messages.
    fn topic(&mut self, topic: Topic<'_>) -> Result<Self::Id, Self::Error>;
    /// Whether anybody would see a message: one that nobody sees need not be made.
    fn wants(&self, id: Self::Id) -> bool;
    /// Takes a message.
    fn message(&mut self, id: Self::Id, message: TopicMessage<'_>) -> Result<(), Self::Error>;
}

/// A channel, as a feed numbers them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ChannelKey(usize);

struct Channel<Id> {
    id: Id,
    path: String,
    layout: Layout,
    copier: Option<Copier>,
    /// The copies under `/ros`, by type: images change theirs.
    copies: Vec<(RosType, Id)>,
}

/// Turns samples into messages for an outlet.
pub struct Feed<O: Outlet> {
    pub(crate) out: O,
    offset_ns: u64,
    channels: Vec<Channel<O::Id>>,
    incidents: Option<O::Id>,
    cdr: Cdr,
}

impl<O: Outlet> Feed<O> {
    /// A feed into `out`, whose clock is `offset_ns` ahead of the robot's.
    pub fn new(out: O, offset_ns: u64) -> Feed<O> {
        Feed { out, offset_ns, channels: Vec::new(), incidents: None, cdr: Cdr::new() }
    }

    /// Where it feeds to.
    pub fn outlet(&mut self) -> &mut O {
        &mut self.out
    }

    /// Adds a channel, before its samples. A channel whose ring was made anew with other sizes is added again.
    pub fn channel(&mut self, path: &str, geometry: &Geometry) -> Result<ChannelKey, O::Error> {
        let schema = Schema::from_text(&geometry.schema)
            .map_err(|e| RecordError::Schema { path: path.to_owned(), why: e.to_string() })?;
        let parts = parts_per_element(&schema);
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
        let id = self.out.topic(Topic {
            name: path,
            ros_type: &topic_type(&schema.name),
            definition: &definition(&schema, geometry),
            words: words.into_iter().map(|(key, value)| (key.to_owned(), value)).collect(),
        })?;
        let layout = Layout::new(geometry, parts);
        let copier = Copier::of(&schema);
        self.channels.push(Channel { id, path: path.into(), layout, copier, copies: Vec::new() });
        Ok(ChannelKey(self.channels.len() - 1))
    }

    /// Adds a sample, and its copy for ROS 2 where there is one.
    pub fn sample(&mut self, key: ChannelKey, sample: &RawSample, fixed: &[u8], tail: &[u8]) -> Result<(), O::Error> {
        let mut cdr = std::mem::take(&mut self.cdr);
        let done = self.sample_in(key, sample, (fixed, tail), &mut cdr);
        self.cdr = cdr;
        done
    }

    fn sample_in(
        &mut self,
        key: ChannelKey,
        sample: &RawSample,
        (fixed, tail): (&[u8], &[u8]),
        cdr: &mut Cdr,
    ) -> Result<(), O::Error> {
        let Some(channel) = self.channels.get(key.0) else { return Ok(()) };
        let ns = sample.stamp_ns.saturating_add(self.offset_ns);
        let sequence = sample.sequence;
        if self.out.wants(channel.id) {
            channel.layout.encode(sample, fixed, tail, cdr);
            self.out.message(channel.id, TopicMessage { sequence, ns, data: cdr.bytes() })?;
        }
        let known = channel.copies.last();
        if known.is_some_and(|(_, id)| !self.out.wants(*id)) && !matches!(channel.copier, Some(Copier::Image)) {
            return Ok(());
        }
        if let Some(kind) = channel.copier.as_ref().and_then(|copier| copier.encode(ns, fixed, tail, cdr)) {
            let id = self.copy_topic(key, kind)?;
            self.out.message(id, TopicMessage { sequence, ns, data: cdr.bytes() })?;
        }
        Ok(())
    }

    /// Adds an incident.
    pub fn incident(&mut self, record: &supervisor::Record) -> Result<(), O::Error> {
        let id = match self.incidents {
            Some(id) => id,
            None => self.plain_topic(INCIDENTS, ros::INCIDENT_TYPE, ros::INCIDENT)?,
        };
        self.incidents = Some(id);
        let stamp_ns = runtime::Time::from_seconds(record.at_s).nanos();
        let mut cdr = Cdr::new();
        let json = serde_json::to_string(record).unwrap_or_default();
        cdr.u64(stamp_ns).string(&record.node).string(&record.event).string(&record.message).string(&json);
        let ns = stamp_ns.saturating_add(self.offset_ns);
        self.out.message(id, TopicMessage { sequence: 0, ns, data: cdr.bytes() })
    }

    /// The copy's topic, made when the first copy comes.
    fn copy_topic(&mut self, key: ChannelKey, kind: RosType) -> Result<O::Id, O::Error> {
        let channel = &self.channels[key.0];
        if let Some((_, id)) = channel.copies.iter().find(|(known, _)| *known == kind) {
            return Ok(*id);
        }
        let mut topic = format!("/ros{}", channel.path);
        if kind == RosType::CompressedImage {
            topic.push_str("/compressed");
        }
        let id = self.plain_topic(&topic, kind.name(), &ros::definition(kind))?;
        self.channels[key.0].copies.push((kind, id));
        Ok(id)
    }

    fn plain_topic(&mut self, name: &str, ros_type: &str, definition: &str) -> Result<O::Id, O::Error> {
        let words = BTreeMap::from([("offered_qos_profiles".to_owned(), QOS.to_owned())]);
        self.out.topic(Topic { name, ros_type, definition, words })
    }
}
