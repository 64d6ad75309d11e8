//! Channels in files: made whole before they get their name, never resized.
//!
//! `ftruncate` succeeds on a full tmpfs and the first write dies; so the space is allocated first, and the ring is
//! renamed into place when it is complete. Whatever is wrong with a ring, its next writer puts a new one in its place.

use std::fs::File;
use std::os::fd::{AsFd, AsRawFd, BorrowedFd, OwnedFd};
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};

use rustix::fs::{AtFlags, FileType, Mode, OFlags};
use rustix::io::Errno;

use super::atomic::AtomicU64;
use super::error::ChannelError;
use super::folder::{self, Purpose, system};
use super::image::Image;
use super::layout::{self, Geometry};
use super::lock::{self, Lock};
use super::memory::Memory;
use super::path;
use super::reader::RawReader;
use super::succession::{self, Start};
use super::tree::Claim;
use super::writer::RawWriter;

/// The longest header that is looked at, in bytes: schemas are text of a few kilobytes.
const MOST_HEADER_BYTES: u64 = 16 << 20;

/// The root of the files.
pub(super) struct SharedTree {
    root: PathBuf,
}

/// A channel's folder and its name in it.
struct Place<'a> {
    folder: OwnedFd,
    name: &'a str,
    path: &'a str,
}

/// An open ring.
struct Ring {
    image: Image,
    geometry: Geometry,
    file: File,
}

/// A ring that has no name yet; vanishes unless it gets one.
struct Fresh<'a> {
    image: Image,
    geometry: Geometry,
    name: Hidden<'a>,
}

/// The hidden name of an unfinished file.
struct Hidden<'a> {
    folder: BorrowedFd<'a>,
    name: String,
}

impl Drop for Hidden<'_> {
    fn drop(&mut self) {
        // Where the file got its real name there is nothing under this one.
        let _ = rustix::fs::unlinkat(self.folder, &self.name, AtFlags::empty());
    }
}

impl SharedTree {
    pub fn open(root: &Path) -> Result<SharedTree, ChannelError> {
        folder::open_root(root, Purpose::Read)?;
        Ok(SharedTree { root: root.into() })
    }

    pub fn prepare(&self, path: &str, geometry: &Geometry) -> Result<(), ChannelError> {
        geometry.shape_for(path)?;
        let place = self.place(path, Purpose::Write)?;
        let fits = |ring: &Ring| ring.geometry == *geometry && ring.image.retired() == 0;
        if place.existing()?.as_ref().is_some_and(fits) {
            return Ok(());
        }
        let _lock = Lock::take(place.folder.as_fd(), place.name, path)?;
        place.put(place.make(geometry)?).map(drop)
    }

    pub fn writer(&self, path: &str, geometry: &Geometry, claim: Claim) -> Result<RawWriter, ChannelError> {
        geometry.shape_for(path)?;
        let place = self.place(path, Purpose::Write)?;
        let folder = place.folder.as_fd();
        let (lock, image, start) = match claim {
            Claim::Continue => {
                let lock = Lock::take(folder, place.name, path)?;
                let fitting = place.existing()?.filter(|ring| ring.geometry == *geometry);
                match fitting.and_then(|ring| Some((resume(&ring.image)?, ring.image))) {
                    Some((start, image)) => (lock, image, Some(start)),
                    None => (lock, place.put(place.make(geometry)?)?, None),
                }
            }
            Claim::Fence => {
                // The ring first: a fence that fails for want of space has taken nothing from anybody.
                let fresh = place.make(geometry)?;
                let lock = Lock::seize(folder, place.name, path)?;
                (lock, place.put(fresh)?, None)
            }
        };
        // A ring that was just made has nothing that could keep it from being resumed.
        let start = start.or_else(|| resume(&image)).unwrap_or(Start { next: 1, generation: 1 });
        Ok(RawWriter::new(image, start, Box::new(lock)))
    }

    pub fn reader(&self, path: &str) -> Result<RawReader, ChannelError> {
        let ring = self.find(path)?.open(false)?;
        let ring = ring.ok_or_else(|| ChannelError::Missing { path: path.into() })?;
        Ok(RawReader::new(ring.image, ring.geometry, Some(ring.file)))
    }

