//! The drawing: rows on the left, and on the right a lane per written path, from its writer to each reader.
//!
//! ```text
//!   base  p2os · 50 ms, device
//!     command   Command   ◄───────┐
//!     sonar     Ranges    ──┐     │
//! ```

use super::rows::{Row, rows};
use crate::output::{Paint, Tone, count};
use runtime::robot::{Graph, Robot};

/// Left of a row that reads.
const TRIGGERED: char = '◄';
const READ: char = '◅';

/// A path's line: its rows, and the column that it runs in.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Lane {
    path: String,
    rows: Vec<usize>,
    column: usize,
}

impl Lane {
    fn first(&self) -> usize {
        self.rows.iter().copied().min().unwrap_or(0)
    }

    fn last(&self) -> usize {
        self.rows.iter().copied().max().unwrap_or(0)
    }

    fn covers(&self, row: usize) -> bool {
        (self.first()..=self.last()).contains(&row)
    }
}

/// The lines of the drawing.
pub fn draw(robot: &Robot, graph: &Graph, paint: Paint) -> Vec<String> {
    let rows = rows(graph);
    let lanes = lanes(&rows);
    let ports = rows.iter().map(port_width).fold((0, 0), |a, b| (a.0.max(b.0), a.1.max(b.1)));
    let width = rows.iter().map(|row| text(row, ports, Paint::OFF, &lanes).chars().count()).max().unwrap_or(0) + 1;
    let description = if robot.description.is_empty() { String::new() } else { format!(": {}", robot.description) };
    let mut lines = vec![format!("{}{}", paint.strong(&robot.name), paint.dim(description)), String::new()];
    for (index, row) in rows.iter().enumerate() {
        let plain = text(row, ports, Paint::OFF, &lanes).chars().count();
        let line =
            text(row, ports, paint, &lanes) + &" ".repeat(width - plain) + &line_of_lanes(&lanes, index, row, paint);
        lines.push(line.trim_end().to_owned());
    }
    lines.push(String::new());
    let triggers = graph.edges.iter().filter(|edge| edge.triggers).count();
    lines.push(paint.dim(format!(
        "{}, {}   {TRIGGERED} triggers a step ({triggers})   {READ} is read ({})",
        count(graph.nodes.len(), "node"),
        count(graph.edges.len(), "wire"),
        graph.edges.len() - triggers
    )));
    lines
}

/// A lane for every path with a reader; the shortest nearest to the text, none over another.
fn lanes(rows: &[Row]) -> Vec<Lane> {
    let mut lanes: Vec<Lane> = Vec::new();
    for (index, row) in rows.iter().enumerate() {
        if let Row::Out { path, .. } = row {
            lanes.push(Lane { path: path.clone(), rows: vec![index], column: 0 });
        }
    }
    for (index, row) in rows.iter().enumerate() {
        if let Row::In { paths, .. } = row {
            for lane in lanes.iter_mut().filter(|lane| paths.contains(&lane.path)) {
                lane.rows.push(index);
            }
        }
    }
    lanes.retain(|lane| lane.rows.len() > 1);
    lanes.sort_by_key(|lane| (lane.last() - lane.first(), lane.first()));
    for index in 0..lanes.len() {
        let (placed, rest) = lanes.split_at_mut(index);
        let lane = &mut rest[0];
        let free = |column: usize| {
            placed
                .iter()
                .filter(|other| other.column == column)
                .all(|other| other.last() < lane.first() || other.first() > lane.last())
        };
        lane.column = (0..=index).find(|column| free(*column)).unwrap_or(index);
    }
    lanes
}

/// Widths of a port's name and of its type.
fn port_width(row: &Row) -> (usize, usize) {
    match row {
        Row::In { port, kind, .. } | Row::Out { port, kind, .. } => (port.chars().count(), kind.chars().count()),
        _ => (0, 0),
    }
}

fn text(row: &Row, (name, kind_width): (usize, usize), paint: Paint, lanes: &[Lane]) -> String {
    let number = |path: &str| lanes.iter().position(|lane| lane.path == path);
    let port_line = |port: &str, kind: &str, lane: Option<usize>| {
        let port = format!("{port:<name$}");
        let port = lane.map_or_else(|| paint.dim(&port), |lane| paint.colour(lane, &port));
        format!("    {port}  {}", paint.dim(format!("{kind:<kind_width$}")))
    };
    match row {
        Row::Blank => String::new(),
        Row::Layer(layer) => paint.strong(layer),
        Row::Node(instance, kind, released) => {
            format!("  {}  {}", paint.tone(Tone::Strong, instance), paint.dim(format!("{kind} · {released}")))
        }
        Row::In { port, kind, paths, .. } => port_line(port, kind, paths.first().and_then(|path| number(path))),
        Row::Out { port, kind, path } => port_line(port, kind, number(path)),
        Row::Note(note) => format!("    {}", paint.dim(note)),
    }
}

