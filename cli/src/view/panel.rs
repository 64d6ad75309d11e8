//! The panel beside the map: how the robot is, how its nodes are, what the supervisor said.

use super::line::held;
use super::nodes::{NodeRow, Nodes, State};
use super::watch::Picture;
use crate::output::{metres_per_second, span};
use messages::Link;
use ratatui::style::{Color, Modifier, Style};
use ratatui::text::{Line, Span};

/// Width of the panel where there is room for no more [columns].
pub const LEAST_WIDTH: u16 = 36;

/// Columns of the node table beside the names; and of what a wide one tells more.
const TIMES: usize = 25;
const MORE: usize = 16;

const DIM: Style = Style::new().fg(Color::DarkGray);
const BOLD: Style = Style::new().add_modifier(Modifier::BOLD);
const GOOD: Style = Style::new().fg(Color::Green);
const WARN: Style = Style::new().fg(Color::Yellow);
const BAD: Style = Style::new().fg(Color::Red);

/// All lines of a panel of `rows` × `width`.
pub fn lines(picture: &Picture, nodes: &Nodes, width: usize, rows: usize) -> Vec<Line<'static>> {
    let mut lines = state(picture);
    lines.push(Line::default());
    lines.extend(table(nodes, width));
    lines.push(Line::default());
    let left = rows.saturating_sub(lines.len());
    lines.extend(messages(nodes, width, left));
    lines.truncate(rows);
    lines
}

/// The robot itself.
pub fn state(picture: &Picture) -> Vec<Line<'static>> {
    let velocity = picture.velocity();
    let speed = velocity.map_or(f64::NAN, |velocity| velocity.linear_x_m_s);
    let turn = velocity.map_or("    -".into(), |velocity| format!("{:5.0}", velocity.angular_z_rad_s.to_degrees()));
    let mut lines =
        vec![row("speed", vec![Span::styled(metres_per_second(speed), BOLD), Span::raw(format!("  turn {turn} °/s"))])];
    lines.push(row("battery", battery(picture)));
    let motion = match picture.motion.map(|_| held(picture)) {
        None => Span::styled("nothing heard of it", DIM),
        Some(None) => Span::styled("free", GOOD),
        Some(Some(reason)) => Span::styled(format!("held: {reason}"), WARN),
    };
    lines.push(row("motion", vec![motion]));
    if let Some(truth) = picture.truth {
        let [drove, reversed, suffered] = truth.contacts;
        let style = if drove + reversed > 0 { BAD } else { GOOD };
        let contacts = Span::styled(format!("{} caused", drove + reversed), style);
        lines.push(row("contacts", vec![contacts, Span::raw(format!("  {suffered} suffered"))]));
        lines.push(row(
            "way",
            vec![Span::raw(format!("{:.1} m  clearance {:.2} m", truth.distance_m, truth.clearance_m))],
        ));
    } else if let Some(odometry) = picture.odometry {
        let heading = odometry.heading_rad.to_degrees();
        lines.push(row("pose", vec![Span::raw(format!("{:.2} {:.2} m {heading:.0}°", odometry.x_m, odometry.y_m))]));
    }
    lines
}

fn row(name: &'static str, mut value: Vec<Span<'static>>) -> Line<'static> {
    value.insert(0, Span::styled(format!("{name:<10}"), DIM));
    Line::from(value)
}

fn battery(picture: &Picture) -> Vec<Span<'static>> {
    let Some(base) = picture.base else { return vec![Span::styled("nothing heard of the base", DIM)] };
    let link = match base.link {
        link if link == Link::Up as u32 => None,
        link if link == Link::Connecting as u32 => Some("connecting"),
        link if link == Link::NoPort as u32 => Some("no port"),
        link if link == Link::Silent as u32 => Some("silent"),
        link if link == Link::Lost as u32 => Some("lost"),
        _ => Some("foreign device"),
    };
    if let Some(why) = link {
        return vec![Span::styled(format!("link: {why}"), BAD)];
    }
    let mut spans = match base.battery_v.is_finite() {
        true => vec![Span::styled(format!("{:.1} V", base.battery_v), BOLD)],
        false => vec![Span::styled("unknown", DIM)],
    };
    if base.motors_enabled == 0 {
        spans.push(Span::styled("  motors off", WARN));
    }
    if base.front_bumpers | base.rear_bumpers != 0 {
        spans.push(Span::styled("  bumper", BAD));
    }
    if base.stall_left | base.stall_right != 0 {
        spans.push(Span::styled("  stall", BAD));
    }
    spans
}

/// The nodes: name, state, restarts, steps per second, lateness.
fn table(nodes: &Nodes, width: usize) -> Vec<Line<'static>> {
    let name = nodes.rows.iter().map(|row| row.name().chars().count()).max().unwrap_or(0);
    let name = name.clamp(4, width.saturating_sub(TIMES).max(4));
    let wide = width >= name + TIMES + MORE;
    let more = if wide { format!("{:>9}{:>7}", "step p99", "missed") } else { String::new() };
    let heading = format!("{:<name$} {:<9}{:>6}{:>9}{more}", "node", "state", "Hz", "late p99");
    let mut lines = vec![Line::styled(cut(&heading, width), DIM)];
    lines.extend(nodes.rows.iter().map(|row| node(row, name, wide)));
    lines
}

