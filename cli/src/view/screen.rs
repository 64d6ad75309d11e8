//! The live screen: map on the left, panel on the right, one line above and one below.

use super::line::clock;
use super::map::{Extent, Map};
use super::nodes::Nodes;
use super::panel;
use super::watch::Watch;
use super::{COLLECT_S, Run};
use crate::exit::Failure;
use ratatui::Frame;
use ratatui::crossterm::event::{self, Event, KeyCode, KeyEventKind, KeyModifiers};
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Color, Modifier, Style};
use ratatui::text::{Line, Span};
use ratatui::widgets::Paragraph;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use simulator::geometry::Point;
use std::time::Duration;
use supervisor::RobotState;

/// Time between two pictures [s].
const FRAME_S: f64 = 0.1;
/// What is seen around the robot when the map follows it [m].
const FOLLOW_M: f64 = 4.0;

/// The terminal in raw mode on its second screen; given back when dropped, and when the program panics.
pub struct Terminal {
    inner: Option<ratatui::DefaultTerminal>,
}

impl Terminal {
    /// Takes the terminal.
    pub fn take() -> Result<Terminal, Failure> {
        let inner = ratatui::try_init().map_err(|e| Failure::from(format!("cannot use the terminal: {e}")))?;
        Ok(Terminal { inner: Some(inner) })
    }

