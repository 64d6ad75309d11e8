//! Whose what is in a robot's folder, where its nodes have users of their own.
//!
//! Everything belongs to the robot's group, which reads; a node's folder with its channels belongs to the node's user,
//! which writes. A driver and its simulated twin meet in a folder that these two alone may enter: the twin's, shared
//! with a group that has the driver's number and no other member.

use runtime::device::Address;
use runtime::robot::{Isolate, NodeSpec, Robot};
use runtime::{Layer, TWINS};
use rustix::fs::{AtFlags, CWD, Gid, Mode, Uid, chmod, chownat};
use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

use super::identity::{Identity, group_of, named, user_of};
use super::needs::addresses;

/// Who the nodes of a robot are.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Ownership {
    /// The robot's group.
    pub group: u32,
    /// The nodes that have a user of their own, by their paths.
    pub nodes: BTreeMap<String, Identity>,
    /// Drivers whose devices are simulated, with the twin's user and the group of the two.
    twins: Vec<(String, u32, u32)>,
}

impl Ownership {
    /// Of `robot`, as run by this user; `None` where no node gets a user of its own.
    pub fn of(robot: &Robot) -> Option<Ownership> {
        if !rustix::process::geteuid().is_root() {
            return None;
        }
        let ownership = Ownership::under_root(robot);
        (!ownership.nodes.is_empty()).then_some(ownership)
    }

    fn under_root(robot: &Robot) -> Ownership {
        let group = group_of(&robot.name);
        let mut nodes = BTreeMap::new();
        let mut twins = Vec::new();
        // Nodes of one process are one user: the first one's.
        let place = |node: &NodeSpec| {
            let same = |other: &NodeSpec| {
                other.path() == node.path() || other.process.is_some() && other.process == node.process
            };
            robot.nodes.iter().position(same).unwrap_or(0)
        };
        for node in &robot.nodes {
            let wished = match (&node.user, node.isolate) {
                (Some(name), _) => named(name, group),
                (None, Isolate::Strict) => {
                    Some(Identity { uid: user_of(group, place(node)), gid: group, groups: Vec::new() })
                }
                (None, Isolate::None) => None,
            };
            let mut identity = wished.zip(groups_of_devices(node)).map(|(mut identity, groups)| {
                identity.groups.extend(groups);
                identity
            });
            if is_simulated(node) {
                identity.iter_mut().for_each(|identity| identity.groups.push(identity.uid));
                twins.push((node.instance.clone(), identity.as_ref().map_or(group, |identity| identity.uid)));
            }
            nodes.extend(identity.map(|identity| (node.path(), identity)));
        }
        let world = robot.nodes.iter().find(|node| node.kind.layer == Layer::Simulator).map(NodeSpec::path);
        let world = world.and_then(|path| nodes.get_mut(&path));
        let twins = match world {
            Some(world) => {
                world.groups.extend(twins.iter().map(|(_, group)| *group));
                twins.into_iter().map(|(driver, group)| (driver, world.uid, group)).collect()
            }
            // A twin that stays root gives its terminals to nobody by itself.
            None => twins.into_iter().map(|(driver, group)| (driver, 0, group)).collect(),
        };
        Ownership { group, nodes, twins }
    }

    /// The user of a process in which the nodes at `paths` run.
    pub fn of_process(&self, paths: &[String]) -> Option<&Identity> {
        paths.iter().find_map(|path| self.nodes.get(path))
    }

    /// Gives everything below `root` to whom it belongs, before any node runs.
    pub fn share_out(&self, root: &Path) -> io::Result<()> {
        for path in self.nodes.keys() {
            fs::create_dir_all(root.join(path.trim_start_matches('/')))?;
        }
        for (driver, user, group) in &self.twins {
            let folder = root.join(TWINS).join(driver);
            fs::create_dir_all(&folder)?;
            give(&folder, Some(*user), *group)?;
            chmod(&folder, Mode::RWXU | Mode::RGRP | Mode::XGRP)?;
        }
        let mut folders = vec![(root.to_owned(), None)];
        while let Some((folder, user)) = folders.pop() {
            give(&folder, user, self.group)?;
            // What is made in it later, by whomever, is the group's to read, too.
            let others = if user.is_some() { Mode::empty() } else { Mode::ROTH | Mode::XOTH };
            chmod(&folder, Mode::RWXU | Mode::RGRP | Mode::XGRP | Mode::SGID | others)?;
            for entry in fs::read_dir(&folder)? {
                let path = entry?.path();
                let kind = fs::symlink_metadata(&path)?;
                if kind.is_dir() && !self.is_closed(root, &path) {
                    let own = self.nodes.get(&name_of(root, &path)).map(|identity| identity.uid);
                    folders.push((path, own.or(user)));
                } else if kind.is_file() {
                    give(&path, user, self.group)?;
                }
            }
        }
        Ok(())
    }

    /// Whether a folder is none of the group's: the supervisor's own, and those of the twins.
    fn is_closed(&self, root: &Path, folder: &Path) -> bool {
        folder == root.join(crate::owner::RUN_FOLDER) || folder.parent() == Some(&root.join(TWINS))
    }
}

fn name_of(root: &Path, folder: &Path) -> String {
    format!("/{}", folder.strip_prefix(root).unwrap_or(Path::new("")).display())
}

fn give(path: &Path, user: Option<u32>, group: u32) -> io::Result<()> {
    let user = user.map(Uid::from_raw);
    Ok(chownat(CWD, path, user, Some(Gid::from_raw(group)), AtFlags::SYMLINK_NOFOLLOW)?)
}

/// Whether a node's device is its simulated twin.
fn is_simulated(node: &NodeSpec) -> bool {
    node.kind.layer == Layer::Drivers
        && addresses(node).iter().all(|address| matches!(address, Address::Simulator | Address::Memory { .. }))
}

/// The groups by which the device files of `node` can be opened. `None`: nobody but their owner may, or they are not
/// there yet, or the node is to make terminals in a folder of root's.
fn groups_of_devices(node: &NodeSpec) -> Option<Vec<u32>> {
    let mut groups = Vec::new();
    for address in addresses(node) {
        let path: PathBuf = match (address, node.kind.layer) {
            (Address::Pty { .. }, Layer::Simulator) => return None,
            (Address::Serial { path, .. } | Address::Pty { path }, Layer::Drivers) => path,
            _ => continue,
        };
        let file = fs::metadata(path).ok()?;
        match file.mode() {
            mode if mode & 0o006 == 0o006 => {}
            // A plain file is read only.
            mode if file.is_file() && mode & 0o004 != 0 => {}
            mode if mode & 0o060 == 0o060 => groups.push(file.gid()),
            _ => return None,
        }
    }
    Some(groups)
}
