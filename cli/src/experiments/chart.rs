//! A chart as SVG: lines, bars, dots, with axes, units, a legend.

use std::fmt::Write;

/// How the points of a series are drawn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Mark {
    /// One line through all of them.
    Line,
    /// A bar of this width, in the units of the axis to the right, up to each.
    Bars(f64),
    /// A ring of this radius, in the units of the axis to the right, about each.
    Rings(f64),
}

/// One series of a chart.
#[derive(Debug, Clone)]
pub struct Series {
    /// Its name in the legend; nameless ones are not in it.
    pub name: String,
    /// Its points.
    pub points: Vec<(f64, f64)>,
    /// How they are drawn.
    pub mark: Mark,
    /// Which of the colours.
    pub colour: usize,
}

impl Series {
    /// A line in the colour of its number.
    pub fn line(name: impl Into<String>, colour: usize, points: Vec<(f64, f64)>) -> Series {
        Series { name: name.into(), points, mark: Mark::Line, colour }
    }

    /// How many of `values` there are in each of the bins of `width` from zero on.
    pub fn histogram(name: impl Into<String>, colour: usize, values: &[f64], width: f64) -> Series {
        let bin = |value: f64| (value / width).floor().clamp(0.0, 10_000.0) as usize;
        let finite = || values.iter().copied().filter(|value| value.is_finite());
        let mut counts = vec![0_u32; finite().map(bin).max().map_or(0, |most| most + 1)];
        finite().for_each(|value| counts[bin(value)] += 1);
        let points = counts.iter().enumerate().filter(|(_, count)| **count > 0);
        let points = points.map(|(k, count)| ((k as f64 + 0.5) * width, f64::from(*count))).collect();
        Series { name: name.into(), points, mark: Mark::Bars(width), colour }
    }
}

/// A chart.
#[derive(Debug, Clone)]
pub struct Chart<'a> {
    /// Above it.
    pub title: &'a str,
    /// Of the axis to the right.
    pub x: &'a str,
    /// Of the axis upwards.
    pub y: &'a str,
    /// What is drawn, the first at the bottom.
    pub series: &'a [Series],
    /// Bounds: a dashed line upwards at each, with its name.
    pub bounds: &'a [(f64, &'a str)],
    /// Whether a unit is as long upwards as to the right: a map.
    pub is_map: bool,
}

const WIDE: f64 = 720.0;
/// Left, top, right, bottom [px].
const MARGIN: (f64, f64, f64, f64) = (64.0, 40.0, 168.0, 48.0);
const HIGH: f64 = 312.0;
const COLOURS: [&str; 9] =
    ["#2e86de", "#e4572e", "#1b7f5c", "#8c6bb1", "#e07a00", "#3b424d", "#b23a6f", "#5a9bd4", "#7fb3a2"];

/// From values to places in the picture.
struct Frame {
    x: Vec<f64>,
    y: Vec<f64>,
    wide: f64,
    high: f64,
}

impl Frame {
    fn of(chart: &Chart<'_>) -> Frame {
        let all = || chart.series.iter().flat_map(Series::reach).filter(|p| p.0.is_finite() && p.1.is_finite());
        let bounds = chart.bounds.iter().map(|bound| bound.0);
        let x = ticks(all().map(|p| p.0).chain(bounds));
        let y = ticks(all().map(|p| p.1));
        let wide = WIDE - MARGIN.0 - MARGIN.2;
        let high = if chart.is_map { (wide * span(&y) / span(&x)).min(2.0 * wide) } else { HIGH };
        Frame { x, y, wide, high }
    }

    fn right(&self, x: f64) -> f64 {
        MARGIN.0 + self.wide * (x - self.x[0]) / span(&self.x)
    }

    fn down(&self, y: f64) -> f64 {
        MARGIN.1 + self.high * (1.0 - (y - self.y[0]) / span(&self.y))
    }
}

