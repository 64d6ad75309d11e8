//! Sweeps the planner alone over BARN or DynaBARN worlds: `follow_gap_sweep DIR [every] [offset] [key=value …]`.
#![allow(clippy::unwrap_used, clippy::disallowed_methods, reason = "a development program")]

#[path = "../tests/planar/mod.rs"]
mod planar;

use actions::follow_gap::FollowGapConfig;
use actions::follow_gap::planner::Setup;

fn main() {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let folder = std::path::PathBuf::from(&args[0]);
    let dynamic = folder.join("worlds.txt").exists();
    let courses = if dynamic { planar::dynabarn(&folder) } else { planar::barn(&folder) }.unwrap();
    let (mut every, mut offset, mut only) = (1usize, 0usize, None::<u32>);
    let mut trial = planar::Trial { seed: 0, latency_s: 0.04, scale: 1.0, tracking: true, keep_track: false };
    let mut changes = serde_json::Map::new();
    for arg in &args[1..] {
        let (key, value) = arg.split_once('=').unwrap();
        match key {
            "every" => every = value.parse().unwrap(),
            "offset" => offset = value.parse().unwrap(),
            "world" => only = Some(value.parse().unwrap()),
            "seed" => trial.seed = value.parse().unwrap(),
            "latency" => trial.latency_s = value.parse().unwrap(),
            "scale" => trial.scale = value.parse().unwrap(),
            "tracking" => trial.tracking = value.parse().unwrap(),
            "track" => trial.keep_track = value.parse().unwrap(),
            _ => drop(changes.insert(key.into(), serde_json::from_str(value).unwrap())),
        }
    }
    let config: FollowGapConfig = serde_json::from_value(serde_json::Value::Object(changes)).unwrap();
    let setup: Setup = config.setup(&body());
    let (mut runs, mut won, mut hit, mut time, mut score) = (0, 0, 0, 0.0, 0.0);
    let mut step_us = Vec::new();
    let mut class = [(0, 0); 3];
    for course in courses.iter().skip(offset).step_by(every) {
        if only.is_some_and(|only| only != course.index) {
            continue;
        }
        let result = planar::run(course, &setup, &trial);
        runs += 1;
        won += u32::from(result.success);
        hit += u32::from(result.collided);
        score += result.score;
        if result.success {
            time += result.time_s;
        }
        let of = &mut class[(course.index as usize / 20).min(2)];
        *of = (of.0 + u32::from(result.success), of.1 + 1);
        step_us.extend(result.step_us);
        if !result.success || result.score < 0.499 || only.is_some() {
            let what = if result.success {
                "slow"
            } else if result.collided {
                "COLLISION"
            } else {
                "TIMEOUT"
            };
            println!("world {} {what} {:.1} s score {:.3}", course.index, result.time_s, result.score);
        }
        if trial.keep_track {
            for (k, pose) in result.track.iter().enumerate().step_by(5) {
                println!("{:.2} {:.3} {:.3} {:.2}", k as f64 * 0.02, pose.place.x_m, pose.place.y_m, pose.heading_rad);
            }
        }
    }
    step_us.sort_by(f64::total_cmp);
    let at = |q: f64| step_us[((step_us.len() - 1) as f64 * q) as usize];
    println!(
        "{runs} runs: {won} won, {hit} collided, mean {:.2} s, score {:.4}; step p50 {:.0} p99 {:.0} us",
        time / f64::from(won.max(1)),
        score / f64::from(runs),
        at(0.5),
        at(0.99)
    );
    if dynamic {
        println!("by class {class:?}");
    }
}

fn body() -> runtime::Body {
    runtime::Body {
        length_ahead_m: 0.254,
        length_behind_m: 0.254,
        half_width_m: 0.215,
        max_forward_m_s: 2.0,
        max_backward_m_s: 0.2,
        max_turn_rad_s: 2.5,
        acceleration_m_s2: 3.0,
        deceleration_m_s2: 4.0,
        turn_acceleration_rad_s2: 10.0,
        ..runtime::Body::default()
    }
}
