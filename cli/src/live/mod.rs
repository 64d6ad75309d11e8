//! Robots that run on this machine, found by looking: no daemon is asked.
//!
//! The folder `$SINEW_SHM` (else `/dev/shm/sinew`) holds a folder per robot, and in it a file per channel. A robot runs
//! while its supervisor lives; one without a supervisor (a node started by hand, a test) while one of its writers lives.

mod tap;

pub use tap::{Seen, Tap};

use crate::exit::{Failure, NOT_RUNNING, USAGE};
use runtime::channel::{ChannelError, Tree};
use runtime::path;
use runtime::robot::nearest_advice;
use std::path::{Path, PathBuf};

/// A robot whose channels are there.
pub struct LiveRobot {
    /// Its name.
    pub name: String,
    /// Its folder of channels.
    pub folder: PathBuf,
    /// Its channels.
    pub tree: Tree,
}

/// Which robot a command is about.
#[derive(Debug, Clone, Default, clap::Args)]
pub struct Which {
    /// The robot, where several run
    #[arg(long, value_name = "NAME")]
    pub robot: Option<String>,
}

/// The folder that holds the robots of this machine.
pub fn root() -> PathBuf {
    supervisor::base_folder()
}

/// Names of the folders below `root` that can be robots, sorted.
pub fn names(root: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(root).into_iter().flatten().flatten();
    let mut names: Vec<String> = entries
        .filter(|entry| entry.file_type().is_ok_and(|kind| kind.is_dir()))
        .filter_map(|entry| entry.file_name().into_string().ok())
        .filter(|name| path::is_name(name))
        .collect();
    names.sort();
    names
}

/// Whether the robot in `folder` runs.
pub fn runs(folder: &Path) -> bool {
    match supervisor::owner(folder) {
        Some(owner) if owner.is_alive() => true,
        _ => Tree::shared(folder).is_ok_and(|tree| has_living_writer(&tree)),
    }
}

fn has_living_writer(tree: &Tree) -> bool {
    let paths = tree.list().unwrap_or_default();
    paths.iter().any(|path| tree.reader(path, None).is_ok_and(|ring| ring.writer_pid().is_some_and(is_alive)))
}

/// Whether process `pid` lives; one that only waits to be reaped does not.
pub fn is_alive(pid: u32) -> bool {
    let Ok(stat) = std::fs::read(format!("/proc/{pid}/stat")) else { return false };
    let after_name = stat.iter().rposition(|byte| *byte == b')').map_or(0, |at| at + 1);
    !matches!(stat[after_name..].iter().find(|byte| **byte != b' '), Some(b'Z' | b'X') | None)
}

impl Which {
    /// The robot that is meant: the named one, else the only one that runs.
    pub fn find(&self) -> Result<LiveRobot, Failure> {
        find_below(&root(), self.robot.as_deref())
    }
}

/// The robot `name` below `root`, else the only one that runs there.
pub fn find_below(root: &Path, name: Option<&str>) -> Result<LiveRobot, Failure> {
    let names = names(root);
    if let Some(name) = name {
        if !path::is_name(name) {
            let text = format!("\"{name}\" is no robot's name: use 1 to 32 of a-z, 0-9 and _, beginning with a letter");
            return Err(Failure::new(USAGE, text));
        }
        return match names.iter().any(|known| known == name) {
            true => LiveRobot::open(root, name),
            false if names.is_empty() => Err(none_runs(root, &names)),
            false => {
                let text = format!("no robot \"{name}\" is running; {}", nearest_advice(name, &names));
                Err(Failure::new(NOT_RUNNING, text))
            }
        };
    }
    let running: Vec<&String> = names.iter().filter(|name| runs(&root.join(name))).collect();
    match running[..] {
        [] => Err(none_runs(root, &names)),
        [name] => LiveRobot::open(root, name),
        _ => {
            let list = running.iter().map(|name| name.as_str()).collect::<Vec<_>>().join(", ");
            Err(Failure::new(USAGE, format!("several robots are running: {list}; say which with --robot NAME")))
        }
    }
}

fn none_runs(root: &Path, leftovers: &[String]) -> Failure {
    let mut text = "no robot is running: start one with `sinew run`".to_owned();
    if !leftovers.is_empty() {
        let list = leftovers.join(", ");
        text += &format!("\n(of {list} there are leftovers in {}: `sinew ls --robot NAME` shows them)", root.display());
    }
    Failure::new(NOT_RUNNING, text)
}

impl LiveRobot {
    fn open(root: &Path, name: &str) -> Result<LiveRobot, Failure> {
        let folder = root.join(name);
        let tree = Tree::shared(&folder).map_err(|e| Failure::from(format!("robot \"{name}\": {e}")))?;
        Ok(LiveRobot { name: name.to_owned(), folder, tree })
    }

    /// Paths of all channels, sorted.
    pub fn paths(&self) -> Result<Vec<String>, Failure> {
        Ok(self.tree.list()?)
    }

