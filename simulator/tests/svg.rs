//! Pictures of a run: complete, well formed, and of the size that the world has.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking, also in its helpers")]

use messages::{Contact, ContactCause};
use simulator::geometry::{Circle, Footprint, Point, Pose};
use simulator::svg::{Picture, RobotPicture, SonarBeam, SonarForce, TrackPoint, render};
use simulator::world::World;

const OFFICE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../robots/pioneer/worlds/office.toml");

fn office() -> World {
    World::load(OFFICE, &mut |file| std::fs::read(file).map_err(|error| error.to_string())).unwrap()
}

fn track() -> Vec<TrackPoint> {
    (0..600)
        .map(|k| k as f64 * 0.01)
        .map(|t| TrackPoint { x_m: 1.5 + 1.8 * t, y_m: 6.0 + 0.25 * runtime::math::sin(2.0 * t), speed_m_s: 0.05 * t })
        .collect()
}

fn forces() -> Vec<SonarForce> {
    [90.0, 50.0, 30.0, 10.0, -10.0, -30.0, -50.0, -90.0_f64]
        .iter()
        .zip([0.2, 0.5, 0.9, 1.3, 1.6, 0.7, 0.0, 0.1])
        .map(|(bearing_deg, force)| SonarForce { bearing_rad: bearing_deg.to_radians(), force })
        .collect()
}

fn beams() -> Vec<SonarBeam> {
    forces()
        .iter()
        .enumerate()
        .map(|(k, force)| SonarBeam {
            origin_x_m: 0.15,
            origin_y_m: 0.0,
            bearing_rad: force.bearing_rad,
            range_m: (k != 6).then_some(0.6 + 0.2 * k as f64),
        })
        .collect()
}

/// Every element that is opened is closed, and every attribute is quoted: a browser refuses anything else.
fn assert_well_formed(svg: &str) {
    let mut open = Vec::new();
    let mut rest = svg;
    while let Some(at) = rest.find('<') {
        let end = rest[at..].find('>').unwrap() + at;
        let tag = &rest[at + 1..end];
        assert_eq!(tag.matches('"').count() % 2, 0, "{tag}");
        let name = tag.trim_start_matches('/').split([' ', '/']).next().unwrap();
        if tag.starts_with('/') {
            assert_eq!(open.pop(), Some(name));
        } else if !tag.ends_with('/') {
            open.push(name);
        }
        rest = &rest[end + 1..];
    }
    assert!(open.is_empty(), "{open:?}");
    assert!(!svg.contains("NaN") && !svg.contains("inf"), "numbers that no viewer knows");
}

#[test]
fn a_picture_shows_map_track_contacts_robot_and_forces() {
    let world = office();
    let footprint = Footprint::cut_rectangle(0.21, 0.3, 0.2, 0.1).unwrap();
    let contact = |x_m, cause: ContactCause| Contact { x_m, y_m: 6.3, speed_m_s: 0.2, cause: cause as u64 };
    let (track, beams, forces) = (track(), beams(), forces());
    let went: Vec<Point> = (0..80).map(|k| Point::new(6.0 + 0.0375 * k as f64, 6.1)).collect();
    let svg = render(&Picture {
        world: &world,
        persons: &[Circle::new(Point::new(9.0, 6.1), 0.25)],
        ways: &[went],
        track: &track,
        contacts: &[contact(6.0, ContactCause::Drove), contact(7.0, ContactCause::Suffered)],
        robot: Some(RobotPicture {
            pose: Pose::new(12.3, 6.0, 0.3),
            footprint: &footprint,
            beams: &beams,
            forces: &forces,
        }),
        title: "pioneer in <office>, seed 3",
        facts: &[("Distance", "31.2 m".into()), ("Mean speed", "0.21 m/s".into())],
    });
    assert_well_formed(&svg);
    let count = |what: &str| svg.matches(what).count();
    assert_eq!(count("class=\"wall\""), world.map.segments().len());
    assert_eq!(count("class=\"beam\"") + count("class=\"silent\""), 8);
    assert_eq!((count("class=\"strong\""), count("class=\"calm\"")), (2, 5));
    assert!(count("class=\"track\"") > 5, "the track changes its colour with the speed");
    assert!(svg.contains("&lt;office&gt;") && svg.contains("31.2 m"));
    assert_eq!((count("class=\"trace\""), count("class=\"way\"")), (1, 0), "people are drawn where they went");
    assert!(svg.contains("contact caused") && svg.contains("contact suffered"));
    if let Ok(file) = std::env::var("SINEW_TEST_SVG") {
        std::fs::write(file, svg).unwrap();
    }
}

#[test]
fn an_empty_world_without_a_robot_is_a_picture_too() {
    let world = World::default();
    let svg = render(&Picture {
        world: &world,
        persons: &[],
        ways: &[],
        track: &[],
        contacts: &[],
        robot: None,
        title: "",
        facts: &[],
    });
    assert_well_formed(&svg);
}
