//! Worlds from files, and their queries against brute force.

use super::*;
use crate::geometry::{Cone, Footprint};
use proptest::prelude::*;

fn load_from(files: &[(&str, &str)], name: &str) -> Result<World, WorldError> {
    World::load(name, &mut |wanted| {
        let found = files.iter().find(|(file, _)| *file == wanted);
        found.map(|(_, text)| text.as_bytes().to_vec()).ok_or_else(|| "no such file".to_owned())
    })
}

fn toml(text: &str) -> Result<World, WorldError> {
    load_from(&[("w/office.toml", text)], "w/office.toml")
}

const X: Point = Point::new(1.0, 0.0);

#[test]
fn a_world_file_gives_walls_doors_boxes_circles_people_and_starts() {
    let world = toml(
        r#"
        name = "two rooms"
        bounds_m = [0.0, 0.0, 10.0, 6.0]
        [[start]]
        x_m = 1.0
        y_m = 3.0
        heading_deg = 90.0
        [[wall]]
        points_m = [[5.0, 0.0], [5.0, 6.0]]
        thickness_m = 0.1
        doors = [{ at_m = 3.0, width_m = 0.9 }]
        [[box]]
        centre_m = [8.0, 3.0]
        size_m = [1.0, 2.0]
        [[polygon]]
        points_m = [[1.0, 5.0], [2.0, 5.0], [1.0, 6.0]]
        [[circle]]
        centre_m = [2.0, 1.0]
        radius_m = 0.2
        [[person]]
        path_m = [[1.0, 1.0], [4.0, 1.0]]
        speed_m_s = 0.7
        "#,
    )
    .unwrap();
    assert_eq!((world.name.as_str(), world.starts.len(), world.persons.len()), ("two rooms", 1, 1));
    assert!((world.starts[0].pose.heading_rad - std::f64::consts::FRAC_PI_2).abs() < 1e-12);
    // Through the door to the box; beside the door to the wall; to the circle; to the outer wall.
    let seen = |x: f64, y: f64| world.map.cast(Point::new(x, y), X, 20.0).unwrap();
    assert!((seen(1.0, 3.0) - 6.5).abs() < 1e-9);
    assert!((seen(1.0, 3.44) - 6.5).abs() < 1e-9);
    assert!((seen(1.0, 3.46) - 3.95).abs() < 1e-9);
    assert!((seen(1.0, 1.0) - 0.8).abs() < 1e-9);
    assert!((seen(8.6, 1.0) - 1.4).abs() < 1e-9);
    assert!(
        world.is_solid(Point::new(8.0, 3.0))
            && world.is_solid(Point::new(2.1, 1.0))
            && world.is_solid(Point::new(5.0, 1.0))
    );
    assert!(!world.is_solid(Point::new(5.0, 3.0)));
}

#[test]
fn a_door_may_span_a_corner_of_its_wall() {
    let world =
        toml("[[wall]]\npoints_m = [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0]]\ndoors = [{ at_m = 2.0, width_m = 1.0 }]\n")
            .unwrap();
    let segments = world.map.segments();
    assert_eq!(segments.len(), 2);
    assert_eq!(segments[0].b, Point::new(1.5, 0.0));
    assert_eq!(segments[1].a, Point::new(2.0, 0.5));
}

