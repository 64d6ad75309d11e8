//! The report: one HTML file that needs nothing else, no script and no network.

use super::figures::{Figures, METRICS, Metric, wilson};
use super::mission::Mission;
use std::fmt::Write;

/// Bars of a histogram.
const BARS: usize = 20;
/// Missions listed one by one.
const LISTED: usize = 2000;

/// What frames the missions.
#[derive(Debug, Clone, Default)]
pub struct Frame {
    /// Name of the robot.
    pub robot: String,
    /// What was asked for, in words and values.
    pub facts: Vec<(String, String)>,
    /// The command that repeats the batch.
    pub command: String,
}

/// A failure that is shown.
#[derive(Debug, Clone)]
pub struct Failed {
    /// Its seed.
    pub seed: u64,
    /// Its track (SVG).
    pub picture: String,
    /// The command that simulates it again.
    pub command: String,
}

const STYLE: &str = "body{font:15px/1.45 system-ui,sans-serif;margin:2rem auto;max-width:64rem;padding:0 1rem;color:#1d2430}\
h1{font-size:1.5rem}h2{font-size:1.15rem;margin-top:2rem}table{border-collapse:collapse;font-size:13px}\
td,th{padding:.2rem .6rem;text-align:right;border-bottom:1px solid #dde2ea}td:first-child,th:first-child{text-align:left}\
code{background:#eef1f6;padding:.15rem .35rem;border-radius:3px}figure{display:inline-block;margin:.5rem 1rem .5rem 0}\
figcaption{font-size:12px;color:#566}.bad{color:#b3261e}section svg{max-width:100%;height:auto}";

/// The whole file.
pub fn html(frame: &Frame, missions: &[Mission], failed: &[Failed]) -> String {
    let n = missions.len() as u64;
    let good = missions.iter().filter(|mission| mission.succeeded()).count() as u64;
    let [low, high] = wilson(good, n);
    let title = format!("{}: {good} of {n} missions succeeded", escape(&frame.robot));
    let mut text = format!(
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>{title}</title><style>{STYLE}</style></head>\n\
         <body><h1>{title}</h1>\n<p>Success rate {:.1} %, 95 % interval {:.1} to {:.1} %.</p>\n<table>\n",
        100.0 * good as f64 / n.max(1) as f64,
        100.0 * low,
        100.0 * high
    );
    for (name, value) in &frame.facts {
        let _ = writeln!(text, "<tr><td>{}</td><td>{}</td></tr>", escape(name), escape(value));
    }
    let _ = writeln!(text, "</table>\n<p>Again: <code>{}</code></p>", escape(&frame.command));
    add_figures(&mut text, missions);
    add_failures(&mut text, missions, failed);
    add_missions(&mut text, missions);
    text += "</body></html>\n";
    text
}

fn add_figures(text: &mut String, missions: &[Mission]) {
    *text += "<h2>Figures</h2>\n<table><tr><th>metric</th><th>mean</th><th>s.d.</th><th>least</th><th>5 %</th>\
              <th>median</th><th>95 %</th><th>greatest</th><th></th></tr>\n";
    for figures in Figures::of(missions) {
        let _ = write!(text, "<tr><td>{}</td>", figures.metric);
        for value in [figures.mean, figures.deviation].iter().chain(&figures.quantiles) {
            let _ = write!(text, "<td>{value:.4}</td>");
        }
        let _ = writeln!(text, "<td>{}</td></tr>", figures.unit);
    }
    *text += "</table>\n<h2>Histograms</h2>\n";
    for (metric, unit, value) in METRICS {
        *text += &histogram(metric, unit, missions, value);
    }
}

/// A histogram with even bins between the least and the greatest value; nothing where all are the same.
fn histogram(metric: &str, unit: &str, missions: &[Mission], value: Metric) -> String {
    let values: Vec<f64> = missions.iter().map(value).filter(|value| value.is_finite()).collect();
    let low = values.iter().copied().fold(f64::INFINITY, f64::min);
    let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if high <= low || values.is_empty() {
        return String::new();
    }
    let mut bars = [0_usize; BARS];
    for value in &values {
        bars[(((value - low) / (high - low) * BARS as f64) as usize).min(BARS - 1)] += 1;
    }
    let most = bars.iter().copied().max().unwrap_or(1).max(1);
    let mut text = String::from("<figure><svg width=\"260\" height=\"90\" role=\"img\">");
    for (k, count) in bars.iter().enumerate() {
        let tall = 88.0 * *count as f64 / most as f64;
        let _ = write!(
            text,
            "<rect x=\"{}\" y=\"{:.1}\" width=\"12\" height=\"{tall:.1}\" fill=\"#3b6fb6\"><title>{count}</title></rect>",
            k * 13,
            89.0 - tall
        );
    }
    let _ =
        writeln!(text, "</svg><figcaption>{metric}: {low:.4} to {high:.4} {unit}, most {most}</figcaption></figure>");
    text
}

fn add_failures(text: &mut String, missions: &[Mission], failed: &[Failed]) {
    let bad: Vec<&Mission> = missions.iter().filter(|mission| !mission.succeeded()).collect();
    let _ = writeln!(text, "<h2>Failures: {}</h2>", bad.len());
    for shown in failed {
        let reason = bad.iter().find(|mission| mission.seed == shown.seed).map_or("", |mission| &mission.failure);
        let _ = writeln!(
            text,
            "<section><h3>Seed {}: <span class=\"bad\">{}</span></h3><p>Again: <code>{}</code></p>\n{}</section>",
            shown.seed,
            escape(reason),
            escape(&shown.command),
            shown.picture
        );
    }
    if bad.len() > failed.len() {
        let _ = writeln!(text, "<p>{} more are in the table below.</p>", bad.len() - failed.len());
    }
}

fn add_missions(text: &mut String, missions: &[Mission]) {
    *text += "<h2>Missions</h2>\n<table><tr><th>seed</th><th>outcome</th>";
    for (metric, ..) in METRICS {
        let _ = write!(text, "<th>{metric}</th>");
    }
    *text += "<th>hash</th></tr>\n";
    for mission in missions.iter().take(LISTED) {
        let outcome = if mission.succeeded() { "success" } else { &mission.failure };
        let class = if mission.succeeded() { "" } else { " class=\"bad\"" };
        let _ = write!(text, "<tr><td>{}</td><td{class}>{}</td>", mission.seed, escape(outcome));
        for (.., value) in METRICS {
            let _ = write!(text, "<td>{:.3}</td>", value(mission));
        }
        let _ = writeln!(text, "<td>{}</td></tr>", escape(&mission.hash));
    }
    *text += "</table>\n";
    if missions.len() > LISTED {
        let _ = writeln!(text, "<p>The first {LISTED} of {}; the CSV file has all.</p>", missions.len());
    }
}

fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
