//! Locked memory, and the folder that channels live in.

use super::Finding;
use super::machine::Machine;
use crate::live;
use crate::output::bytes;
use rustix::process::{Resource, geteuid, getrlimit};
use std::os::unix::fs::MetadataExt;
use std::path::Path;

/// Locked memory that a robot of a dozen nodes needs [byte].
const LOCKED_BYTES: u64 = 128 << 20;
/// Room for channels that makes no trouble [byte].
const ROOM_BYTES: u64 = 128 << 20;

/// All about memory.
pub fn look(machine: &Machine) -> Vec<Finding> {
    let limit = getrlimit(Resource::Memlock).current;
    let root = live::root();
    let mut findings = vec![memlock(limit, geteuid().is_root()), room(&root), owner(&root)];
    findings.push(remove_ipc(machine, geteuid().as_raw()));
    findings
}

fn memlock(limit: Option<u64>, root: bool) -> Finding {
    let name = "locked memory";
    match limit {
        _ if root => Finding::ok(name, "no limit (root)"),
        None => Finding::ok(name, "no limit"),
        Some(limit) if limit >= LOCKED_BYTES => Finding::ok(name, format!("limit {}", bytes(limit))),
        Some(limit) => Finding::warn(
            name,
            format!("limit {}: a process that locks more cannot even start a thread", bytes(limit)),
            "as root: echo \"$USER - memlock 262144\" >> /etc/security/limits.d/sinew.conf, then log in anew",
        ),
    }
}

/// The nearest folder above (or at) `path` that is there.
fn existing(path: &Path) -> &Path {
    path.ancestors().find(|folder| folder.is_dir()).unwrap_or(Path::new("/"))
}

fn room(root: &Path) -> Finding {
    let name = "room for channels";
    let place = existing(root);
    match rustix::fs::statvfs(place) {
        Ok(stat) => {
            let (size, free) = (stat.f_blocks * stat.f_frsize, stat.f_bavail * stat.f_frsize);
            room_finding(name, &place.display().to_string(), size, free)
        }
        Err(e) => Finding::fail(name, format!("cannot look at {}: {e}", place.display()), "mount a tmpfs at /dev/shm"),
    }
}

fn room_finding(name: &str, place: &str, size: u64, free: u64) -> Finding {
    let found = format!("{} of {} free in {place}", bytes(free), bytes(size));
    let remedy = "mount -o remount,size=512m /dev/shm (docker: --shm-size=512m)";
    match free {
        0..8_388_608 => Finding::fail(name, found, remedy),
        _ if free < ROOM_BYTES => Finding::warn(name, format!("{found}: little for cameras and maps"), remedy),
        _ => Finding::ok(name, found),
    }
}

fn owner(root: &Path) -> Finding {
    let name = "folder of robots";
    let shown = root.display();
    match std::fs::symlink_metadata(root) {
        Err(_) => Finding::ok(name, format!("{shown} is not there yet: the first run makes it")),
        Ok(link) if !link.is_dir() => {
            Finding::fail(name, format!("{shown} is no folder"), format!("remove it: rm {shown}"))
        }
        Ok(folder) => owner_finding(name, &shown.to_string(), folder.uid(), folder.mode(), geteuid().as_raw()),
    }
}

fn owner_finding(name: &str, shown: &str, uid: u32, mode: u32, me: u32) -> Finding {
    // With the sticky bit nobody can remove or exchange another's robots.
    let open = mode & 0o022 != 0 && mode & 0o1000 == 0;
    match uid {
        _ if uid != me && uid != 0 => Finding::fail(
            name,
            format!("{shown} belongs to user {uid}: whoever made it first can exchange everybody's channels"),
            format!("as root: rm -r {shown}; or choose another with SINEW_SHM"),
        ),
        _ if open => Finding::fail(
            name,
            format!("{shown} can be written by others (mode {:o})", mode & 0o7777),
            format!("chmod go-w {shown}"),
        ),
        _ if uid != me && mode & 0o1000 == 0 => Finding::warn(
            name,
            format!("{shown} belongs to root: user {me} cannot make robots in it"),
            "choose another with SINEW_SHM, or run robots as one user",
        ),
        _ => Finding::ok(name, format!("{shown} belongs to user {uid}")),
    }
}

