//! Whether nodes can run under SCHED_FIFO, asked of the kernel itself, and why not.

use super::Finding;
use super::machine::Machine;
use runtime::realtime::{self, Grant};
use runtime::robot::{RealtimeTable, Scheduler};

const NAME: &str = "SCHED_FIFO";
/// A priority as robots use it.
const PRIORITY: u8 = 80;

/// All about scheduling.
pub fn look(machine: &Machine) -> Vec<Finding> {
    let mut findings = vec![fifo(machine, asked_kernel())];
    findings.extend(throttling(machine));
    findings
}

/// The kernel's answer to a thread that asks for SCHED_FIFO, and ends.
fn asked_kernel() -> Option<String> {
    let wishes = RealtimeTable { scheduler: Scheduler::Fifo, lock_memory: false, runaway_ms: 0 };
    let asked = std::thread::spawn(move || realtime::apply(&wishes, PRIORITY, "doctor").scheduler).join();
    match asked {
        Ok(Grant::Refused(why)) => Some(why),
        Ok(_) => None,
        Err(_) => Some("the asking thread ended in a panic".into()),
    }
}

fn fifo(machine: &Machine, refusal: Option<String>) -> Finding {
    let Some(_) = refusal else { return Finding::ok(NAME, format!("granted (priority {PRIORITY})")) };
    match group_runtime(machine) {
        Some((file, 0)) => Finding::warn(
            NAME,
            "refused: this process is in a cpu control group without real-time share (RT_GROUP_SCHED)",
            format!("echo 900000 > {file}"),
        ),
        _ => Finding::warn(
            NAME,
            "refused: robots run without it, less evenly",
            "as root: echo \"$USER - rtprio 89\" > /etc/security/limits.d/sinew.conf, then log in anew\n\
             or for the program alone: setcap cap_sys_nice=ep $(which sinew)",
        ),
    }
}

/// Real-time share of this process's cpu group under RT_GROUP_SCHED: its file and the µs per second.
fn group_runtime(machine: &Machine) -> Option<(String, i64)> {
    let groups = machine.text("/proc/self/cgroup")?;
    let of_cpu = groups.lines().find_map(|line| {
        let mut parts = line.splitn(3, ':').skip(1);
        let controllers = parts.next()?;
        controllers.split(',').any(|name| name == "cpu").then(|| parts.next()).flatten()
    })?;
    let group = of_cpu.trim_start_matches('/');
    for mount in ["/sys/fs/cgroup/cpu,cpuacct", "/sys/fs/cgroup/cpu"] {
        let file = format!("{mount}/{group}/cpu.rt_runtime_us").replace("//", "/");
        if let Some(text) = machine.text(&file) {
            return Some((file, text.trim().parse().unwrap_or(-1)));
        }
    }
    None
}

/// The kernel's brake on all real-time threads together.
fn throttling(machine: &Machine) -> Option<Finding> {
    let number = |name: &str| machine.text(&format!("/proc/sys/kernel/{name}"))?.parse::<i64>().ok();
    let (runtime_us, period_us) = (number("sched_rt_runtime_us")?, number("sched_rt_period_us")?);
    let name = "real-time throttling";
    Some(match runtime_us {
        0 => Finding::warn(name, "real-time threads get no time at all", "sysctl kernel.sched_rt_runtime_us=950000"),
        -1 => Finding::ok(name, "off: a runaway node can shut out everything else; runaway_ms in [realtime] ends it"),
        _ => Finding::ok(
            name,
            format!("real-time threads get {} % of a processor at most", 100 * runtime_us / period_us.max(1)),
        ),
    })
}

#[cfg(test)]
mod tests {
    use super::super::Verdict;
    use super::super::machine::fake;
    use super::*;

    #[test]
    fn a_group_without_share_is_named_with_the_file_that_gives_it() {
        let machine = fake(
            "rt-group",
            &[
                ("/proc/self/cgroup", "12:pids:/x\n4:cpu,cpuacct:/user/robot\n0::/x\n"),
                ("/sys/fs/cgroup/cpu,cpuacct/user/robot/cpu.rt_runtime_us", "0\n"),
            ],
        );
        let finding = fifo(&machine, Some("EPERM".into()));
        assert_eq!(finding.verdict, Verdict::Warn);
        assert!(finding.remedy.contains("/sys/fs/cgroup/cpu,cpuacct/user/robot/cpu.rt_runtime_us"), "{finding:?}");
    }

    #[test]
    fn a_plain_refusal_is_mended_by_limits() {
        let finding = fifo(&fake("rt-plain", &[]), Some("EPERM".into()));
        assert!(finding.remedy.contains("rtprio"), "{finding:?}");
        assert_eq!(fifo(&fake("rt-granted", &[]), None).verdict, Verdict::Ok);
    }

    #[test]
    fn throttling_says_how_much_is_left() {
        let files = |us: &'static str| {
            [("/proc/sys/kernel/sched_rt_runtime_us", us), ("/proc/sys/kernel/sched_rt_period_us", "1000000")]
        };
        let finding = |name, us| throttling(&fake(name, &files(us))).unwrap();
        assert!(finding("throttle-a", "950000").found.contains("95 %"));
        assert_eq!(finding("throttle-b", "0").verdict, Verdict::Warn);
        assert_eq!(finding("throttle-c", "-1").verdict, Verdict::Ok);
    }
}
