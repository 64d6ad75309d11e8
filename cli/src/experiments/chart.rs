//! A line chart as SVG.

use std::fmt::Write;

/// One line of a chart.
pub struct Series {
    /// Its name in the legend.
    pub name: String,
    /// Its points.
    pub points: Vec<(f64, f64)>,
}

/// A chart.
pub struct Chart<'a> {
    /// Above it.
    pub title: &'a str,
    /// Of the axis to the right.
    pub x: &'a str,
    /// Of the axis upwards.
    pub y: &'a str,
    /// The lines.
    pub series: &'a [Series],
}

const SIZE: (f64, f64) = (720.0, 400.0);
/// Left, top, right, bottom [px].
const MARGIN: (f64, f64, f64, f64) = (64.0, 40.0, 150.0, 48.0);
const COLOURS: [&str; 9] =
    ["#2e86de", "#e4572e", "#1b7f5c", "#8c6bb1", "#e07a00", "#3b424d", "#b23a6f", "#5a9bd4", "#7fb3a2"];

impl Chart<'_> {
    /// The chart as SVG.
    pub fn svg(&self) -> String {
        let all = || {
            self.series.iter().flat_map(|series| series.points.iter()).filter(|p| p.0.is_finite() && p.1.is_finite())
        };
        let (x_ticks, y_ticks) = (ticks(all().map(|p| p.0)), ticks(all().map(|p| p.1)));
        let (left, top, right, bottom) = MARGIN;
        let (wide, high) = (SIZE.0 - left - right, SIZE.1 - top - bottom);
        let share = |value: f64, ticks: &[f64]| (value - ticks[0]) / (ticks[ticks.len() - 1] - ticks[0]);
        let at = |(x, y): (f64, f64)| (left + wide * share(x, &x_ticks), top + high * (1.0 - share(y, &y_ticks)));
        let mut svg = String::new();
        // Writing to a string cannot fail.
        let _ = writeln!(
            svg,
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{0}\" height=\"{1}\" viewBox=\"0 0 {0} {1}\" \
             font-family=\"Helvetica,Arial,'DejaVu Sans',sans-serif\" font-size=\"12\" fill=\"#333a44\">\n\
             <rect width=\"{0}\" height=\"{1}\" fill=\"#faf9f6\"/>\n\
             <text x=\"{left}\" y=\"24\" font-size=\"15\" font-weight=\"600\">{2}</text>",
            SIZE.0, SIZE.1, self.title
        );
        for &x in &x_ticks {
            let (px, _) = at((x, y_ticks[0]));
            let _ = writeln!(
                svg,
                "<path d=\"M{px:.1} {top}V{:.1}\" stroke=\"#e3dfd5\"/><text x=\"{px:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{}</text>",
                top + high,
                top + high + 16.0,
                label(x)
            );
        }
        for &y in &y_ticks {
            let (_, py) = at((x_ticks[0], y));
            let _ = writeln!(
                svg,
                "<path d=\"M{left} {py:.1}H{:.1}\" stroke=\"#e3dfd5\"/><text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>",
                left + wide,
                left - 6.0,
                py + 4.0,
                label(y)
            );
        }
        let _ = writeln!(
            svg,
            "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{}</text>\n\
             <text transform=\"translate(16 {:.1}) rotate(-90)\" text-anchor=\"middle\">{}</text>",
            left + wide / 2.0,
            SIZE.1 - 12.0,
            self.x,
            top + high / 2.0,
            self.y
        );
        for (k, series) in self.series.iter().enumerate() {
            let colour = COLOURS[k % COLOURS.len()];
            let _ = write!(svg, "<path fill=\"none\" stroke-width=\"1.8\" stroke=\"{colour}\" d=\"");
            for (n, &point) in series.points.iter().filter(|p| p.0.is_finite() && p.1.is_finite()).enumerate() {
                let (x, y) = at(point);
                let _ = write!(svg, "{}{x:.1} {y:.1}", if n == 0 { 'M' } else { 'L' });
            }
            let (x, y) = (SIZE.0 - right + 14.0, top + 10.0 + 18.0 * k as f64);
            let _ = writeln!(
                svg,
                "\"/>\n<path d=\"M{x} {y}h18\" stroke=\"{colour}\" stroke-width=\"2.4\"/><text x=\"{}\" y=\"{}\">{}</text>",
                x + 24.0,
                y + 4.0,
                series.name
            );
        }
        svg.push_str("</svg>\n");
        svg
    }
}

/// Round numbers that span the values.
fn ticks(values: impl Iterator<Item = f64>) -> Vec<f64> {
    let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)));
    let (low, high) = if low < high {
        (low, high)
    } else if low.is_finite() {
        (low - 0.5, high + 0.5)
    } else {
        (0.0, 1.0)
    };
    let mut step = 1e-6;
    let mut factors = [2.0, 2.5, 2.0].into_iter().cycle();
    while (high - low) / step > 8.0 {
        step *= factors.next().unwrap_or(2.0);
    }
    let (from, to) = ((low / step).floor() as i64, (high / step).ceil() as i64);
    (from..=to.max(from + 1)).map(|k| k as f64 * step).collect()
}

fn label(value: f64) -> String {
    let text = format!("{value:.3}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".into() } else { text.into() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_span_the_values() {
        assert_eq!(ticks([0.0, 1.0].into_iter()).first(), Some(&0.0));
        let all = ticks([0.13, 0.87].into_iter());
        assert!(all[0] <= 0.13 && all[all.len() - 1] >= 0.87 && all.len() <= 11, "{all:?}");
        assert_eq!(label(-0.0), "0");
        assert_eq!(label(0.250), "0.25");
    }

    #[test]
    fn a_chart_draws_every_series_and_survives_none() {
        let series = [Series { name: "a".into(), points: vec![(0.0, 0.0), (1.0, 2.0), (2.0, f64::NAN)] }];
        let svg = Chart { title: "t", x: "x", y: "y", series: &series }.svg();
        assert!(svg.contains(">a</text>") && !svg.contains("NaN"));
        assert!(Chart { title: "t", x: "x", y: "y", series: &[] }.svg().ends_with("</svg>\n"));
    }
}
