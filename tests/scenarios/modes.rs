//! S2's five op modes and the five algorithms of arbitration, each with what it does that no other does.

use messages::{
    Axis, CoordinatorState, GotoGoal, ModeState, MoveRequest, Proposal, Room, SetMode, Trigger, Twist, Wish,
};
use runtime::calls::TicketState;
use runtime::robot::Robot;
use sinew::experiments::rig::{End, OpMode, Rig, configure, service};
use sinew::{messages, runtime};

/// Changes a mode of the coordinator.
fn change(robot: &mut Robot, mode: OpMode, change: impl FnOnce(&mut toml::Table)) {
    configure(robot, runtime::Layer::Coordinator, "arbiter", |config| {
        let modes = config.get_mut("modes").and_then(|modes| modes.as_array_mut()).unwrap();
        change(modes[mode as usize].as_table_mut().unwrap());
    });
}

/// Who is obeyed, counted over the moments in which both Goto and Avoid want something.
#[derive(Debug, Default)]
struct Obeyed {
    both: u32,
    goto: u32,
    avoid: u32,
    /// The mean by weight and urgency.
    mean: u32,
    /// Between the two on each axis.
    between: u32,
}

/// Goto and Avoid towards a goal behind a pillar, under `algorithm`.
fn behind_a_pillar(algorithm: &str, goto_weight: f64) -> (Obeyed, Rig) {
    let mut robot = service("hallway").unwrap();
    change(&mut robot, OpMode::PositionAvoidance, |mode| {
        mode.insert("algorithm".into(), algorithm.into());
        mode["weights"].as_table_mut().unwrap().insert("goto".into(), goto_weight.into());
    });
    let mut rig = Rig::new(&robot, 3, OpMode::PositionAvoidance).unwrap();
    let goal = GotoGoal { x_m: 9.0, y_m: 3.2, heading_rad: f64::NAN, tolerance_m: 0.1 };
    rig.order("/actions/goto", "goto", &goal);
    let mut obeyed = Obeyed::default();
    for _ in 0..1500 {
        rig.watch(0.02);
        let of = |path: &str| rig.latest::<Proposal>(path).unwrap_or_default();
        let (goto, avoid) = (of("/actions/goto/proposal"), of("/actions/avoid/proposal"));
        let room: Room = rig.latest("/actions/avoid/room").unwrap_or_default();
        let sent: Twist = rig.latest("/coordinator/arbiter/velocity").unwrap_or_default();
        let wants = |p: &Proposal| p.forward.wish == Wish::Exact as u32 && p.turn.wish == Wish::Exact as u32;
        // Where the two all but agree nobody can tell whom the body obeys.
        let far_apart = (goto.forward.value - avoid.forward.value).abs() > 0.02
            && (goto.turn.value - avoid.turn.value).abs() > 0.02;
        // A protective stop cuts whatever is wanted.
        let stop = of("/actions/emergency_stop/proposal");
        if !(wants(&goto) && wants(&avoid) && room.nearest_m < 0.8 && far_apart) || stop.forward.cap_positive < 1.0 {
            continue;
        }
        obeyed.both += 1;
        let capped = |axis: &Axis, most: f64| axis.value.clamp(-most, most);
        let (goto_wants, avoid_wants) = (
            [capped(&goto.forward, 1.0), capped(&goto.turn, 1.0)],
            [capped(&avoid.forward, 1.0), capped(&avoid.turn, 1.0)],
        );
        let is = [sent.linear_x_m_s, sent.angular_z_rad_s];
        let same = |wanted: [f64; 2]| (0..2).all(|k| (is[k] - wanted[k]).abs() < 1e-3);
        let (heavy, light) = (goto_weight * goto.urgency, avoid.urgency);
        let mean = [0, 1].map(|k| (heavy * goto_wants[k] + light * avoid_wants[k]) / (heavy + light));
        let between = (0..2).all(|k| {
            let (low, high) = (goto_wants[k].min(avoid_wants[k]), goto_wants[k].max(avoid_wants[k]));
            is[k] > low + 1e-3 && is[k] < high - 1e-3
        });
        obeyed.goto += u32::from(same(goto_wants));
        obeyed.avoid += u32::from(same(avoid_wants));
        obeyed.mean += u32::from(same(mean));
        obeyed.between += u32::from(between);
    }
    (obeyed, rig)
}

