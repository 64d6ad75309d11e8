//! seccomp: system calls that no node needs, refused with EPERM.
//!
//! A list of what is refused and not of what is allowed: which calls the C library makes of a node's steps changes with
//! its versions, and a node that is killed for an unknown call stops a robot that did nothing wrong. What the list must
//! cover is every way to another process, to another user, to another program, and out of Landlock: ptrace and its kin,
//! signals, scheduling, mounts, namespaces, modules, modes and owners of files, exec, io_uring (which makes other calls
//! unseen) and sockets of other families than the node's own.

use libc::c_long;
use runtime::realtime::Grant;
use seccompiler::{
    BpfProgram, SeccompAction, SeccompCmpArgLen, SeccompCmpOp, SeccompCondition, SeccompFilter, SeccompRule,
    apply_filter, sock_filter,
};
use std::collections::BTreeMap;

use super::needs::Needs;

/// Refused whatever their arguments.
const REFUSED: &[c_long] = &[
    // Into other processes.
    libc::SYS_ptrace,
    libc::SYS_process_vm_readv,
    libc::SYS_process_vm_writev,
    libc::SYS_process_madvise,
    libc::SYS_pidfd_getfd,
    libc::SYS_pidfd_send_signal,
    libc::SYS_kcmp,
    libc::SYS_tkill,
    libc::SYS_setpriority,
    libc::SYS_ioprio_set,
    libc::SYS_migrate_pages,
    libc::SYS_move_pages,
    // Out of the session by which a node and what it starts are known, and into other programs and users.
    libc::SYS_setsid,
    libc::SYS_setpgid,
    libc::SYS_execve,
    libc::SYS_execveat,
    libc::SYS_setuid,
    libc::SYS_setgid,
    libc::SYS_setreuid,
    libc::SYS_setregid,
    libc::SYS_setresuid,
    libc::SYS_setresgid,
    libc::SYS_setfsuid,
    libc::SYS_setfsgid,
    libc::SYS_setgroups,
    libc::SYS_capset,
    libc::SYS_personality,
    // File systems and namespaces.
    libc::SYS_mount,
    libc::SYS_umount2,
    libc::SYS_pivot_root,
    libc::SYS_chroot,
    libc::SYS_move_mount,
    libc::SYS_open_tree,
    libc::SYS_fsopen,
    libc::SYS_fsconfig,
    libc::SYS_fsmount,
    libc::SYS_fspick,
    libc::SYS_mount_setattr,
    libc::SYS_unshare,
    libc::SYS_setns,
    libc::SYS_open_by_handle_at,
    libc::SYS_mknodat,
    libc::SYS_setxattr,
    libc::SYS_lsetxattr,
    libc::SYS_fsetxattr,
    libc::SYS_quotactl,
    libc::SYS_swapon,
    libc::SYS_swapoff,
    libc::SYS_acct,
    // The kernel itself.
    libc::SYS_bpf,
    libc::SYS_perf_event_open,
    libc::SYS_userfaultfd,
    libc::SYS_io_uring_setup,
    libc::SYS_io_uring_enter,
    libc::SYS_io_uring_register,
    libc::SYS_keyctl,
    libc::SYS_add_key,
    libc::SYS_request_key,
    libc::SYS_init_module,
    libc::SYS_finit_module,
    libc::SYS_delete_module,
    libc::SYS_kexec_load,
    libc::SYS_kexec_file_load,
    libc::SYS_reboot,
    libc::SYS_syslog,
    libc::SYS_settimeofday,
    libc::SYS_clock_settime,
    libc::SYS_clock_adjtime,
    libc::SYS_adjtimex,
    libc::SYS_sethostname,
    libc::SYS_setdomainname,
    #[cfg(target_arch = "x86_64")]
    libc::SYS_mknod,
    #[cfg(target_arch = "x86_64")]
    libc::SYS_iopl,
    #[cfg(target_arch = "x86_64")]
    libc::SYS_ioperm,
    #[cfg(target_arch = "x86_64")]
    libc::SYS_modify_ldt,
];

/// Modes and owners of files: for those who make terminals for others.
const OWNERSHIP: &[c_long] = &[
    libc::SYS_fchmod,
    libc::SYS_fchmodat,
    libc::SYS_fchmodat2,
    libc::SYS_fchown,
    libc::SYS_fchownat,
    #[cfg(target_arch = "x86_64")]
    libc::SYS_chmod,
    #[cfg(target_arch = "x86_64")]
    libc::SYS_chown,
    #[cfg(target_arch = "x86_64")]
    libc::SYS_lchown,
];

/// Refused unless they name this process in their first argument, as its number or as 0.
const SELF_ONLY: &[c_long] = &[
    libc::SYS_kill,
    libc::SYS_tgkill,
    libc::SYS_rt_sigqueueinfo,
    libc::SYS_rt_tgsigqueueinfo,
    libc::SYS_sched_setscheduler,
    libc::SYS_sched_setparam,
    libc::SYS_sched_setattr,
    libc::SYS_sched_setaffinity,
    libc::SYS_prlimit64,
];

/// Number from which the calls of the x32 ABI begin, which has every call once more.
#[cfg(target_arch = "x86_64")]
const X32: u32 = 0x4000_0000;