#[test]
fn faults_in_a_world_file_name_place_reason_and_remedy() {
    for (text, said) in [
        (
            "[[circle]]\ncentre_m = [1.0, 2.0]\nradius = 0.2\n",
            "w/office.toml:3:1: unknown field `radius`; did you mean `radius_m`?",
        ),
        ("[[cirle]]\n", "w/office.toml:1:3: unknown field `cirle`; did you mean `circle`?"),
        ("name = 3\n", "w/office.toml:1:8: invalid type"),
        ("name = \"x\n", "w/office.toml:1:"),
        (
            "\n[[circle]]\ncentre_m = [1.0, 2.0]\nradius_m = 0.0\n",
            "w/office.toml:2:1: a circle needs a radius_m above zero",
        ),
        ("[[circle]]\ncentre_m = [nan, 2.0]\nradius_m = 1.0\n", "w/office.toml:1:1: a circle needs"),
        (
            "[[wall]]\npoints_m = [[0.0, 0.0], [4.0, 0.0]]\ndoors = [\n  { at_m = 3.8, width_m = 0.9 },\n]\n",
            "w/office.toml:4:3: the door from 3.350 m to 4.250 m lies outside the wall, which is 4.000 m long",
        ),
        ("[[wall]]\npoints_m = [[0.0, 0.0]]\n", "points_m needs at least 2 points, here are 1"),
        ("[[wall]]\npoints_m = [[0.0, 0.0], [0.0, 0.0]]\n", "the same point twice"),
        ("[[person]]\npath_m = [[0.0, 0.0], [1.0, 0.0]]\nspeed_m_s = -1.0\n", "speed_m_s above zero"),
        ("bounds_m = [3.0, 0.0, 1.0, 2.0]\n", "left < right"),
        ("[bitmap]\nfile = \"gone.yaml\"\n", "cannot read w/gone.yaml: no such file"),
    ] {
        let error = toml(text).unwrap_err().to_string();
        assert!(error.contains(said), "{text:?} gave {error:?}, not {said:?}");
        assert!(error.contains("; "), "{error:?} lacks a remedy");
    }
    let far = toml("[[circle]]\ncentre_m = [12500.0, 2.0]\nradius_m = 300.0\n").unwrap_err().to_string();
    assert!(far.contains("farther than 10 km") && far.contains("metres"), "{far}");
    let error = load_from(&[("a.stl", "")], "a.stl").unwrap_err().to_string();
    assert!(error.contains("describes no world"), "{error}");
}

#[test]
fn a_barn_block_stands_where_its_readme_says() {
    let mut rows = vec![".".repeat(30); 30];
    rows[3].replace_range(7..8, "#");
    let text = format!("world 4\n{}\nworld 7\n{}\n", vec![".".repeat(30); 30].join("\n"), rows.join("\n"));
    let world = load_from(&[("g.txt", &text)], "g.txt#7").unwrap();
    assert_eq!(world.map.circles().len(), 30 + 66 + 1);
    assert!(world.is_solid(Point::new(-4.425 + 0.45, 5.175 + 1.05)));
    assert_eq!(world.starts[0].pose.place(), Point::new(-2.25, 3.0));
    // Down the run-up the wall at x = −0.075 is 2.175 m away, less its radius.
    let seen = world.map.cast(Point::new(-2.25, 0.075 + 0.15 * 10.0), X, 9.0).unwrap();
    assert!((seen - 2.1).abs() < 1e-9);
    let missing = load_from(&[("g.txt", &text)], "g.txt#5").unwrap_err().to_string();
    assert!(missing.contains("holds no world number 5 among its 2"), "{missing}");
    let broken = load_from(&[("g.txt", "world 1\n....\n")], "g.txt").unwrap_err().to_string();
    assert!(broken.starts_with("g.txt:2:1: row 0 of world 1"), "{broken}");
}

/// A cheap generator for test cases.
fn noise(seed: &mut u64) -> f64 {
    *seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    (*seed >> 11) as f64 / (1u64 << 53) as f64
}

fn clutter(seed: &mut u64) -> (Vec<Wall>, Vec<Post>) {
    let mut place = |scale: f64| Point::new(noise(seed) * scale, noise(seed) * scale);
    let walls = (0..60)
        .map(|_| {
            let a = place(12.0);
            Wall { segment: Segment::new(a, a + place(3.0) - Point::new(1.5, 1.5)), rough: false }
        })
        .collect();
    let posts = (0..40)
        .map(|_| Post { circle: Circle::new(place(12.0), 0.05 + 0.03 * place(1.0).x_m), rough: false })
        .collect();
    (walls, posts)
}

#[test]
fn the_indexed_ray_equals_the_nearest_of_all_primitives() {
    let mut seed = 7;
    let (walls, posts) = clutter(&mut seed);
    let map = Map::new(&walls, &posts);
    for _ in 0..20_000 {
        let origin = Point::new(noise(&mut seed) * 16.0 - 2.0, noise(&mut seed) * 16.0 - 2.0);
        let direction = Point::unit(noise(&mut seed) * 7.0);
        let all = walls
            .iter()
            .filter_map(|wall| wall.segment.cast(origin, direction))
            .chain(posts.iter().filter_map(|post| post.circle.cast(origin, direction)))
            .fold(f64::INFINITY, f64::min);
        let expected = (all <= 8.0).then_some(all);
        assert_eq!(map.cast(origin, direction, 8.0), expected, "{origin:?} {direction:?}");
    }
}

