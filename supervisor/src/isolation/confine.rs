//! Takes the isolation on, at the start of a node's process.

use runtime::realtime::Grant;
use runtime::robot::{Isolate, NodeSpec, Resources, Robot};
use rustix::fs::Mode;
use rustix::process::{Gid, Resource, Rlimit, Uid, setrlimit, umask};
use rustix::thread::{set_no_new_privs, set_thread_groups, set_thread_res_gid, set_thread_res_uid};
use std::collections::BTreeMap;
use std::fmt;
use std::io;
use std::os::unix::fs::MetadataExt;
use std::path::Path;
use std::sync::Arc;

use super::identity::{IDENTITY, Identity};
use super::needs::Needs;
use super::{calls, files};

/// What a process was granted.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Confined {
    /// A user of its own.
    pub user: Grant,
    /// Landlock.
    pub files: Grant,
    /// seccomp.
    pub calls: Grant,
}

/// Confines this process, a single thread, to what the nodes at `paths` of `robot` need. What cannot be had is said, and
/// the node goes on without. `None`: the robot file asks for nothing.
pub fn confine(robot: &mut Robot, paths: &[String], root: &Path) -> Option<Confined> {
    let nodes: Vec<NodeSpec> = robot.nodes.iter().filter(|node| paths.contains(&node.path())).cloned().collect();
    let strict = nodes.iter().any(|node| node.isolate == Isolate::Strict);
    let identity = std::env::var(IDENTITY).ok().and_then(|word| Identity::from_word(&word));
    if !strict && identity.is_none() {
        return None;
    }
    let needs = Needs::of(robot, &nodes.iter().collect::<Vec<_>>(), root);
    let wished = strict || nodes.iter().any(|node| node.user.is_some());
    let user = match identity {
        Some(identity) => become_user(robot, &nodes, &identity),
        None if !wished => Grant::NotAsked,
        None if rustix::process::geteuid().is_root() => {
            Grant::Refused("it stays root: nobody else may open its device, or that is not there yet".into())
        }
        None => {
            let uid = rustix::process::geteuid().as_raw();
            Grant::Refused(format!("it stays user {uid}: only root can give nodes users of their own"))
        }
    };
    if !strict {
        return Some(Confined { user, files: Grant::NotAsked, calls: Grant::NotAsked });
    }
    // What it makes is its own and its group's; sockets get their mode from this alone.
    umask(Mode::RWXO);
    // Neither of the others is granted to an ordinary user without; it fails only on kernels that have neither.
    let _ = set_no_new_privs(true);
    // The last one first forbids what the others need.
    let files = files::restrict(&needs);
    let calls = calls::refuse(&needs);
    Some(Confined { user, files, calls })
}

fn become_user(robot: &mut Robot, nodes: &[NodeSpec], identity: &Identity) -> Grant {
    // While it may still be read.
    if let Resources::Folder(folder) = &robot.resources
        && !readable_by_all(folder)
    {
        robot.resources = Resources::Held(Arc::new(held(folder)));
    }
    match change(nodes, identity) {
        Ok(()) => Grant::Granted(format!("user {}, group {}", identity.uid, identity.gid)),
        Err(error) => Grant::Refused(format!(
            "it stays user {}: user {} cannot be had ({error}); in a container map more users into it",
            rustix::process::geteuid().as_raw(),
            identity.uid
        )),
    }
}

fn change(nodes: &[NodeSpec], identity: &Identity) -> io::Result<()> {
    // The pump stands one above its step; more than that nobody of this process ever needs.
    let priority = nodes.iter().map(|node| node.priority).max().unwrap_or(0);
    let limit = |value| Rlimit { current: value, maximum: value };
    // Without CAP_SYS_RESOURCE limits cannot be raised: the node then says what scheduling and memory it was granted.
    let _ = setrlimit(Resource::Rtprio, limit(Some(u64::from(priority) + 1)));
    let _ = setrlimit(Resource::Memlock, limit(None));
    let groups: Vec<Gid> = identity.groups.iter().map(|&group| Gid::from_raw(group)).collect();
    set_thread_groups(&groups)?;
    let (uid, gid) = (Uid::from_raw(identity.uid), Gid::from_raw(identity.gid));
    set_thread_res_gid(gid, gid, gid)?;
    set_thread_res_uid(uid, uid, uid)?;
    Ok(())
}

/// Whether everybody may read `folder` and come to it.
fn readable_by_all(folder: &Path) -> bool {
    let open = |folder: &Path, mode: u32| std::fs::metadata(folder).is_ok_and(|found| found.mode() & mode == mode);
    open(folder, 0o005) && folder.ancestors().all(|folder| open(folder, 0o001))
}

/// A robot's files are small; what is larger was put there by mistake [byte].
const LARGEST_BYTES: u64 = 64 << 20;

/// The files in `folder` and below, by their names from there.
fn held(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut files = BTreeMap::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(next) = folders.pop() {
        for entry in std::fs::read_dir(&next).into_iter().flatten().flatten() {
            let (path, Ok(found)) = (entry.path(), entry.metadata()) else { continue };
            match path.strip_prefix(folder).ok().and_then(Path::to_str) {
                _ if found.is_dir() => folders.push(path),
                Some(name) if found.is_file() && found.len() <= LARGEST_BYTES => {
                    files.extend(std::fs::read(&path).ok().map(|bytes| (name.to_owned(), bytes)));
                }
                _ => {}
            }
        }
    }
    files
}

impl fmt::Display for Confined {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "isolation: ")?;
        for (index, (name, grant)) in
            [("user", &self.user), ("files", &self.files), ("calls", &self.calls)].into_iter().enumerate()
        {
            let separator = if index == 0 { "" } else { "; " };
            match grant {
                Grant::NotAsked => write!(f, "{separator}{name} not asked for")?,
                Grant::Granted(what) => write!(f, "{separator}{name} granted ({what})")?,
                Grant::Refused(why) => write!(f, "{separator}{name} REFUSED: {why}")?,
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_that_others_cannot_read_is_held_by_the_names_in_it() {
        let folder = tempfile::tempdir().unwrap();
        let own = std::os::unix::fs::PermissionsExt::from_mode(0o700);
        std::fs::set_permissions(folder.path(), own).unwrap();
        std::fs::create_dir(folder.path().join("worlds")).unwrap();
        std::fs::write(folder.path().join("worlds/office.toml"), "walls").unwrap();
        assert!(!readable_by_all(folder.path()), "it is its owner's");
        assert_eq!(held(folder.path()), BTreeMap::from([("worlds/office.toml".to_owned(), b"walls".to_vec())]));
    }

    #[test]
    fn what_was_granted_is_one_line() {
        let confined = Confined {
            user: Grant::Granted("user 61185, group 61184".into()),
            files: Grant::Refused("this kernel has no Landlock".into()),
            calls: Grant::NotAsked,
        };
        let line = confined.to_string();
        assert_eq!(
            line,
            "isolation: user granted (user 61185, group 61184); files REFUSED: this kernel has no Landlock; calls not asked for"
        );
    }
}