/// What strict nodes have to do without where this kernel has no filters.
pub fn flaw() -> Option<String> {
    let actions = std::fs::read_to_string("/proc/sys/kernel/seccomp/actions_avail").unwrap_or_default();
    let known = actions.split_ascii_whitespace().any(|action| action == "errno");
    (!known).then(|| {
        "this kernel has no seccomp filters: strict nodes can make every system call (CONFIG_SECCOMP_FILTER)".into()
    })
}

/// Refuses this thread, and every later one of its process, what `needs` do not need, for good.
pub(super) fn refuse(needs: &Needs) -> Grant {
    let number = REFUSED.len() + OWNERSHIP.len() + SELF_ONLY.len();
    match filter(needs).and_then(|filter| apply_filter(&filter).map_err(|error| error.to_string())) {
        Ok(()) => Grant::Granted(format!("seccomp: {number} calls refused")),
        Err(error) => Grant::Refused(flaw().unwrap_or_else(|| format!("seccomp: {error}"))),
    }
}

/// The filter as the kernel takes it.
fn filter(needs: &Needs) -> Result<BpfProgram, String> {
    let text = |error: seccompiler::BackendError| error.to_string();
    let unless = |argument: u8, allowed: &[u64]| {
        let differs = |&value: &u64| SeccompCondition::new(argument, SeccompCmpArgLen::Dword, SeccompCmpOp::Ne, value);
        let conditions = allowed.iter().map(differs).collect::<Result<Vec<_>, _>>()?;
        Ok::<_, seccompiler::BackendError>(vec![SeccompRule::new(conditions)?])
    };
    let mut rules: BTreeMap<i64, Vec<SeccompRule>> = REFUSED.iter().map(|&call| (call, Vec::new())).collect();
    if !needs.serves_terminals {
        rules.extend(OWNERSHIP.iter().map(|&call| (call, Vec::new())));
    }
    for &call in SELF_ONLY {
        rules.insert(call, unless(0, &[0, u64::from(std::process::id())]).map_err(text)?);
    }
    let mut families = vec![libc::AF_UNIX as u64];
    if needs.internet() {
        families.extend([libc::AF_INET as u64, libc::AF_INET6 as u64]);
    }
    if needs.names {
        families.push(libc::AF_NETLINK as u64);
    }
    rules.insert(libc::SYS_socket, unless(0, &families).map_err(text)?);
    let architecture = std::env::consts::ARCH.try_into().map_err(text)?;
    let refusal = SeccompAction::Errno(libc::EPERM as u32);
    let filter = SeccompFilter::new(rules, SeccompAction::Allow, refusal, architecture).map_err(text)?;
    let filter = BpfProgram::try_from(filter).map_err(text)?;
    Ok(without_x32(filter))
}

/// The same filter, behind a refusal of every call of the x32 ABI: load the number, compare, return.
#[cfg(target_arch = "x86_64")]
fn without_x32(filter: BpfProgram) -> BpfProgram {
    let line = |code, jt, jf, k| sock_filter { code, jt, jf, k };
    let refusal = 0x0005_0000 | libc::EPERM as u32;
    let head = [line(0x20, 0, 0, 0), line(0x35, 0, 1, X32), line(0x06, 0, 0, refusal)];
    head.into_iter().chain(filter).collect()
}

#[cfg(not(target_arch = "x86_64"))]
fn without_x32(filter: BpfProgram) -> BpfProgram {
    filter
}

#[cfg(test)]
mod tests {
    use super::*;
    use rustix::io::Errno;
    use rustix::net::{AddressFamily, SocketType, socket};

    /// In a thread of its own: its filter ends with it.
    fn under<T: Send + 'static>(needs: Needs, act: impl FnOnce() -> T + Send + 'static) -> T {
        let run = move || {
            let granted = refuse(&needs);
            assert!(matches!(granted, Grant::Granted(_)), "{granted:?}");
            act()
        };
        std::thread::spawn(run).join().unwrap()
    }

    #[test]
    fn a_thread_under_the_filter_signals_itself_and_nobody_else() {
        let (own, other) = under(Needs::default(), || {
            let own = rustix::process::getpid();
            let parent = rustix::process::getppid().unwrap();
            (rustix::process::test_kill_process(own), rustix::process::test_kill_process(parent))
        });
        assert_eq!((own, other), (Ok(()), Err(Errno::PERM)));
    }

    #[test]
    fn sockets_of_the_internet_are_for_those_who_have_an_address_there() {
        let open = || {
            [AddressFamily::UNIX, AddressFamily::INET].map(|family| socket(family, SocketType::STREAM, None).map(drop))
        };
        assert_eq!(under(Needs::default(), open), [Ok(()), Err(Errno::PERM)]);
        let needs = Needs { connect: vec![8101], ..Needs::default() };
        assert_eq!(under(needs, open), [Ok(()), Ok(())]);
    }

    #[test]
    fn no_other_program_is_started_and_no_mode_changed() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let path = file.path().to_owned();
        let (run, mode) = under(Needs::default(), move || {
            let run = std::process::Command::new("/bin/true").status().map(drop).map_err(|error| error.kind());
            (run, rustix::fs::chmod(&path, rustix::fs::Mode::RWXO))
        });
        assert_eq!((run, mode), (Err(std::io::ErrorKind::PermissionDenied), Err(Errno::PERM)));
    }
}
