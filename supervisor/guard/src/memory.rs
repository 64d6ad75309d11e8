//! Memory that outlives its writers: sealed memfds, mapped as 64-bit atomic words.
//!
//! A sealed memfd cannot be cut off under its map (a file in /dev/shm can, and kills its readers by SIGBUS).

use std::io;
use std::os::fd::{AsFd, OwnedFd};
use std::sync::atomic::{AtomicU32, AtomicU64};

use rustix::fs::{MemfdFlags, Mode, SealFlags, fchmod, fcntl_add_seals, ftruncate, memfd_create};
use rustix::io::Errno;

use crate::sys;

/// A memfd of `bytes` zeros whose size nobody can change. Whoever is handed a read-only descriptor cannot open it anew for
/// writing unless it is this user or root: a memfd is born with a mode that lets everyone.
pub fn make_memfd(name: &str, bytes: usize) -> io::Result<OwnedFd> {
    let memfd = memfd_create(name, MemfdFlags::CLOEXEC | MemfdFlags::ALLOW_SEALING)?;
    fchmod(&memfd, Mode::RUSR | Mode::WUSR)?;
    ftruncate(&memfd, bytes as u64)?;
    fcntl_add_seals(&memfd, SealFlags::SHRINK | SealFlags::GROW | SealFlags::SEAL)?;
    Ok(memfd)
}

/// Words of a sealed memfd. They stay mapped until the process ends: there are three such maps in a process, for good.
#[derive(Debug, Clone, Copy)]
pub struct Words(&'static [AtomicU64]);

impl Words {
    /// Maps `count` words of `memfd`.
    pub fn map(memfd: impl AsFd, count: usize, writable: bool) -> io::Result<Words> {
        let memfd = memfd.as_fd();
        let sealed = rustix::fs::fcntl_get_seals(memfd).unwrap_or(SealFlags::empty());
        if !sealed.contains(SealFlags::SHRINK) {
            return Err(io::Error::other("not a sealed memfd: its size could change under the map"));
        }
        if rustix::fs::fstat(memfd)?.st_size < (count * 8) as i64 {
            return Err(Errno::INVAL.into());
        }
        sys::map_words(memfd, count, writable).map(Words)
    }

    /// Words of this process alone, for the simulated host and tests.
    pub fn local(count: usize) -> Words {
        let zeros: Box<[AtomicU64]> = (0..count).map(|_| AtomicU64::new(0)).collect();
        Words(Box::leak(zeros))
    }

    /// All of them.
    #[inline]
    pub fn all(&self) -> &'static [AtomicU64] {
        self.0
    }

    /// The low half of a word, as a futex.
    #[inline]
    pub(crate) fn futex(&self, index: usize) -> &'static AtomicU32 {
        sys::low_half(&self.0[index])
    }
}
