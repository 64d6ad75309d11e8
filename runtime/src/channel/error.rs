//! What can go wrong with a channel as a whole; what can go wrong with one sample is [`ReadError`].

use std::fmt;
use std::os::fd::BorrowedFd;
use std::path::Path;

use rustix::fs::{Mode, OFlags};
use rustix::io::Errno;

/// Why a channel cannot be made, opened or removed.
#[derive(Debug, thiserror::Error)]
pub enum ChannelError {
    /// The text is no path.
    #[error("\"{path}\" is no channel path: {why}")]
    BadPath {
        /// As given.
        path: String,
        /// What is wrong with it.
        why: String,
    },
    /// No ring can have this geometry.
    #[error("channel {path} cannot be made: {why}")]
    BadGeometry {
        /// The channel.
        path: String,
        /// What is wrong with it.
        why: String,
    },
    /// Nobody has made the channel.
    #[error("channel {path} does not exist: no writer has made it yet (`sinew ls` lists what there is)")]
    Missing {
        /// The channel.
        path: String,
    },
    /// Another writer lives.
    #[error("channel {path} has a writer already, {}: a path has exactly one; stop that one first", Holder(*.holder))]
    Held {
        /// The channel.
        path: String,
        /// The process that holds the lock, where the kernel tells.
        holder: Option<u32>,
    },
    /// The channel carries another type than its reader expects.
    #[error(
        "channel {path} carries {found_type} (layout {found_hash:016x}), its reader expects {wanted_type} \
         (layout {wanted_hash:016x}): build both from the same messages, or wire another path"
    )]
    Mismatch {
        /// The channel.
        path: String,
        /// Type that the reader expects.
        wanted_type: String,
        /// Its layout hash.
        wanted_hash: u64,
        /// Type that the channel carries.
        found_type: String,
        /// Its layout hash.
        found_hash: u64,
    },
    /// There is something under the path, but no channel.
    #[error("{path} is no channel that this program can read: {why}")]
    NotAChannel {
        /// The channel or file.
        path: String,
        /// What is wrong with it.
        why: String,
    },
    /// The file system is full.
    #[error(
        "no space for channel {path}: it needs {wanted_bytes} bytes, {free_bytes} are free; lower its depth or tail in \
         the robot file, remove another robot's files (`sinew down`), or give /dev/shm more (mount -o remount,size=…)"
    )]
    NoSpace {
        /// The channel.
        path: String,
        /// Size of the ring, in bytes.
        wanted_bytes: u64,
        /// Free where the tree lives, in bytes.
        free_bytes: u64,
    },
    /// The tree could be tampered with.
    #[error("{path} cannot be trusted: {why}")]
    Untrusted {
        /// File or folder.
        path: String,
        /// What is wrong with it.
        why: String,
    },
    /// The system refused.
    #[error("cannot {doing} {path}: {source}")]
    System {
        /// File or channel.
        path: String,
        /// What was being done.
        doing: &'static str,
        /// The system's reason.
        source: std::io::Error,
    },
}

impl ChannelError {
    /// `path` cannot be a channel because `other` is in its way.
    pub(super) fn in_the_way(path: &str, other: &str) -> ChannelError {
        let why = format!("{other} is in its way: a name is a channel or a folder of channels, not both");
        ChannelError::BadPath { path: path.into(), why }
    }

    /// The refusal `error`, told as want of space where it is one; `near` in `folder` is where the space would be.
    pub(super) fn full_or(
        path: &str,
        wanted_bytes: u64,
        folder: BorrowedFd<'_>,
        near: &Path,
        doing: &'static str,
        error: Errno,
    ) -> ChannelError {
        if !matches!(error, Errno::NOSPC | Errno::DQUOT | Errno::FBIG) {
            return ChannelError::System { path: path.into(), doing, source: error.into() };
        }
        let near = near.ancestors().find_map(|near| {
            let near = rustix::fs::openat(folder, near, OFlags::PATH | OFlags::CLOEXEC, Mode::empty()).ok()?;
            rustix::fs::fstatvfs(near).ok()
        });
        let free_bytes = near.map_or(0, |space| space.f_bavail * space.f_frsize);
        ChannelError::NoSpace { path: path.into(), wanted_bytes, free_bytes }
    }
}

struct Holder(Option<u32>);

impl fmt::Display for Holder {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            Some(pid) if pid == std::process::id() => write!(f, "in this process ({pid})"),
            Some(pid) => write!(f, "process {pid}"),
            None => write!(f, "in a process that is not visible from here"),
        }
    }
}

/// Why a sample cannot be had. None of these is worth a second try with the same sequence number, but `NotYet`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum ReadError {
    /// It has not been written.
    #[error("not written yet")]
    NotYet,
    /// A later sample has taken its place.
    #[error("overwritten by a later sample")]
    Overrun,
    /// Its writer died in the middle of it.
    #[error("never finished: its writer died while writing it")]
    Unfinished,
    /// The file was cut off under the map; open the path again.
    #[error("the channel's file was damaged under its readers")]
    Fault,
    /// The buffer was made for another geometry.
    #[error("the buffer was made for a channel of another geometry")]
    Buffer,
}
