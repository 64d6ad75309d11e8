//! A histogram as SVG: even bins between the least and the greatest value, failed missions on top in red.

use super::figures::Metric;
use super::mission::Mission;
use crate::output::number;
use std::fmt::Write;

/// Bars, and the size of the picture [px].
const BARS: usize = 20;
const WIDTH: f64 = 300.0;
const TALL: f64 = 84.0;
/// Room for the greatest count, left of the bars.
const LEFT: f64 = 30.0;

/// The picture; `None` where all values are the same, or none is a number.
pub fn histogram(missions: &[Mission], value: Metric) -> Option<String> {
    let finite = |mission: &&Mission| value(mission).is_finite();
    let values = || missions.iter().filter(finite).map(value);
    let low = values().fold(f64::INFINITY, f64::min);
    let high = values().fold(f64::NEG_INFINITY, f64::max);
    if high <= low || !(high - low).is_finite() {
        return None;
    }
    // Successes and failures of each bar.
    let mut bars = [[0_usize; 2]; BARS];
    for mission in missions.iter().filter(finite) {
        let bar = ((value(mission) - low) / (high - low) * BARS as f64) as usize;
        bars[bar.min(BARS - 1)][usize::from(!mission.succeeded())] += 1;
    }
    let most = bars.iter().map(|[good, bad]| good + bad).max().unwrap_or(1).max(1);
    let wide = (WIDTH - LEFT) / BARS as f64;
    let base = TALL + 8.0;
    let mut text = format!("<svg width=\"{WIDTH}\" height=\"{:.0}\" role=\"img\" font-size=\"11\">", base + 18.0);
    for (k, counts) in bars.iter().enumerate() {
        let mut top = base;
        for (count, colour) in counts.iter().zip(["#3b6fb6", "#b3261e"]).filter(|(count, _)| **count > 0) {
            // What is there is seen.
            let tall = (TALL * *count as f64 / most as f64).max(1.5);
            top -= tall;
            let _ = write!(
                text,
                "<rect x=\"{:.1}\" y=\"{top:.1}\" width=\"{:.1}\" height=\"{tall:.1}\" fill=\"{colour}\"><title>{count}</title></rect>",
                LEFT + k as f64 * wide,
                wide - 1.0
            );
        }
    }
    let _ = write!(
        text,
        "<path d=\"M{LEFT} {base:.1}H{WIDTH}\" stroke=\"#8b95a5\"/><text x=\"{:.0}\" y=\"16\" text-anchor=\"end\">{most}</text>\
         <text x=\"{LEFT}\" y=\"{:.0}\">{}</text><text x=\"{WIDTH}\" y=\"{:.0}\" text-anchor=\"end\">{}</text></svg>",
        LEFT - 5.0,
        base + 14.0,
        number(low),
        base + 14.0,
        number(high)
    );
    Some(text)
}
