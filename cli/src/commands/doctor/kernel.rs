//! The kernel: its version, how nodes can wait, how it preempts, how it clocks the processor.

use super::Finding;
use super::machine::Machine;
use runtime::channel::{Method, PrivateWord, Waiter};

/// All about the kernel.
pub fn look(machine: &Machine) -> Vec<Finding> {
    let release = machine.text("/proc/sys/kernel/osrelease").unwrap_or_else(|| "of unknown version".into());
    let version = machine.text("/proc/version").unwrap_or_default();
    let mut findings = vec![waiting(&release), preemption(&version, machine.text("/sys/kernel/realtime").as_deref())];
    findings.extend(governor(machine));
    findings
}

fn waiting(release: &str) -> Finding {
    let name = "waiting on channels";
    match Waiter::new(&PrivateWord::new(), Vec::new()).map(|waiter| waiter.method()) {
        Ok(Method::Vector) => Finding::ok(name, format!("Linux {release} has futex_waitv")),
        Ok(Method::Helpers) => Finding::warn(
            name,
            format!("Linux {release} has no futex_waitv: a helper thread per trigger waits instead, some 10 µs later"),
            "Linux 5.16 or later",
        ),
        Err(e) => Finding::fail(name, format!("a node could not wait: {e}"), "raise the limit of threads (ulimit -u)"),
    }
}

fn preemption(version: &str, realtime: Option<&str>) -> Finding {
    let name = "preemption";
    let words: Vec<&str> = version.split_whitespace().collect();
    let has = |word: &str| words.contains(&word);
    if realtime == Some("1") || has("PREEMPT_RT") {
        Finding::ok(name, "PREEMPT_RT: bounded latencies")
    } else if has("PREEMPT_DYNAMIC") || has("PREEMPT") {
        let model = if has("PREEMPT_DYNAMIC") { "PREEMPT_DYNAMIC" } else { "PREEMPT" };
        Finding::ok(name, format!("{model}: usually below a millisecond, not bounded; PREEMPT_RT bounds it"))
    } else {
        Finding::warn(
            name,
            "a kernel that does not preempt itself: system calls of others delay nodes by milliseconds",
            "a kernel with PREEMPT_RT (Debian: apt install linux-image-rt-amd64), or preempt=full on its command line",
        )
    }
}

fn governor(machine: &Machine) -> Option<Finding> {
    let governor = machine.text("/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor")?;
    let name = "processor clock";
    Some(match governor.as_str() {
        "performance" => Finding::ok(name, "governor performance"),
        other => Finding::warn(
            name,
            format!("governor {other}: waking from a low clock costs up to milliseconds"),
            "cpupower frequency-set -g performance",
        ),
    })
}

#[cfg(test)]
mod tests {
    use super::super::Verdict;
    use super::super::machine::fake;
    use super::*;

    #[test]
    fn preemption_models_are_told_apart() {
        let verdict = |version: &str| preemption(version, None).verdict;
        assert_eq!(verdict("Linux version 6.1 (gcc) #1 SMP PREEMPT_RT Debian"), Verdict::Ok);
        assert_eq!(verdict("Linux version 6.1 (gcc) #1 SMP PREEMPT_DYNAMIC Debian"), Verdict::Ok);
        assert_eq!(verdict("Linux version 4.9 (gcc) #1 SMP Debian"), Verdict::Warn);
        assert!(preemption("", Some("1")).found.contains("PREEMPT_RT"));
    }

    #[test]
    fn a_saving_governor_is_a_warning_and_none_is_nothing() {
        let saving = fake("governor", &[("/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor", "powersave\n")]);
        assert_eq!(governor(&saving).map(|f| f.verdict), Some(Verdict::Warn));
        assert_eq!(governor(&fake("no-governor", &[])), None);
    }
}