    /// The channel that a person means by `text`: its path, with or without the first slash, or the end of it where only
    /// one path ends so (`sonar`, `base/sonar`).
    pub fn resolve(&self, text: &str) -> Result<String, Failure> {
        let paths = self.paths()?;
        let absolute = format!("/{}", text.trim_matches('/'));
        if paths.contains(&absolute) {
            return Ok(absolute);
        }
        if text.is_empty() || !text.chars().all(|c| c.is_ascii_alphanumeric() || "/_-.".contains(c)) {
            let advice = "write /<layer>/<node>/<port>, as `sinew ls` shows them";
            return Err(Failure::new(USAGE, format!("\"{text}\" is no path: {advice}")));
        }
        let ending: Vec<&String> = paths.iter().filter(|path| path.ends_with(&absolute)).collect();
        match ending[..] {
            [only] => Ok(only.clone()),
            [] => {
                let text = match paths.is_empty() {
                    true => format!("robot \"{}\" has no channels yet: its nodes have not started", self.name),
                    false => format!("robot \"{}\" has no channel {absolute}; {}", self.name, near(&absolute, &paths)),
                };
                Err(Failure::new(NOT_RUNNING, text))
            }
            _ => {
                let list = ending.iter().map(|path| path.as_str()).collect::<Vec<_>>().join(", ");
                Err(Failure::new(USAGE, format!("\"{text}\" could be any of {list}: write more of the path")))
            }
        }
    }

    /// The channel that a person means by `text`, opened.
    pub fn tap(&self, text: &str) -> Result<Tap, Failure> {
        let path = self.resolve(text)?;
        Tap::open(&self.tree, &path).map_err(|e| match e {
            ChannelError::Missing { .. } => Failure::new(NOT_RUNNING, e.to_string()),
            _ => Failure::from(e),
        })
    }

    /// The nodes' paths: folders that hold channels or a call socket, sorted.
    pub fn nodes(&self) -> Vec<String> {
        let mut nodes = Vec::new();
        for layer in runtime::Layer::ALL {
            let entries = std::fs::read_dir(self.folder.join(layer.folder())).into_iter().flatten().flatten();
            let folders = entries.filter(|entry| entry.file_type().is_ok_and(|kind| kind.is_dir()));
            let names = folders.filter_map(|entry| entry.file_name().into_string().ok());
            let mut here: Vec<String> =
                names.filter(|name| path::is_name(name)).map(|name| format!("/{layer}/{name}")).collect();
            here.sort();
            nodes.append(&mut here);
        }
        nodes
    }

    /// The node that a person means by `text`: `/drivers/base`, `drivers/base`, or `base` where only one is called so.
    pub fn resolve_node(&self, text: &str) -> Result<String, Failure> {
        let nodes = self.nodes();
        let absolute = format!("/{}", text.trim_matches('/'));
        let fitting: Vec<&String> = nodes.iter().filter(|node| node.ends_with(&absolute)).collect();
        match fitting[..] {
            _ if nodes.contains(&absolute) => Ok(absolute),
            [only] => Ok(only.clone()),
            [] => {
                let text = format!("robot \"{}\" has no node {absolute}; {}", self.name, near(&absolute, &nodes));
                Err(Failure::new(NOT_RUNNING, text))
            }
            _ => {
                let list = fitting.iter().map(|node| node.as_str()).collect::<Vec<_>>().join(", ");
                Err(Failure::new(USAGE, format!("\"{text}\" could be any of {list}: write the layer too")))
            }
        }
    }
}

/// "did you mean …" without the whole list, which `sinew ls` shows better. `wanted` may be the end of a path alone.
fn near(wanted: &str, known: &[String]) -> String {
    let parts = wanted.matches('/').count();
    let end = |path: &String| {
        let from = path.rmatch_indices('/').nth(parts.saturating_sub(1)).map_or(0, |(at, _)| at);
        path[from..].to_owned()
    };
    let ends: Vec<String> = known.iter().map(end).collect();
    let advice = nearest_advice(wanted, &ends);
    let meant = advice.strip_prefix("did you mean \"").and_then(|rest| rest.split('"').next());
    let whole = meant.and_then(|meant| known.iter().find(|path| path.ends_with(meant)));
    match whole {
        Some(whole) => format!("did you mean {whole}? (`sinew ls` lists all)"),
        None => "`sinew ls` lists what there is".into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mistyped_end_of_a_path_finds_the_whole_one() {
        let known = ["/drivers/base/sonar", "/drivers/base/odometry"].map(str::to_owned);
        assert!(near("/sonor", &known).contains("did you mean /drivers/base/sonar?"));
        assert!(near("/base/odometri", &known).contains("did you mean /drivers/base/odometry?"));
        assert!(near("/drivrs/base/sonar", &known).contains("did you mean /drivers/base/sonar?"));
        assert_eq!(near("/entirely/different/thing", &known), "`sinew ls` lists what there is");
        assert_eq!(near("/x", &[]), "`sinew ls` lists what there is");
    }

    #[test]
    fn this_process_lives_and_no_process_has_the_greatest_number() {
        assert!(is_alive(std::process::id()));
        assert!(!is_alive(u32::MAX));
    }
}