    pub fn list(&self) -> Result<Vec<String>, ChannelError> {
        let mut paths = Vec::new();
        if let Some(root) = folder::open_root(&self.root, Purpose::Read)? {
            collect(root.as_fd(), "", &mut paths)?;
        }
        paths.sort();
        Ok(paths)
    }

    pub fn remove(&self, path: &str) -> Result<(), ChannelError> {
        let place = self.find(path)?;
        if !place.is_file() {
            return Err(ChannelError::Missing { path: path.into() });
        }
        place.remove()?;
        // Folders that are empty now go too, the root excepted.
        let parts = path::parts(path)?;
        for depth in (1..parts.len()).rev() {
            let above = self.folder(&parts[..depth - 1], Purpose::Read, path)?;
            let emptied = above.map(|above| rustix::fs::unlinkat(above, parts[depth - 1], AtFlags::REMOVEDIR));
            if !matches!(emptied, Some(Ok(()))) {
                break;
            }
        }
        Ok(())
    }

    pub fn clear(&self) -> Result<(), ChannelError> {
        let Some(root) = folder::open_root(&self.root, Purpose::Read)? else { return Ok(()) };
        clear(root.as_fd(), "")?;
        match rustix::fs::rmdir(&self.root) {
            Ok(()) | Err(Errno::NOENT) => Ok(()),
            Err(Errno::NOTEMPTY | Errno::EXIST) => {
                Err(folder::untrusted(&self.root.display().to_string(), "it has files that are no channels; they stay"))
            }
            Err(e) => Err(system(&self.root.display().to_string(), "remove folder", e)),
        }
    }

    fn find<'a>(&self, path: &'a str) -> Result<Place<'a>, ChannelError> {
        self.place(path, Purpose::Read)
    }

    fn place<'a>(&self, path: &'a str, purpose: Purpose) -> Result<Place<'a>, ChannelError> {
        let mut parts = path::parts(path)?;
        let missing = || ChannelError::Missing { path: path.into() };
        let name = parts.pop().ok_or_else(missing)?;
        let folder = self.folder(&parts, purpose, path)?.ok_or_else(missing)?;
        Ok(Place { folder, name, path })
    }

    fn folder(&self, parts: &[&str], purpose: Purpose, path: &str) -> Result<Option<OwnedFd>, ChannelError> {
        let mut folder = folder::open_root(&self.root, purpose)?;
        for part in parts {
            let Some(above) = folder else { return Ok(None) };
            folder = folder::open_in(above.as_fd(), part, purpose, path)?;
        }
        Ok(folder)
    }
}

