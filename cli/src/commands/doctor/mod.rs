//! `sinew doctor`: what this machine lacks for real-time runs and real devices, and what to do about each.

mod devices;
mod isolation;
mod kernel;
mod leftovers;
mod machine;
mod memory;
mod scheduling;

use crate::exit::{CHECK, Failure};
use crate::output::{Out, Paint, Tone, count};
use machine::Machine;
use serde::Serialize;

/// Looks this machine over: kernel, real-time rights, memory, isolation, serial ports, leftovers
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Prints one JSON object
    #[arg(long)]
    json: bool,
}

/// How bad it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// As it should be.
    Ok,
    /// Robots run, but later or less evenly than they could.
    Warn,
    /// Robots, or a device, cannot run.
    Fail,
}

/// One thing looked at.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Finding {
    /// What was looked at.
    pub name: String,
    /// How bad it is.
    pub verdict: Verdict,
    /// What was found.
    pub found: String,
    /// What to do about it; empty when nothing needs to be done.
    pub remedy: String,
}

impl Finding {
    fn ok(name: &str, found: impl Into<String>) -> Finding {
        Finding { name: name.into(), verdict: Verdict::Ok, found: found.into(), remedy: String::new() }
    }

    fn warn(name: &str, found: impl Into<String>, remedy: impl Into<String>) -> Finding {
        Finding { name: name.into(), verdict: Verdict::Warn, found: found.into(), remedy: remedy.into() }
    }

    fn fail(name: &str, found: impl Into<String>, remedy: impl Into<String>) -> Finding {
        Finding { name: name.into(), verdict: Verdict::Fail, found: found.into(), remedy: remedy.into() }
    }
}

/// Looks and reports.
pub fn run(args: Args) -> Result<(), Failure> {
    let machine = Machine::this();
    let groups = [
        ("kernel", kernel::look(&machine)),
        ("real time", scheduling::look(&machine)),
        ("memory", memory::look(&machine)),
        ("isolation", isolation::look(&machine)),
        ("devices", devices::look(&machine)),
        ("robots", leftovers::look()),
    ];
    let all = || groups.iter().flat_map(|(_, findings)| findings);
    let worst = all().map(|finding| finding.verdict).max().unwrap_or(Verdict::Ok);
    let mut out = Out::stdout();
    if args.json {
        let findings: Vec<&Finding> = all().collect();
        out.json(&serde_json::json!({"verdict": worst, "findings": findings}))?;
    } else {
        report(&groups, out.paint).iter().try_for_each(|line| out.line(line))?;
    }
    out.flush()?;
    if worst == Verdict::Fail { Err(Failure::new(CHECK, "")) } else { Ok(()) }
}

fn report(groups: &[(&str, Vec<Finding>)], paint: Paint) -> Vec<String> {
    let mut lines = Vec::new();
    let width = groups.iter().flat_map(|(_, f)| f).map(|f| f.name.chars().count()).max().unwrap_or(0);
    for (group, findings) in groups {
        lines.push(paint.strong(group));
        for Finding { name, verdict, found, remedy } in findings {
            let mark = match verdict {
                Verdict::Ok => paint.tone(Tone::Good, "ok  "),
                Verdict::Warn => paint.tone(Tone::Warn, "warn"),
                Verdict::Fail => paint.tone(Tone::Bad, "FAIL"),
            };
            lines.push(format!("  {mark}  {name:<width$}  {found}"));
            for line in remedy.lines() {
                lines.push(format!("        {:width$}  {}", "", paint.tone(Tone::Name, format!("→ {line}"))));
            }
        }
    }
    let number = |verdict| groups.iter().flat_map(|(_, f)| f).filter(|f| f.verdict == verdict).count();
    lines.push(format!(
        "\n{} ok, {}, {}",
        number(Verdict::Ok),
        count(number(Verdict::Warn), "warning"),
        count(number(Verdict::Fail), "failure")
    ));
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_ailment_stands_with_its_remedy_below_it() {
        let findings =
            vec![Finding::ok("kernel", "Linux 6.1"), Finding::warn("memlock", "64 KiB", "raise it\nlog in anew")];
        assert_eq!(
            report(&[("memory", findings)], Paint::OFF),
            [
                "memory",
                "  ok    kernel   Linux 6.1",
                "  warn  memlock  64 KiB",
                "                 → raise it",
                "                 → log in anew",
                "\n1 ok, 1 warning, 0 failures",
            ]
        );
    }

    #[test]
    fn the_worst_finding_is_the_verdict() {
        assert!(Verdict::Fail > Verdict::Warn && Verdict::Warn > Verdict::Ok);
    }
}
