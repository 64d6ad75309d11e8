//! What can keep nodes apart here: users, Landlock, seccomp; and what can measure and bound them: limits, pressure, groups.

use super::Finding;
use super::machine::Machine;
use rustix::process::{Resource, geteuid, getrlimit};
use supervisor::isolation::{Landlock, landlock, seccomp};

/// The version of Landlock whose rules strict nodes make use of.
const WANTED: i32 = 6;

/// All about isolation.
pub fn look(machine: &Machine) -> Vec<Finding> {
    let limit = getrlimit(Resource::Rtprio).current;
    vec![
        users(geteuid().as_raw(), mapped(machine)),
        files(landlock()),
        calls(seccomp()),
        priority(limit, geteuid().is_root()),
        pressure(machine),
        groups(machine),
    ]
}

/// How many users this user namespace knows (user_namespaces(7): inside, outside, length).
fn mapped(machine: &Machine) -> u64 {
    let map = machine.text("/proc/self/uid_map").unwrap_or_default();
    map.lines().filter_map(|line| line.split_ascii_whitespace().nth(2)?.parse::<u64>().ok()).sum()
}

fn users(uid: u32, mapped: u64) -> Finding {
    let name = "users of nodes";
    match uid {
        0 if mapped < 65_536 => Finding::warn(
            name,
            format!("root, in a container that knows {mapped} users only: strict nodes stay root"),
            "map 65536 users into the container (subuid), or run it without a user namespace",
        ),
        0 => Finding::ok(name, "root: every strict node gets a user of its own"),
        _ => Finding::warn(
            name,
            format!("user {uid}: nodes share it; Landlock and seccomp alone keep strict ones apart"),
            "run the robot as root, which gives every strict node a user of its own",
        ),
    }
}

fn files(found: Landlock) -> Finding {
    let name = "Landlock";
    match (found, found.flaw()) {
        (Landlock::Version(version), None) => {
            Finding::ok(name, format!("version {version}: files, TCP ports, signals, abstract sockets"))
        }
        (Landlock::Version(version), Some(flaw)) => {
            Finding::warn(name, flaw, format!("Linux 6.12 or later has version {WANTED}; this one has {version}"))
        }
        (Landlock::Missing, flaw) => Finding::warn(
            name,
            flaw.unwrap_or_default(),
            "boot with lsm=landlock,… (cat /sys/kernel/security/lsm shows what is on)",
        ),
    }
}

fn calls(flaw: Option<String>) -> Finding {
    match flaw {
        None => Finding::ok("seccomp", "filters by system call and argument"),
        Some(flaw) => Finding::warn("seccomp", flaw, "a kernel with CONFIG_SECCOMP_FILTER"),
    }
}

fn priority(limit: Option<u64>, root: bool) -> Finding {
    let name = "RLIMIT_RTPRIO";
    match limit {
        _ if root => Finding::ok(name, "no limit (root); nodes get one of their own"),
        None => Finding::ok(name, "no limit"),
        Some(limit) if limit >= 90 => Finding::ok(name, format!("up to {limit}")),
        Some(limit) => Finding::warn(
            name,
            format!("up to {limit}: priorities above it are refused"),
            "as root: echo \"$USER - rtprio 90\" > /etc/security/limits.d/sinew.conf, then log in anew",
        ),
    }
}

fn pressure(machine: &Machine) -> Finding {
    let name = "pressure";
    match machine.text("/proc/pressure/cpu") {
        Some(text) if text.starts_with("some") => Finding::ok(name, "the kernel tells how long tasks wait"),
        _ => Finding::warn(
            name,
            "/proc/pressure is not there: the governor sees load, but not what it costs",
            "boot with psi=1 (CONFIG_PSI)",
        ),
    }
}

fn groups(machine: &Machine) -> Finding {
    let name = "control groups";
    match machine.text("/sys/fs/cgroup/cgroup.controllers") {
        Some(controllers) if controllers.split(' ').any(|name| name == "memory") => {
            Finding::ok(name, format!("version 2: {controllers}"))
        }
        Some(controllers) => Finding::warn(
            name,
            format!("version 2 without the memory controller ({controllers}): nothing bounds a node's memory"),
            "boot with cgroup_enable=memory, or systemd.unified_cgroup_hierarchy=1",
        ),
        None => Finding::warn(
            name,
            "no version 2: nothing bounds a node's memory",
            "boot with systemd.unified_cgroup_hierarchy=1; robots run without",
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::super::Verdict;
    use super::super::machine::fake;
    use super::*;

    #[test]
    fn root_gives_users_to_nodes_unless_its_container_has_none() {
        assert_eq!(users(0, 4_294_967_295).verdict, Verdict::Ok);
        assert_eq!(users(0, 1).verdict, Verdict::Warn);
        assert!(users(1000, 4_294_967_295).found.contains("nodes share it"));
        assert_eq!(mapped(&fake("uid-map", &[("/proc/self/uid_map", "0 1000 1\n1 100000 65536\n")])), 65_537);
    }

    #[test]
    fn a_kernel_without_landlock_or_with_an_old_one_is_a_warning_with_what_is_missing() {
        assert_eq!(files(Landlock::Version(7)).verdict, Verdict::Ok);
        assert!(files(Landlock::Version(3)).found.contains("TCP ports and signals"));
        assert!(files(Landlock::Missing).remedy.contains("lsm=landlock"));
        assert_eq!(calls(Some("none".into())).verdict, Verdict::Warn);
    }

    #[test]
    fn limits_pressure_and_groups_are_told_as_they_are() {
        assert_eq!(priority(Some(0), false).verdict, Verdict::Warn);
        assert_eq!(priority(Some(95), false).verdict, Verdict::Ok);
        assert_eq!(pressure(&fake("psi", &[("/proc/pressure/cpu", "some avg10=0.00\n")])).verdict, Verdict::Ok);
        assert_eq!(pressure(&fake("no-psi", &[])).verdict, Verdict::Warn);
        let two = fake("cgroup2", &[("/sys/fs/cgroup/cgroup.controllers", "cpu memory pids\n")]);
        assert_eq!(groups(&two).verdict, Verdict::Ok);
        let bare = fake("cgroup2-bare", &[("/sys/fs/cgroup/cgroup.controllers", "hugetlb\n")]);
        assert_eq!((groups(&bare).verdict, groups(&fake("cgroup1", &[])).verdict), (Verdict::Warn, Verdict::Warn));
    }
}
