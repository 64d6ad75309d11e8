//! Channels of one process: the same rings on the heap. The simulated host's tree, and the test bench's.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};

use super::error::ChannelError;
use super::image::Image;
use super::layout::Geometry;
use super::memory::Memory;
use super::path;
use super::reader::RawReader;
use super::succession::{self, Start};
use super::tree::Claim;
use super::writer::RawWriter;

/// The rings by path.
#[derive(Default)]
pub(super) struct LocalTree {
    channels: Mutex<BTreeMap<String, Channel>>,
}

struct Channel {
    image: Image,
    geometry: Geometry,
    /// Alive as long as the writer is.
    place: Weak<()>,
}

impl LocalTree {
    pub fn prepare(&self, path: &str, geometry: &Geometry) -> Result<(), ChannelError> {
        let mut channels = self.channels();
        if channels.get(path).is_some_and(|channel| channel.geometry == *geometry && channel.image.retired() == 0) {
            return Ok(());
        }
        free(&channels, path)?;
        renew(&mut channels, path, geometry).map(drop)
    }

    pub fn writer(&self, path: &str, geometry: &Geometry, claim: Claim) -> Result<RawWriter, ChannelError> {
        let mut channels = self.channels();
        if claim == Claim::Continue {
            free(&channels, path)?;
        }
        let start = match channels.get(path) {
            Some(channel) if claim == Claim::Continue && channel.geometry == *geometry => resume(&channel.image),
            _ => None,
        };
        let start = match start {
            Some(start) => start,
            // A ring that was just made has nothing that could keep it from being resumed.
            None => resume(renew(&mut channels, path, geometry)?).unwrap_or(Start { next: 1, generation: 1 }),
        };
        let Some(channel) = channels.get_mut(path) else { return Err(ChannelError::Missing { path: path.into() }) };
        let place = Arc::new(());
        channel.place = Arc::downgrade(&place);
        Ok(RawWriter::new(channel.image.clone(), start, Box::new(place)))
    }

    pub fn reader(&self, path: &str) -> Result<RawReader, ChannelError> {
        let channels = self.channels();
        let channel = channels.get(path).ok_or_else(|| ChannelError::Missing { path: path.into() })?;
        Ok(RawReader::new(channel.image.clone(), channel.geometry.clone(), None))
    }

    pub fn list(&self) -> Vec<String> {
        self.channels().keys().cloned().collect()
    }

    pub fn remove(&self, path: &str) -> Result<(), ChannelError> {
        let channel = self.channels().remove(path).ok_or_else(|| ChannelError::Missing { path: path.into() })?;
        succession::retire(&channel.image);
        channel.image.wake();
        Ok(())
    }

    pub fn clear(&self) {
        for channel in std::mem::take(&mut *self.channels()).into_values() {
            succession::retire(&channel.image);
            channel.image.wake();
        }
    }

    fn channels(&self) -> MutexGuard<'_, BTreeMap<String, Channel>> {
        self.channels.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

fn resume(image: &Image) -> Option<Start> {
    succession::resume(image, std::process::id())
}

fn free(channels: &BTreeMap<String, Channel>, path: &str) -> Result<(), ChannelError> {
    match channels.get(path) {
        Some(channel) if channel.place.strong_count() > 0 => {
            Err(ChannelError::Held { path: path.into(), holder: Some(std::process::id()) })
        }
        _ => Ok(()),
    }
}

/// Puts a new ring under the path; its predecessor's readers are told.
fn renew<'a>(
    channels: &'a mut BTreeMap<String, Channel>,
    path: &str,
    geometry: &Geometry,
) -> Result<&'a Image, ChannelError> {
    let shape = geometry.shape_for(path)?;
    // As in a file system, a name is a channel or a folder.
    if let Some(other) = channels.keys().find(|&other| path::nested(path, other)) {
        return Err(ChannelError::in_the_way(path, other));
    }
    let image = Image::format(Memory::heap(shape.total_words()), geometry, shape, 0);
    let old = channels.remove(path);
    if let Some(old) = &old {
        succession::retire(&old.image);
        succession::inherit(&old.image, &old.geometry, &image, geometry);
    }
    let channel = Channel { image, geometry: geometry.clone(), place: Weak::new() };
    let image = &channels.entry(path.into()).insert_entry(channel).into_mut().image;
    if let Some(old) = old {
        old.image.wake();
    }
    Ok(image)
}
