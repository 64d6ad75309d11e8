//! What can go wrong with writing and with reading a recording.

use std::io;
use std::path::PathBuf;

/// Why a recording ended or never began.
#[derive(Debug, thiserror::Error)]
pub enum RecordError {
    /// The file cannot be made.
    #[error("cannot make {file}: {source}; choose another file with -o")]
    Create {
        /// The file.
        file: PathBuf,
        /// The system's reason.
        source: io::Error,
    },
    /// There is such a file.
    #[error("{file} is there already, and a recording replaces nothing: choose another file with -o")]
    Exists {
        /// The file.
        file: PathBuf,
    },
    /// The disk is full. What was written before can be read.
    #[error(
        "the disk of {file} is full: recording stopped after {written_bytes} bytes, the robot goes on; \
         `sinew recover` saves what is in the file"
    )]
    DiskFull {
        /// The file.
        file: PathBuf,
        /// Bytes that are in it.
        written_bytes: u64,
    },
    /// The file has the greatest size that it may have. What was written before can be read.
    #[error(
        "{file} may not grow beyond {written_bytes} bytes (`ulimit -f`, or its file system): recording stopped, the robot \
         goes on; `sinew recover` saves what is in the file"
    )]
    TooLarge {
        /// The file.
        file: PathBuf,
        /// Bytes that are in it.
        written_bytes: u64,
    },
    /// The file cannot be written.
    #[error("cannot write {file}: {reason}; recording stopped, the robot goes on")]
    Write {
        /// The file.
        file: PathBuf,
        /// Why.
        reason: String,
    },
    /// A channel's own description is damaged.
    #[error("the schema of {path} cannot be read: {why}; recording stopped, the robot goes on")]
    Schema {
        /// The channel.
        path: String,
        /// What is wrong with it.
        why: String,
    },
    /// The robot's channels cannot be looked at.
    #[error(transparent)]
    Channels(#[from] runtime::channel::ChannelError),
}

/// Why a file cannot be read as a recording.
#[derive(Debug, thiserror::Error)]
pub enum RecordingError {
    /// The file cannot be opened or read.
    #[error("cannot read {file}: {source}")]
    Io {
        /// The file.
        file: PathBuf,
        /// The system's reason.
        source: io::Error,
    },
    /// It is empty.
    #[error("{file} is empty: nothing was recorded in it")]
    Empty {
        /// The file.
        file: PathBuf,
    },
    /// It is no MCAP file.
    #[error("{file} is no recording: it does not begin as an MCAP file does")]
    NotMcap {
        /// The file.
        file: PathBuf,
    },
    /// It ends before its end.
    #[error("{file} is cut off at byte {at_byte}; `sinew recover {file} -o FILE` saves what is whole")]
    Truncated {
        /// The file.
        file: PathBuf,
        /// Where the whole part ends.
        at_byte: u64,
    },
    /// Something in it is damaged.
    #[error("{file} is damaged at byte {at_byte}: {why}; `sinew recover {file} -o FILE` saves what is whole before")]
    Corrupt {
        /// The file.
        file: PathBuf,
        /// Where.
        at_byte: u64,
        /// What is wrong.
        why: String,
    },
    /// An MCAP file of another program.
    #[error("{file} is an MCAP file, but not of Sinew ({library}): it has no record of a robot's run")]
    Foreign {
        /// The file.
        file: PathBuf,
        /// The program that wrote it.
        library: String,
    },
    /// Written by a later Sinew.
    #[error("{file} has format {format}, this program knows up to {known}: read it with a newer sinew")]
    Newer {
        /// The file.
        file: PathBuf,
        /// Its format.
        format: u32,
        /// The newest that this program knows.
        known: u32,
    },
    /// A channel without what is needed to read it.
    #[error("{file}: channel {path} cannot be read: {why}")]
    Channel {
        /// The file.
        file: PathBuf,
        /// The channel.
        path: String,
        /// What is missing or wrong.
        why: String,
    },
}
