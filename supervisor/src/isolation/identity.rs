//! Who a node runs as.
//!
//! A strict node of a robot that root runs gets a user that nobody else is: a number from the range that systemd keeps
//! for such users (61184 to 65519), by the robot's name and the node's place in it. All nodes of a robot have one group,
//! which may read the robot's channels.

use nix::unistd::{Gid, User, getgrouplist};
use runtime::robot::{Isolate, Robot, RobotError};
use std::ffi::CString;

/// Variable by which a supervisor tells a node who it is: `uid:gid:group,group`.
pub const IDENTITY: &str = "SINEW_IDENTITY";

/// The first number of the range.
const FIRST: u32 = 61_184;
/// Numbers of one robot: its group, then its nodes.
const PER_ROBOT: u32 = 64;
/// Robots whose numbers differ.
const ROBOTS: u64 = 67;

/// User and groups of a process.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Identity {
    /// User.
    pub uid: u32,
    /// The robot's group.
    pub gid: u32,
    /// Further groups.
    pub groups: Vec<u32>,
}

impl Identity {
    /// As the variable's value.
    pub fn to_word(&self) -> String {
        let groups: Vec<String> = self.groups.iter().map(u32::to_string).collect();
        format!("{}:{}:{}", self.uid, self.gid, groups.join(","))
    }

    /// From the variable's value.
    pub fn from_word(word: &str) -> Option<Identity> {
        let mut parts = word.split(':');
        let (uid, gid) = (parts.next()?.parse().ok()?, parts.next()?.parse().ok()?);
        let groups =
            parts.next()?.split(',').filter(|group| !group.is_empty()).map(str::parse).collect::<Result<_, _>>();
        Some(Identity { uid, gid, groups: groups.ok()? })
    }
}

/// The group of the robot called `name`.
pub(super) fn group_of(name: &str) -> u32 {
    let hash = name
        .bytes()
        .fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3));
    FIRST + (hash % ROBOTS) as u32 * PER_ROBOT
}

/// The user of the node at `place`. A robot with more nodes than numbers lets some share one.
pub(super) fn user_of(group: u32, place: usize) -> u32 {
    group + 1 + place as u32 % (PER_ROBOT - 1)
}

/// The user called `name`, and its groups.
pub(super) fn named(name: &str, group: u32) -> Option<Identity> {
    let user = User::from_name(name).ok().flatten()?;
    let groups = CString::new(name).ok().and_then(|name| getgrouplist(&name, user.gid).ok()).unwrap_or_default();
    Some(Identity { uid: user.uid.as_raw(), gid: group, groups: groups.into_iter().map(Gid::as_raw).collect() })
}

/// What is wrong with the users of a robot file on this machine.
pub fn flaws(robot: &Robot) -> Vec<RobotError> {
    let mut flaws = Vec::new();
    for node in &robot.nodes {
        let keys = ["nodes", &node.instance, "user"];
        if let Some(user) = node.user.as_deref().filter(|user| named(user, 0).is_none()) {
            let reason = format!("there is no user \"{user}\" on this machine");
            let advice = match node.isolate {
                Isolate::Strict => "leave `user` out: a strict node gets a user of its own; ",
                Isolate::None => "",
            };
            let advice = format!("{advice}or make it: useradd --system --no-create-home {user}");
            flaws.push(robot.error_at(&keys, reason).advise(advice.trim_start_matches("or ")));
        }
        let same = |other: &&runtime::robot::NodeSpec| other.process.is_some() && other.process == node.process;
        if let Some(first) = robot.nodes.iter().find(same)
            && (first.isolate, &first.user) != (node.isolate, &node.user)
        {
            let reason = format!(
                "\"{}\" shares a process with \"{}\" and is isolated otherwise: one process has one user",
                node.instance, first.instance
            );
            flaws.push(
                robot
                    .error_at(&["nodes", &node.instance, "process"], reason)
                    .advise("write the same `isolate` and `user` for both"),
            );
        }
    }
    flaws
}

/// One line for each thing that a robot file asks for and that cannot be had here.
pub fn warnings(robot: &Robot) -> Vec<String> {
    let strict = robot.nodes.iter().any(|node| node.isolate == Isolate::Strict);
    let mut lines = Vec::new();
    if (strict || robot.nodes.iter().any(|node| node.user.is_some())) && !rustix::process::geteuid().is_root() {
        let uid = rustix::process::geteuid().as_raw();
        lines.push(format!("nodes share user {uid}: only root can give them users of their own"));
    }
    if strict {
        lines.extend(super::files::landlock().flaw());
        lines.extend(super::calls::flaw());
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_identity_is_read_as_it_was_written() {
        for groups in [vec![], vec![20, 44]] {
            let identity = Identity { uid: 61_185, gid: 61_184, groups };
            assert_eq!(Identity::from_word(&identity.to_word()), Some(identity));
        }
        for word in ["", "1", "1:2", "a:b:", "1:2:x", "-1:2:"] {
            assert_eq!(Identity::from_word(word), None, "{word}");
        }
    }

    #[test]
    fn the_nodes_of_a_robot_have_users_of_their_own_within_the_range() {
        let group = group_of("pioneer");
        let users: Vec<u32> = (0..63).map(|place| user_of(group, place)).collect();
        assert!(users.iter().all(|user| (61_184..=65_519).contains(user) && *user != group));
        assert_eq!(users.iter().collect::<std::collections::HashSet<_>>().len(), 63);
    }

    #[test]
    fn root_is_found_by_name_and_nobody_is_found_who_does_not_exist() {
        assert_eq!(named("root", 7).map(|identity| (identity.uid, identity.gid)), Some((0, 7)));
        assert_eq!(named("no such user", 7), None);
    }
}
