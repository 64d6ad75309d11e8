//! The driver's screen: surroundings, state, keys; and the loop that turns keys into wishes.

use super::Limits;
use super::hold::{DEAD_MAN_S, Hold, Push, Way, push_of};
use super::teleop::{Teleop, Wish};
use crate::exit::{Failure, NOT_RUNNING};
use crate::view::{Extent, Map, Terminal, Watch, panel};
use ratatui::Frame;
use ratatui::crossterm::cursor;
use ratatui::crossterm::event::{Event, KeyCode, KeyEvent, KeyEventKind, KeyModifiers};
use ratatui::layout::{Constraint, Layout};
use ratatui::style::{Color, Modifier, Style};
use ratatui::text::{Line, Span};
use ratatui::widgets::Paragraph;
use runtime::{Time, clock};

/// Keys are looked at this often [s].
const LOOK_S: f64 = 0.02;
/// Time between two pictures [s].
const FRAME_S: f64 = 0.1;
/// The terminal is asked for a sign of life this often while a key is held [s].
const ASK_S: f64 = 0.15;
/// What is seen around the robot [m].
const AROUND_M: f64 = 3.0;
/// A robot that has not been heard of for this long is gone [s].
const GONE_S: f64 = 5.0;

/// What a key means.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Meaning {
    Hold(char, Push),
    Release(char),
    Stop,
    Faster,
    Slower,
    Leave,
    Nothing,
}

/// Drives until the person leaves.
pub fn drive(
    terminal: &mut Terminal,
    watch: &mut Watch,
    teleop: &Teleop,
    hold: &mut Hold,
    limits: Limits,
) -> Result<(), Failure> {
    let mut share = 1.0_f64;
    let (mut next_frame, mut next_ask) = (Time::ZERO, Time::ZERO);
    let mut heard = clock::now();
    loop {
        while let Some(event) = Terminal::event(if next_frame > clock::now() { LOOK_S } else { 0.0 })? {
            let now = clock::now();
            match event {
                Event::Key(key) => match meaning(key) {
                    Meaning::Hold(key, push) => hold.press(key, push, now),
                    Meaning::Release(key) => hold.release(key, now),
                    Meaning::Stop => hold.let_go(),
                    Meaning::Faster => share = (share + 0.1).min(1.0),
                    Meaning::Slower => share = (share - 0.1).max(0.1),
                    Meaning::Leave => return Ok(()),
                    Meaning::Nothing => {}
                },
                Event::FocusLost => hold.let_go(),
                _ => {}
            }
            wish(teleop, hold, limits, share, clock::now());
        }
        let now = clock::now();
        let wanted = wish(teleop, hold, limits, share, now);
        if hold.way() == Way::Releases && wanted.is_some() && now >= next_ask {
            next_ask = now.after_s(ASK_S);
            // A broken connection tells of no release, and answers nothing either.
            if cursor::position().is_ok() {
                hold.sign_of_life(clock::now());
            }
        }
        if teleop.is_lost() {
            return Err(Failure::new(NOT_RUNNING, "the robot was stopped while you drove it"));
        }
        watch.collect(now);
        if watch.picture().base.is_some() || watch.picture().odometry.is_some() {
            heard = now;
        } else if now.since(heard) > GONE_S {
            let text = format!("nothing was heard of the robot for {GONE_S} s: it was stopped, or its base is dead");
            return Err(Failure::new(NOT_RUNNING, text));
        }
        if now >= next_frame {
            next_frame = now.after_s(FRAME_S);
            let way = hold.way();
            terminal.draw(|frame| draw(frame, watch, way, wanted, limits, share))?;
        }
    }
}

/// Hands the held keys' wish on.
fn wish(teleop: &Teleop, hold: &mut Hold, limits: Limits, share: f64, now: Time) -> Option<Wish> {
    let wanted = hold.wanted(now).map(|wanted| {
        let Push { forward, turn } = wanted.push;
        let greatest_m_s = if forward < 0.0 { limits.backward_m_s } else { limits.forward_m_s };
        Wish {
            forward_m_s: share * forward * greatest_m_s,
            turn_rad_s: share * turn * limits.turn_rad_s,
            until: wanted.until,
        }
    });
    teleop.wish(wanted.unwrap_or_default());
    wanted
}

fn meaning(key: KeyEvent) -> Meaning {
    let held = match key.code {
        KeyCode::Up => Some('↑'),
        KeyCode::Down => Some('↓'),
        KeyCode::Left => Some('←'),
        KeyCode::Right => Some('→'),
        KeyCode::Char(c) if !key.modifiers.contains(KeyModifiers::CONTROL) => Some(c.to_ascii_lowercase()),
        _ => None,
    };
    let push = held.and_then(|key| Some((key, push_of(key)?)));
    match (key.kind, push, key.code) {
        (KeyEventKind::Release, Some((key, _)), _) => Meaning::Release(key),
        (KeyEventKind::Release, ..) => Meaning::Nothing,
        (_, Some((key, push)), _) => Meaning::Hold(key, push),
        (_, _, KeyCode::Char('c')) if key.modifiers.contains(KeyModifiers::CONTROL) => Meaning::Leave,
        (_, _, KeyCode::Char('q') | KeyCode::Esc) => Meaning::Leave,
        (_, _, KeyCode::Char(' ' | 'k')) => Meaning::Stop,
        (_, _, KeyCode::Char('+' | '=')) => Meaning::Faster,
        (_, _, KeyCode::Char('-')) => Meaning::Slower,
        _ => Meaning::Nothing,
    }
}

