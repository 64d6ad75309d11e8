//! What a mission is, in the words of the command line: the same for `simulate` and `shrink`.

use crate::batch::{Faults, Scenario};
use crate::exit::{CHECK, Failure, USAGE};
use crate::load::{self, Changes};
use crate::picture;
use crate::simulation::{self, Fingerprint, Run};
use runtime::robot::Robot;
use runtime::{NodeType, OpenError};
use std::path::PathBuf;

/// Robot, length, faults and scenario.
#[derive(Debug, Clone, Default, clap::Args)]
pub struct MissionArgs {
    /// Folder or file of the robot; without it the built-in Pioneer
    robot: Option<PathBuf>,
    /// Simulated time of each run, as in 300s, 5min or 1h; a scenario has its own
    #[arg(long = "for", default_value = "60s", value_name = "TIME")]
    length: String,
    /// Injects faults: "chaos", rates per minute as in deaths=10,hangs=4,lost_bytes=0.02, or a TOML file of rates and lists
    #[arg(long, value_name = "FILE")]
    faults: Option<String>,
    /// Missions: goals, timeouts, success conditions (TOML); judges every seed
    #[arg(long, value_name = "FILE")]
    pub scenario: Option<PathBuf>,
    #[command(flatten)]
    changes: Changes,
}

/// The same, read and checked.
pub struct Plan {
    /// Who.
    pub robot: Robot,
    /// What counts as success, and how long it may take.
    pub scenario: Scenario,
    /// What goes wrong.
    pub faults: Option<Faults>,
}

impl MissionArgs {
    /// Reads and checks everything.
    pub fn plan(&self, types: &[NodeType]) -> Result<Plan, Failure> {
        let seconds = crate::output::parse_seconds(&self.length).map_err(|reason| Failure::new(USAGE, reason))?;
        let robot = load::robot(self.robot.as_deref(), &self.changes, types)?;
        robot.graph().map_err(load::errors)?;
        if !robot.nodes.iter().any(|node| node.kind.layer == runtime::Layer::Simulator) {
            let text = format!("robot \"{}\" has no simulator node: there is nothing to simulate it in", robot.name);
            return Err(Failure::new(CHECK, text));
        }
        let faults = self.faults.as_deref().map(|argument| {
            Faults::of_argument(argument, &robot).map_err(|e| Failure::new(USAGE, format!("--faults {argument}: {e}")))
        });
        let faults = faults.transpose()?;
        let scenario = self.read_scenario(&robot, seconds)?;
        Ok(Plan { robot, scenario, faults })
    }

    fn read_scenario(&self, robot: &Robot, seconds: f64) -> Result<Scenario, Failure> {
        let Some(file) = &self.scenario else { return Ok(Scenario::of_length(seconds)) };
        let failed = |reason: String| Failure::new(CHECK, format!("{}: {reason}", file.display()));
        let text = std::fs::read_to_string(file).map_err(|e| failed(format!("cannot be read: {e}")))?;
        let world = picture::world_of(robot);
        Scenario::parse(&text, world.as_ref(), robot.body.max_forward_m_s).map_err(|e| failed(e.to_string()))
    }

    /// The faults as they were written.
    pub fn faults(&self) -> Option<&str> {
        self.faults.as_deref()
    }

    /// The command line that simulates these seeds: `faults` instead of the own ones, `more` at its end.
    pub fn command(&self, seeds: &std::ops::Range<u64>, faults: Option<&str>, more: &[String]) -> String {
        let mut words = vec![program(), "simulate".to_owned()];
        words.extend(self.robot.iter().map(|robot| robot.display().to_string()));
        words.extend(["--seeds".to_owned(), format!("{}..{}", seeds.start, seeds.end)]);
        match &self.scenario {
            Some(file) => words.extend(["--scenario".to_owned(), file.display().to_string()]),
            None => words.extend(["--for".to_owned(), self.length.clone()]),
        }
        if let Some(faults) = faults.or(self.faults()) {
            words.extend(["--faults".to_owned(), faults.to_owned()]);
        }
        words.extend(self.changes.arguments());
        words.extend_from_slice(more);
        words.iter().map(|word| quoted(word)).collect::<Vec<String>>().join(" ")
    }
}

impl Plan {
    /// The mission of a seed.
    pub fn simulate(&self, seed: u64) -> Result<Run, OpenError> {
        simulation::run(&self.robot, seed, self.scenario.timeout_s, self.faults.as_ref())
    }

    /// Tells program, robot, world, scenario and faults apart.
    pub fn setup(&self) -> String {
        let mut hash = Fingerprint::default();
        for node in &self.robot.nodes {
            hash.add(format!("{node:?}").as_bytes());
        }
        hash.add(format!("{:?} {:?} {:?}", self.robot.body, self.scenario, self.faults).as_bytes());
        // A world's file may change under its name.
        hash.add(format!("{:?}", picture::world_of(&self.robot)).as_bytes());
        hash.add(recorder::facts::build_id().as_bytes());
        hash.text()
    }
}

/// How this program was called.
fn program() -> String {
    std::env::args().next().unwrap_or_else(|| "sinew".into())
}

/// As a shell takes it.
fn quoted(text: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "/._-:=,@+".contains(c);
    if !text.is_empty() && text.chars().all(plain) { text.into() } else { format!("'{}'", text.replace('\'', "'\\''")) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_command_carries_everything_that_a_mission_depends_on() {
        let mission = MissionArgs {
            robot: Some("my robot".into()),
            length: "60s".into(),
            faults: Some("deaths=3,hangs=2".into()),
            scenario: Some("a.toml".into()),
            changes: Changes { world: Some("cave:1".into()), set: vec!["a.b='c'".into()], ..Changes::default() },
        };
        let again = mission.command(&(7..8), None, &["--expect".into(), "12ab".into()]);
        assert!(
            again.ends_with(
                "simulate 'my robot' --seeds 7..8 --scenario a.toml --faults deaths=3,hangs=2 --world cave:1 \
                 --set 'a.b='\\''c'\\''' --expect 12ab"
            ),
            "{again}"
        );
        assert!(mission.command(&(7..8), Some("few.toml"), &[]).contains("--faults few.toml"));
    }
}
