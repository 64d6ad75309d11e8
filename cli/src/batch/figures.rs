//! What many missions say together: quantiles, and how sure a share is.

use super::mission::Mission;
use serde::Serialize;

/// One metric of a mission.
pub type Metric = fn(&Mission) -> f64;

/// The metrics: name, unit, value, and whether more is better (`None`: neither).
pub const METRICS: [(&str, &str, Metric); 13] = [
    ("time_s", "s", |m| m.time_s),
    ("distance_m", "m", |m| m.distance_m),
    ("mean_speed_m_s", "m/s", |m| m.speed_m_s[0]),
    ("max_speed_m_s", "m/s", |m| m.speed_m_s[1]),
    ("jerk_rms_m_s3", "m/s³", |m| m.jerk_m_s3),
    ("least_clearance_m", "m", |m| m.clearance_m[0]),
    ("mean_clearance_m", "m", |m| m.clearance_m[1]),
    ("energy_j", "J", |m| m.energy_j),
    ("contacts_caused", "", |m| m.contacts[0] as f64),
    ("missed_deadlines", "", |m| m.missed_deadlines() as f64),
    ("cpu_share", "of a core", Mission::cpu),
    ("faults", "", |m| m.faults[0] as f64),
    ("restarts", "", |m| m.faults[1] as f64),
];

/// A metric over all missions.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Figures {
    /// Which.
    pub metric: &'static str,
    /// Its unit.
    pub unit: &'static str,
    /// Mean.
    pub mean: f64,
    /// Standard deviation of the sample.
    pub deviation: f64,
    /// Least, 5 %, median, 95 % and greatest.
    pub quantiles: [f64; 5],
}

impl Figures {
    /// All metrics of these missions; those that are no numbers are left out (the clearance in an empty world).
    pub fn of(missions: &[Mission]) -> Vec<Figures> {
        METRICS
            .iter()
            .map(|(metric, unit, value)| {
                // An empty sum is −0.
                let plus = |value: f64| value + 0.0;
                let finite = missions.iter().map(|m| plus(value(m))).filter(|value| value.is_finite());
                let mut values: Vec<f64> = finite.collect();
                values.sort_by(f64::total_cmp);
                let (mean, deviation) = mean_and_deviation(&values);
                // What rounding alone makes of equal values is no deviation.
                let deviation = if deviation > 1e-12 * mean.abs() { deviation } else { 0.0 };
                let last = values.len().saturating_sub(1) as f64;
                let at = |q: f64| values.get((q * last).round() as usize).copied().unwrap_or(f64::NAN);
                Figures { metric, unit, mean, deviation, quantiles: [0.0, 0.05, 0.5, 0.95, 1.0].map(at) }
            })
            .collect()
    }
}

/// Mean and standard deviation of a sample.
pub fn mean_and_deviation(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let squares: f64 = values.iter().map(|value| (value - mean) * (value - mean)).sum();
    (mean, if values.len() > 1 { (squares / (n - 1.0)).sqrt() } else { 0.0 })
}

/// 95 % confidence interval of a share of which `hits` of `n` were seen (Wilson, JASA 22, 1927).
pub fn wilson(hits: u64, n: u64) -> [f64; 2] {
    const Z: f64 = 1.959_964;
    if n == 0 {
        return [0.0, 1.0];
    }
    let (n, p) = (n as f64, hits as f64 / n as f64);
    let middle = p + Z * Z / (2.0 * n);
    let half = Z * (p * (1.0 - p) / n + Z * Z / (4.0 * n * n)).sqrt();
    [(middle - half) / (1.0 + Z * Z / n), (middle + half) / (1.0 + Z * Z / n)].map(|share| share.clamp(0.0, 1.0))
}