fn node(row: &NodeRow, width: usize, wide: bool) -> Line<'static> {
    let style = match row.state {
        State::Up => GOOD,
        State::Waiting | State::Starting => WARN,
        State::Down | State::Lost => BAD,
    };
    let word = row.state.word();
    let times = match row.restarts {
        0 => String::new(),
        restarts => format!(" ×{restarts}"),
    };
    let pad = 9_usize.saturating_sub(word.len() + times.chars().count());
    let rate = row.rate_hz.map_or("-".into(), |hz| if hz < 100.0 { format!("{hz:.1}") } else { format!("{hz:.0}") });
    let late = row.lateness_p99_s.map_or("-".into(), span);
    Line::from(vec![
        Span::raw(format!("{:<width$} ", cut(row.name(), width))),
        Span::styled(word, style),
        Span::styled(times, WARN),
        Span::raw(" ".repeat(pad)),
        Span::raw(format!("{rate:>6}{late:>9}{}", if wide { more(row) } else { String::new() })),
    ])
}

/// Longest steps but one in a hundred, and steps that ended late.
fn more(row: &NodeRow) -> String {
    let step = row.statistics.map_or("-".into(), |statistics| span(statistics.execution_s[1]));
    let missed = row.statistics.map_or("-".into(), |statistics| statistics.missed_deadlines.to_string());
    format!("{step:>9}{missed:>7}")
}

/// The newest messages that fit.
fn messages(nodes: &Nodes, width: usize, rows: usize) -> Vec<Line<'static>> {
    if rows < 2 || nodes.messages.is_empty() {
        return Vec::new();
    }
    let wrapped: Vec<String> = nodes.messages.iter().flat_map(|message| wrap(message, width)).collect();
    let shown = &wrapped[wrapped.len().saturating_sub(rows - 1)..];
    let heading = Line::styled("messages", DIM);
    std::iter::once(heading).chain(shown.iter().map(|line| Line::raw(line.clone()))).collect()
}

/// `text` in lines of at most `width`, broken between words; what goes on is indented.
fn wrap(text: &str, width: usize) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    let mut line = String::new();
    for word in text.split_whitespace() {
        if !line.trim().is_empty() && line.chars().count() + 1 + word.chars().count() > width {
            lines.push(std::mem::replace(&mut line, " ".into()));
        }
        if !line.is_empty() {
            line.push(' ');
        }
        line += word;
    }
    lines.push(line);
    lines.into_iter().map(|line| cut(&line, width)).collect()
}

fn cut(text: &str, width: usize) -> String {
    match text.chars().count() > width {
        true => text.chars().take(width.saturating_sub(1)).chain(['…']).collect(),
        false => text.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::super::nodes::tests::nodes;
    use super::*;
    use messages::{BaseState, MotionState, NodeStatistics, Truth};

    fn text(lines: &[Line<'_>]) -> Vec<String> {
        lines.iter().map(|line| line.spans.iter().map(|span| span.content.as_ref()).collect::<String>()).collect()
    }

    #[test]
    fn the_panel_of_eight_nodes_fits_into_a_terminal_of_80_by_24() {
        let paths = ["/simulator/world", "/drivers/base", "/perception/odometry", "/actions/forward"];
        let more = ["/actions/steer_clear", "/coordinator/arbiter", "/motion/drive", "/perception/echoes"];
        let mut nodes = nodes(&[paths, more].concat());
        nodes.messages = vec!["base: killed by SIGKILL after 3.0 s; restarted at once".into(); 9];
        nodes.rows[1].restarts = 12;
        let truth = Truth { contacts: [0, 0, 3], ..Truth::default() };
        let picture = Picture { truth: Some(truth), ..Picture::default() };
        let lines = text(&lines(&picture, &nodes, usize::from(LEAST_WIDTH), 22));
        assert!(lines.len() <= 22, "{lines:#?}");
        assert!(lines.iter().all(|line| line.chars().count() <= 36), "{lines:#?}");
        assert!(lines.iter().any(|line| line == "base        up ×12     10.0   120 µs"), "{lines:#?}");
        assert!(lines.iter().any(|line| line.starts_with("contacts  0 caused  3 suffered")), "{lines:#?}");
        assert!(lines.last().unwrap().contains("restarted"), "{lines:#?}");
    }

    #[test]
    fn a_wide_panel_tells_more_of_every_node() {
        let mut nodes = nodes(&["/drivers/base"]);
        let statistics =
            NodeStatistics { missed_deadlines: 7, execution_s: [0.0, 2e-4, 0.0, 0.0], ..NodeStatistics::default() };
        nodes.rows[0].statistics = Some(statistics);
        let lines = text(&lines(&Picture::default(), &nodes, 60, 22));
        assert!(lines.iter().any(|line| line.ends_with("step p99 missed")), "{lines:#?}");
        assert!(lines.iter().any(|line| line.starts_with("base") && line.ends_with("200 µs      7")), "{lines:#?}");
    }

    #[test]
    fn why_the_robot_stands_is_said() {
        let motion = MotionState { stop: 4, ..MotionState::default() };
        let base = BaseState { link: Link::Lost as u32, ..BaseState::default() };
        let picture = Picture { motion: Some(motion), base: Some(base), ..Picture::default() };
        let lines = text(&state(&picture));
        assert!(lines.iter().any(|line| line.contains("held: bumper")), "{lines:?}");
        assert!(lines.iter().any(|line| line.contains("link: lost")), "{lines:?}");
    }

    #[test]
    fn long_messages_are_broken_between_words() {
        assert_eq!(wrap("base: killed by SIGKILL", 12), ["base: killed", "  by SIGKILL"]);
        assert_eq!(wrap("x", 12), ["x"]);
        assert_eq!(wrap("incomprehensibilities", 8), ["incompr…"]);
    }
}
