//! `sinew ls`: the channels of a running robot, straight from their files.

use crate::exit::{Failure, NOT_RUNNING, USAGE};
use crate::live::{self, LiveRobot, Which};
use crate::output::{Align, Cell, Out, Paint, Table, Tone, bytes, rate, span};
use runtime::channel::RawReader;
use runtime::{Time, clock, path};
use serde::Serialize;

/// Lists channels: type, rate, age, writer
#[derive(Debug, clap::Args)]
pub struct Args {
    /// A folder (/drivers/base), a pattern (/actions/*/proposal) or a word of the path (sonar)
    pattern: Option<String>,
    /// Shows layers and nodes as a tree
    #[arg(long)]
    tree: bool,
    /// Prints one JSON object
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    which: Which,
}

/// What is known of a channel from its file.
#[derive(Debug, Clone, PartialEq, Serialize)]
struct Listed {
    path: String,
    #[serde(rename = "type")]
    kind: String,
    writer_pid: Option<u32>,
    writer_alive: bool,
    generation: u64,
    /// From the samples in the ring; none where there are fewer than two.
    rate_hz: Option<f64>,
    age_s: Option<f64>,
    /// Written since the ring was made.
    samples: u64,
    /// Of these in the ring.
    held: u64,
    depth: usize,
    bytes: u64,
    layout_hash: String,
}

/// The newest samples that a rate is taken from.
const RATE_SAMPLES: u64 = 32;
/// A channel is silent when its newest sample is older than this many periods.
const SILENT_PERIODS: f64 = 5.0;

/// Prints the list.
pub fn run(args: Args) -> Result<(), Failure> {
    let robot = args.which.find()?;
    let paths = in_flow_order(matching(&robot.paths()?, args.pattern.as_deref())?);
    let now = clock::now();
    let listed: Vec<Listed> = paths.iter().filter_map(|path| look(&robot, path, now)).collect();
    let running = live::runs(&robot.folder);
    let mut out = Out::stdout();
    if args.json {
        let value = serde_json::json!({"robot": robot.name, "running": running, "channels": listed});
        out.json(&value)?;
        return out.flush();
    }
    if listed.is_empty() {
        return Err(nothing(&robot, args.pattern.as_deref()));
    }
    if !running {
        eprintln!("robot \"{}\" does not run: these are its leftovers", robot.name);
    }
    match args.tree {
        true => tree_lines(&listed, out.paint).iter().try_for_each(|line| out.line(line))?,
        false => out.table(&table(&listed))?,
    }
    out.flush()
}

fn nothing(robot: &LiveRobot, pattern: Option<&str>) -> Failure {
    let text = match pattern {
        Some(pattern) => format!("robot \"{}\" has no channel like {pattern}; `sinew ls` lists all", robot.name),
        None => format!("robot \"{}\" has no channels yet: its nodes have not started", robot.name),
    };
    Failure::new(NOT_RUNNING, text)
}

/// The paths that `pattern` means.
fn matching(paths: &[String], pattern: Option<&str>) -> Result<Vec<String>, Failure> {
    let Some(pattern) = pattern else { return Ok(paths.to_vec()) };
    let plain = pattern.trim_end_matches('/');
    if !plain.chars().all(|c| c.is_ascii_alphanumeric() || "/_-.*".contains(c)) {
        let text =
            format!("\"{pattern}\" is no pattern: write /layer, /layer/node, /layer/*/port or a word of the path");
        return Err(Failure::new(USAGE, text));
    }
    let parts: Vec<&str> = plain.trim_start_matches('/').split('/').collect();
    let absolute = plain.starts_with('/') || plain.contains('*') || plain.contains('/');
    let fits = |path: &String| {
        let of_path: Vec<&str> = path.trim_start_matches('/').split('/').collect();
        match absolute {
            true => {
                parts == [""] || parts.len() <= of_path.len() && parts.iter().zip(&of_path).all(|(p, q)| like(p, q))
            }
            false => path.contains(plain),
        }
    };
    Ok(paths.iter().filter(|path| fits(path)).cloned().collect())
}

/// The paths in the order of the flow, from the device to the wheels.
fn in_flow_order(mut paths: Vec<String>) -> Vec<String> {
    paths.sort_by_cached_key(|path| (path::split_path(path).ok().map(|(layer, ..)| layer), path.clone()));
    paths
}

/// Whether `part` is what `pattern` says; `*` stands for any text.
fn like(pattern: &str, part: &str) -> bool {
    match pattern.split_once('*') {
        None => pattern == part,
        Some((before, after)) => part
            .strip_prefix(before)
            .is_some_and(|rest| (0..=rest.len()).any(|from| rest.is_char_boundary(from) && like(after, &rest[from..]))),
    }
}

