//! The peer: IR-SIM from PyPI, where a Python that has it can be found.
//!
//! It is given the world, the robots' places, their speeds and sensors as data, and steps of the same length. Its robots
//! go for one drawn goal after another, ours wander; both see walls, furniture and each other.

use super::row::{self, Measured, STEP_S};
use simulator::swarm::{Rays, Swarm};
use std::process::Command;

/// Names the Python that has `irsim`.
const VARIABLE: &str = "SINEW_PEER_PYTHON";
const SCRIPT: &str = include_str!("peer_ir_sim.py");

/// Runs the peer's task in it; or why not.
pub fn ir_sim(seconds: f64) -> Result<Measured, String> {
    let python = std::env::var(VARIABLE).unwrap_or_else(|_| "python3".into());
    let have = Command::new(&python).args(["-c", "import irsim"]).output();
    match have {
        Err(e) => return Err(format!("{python} does not start: {e}")),
        Ok(output) if !output.status.success() => {
            return Err(format!(
                "{python} has no module irsim; `python3 -m venv VENV && VENV/bin/pip install ir-sim` and \
                 {VARIABLE}=VENV/bin/python"
            ));
        }
        Ok(_) => {}
    }
    let task = task(&row::peer_task().map_err(|e| e.message)?);
    let folder = std::env::temp_dir().join(format!("sinew-peer-{}", std::process::id()));
    std::fs::create_dir_all(&folder).map_err(|e| e.to_string())?;
    let file = folder.join("task.json");
    let output = std::fs::write(&file, task.to_string()).and_then(|()| {
        Command::new(&python)
            .args(["-c", SCRIPT, "task.json", &seconds.to_string()])
            .current_dir(&folder)
            .env("MPLBACKEND", "Agg")
            .output()
    });
    let _ = std::fs::remove_dir_all(&folder);
    let output = output.map_err(|e| e.to_string())?;
    // It prints a banner of its own first.
    let text = String::from_utf8_lossy(&output.stdout);
    let line = text.lines().rev().find(|line| line.starts_with('{'));
    let line = line.ok_or_else(|| {
        let error = String::from_utf8_lossy(&output.stderr);
        format!("it failed: {}", error.lines().last().unwrap_or("it printed nothing"))
    })?;
    serde_json::from_str(line).map_err(|e| format!("it printed {line:?}: {e}"))
}

/// The task as data: metres and radians throughout.
fn task(swarm: &Swarm) -> serde_json::Value {
    let (world, kind) = (swarm.world(), swarm.kind());
    let (_, high) = world.map.extent();
    let pair = |point: simulator::geometry::Point| [point.x_m, point.y_m];
    let solids: Vec<Vec<[f64; 2]>> =
        world.solids.iter().map(|solid| solid.outline.iter().copied().map(pair).collect()).collect();
    let on_a_solid = |a, b| solids.iter().any(|outline| outline.contains(&a) && outline.contains(&b));
    let walls = world.map.segments().iter().map(|wall| [pair(wall.a), pair(wall.b)]);
    let walls: Vec<_> = walls.filter(|[a, b]| !on_a_solid(*a, *b)).collect();
    let posts: Vec<_> = world.map.circles().iter().map(|c| [c.centre.x_m, c.centre.y_m, c.radius_m]).collect();
    let starts: Vec<_> =
        (0..swarm.robots()).map(|robot| swarm.pose(robot)).map(|pose| [pose.x_m, pose.y_m, pose.heading_rad]).collect();
    let (place, wide_rad) = match &kind.rays {
        Rays::Fan(fan) => (fan.place, fan.step_rad * (fan.directions.len() - 1) as f64),
        Rays::Few(_) => Default::default(),
    };
    serde_json::json!({
        "high": pair(high), "walls": walls, "solids": solids, "posts": posts, "starts": starts, "step_s": STEP_S,
        "radius_m": kind.radius_m, "speed_m_s": kind.speed_m_s, "turn_rad_s": kind.turn_rad_s,
        "rays": kind.ray_count(), "reach_m": kind.reach_m, "wide_rad": wide_rad, "place": [place.x_m, place.y_m, 0.0],
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_peer_is_told_the_same_world_and_the_same_robots() {
        let task = task(&row::peer_task().unwrap());
        let count = |what: &str| task[what].as_array().map_or(0, Vec::len);
        assert_eq!((count("walls"), count("solids"), count("posts"), count("starts")), (4, 9, 4, 50));
        assert_eq!((task["rays"].as_u64(), task["reach_m"].as_f64()), (Some(180), Some(10.0)));
        assert!((task["wide_rad"].as_f64().unwrap() - std::f64::consts::PI).abs() < 1e-12);
    }
}
