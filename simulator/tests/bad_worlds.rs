//! Worlds that are broken, open, full or far too large: a sentence or a simulation, never a panic.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking, also in its helpers")]

use simulator::geometry::{Circle, Point, Pose, Segment};
use simulator::swarm::{Kind, Swarm};
use simulator::world::{Post, Wall, World};
use simulator::{BodySetup, Setup, SetupError, Simulation};

const YAML: &str = "image: m.img\nresolution: 0.5\norigin: [0.0, 0.0, 0.0]\noccupied_thresh: 0.65\nfree_thresh: 0.25\n";
const STAGE: &str = "define plan model ( size [ 4 4 ] )\nplan ( bitmap \"m.img\" pose [ 0 0 0 ] )\n";

fn with_picture(world: &str, picture: &[u8]) -> Result<World, String> {
    let text = if world.ends_with(".world") { STAGE } else { YAML };
    World::load(world, &mut |file| Ok(if file == world { text.as_bytes().to_vec() } else { picture.to_vec() }))
        .map_err(|error| error.to_string())
}

fn png() -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, 16, 16);
    encoder.set_color(png::ColorType::Grayscale);
    let shades: Vec<u8> = (0..256).map(|k| if k % 7 == 0 { 0 } else { 255 }).collect();
    encoder.write_header().unwrap().write_image_data(&shades).unwrap();
    bytes
}

#[test]
fn a_picture_cut_at_any_byte_is_refused_with_its_name_and_a_whole_one_read() {
    let raw = [b"P5\n16 16\n255\n".as_slice(), &[0; 256]].concat();
    for picture in [png(), raw] {
        for world in ["m.yaml", "m.world"] {
            assert!(with_picture(world, &picture).is_ok());
            // A PNG's end mark alone may be missing: all pixels are there.
            for length in 0..picture.len() - 13 {
                let said = with_picture(world, &picture[..length]).unwrap_err();
                assert!(said.starts_with("m.img: "), "{world} cut at {length}: {said}");
            }
        }
    }
}

#[test]
fn pictures_of_other_kinds_are_refused_by_name() {
    for picture in
        [b"GIF89a....".as_slice(), b"\xFF\xD8\xFF\xE0JFIF", b"BM______", b"P6\n1 1\n255\n\0\0\0", b"", b"<svg/>"]
    {
        for world in ["m.yaml", "m.world"] {
            let said = with_picture(world, picture).unwrap_err();
            assert!(said.contains("m.img: it is neither PGM (P2, P5) nor PNG"), "{said}");
        }
    }
}

fn wall(a: (f64, f64), b: (f64, f64)) -> Wall {
    Wall { segment: Segment::new(Point::new(a.0, a.1), Point::new(b.0, b.1)), rough: false }
}

#[test]
fn robots_that_leave_a_world_with_open_walls_go_on_and_are_still_seen() {
    // Three sides of a square: the fourth is open.
    let open =
        || World::of(&[wall((0.0, 0.0), (6.0, 0.0)), wall((0.0, 0.0), (0.0, 6.0)), wall((0.0, 6.0), (6.0, 6.0))], &[]);
    let run = |threads: usize| {
        let mut swarm = Swarm::new(open(), Kind::pioneer_with_laser(90, 8.0), 12, 0.1, 4).unwrap();
        swarm.use_threads(threads).unwrap();
        (0..900).for_each(|_| swarm.step());
        let outside = (0..12).filter(|robot| swarm.pose(*robot).x_m > 6.5).count();
        assert!(outside > 0, "somebody has left");
        assert!((0..12).all(|robot| swarm.ranges_m(robot).iter().all(|range_m| (0.0..=8.0).contains(range_m))));
        swarm.hash()
    };
    assert_eq!(run(1), run(2));
    // Two face each other far outside.
    let poses = [Pose::new(40.0, 3.0, 0.0), Pose::new(43.0, 3.0, std::f64::consts::PI)];
    let mut swarm = Swarm::at(open(), Kind::pioneer_with_laser(181, 8.0), &poses, 0.1, 4).unwrap();
    swarm.step();
    assert!((swarm.ranges_m(0)[90] - (3.0 - 0.1 - 0.22)).abs() < 1e-3, "{}", swarm.ranges_m(0)[90]);
}

#[test]
fn a_robot_inside_a_wall_a_solid_or_a_post_does_not_begin() {
    let toml = |text: &str| World::load("w.toml", &mut |_| Ok(text.as_bytes().to_vec())).unwrap();
    let worlds = [
        World::of(&[wall((-1.0, 0.1), (1.0, 0.1))], &[]),
        World::of(&[], &[Post { circle: Circle::new(Point::ZERO, 3.0), rough: false }]),
        toml("[[box]]\ncentre_m = [0.0, 0.0]\nsize_m = [9.0, 9.0]\n"),
        toml("[[polygon]]\npoints_m = [[-5.0, -5.0], [5.0, -5.0], [0.0, 8.0]]\n"),
    ];
    for world in worlds {
        let setup = Setup {
            bodies: vec![BodySetup { start: Some(Pose::default()), ..BodySetup::default() }],
            ..Setup::default()
        };
        let refused = Simulation::new(world.clone(), &setup).unwrap_err();
        assert!(matches!(refused, SetupError::Occupied { body: 0, .. }), "{refused}");
        let said =
            Swarm::at(world, Kind::simple(12, 2.0), &[Pose::new(0.0, 0.1, 0.0)], 0.1, 0).unwrap_err().to_string();
        assert!(said.contains("robot 0 cannot start at (0.000, 0.100): something stands there"), "{said}");
    }
}

#[test]
fn maps_without_area_say_so_in_a_swarm_and_are_open_ground_for_a_robot() {
    let line = || World::of(&[wall((0.0, 0.0), (5.0, 0.0))], &[]);
    for world in [World::default(), line()] {
        let said = Swarm::new(world.clone(), Kind::simple(12, 2.0), 3, 0.1, 0).unwrap_err().to_string();
        assert!(said.contains("has no area to drive in; it needs walls that enclose one"), "{said}");
        let start = Some(Pose::new(1.0, 2.0, 0.0));
        let setup = Setup { bodies: vec![BodySetup { start, ..BodySetup::default() }], ..Setup::default() };
        let mut simulation = Simulation::new(world, &setup).unwrap();
        (0..100).for_each(|_| simulation.step());
    }
    let said =
        World::load("w.toml", &mut |_| Ok(b"bounds_m = [0.0, 0.0, 0.0, 4.0]\n".to_vec())).unwrap_err().to_string();
    assert!(said.starts_with("w.toml:1:12: bounds_m must be"), "{said}");
}

#[test]
fn a_hundred_thousand_robots_are_simulated_where_there_is_room_and_refused_where_there_is_none() {
    let made = |name: &str| World::load(name, &mut |_| Err("it is made".into())).unwrap();
    let mut swarm = Swarm::new(made("office:1:440x190"), Kind::simple(12, 2.0), 100_000, 0.1, 1).unwrap();
    swarm.step();
    assert_eq!(swarm.robots(), 100_000);
    assert!(swarm.distance_m() > 100.0);
    let said = Swarm::new(made("cave:1"), Kind::pioneer_with_sonars(), 100_000, 0.1, 1).unwrap_err().to_string();
    assert!(said.starts_with("of 100000 robots of 0.22 m radius only ") && said.contains("larger world"), "{said}");
}
