//! The words of a world file (TOML). Unknown keys are refused with the nearest valid one.
//!
//! ```toml
//! name = "office"
//! bounds_m = [0.0, 0.0, 16.0, 12.0]       # an outer wall, lower left to upper right
//! [[start]]                               # the first robot starts at the first one
//! x_m = 1.0
//! y_m = 2.0
//! heading_deg = 90.0
//! spread_m = 0.1                          # drawn anew from every seed
//! [[wall]]
//! points_m = [[0.0, 4.0], [9.0, 4.0]]
//! thickness_m = 0.1
//! doors = [{ at_m = 2.0, width_m = 0.9 }] # middle of the gap, measured along the wall from its first point
//! [[box]]
//! centre_m = [3.0, 2.0]
//! size_m = [1.6, 0.8]
//! [[polygon]]
//! points_m = [[5.0, 0.0], [6.0, 0.0], [5.0, 1.0]]
//! [[circle]]
//! centre_m = [7.0, 1.0]
//! radius_m = 0.2
//! [[person]]
//! path_m = [[1.0, 5.0], [9.0, 5.0]]
//! speed_m_s = 0.8
//! yields_within_m = 0.5
//! [[person]]
//! path_m = [[1.0, 6.0], [9.0, 6.0]]
//! course = "timed"                        # at each point at its time, whatever stands around
//! at_s = [0.0, 6.5]
//! [[person]]
//! path_m = [[1.0, 7.0], [9.0, 7.0]]
//! speed_m_s = 1.2
//! social = true                           # gives way to people and walls by social force ...
//! sees_robots = false                     # ... and runs into robots
//! [[crowd]]
//! count = 12                              # such people, with ways that the seed draws
//! seed = 3
//! [bitmap]
//! file = "map.yaml"                       # map_server's format, relative to this file
//! [barn]
//! file = "grids.txt"
//! world = 1
//! [dynabarn]
//! file = "worlds.txt"
//! world = 1
//! ```

use super::person::Course;
use toml::Spanned;

type Pair = [f64; 2];

/// A whole world file.
#[derive(Debug, Default, serde::Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct WorldFile {
    pub name: String,
    pub bounds_m: Option<Spanned<[f64; 4]>>,
    pub start: Vec<Spanned<StartTable>>,
    pub wall: Vec<Spanned<WallTable>>,
    pub r#box: Vec<Spanned<BoxTable>>,
    pub polygon: Vec<Spanned<PolygonTable>>,
    pub circle: Vec<Spanned<CircleTable>>,
    pub person: Vec<Spanned<PersonTable>>,
    pub crowd: Vec<Spanned<CrowdTable>>,
    pub bitmap: Option<Spanned<BitmapTable>>,
    pub barn: Option<Spanned<BarnTable>>,
    pub dynabarn: Option<Spanned<BarnTable>>,
}

/// Where a robot starts. `spread_m` and `spread_deg` bound a deviation that is drawn from the seed.
#[derive(Debug, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct StartTable {
    pub x_m: f64,
    pub y_m: f64,
    pub heading_deg: f64,
    #[serde(default)]
    pub spread_m: f64,
    #[serde(default)]
    pub spread_deg: f64,
}

/// A polyline; a slab of that thickness, or a bare line.
#[derive(Debug, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct WallTable {
    pub points_m: Vec<Pair>,
    #[serde(default)]
    pub closed: bool,
    #[serde(default)]
    pub thickness_m: f64,
    #[serde(default)]
    pub doors: Vec<Spanned<DoorTable>>,
    #[serde(default)]
    pub rough: bool,
}

/// A gap in a wall.
#[derive(Debug, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct DoorTable {
    pub at_m: f64,
    pub width_m: f64,
}

/// A rectangle, solid.
#[derive(Debug, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct BoxTable {
    pub centre_m: Pair,
    pub size_m: Pair,
    #[serde(default)]
    pub heading_deg: f64,
    #[serde(default)]
    pub rough: bool,
}

/// A closed outline, solid.
#[derive(Debug, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PolygonTable {
    pub points_m: Vec<Pair>,
    #[serde(default)]
    pub rough: bool,
}

/// A round obstacle.
#[derive(Debug, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct CircleTable {
    pub centre_m: Pair,
    pub radius_m: f64,
    #[serde(default)]
    pub rough: bool,
}

/// Somebody who walks about.
#[derive(Debug, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PersonTable {
    pub path_m: Vec<Pair>,
    #[serde(default)]
    pub speed_m_s: f64,
    #[serde(default)]
    pub at_s: Vec<f64>,
    #[serde(default = "adult_radius")]
    pub radius_m: f64,
    #[serde(default)]
    pub course: Course,
    pub yields_within_m: Option<f64>,
    #[serde(default)]
    pub pause_s: f64,
    pub phase: Option<f64>,
    #[serde(default)]
    pub social: bool,
    pub sees_robots: Option<bool>,
}

/// People who give way, drawn from a seed.
#[derive(Debug, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct CrowdTable {
    pub count: usize,
    #[serde(default)]
    pub seed: u64,
    #[serde(default = "yes")]
    pub sees_robots: bool,
}

/// A map_server map whose occupied cells are obstacles.
#[derive(Debug, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct BitmapTable {
    pub file: String,
    #[serde(default)]
    pub rough: bool,
}

/// One of the BARN or DynaBARN worlds.
#[derive(Debug, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct BarnTable {
    pub file: String,
    pub world: Option<u32>,
}

fn adult_radius() -> f64 {
    0.25
}

fn yes() -> bool {
    true
}