fn look(robot: &LiveRobot, path: &str, now: Time) -> Option<Listed> {
    // A channel that went while we looked is no error.
    let ring = robot.tree.reader(path, None).ok()?;
    let geometry = ring.geometry();
    let head = ring.head();
    let newest = (head > 0).then(|| ring.stamp(head).ok()).flatten();
    let file = robot.folder.join(path.trim_start_matches('/'));
    Some(Listed {
        path: path.to_owned(),
        kind: geometry.type_name.clone(),
        writer_pid: ring.writer_pid(),
        writer_alive: ring.writer_pid().is_some_and(live::is_alive),
        generation: ring.generation(),
        rate_hz: rate_hz(&ring, head),
        age_s: newest.map(|sample| now.since(Time::from_nanos(sample.stamp_ns))),
        samples: head,
        held: if head == 0 { 0 } else { head + 1 - ring.oldest() },
        depth: geometry.depth,
        bytes: std::fs::metadata(file).map_or(0, |file| file.len()),
        layout_hash: format!("{:016x}", geometry.layout_hash),
    })
}

/// Rate of the newest samples in the ring.
fn rate_hz(ring: &RawReader, head: u64) -> Option<f64> {
    let oldest = ring.oldest().max((head + 1).saturating_sub(RATE_SAMPLES));
    let first = (oldest..head).find_map(|sequence| ring.stamp(sequence).ok())?;
    let last = ring.stamp(head).ok()?;
    let span_s = Time::from_nanos(last.stamp_ns).since(Time::from_nanos(first.stamp_ns));
    (span_s > 0.0).then(|| (last.sequence - first.sequence) as f64 / span_s)
}

impl Listed {
    fn silent(&self) -> bool {
        match (self.rate_hz, self.age_s) {
            (Some(rate_hz), Some(age_s)) => age_s > 1.0 && age_s * rate_hz > SILENT_PERIODS,
            (_, age_s) => age_s.is_none_or(|age_s| age_s > 1.0),
        }
    }

    /// How often samples come; how long ago the last one came where they do not any more.
    fn rate_cell(&self) -> Cell {
        match (self.rate_hz, self.age_s) {
            (_, None) => Cell::toned(Tone::Dim, "no sample"),
            (Some(rate_hz), _) if !self.silent() => rate(rate_hz).into(),
            (_, Some(age_s)) if self.silent() => Cell::toned(Tone::Warn, format!("silent {}", span(age_s))),
            _ => Cell::toned(Tone::Dim, "one sample"),
        }
    }

    fn age_cell(&self) -> Cell {
        let tone = if self.silent() { Tone::Warn } else { Tone::Plain };
        self.age_s.map_or(Cell::toned(Tone::Dim, "-"), |age_s| Cell::toned(tone, span(age_s)))
    }

    fn writer_cell(&self) -> Cell {
        let lives = match self.generation {
            0..=1 => String::new(),
            generation => format!(" (life {generation})"),
        };
        match self.writer_pid {
            Some(pid) if self.writer_alive => Cell::toned(Tone::Good, pid.to_string()).and(Tone::Warn, lives),
            Some(pid) => Cell::toned(Tone::Bad, format!("{pid} dead")).and(Tone::Warn, lives),
            None => Cell::toned(Tone::Dim, "none").and(Tone::Warn, lives),
        }
    }
}

/// What the runtime writes for every node stands back.
fn tone_of(port: &str) -> Tone {
    if port == "statistics" || port == "inputs" { Tone::Dim } else { Tone::Name }
}

fn table(listed: &[Listed]) -> Table {
    let mut table = Table::new(&[
        ("PATH", Align::Left),
        ("TYPE", Align::Left),
        ("RATE", Align::Right),
        ("AGE", Align::Right),
        ("SAMPLES", Align::Right),
        ("DEPTH", Align::Right),
        ("SIZE", Align::Right),
        ("WRITER", Align::Left),
    ]);
    for channel in listed {
        let (folder, port) = channel.path.rsplit_once('/').unwrap_or(("", &channel.path));
        table.row([
            Cell::toned(Tone::Dim, format!("{folder}/")).and(tone_of(port), port),
            channel.kind.as_str().into(),
            channel.rate_cell(),
            channel.age_cell(),
            channel.samples.to_string().into(),
            Cell::toned(Tone::Dim, channel.depth.to_string()),
            Cell::toned(Tone::Dim, bytes(channel.bytes)),
            channel.writer_cell(),
        ]);
    }
    table
}