    /// Draws one picture.
    pub fn draw(&mut self, paint: impl FnOnce(&mut Frame<'_>)) -> Result<(), Failure> {
        let Some(inner) = &mut self.inner else { return Ok(()) };
        inner.draw(paint).map(|_| ()).map_err(|e| Failure::from(format!("cannot draw on the terminal: {e}")))
    }

    /// The next event, if one comes within `seconds`. A terminal that has gone is an error: crossterm would read the
    /// end of its input again and again, and never come back.
    pub fn event(seconds: f64) -> Result<Option<Event>, Failure> {
        let failed = |e: std::io::Error| Failure::from(format!("cannot read the keyboard: {e}"));
        let keyboard = std::io::stdin();
        let mut polled = [PollFd::new(&keyboard, PollFlags::IN)];
        let within = Timespec::try_from(Duration::from_secs_f64(seconds.max(0.0))).ok();
        // A signal, a change of the window's size among them, is looked at below.
        let _ = poll(&mut polled, within.as_ref());
        if polled[0].revents().intersects(PollFlags::HUP | PollFlags::ERR | PollFlags::NVAL) {
            return Err(Failure::from("the terminal has gone"));
        }
        match event::poll(Duration::ZERO).map_err(failed)? {
            true => event::read().map(Some).map_err(failed),
            false => Ok(None),
        }
    }
}

impl Drop for Terminal {
    fn drop(&mut self) {
        // On a terminal that has gone, ratatui's own end would complain to a terminal that has gone, and panic.
        let inner = self.inner.take();
        if ratatui::try_restore().is_err() {
            std::mem::forget(inner);
        }
    }
}

/// What the keys have chosen.
#[derive(Debug, Clone, Copy)]
struct View {
    follow: bool,
    beams: bool,
    track: bool,
    /// Greater is nearer.
    zoom: f64,
}

/// Shows the run until it is over. A screen that fails is no reason to leave a robot unattended: it is stopped in order.
pub(super) fn screen(watch: &mut Watch, nodes: &mut Nodes, run: &mut Run<'_>) -> Result<(), Failure> {
    let shown = show(watch, nodes, run);
    if shown.is_err() {
        run.stop();
        while !run.over() {
            nodes.hear(&run.news(runtime::clock::now()));
            runtime::clock::sleep_s(COLLECT_S);
        }
    }
    shown
}

fn show(watch: &mut Watch, nodes: &mut Nodes, run: &mut Run<'_>) -> Result<(), Failure> {
    let mut terminal = Terminal::take()?;
    let mut view = View { follow: false, beams: true, track: true, zoom: 1.0 };
    let (mut next_frame, mut next_read) = (runtime::Time::ZERO, runtime::Time::ZERO);
    while !run.over() {
        let now = runtime::clock::now();
        nodes.hear(&run.news(now));
        watch.collect(now);
        if now >= next_read {
            next_read = now.after_s(1.0);
            nodes.read(watch.tree(), now);
        }
        if now >= next_frame {
            next_frame = now.after_s(FRAME_S);
            let stopping = run.stopping;
            terminal.draw(|frame| draw(frame, watch, nodes, view, stopping))?;
        }
        if let Some(Event::Key(key)) = Terminal::event(COLLECT_S)?
            && key.kind != KeyEventKind::Release
        {
            match key.code {
                KeyCode::Char('c') if key.modifiers.contains(KeyModifiers::CONTROL) => run.stop(),
                KeyCode::Char('q') | KeyCode::Esc => run.stop(),
                KeyCode::Char('f') => view.follow = !view.follow,
                KeyCode::Char('s') => view.beams = !view.beams,
                KeyCode::Char('t') => view.track = !view.track,
                KeyCode::Char('+' | '=') => view.zoom = (view.zoom * 1.25).min(16.0),
                KeyCode::Char('-') => view.zoom = (view.zoom / 1.25).max(0.25),
                _ => {}
            }
            next_frame = runtime::Time::ZERO;
        }
    }
    Ok(())
}

fn draw(frame: &mut Frame<'_>, watch: &Watch, nodes: &Nodes, view: View, stopping: bool) {
    let [top, middle, bottom] =
        Layout::vertical([Constraint::Length(1), Constraint::Min(1), Constraint::Length(1)]).areas(frame.area());
    frame.render_widget(Paragraph::new(heading(watch, nodes, stopping)), top);
    frame.render_widget(Paragraph::new(keys(stopping)), bottom);
    let panel_width = panel_width(middle.width);
    let [left, gap, right] =
        Layout::horizontal([Constraint::Min(1), Constraint::Length(1), Constraint::Length(panel_width)]).areas(middle);
    draw_map(frame, watch, view, left);
    let _ = gap;
    let lines = panel::lines(watch.picture(), nodes, usize::from(right.width), usize::from(right.height));
    frame.render_widget(Paragraph::new(lines), right);
}

/// The panel takes what the map does not need, within bounds; a narrow terminal shows the map alone.
fn panel_width(width: u16) -> u16 {
    match width {
        0..64 => 0,
        _ => (width * 2 / 5).clamp(panel::LEAST_WIDTH, 64),
    }
}

fn draw_map(frame: &mut Frame<'_>, watch: &Watch, view: View, area: Rect) {
    let picture = watch.picture();
    let track = if view.track { watch.track() } else { &[] };
    let map = Map { world: watch.world(), body: watch.body(), picture, track, beams: view.beams };
    let extent = match picture.pose {
        Some(pose) if view.follow => Extent::around(pose.place(), FOLLOW_M / view.zoom, area),
        pose => {
            let (low, high) = map.corners();
            let whole = (low + high) * 0.5;
            // Nearer than the whole, the map keeps the robot in sight.
            let centre = pose.filter(|_| view.zoom > 1.0).map_or(whole, |pose| pose.place());
            let half = (high - low) * (0.5 / view.zoom);
            Extent::fit(centre - half, centre + half, area)
        }
    };
    map.render(frame, area, extent);
    if picture.pose.is_none() {
        let text = "waiting for the first sample …";
        let place = Rect { y: area.y + area.height / 2, height: 1.min(area.height), ..area };
        frame.render_widget(Paragraph::new(text).centered().style(Style::new().fg(Color::DarkGray)), place);
    }
}

fn heading(watch: &Watch, nodes: &Nodes, stopping: bool) -> Line<'static> {
    let picture = watch.picture();
    let bold = Style::new().add_modifier(Modifier::BOLD);
    let (word, color) = match nodes.robot {
        _ if stopping => ("stopping", Color::Yellow),
        Some(state @ RobotState::Running) => (state.word(), Color::Green),
        Some(state @ RobotState::Degraded) => (state.word(), Color::Red),
        Some(state) => (state.word(), Color::Yellow),
        None => ("starting", Color::Yellow),
    };
    let world = watch.world().map_or(String::new(), |world| format!(" in {}", world.name));
    let pose = picture.pose.unwrap_or_default();
    let Point { x_m, y_m } = pose.place();
    Line::from(vec![
        Span::styled(picture.name.clone(), bold),
        Span::raw(world),
        Span::raw(format!("  {}  ", clock(picture.watched_s).trim_start())),
        Span::styled(word, Style::new().fg(color)),
        Span::styled(
            format!("  x {x_m:.2}  y {y_m:.2} m  {:.0}°", pose.heading_rad.to_degrees()),
            Style::new().fg(Color::DarkGray),
        ),
    ])
}

fn keys(stopping: bool) -> Line<'static> {
    let all: &[(&str, &str)] = match stopping {
        true => &[("q", "stop at once")],
        false => &[("q", "stop"), ("f", "follow"), ("+ -", "zoom"), ("s", "sonar"), ("t", "track")],
    };
    let mut spans = Vec::new();
    for (key, what) in all {
        spans.push(Span::styled(format!(" {key} "), Style::new().add_modifier(Modifier::REVERSED)));
        spans.push(Span::styled(format!(" {what}  "), Style::new().fg(Color::DarkGray)));
    }
    Line::from(spans)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_panel_never_takes_the_maps_room_in_a_narrow_terminal() {
        assert_eq!([40, 63, 64, 80, 120, 300].map(panel_width), [0, 0, 36, 36, 48, 64]);
    }
}
