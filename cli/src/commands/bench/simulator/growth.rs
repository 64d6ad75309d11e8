//! How the cost of a step grows with robots, rays, map area and nodes: a table, and the growth's name.
//!
//! The exponent is the slope of the least-squares line through (ln amount, ln cost): 1 is linear, 0 does not matter.

use super::row::{self, Measured};
use crate::exit::Failure;
use std::fmt::Write;

/// Wall time of a point [s].
const POINT_S: f64 = 1.0;

/// One quantity that is varied.
pub struct Line {
    /// Which.
    pub against: &'static str,
    /// Amounts and costs per simulated second on a core [ms].
    points: Vec<(f64, f64)>,
    /// Slope in the double logarithmic plot.
    pub exponent: f64,
}

/// Measures all of them.
pub fn measure(part: f64) -> Result<Vec<Line>, Failure> {
    let families: [(&str, &str, &[usize], f64); 5] = [
        ("robots (12 rays, 8.4 m² each)", "robots", &[100, 300, 1000, 3000, 10_000], 0.0),
        ("crowding (12 rays, so many robots on 140 × 60 m)", "crowding", &[100, 300, 1000, 3000, 10_000], 0.0),
        ("rays per robot (1,000 robots)", "rays", &[4, 12, 36, 108], 0.0),
        ("map area in m² (1,000 robots)", "map", &[70, 140, 280, 560], 0.0),
        ("nodes of a whole robot", "nodes", &[0, 8, 24, 56], 8.0),
    ];
    let mut lines = Vec::new();
    for (against, row, amounts, own) in families {
        let mut points = Vec::new();
        for amount in amounts {
            let Measured { realtime_factor_core, .. } =
                row::in_own_process(&format!("{row}:{amount}"), 1, POINT_S * part)?;
            let amount = *amount as f64;
            let amount = if row == "map" { amount * amount * 3.0 / 7.0 } else { amount + own };
            points.push((amount, 1e3 / realtime_factor_core));
        }
        lines.push(Line { against, exponent: slope(&points), points });
    }
    Ok(lines)
}

impl Line {
    /// The exponent's unit, which names the growth.
    pub fn unit(&self) -> &'static str {
        match self.exponent {
            e if e < 0.15 => "exponent: nearly constant",
            e if e < 0.85 => "exponent: less than linear",
            e if e < 1.15 => "exponent: linear",
            _ => "exponent: more than linear",
        }
    }
}

/// The table of all points.
pub fn table(lines: &[Line]) -> String {
    let mut text =
        "Cost of a simulated second on a core:\n\n| against | amount: ms | growth |\n|---|---|---|\n".to_owned();
    for line in lines {
        let points: Vec<String> =
            line.points.iter().map(|(amount, cost_ms)| format!("{amount:.0}: {cost_ms:.3}")).collect();
        let growth = line.unit().trim_start_matches("exponent: ");
        let _ = writeln!(text, "| {} | {} | {growth} ({:.2}) |", line.against, points.join(", "), line.exponent);
    }
    text
}

fn slope(points: &[(f64, f64)]) -> f64 {
    let logs: Vec<(f64, f64)> =
        points.iter().map(|(x, y)| (runtime::math::ln(*x), runtime::math::ln(y.max(1e-12)))).collect();
    let n = logs.len() as f64;
    let (mean_x, mean_y) = (logs.iter().map(|p| p.0).sum::<f64>() / n, logs.iter().map(|p| p.1).sum::<f64>() / n);
    let over: f64 = logs.iter().map(|(x, y)| (x - mean_x) * (y - mean_y)).sum();
    let under: f64 = logs.iter().map(|(x, _)| (x - mean_x) * (x - mean_x)).sum();
    over / under
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn growth_is_named_by_the_slope_of_the_logarithms() {
        let line = |cost: &dyn Fn(f64) -> f64| {
            let points: Vec<(f64, f64)> = [1.0, 10.0, 100.0].map(|x| (x, cost(x))).to_vec();
            Line { against: "x", exponent: slope(&points), points }
        };
        assert_eq!(line(&|_| 3.0).unit(), "exponent: nearly constant");
        assert_eq!(line(&|x| 0.2 * x).unit(), "exponent: linear");
        assert_eq!(line(&|x| x * x).unit(), "exponent: more than linear");
        assert_eq!(line(&f64::sqrt).unit(), "exponent: less than linear");
    }
}