fn most(part: u32, whole: u32) -> bool {
    10 * part >= 8 * whole
}

#[test]
fn switch_80cm_hands_over_to_avoid_near_the_pillar() {
    let (obeyed, rig) = behind_a_pillar("switch_80cm", 1.0);
    assert!(obeyed.both > 20 && most(obeyed.avoid, obeyed.both), "{obeyed:?}");
    assert!(rig.truth().x_m > 7.0 && rig.truth().contacts == [0; 3], "{:?}", rig.truth());
}

#[test]
fn priority_obeys_the_weightiest_alone_and_motion_stops_it_before_the_pillar() {
    let (obeyed, rig) = behind_a_pillar("priority", 2.0);
    assert!(obeyed.both > 20 && most(obeyed.goto, obeyed.both), "{obeyed:?}");
    assert!(rig.truth().x_m < 5.6 && rig.truth().contacts == [0; 3], "{:?}", rig.truth());
}

#[test]
fn weighted_takes_the_mean_of_both() {
    let (obeyed, _) = behind_a_pillar("weighted", 1.0);
    assert!(obeyed.both > 20 && most(obeyed.mean, obeyed.both), "{obeyed:?}");
}

#[test]
fn fuzzy_takes_something_between_that_is_not_the_mean() {
    let (obeyed, _) = behind_a_pillar("fuzzy", 1.0);
    assert!(obeyed.both > 20 && most(obeyed.between, obeyed.both), "{obeyed:?}");
    assert!(obeyed.mean * 2 < obeyed.both, "{obeyed:?}");
}

/// Held by EmergencyStop before somebody who stands in the way: who decides the turn, and is the wish cut or refused?
fn before_a_person(algorithm: &str) -> (u32, u32) {
    let mut robot = service("person").unwrap();
    configure(&mut robot, runtime::Layer::Simulator, "world", |config| {
        let body = config["bodies"].as_array_mut().unwrap()[0].as_table_mut().unwrap();
        body.insert("start".into(), vec![5.0, 2.0, 0.0].into());
    });
    // A long reach: it holds before motion does.
    configure(&mut robot, runtime::Layer::Actions, "emergency_stop", |config| {
        config.insert("danger_m".into(), 0.6.into());
    });
    change(&mut robot, OpMode::Position, |mode| {
        mode.insert("algorithm".into(), algorithm.into());
    });
    let mut rig = Rig::new(&robot, 1, OpMode::Position).unwrap();
    // Somebody stands before it now; the goal is to the left.
    rig.watch(4.0);
    let goal = GotoGoal { x_m: 6.0, y_m: 6.0, heading_rad: f64::NAN, tolerance_m: 0.1 };
    rig.order("/actions/goto", "goto", &goal);
    let (mut cut, mut refused) = (0, 0);
    for _ in 0..250 {
        rig.watch(0.02);
        let stop: Proposal = rig.latest("/actions/emergency_stop/proposal").unwrap_or_default();
        let goto: Proposal = rig.latest("/actions/goto/proposal").unwrap_or_default();
        let (sent, state): (Twist, CoordinatorState) = (
            rig.latest("/coordinator/arbiter/velocity").unwrap_or_default(),
            rig.latest("/coordinator/arbiter/state").unwrap_or_default(),
        );
        if stop.forward.cap_positive == 0.0 && goto.forward.value > 0.01 && goto.turn.value.abs() > 0.01 {
            let turns = (sent.angular_z_rad_s - goto.turn.value).abs() < 0.02;
            cut += u32::from(sent.linear_x_m_s == 0.0 && turns && state.capped & 1 != 0);
            refused += u32::from(sent == Twist::default() && state.share == [0.0; 3]);
        }
    }
    assert_eq!(rig.truth().contacts, [0; 3]);
    (cut, refused)
}

