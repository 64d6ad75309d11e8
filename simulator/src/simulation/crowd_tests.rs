//! People by social force: they pass each other, walls and robots, and are blamed rightly where they do not.

use super::people::people_along;
use super::tests::{Client, perfect};
use super::*;
use crate::geometry::Segment;
use crate::realism::Realism;
use crate::world::{Course, Map, Person, Social, Wall};

fn social(path: &[(f64, f64)], sees_robots: bool) -> Person {
    Person {
        path: path.iter().map(|(x, y)| Point::new(*x, *y)).collect(),
        course: Course::BackAndForth,
        speed_m_s: 1.3,
        radius_m: 0.25,
        yields_within_m: None,
        pause_s: 0.0,
        phase: Some(0.0),
        times_s: Vec::new(),
        social: Some(Social { sees_robots }),
    }
}

fn simulation(world: World, starts: &[Pose]) -> Simulation {
    let body = |pose: &Pose| BodySetup { start: Some(*pose), ..BodySetup::default() };
    let setup = Setup { bodies: starts.iter().map(body).collect(), seed: 3, realism: Realism::none() };
    Simulation::new(world, &setup).unwrap()
}

/// Steps until the time; after each one nobody may stand in a wall, or deep in somebody.
fn run(simulation: &mut Simulation, seconds: f64) {
    for _ in 0..(seconds / STEP_S) as usize {
        simulation.step();
        for (index, disc) in simulation.discs.iter().enumerate() {
            let mut gap_m = f64::INFINITY;
            simulation.world.map.near(disc.centre, 1.0, |to| gap_m = gap_m.min(to.norm()));
            assert!(gap_m > disc.radius_m - 2e-3, "{index} is {gap_m} m from a wall at {disc:?}");
            for other in &simulation.discs[..index] {
                let apart_m = (other.centre - disc.centre).norm();
                assert!(apart_m > 0.45, "{apart_m} m between two at {disc:?}");
            }
        }
    }
}

type Pair = (f64, f64);

fn walls(lines: &[(Pair, Pair)]) -> Map {
    let wall = |((ax, ay), (bx, by)): &(Pair, Pair)| Wall {
        segment: Segment::new(Point::new(*ax, *ay), Point::new(*bx, *by)),
        rough: false,
    };
    Map::new(&lines.iter().map(wall).collect::<Vec<_>>(), &[])
}

#[test]
fn two_who_meet_in_a_corridor_pass_each_other_on_the_right() {
    let persons = vec![social(&[(0.0, 0.0), (10.0, 0.0)], true), social(&[(10.0, 0.0), (0.0, 0.0)], true)];
    let map = walls(&[((-2.0, 1.0), (12.0, 1.0)), ((-2.0, -1.0), (12.0, -1.0))]);
    let mut simulation = simulation(World { map, persons, ..World::default() }, &[]);
    let mut beside_m = 0.0;
    for _ in 0..12 {
        run(&mut simulation, 0.5);
        let [one, other] = [simulation.discs[0].centre, simulation.discs[1].centre];
        if (one.x_m - other.x_m).abs() < 1.0 {
            beside_m = other.y_m - one.y_m;
        }
    }
    assert!(simulation.discs[0].centre.x_m > 5.5 && simulation.discs[1].centre.x_m < 4.5, "{:?}", simulation.discs);
    assert!(beside_m > 0.3, "the one who walks along x keeps below: {beside_m}");
}

#[test]
fn people_go_through_a_door_of_ninety_centimetres() {
    let persons = vec![social(&[(-3.0, 0.1), (3.0, -0.1)], true)];
    let map = walls(&[((0.0, 0.45), (0.0, 4.0)), ((0.0, -0.45), (0.0, -4.0))]);
    let mut simulation = simulation(World { map, persons, ..World::default() }, &[]);
    run(&mut simulation, 6.0);
    assert!(simulation.discs[0].centre.x_m > 1.0, "{:?}", simulation.discs);
}

