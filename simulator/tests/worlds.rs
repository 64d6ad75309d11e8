//! The worlds that come with the robots: they load, robots can start in them, and they hold what they promise.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking, also in its helpers")]

use simulator::geometry::{Footprint, Point, Pose};
use simulator::world::World;
use simulator::{Setup, Simulation};

const ROBOTS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../robots");

fn world(name: &str) -> World {
    let file = format!("{ROBOTS}/{name}");
    World::load(&file, &mut |file| std::fs::read(file).map_err(|error| error.to_string())).unwrap()
}

/// Every world file below `robots/*/worlds`.
fn shipped() -> Vec<String> {
    let mut names = Vec::new();
    for robot in std::fs::read_dir(ROBOTS).unwrap() {
        let robot = robot.unwrap().file_name().into_string().unwrap();
        let Ok(worlds) = std::fs::read_dir(format!("{ROBOTS}/{robot}/worlds")) else { continue };
        names.extend(worlds.map(|file| format!("{robot}/worlds/{}", file.unwrap().file_name().to_str().unwrap())));
    }
    names.retain(|name| name.ends_with(".toml"));
    names
}

#[test]
fn every_world_loads_and_every_seed_finds_a_start() {
    let names = shipped();
    assert!(names.len() >= 4, "{names:?}");
    for name in names {
        let world = world(&name);
        for seed in 0..100 {
            let setup = Setup { seed, ..Setup::default() };
            let mut simulation =
                Simulation::new(world.clone(), &setup).unwrap_or_else(|error| panic!("{name}: {error}"));
            assert!(simulation.clearance_m(0) > 0.0, "{name}, seed {seed}");
        }
    }
}

/// Whether a Pioneer fits along the straight way from `from` to `to`, and the least room that it has [m].
fn room_along(world: &World, from: Point, to: Point) -> f64 {
    let outline = Footprint::cut_rectangle(0.21, 0.301, 0.2, 0.1).unwrap();
    let heading_rad = (to - from).angle();
    (0..=1000)
        .map(|k| from + (to - from) * (k as f64 / 1000.0))
        .map(|place| outline.placed(Pose::new(place.x_m, place.y_m, heading_rad)))
        .map(|placed| world.map.nearest(&placed, 9.0).map_or(9.0, |near| near.distance_m))
        .fold(f64::INFINITY, f64::min)
}

#[test]
fn the_opening_is_half_a_metre_and_a_pioneer_fits_through_with_five_centimetres_to_spare() {
    let world = world("pioneer/worlds/opening.toml");
    let start = world.starts[0].pose;
    let room_m = room_along(&world, start.place(), start.place() + Point::new(5.0, 0.0));
    assert!((room_m - 0.05).abs() < 0.001, "{room_m}");
}

#[test]
fn the_office_has_a_door_of_half_a_metre_and_people_in_it() {
    let world = world("pioneer/worlds/office.toml");
    assert!(!world.persons.is_empty());
    for person in &world.persons {
        for way in person.path.windows(2) {
            let free =
                (0..=200).map(|k| way[0] + (way[1] - way[0]) * (k as f64 / 200.0)).all(|place| !world.is_solid(place));
            assert!(free, "somebody walks through a wall");
        }
    }
    // Somewhere two walls in line end half a metre apart.
    let walls = world.map.segments();
    let is_opening = |a: Point, b: Point| ((b - a).norm() - 0.5).abs() < 1e-6;
    let ends: Vec<Point> = walls.iter().flat_map(|wall| [wall.a, wall.b]).collect();
    let found = ends.iter().any(|a| ends.iter().any(|b| is_opening(*a, *b)));
    assert!(found);
}

#[test]
fn the_barn_world_can_be_crossed_by_its_reference_robots_circle() {
    let world = world("barn/worlds/barn_1.toml");
    assert_eq!(world.name, "BARN 1");
    // 30 + 66 cylinders of the run-up; the rest is the field, of which the generator fills some 15 %.
    let field = world.map.circles().len() - 96;
    assert!((60..180).contains(&field), "{field}");
    assert!(!world.is_solid(Point::new(-2.25, 3.0)) && !world.is_solid(Point::new(-2.25, 13.0)));
}
