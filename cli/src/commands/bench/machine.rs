//! The conditions of a measurement: what a figure means without them nobody knows.

use super::witness::Testimony;
use serde::Serialize;
use std::fmt;
use std::fs::read_to_string;

/// The machine, and what else happened on it meanwhile.
#[derive(Debug, Clone, Serialize)]
pub struct Machine {
    /// Processor.
    pub cpu: String,
    /// Cores that this process may use.
    pub cores: usize,
    /// Whether a hypervisor is below; its scheduler then takes cores away unasked.
    pub virtual_machine: bool,
    /// Kernel release.
    pub kernel: String,
    /// Preemption model.
    pub preemption: String,
    /// The kernel's clock source.
    pub clock_source: String,
    /// Frequency governor of the first core.
    pub governor: String,
    /// Load average over one minute, before and after.
    pub load_average: [f64; 2],
    /// Time that the hypervisor gave to others, summed over the cores [ms].
    pub steal_ms: u64,
    /// How long the measurement took [s].
    pub duration_s: f64,
    /// How the measuring threads were scheduled, by placement.
    pub scheduler: Vec<String>,
    /// What the stall witnesses saw.
    pub witness: WitnessSummary,
    /// Version and build of this program.
    pub program: String,
}

/// The witnesses in figures.
#[derive(Debug, Clone, Default, Serialize)]
pub struct WitnessSummary {
    /// How they were scheduled; empty when none ran.
    pub scheduler: String,
    /// Times that a core did not run its witness for more than 3 ms.
    pub gaps: usize,
    /// The longest of them [ms].
    pub longest_ms: f64,
}

impl fmt::Display for WitnessSummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.scheduler.as_str() {
            "" => write!(f, "none ran"),
            how => write!(f, "{} gaps over 3 ms, the longest {:.1} ms ({how})", self.gaps, self.longest_ms),
        }
    }
}

/// Conditions at the beginning of a measurement.
pub struct Before {
    load: f64,
    steal_ticks: u64,
    at: runtime::Time,
}

impl Before {
    /// Looks at the machine.
    pub fn now() -> Before {
        Before { load: load(), steal_ticks: steal_ticks(), at: runtime::clock::now() }
    }

    /// Looks again, and says what the conditions were.
    pub fn finish(self, scheduler: Vec<String>, seen: &Testimony) -> Machine {
        let cpuinfo = read_to_string("/proc/cpuinfo").unwrap_or_default();
        let release = rustix::system::uname();
        Machine {
            cpu: field(&cpuinfo, "model name").unwrap_or_else(|| std::env::consts::ARCH.into()),
            cores: processors().len(),
            virtual_machine: field(&cpuinfo, "flags").is_some_and(|flags| flags.split(' ').any(|f| f == "hypervisor")),
            kernel: release.release().to_string_lossy().into_owned(),
            preemption: preemption(&release.version().to_string_lossy()),
            clock_source: file("/sys/devices/system/clocksource/clocksource0/current_clocksource"),
            governor: file("/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor"),
            load_average: [self.load, load()],
            // A tick of /proc/stat is 10 ms on every architecture in use.
            steal_ms: (steal_ticks() - self.steal_ticks) * 10,
            duration_s: runtime::clock::now().since(self.at),
            scheduler,
            witness: WitnessSummary {
                scheduler: seen.scheduler.clone(),
                gaps: seen.gaps.len(),
                longest_ms: seen.longest_ms(),
            },
            program: program(),
        }
    }
}

impl Machine {
    /// The conditions in lines for people.
    pub fn lines(&self) -> Vec<String> {
        let host = if self.virtual_machine { "virtual machine" } else { "bare machine" };
        let mut lines = vec![
            format!("machine    {}, {} cores, {host}", self.cpu, self.cores),
            format!(
                "kernel     {}, {}, clock source {}, governor {}",
                self.kernel, self.preemption, self.clock_source, self.governor
            ),
            format!(
                "load       {:.2} before, {:.2} after {:.0} s; the hypervisor took {} ms of CPU time",
                self.load_average[0], self.load_average[1], self.duration_s, self.steal_ms
            ),
            format!("witness    {}", self.witness),
        ];
        lines.extend(self.scheduler.iter().map(|text| format!("scheduling {text}")));
        lines.push(format!("program    {}", self.program));
        lines
    }
}

/// Cores that this process may use.
pub fn processors() -> Vec<usize> {
    let Ok(set) = rustix::thread::sched_getaffinity(None) else { return vec![0] };
    (0..rustix::thread::CpuSet::MAX_CPU).filter(|core| set.is_set(*core)).collect()
}

fn program() -> String {
    let build = if cfg!(debug_assertions) { "development build: its figures mean nothing" } else { "release build" };
    let with = if cfg!(feature = "iceoryx2") { ", with iceoryx2" } else { "" };
    format!("sinew {}, {build}{with}", env!("CARGO_PKG_VERSION"))
}

fn file(path: &str) -> String {
    read_to_string(path).map_or_else(|_| "unknown".into(), |text| text.trim().to_owned())
}

fn load() -> f64 {
    file("/proc/loadavg").split(' ').next().and_then(|text| text.parse().ok()).unwrap_or(f64::NAN)
}

fn steal_ticks() -> u64 {
    let stat = file("/proc/stat");
    stat.lines().next().and_then(|line| line.split_whitespace().nth(8)?.parse().ok()).unwrap_or(0)
}

/// First value of `name` in text of lines `name : value`.
fn field(text: &str, name: &str) -> Option<String> {
    let (_, value) = text.lines().filter_map(|line| line.split_once(':')).find(|(key, _)| key.trim() == name)?;
    Some(value.trim().to_owned())
}

fn preemption(version: &str) -> String {
    let model = ["PREEMPT_RT", "PREEMPT_DYNAMIC", "PREEMPT_LAZY", "PREEMPT"].into_iter();
    let model = model.into_iter().find(|name| version.split(' ').any(|word| word == *name));
    let model = model.unwrap_or("no forced preemption");
    if model != "PREEMPT_DYNAMIC" {
        return model.into();
    }
    // "none voluntary (full)": the chosen one stands in brackets.
    let chosen = read_to_string("/sys/kernel/debug/sched/preempt").ok();
    let chosen = chosen.as_deref().and_then(|text| Some(text.split_once('(')?.1.split_once(')')?.0.to_owned()));
    let command_line = read_to_string("/proc/cmdline").unwrap_or_default();
    let asked = command_line.split_whitespace().find_map(|word| word.strip_prefix("preempt="));
    match (chosen, asked) {
        (Some(mode), _) => format!("{model} ({mode})"),
        (None, Some(mode)) => format!("{model} ({mode} asked for at boot)"),
        (None, None) => format!("{model} (mode not readable)"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_conditions_of_this_machine_can_be_told() {
        let machine = Before::now().finish(vec!["SCHED_OTHER".into()], &Testimony::default());
        assert!(machine.cores >= 1 && !machine.kernel.is_empty());
        assert!(machine.load_average.iter().all(|load| load.is_finite()));
    }

    #[test]
    fn the_preemption_model_is_read_from_the_kernels_version() {
        assert_eq!(preemption("#1 SMP PREEMPT_RT Debian 6.12"), "PREEMPT_RT");
        assert_eq!(preemption("#1 SMP"), "no forced preemption");
        assert!(preemption("#1 SMP PREEMPT_DYNAMIC @0").starts_with("PREEMPT_DYNAMIC ("));
    }
}