impl Series {
    /// The corners of all that is drawn of it.
    fn reach(&self) -> impl Iterator<Item = (f64, f64)> + '_ {
        let (aside, up, from_zero) = match self.mark {
            Mark::Line => (0.0, 0.0, false),
            Mark::Bars(width) => (0.5 * width, 0.0, true),
            Mark::Rings(radius) => (radius, radius, false),
        };
        let corners =
            move |&(x, y): &(f64, f64)| [(x - aside, if from_zero { 0.0 } else { y - up }), (x + aside, y + up)];
        self.points.iter().flat_map(corners)
    }
}

impl Chart<'_> {
    /// The chart as SVG.
    pub fn svg(&self) -> String {
        let frame = Frame::of(self);
        let (left, top, _, bottom) = MARGIN;
        let (whole, floor) = (top + frame.high + bottom, top + frame.high);
        let mut svg = String::new();
        // Writing to a string cannot fail.
        let _ = writeln!(
            svg,
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{WIDE}\" height=\"{whole:.0}\" viewBox=\"0 0 {WIDE} {whole:.0}\" \
             font-family=\"Helvetica,Arial,'DejaVu Sans',sans-serif\" font-size=\"12\" fill=\"#333a44\">\n\
             <rect width=\"{WIDE}\" height=\"{whole:.0}\" fill=\"#faf9f6\"/>\n\
             <text x=\"{left}\" y=\"24\" font-size=\"15\" font-weight=\"600\">{}</text>",
            self.title
        );
        for &x in &frame.x {
            let (px, text) = (frame.right(x), label(x));
            let below = floor + 16.0;
            let _ = writeln!(
                svg,
                "<path d=\"M{px:.1} {top}V{floor:.1}\" stroke=\"#e3dfd5\"/>\
                 <text x=\"{px:.1}\" y=\"{below:.1}\" text-anchor=\"middle\">{text}</text>"
            );
        }
        for &y in &frame.y {
            let (py, text) = (frame.down(y), label(y));
            let (end, before, line) = (left + frame.wide, left - 6.0, py + 4.0);
            let _ = writeln!(
                svg,
                "<path d=\"M{left} {py:.1}H{end:.1}\" stroke=\"#e3dfd5\"/>\
                 <text x=\"{before:.1}\" y=\"{line:.1}\" text-anchor=\"end\">{text}</text>"
            );
        }
        let _ = writeln!(
            svg,
            "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{}</text>\n\
             <text transform=\"translate(16 {:.1}) rotate(-90)\" text-anchor=\"middle\">{}</text>",
            left + frame.wide / 2.0,
            whole - 12.0,
            self.x,
            top + frame.high / 2.0,
            self.y
        );
        self.series.iter().for_each(|series| series.draw(&frame, &mut svg));
        for (bound, _) in self.bounds {
            let px = frame.right(*bound);
            let _ = writeln!(
                svg,
                "<path d=\"M{px:.1} {top}V{floor:.1}\" stroke=\"#3b424d\" stroke-dasharray=\"5 4\" fill=\"none\"/>"
            );
        }
        self.legend(&frame, &mut svg);
        svg.push_str("</svg>\n");
        svg
    }

    fn legend(&self, frame: &Frame, svg: &mut String) {
        let x = MARGIN.0 + frame.wide + 14.0;
        let named = self.series.iter().filter(|series| !series.name.is_empty());
        let entries = named.map(|series| (COLOURS[series.colour % COLOURS.len()], "", series.name.as_str()));
        let bounds = self.bounds.iter().map(|(_, name)| ("#3b424d", " stroke-dasharray=\"5 4\"", *name));
        for (k, (colour, dashes, name)) in entries.chain(bounds).enumerate() {
            let y = MARGIN.1 + 10.0 + 18.0 * k as f64;
            let _ = writeln!(
                svg,
                "<path d=\"M{x} {y}h18\" stroke=\"{colour}\" stroke-width=\"2.4\"{dashes}/><text x=\"{}\" y=\"{}\">{name}</text>",
                x + 24.0,
                y + 4.0
            );
        }
    }
}