impl Place<'_> {
    /// The ring that a writer finds: none, also when what is there is none or damaged.
    fn existing(&self) -> Result<Option<Ring>, ChannelError> {
        match self.open(true) {
            Err(ChannelError::NotAChannel { .. }) => Ok(None),
            other => other,
        }
    }

    /// Opens the ring; `None` when there is no file.
    fn open(&self, writable: bool) -> Result<Option<Ring>, ChannelError> {
        let access = if writable { OFlags::RDWR } else { OFlags::RDONLY };
        // NONBLOCK: a fifo under this name must not hold us up.
        let flags = access | OFlags::NOFOLLOW | OFlags::CLOEXEC | OFlags::NONBLOCK;
        let file = match rustix::fs::openat(&self.folder, self.name, flags, Mode::empty()) {
            Ok(file) => File::from(file),
            Err(Errno::NOENT) => return Ok(None),
            Err(Errno::ISDIR) => return Err(ChannelError::in_the_way(self.path, "a folder")),
            Err(Errno::LOOP) => return Err(folder::untrusted(self.path, "it is a symbolic link")),
            Err(e) => return Err(system(self.path, "open channel", e)),
        };
        let stat = folder::stat(file.as_fd(), self.path)?;
        match FileType::from_raw_mode(stat.st_mode) {
            FileType::RegularFile => {}
            FileType::Directory => return Ok(None),
            _ => return Err(folder::untrusted(self.path, "it is no regular file")),
        }
        let not = |why: String| ChannelError::NotAChannel { path: self.path.into(), why };
        let size = u64::try_from(stat.st_size).unwrap_or(0);
        let header = read_header(&file, size).map_err(|e| system(self.path, "read the header of", e))?;
        let (geometry, shape) = layout::parse(&header, size / 8).map_err(not)?;
        // A file with holes is no work of ours; looking at a hole would allocate it.
        let whole = u64::try_from(stat.st_blocks).is_ok_and(|blocks| blocks * 512 >= shape.total_bytes() as u64);
        let memory = Memory::map(&file, shape.total_words(), writable, whole)
            .map_err(|source| ChannelError::System { path: self.path.into(), doing: "map channel", source })?;
        Ok(Some(Ring { image: Image::of(memory, shape), geometry, file }))
    }

    /// A new, empty ring under a hidden name, its space allocated. Changes nothing that anybody can see.
    fn make(&self, geometry: &Geometry) -> Result<Fresh<'_>, ChannelError> {
        self.remove_unfinished()?;
        let shape = geometry.shape_for(self.path)?;
        let bytes = shape.total_bytes() as u64;
        let full_or = |doing, e| ChannelError::full_or(self.path, bytes, self.folder.as_fd(), ".".as_ref(), doing, e);
        let name = format!(".{}.{}.new", self.name, std::process::id());
        let flags = OFlags::RDWR | OFlags::CREATE | OFlags::EXCL | OFlags::NOFOLLOW | OFlags::CLOEXEC;
        // Its writer's own to write; the robot's group reads.
        let mode = Mode::RUSR | Mode::WUSR | Mode::RGRP;
        let file = rustix::fs::openat(&self.folder, &name, flags, mode).map_err(|e| full_or("make channel", e))?;
        let name = Hidden { folder: self.folder.as_fd(), name };
        let file = File::from(file);
        allocate(&file, bytes).map_err(|e| full_or("allocate channel", e))?;
        let memory = Memory::map(&file, shape.total_words(), true, true).map_err(|source| ChannelError::System {
            path: self.path.into(),
            doing: "map channel",
            source,
        })?;
        let now = rustix::time::clock_gettime(rustix::time::ClockId::Monotonic);
        let created_ns = now.tv_sec as u64 * 1_000_000_000 + now.tv_nsec as u64;
        Ok(Fresh { image: Image::format(memory, geometry, shape, created_ns), geometry: geometry.clone(), name })
    }

    /// Puts the new ring under the channel's name; it carries on what it can of the one that is there. Needs the lock.
    fn put(&self, fresh: Fresh<'_>) -> Result<Image, ChannelError> {
        let old = self.existing()?;
        if let Some(old) = &old {
            // First, so that what a hanging writer adds while its ring is copied counts for nobody.
            succession::retire(&old.image);
            succession::inherit(&old.image, &old.geometry, &fresh.image, &fresh.geometry);
        }
        let named = rustix::fs::renameat(&self.folder, &fresh.name.name, &self.folder, self.name);
        // After the renaming: whoever wakes finds the successor.
        if let Some(old) = &old {
            old.image.wake();
        }
        match named {
            Ok(()) => Ok(fresh.image),
            Err(Errno::ISDIR) => Err(ChannelError::in_the_way(self.path, "a folder")),
            Err(e) => Err(system(self.path, "name the new file of", e)),
        }
    }

    /// Removes what makers that died left.
    fn remove_unfinished(&self) -> Result<(), ChannelError> {
        let begin = format!(".{}.", self.name);
        for (name, _) in folder::entries(self.folder.as_fd(), self.path)? {
            if name.strip_prefix(&begin).is_some_and(is_unfinished) {
                let _ = rustix::fs::unlinkat(&self.folder, &name, AtFlags::empty());
            }
        }
        Ok(())
    }

    fn is_file(&self) -> bool {
        rustix::fs::statat(&self.folder, self.name, AtFlags::SYMLINK_NOFOLLOW)
            .is_ok_and(|stat| FileType::from_raw_mode(stat.st_mode) == FileType::RegularFile)
    }

    fn remove(&self) -> Result<(), ChannelError> {
        let old = self.existing()?;
        if let Some(old) = &old {
            succession::retire(&old.image);
        }
        self.remove_unfinished()?;
        for name in [self.name, &lock::file_name(self.name)] {
            match rustix::fs::unlinkat(&self.folder, name, AtFlags::empty()) {
                Ok(()) | Err(Errno::NOENT) => {}
                Err(e) => return Err(system(self.path, "remove", e)),
            }
        }
        if let Some(old) = &old {
            old.image.wake();
        }
        Ok(())
    }
}

fn resume(image: &Image) -> Option<Start> {
    succession::resume(image, std::process::id())
}

