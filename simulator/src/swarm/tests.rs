use super::*;
use crate::geometry::{Circle, Segment};
use crate::world::{Post, Wall};

fn made(name: &str) -> World {
    World::load(name, &mut |_| Err("no file".into())).unwrap()
}

fn run(swarm: &mut Swarm, steps: usize) {
    (0..steps).for_each(|_| swarm.step());
}

#[test]
fn one_and_two_and_five_threads_give_the_same_bits() {
    for kind in [Kind::simple(12, 2.0), Kind::pioneer_with_sonars(), Kind::pioneer_with_laser(180, 8.0)] {
        let hash = |threads: usize| {
            let mut swarm = Swarm::new(made("office:1:40x26"), kind.clone(), 70, 0.1, 3).unwrap();
            swarm.use_threads(threads).unwrap();
            run(&mut swarm, 60);
            swarm.hash()
        };
        let one = hash(1);
        assert_eq!([hash(1), hash(2), hash(5)], [one; 3], "{}", kind.name);
    }
}

#[test]
fn another_seed_gives_other_places() {
    let hash = |seed| Swarm::new(made("cave:1"), Kind::simple(12, 2.0), 50, 0.1, seed).unwrap().hash();
    assert_eq!(hash(1), hash(1));
    assert_ne!(hash(1), hash(2));
}

#[test]
fn robots_go_a_long_way_and_never_into_a_wall_or_one_another() {
    let kind = Kind::pioneer_with_sonars();
    let radius_m = kind.radius_m;
    let mut swarm = Swarm::new(made("cave:2"), kind, 100, 0.1, 7).unwrap();
    for _ in 0..600 {
        swarm.step();
        for robot in 0..100 {
            let place = swarm.pose(robot).place();
            let mut gap_m = f64::INFINITY;
            swarm.world.map.near(place, 0.5, |to| gap_m = gap_m.min(to.norm()));
            assert!(gap_m > radius_m - 1e-6, "robot {robot} is {gap_m} m from a wall at {} s", swarm.time_s());
            assert!(!swarm.world.is_solid(place));
            for other in 0..robot {
                let apart_m = (swarm.pose(other).place() - place).norm();
                assert!(apart_m > 2.0 * radius_m - 1e-6, "{robot} and {other}: {apart_m} m at {} s", swarm.time_s());
            }
        }
    }
    assert!(swarm.distance_m() > 100.0 * 60.0 * 0.1, "{} m in all", swarm.distance_m());
}

/// Every ray against a plain loop over all walls, posts and robots.
#[test]
fn every_ray_reads_what_an_exhaustive_search_finds() {
    for kind in [Kind::simple(12, 2.0), Kind::pioneer_with_sonars(), Kind::pioneer_with_laser(180, 8.0)] {
        let mut swarm = Swarm::new(made("cave:3"), kind.clone(), 60, 0.1, 1).unwrap();
        run(&mut swarm, 20);
        let before: Vec<Pose> = (0..60).map(|robot| swarm.pose(robot)).collect();
        swarm.step();
        for robot in 0..60 {
            for (ray, read_m) in swarm.ranges_m(robot).iter().enumerate() {
                let (place, direction) = match &kind.rays {
                    Rays::Few(few) => few.rays[ray],
                    Rays::Fan(fan) => (fan.place, fan.directions[ray]),
                };
                let origin = before[robot].world_from_body(place);
                let direction = before[robot].world_from_body(direction) - before[robot].place();
                let walls = swarm.world.map.segments().iter().filter_map(|wall| wall.cast(origin, direction));
                let posts = swarm.world.map.circles().iter().filter_map(|post| post.cast(origin, direction));
                let others = (0..60).filter(|other| *other != robot);
                let discs =
                    others.filter_map(|k| Circle::new(before[k].place(), kind.radius_m).cast(origin, direction));
                let wanted_m = walls.chain(posts).chain(discs).fold(kind.reach_m, f64::min);
                assert!(
                    (f64::from(*read_m) - wanted_m).abs() < 1e-5,
                    "{} {robot} {ray}: {read_m} {wanted_m}",
                    kind.name
                );
            }
        }
    }
}

#[test]
fn a_robot_stops_at_a_wall_and_counts_one_contact() {
    let wall = Wall { segment: Segment::new(Point::new(1.0, -5.0), Point::new(1.0, 5.0)), rough: false };
    let post = Post { circle: Circle::new(Point::new(-3.0, 0.0), 0.3), rough: false };
    // It looks at none of its rays: nobody sees the wall.
    let kind = Kind { ahead: Default::default(), ..Kind::simple(12, 2.0) };
    let world = World::of(&[wall], &[post]);
    let mut swarm = Swarm::at(world, kind, &[Pose::new(0.0, 0.0, 0.0)], 0.1, 0).unwrap();
    run(&mut swarm, 40);
    let pose = swarm.pose(0);
    assert!((pose.x_m - 0.95).abs() < 0.02 && swarm.contacts() >= 1, "{pose:?} {}", swarm.contacts());
    assert!(pose.x_m <= 0.95 + 1e-9);
}

#[test]
fn senseless_swarms_are_refused_in_one_sentence() {
    let refused =
        |count: usize, world: World| Swarm::new(world, Kind::simple(12, 2.0), count, 0.1, 0).unwrap_err().to_string();
    assert_eq!(refused(0, made("cave:1")), "a swarm of 0 robots has nothing to simulate; give at least 1");
    assert!(refused(5, World::default()).contains("has no area to drive in"));
    let full = refused(100_000, made("cave:1"));
    assert!(full.starts_with("of 100000 robots of 0.05 m radius only") && full.contains("larger world"), "{full}");
    let inside = Swarm::at(
        World::of(&[], &[Post { circle: Circle::new(Point::ZERO, 1.0), rough: false }]),
        Kind::simple(12, 2.0),
        &[Pose::new(0.3, 0.0, 0.0)],
        0.1,
        0,
    );
    assert!(inside.unwrap_err().to_string().contains("robot 0 cannot start at (0.300, 0.000)"));
    let mut swarm = Swarm::new(made("cave:1"), Kind::simple(12, 2.0), 1, 0.1, 0).unwrap();
    assert!(swarm.use_threads(0).is_err());
}
