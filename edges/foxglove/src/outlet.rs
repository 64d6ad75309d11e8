//! Topics and messages as channels of the Foxglove server.

use foxglove::{ChannelBuilder, ChannelId, Context, FoxgloveError, PartialMetadata, RawChannel, Schema, SinkId};
use recorder::RecordError;
use recorder::feed::{Outlet, Topic, TopicMessage};
use std::sync::Arc;

/// Why nothing can be served.
#[derive(Debug)]
pub enum ServeError {
    /// The robot's side.
    Robot(RecordError),
    /// The viewers' side.
    Server(String),
}

impl std::fmt::Display for ServeError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            ServeError::Robot(e) => e.fmt(f),
            ServeError::Server(text) => f.write_str(text),
        }
    }
}

impl From<RecordError> for ServeError {
    fn from(e: RecordError) -> ServeError {
        ServeError::Robot(e)
    }
}

impl From<FoxgloveError> for ServeError {
    fn from(e: FoxgloveError) -> ServeError {
        ServeError::Server(e.to_string())
    }
}

/// The server's channels.
pub struct Viewers {
    context: Arc<Context>,
    channels: Vec<Arc<RawChannel>>,
    /// Only this viewer's subscription to this channel is served now, where one is named.
    pub only: Option<(ChannelId, Option<SinkId>)>,
}

impl Viewers {
    /// None yet.
    pub fn new(context: Arc<Context>) -> Viewers {
        Viewers { context, channels: Vec::new(), only: None }
    }

    /// The topic of a channel, by the server's number.
    pub fn topic_of(&self, id: ChannelId) -> Option<&str> {
        self.channels.iter().find(|channel| channel.id() == id).map(|channel| channel.topic())
    }
}

impl Outlet for Viewers {
    type Id = usize;
    type Error = ServeError;

    fn topic(&mut self, topic: Topic<'_>) -> Result<usize, ServeError> {
        // A ring that was made anew with other sizes takes its predecessor's place: viewers know one topic of a name.
        for old in self.channels.iter().filter(|channel| channel.topic() == topic.name) {
            old.close();
        }
        let schema = Schema::new(topic.ros_type, "ros2msg", topic.definition.as_bytes().to_vec());
        let channel = ChannelBuilder::new(topic.name)
            .schema(schema)
            .message_encoding("cdr")
            .metadata(topic.words)
            .context(&self.context)
            .build_raw()?;
        self.channels.push(channel);
        Ok(self.channels.len() - 1)
    }

    fn wants(&self, id: usize) -> bool {
        let channel = self.channels.get(id);
        channel.is_some_and(|channel| channel.has_sinks() && self.only.is_none_or(|(only, _)| only == channel.id()))
    }

    fn message(&mut self, id: usize, message: TopicMessage<'_>) -> Result<(), ServeError> {
        if self.wants(id) {
            let viewer = self.only.and_then(|(_, viewer)| viewer);
            let times = PartialMetadata { log_time: Some(message.ns) };
            self.channels[id].log_with_meta_to_sink(message.data, times, viewer);
        }
        Ok(())
    }
}
