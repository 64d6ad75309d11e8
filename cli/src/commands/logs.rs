//! `sinew logs`: what the nodes of a robot wrote to their standard output and error, each in a file of its own.

use crate::exit::{FAILED, Failure, NOT_RUNNING, USAGE};
use crate::live::{self, Which};
use crate::output::{Out, Paint};
use runtime::robot::nearest_advice;
use runtime::{Layer, clock};
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

/// Shows what the nodes of a robot said
#[derive(Debug, clap::Args)]
pub struct Args {
    /// A node, as in base or /drivers/base; without it all
    node: Option<String>,
    /// Goes on with what comes
    #[arg(long, short)]
    follow: bool,
    /// The last lines of each node
    #[arg(long, short = 'n', default_value_t = 20, value_name = "N")]
    lines: usize,
    /// The run before
    #[arg(long, conflicts_with = "follow")]
    previous: bool,
    /// Prints a JSON object per line: node, line
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    which: Which,
}

/// How often the files are looked at [s].
const POLL_S: f64 = 0.1;
/// A supervisor answers within this time, or is not waited for [s].
const ASK_S: f64 = 0.5;
/// More than this is not searched for the last lines [byte].
const MOST_BYTES: u64 = 4 << 20;

/// A log file, and how far it has been read.
struct Log {
    node: String,
    path: PathBuf,
    inode: u64,
    read_to: u64,
    /// A line whose end has not been written yet.
    unfinished: String,
}

/// Prints the logs.
pub fn run(args: Args) -> Result<(), Failure> {
    let folder = folder(&args.which)?;
    let mut logs = find(&folder, args.node.as_deref(), args.previous)?;
    let widest = logs.iter().map(|log| log.node.chars().count()).max().unwrap_or(0);
    let alone = logs.len() == 1;
    let mut out = Out::stdout();
    let paint = out.paint;
    let print = |out: &mut Out, number: usize, node: &str, line: &str| match args.json {
        true => out.json(&serde_json::json!({"node": node, "line": line})),
        false if alone => out.line(line),
        false => out.line(prefixed(paint, number, node, widest, line)),
    };
    for (number, log) in logs.iter_mut().enumerate() {
        for line in log.last_lines(args.lines)? {
            print(&mut out, number, &log.node, &line)?;
        }
    }
    out.flush()?;
    if !args.follow {
        return Ok(());
    }
    loop {
        for (number, log) in logs.iter_mut().enumerate() {
            for line in log.new_lines() {
                print(&mut out, number, &log.node, &line)?;
            }
        }
        out.flush()?;
        clock::sleep_s(POLL_S);
    }
}

fn prefixed(paint: Paint, number: usize, node: &str, widest: usize, line: &str) -> String {
    format!("{} {line}", paint.colour(number, format!("{node:<widest$} │")))
}

/// Folder of the logs: the running robot's, else that of the named one or of the only one that ever ran.
fn folder(which: &Which) -> Result<PathBuf, Failure> {
    let of = |name: &str| {
        let none = "there is no folder for logs: set SINEW_STATE, XDG_STATE_HOME or HOME";
        supervisor::log_folder(name).ok_or_else(|| Failure::new(FAILED, none))
    };
    if let Some(name) = &which.robot {
        return of(name);
    }
    match live::find_below(&live::root(), None) {
        // Its supervisor knows best: it may have been started with another environment.
        Ok(robot) => told_folder(&robot.folder).map_or_else(|| of(&robot.name), Ok),
        // After a crash the logs are wanted most.
        Err(failure) => {
            let base = of("any")?;
            let base = base.parent().map(Path::to_path_buf).unwrap_or_default();
            let names = live::names(&base);
            match &names[..] {
                [only] => of(only),
                [] => Err(failure),
                _ => {
                    let text = format!("which robot? There are logs of {}: say --robot NAME", names.join(", "));
                    Err(Failure::new(failure.code, text))
                }
            }
        }
    }
}

/// Where the supervisor of the robot in `folder` says that it writes.
fn told_folder(folder: &Path) -> Option<PathBuf> {
    let answer = supervisor::ask(folder, "status", ASK_S).ok()?;
    serde_json::from_str::<supervisor::Status>(&answer).ok()?.log_folder.map(PathBuf::from)
}

/// The log files in `folder`, sorted by node.
fn find(folder: &Path, node: Option<&str>, previous: bool) -> Result<Vec<Log>, Failure> {
    let ending = if previous { ".previous.log" } else { ".log" };
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let mut logs: Vec<Log> = entries
        .filter_map(|entry| {
            let name = entry.file_name().into_string().ok()?;
            let node = name.strip_suffix(ending)?;
            (previous || !node.ends_with(".previous")).then(|| Log {
                node: node_of(node),
                path: entry.path(),
                inode: 0,
                read_to: 0,
                unfinished: String::new(),
            })
        })
        .collect();
    logs.sort_by(|a, b| a.node.cmp(&b.node));
    if logs.is_empty() {
        let text = format!("there are no logs in {}: `sinew run` writes them", folder.display());
        return Err(Failure::new(NOT_RUNNING, text));
    }
    let Some(wanted) = node else { return Ok(logs) };
    let names: Vec<String> = logs.iter().map(|log| log.node.clone()).collect();
    let end = format!("/{}", wanted.trim_matches('/'));
    let fits = |name: &String| name == wanted || *name == end || name.ends_with(&end);
    let fitting: Vec<&String> = names.iter().filter(|name| fits(name)).collect();
    match fitting[..] {
        [only] => {
            logs.retain(|log| log.node == *only);
            Ok(logs)
        }
        [] => {
            let instances: Vec<&str> = names.iter().map(|name| name.rsplit('/').next().unwrap_or(name)).collect();
            let instance = wanted.rsplit('/').next().unwrap_or(wanted);
            let text = format!("there is no log of \"{wanted}\"; {}", nearest_advice(instance, &instances));
            Err(Failure::new(NOT_RUNNING, text))
        }
        _ => {
            let list = fitting.iter().map(|name| name.as_str()).collect::<Vec<_>>().join(", ");
            Err(Failure::new(USAGE, format!("\"{wanted}\" could be any of {list}: write the layer too")))
        }
    }
}