/// systemd removes a user's files in /dev/shm when the user's last session ends.
fn remove_ipc(machine: &Machine, uid: u32) -> Finding {
    let name = "RemoveIPC";
    if !machine.path("/run/systemd/system").is_dir() {
        return Finding::ok(name, "no systemd: nobody clears /dev/shm at log-out");
    }
    if uid < 1000 {
        return Finding::ok(name, format!("user {uid} is a system user: systemd leaves its files alone"));
    }
    let drop_ins =
        machine.names("/etc/systemd/logind.conf.d").into_iter().map(|f| format!("/etc/systemd/logind.conf.d/{f}"));
    let files = std::iter::once("/etc/systemd/logind.conf".to_owned()).chain(drop_ins);
    let lines: Vec<String> = files
        .filter_map(|file| machine.text(&file))
        .flat_map(|text| text.lines().map(str::to_owned).collect::<Vec<_>>())
        .collect();
    let set = lines.iter().rev().find_map(|line| line.trim().strip_prefix("RemoveIPC=").map(str::to_owned));
    match set.as_deref() {
        Some("no" | "false" | "0" | "off") => Finding::ok(name, "off: channels survive a log-out"),
        _ => Finding::warn(
            name,
            "on: when your last session ends, systemd deletes the channels of robots that still run",
            "run robots as a system user, or: loginctl enable-linger $USER, or RemoveIPC=no in /etc/systemd/logind.conf",
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::super::Verdict;
    use super::super::machine::fake;
    use super::*;

    #[test]
    fn eight_mebibytes_of_locked_memory_are_few() {
        assert_eq!(memlock(Some(8 << 20), false).verdict, Verdict::Warn);
        assert_eq!(memlock(Some(8 << 20), true).verdict, Verdict::Ok);
        assert_eq!(memlock(None, false).verdict, Verdict::Ok);
    }

    #[test]
    fn a_containers_small_shared_memory_is_a_warning_and_a_full_one_a_failure() {
        assert_eq!(room_finding("room", "/dev/shm", 64 << 20, 60 << 20).verdict, Verdict::Warn);
        assert_eq!(room_finding("room", "/dev/shm", 64 << 20, 1 << 20).verdict, Verdict::Fail);
        assert_eq!(room_finding("room", "/dev/shm", 4 << 30, 3 << 30).verdict, Verdict::Ok);
    }

    #[test]
    fn a_folder_that_somebody_else_made_first_is_not_trusted() {
        let verdict = |uid, mode, me| owner_finding("folder", "/dev/shm/sinew", uid, mode, me).verdict;
        assert_eq!(verdict(1001, 0o755, 1000), Verdict::Fail);
        assert_eq!(verdict(1000, 0o777, 1000), Verdict::Fail);
        assert_eq!(verdict(1000, 0o755, 1000), Verdict::Ok);
        assert_eq!(verdict(0, 0o755, 1000), Verdict::Warn);
        assert_eq!(verdict(0, 0o1777, 1000), Verdict::Ok);
    }

    #[test]
    fn logging_out_deletes_channels_unless_systemd_is_told_otherwise() {
        let unit = ("/run/systemd/system/x", "");
        assert_eq!(remove_ipc(&fake("ipc-none", &[]), 1000).verdict, Verdict::Ok);
        assert_eq!(remove_ipc(&fake("ipc-default", &[unit]), 1000).verdict, Verdict::Warn);
        assert_eq!(remove_ipc(&fake("ipc-system", &[unit]), 500).verdict, Verdict::Ok);
        let off = ("/etc/systemd/logind.conf.d/robots.conf", "[Login]\nRemoveIPC=no\n");
        assert_eq!(remove_ipc(&fake("ipc-off", &[unit, off]), 1000).verdict, Verdict::Ok);
    }
}
