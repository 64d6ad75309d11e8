//! The report: one HTML file that needs nothing else, no script and no network.

use super::figures::{Figures, METRICS, wilson};
use super::histogram::histogram;
use super::mission::Mission;
use crate::output::number;
use std::collections::BTreeMap;
use std::fmt::Write;

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
    /// Its track (SVG), where it is drawn.
    pub picture: Option<String>,
    /// The command that simulates it again.
    pub command: String,
}

const STYLE: &str = "body{font:15px/1.45 system-ui,sans-serif;margin:2rem auto;max-width:66rem;padding:0 1rem;color:#1d2430}\
h1{font-size:1.5rem}h2{font-size:1.15rem;margin-top:2rem}h3{font-size:1rem;margin:1.5rem 0 .4rem}\
table{border-collapse:collapse;font-size:13px;font-variant-numeric:tabular-nums}\
td,th{padding:.2rem .6rem;text-align:right;border-bottom:1px solid #dde2ea;white-space:nowrap}\
td:first-child,th:first-child,.words td,.words th{text-align:left}.words td{white-space:normal;overflow-wrap:anywhere}\
code,pre{background:#eef1f6;border-radius:3px;font-size:12.5px}code{padding:.15rem .35rem}\
pre{padding:.5rem .7rem;margin:.4rem 0 .8rem;white-space:pre-wrap;overflow-wrap:anywhere}\
.charts{display:flex;flex-wrap:wrap;gap:.6rem 1.4rem}figure{margin:0;width:19rem}figcaption{font-size:12.5px}\
.unit{color:#66707f}.bad{color:#b3261e}.wide{overflow-x:auto}section svg{max-width:100%;height:auto}\
section{break-inside:avoid}figure svg text{font:11px system-ui,sans-serif;fill:#66707f}";

/// The whole file.
pub fn html(frame: &Frame, missions: &[Mission], failed: &[Failed]) -> String {
    let n = missions.len() as u64;
    let good = missions.iter().filter(|mission| mission.succeeded()).count() as u64;
    let [low, high] = wilson(good, n);
    let title = format!("{}: {good} of {n} missions succeeded", escape(&frame.robot));
    let mut text = format!(
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>{title}</title><style>{STYLE}</style></head>\n\
         <body><h1>{title}</h1>\n<p>Success rate {:.1} %, 95 % interval {:.1} to {:.1} %.</p>\n<table class=\"words\">\n",
        100.0 * good as f64 / n.max(1) as f64,
        100.0 * low,
        100.0 * high
    );
    for (name, value) in &frame.facts {
        let _ = writeln!(text, "<tr><td>{}</td><td>{}</td></tr>", escape(name), escape(value));
    }
    let _ = writeln!(text, "</table>\n<p>The whole batch again:</p><pre>{}</pre>", escape(&frame.command));
    add_figures(&mut text, missions);
    add_nodes(&mut text, missions);
    add_failures(&mut text, missions, failed);
    add_missions(&mut text, missions);
    text += "</body></html>\n";
    text
}

fn add_figures(text: &mut String, missions: &[Mission]) {
    *text += "<h2>Figures</h2>\n<table><tr><th>metric</th><th>mean</th><th>s.d.</th><th>least</th><th>5 %</th>\
              <th>median</th><th>95 %</th><th>greatest</th></tr>\n";
    for figures in Figures::of(missions) {
        let _ = write!(text, "<tr><td>{}</td>", named(figures.metric, figures.unit));
        for value in [figures.mean, figures.deviation].iter().chain(&figures.quantiles) {
            let _ = write!(text, "<td>{}</td>", number(*value));
        }
        *text += "</tr>\n";
    }
    *text += "</table>\n<h2>Histograms</h2>\n<p>Failed missions are red.</p>\n<div class=\"charts\">\n";
    for (metric, unit, value) in METRICS {
        if let Some(chart) = histogram(missions, value) {
            let _ = writeln!(text, "<figure><figcaption>{}</figcaption>{chart}</figure>", named(metric, unit));
        }
    }
    *text += "</div>\n";
}

/// `mean_speed_m_s` as people write it.
fn named(metric: &str, unit: &str) -> String {
    let suffixes = ["_m_s3", "_m_s", "_m", "_s", "_j"];
    let bare = suffixes.iter().find_map(|suffix| metric.strip_suffix(suffix)).filter(|_| !unit.is_empty());
    let words = bare.unwrap_or(metric).replace('_', " ").replace("cpu", "CPU").replace("rms", "r.m.s.");
    if unit.is_empty() { words } else { format!("{words} <span class=\"unit\">{unit}</span>") }
}

