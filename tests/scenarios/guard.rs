//! The guard zone: time to collision with what moves, from the tracks.

use messages::{GotoGoal, MotionState, Stop};
use runtime::Layer;
use sinew::experiments::rig::{OpMode, Rig, configure, variant};
use sinew::{messages, runtime};

/// Drives towards somebody who walks towards it; how far away everything still was when motion first slowed it [m].
fn slows_at_m(with_tracks: bool) -> f64 {
    let mut robot = variant("laser.toml", "hallway").unwrap();
    configure(&mut robot, Layer::Simulator, "world", |config| {
        let body = config["bodies"].as_array_mut().unwrap()[0].as_table_mut().unwrap();
        body.insert("start".into(), vec![6.0, 4.8, 0.0].into());
    });
    if !with_tracks {
        let drive = robot.nodes.iter_mut().find(|node| node.kind.layer == Layer::Motion).unwrap();
        drive.reads.retain(|name, _| name != "tracks");
    }
    let mut rig = Rig::new(&robot, 1, OpMode::Position).unwrap();
    let goal = GotoGoal { x_m: 20.0, y_m: 4.8, heading_rad: f64::NAN, tolerance_m: 0.1 };
    rig.order("/actions/goto", "goto", &goal);
    let mut slowed_at_m = None;
    for _ in 0..1500 {
        rig.watch(0.02);
        let state: MotionState = rig.latest("/motion/drive/state").unwrap_or_default();
        let truth = rig.truth();
        let held = state.stop == Stop::Zone as u32 && truth.velocity.linear_x_m_s > 0.2;
        if held && slowed_at_m.is_none() && truth.clearance_m < 3.0 {
            slowed_at_m = Some(truth.clearance_m);
        }
    }
    assert_eq!(rig.truth().contacts[0], 0);
    slowed_at_m.expect("nobody came near")
}

#[test]
fn somebody_who_comes_towards_it_slows_the_robot_earlier_when_tracks_say_so() {
    let (with, without) = (slows_at_m(true), slows_at_m(false));
    assert!(with > 1.3 * without, "{with} m with tracks, {without} m without");
}
