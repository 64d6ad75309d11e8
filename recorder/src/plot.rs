//! A plot of what differs: recorded and replayed values over time, a panel per field.

use std::fmt::Write;

use crate::compare::{NodeComparison, Series};

const WIDTH: f64 = 900.0;
const PANEL: f64 = 170.0;
const TITLE: f64 = 34.0;
const LEFT: f64 = 70.0;
const MARGIN: f64 = 28.0;
/// Points drawn per line.
const MOST_POINTS: usize = 2000;

/// The plot of the nodes' differences as an SVG document, node after node; `None` where nothing differs.
pub fn plot(nodes: &[NodeComparison]) -> Option<String> {
    let series = |node: &'_ NodeComparison| node.paths.iter().map(|path| path.series.len()).sum::<usize>();
    let differing: Vec<&NodeComparison> = nodes.iter().filter(|node| series(node) > 0).collect();
    if differing.is_empty() {
        return None;
    }
    let height: f64 = differing.iter().map(|node| TITLE + PANEL * series(node) as f64).sum::<f64>() + 6.0;
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{WIDTH}\" height=\"{height}\" viewBox=\"0 0 {WIDTH} {height}\" \
         font-family=\"sans-serif\" font-size=\"12\">\n<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n"
    );
    let mut top = 0.0;
    for node in differing {
        let _ = writeln!(
            svg,
            "<text x=\"{LEFT}\" y=\"{:.1}\" font-size=\"14\">{}: <tspan fill=\"#555\">recorded</tspan>, \
             <tspan fill=\"#c0392b\">replayed</tspan></text>",
            top + 22.0,
            node.node
        );
        top += TITLE;
        for series in node.paths.iter().flat_map(|path| &path.series) {
            panel(&mut svg, top, series);
            top += PANEL;
        }
    }
    svg.push_str("</svg>\n");
    Some(svg)
}

fn panel(svg: &mut String, top: f64, series: &Series) {
    let finite = series.points.iter().filter(|(t, a, b)| t.is_finite() && a.is_finite() && b.is_finite());
    let points: Vec<(f64, f64, f64)> = finite.copied().collect();
    let Some((first, ..)) = points.first() else { return };
    let span = |values: &mut dyn Iterator<Item = f64>| {
        let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
        if high > low { (low, high) } else { (low - 0.5, low + 0.5) }
    };
    let (low, high) = span(&mut points.iter().flat_map(|(_, a, b)| [*a, *b]));
    let (begin, end) = span(&mut points.iter().map(|(t, ..)| *t));
    let (right, bottom) = (WIDTH - 20.0, top + PANEL - MARGIN);
    let x = |t: f64| LEFT + (t - begin) / (end - begin) * (right - LEFT);
    let y = |v: f64| bottom - (v - low) / (high - low) * (bottom - top - 18.0);
    let _ = writeln!(
        svg,
        "<text x=\"{LEFT}\" y=\"{:.1}\">{}</text>\n\
         <rect x=\"{LEFT}\" y=\"{:.1}\" width=\"{:.1}\" height=\"{:.1}\" fill=\"none\" stroke=\"#ccc\"/>\n\
         <text x=\"4\" y=\"{:.1}\" fill=\"#777\">{high:.4}</text><text x=\"4\" y=\"{bottom:.1}\" fill=\"#777\">{low:.4}</text>\n\
         <text x=\"{LEFT}\" y=\"{:.1}\" fill=\"#777\">{first:.1} s</text>\
         <text x=\"{:.1}\" y=\"{:.1}\" fill=\"#777\" text-anchor=\"end\">{end:.1} s</text>",
        top + 12.0,
        series.name,
        top + 18.0,
        right - LEFT,
        bottom - top - 18.0,
        top + 28.0,
        bottom + 14.0,
        right,
        bottom + 14.0,
    );
    let every = points.len().div_ceil(MOST_POINTS);
    let mut line = |colour: &str, value: fn(&(f64, f64, f64)) -> f64| {
        let mut path = String::new();
        for point in points.iter().step_by(every) {
            let _ = write!(path, "{:.1},{:.1} ", x(point.0), y(value(point)));
        }
        let _ = writeln!(svg, "<polyline points=\"{path}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"1.2\"/>");
    };
    line("#555", |point| point.1);
    line("#c0392b", |point| point.2);
}