/// Whether the end of a hidden name, `<pid>.new` or `<pid>.newlock`, is that of a file still in the making.
fn is_unfinished(end: &str) -> bool {
    let pid = end.strip_suffix(".new").or_else(|| end.strip_suffix(".newlock"));
    pid.is_some_and(|pid| !pid.is_empty() && pid.bytes().all(|b| b.is_ascii_digit()))
}

/// The header's words, as far as there are any.
fn read_header(file: &File, size: u64) -> Result<Vec<AtomicU64>, Errno> {
    let read = |bytes: u64| {
        let mut buffer = vec![0; bytes as usize];
        file.read_exact_at(&mut buffer, 0).map_err(|e| Errno::from_io_error(&e).unwrap_or(Errno::IO))?;
        let (words, _) = buffer.as_chunks::<8>();
        Ok(words.iter().map(|&word| AtomicU64::new(u64::from_le_bytes(word))).collect::<Vec<_>>())
    };
    let first = read(size.min(layout::LEAST_WORDS as u64 * 8))?;
    let stated = layout::stated_header_bytes(&first).min(size).min(MOST_HEADER_BYTES);
    if stated <= first.len() as u64 * 8 { Ok(first) } else { read(stated) }
}

/// Gives the file its size and its space, or fails and changes nothing that lasts.
fn allocate(file: &File, bytes: u64) -> Result<(), Errno> {
    let length = libc::off_t::try_from(bytes).map_err(|_| Errno::FBIG)?;
    loop {
        // SAFETY: the descriptor is open; nothing else is passed.
        match unsafe { libc::posix_fallocate(file.as_raw_fd(), 0, length) } {
            0 => return Ok(()),
            libc::EINTR => continue,
            errno => return Err(Errno::from_raw_os_error(errno)),
        }
    }
}

/// Adds the paths of all channels below `folder`, whose own path is `above`.
fn collect(folder: BorrowedFd<'_>, above: &str, paths: &mut Vec<String>) -> Result<(), ChannelError> {
    for (name, kind) in folder::entries(folder, above)? {
        let path = format!("{above}/{name}");
        if !path::is_part(&name) {
            continue;
        }
        match kind {
            FileType::RegularFile => paths.push(path),
            FileType::Directory => {
                if let Some(inner) = folder::open_in(folder, &name, Purpose::Read, &path)? {
                    collect(inner.as_fd(), &path, paths)?;
                }
            }
            _ => {}
        }
    }
    Ok(())
}

/// Removes all channels below `folder` and the folders that this leaves empty; leaves what is not ours.
fn clear(folder: BorrowedFd<'_>, above: &str) -> Result<(), ChannelError> {
    let entries = folder::entries(folder, above)?;
    for (name, kind) in &entries {
        let path = format!("{above}/{name}");
        if !path::is_part(name) {
            continue;
        }
        if *kind == FileType::Directory {
            if let Some(inner) = folder::open_in(folder, name, Purpose::Read, &path)? {
                clear(inner.as_fd(), &path)?;
            }
            let _ = rustix::fs::unlinkat(folder, name, AtFlags::REMOVEDIR);
            continue;
        }
        let own = |e: Errno| system(&path, "open the folder of", e);
        let place = Place { folder: rustix::io::fcntl_dupfd_cloexec(folder, 0).map_err(own)?, name, path: &path };
        // A damaged ring is known by its lock.
        let locked = entries.iter().any(|(other, _)| *other == lock::file_name(name));
        if *kind == FileType::RegularFile && (locked || matches!(place.open(false), Ok(Some(_)))) {
            place.remove()?;
        }
    }
    // What is left of channels that were never finished or are gone.
    for (name, kind) in &entries {
        let ours =
            name.starts_with('.') && (name.ends_with(".lock") || name.rsplit_once('.').is_some_and(|_| hidden(name)));
        if *kind == FileType::RegularFile && ours {
            let _ = rustix::fs::unlinkat(folder, name, AtFlags::empty());
        }
    }
    Ok(())
}

/// Whether a hidden name is that of a file still in the making.
fn hidden(name: &str) -> bool {
    let mut parts = name.rsplitn(3, '.');
    let (end, pid) = (parts.next().unwrap_or_default(), parts.next().unwrap_or_default());
    is_unfinished(&format!("{pid}.{end}"))
}
