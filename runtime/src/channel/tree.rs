//! A robot's tree of channels: in shared files, or within this process.

use std::path::Path;
use std::sync::Arc;

use super::error::ChannelError;
use super::layout::Geometry;
use super::local::LocalTree;
use super::path;
use super::reader::{Expect, RawReader};
use super::shared::SharedTree;
use super::writer::RawWriter;

/// How a writer comes to its path.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Claim {
    /// The path has no living writer: go on in the same ring, history and all.
    Continue,
    /// The path's writer lives but hangs, says the supervisor: a new ring under the same path carries numbers and
    /// history on, and the old writer writes to nobody.
    Fence,
}

/// A tree of channels. Clones are the same tree.
#[derive(Clone)]
pub struct Tree(Arc<Kind>);

enum Kind {
    Shared(SharedTree),
    Local(LocalTree),
}

impl Tree {
    /// The tree of files under `root`, for example `/dev/shm/sinew/pioneer`. Nothing is made before the first channel.
    /// Fails when the root is there and is no folder of its own (a symbolic link, say).
    pub fn shared(root: &Path) -> Result<Tree, ChannelError> {
        Ok(Tree(Arc::new(Kind::Shared(SharedTree::open(root)?))))
    }

    /// A tree of its own within this process.
    pub fn local() -> Tree {
        Tree(Arc::new(Kind::Local(LocalTree::default())))
    }

    /// Makes the channel whole, if there is none of this geometry. A channel of another geometry is replaced, its
    /// readers are told; it must have no living writer.
    pub fn prepare(&self, path: &str, geometry: &Geometry) -> Result<(), ChannelError> {
        path::parts(path)?;
        match &*self.0 {
            Kind::Shared(tree) => tree.prepare(path, geometry),
            Kind::Local(tree) => tree.prepare(path, geometry),
        }
    }

    /// Becomes the channel's one writer; makes or replaces the channel like [`Tree::prepare`] where needed.
    pub fn writer(&self, path: &str, geometry: &Geometry, claim: Claim) -> Result<RawWriter, ChannelError> {
        path::parts(path)?;
        match &*self.0 {
            Kind::Shared(tree) => tree.writer(path, geometry, claim),
            Kind::Local(tree) => tree.writer(path, geometry, claim),
        }
    }

    /// Opens the channel for reading. With `expect`, only if it carries that layout.
    pub fn reader(&self, path: &str, expect: Option<Expect>) -> Result<RawReader, ChannelError> {
        path::parts(path)?;
        let reader = match &*self.0 {
            Kind::Shared(tree) => tree.reader(path)?,
            Kind::Local(tree) => tree.reader(path)?,
        };
        let found = reader.geometry();
        match expect {
            Some(wanted) if wanted.layout_hash != found.layout_hash || wanted.type_name != found.type_name => {
                Err(ChannelError::Mismatch {
                    path: path.into(),
                    wanted_type: wanted.type_name,
                    wanted_hash: wanted.layout_hash,
                    found_type: found.type_name.clone(),
                    found_hash: found.layout_hash,
                })
            }
            _ => Ok(reader),
        }
    }

    /// The paths of all channels, sorted.
    pub fn list(&self) -> Result<Vec<String>, ChannelError> {
        match &*self.0 {
            Kind::Shared(tree) => tree.list(),
            Kind::Local(tree) => Ok(tree.list()),
        }
    }

    /// The paths of the channels that `pattern` covers, sorted; `*` stands for one part, as in `/actions/*/proposal`.
    pub fn members(&self, pattern: &str) -> Result<Vec<String>, ChannelError> {
        let parts = path::pattern_parts(pattern)?;
        let mut paths = self.list()?;
        paths.retain(|path| path::covers(&parts, path));
        Ok(paths)
    }

    /// Removes the channel, with its lock and the folders that it leaves empty. Its readers are told; a living writer
    /// loses its place.
    pub fn remove(&self, path: &str) -> Result<(), ChannelError> {
        path::parts(path)?;
        match &*self.0 {
            Kind::Shared(tree) => tree.remove(path),
            Kind::Local(tree) => tree.remove(path),
        }
    }

    /// Removes all channels and, of a shared tree, the root. What is not ours stays, and is the error.
    pub fn clear(&self) -> Result<(), ChannelError> {
        match &*self.0 {
            Kind::Shared(tree) => tree.clear(),
            Kind::Local(tree) => {
                tree.clear();
                Ok(())
            }
        }
    }
}
