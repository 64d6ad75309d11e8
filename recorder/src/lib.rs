//! MCAP in and out, replay.
//!
//! A recording is an MCAP file with the profile `ros2`. Every channel of the robot is a topic of the same name, whose
//! messages are CDR of a ROS 2 definition that is generated from the channel's own schema: any ROS 2 reader decodes them,
//! and the bytes of the sample come out of them unchanged ([`exact`]). Where ROS 2 has a message for the same thing, a
//! copy of it stands under `/ros` ([`ros`]).
//!
//! | file | what |
//! |---|---|
//! | `exact`, `definition` | a sample as CDR and back; its ROS 2 definition |
//! | `ros`, `cdr` | copies as messages of sensor_msgs, nav_msgs, geometry_msgs |
//! | `facts` | what a file says about its run: robot file, seed, build, resources |
//! | `taps`, `feed` | from a robot's rings to topics and messages |
//! | `follow` | into any outlet, such as a live view |
//! | `writer`, `sink`, `live` | into a file |
//! | `reader`, `records` | from a file, whole or cut off |
//! | `info`, `recover`, `play`, `pace` | what is in it; saving what is left of it; the paths come alive |
//! | `replay`, `compare`, `difference` | nodes do their recorded steps again, and are compared |

mod cdr;
mod compare;
mod definition;
mod difference;
mod error;
pub mod exact;
pub mod facts;
pub mod feed;
pub mod follow;
mod incidents;
pub mod info;
pub mod live;
mod pace;
pub mod play;
mod plot;
mod reader;
mod records;
pub mod recover;
pub mod replay;
pub mod ros;
mod sink;
mod taps;
mod writer;

pub use compare::{Comparison, NodeComparison, PathComparison};
pub use definition::{definition, topic_type};
pub use difference::FirstDifference;
pub use error::{RecordError, RecordingError};
pub use facts::Facts;
pub use feed::ChannelKey;
pub use pace::Ask;
pub use plot::plot;
pub use reader::{ChannelFacts, Item, Recording};
pub use taps::Taps;
pub use writer::{McapFile, RecordingWriter};