#[test]
fn the_indexed_cone_equals_the_nearest_of_all_primitives() {
    let mut seed = 8;
    let (walls, posts) = clutter(&mut seed);
    let map = Map::new(&walls, &posts);
    for _ in 0..5_000 {
        let apex = Point::new(noise(&mut seed) * 12.0, noise(&mut seed) * 12.0);
        let cone = Cone::new(apex, noise(&mut seed) * 7.0, 0.26, 5.0);
        let all = walls
            .iter()
            .filter_map(|wall| cone.meet_segment(&wall.segment))
            .chain(posts.iter().filter_map(|post| cone.meet_circle(&post.circle)))
            .fold(f64::INFINITY, |best, hit| best.min(hit.distance_m));
        let mut heard = f64::INFINITY;
        map.listen(&cone, |hit, _| {
            heard = heard.min(hit.distance_m);
            heard
        });
        assert_eq!(heard, all, "{apex:?}");
    }
}

#[test]
fn the_indexed_clearance_equals_the_least_of_all_gaps() {
    let mut seed = 9;
    let (walls, posts) = clutter(&mut seed);
    let map = Map::new(&walls, &posts);
    let outline = Footprint::cut_rectangle(0.21, 0.3, 0.2, 0.1).unwrap();
    for _ in 0..5_000 {
        let pose = Pose::new(noise(&mut seed) * 14.0 - 1.0, noise(&mut seed) * 14.0 - 1.0, noise(&mut seed) * 6.0);
        let body = outline.placed(pose);
        let all = walls
            .iter()
            .map(|wall| body.gap_to_segment(&wall.segment).0)
            .chain(posts.iter().map(|post| body.gap_to_circle(&post.circle).0))
            .fold(f64::INFINITY, f64::min);
        assert_eq!(map.nearest(&body, 20.0).unwrap().distance_m, all, "{pose:?}");
        let near = map.nearest(&body, 0.2).map(|found| found.distance_m);
        assert_eq!(near, (all <= 0.2).then_some(all), "{pose:?}");
    }
}

proptest! {
    #[test]
    fn no_text_panics_the_readers_of_worlds(text in "\\PC{0,200}", kind in 0..4_usize) {
        let name = ["w.toml", "w.yaml", "w.txt", "w.txt#3"][kind];
        let _ = load_from(&[(name.split('#').next().unwrap(), &text)], name);
    }

    #[test]
    fn no_words_of_a_world_file_panic_its_reader(
        numbers in prop::collection::vec(prop_oneof![-20.0..20.0_f64, any::<f64>(), Just(0.0)], 12),
        closed in any::<bool>(),
    ) {
        let n = |k: usize| format!("{:?}", numbers[k]).replace("NaN", "nan");
        let text = format!(
            "[[wall]]\npoints_m = [[{}, {}], [{}, {}], [{}, {}]]\nthickness_m = {}\nclosed = {closed}\n\
             doors = [{{ at_m = {}, width_m = {} }}]\n[[circle]]\ncentre_m = [{}, {}]\nradius_m = {}\n",
            n(0), n(1), n(2), n(3), n(4), n(5), n(6), n(7), n(8), n(9), n(10), n(11),
        );
        if let Ok(world) = toml(&text) {
            let hit = world.map.cast(Point::ZERO, X, 100.0);
            prop_assert!(hit.is_none_or(|distance| (0.0..=100.0).contains(&distance)));
        }
    }

    #[test]
    fn no_bytes_panic_the_reader_of_pictures(
        bytes in prop::collection::vec(any::<u8>(), 0..200),
        magic in prop::sample::select(vec!["P2 ", "P5 ", "P5 3 3 255\n", "P2\n9 1 9\n", "\u{89}PNG\r\n"]),
    ) {
        let mut picture = magic.as_bytes().to_vec();
        picture.extend(bytes);
        let _ = World::load("m.yaml", &mut |name| Ok(match name {
            "m.yaml" => b"image: m.pgm\nresolution: 0.1\norigin: [0, 0, 0]\n".to_vec(),
            _ => picture.clone(),
        }));
    }
}
