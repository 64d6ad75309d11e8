//! What goes wrong in a mission: rates from which every seed draws its faults, a list of faults, or both.
//!
//! ```toml
//! deaths = 14.0                 # a minute; hangs, slowdowns, bursts, stops, supervisor as well
//! hang_s = 5.0                  # and how long or how strong each may be at most
//! [[fault]]                     # besides, in every mission
//! kind = "hang"
//! at_s = 12.0
//! node = "/actions/steer_clear"
//! for_s = 2.0
//! ```

use runtime::robot::Robot;
use serde::Serialize;
use std::path::Path;
use supervisor::{FaultRates, PlannedFault};

/// See the module's text.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Faults {
    /// How often each kind, from the seed.
    pub rates: FaultRates,
    /// In every mission.
    pub listed: Vec<PlannedFault>,
}

/// Most faults of a list.
const MOST_LISTED: usize = 100_000;

impl From<FaultRates> for Faults {
    fn from(rates: FaultRates) -> Faults {
        Faults { rates, listed: Vec::new() }
    }
}

impl From<Vec<PlannedFault>> for Faults {
    fn from(listed: Vec<PlannedFault>) -> Faults {
        Faults { rates: FaultRates::default(), listed }
    }
}

impl Faults {
    /// From the command line: "chaos", `KEY=VALUE,…`, or a file.
    pub fn of_argument(argument: &str, robot: &Robot) -> Result<Faults, String> {
        if argument == "chaos" {
            return Ok(FaultRates::CHAOS.into());
        }
        let is_file = Path::new(argument).exists() || !argument.contains('=');
        let text = match is_file {
            true => std::fs::read_to_string(argument)
                .map_err(|e| format!("cannot be read: {e}; write \"chaos\", KEY=VALUE,… or a file"))?,
            false => argument.replace(',', "\n"),
        };
        Faults::parse(&text, robot)
    }

    /// Reads a file's text, and checks it against the robot.
    pub fn parse(text: &str, robot: &Robot) -> Result<Faults, String> {
        let mut table: toml::Table = text.parse().map_err(|e: toml::de::Error| e.to_string().trim_end().to_owned())?;
        let mut listed = Vec::new();
        match table.remove("fault") {
            None => {}
            Some(toml::Value::Array(faults)) if faults.len() <= MOST_LISTED => {
                for (index, fault) in faults.into_iter().enumerate() {
                    let failed = |reason: String| format!("fault {}: {reason}", index + 1);
                    let fault: PlannedFault =
                        fault.try_into().map_err(|e: toml::de::Error| failed(e.message().to_owned()))?;
                    fault.flaw(robot).map_or(Ok(()), |flaw| Err(failed(flaw)))?;
                    listed.push(fault);
                }
            }
            Some(toml::Value::Array(faults)) => {
                return Err(format!("{} faults are listed; at most {MOST_LISTED} can be", faults.len()));
            }
            Some(_) => return Err("fault is no list; write each fault as a [[fault]] table".into()),
        }
        let rates: FaultRates = table.try_into().map_err(|e: toml::de::Error| e.message().to_owned())?;
        rates.flaw().map_or(Ok(()), Err)?;
        Ok(Faults { rates, listed })
    }

    /// Everything that goes wrong in the first `seconds` of the mission of `seed`, by time.
    pub fn of(&self, robot: &Robot, seed: u64, seconds: f64) -> Vec<PlannedFault> {
        let mut all = self.rates.draw(robot, seed, seconds);
        all.extend(self.listed.iter().filter(|fault| fault.at_s() < seconds).cloned());
        all.sort_by(|a, b| a.at_s().total_cmp(&b.at_s()));
        all
    }
}

/// A list as a file's text.
pub fn to_toml(listed: &[PlannedFault]) -> Result<String, toml::ser::Error> {
    #[derive(Serialize)]
    struct File<'a> {
        fault: &'a [PlannedFault],
    }
    toml::to_string(&File { fault: listed })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::built_in::node_types;

    fn pioneer() -> Robot {
        crate::load::robot(None, &crate::load::Changes::default(), &node_types(&[])).unwrap()
    }

    #[test]
    fn a_drawn_list_reads_back_from_its_file_to_the_last_bit() {
        let robot = pioneer();
        let drawn = Faults::from(FaultRates::CHAOS).of(&robot, 5, 600.0);
        assert!(drawn.len() > 200, "{}", drawn.len());
        let read = Faults::parse(&to_toml(&drawn).unwrap(), &robot).unwrap();
        assert_eq!(read.listed, drawn);
        assert_eq!(read.of(&robot, 99, 600.0), drawn, "whatever the seed");
        assert_eq!(to_toml(&[]).unwrap().parse::<toml::Table>().unwrap().len(), 1);
    }

    #[test]
    fn a_longer_mission_begins_with_the_faults_of_a_shorter_one() {
        let robot = pioneer();
        let faults = Faults::from(FaultRates::CHAOS);
        let (short, long) = (faults.of(&robot, 1, 20.0), faults.of(&robot, 1, 60.0));
        assert_eq!(short, long[..short.len()]);
    }

    #[test]
    fn what_makes_no_sense_is_refused_with_the_reason() {
        let robot = pioneer();
        let refused = |text: &str| Faults::parse(text, &robot).unwrap_err();
        let fault = |words: &str| refused(&format!("[[fault]]\n{words}"));
        for (text, wanted) in [
            (refused("deaths = -1"), "deaths is -1"),
            (refused("deaths = \"often\""), "invalid type"),
            (refused("deths = 1"), "unknown field `deths`"),
            (refused("deaths = "), "TOML parse error"),
            (refused("fault = 3"), "[[fault]]"),
            (fault("at_s = 1.0"), "fault 1: missing field `kind`"),
            (fault("kind = \"flood\"\nat_s = 1.0"), "unknown variant `flood`"),
            (fault("kind = \"hang\"\nat_s = 1.0\nfor_s = 1.0\nnode = \"/actions/nobody\""), "nodes are /drivers/base"),
            (fault("kind = \"death\"\nat_s = 1.0\nnode = \"/simulator/world\""), "never fails"),
            (fault("kind = \"death\"\nat_s = nan\nnode = \"/drivers/base\""), "at_s is NaN"),
            (fault("kind = \"supervisor\"\nat_s = 1.0\nfor_s = -2.0"), "for_s is -2"),
            (fault("kind = \"burst\"\nat_s = 1.0\nfor_s = 1.0\nshare = 7.0"), "share is 7"),
            (fault("kind = \"supervisor\"\nat_s = 1.0\nfor_s = 0.1\ncolour = 1"), "unknown field `colour`"),
        ] {
            assert!(text.contains(wanted), "{wanted}: {text}");
        }
    }
}
