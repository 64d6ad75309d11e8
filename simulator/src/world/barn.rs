//! BARN worlds: text grids of cylinders behind a walled run-up (Perille, Truong, Xiao, Stone, SSRR 2020).
//!
//! A block is the line `world N` and 30 lines of 30 characters, `#` for a cylinder of radius 0.075 m; row r and column c
//! stand at x = −4.425 + 0.15 r, y = 5.175 + 0.15 c. The run-up's walls are the same in every world.

use super::error::WorldError;
use super::{Sketch, Start};
use crate::geometry::{Circle, Point, Pose};
use std::f64::consts::FRAC_PI_2;

const CELLS: usize = 30;
const STEP_M: f64 = 0.15;
const RADIUS_M: f64 = 0.075;
const LEFT_M: f64 = -4.425;
const RIGHT_M: f64 = -0.075;
const FIELD_M: f64 = 5.175;
const BACK_M: f64 = 0.075;
/// Cylinders in each side wall of the run-up.
const SIDE_WALL: usize = 33;

/// Adds world `wanted` of a grids file (the first one when `None`), its walls and its start.
pub(super) fn add(sketch: &mut Sketch, file: &str, bytes: &[u8], wanted: Option<u32>) -> Result<(), WorldError> {
    let text = std::str::from_utf8(bytes)
        .map_err(|_| WorldError::of_file(file, "it is not UTF-8 text", "give a BARN grids file"))?;
    let mut seen = 0;
    let mut lines = text.lines().enumerate();
    while let Some((number, line)) = lines.next() {
        let fault = |row: usize, reason: String| WorldError {
            file: file.to_owned(),
            place: Some((row + 1, 1)),
            reason,
            remedy: "a block is `world N` and 30 lines of 30 characters, # or .".to_owned(),
        };
        if line.trim().is_empty() || line.starts_with("//") {
            continue;
        }
        let index = line.strip_prefix("world ").and_then(|rest| rest.trim().parse::<u32>().ok());
        let Some(index) = index else {
            return Err(fault(number, format!("expected `world N`, found {line:?}")));
        };
        seen += 1;
        let chosen = wanted.is_none_or(|wanted| wanted == index);
        for row in 0..CELLS {
            let (at, cells) = lines.next().unwrap_or((number + row + 1, ""));
            let cells = cells.trim_end();
            if cells.len() != CELLS || !cells.bytes().all(|cell| cell == b'#' || cell == b'.') {
                return Err(fault(at, format!("row {row} of world {index} is {cells:?}")));
            }
            if chosen {
                for (column, _) in cells.bytes().enumerate().filter(|(_, cell)| *cell == b'#') {
                    cylinder(sketch, LEFT_M + STEP_M * row as f64, FIELD_M + STEP_M * column as f64);
                }
            }
        }
        if chosen {
            add_run_up(sketch);
            if sketch.name.is_empty() {
                sketch.name = format!("BARN {index}");
            }
            return Ok(());
        }
    }
    let wanted = wanted.map_or(String::new(), |wanted| format!(" number {wanted}"));
    Err(WorldError::of_file(file, format!("holds no world{wanted} among its {seen}"), "choose one that it holds"))
}

fn add_run_up(sketch: &mut Sketch) {
    for k in 0..CELLS {
        cylinder(sketch, LEFT_M + STEP_M * k as f64, BACK_M);
    }
    for k in 1..=SIDE_WALL {
        for x in [LEFT_M, RIGHT_M] {
            cylinder(sketch, x, BACK_M + STEP_M * k as f64);
        }
    }
    sketch.starts.push(Start { pose: Pose::new(-2.25, 3.0, FRAC_PI_2), spread_m: 0.0, spread_rad: 0.0 });
}

fn cylinder(sketch: &mut Sketch, x_m: f64, y_m: f64) {
    sketch.add_post(Circle::new(Point::new(x_m, y_m), RADIUS_M), true);
}
