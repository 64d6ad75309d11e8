//! The track: a line coloured by speed.

use super::TrackPoint;
use super::canvas::{Canvas, View};
use crate::geometry::Point;

/// Points nearer to the last one than this are left out [m].
const SPACING_M: f64 = 0.015;
/// Shades of the colour scale.
pub(super) const SHADES: usize = 12;
/// The scale never ends below this [m/s].
const LEAST_TOP_M_S: f64 = 0.1;
/// Slow to fast: violet, blue, green, amber; told apart also in grey.
const STOPS: [[f64; 3]; 5] =
    [[68.0, 40.0, 120.0], [52.0, 98.0, 160.0], [33.0, 150.0, 140.0], [120.0, 190.0, 80.0], [245.0, 178.0, 36.0]];

/// Draws the track; gives the speed at the end of the colour scale [m/s].
pub(super) fn draw(canvas: &mut Canvas, view: &View, track: &[TrackPoint]) -> f64 {
    let fastest = track.iter().map(|point| point.speed_m_s.abs()).filter(|speed| speed.is_finite()).fold(0.0, f64::max);
    // A round number is easier to read on the scale.
    let top_m_s = ((fastest * 20.0 - 1e-9).ceil() / 20.0).max(LEAST_TOP_M_S);
    let shade = |speed: f64| ((speed.abs() / top_m_s * SHADES as f64) as usize).min(SHADES - 1);
    let mut line: Vec<(f64, f64)> = Vec::new();
    let mut current: Option<(Point, usize)> = None;
    for point in track {
        let place = Point::new(point.x_m, point.y_m);
        let now = shade(point.speed_m_s);
        match current {
            None => current = Some((place, now)),
            Some((last, _)) if (place - last).norm() < SPACING_M => continue,
            Some((_, before)) => {
                if now != before {
                    flush(canvas, &mut line, before, view.at(place));
                }
                current = Some((place, now));
            }
        }
        line.push(view.at(place));
    }
    if let Some((last, before)) = current {
        flush(canvas, &mut line, before, view.at(last));
    }
    top_m_s
}

/// Marks where the track begins.
pub(super) fn draw_start(canvas: &mut Canvas, view: &View, track: &[TrackPoint]) {
    if let Some(first) = track.first() {
        canvas.circle(view.at(Point::new(first.x_m, first.y_m)), 5.0, "start");
    }
}

/// Draws what has gathered, on to `next`, and begins anew.
fn flush(canvas: &mut Canvas, line: &mut Vec<(f64, f64)>, shade: usize, next: (f64, f64)) {
    if !line.is_empty() {
        canvas.polyline(line.drain(..).chain([next]), "track", &colour(shade));
    }
}

/// The colour of a shade.
pub(super) fn colour(shade: usize) -> String {
    let along = shade as f64 / (SHADES - 1) as f64 * (STOPS.len() - 1) as f64;
    let stop = (along as usize).min(STOPS.len() - 2);
    let part = along - stop as f64;
    let mix = |channel: usize| (STOPS[stop][channel] * (1.0 - part) + STOPS[stop + 1][channel] * part).round() as u8;
    format!("#{:02x}{:02x}{:02x}", mix(0), mix(1), mix(2))
}