impl Series {
    fn draw(&self, frame: &Frame, svg: &mut String) {
        let colour = COLOURS[self.colour % COLOURS.len()];
        let points = self.points.iter().filter(|p| p.0.is_finite() && p.1.is_finite());
        let scale = frame.wide / span(&frame.x);
        match self.mark {
            Mark::Line => {
                let _ = write!(svg, "<path fill=\"none\" stroke-width=\"1.6\" stroke=\"{colour}\" d=\"");
                for (n, &(x, y)) in points.enumerate() {
                    let pen = if n == 0 { 'M' } else { 'L' };
                    let _ = write!(svg, "{pen}{:.1} {:.1}", frame.right(x), frame.down(y));
                }
                let _ = writeln!(svg, "\"/>");
            }
            Mark::Bars(width) => {
                let _ = write!(svg, "<path fill=\"{colour}\" fill-opacity=\"0.55\" stroke=\"{colour}\" d=\"");
                for &(x, y) in points {
                    let (left, wide) = (frame.right(x - 0.5 * width), width * scale);
                    let _ = write!(svg, "M{left:.1} {:.1}V{:.1}h{wide:.1}V{0:.1}z", frame.down(0.0), frame.down(y));
                }
                let _ = writeln!(svg, "\"/>");
            }
            Mark::Rings(radius) => {
                let _ = writeln!(svg, "<g fill=\"none\" stroke=\"{colour}\">");
                for &(x, y) in points {
                    let (px, py, r) = (frame.right(x), frame.down(y), radius * scale);
                    let _ = writeln!(svg, "<circle cx=\"{px:.1}\" cy=\"{py:.1}\" r=\"{r:.1}\"/>");
                }
                let _ = writeln!(svg, "</g>");
            }
        }
    }
}

fn span(ticks: &[f64]) -> f64 {
    ticks[ticks.len() - 1] - ticks[0]
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
    // A value at a tick needs no further one, whatever its last digit.
    let (from, to) = ((low / step + 1e-6).floor() as i64, (high / step - 1e-6).ceil() as i64);
    (from..=to.max(from + 1)).map(|k| k as f64 * step).collect()
}

fn label(value: f64) -> String {
    let text = format!("{value:.3}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".into() } else { text.replace('-', "−") }
}

#[cfg(test)]
mod tests {
    use super::*;

    const EMPTY: Chart<'_> = Chart { title: "t", x: "x", y: "y", series: &[], bounds: &[], is_map: false };

    #[test]
    fn ticks_are_round_and_span_the_values() {
        assert_eq!(ticks([0.0, 1.0].into_iter()).first(), Some(&0.0));
        let all = ticks([0.13, 0.87].into_iter());
        assert!(all[0] <= 0.13 && all[all.len() - 1] >= 0.87 && all.len() <= 11, "{all:?}");
        assert_eq!(ticks([0.0, 0.1 + 0.2].into_iter()).last().map(|tick| label(*tick)), Some("0.3".into()));
        assert_eq!((label(-0.0), label(0.250), label(-0.5)), ("0".into(), "0.25".into(), "−0.5".into()));
    }

    #[test]
    fn a_chart_draws_every_series_and_survives_none() {
        let series = [
            Series::line("a", 0, vec![(0.0, 0.0), (1.0, 2.0), (2.0, f64::NAN)]),
            Series { mark: Mark::Rings(0.1), ..Series::line("", 1, vec![(1.0, 1.0)]) },
        ];
        let svg = Chart { series: &series, bounds: &[(0.5, "half")], ..EMPTY }.svg();
        assert!(svg.contains(">a</text>") && svg.contains("<circle") && svg.contains(">half</text>"));
        assert!(!svg.contains("NaN") && svg.matches("<text").count() > 8);
        assert!(EMPTY.svg().ends_with("</svg>\n"));
    }

    #[test]
    fn a_histogram_counts_every_value_once() {
        let bars = Series::histogram("h", 0, &[0.001, 0.0049, 0.0051, 0.02, f64::NAN], 0.005);
        assert_eq!(bars.points, [(0.0025, 2.0), (0.0075, 1.0), (0.0225, 1.0)]);
        assert!(Chart { series: &[bars], ..EMPTY }.svg().matches('z').count() >= 3);
    }
}