fn draw(frame: &mut Frame<'_>, watch: &Watch, way: Way, wanted: Option<Wish>, limits: Limits, share: f64) {
    let [middle, bottom] = Layout::vertical([Constraint::Min(1), Constraint::Length(1)]).areas(frame.area());
    let [left, _, right] =
        Layout::horizontal([Constraint::Min(1), Constraint::Length(1), Constraint::Length(panel::LEAST_WIDTH)])
            .areas(middle);
    let picture = watch.picture();
    let map = Map { world: watch.world(), body: watch.body(), picture, track: watch.track(), beams: true };
    let centre = picture.pose.unwrap_or_default().place();
    map.render(frame, left, Extent::around(centre, AROUND_M, left));
    let bold = Style::new().add_modifier(Modifier::BOLD);
    let mut lines =
        vec![Line::from(vec![Span::styled("driving ", bold), Span::raw(picture.name.clone())]), Line::default()];
    lines.extend(wishes(wanted, limits, share));
    lines.push(Line::default());
    lines.extend(panel::state(picture));
    lines.push(Line::default());
    lines.extend(legend());
    lines.push(Line::default());
    lines.extend(dead_man(way));
    frame.render_widget(Paragraph::new(lines), right);
    let foot = " the robot's own actions wait while you drive; they go on when you leave (q)";
    frame.render_widget(Paragraph::new(foot).style(Style::new().fg(Color::DarkGray)), bottom);
}

/// What is asked of the robot, as bars.
fn wishes(wanted: Option<Wish>, limits: Limits, share: f64) -> Vec<Line<'static>> {
    let Wish { forward_m_s, turn_rad_s, .. } = wanted.unwrap_or_default();
    let row = |name: &str, value: f64, most: f64, unit: &str| {
        let style = if value == 0.0 { Style::new().fg(Color::DarkGray) } else { Style::new().fg(Color::Green) };
        Line::from(vec![
            Span::styled(format!("{name:<8}"), Style::new().fg(Color::DarkGray)),
            Span::styled(bar(value / most.max(1e-9)), style),
            Span::raw(format!(" {value:5.2} {unit}")),
        ])
    };
    vec![
        row("forward", forward_m_s, limits.forward_m_s, "m/s"),
        row("turn", turn_rad_s, limits.turn_rad_s, "rad/s"),
        Line::styled(
            format!("{:<8}{:.0} % of {:.2} m/s", "speed", 100.0 * share, limits.forward_m_s),
            Style::new().fg(Color::DarkGray),
        ),
    ]
}

/// A bar from the middle, for −1…1.
fn bar(value: f64) -> String {
    const HALF: i32 = 6;
    let filled = (value.clamp(-1.0, 1.0) * f64::from(HALF)).round() as i32;
    (-HALF..=HALF)
        .map(|k| match k {
            0 => '│',
            k if k.signum() == filled.signum() && k.abs() <= filled.abs() => '█',
            _ => '·',
        })
        .collect()
}

fn legend() -> Vec<Line<'static>> {
    let keys = [
        ("↑ ↓ ← →", "or W A S D: drive, turn"),
        ("U O", "arcs to the left, right"),
        ("space", "stop"),
        ("+ -", "faster, slower"),
        ("q Esc", "leave"),
    ];
    let row = |(key, what): (&'static str, &'static str)| {
        Line::from(vec![
            Span::styled(format!("{key:<9}"), Style::new().add_modifier(Modifier::BOLD)),
            Span::styled(what, Style::new().fg(Color::DarkGray)),
        ])
    };
    keys.map(row).into()
}

fn dead_man(way: Way) -> Vec<Line<'static>> {
    let (first, second) = match way {
        Way::Releases => ("stops when the key is released", "(this terminal reports releases)".to_owned()),
        Way::Repeats => ("stops when the key's repeat ends", format!("(after {DEAD_MAN_S} s: no releases here)")),
    };
    let style = Style::new().fg(Color::Yellow);
    vec![Line::styled(first, style), Line::styled(second, style)]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn key(code: KeyCode, kind: KeyEventKind) -> Meaning {
        meaning(KeyEvent::new_with_kind(code, KeyModifiers::NONE, kind))
    }

    #[test]
    fn keys_mean_what_people_expect() {
        assert!(matches!(key(KeyCode::Up, KeyEventKind::Press), Meaning::Hold('↑', Push { forward: 1.0, turn: 0.0 })));
        assert!(matches!(key(KeyCode::Char('a'), KeyEventKind::Repeat), Meaning::Hold('a', Push { turn: 1.0, .. })));
        assert_eq!(key(KeyCode::Up, KeyEventKind::Release), Meaning::Release('↑'));
        assert_eq!(key(KeyCode::Char('q'), KeyEventKind::Press), Meaning::Leave);
        assert_eq!(key(KeyCode::Esc, KeyEventKind::Press), Meaning::Leave);
        assert_eq!(key(KeyCode::Char(' '), KeyEventKind::Press), Meaning::Stop);
        assert_eq!(key(KeyCode::Char('x'), KeyEventKind::Press), Meaning::Nothing);
        let ctrl_c = KeyEvent::new(KeyCode::Char('c'), KeyModifiers::CONTROL);
        assert_eq!(meaning(ctrl_c), Meaning::Leave);
    }

    #[test]
    fn bars_grow_from_the_middle() {
        assert_eq!(bar(0.0), "······│······");
        assert_eq!(bar(0.5), "······│███···");
        assert_eq!(bar(-1.0), "██████│······");
    }
}
