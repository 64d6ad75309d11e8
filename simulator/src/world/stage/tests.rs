//! Worlds in Stage's format, all of our own making.

use crate::geometry::Point;
use crate::world::{World, WorldError};
use std::f64::consts::FRAC_PI_2;

/// Two pixels of wall at the left and one at the lower right, in a picture whose rim is free.
const PICTURE: &str = "P2\n5 4\n255\n255 255 255 255 255\n255 0 255 255 255\n255 127 255 90 255\n255 255 255 255 255\n";

const ROBOTS: &str = r#"
define ears ranger
(
  scount 2               # the way of Stage 2 and 3
  spose[0] [ 0.1 0.1 90 ]
  spose[1] [ 0.1 -0.1 -90 ]
  sview [ 0 5.0 15 ]
)
define cart position
(
  size [ 0.4 0.3 0.2 ]
  origin [ -0.04 0 0 0 ]
  mass 15
  drive "diff"
  ears()
)
"#;

const PLAN: &str = "define plan model ( color \"gray30\" gui_nose 0 boundary 1 )\n";

fn load(world: &str) -> Result<World, WorldError> {
    let files =
        [("w/hall.world", world), ("w/inc/robots.inc", ROBOTS), ("w/inc/plan.inc", PLAN), ("w/maps/hall.pgm", PICTURE)];
    World::load("w/hall.world", &mut |wanted| {
        let found = files.iter().find(|(file, _)| *file == wanted);
        found.map(|(_, text)| text.as_bytes().to_vec()).ok_or_else(|| "no such file".to_owned())
    })
}

const HALL: &str = r#"# a hall
include "inc/robots.inc"
include "inc/plan.inc"
resolution 0.02
interval_sim 100
window ( size [ 700 700 ] scale 37 )
plan ( name "hall" size [ 6.0 4.0 0.6 ] pose [ 1.0 2.0 0 0 ] bitmap "maps/hall.pgm" )
define red cart ( color "red" )
red ( pose [ -1.5 2.0 0 90 ] )
cart ( pose [ 0.0 1.0 180 ] ctrl "wander" )
"#;

#[test]
fn a_floor_plan_fills_its_size_and_robots_are_starts() {
    let world = load(HALL).unwrap();
    let seen = |x: f64, y: f64, to: Point| world.map.cast(Point::new(x, y), to, 50.0);
    // The box around the dark pixels, 3 × 2 of them, becomes 6 × 4 m about (1, 2): a pixel is 2 m wide.
    assert_eq!(seen(1.0, 2.5, Point::new(-1.0, 0.0)), Some(1.0), "to the left wall, which ends at x = 0");
    assert_eq!(seen(1.0, 1.0, Point::new(1.0, 0.0)), Some(1.0), "to the block in the lower right");
    assert_eq!(seen(1.0, 3.0, Point::new(1.0, 0.0)), Some(3.0), "above it to the boundary");
    assert!(world.is_solid(Point::new(-1.0, 1.0)) && world.is_solid(Point::new(3.0, 1.0)));
    assert!(!world.is_solid(Point::new(3.0, 3.0)) && !world.is_solid(Point::new(1.0, 2.0)));
    let poses: Vec<_> = world.starts.iter().map(|start| start.pose).collect();
    assert_eq!((poses[0].x_m, poses[0].y_m), (-1.5, 2.0));
    assert!((poses[0].heading_rad - FRAC_PI_2).abs() < 1e-12 && poses[1].heading_rad.abs() > 3.1);
    assert_eq!(world.name, "hall.world");
}

#[test]
fn what_is_left_out_is_said_once_with_its_place() {
    let world =
        load(&format!("{HALL}cart ( pose [ 0 3 0 0 ] ctrl \"wander\" )\nmodel ( pose [ 9 9 0 0 ] sticky 3 )\n"))
            .unwrap();
    assert_eq!(
        world.notes,
        [
            "w/inc/robots.inc:15:3: `ears` of a robot is not taken over: the robot file decides on sensors",
            "w/hall.world:10:29: `ctrl`: controllers are nodes here, the robot file names them",
            "w/hall.world:11:25: `ctrl`: controllers are nodes here, the robot file names them",
            "w/hall.world:12:26: `sticky` is not understood and left out",
        ]
    );
}