/// What runs right of a row: the arrow's head, then a mark per column.
fn line_of_lanes(lanes: &[Lane], index: usize, row: &Row, paint: Paint) -> String {
    let attached = |lane: &&Lane| lane.rows.contains(&index);
    let far = lanes.iter().filter(attached).map(|lane| lane.column).max();
    let columns = lanes.iter().map(|lane| lane.column + 1).max().unwrap_or(0);
    let numbered =
        |column: usize| lanes.iter().enumerate().find(|(_, lane)| lane.column == column && lane.covers(index));
    // The horizontal line has the colour of the lane that it comes from or goes to.
    let owner = lanes.iter().position(|lane| lane.rows.contains(&index)).unwrap_or(0);
    let head = match (row, far) {
        (_, None) => "  ".to_owned(),
        (Row::In { triggers: true, .. }, _) => paint.colour(owner, format!("{TRIGGERED}─")),
        (Row::In { .. }, _) => paint.colour(owner, format!("{READ}─")),
        _ => paint.colour(owner, "──"),
    };
    let mut line = head;
    for column in 0..columns {
        let before_far = far.is_some_and(|far| column < far);
        match numbered(column) {
            Some((number, lane)) => {
                let mark = match lane.rows.contains(&index) {
                    true => corner(index > lane.first(), index < lane.last(), before_far),
                    false => '│',
                };
                line += &paint.colour(number, mark);
            }
            None if before_far => line += &paint.colour(owner, '─'),
            None => line.push(' '),
        }
        line += &if before_far { paint.colour(owner, '─') } else { " ".into() };
    }
    line
}

fn corner(up: bool, down: bool, right: bool) -> char {
    match (up, down, right) {
        (true, true, true) => '┼',
        (true, true, false) => '┤',
        (true, false, true) => '┴',
        (true, false, false) => '┘',
        (false, true, true) => '┬',
        (false, _, _) => '┐',
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn output(port: &str, path: &str) -> Row {
        Row::Out { port: port.into(), kind: "Twist".into(), path: path.into() }
    }

    fn input(port: &str, paths: &[&str], triggers: bool) -> Row {
        let paths = paths.iter().map(|path| (*path).to_owned()).collect();
        Row::In { port: port.into(), kind: "Twist".into(), paths, triggers }
    }

    fn node(name: &str) -> Row {
        Row::Node(name.into(), "kind".into(), "50 ms".into())
    }

    fn drawn(rows: &[Row]) -> Vec<String> {
        let lanes = lanes(rows);
        let line = |(index, row): (usize, &Row)| line_of_lanes(&lanes, index, row, Paint::OFF).trim_end().to_owned();
        rows.iter().enumerate().map(line).collect()
    }

    #[test]
    fn a_line_leads_from_the_writer_to_every_reader() {
        let rows = [
            node("base"),
            output("sonar", "/drivers/base/sonar"),
            node("forward"),
            input("ranges", &["/drivers/base/sonar"], true),
            node("drive"),
            input("ranges", &["/drivers/base/sonar"], false),
        ];
        assert_eq!(drawn(&rows), ["", "──┐", "  │", "◄─┤", "  │", "◅─┘"]);
    }

    #[test]
    fn what_flows_back_is_drawn_upwards_beside_the_shorter_lines() {
        let rows = [
            input("command", &["/motion/drive/command"], true),
            output("state", "/drivers/base/state"),
            input("state", &["/drivers/base/state"], false),
            output("command", "/motion/drive/command"),
        ];
        assert_eq!(drawn(&rows), ["◄───┐", "──┐ │", "◅─┘ │", "────┘"]);
    }

    #[test]
    fn a_set_joins_several_lines() {
        let rows = [
            output("proposal", "/actions/a/proposal"),
            output("proposal", "/actions/b/proposal"),
            input("proposals", &["/actions/a/proposal", "/actions/b/proposal"], true),
        ];
        assert_eq!(drawn(&rows), ["────┐", "──┐ │", "◄─┴─┘"]);
    }

    #[test]
    fn what_nobody_reads_has_no_line() {
        assert_eq!(drawn(&[output("state", "/motion/drive/state")]), [""]);
    }

    #[test]
    fn lines_that_do_not_meet_share_a_column() {
        let rows = [
            output("a", "/x/a/a"),
            input("a", &["/x/a/a"], true),
            output("b", "/x/b/b"),
            input("b", &["/x/b/b"], true),
        ];
        assert_eq!(drawn(&rows), ["──┐", "◄─┘", "──┐", "◄─┘"]);
    }
}
