//! `sinew bench laser`: from a scan on the wire to the motor command that answers it, through the whole live robot: the
//! laser's driver, `steer_clear`, coordinator, motion and the base's driver, every node a process of its own under the
//! supervisor. This program is the laser's and the robot's end of the wires, two pseudo-terminals.

mod laser_end;

pub use laser_end::LaserEnd;

use super::reflex::{self, Stimulus};
use super::report::{Report, Target};
use super::scratch::Scratch;
use crate::built_in;
use crate::exit::Failure;
use runtime::NodeType;

/// The target's percentile [µs].
const TARGET_US: f64 = 1000.0;

/// What makes the built-in Pioneer one that steers by a laser. Its driver has the base's place in the order of priorities.
const LASER: &str = r#"
[nodes.laser]
type = "lms200"
trigger = "device"
period_ms = 25
deadline_ms = 20
priority = 74
config = { device = "simulator", mount = { x_m = 0.15 } }
"#;

/// The Pioneer's action by sonar, and by laser.
const BY_SONAR: &str = "priority = 64\nreads.ranges = \"/drivers/base/sonar\"";
const BY_LASER: &str = "priority = 64\nreads.ranges = \"/drivers/laser/ranges\"";

/// Runs the robot for `seconds`.
pub fn run(seconds: f64, types: &[NodeType]) -> Result<Report, Failure> {
    let scratch = Scratch::new()?;
    let folder = scratch.folder("robot")?;
    for (name, bytes) in built_in::PIONEER {
        let file = folder.join(name);
        std::fs::create_dir_all(file.parent().unwrap_or(&folder))?;
        std::fs::write(file, bytes)?;
    }
    let file = folder.join("robot.toml");
    let text = std::fs::read_to_string(&file)?;
    if !text.contains(BY_SONAR) {
        return Err("the built-in Pioneer has no steer_clear by sonar any more".into());
    }
    std::fs::write(&file, text.replace(BY_SONAR, BY_LASER) + LASER)?;
    let mut report =
        reflex::observe("laser", &scratch, Some(&folder), seconds, types, Stimulus::Scans(LaserEnd::open()?))?;
    if let Some(row) = report.rows.iter().find(|row| row.name == "laser_direct") {
        report.targets.push(Target {
            aim: format!("scan on the wire → command on the wire: p99 at most {TARGET_US} µs"),
            measured: format!("{} µs of {} answers", row.p99_us, row.n),
            reached: row.n > 0 && row.p99_us <= TARGET_US,
        });
    }
    Ok(report)
}
