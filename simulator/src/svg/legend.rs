//! What the colours and marks mean, how long a metre is, and the run in numbers.

use super::canvas::Canvas;
use super::track::{SHADES, colour};
use super::{Picture, map};
use messages::ContactCause;

/// Least width of the legend, and height of a fact's line [px].
pub(super) const WIDTH_PX: f64 = 620.0;
pub(super) const FACT_PX: f64 = 24.0;
/// Lengths that the scale bar may stand for [m].
const BARS_M: [f64; 8] = [0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0];
/// The bar is the longest of them that stays within this [px].
const BAR_PX: f64 = 130.0;

/// Draws the legend below the map; `scale` is in pixels per metre.
pub(super) fn draw(canvas: &mut Canvas, scale: f64, fastest_m_s: f64, picture: &Picture) {
    let length_m = BARS_M.into_iter().rev().find(|length| length * scale <= BAR_PX).unwrap_or(BARS_M[0]);
    let length = length_m * scale;
    canvas.polyline([(0.0, 24.0), (0.0, 30.0), (length, 30.0), (length, 24.0)].into_iter(), "bar", "");
    canvas.text((0.0, 46.0), "small", &format!("{length_m} m"));
    let mut x = BAR_PX + 30.0;
    if !picture.track.is_empty() {
        canvas.colour_bar((x, 22.0), (120.0, 8.0), (0..SHADES).map(colour));
        canvas.text((x, 46.0), "small", "0");
        canvas.text((x + 72.0, 46.0), "small", &format!("{fastest_m_s:.2} m/s"));
        canvas.circle((x + 150.0, 26.0), 5.0, "start");
        canvas.text((x + 162.0, 30.0), "", "start");
        x += 215.0;
    }
    if !picture.world.persons.is_empty() {
        canvas.circle((x, 26.0), 6.0, "person");
        canvas.text(
            (x + 12.0, 30.0),
            "",
            if picture.ways.is_empty() { "person, at the start" } else { "person, where the way ends" },
        );
        x += if picture.ways.is_empty() { 140.0 } else { 185.0 };
    }
    for (cause, words) in [(false, "contact caused"), (true, "contact suffered")] {
        let of_this_kind = |contact: &&messages::Contact| (contact.cause == ContactCause::Suffered as u64) == cause;
        if picture.contacts.iter().any(|contact| of_this_kind(&contact)) {
            map::mark(canvas, (x, 26.0), cause);
            canvas.text((x + 12.0, 30.0), "", words);
            x += 130.0;
        }
    }
}

/// Draws the facts as a table.
pub(super) fn draw_facts(canvas: &mut Canvas, width_px: f64, facts: &[(&str, String)]) {
    if facts.is_empty() {
        return;
    }
    canvas.rect((0.0, 0.0), (width_px, facts.len() as f64 * FACT_PX + 12.0), "panel");
    for (k, (name, value)) in facts.iter().enumerate() {
        let y = (k + 1) as f64 * FACT_PX;
        canvas.text((12.0, y), "", name);
        canvas.text((width_px - 12.0, y), "value", value);
        if k + 1 < facts.len() {
            canvas.line((12.0, y + 7.0), (width_px - 12.0, y + 7.0), "rule");
        }
    }
}
