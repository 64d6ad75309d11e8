//! Which words of a Stage world are understood, and which are known not to matter here.
//!
//! Everything else is named in a note: a word that nobody understood may have been one that changes what robots see or
//! touch.

/// Things that are no part of the world: windows and cameras of the display, sensors' looks.
pub(super) const DISPLAY: [&str; 2] = ["window", "camera"];

/// Kinds that stand still unless something moves them.
pub(super) const STANDING: [&str; 1] = ["model"];

/// Kinds that drive: they give places to start.
pub(super) const DRIVING: [&str; 1] = ["position"];

/// Kinds that a robot carries: here the robot file decides on sensors.
pub(super) const CARRIED: [&str; 11] = [
    "ranger",
    "laser",
    "sensor",
    "camera",
    "fiducial",
    "blobfinder",
    "gripper",
    "bumper",
    "actuator",
    "lightindicator",
    "speech",
];

/// Words of the world itself that do not change what is simulated here: time here passes in steps of 10 ms as fast as it
/// can or as the clock does, and rays meet walls exactly and not a raster of them.
const OF_THE_WORLD: [&str; 12] = [
    "name",
    "interval_sim",
    "interval_real",
    "resolution",
    "paused",
    "speedup",
    "quit_time",
    "threads",
    "gui_interval",
    "show_clock",
    "show_clock_interval",
    "size",
];

/// Words of a thing that concern looks, names, power or other simulators' bookkeeping.
const OF_A_THING: [&str; 26] = [
    "name",
    "color",
    "color_rgba",
    "gui_nose",
    "gui_grid",
    "gui_outline",
    "gui_move",
    "gui_movemask",
    "gui_mask",
    "gui_boundary",
    "fiducial_return",
    "fiducial_key",
    "gripper_return",
    "blob_return",
    "mass",
    "watts",
    "joules",
    "joules_capacity",
    "trail_length",
    "trail_interval",
    "update_interval",
    "update_interval_energy",
    "alwayson",
    "stack_children",
    "map_resolution",
    "texture",
];

/// Words of a robot whose part the robot file has here.
const OF_A_ROBOT: [&str; 10] = [
    "size",
    "origin",
    "drive",
    "blocks",
    "localization",
    "localization_origin",
    "wheelbase",
    "boundary",
    "obstacle_return",
    "bitmap",
];

pub(super) fn is_harmless_in_the_world(word: &str) -> bool {
    OF_THE_WORLD.contains(&word)
}

pub(super) fn is_harmless(word: &str) -> bool {
    OF_A_THING.contains(&word)
}

pub(super) fn is_the_robot_files(word: &str) -> bool {
    OF_A_ROBOT.contains(&word) || word.starts_with("block[") || word.starts_with("point")
}