#[test]
fn a_robot_that_is_seen_is_walked_around_and_one_that_is_not_suffers_the_contact() {
    let contacts = |sees_robots: bool| {
        let persons = vec![social(&[(-4.0, 0.05), (4.0, 0.05)], sees_robots)];
        let mut simulation = simulation(World { persons, ..World::default() }, &[Pose::new(0.0, 0.0, 1.0)]);
        run(&mut simulation, 9.0);
        assert!(simulation.discs[0].centre.x_m > 1.0, "{sees_robots}: {:?}", simulation.discs);
        simulation.statistics(0).contacts
    };
    assert_eq!(contacts(true), [0, 0, 0]);
    let [drove, reversed, suffered] = contacts(false);
    assert!(drove == 0 && reversed == 0 && suffered >= 1, "{drove} {reversed} {suffered}");
}

#[test]
fn a_robot_that_drives_into_somebody_who_cannot_get_away_has_caused_it() {
    // Somebody who waits in a niche.
    let persons = vec![Person { pause_s: 1e3, ..social(&[(3.0, 0.0), (3.0, 0.1)], true) }];
    let map = walls(&[((3.3, -0.35), (3.3, 0.35)), ((2.0, 0.35), (3.3, 0.35)), ((2.0, -0.35), (3.3, -0.35))]);
    let world = World { map, persons, ..World::default() };
    let mut client = Client::new(world, &perfect(&[Pose::new(1.0, 0.0, 0.0)]));
    client.velocity(0, 300, 0);
    client.run(8.0);
    let [drove, reversed, suffered] = client.simulation.statistics(0).contacts;
    assert!(drove >= 1 && reversed == 0 && suffered == 0, "{drove} {reversed} {suffered}");
}

#[test]
fn crowds_walk_about_in_made_worlds_and_the_same_seed_gives_the_same_steps() {
    let load = |name: &str| World::load(name, &mut |_| Err("it is made".into())).unwrap();
    for name in ["office:7:people=12", "rooms:3:people=8", "corridors:5:20x20:people=8", "cave:2:people=10"] {
        let places = || {
            let mut simulation = simulation(load(name), &[]);
            let begin: Vec<Point> = simulation.discs.iter().map(|disc| disc.centre).collect();
            let mut farthest_m = vec![0.0_f64; begin.len()];
            for _ in 0..20 {
                run(&mut simulation, 1.0);
                for ((farthest_m, begin), disc) in farthest_m.iter_mut().zip(&begin).zip(&simulation.discs) {
                    *farthest_m = farthest_m.max((disc.centre - *begin).norm());
                }
            }
            let moved = farthest_m.iter().filter(|way_m| **way_m > 1.0).count();
            assert!(moved * 4 >= begin.len() * 3, "{name}: {farthest_m:?}");
            simulation
                .discs
                .iter()
                .map(|disc| (disc.centre.x_m.to_bits(), disc.centre.y_m.to_bits()))
                .collect::<Vec<_>>()
        };
        let once = places();
        assert_eq!(once, places(), "{name}");
        assert!(once.len() >= 8, "{name}: {}", once.len());
    }
}

#[test]
fn the_ways_of_people_are_found_again_from_the_robots_track() {
    let world = World::load("office:7:people=6", &mut |_| Err("it is made".into())).unwrap();
    let mut simulation = Simulation::new(world.clone(), &Setup { seed: 5, ..Setup::default() }).unwrap();
    let mut track = vec![(0.0, simulation.pose(0))];
    for k in 1..=1000 {
        simulation.step();
        if k % 20 == 0 {
            track.push((f64::from(k) * STEP_S, simulation.pose(0)));
        }
    }
    let ways = people_along(world, 5, BodySetup::default(), &track).unwrap();
    for (way, disc) in ways.iter().zip(simulation.persons()) {
        assert!((way.end.centre - disc.centre).norm() < 1e-6, "{way:?} {disc:?}");
        assert_eq!(way.points.len(), 101);
    }
}
