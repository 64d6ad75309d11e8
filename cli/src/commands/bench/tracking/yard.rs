//! DynaBARN's worlds: cylinders on key-framed paths in a walled yard, and what a laser sees of them, exactly.

use crate::exit::Failure;
use messages::{Beam, Echo};
use perception::place::Place;
use runtime::math;
use std::path::Path;

/// Radius of every cylinder [m].
pub const RADIUS_M: f64 = 0.5;
/// The laser's reach [m].
pub const REACH_M: f64 = 30.0;
/// Inner faces of the walls: x = −9.75, y = ±9.75.
const WALL_M: f64 = 9.75;

/// A cylinder's way, repeated with its period.
#[derive(Debug, Clone, PartialEq)]
pub struct Mover {
    period_s: f64,
    /// t, x, y; by time.
    keys: Vec<[f64; 3]>,
}

/// Where a mover is and how fast.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Moving {
    pub x_m: f64,
    pub y_m: f64,
    pub velocity_x_m_s: f64,
    pub velocity_y_m_s: f64,
    /// Times that its path began anew: it jumps then.
    pub lap: u64,
}

impl Mover {
    /// At `time_s`, between key frames in a straight line.
    pub fn at(&self, time_s: f64) -> Moving {
        let lap = (time_s / self.period_s).floor();
        let t = time_s - lap * self.period_s;
        let k = self.keys.partition_point(|key| key[0] <= t).clamp(1, self.keys.len() - 1);
        let (a, b) = (self.keys[k - 1], self.keys[k]);
        let whole = (b[0] - a[0]).max(1e-9);
        let share = ((t - a[0]) / whole).clamp(0.0, 1.0);
        Moving {
            x_m: a[1] + share * (b[1] - a[1]),
            y_m: a[2] + share * (b[2] - a[2]),
            velocity_x_m_s: (b[1] - a[1]) / whole,
            velocity_y_m_s: (b[2] - a[2]) / whole,
            lap: lap as u64,
        }
    }
}

/// Reads `worlds.txt`.
pub fn read(file: &Path) -> Result<Vec<Vec<Mover>>, Failure> {
    let text =
        std::fs::read_to_string(file).map_err(|e| Failure::from(format!("cannot read {}: {e}", file.display())))?;
    parse(&text).map_err(|reason| Failure::from(format!("{}: {reason}", file.display())))
}

fn parse(text: &str) -> Result<Vec<Vec<Mover>>, String> {
    let mut worlds: Vec<Vec<Mover>> = Vec::new();
    for (number, line) in text.lines().enumerate() {
        let wrong = |what: &str| format!("line {}: {what}", number + 1);
        let words: Vec<&str> = line.split_whitespace().collect();
        match words.as_slice() {
            [] => {}
            ["world", ..] => worlds.push(Vec::new()),
            [_, period, count, keys @ ..] => {
                let world = worlds.last_mut().ok_or_else(|| wrong("an obstacle before the first world"))?;
                let period_s: f64 = period.parse().map_err(|_| wrong("the period is no number"))?;
                let keys: Option<Vec<[f64; 3]>> = keys.iter().map(|key| triple(key)).collect();
                let keys = keys.ok_or_else(|| wrong("a key frame is not t,x,y"))?;
                if keys.len() < 2 || Ok(keys.len()) != count.parse() || period_s.is_nan() || period_s <= 0.0 {
                    return Err(wrong("two or more key frames are wanted, as many as are told, and a period"));
                }
                world.push(Mover { period_s, keys });
            }
            _ => return Err(wrong("neither a world nor an obstacle")),
        }
    }
    if worlds.is_empty() { Err("holds no world".into()) } else { Ok(worlds) }
}

fn triple(key: &str) -> Option<[f64; 3]> {
    let numbers: Vec<f64> = key.split(',').map_while(|n| n.parse().ok()).collect();
    numbers.try_into().ok()
}

/// A laser in the middle of the body.
#[derive(Debug, Clone)]
pub struct Laser {
    directions: Vec<(f64, f64, f64)>,
    noise: Noise,
    sigma_m: f64,
    /// The newest scan.
    pub beams: Vec<Beam>,
    /// Beams that hit each mover in the newest scan.
    pub hits: Vec<u32>,
}

impl Laser {
    /// `count` beams over `field_rad`.
    pub fn new(count: usize, field_rad: f64, sigma_m: f64, seed: u64) -> Laser {
        let bearing = |k: usize| -0.5 * field_rad + field_rad * k as f64 / (count - 1) as f64;
        let directions = (0..count).map(|k| (bearing(k), math::cos(bearing(k)), math::sin(bearing(k)))).collect();
        Laser { directions, noise: Noise(seed), sigma_m, beams: Vec::with_capacity(count), hits: Vec::new() }
    }

