//! Folders of a shared tree: walked part by part without following symbolic links, made where needed, and trusted for
//! writing only when nobody else can have put something into them.

use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::path::Path;

use rustix::fs::{AtFlags, CWD, Dir, FileType, Mode, OFlags, Stat};
use rustix::io::Errno;

use super::error::ChannelError;

const FLAGS: OFlags = OFlags::DIRECTORY.union(OFlags::NOFOLLOW).union(OFlags::CLOEXEC);

/// Whether folders are made and must be trusted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Purpose {
    Read,
    Write,
}

/// Opens the tree's root; `None` when it is not there and not wanted for writing. Folders above it are made with it.
pub(super) fn open_root(root: &Path, purpose: Purpose) -> Result<Option<OwnedFd>, ChannelError> {
    let shown = root.display().to_string();
    if purpose == Purpose::Write {
        let missing: Vec<&Path> = root.ancestors().take_while(|folder| !is_there(folder)).collect();
        for folder in missing.into_iter().rev() {
            match rustix::fs::mkdirat(CWD, folder, mode()) {
                Ok(()) | Err(Errno::EXIST) => {}
                Err(e) => return Err(ChannelError::full_or(&shown, 4096, CWD, folder, "make folder", e)),
            }
        }
        // Who can rename the root can exchange it.
        if let Some(parent) = root.parent().filter(|parent| !parent.as_os_str().is_empty()) {
            let stat = rustix::fs::stat(parent).map_err(|e| system(&shown, "look at the folder above", e))?;
            trust(&parent.display().to_string(), &stat)?;
        }
    }
    match rustix::fs::openat(CWD, root, FLAGS, Mode::empty()) {
        Ok(folder) => {
            if purpose == Purpose::Write {
                trust(&shown, &stat(folder.as_fd(), &shown)?)?;
            }
            Ok(Some(folder))
        }
        Err(Errno::NOENT) if purpose == Purpose::Read => Ok(None),
        Err(Errno::LOOP | Errno::NOTDIR) => Err(untrusted(&shown, "it must be a folder and no symbolic link")),
        Err(e) => Err(system(&shown, "open", e)),
    }
}

/// Opens the folder `name` in `parent`; `None` when it is not there and not wanted for writing. `path` is the channel's.
pub(super) fn open_in(
    parent: BorrowedFd<'_>,
    name: &str,
    purpose: Purpose,
    path: &str,
) -> Result<Option<OwnedFd>, ChannelError> {
    if purpose == Purpose::Write {
        match rustix::fs::mkdirat(parent, name, mode()) {
            Ok(()) | Err(Errno::EXIST) => {}
            Err(e) => return Err(ChannelError::full_or(path, 4096, parent, ".".as_ref(), "make the folders of", e)),
        }
    }
    match rustix::fs::openat(parent, name, FLAGS, Mode::empty()) {
        Ok(folder) => {
            if purpose == Purpose::Write {
                trust(path, &stat(folder.as_fd(), path)?)?;
            }
            Ok(Some(folder))
        }
        Err(Errno::NOENT) if purpose == Purpose::Read => Ok(None),
        Err(Errno::NOTDIR) if purpose == Purpose::Read && !is_link(parent, name) => Ok(None),
        Err(Errno::NOTDIR) if !is_link(parent, name) => Err(ChannelError::in_the_way(path, name)),
        Err(Errno::LOOP | Errno::NOTDIR) => Err(untrusted(path, &format!("\"{name}\" on its way is a symbolic link"))),
        Err(e) => Err(system(path, "open the folders of", e)),
    }
}

/// Names and kinds in a folder, sorted; hidden ones too.
pub(super) fn entries(folder: BorrowedFd<'_>, path: &str) -> Result<Vec<(String, FileType)>, ChannelError> {
    let failed = |e| system(path, "list", e);
    let mut entries = Vec::new();
    for entry in Dir::read_from(folder).map_err(failed)? {
        let entry = entry.map_err(failed)?;
        // Names that are no text are not ours.
        let Ok(name) = entry.file_name().to_str() else { continue };
        if name == "." || name == ".." {
            continue;
        }
        let kind = match entry.file_type() {
            FileType::Unknown => rustix::fs::statat(folder, name, AtFlags::SYMLINK_NOFOLLOW)
                .map_or(FileType::Unknown, |stat| FileType::from_raw_mode(stat.st_mode)),
            kind => kind,
        };
        entries.push((name.to_owned(), kind));
    }
    entries.sort_by(|a, b| a.0.cmp(&b.0));
    Ok(entries)
}

/// What the system knows about an open file.
pub(super) fn stat(file: BorrowedFd<'_>, path: &str) -> Result<Stat, ChannelError> {
    rustix::fs::fstat(file).map_err(|e| system(path, "look at", e))
}

pub(super) fn system(path: &str, doing: &'static str, error: Errno) -> ChannelError {
    ChannelError::System { path: path.into(), doing, source: error.into() }
}

pub(super) fn untrusted(path: &str, why: &str) -> ChannelError {
    ChannelError::Untrusted { path: path.into(), why: why.into() }
}

/// Refuses a folder in which somebody else could exchange our files.
fn trust(path: &str, stat: &Stat) -> Result<(), ChannelError> {
    let me = rustix::process::geteuid().as_raw();
    if stat.st_uid != me && stat.st_uid != 0 {
        let why = format!("its folder belongs to user {}, not to user {me} or root; choose another root", stat.st_uid);
        return Err(untrusted(path, &why));
    }
    let mode = Mode::from_raw_mode(stat.st_mode);
    if mode.contains(Mode::WOTH) && !mode.contains(Mode::SVTX) {
        return Err(untrusted(path, "everybody may write its folder; chmod o-w it"));
    }
    Ok(())
}

fn mode() -> Mode {
    Mode::RWXU | Mode::RGRP | Mode::XGRP | Mode::ROTH | Mode::XOTH
}

fn is_there(folder: &Path) -> bool {
    folder.as_os_str().is_empty() || rustix::fs::statat(CWD, folder, AtFlags::SYMLINK_NOFOLLOW).is_ok()
}

fn is_link(parent: BorrowedFd<'_>, name: &str) -> bool {
    rustix::fs::statat(parent, name, AtFlags::SYMLINK_NOFOLLOW)
        .is_ok_and(|stat| FileType::from_raw_mode(stat.st_mode) == FileType::Symlink)
}
