//! The status line, for logs and pipes: time, pose, speed, battery, contacts, nodes.

use super::nodes::Nodes;
use super::watch::Picture;
use crate::output::metres_per_second;
use messages::{BaseState, MotionState, Stop};

/// One line about the robot now.
pub fn status(picture: &Picture, nodes: &Nodes) -> String {
    let pose = match picture.pose {
        Some(pose) => format!("x {:6.2}  y {:6.2} m  {:4.0}°", pose.x_m, pose.y_m, pose.heading_rad.to_degrees()),
        None => "x      -  y      - m     -°".into(),
    };
    let speed = picture.velocity().map_or(f64::NAN, |velocity| velocity.linear_x_m_s);
    let battery = match picture.base.map(|base| base.battery_v) {
        Some(volts) if volts.is_finite() => format!("{volts:4.1} V"),
        _ => "   - V".into(),
    };
    let contacts = match picture.truth.map(|truth| truth.contacts) {
        Some([drove, reversed, suffered]) => format!("  contacts {}+{suffered}", drove + reversed),
        None => String::new(),
    };
    let restarts = match nodes.restarts() {
        0 => String::new(),
        restarts => format!("  restarts {restarts}"),
    };
    let stop = held(picture).map(|reason| format!("  held: {reason}")).unwrap_or_default();
    format!(
        "{}  {pose}  {}  {battery}{contacts}  nodes {}/{}{restarts}{stop}",
        clock(picture.watched_s),
        metres_per_second(speed),
        nodes.up(),
        nodes.rows.len()
    )
}

/// Minutes and seconds.
pub fn clock(seconds: f64) -> String {
    let whole = seconds.max(0.0) as u64;
    match whole {
        0..3600 => format!("{:3}:{:02}", whole / 60, whole % 60),
        _ => format!("{}:{:02}:{:02}", whole / 3600, whole / 60 % 60, whole % 60),
    }
}

/// Why motion holds the body back, in words, with what the base says for itself; `None` when it does not.
pub fn held(picture: &Picture) -> Option<&'static str> {
    let motion = picture.motion.as_ref()?;
    let unready = picture.base.as_ref().filter(|_| motion.stop == Stop::Base as u32).and_then(unready);
    unready.or_else(|| stop_reason(motion))
}

/// What a base lacks.
fn unready(base: &BaseState) -> Option<&'static str> {
    match base.link {
        0 => Some("connecting to the base"),
        2 => Some("the base's port cannot be opened; `sinew logs` says why"),
        3 => Some("the base does not answer"),
        4 => Some("the link to the base is lost"),
        5 => Some("what answers is not the base"),
        _ if base.stop_button != 0 => Some("the base's stop button is pressed"),
        _ if base.motors_enabled == 0 => Some("the base's motors are off"),
        _ => None,
    }
}

fn stop_reason(motion: &MotionState) -> Option<&'static str> {
    match motion.stop {
        0 => None,
        1 => Some("no fresh velocity"),
        2 => Some("no fresh ranges"),
        3 => Some("stop zone"),
        4 => Some("bumper"),
        5 => Some("wheel stalled"),
        6 => Some("base not ready"),
        _ => Some("unknown reason"),
    }
}

#[cfg(test)]
mod tests {
    use super::super::nodes::tests::nodes;
    use super::*;
    use messages::{Link, Truth, Twist};
    use simulator::geometry::Pose;

    #[test]
    fn the_line_tells_all_that_matters_in_less_than_a_hundred_columns() {
        let truth = Truth {
            velocity: Twist { linear_x_m_s: 0.28, ..Twist::default() },
            contacts: [0, 1, 2],
            ..Truth::default()
        };
        let picture = Picture {
            watched_s: 75.4,
            pose: Some(Pose::new(3.25, -1.5, std::f64::consts::FRAC_PI_2)),
            truth: Some(truth),
            base: Some(BaseState { battery_v: 12.84, ..BaseState::default() }),
            motion: Some(MotionState { stop: 3, ..MotionState::default() }),
            ..Picture::default()
        };
        let line = status(&picture, &nodes(&["/drivers/base", "/motion/drive"]));
        assert_eq!(
            line,
            "  1:15  x   3.25  y  -1.50 m    90°   0.28 m/s  12.8 V  contacts 1+2  nodes 2/2  held: stop zone"
        );
        assert!(line.chars().count() < 100);
    }

    #[test]
    fn a_base_that_cannot_be_reached_is_the_reason_that_is_shown() {
        let no_port = BaseState { link: Link::NoPort as u32, ..BaseState::default() };
        let motion = Some(MotionState { stop: Stop::Base as u32, ..MotionState::default() });
        let picture = Picture { base: Some(no_port), motion, ..Picture::default() };
        assert!(held(&picture).is_some_and(|reason| reason.contains("port")), "{:?}", held(&picture));
        assert_eq!(held(&Picture { base: None, motion, ..Picture::default() }), Some("base not ready"));
    }

    #[test]
    fn what_is_not_known_is_not_made_up() {
        let line = status(&Picture::default(), &nodes(&[]));
        assert!(line.contains("   - V") && line.contains("    - m/s") && !line.contains("contacts"), "{line}");
    }

    #[test]
    fn hours_have_a_place_of_their_own() {
        assert_eq!([5.0, 65.0, 3725.0].map(clock), ["  0:05", "  1:05", "1:02:05"]);
    }
}