#[test]
fn a_model_without_a_picture_is_a_box_or_its_blocks() {
    let world = load(
        "model ( size [ 2 1 1 ] pose [ 5 0 0 90 ] )
         model ( size [ 1 1 1 ] pose [ 0 5 0 0 ] block ( points 3 point[0] [0 0] point[1] [8 0] point[2] [0 8] z [0 1] ) )
         model ( size [ 1 1 ] pose [ 0 -5 0 ] blocks 1 block[0].points 3
                 block[0].point[0] [0 0] block[0].point[1] [2 0] block[0].point[2] [0 2] )",
    )
    .unwrap();
    assert_eq!(world.map.cast(Point::ZERO, Point::new(1.0, 0.0), 9.0), Some(4.5), "a quarter turn: 1 m deep now");
    assert!(world.is_solid(Point::new(-0.2, 4.8)) && !world.is_solid(Point::new(0.2, 5.2)));
    assert!(world.is_solid(Point::new(-0.2, -5.2)) && !world.is_solid(Point::new(0.2, -4.8)));
    assert_eq!(world.notes, [""; 0]);
}

#[test]
fn units_are_obeyed_and_things_that_hinder_nobody_left_out() {
    let world =
        load("unit_length \"mm\"\nunit_angle \"radians\"\nmodel ( size [ 500 500 ] pose [ 1000 0 0 3.14159 ] )\n")
            .unwrap();
    assert!((world.map.cast(Point::ZERO, Point::new(1.0, 0.0), 9.0).unwrap() - 0.75).abs() < 1e-4);
    let world = load("model ( size [ 1 1 ] pose [ 1 0 0 ] obstacle_return 0 )").unwrap();
    assert!(world.map.segments().is_empty() && world.notes[0].contains("`obstacle_return 0`"), "{:?}", world.notes);
}

#[test]
fn faults_name_file_line_and_column() {
    for (text, said) in [
        ("include \"nowhere.inc\"\n", "w/hall.world:1:1: cannot read w/nowhere.inc: no such file"),
        ("model (\n pose [ 1 2 3 4\n", "w/hall.world:2:7: `[` is never closed"),
        ("model (\n size [ 1 1 ]\n", "w/hall.world:1:1: `(` is never closed"),
        ("name \"hall\nmodel ()\n", "w/hall.world:1:6: a string is not closed"),
        ("model ( pose [ 1 ] )", "w/hall.world:1:9: `pose` needs three or four numbers"),
        ("model ( size [ 0 1 ] )", "w/hall.world:1:9: `size` needs two or three lengths"),
        ("model ( size ( ) )\nmodel ( color )", "w/hall.world:2:9: `color` has no value but `)`"),
        ("model ( bitmap \"none.png\" )", "w/hall.world:1:9: cannot read w/none.png: no such file"),
        ("define a b ( )\ndefine b a ( )\na ( )\n", "w/hall.world:3:1: `a` is based on itself"),
        ("include \"hall.world\"\n", "w/hall.world:1:1: files include one another 8 deep"),
        ("model ( mass 1.2.3 )", "w/hall.world:1:14: `1.2.3` is no number"),
        ("unit_length \"miles\"\n", "w/hall.world:1:1: no such unit of length"),
        (") model ( )", "w/hall.world:1:1: `)` begins nothing"),
        ("model { }", "w/hall.world:1:7: `{` means nothing here"),
    ] {
        let error = load(text).unwrap_err().to_string();
        assert!(error.starts_with(said), "{text:?}: {error}");
    }
    let unknown = load("rover ( pose [ 0 0 0 ] )\n").unwrap();
    assert_eq!(unknown.notes, ["w/hall.world:1:1: `rover` is no kind of thing that is known here: it is left out"]);
}