/// The channels below their layers and nodes.
fn tree_lines(listed: &[Listed], paint: Paint) -> Vec<String> {
    let part = |channel: &Listed, index: usize| channel.path.split('/').nth(index).unwrap_or("").to_owned();
    let mut table = Table::new(&[("", Align::Left), ("", Align::Left), ("", Align::Right), ("", Align::Left)]);
    for (index, channel) in listed.iter().enumerate() {
        let (layer, node, port) = (part(channel, 1), part(channel, 2), part(channel, 3));
        let before = index.checked_sub(1).map(|before| (part(&listed[before], 1), part(&listed[before], 2)));
        let new_layer = before.as_ref().is_none_or(|(other, _)| *other != layer);
        let same = |k: usize, with_node: bool| {
            listed.get(k).is_some_and(|next| part(next, 1) == layer && (!with_node || part(next, 2) == node))
        };
        let more_nodes = (index + 1..listed.len()).take_while(|k| same(*k, false)).any(|k| part(&listed[k], 2) != node);
        if new_layer {
            table.row([Cell::toned(Tone::Strong, layer.clone())]);
        }
        if new_layer || before.is_some_and(|(_, other)| other != node) {
            let branch = if more_nodes { "├─ " } else { "└─ " };
            table.row([Cell::toned(Tone::Dim, branch).and(Tone::Strong, node.clone())]);
        }
        let outer = if more_nodes { "│  " } else { "   " };
        let inner = if same(index + 1, true) { "├─ " } else { "└─ " };
        table.row([
            Cell::toned(Tone::Dim, format!("{outer}{inner}")).and(tone_of(&port), port),
            channel.kind.as_str().into(),
            channel.rate_cell(),
            channel.writer_cell(),
        ]);
    }
    table.lines(paint, None)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn paths() -> Vec<String> {
        ["/actions/forward/proposal", "/actions/steer/free_sectors", "/actions/steer/proposal", "/drivers/base/sonar"]
            .map(str::to_owned)
            .into()
    }

    fn found(pattern: &str) -> Vec<String> {
        matching(&paths(), Some(pattern)).unwrap()
    }

    #[test]
    fn folders_patterns_and_words_find_their_channels() {
        assert_eq!(found("/actions").len(), 3);
        assert_eq!(found("/actions/").len(), 3);
        assert_eq!(found("actions/steer").len(), 2);
        assert_eq!(found("/actions/*/proposal").len(), 2);
        assert_eq!(found("/*/st*/*").len(), 2);
        assert_eq!(found("sonar"), ["/drivers/base/sonar"]);
        assert_eq!(found("/").len(), 4);
        assert!(found("/act").is_empty());
        assert!(matching(&paths(), Some("a b")).is_err());
    }

    #[test]
    fn the_list_follows_the_flow() {
        assert_eq!(in_flow_order(paths())[0], "/drivers/base/sonar");
    }

    fn listed(path: &str, age_s: Option<f64>) -> Listed {
        Listed {
            path: path.into(),
            kind: "Ranges".into(),
            writer_pid: Some(7),
            writer_alive: true,
            generation: 1,
            rate_hz: age_s.map(|_| 10.0),
            age_s,
            samples: 100,
            held: 64,
            depth: 64,
            bytes: 40960,
            layout_hash: "0".into(),
        }
    }

    #[test]
    fn the_table_tells_a_steady_channel_from_a_silent_one() {
        let steady = listed("/drivers/base/sonar", Some(0.05));
        let silent = Listed { writer_alive: false, generation: 3, ..listed("/drivers/base/state", Some(12.0)) };
        let empty = Listed { writer_pid: None, generation: 0, ..listed("/drivers/laser/ranges", None) };
        let lines = table(&[steady, silent, empty]).lines(Paint::OFF, None);
        assert_eq!(
            lines,
            [
                "PATH                   TYPE             RATE      AGE  SAMPLES  DEPTH      SIZE  WRITER",
                "/drivers/base/sonar    Ranges        10.0 Hz  50.0 ms      100     64  40.0 KiB  7",
                "/drivers/base/state    Ranges  silent 12.0 s   12.0 s      100     64  40.0 KiB  7 dead (life 3)",
                "/drivers/laser/ranges  Ranges      no sample        -      100     64  40.0 KiB  none",
            ]
        );
    }

    #[test]
    fn the_tree_shows_layers_nodes_and_ports() {
        let all =
            ["/actions/forward/proposal", "/drivers/base/odometry", "/drivers/base/sonar", "/drivers/laser/ranges"];
        let all: Vec<Listed> = all.iter().map(|path| listed(path, Some(0.05))).collect();
        let lines = tree_lines(&all, Paint::OFF);
        let starts: Vec<&str> = lines.iter().map(|line| line.split("  Ranges").next().unwrap().trim_end()).collect();
        assert_eq!(
            starts,
            [
                "actions",
                "└─ forward",
                "   └─ proposal",
                "drivers",
                "├─ base",
                "│  ├─ odometry",
                "│  └─ sonar",
                "└─ laser",
                "   └─ ranges"
            ]
        );
    }
}