    /// Looks around from `place`.
    pub fn look(&mut self, place: &Place, movers: &[Moving]) {
        self.beams.clear();
        self.hits.clear();
        self.hits.resize(movers.len(), 0);
        for &(bearing, cos, sin) in &self.directions {
            let (u_x, u_y) = place.turned_out(cos, sin);
            let mut range_m = walls(place, u_x, u_y);
            let mut hit = None;
            for (k, mover) in movers.iter().enumerate() {
                let (x, y) = (mover.x_m - place.x_m, mover.y_m - place.y_m);
                let (along, aside) = (x * u_x + y * u_y, u_x * y - u_y * x);
                if along > 0.0 && aside.abs() < RADIUS_M {
                    let surface = along - (RADIUS_M * RADIUS_M - aside * aside).sqrt();
                    if surface < range_m {
                        (range_m, hit) = (surface, Some(k));
                    }
                }
            }
            let echo = match range_m {
                far if far > REACH_M => Echo::Clear,
                near if near < 0.1 => Echo::TooNear,
                _ => Echo::Value,
            };
            if let (Some(k), Echo::Value) = (hit, echo) {
                self.hits[k] += 1;
            }
            let range_m = if echo == Echo::Value { range_m + self.sigma_m * self.noise.normal() } else { 0.0 };
            let (bearing_rad, range_m) = (bearing as f32, range_m as f32);
            self.beams.push(Beam { bearing_rad, range_m, echo: echo as u32, ..Beam::default() });
        }
    }
}

/// Distance to the nearest wall; the east is open.
fn walls(place: &Place, u_x: f64, u_y: f64) -> f64 {
    let mut range_m = f64::INFINITY;
    if u_x < 0.0 {
        let r = (-WALL_M - place.x_m) / u_x;
        if (place.y_m + r * u_y).abs() <= WALL_M {
            range_m = r;
        }
    }
    if u_y != 0.0 {
        let r = (WALL_M.copysign(u_y) - place.y_m) / u_y;
        if (-WALL_M..=10.0).contains(&(place.x_m + r * u_x)) {
            range_m = range_m.min(r);
        }
    }
    range_m
}

/// Normal numbers from a seed (SplitMix64, Box and Muller).
#[derive(Debug, Clone)]
struct Noise(u64);

impl Noise {
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    fn normal(&mut self) -> f64 {
        let radius = (-2.0 * math::ln(1.0 - self.uniform())).sqrt();
        radius * math::cos(std::f64::consts::TAU * self.uniform())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "world 1 1\na_1 10.0 3 0.00,0.0,0.0 5.00,5.0,0.0 10.00,5.0,10.0\n";

    #[test]
    fn a_mover_is_between_its_key_frames_and_begins_anew() {
        let worlds = parse(TEXT).unwrap();
        let mover = &worlds[0][0];
        let at = mover.at(7.5);
        assert_eq!((at.x_m, at.y_m, at.velocity_x_m_s, at.velocity_y_m_s, at.lap), (5.0, 5.0, 0.0, 2.0, 0));
        assert_eq!((mover.at(12.0).x_m, mover.at(12.0).lap), (2.0, 1));
    }

    #[test]
    fn a_broken_file_is_refused_with_the_line() {
        for (text, words) in
            [("", "no world"), ("a 1 2 0,0,0 1,1,1", "line 1"), ("world 1 1\na 3 2 0,0,0 1,x,1", "line 2")]
        {
            assert!(parse(text).unwrap_err().contains(words), "{text}");
        }
    }

    #[test]
    fn the_laser_sees_cylinders_and_walls_where_they_are() {
        let mut laser = Laser::new(3, 2.0 * std::f64::consts::FRAC_PI_2, 0.0, 1);
        let mover = Moving { x_m: -2.0, y_m: 0.0, velocity_x_m_s: 0.0, velocity_y_m_s: 0.0, lap: 0 };
        laser.look(&Place::new(2.0, 1.0, std::f64::consts::PI), &[mover]);
        let ranges: Vec<f32> = laser.beams.iter().map(|beam| beam.range_m).collect();
        // Right of a body that looks west is north.
        assert!((ranges[0] - 8.75).abs() < 1e-5 && (ranges[2] - 10.75).abs() < 1e-5, "{ranges:?}");
        assert!((ranges[1] - 11.75).abs() < 1e-5, "{ranges:?}");
        laser.look(&Place::new(2.0, 0.0, std::f64::consts::PI), &[mover]);
        assert!((laser.beams[1].range_m - 3.5).abs() < 1e-5);
        assert_eq!(laser.hits, [1]);
    }
}