/// A log is called after its node's path, with dots: `drivers.base`; or after a group of nodes that share a process.
fn node_of(name: &str) -> String {
    match name.split_once('.').filter(|(layer, _)| Layer::from_folder(layer).is_some()) {
        Some((layer, instance)) => format!("/{layer}/{instance}"),
        None => name.to_owned(),
    }
}

impl Log {
    /// The last `count` lines; reading goes on behind them.
    fn last_lines(&mut self, count: usize) -> Result<Vec<String>, Failure> {
        let failed = |e: std::io::Error| Failure::from(format!("cannot read {}: {e}", self.path.display()));
        let mut file = File::open(&self.path).map_err(failed)?;
        let metadata = file.metadata().map_err(failed)?;
        let from = metadata.len().saturating_sub(MOST_BYTES);
        file.seek(SeekFrom::Start(from)).map_err(failed)?;
        let mut bytes = Vec::new();
        file.take(MOST_BYTES).read_to_end(&mut bytes).map_err(failed)?;
        (self.inode, self.read_to) = (metadata.ino(), from + bytes.len() as u64);
        let lines = self.lines_of(&bytes);
        Ok(lines[lines.len().saturating_sub(count)..].to_vec())
    }

    /// Whole lines that have come since.
    fn new_lines(&mut self) -> Vec<String> {
        let Ok(mut file) = File::open(&self.path) else { return Vec::new() };
        let Ok(metadata) = file.metadata() else { return Vec::new() };
        if metadata.ino() != self.inode || metadata.len() < self.read_to {
            (self.inode, self.read_to) = (metadata.ino(), 0);
        }
        let mut bytes = Vec::new();
        if file.seek(SeekFrom::Start(self.read_to)).is_err() || file.take(MOST_BYTES).read_to_end(&mut bytes).is_err() {
            return Vec::new();
        }
        self.read_to += bytes.len() as u64;
        self.lines_of(&bytes)
    }

    fn lines_of(&mut self, bytes: &[u8]) -> Vec<String> {
        let text = std::mem::take(&mut self.unfinished) + &String::from_utf8_lossy(bytes);
        let mut lines: Vec<String> = text.split('\n').map(str::to_owned).collect();
        self.unfinished = lines.pop().unwrap_or_default();
        lines
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    fn folder_of(name: &str) -> PathBuf {
        let folder = std::env::temp_dir().join(format!("sinew-logs-{name}-{}", std::process::id()));
        let _ = std::fs::remove_dir_all(&folder);
        std::fs::create_dir_all(&folder).unwrap();
        folder
    }

    #[test]
    fn the_last_lines_come_first_and_new_ones_after_them() {
        let folder = folder_of("tail");
        let mut file = File::create(folder.join("drivers.base.log")).unwrap();
        writeln!(file, "one\ntwo\nthree").unwrap();
        let mut logs = find(&folder, Some("/drivers/base"), false).unwrap();
        assert_eq!(logs[0].last_lines(2).ok(), Some(vec!["two".to_owned(), "three".to_owned()]));
        write!(file, "four\nfi").unwrap();
        assert_eq!(logs[0].new_lines(), ["four"]);
        writeln!(file, "ve").unwrap();
        assert_eq!(logs[0].new_lines(), ["five"]);
        std::fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn a_log_that_was_begun_anew_is_read_from_its_beginning() {
        let folder = folder_of("anew");
        let path = folder.join("base.log");
        std::fs::write(&path, "a long first line\n").unwrap();
        let mut log = find(&folder, None, false).unwrap().remove(0);
        log.last_lines(9).unwrap();
        std::fs::rename(&path, folder.join("base.previous.log")).unwrap();
        std::fs::write(&path, "new\n").unwrap();
        assert_eq!(log.new_lines(), ["new"]);
        std::fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn the_run_before_is_kept_apart() {
        let folder = folder_of("previous");
        std::fs::write(folder.join("base.log"), "now\n").unwrap();
        std::fs::write(folder.join("base.previous.log"), "before\n").unwrap();
        let names =
            |previous| find(&folder, None, previous).unwrap().iter().map(|l| l.node.clone()).collect::<Vec<_>>();
        assert_eq!(names(false), ["base"]);
        assert_eq!(names(true), ["base"]);
        assert_eq!(find(&folder, Some("base"), true).unwrap()[0].last_lines(5).ok(), Some(vec!["before".to_owned()]));
        std::fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn a_wrong_node_says_which_there_are() {
        let folder = folder_of("wrong");
        std::fs::write(folder.join("actions.forward.log"), "").unwrap();
        std::fs::write(folder.join("reflex.log"), "").unwrap();
        let failure = find(&folder, Some("forwad"), false).err().unwrap();
        assert_eq!(failure.code, NOT_RUNNING);
        assert_eq!(find(&folder, Some("forward"), false).unwrap()[0].node, "/actions/forward");
        assert_eq!(find(&folder, Some("reflex"), false).unwrap()[0].node, "reflex");
        assert!(failure.message.contains("did you mean \"forward\"?"), "{}", failure.message);
        std::fs::remove_dir_all(folder).unwrap();
    }
}
