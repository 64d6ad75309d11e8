//! Folders that nobody else can exchange: who owns them, who may write to them, and that they are no links.

use std::fs::{self, DirBuilder};
use std::io::{self, ErrorKind};
use std::os::unix::fs::{DirBuilderExt, MetadataExt};
use std::path::Path;

use crate::claim::ClaimError;

/// Whether the folder had to be made.
pub fn make_folder(path: &Path, mode: u32, with_parents: bool) -> io::Result<bool> {
    match DirBuilder::new().mode(mode).recursive(false).create(path) {
        Ok(()) => Ok(true),
        Err(error) if error.kind() == ErrorKind::AlreadyExists => Ok(false),
        Err(error) if error.kind() == ErrorKind::NotFound && with_parents => {
            DirBuilder::new().mode(mode).recursive(true).create(path).map(|()| true)
        }
        Err(error) => Err(error),
    }
}

/// The base may belong to this user or to root; others must not be able to exchange what lies in it.
pub fn base_flaw(base: &Path) -> io::Result<Option<ClaimError>> {
    let folder = fs::symlink_metadata(base)?;
    let own = rustix::process::geteuid().as_raw();
    let sticky = folder.mode() & 0o1000 != 0;
    let why = match () {
        _ if !folder.is_dir() => "it is no folder".to_owned(),
        _ if folder.uid() != own && folder.uid() != 0 => format!("it belongs to user {}", folder.uid()),
        _ if folder.mode() & 0o022 != 0 && !sticky => "others may exchange files in it".to_owned(),
        _ => return Ok(None),
    };
    Ok(Some(ClaimError::Unsafe { path: base.to_owned(), why }))
}

/// What is claimed belongs to this user alone.
pub fn own_flaw(path: &Path) -> io::Result<Option<ClaimError>> {
    let folder = fs::symlink_metadata(path)?;
    let own = rustix::process::geteuid().as_raw();
    let why = match () {
        _ if folder.is_symlink() => "it is a symbolic link".to_owned(),
        _ if !folder.is_dir() => "it is no folder".to_owned(),
        _ if folder.uid() != own => format!("it belongs to user {}, you are user {own}", folder.uid()),
        _ if folder.mode() & 0o022 != 0 => "others may write to it".to_owned(),
        _ => return Ok(None),
    };
    Ok(Some(ClaimError::Unsafe { path: path.to_owned(), why }))
}

/// Number of files below `folder`; folders and what cannot be read do not count.
pub fn count_files(folder: &Path) -> usize {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    entries
        .map(|entry| if entry.file_type().is_ok_and(|kind| kind.is_dir()) { count_files(&entry.path()) } else { 1 })
        .sum()
}