/// What each node cost.
fn add_nodes(text: &mut String, missions: &[Mission]) {
    let mut nodes: Vec<(&str, f64, f64, u64)> = Vec::new();
    for node in missions.iter().flat_map(|mission| &mission.nodes) {
        let known = nodes.iter_mut().find(|known| known.0 == node.path);
        match known {
            Some((_, sum, most, missed)) => {
                *sum += node.cpu;
                *most = most.max(node.cpu);
                *missed += node.missed_deadlines;
            }
            None => nodes.push((&node.path, node.cpu, node.cpu, node.missed_deadlines)),
        }
    }
    if nodes.is_empty() {
        return;
    }
    *text += "<h2>Nodes</h2>\n<table><tr><th>node</th><th>mean share of a core</th><th>greatest</th>\
              <th>deadlines missed, all missions</th></tr>\n";
    for (path, sum, most, missed) in nodes {
        let mean = 100.0 * sum / missions.len() as f64;
        let _ = writeln!(
            text,
            "<tr><td>{}</td><td>{mean:.3} %</td><td>{:.3} %</td><td>{missed}</td></tr>",
            escape(path),
            100.0 * most
        );
    }
    *text += "</table>\n<p>By the simulated host's model of execution, not by this machine's clock.</p>\n";
}

fn add_failures(text: &mut String, missions: &[Mission], failed: &[Failed]) {
    let bad: Vec<&Mission> = missions.iter().filter(|mission| !mission.succeeded()).collect();
    let _ = writeln!(text, "<h2>Failures: {}</h2>", bad.len());
    if bad.is_empty() {
        return;
    }
    *text += "<p>Each command simulates its mission again and compares the hash: the same byte for byte, or it says so. \
              <code>sinew shrink</code> finds the few faults that a failure needs.</p>\n";
    let mut reasons: BTreeMap<&str, u64> = BTreeMap::new();
    bad.iter().for_each(|mission| *reasons.entry(&mission.failure).or_default() += 1);
    *text += "<table class=\"words\"><tr><th>failure</th><th>missions</th></tr>\n";
    for (reason, count) in reasons {
        let _ = writeln!(text, "<tr><td class=\"bad\">{}</td><td>{count}</td></tr>", escape(reason));
    }
    *text += "</table>\n";
    let reason = |seed: u64| bad.iter().find(|mission| mission.seed == seed).map_or("", |mission| &mission.failure);
    for shown in failed {
        let Some(picture) = &shown.picture else { continue };
        let _ = writeln!(
            text,
            "<section><h3>Seed {}: <span class=\"bad\">{}</span></h3><pre>{}</pre>\n{picture}</section>",
            shown.seed,
            escape(reason(shown.seed)),
            escape(&shown.command)
        );
    }
    let others: Vec<&Failed> = failed.iter().filter(|failed| failed.picture.is_none()).take(LISTED).collect();
    if !others.is_empty() {
        *text +=
            "<h3>Others, not drawn</h3>\n<table class=\"words\"><tr><th>seed</th><th>failure</th><th>again</th></tr>\n";
        for other in others {
            let (why, command) = (escape(reason(other.seed)), escape(&other.command));
            let _ = writeln!(
                text,
                "<tr><td>{}</td><td class=\"bad\">{why}</td><td><code>{command}</code></td></tr>",
                other.seed
            );
        }
        *text += "</table>\n";
    }
}

fn add_missions(text: &mut String, missions: &[Mission]) {
    *text += "<h2>Missions</h2>\n<div class=\"wide\"><table><tr><th>seed</th><th>outcome</th>";
    for (metric, unit, _) in METRICS {
        let _ = write!(text, "<th>{}</th>", named(metric, unit).replace(" <span", "<br><span"));
    }
    *text += "<th>hash</th></tr>\n";
    for mission in missions.iter().take(LISTED) {
        let outcome = if mission.succeeded() { "success" } else { &mission.failure };
        let class = if mission.succeeded() { "" } else { " class=\"bad\"" };
        let _ = write!(text, "<tr><td>{}</td><td{class}>{}</td>", mission.seed, escape(outcome));
        for (.., value) in METRICS {
            let _ = write!(text, "<td>{}</td>", short(value(mission)));
        }
        let _ = writeln!(text, "<td>{}</td></tr>", escape(&mission.hash));
    }
    *text += "</table></div>\n";
    if missions.len() > LISTED {
        let _ = writeln!(text, "<p>The first {LISTED} of {}; the CSV file has all.</p>", missions.len());
    }
}

/// Three digits behind the point, none where there is nothing behind it.
fn short(value: f64) -> String {
    if value == value.trunc() { format!("{value:.0}") } else { format!("{value:.3}") }
}

fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