#[test]
fn a_veto_refuses_the_whole_proposal_where_priority_cuts_its_speed_alone() {
    let (cut, refused) = before_a_person("priority");
    assert!(cut > 10 && refused * 4 < cut, "{cut} cut, {refused} refused");
    let (cut, refused) = before_a_person("priority_with_veto");
    assert!(refused > 20 && cut * 10 < refused, "{cut} cut, {refused} refused");
}

/// How far the robot gets in `mode` by an order to move and one to go, both given.
fn way_m(mode: OpMode) -> (f64, f64) {
    let robot = service("open").unwrap();
    let mut rig = Rig::new(&robot, 1, mode).unwrap();
    // Ahead by Move, to the left by Goto.
    let goal = GotoGoal { x_m: 6.0, y_m: 8.0, heading_rad: f64::NAN, tolerance_m: 0.1 };
    rig.order("/actions/goto", "goto", &goal);
    let request = MoveRequest { speed_m_s: 0.3, wheel_difference_m_s: 0.0, duration_s: 5.0 };
    rig.order("/actions/move", "move", &request);
    rig.watch(8.0);
    (rig.truth().x_m - 6.0, rig.truth().y_m - 6.0)
}

#[test]
fn each_op_mode_obeys_the_actions_that_it_names() {
    assert_eq!(way_m(OpMode::None), (0.0, 0.0));
    for mode in [OpMode::Velocity, OpMode::VelocityAvoidance] {
        let (ahead, aside) = way_m(mode);
        assert!(ahead > 1.2 && aside.abs() < 0.1, "{mode:?}: {ahead} {aside}");
    }
    for mode in [OpMode::Position, OpMode::PositionAvoidance] {
        let (ahead, aside) = way_m(mode);
        assert!(ahead.abs() < 0.5 && aside > 1.5, "{mode:?}: {ahead} {aside}");
    }
}

#[test]
fn with_avoidance_an_order_to_move_goes_around_and_without_it_stops_before() {
    let around = |mode: OpMode| {
        let mut robot = service("hallway").unwrap();
        configure(&mut robot, runtime::Layer::Simulator, "world", |config| {
            let body = config["bodies"].as_array_mut().unwrap()[0].as_table_mut().unwrap();
            body.insert("start".into(), vec![3.5, 3.25, 0.0].into());
        });
        let mut rig = Rig::new(&robot, 1, mode).unwrap();
        let request = MoveRequest { speed_m_s: 0.3, wheel_difference_m_s: 0.0, duration_s: 25.0 };
        rig.order("/actions/move", "move", &request);
        rig.watch(25.0);
        assert_eq!(rig.truth().contacts, [0; 3], "{mode:?}");
        (rig.truth().x_m, rig.truth().y_m)
    };
    let (x_m, _) = around(OpMode::Velocity);
    assert!(x_m > 4.8 && x_m < 5.5, "it stops before the pillar: {x_m}");
    let (x_m, y_m) = around(OpMode::VelocityAvoidance);
    assert!(x_m > 6.0 || (y_m - 3.25).abs() > 0.5, "it turns away: {x_m} {y_m}");
}

#[test]
fn a_mode_is_read_and_set_by_call_while_no_period_runs() {
    let robot = service("open").unwrap();
    let mut rig = Rig::new(&robot, 1, OpMode::None).unwrap();
    let read = |rig: &mut Rig| {
        let ticket = rig.order("/coordinator/arbiter", "get_mode", &Trigger::default());
        match rig.until_over(ticket, 1.0) {
            End::Done(body) => *messages::bytemuck::from_bytes::<ModeState>(&body),
            other => panic!("{other:?}"),
        }
    };
    assert_eq!(read(&mut rig), ModeState { mode: 0, modes: 5 });
    for mode in 0..5 {
        let ticket = rig.order("/coordinator/arbiter", "set_mode", &SetMode { mode });
        assert!(matches!(rig.until_over(ticket, 1.0), End::Done(_)));
        assert_eq!(read(&mut rig).mode, mode);
    }
    let ticket = rig.order("/coordinator/arbiter", "set_mode", &SetMode { mode: 5 });
    rig.watch(0.5);
    assert!(matches!(rig.state(ticket), TicketState::Refused(_)));
    assert_eq!(read(&mut rig).mode, 4, "a mode that is unknown changes nothing");
}
