use crate::geometry::{Footprint, Point};
use crate::world::World;
use std::collections::VecDeque;

fn made(name: &str) -> World {
    World::load(name, &mut |file| Err(format!("nobody may read {file}"))).unwrap_or_else(|e| panic!("{name}: {e}"))
}

const NAMES: [&str; 4] = ["office", "corridors", "rooms", "cave"];

#[test]
fn the_same_name_makes_the_same_world_and_another_seed_another_one() {
    for kind in NAMES {
        let (one, two) = (made(&format!("{kind}:5")), made(&format!("{kind}:5")));
        assert_eq!(one.map.segments(), two.map.segments(), "{kind}");
        assert_ne!(one.map.segments(), made(&format!("{kind}:6")).map.segments(), "{kind}");
    }
}

/// A flood over cells of 0.2 m for a robot of 0.25 m radius.
#[test]
fn every_start_of_a_made_world_reaches_every_other_and_never_the_outside() {
    for name in NAMES.into_iter().flat_map(|kind| (0..6).map(move |seed| format!("{kind}:{seed}"))) {
        let world = made(&name);
        let (low, high) = world.map.extent();
        let columns = ((high.x_m - low.x_m) / 0.2) as i32 + 11;
        let rows = ((high.y_m - low.y_m) / 0.2) as i32 + 11;
        let disc = Footprint::cut_rectangle(0.25, 0.25, 0.25, 0.146).unwrap();
        let centre = |cell: (i32, i32)| low + Point::new(f64::from(cell.0 - 5) * 0.2, f64::from(cell.1 - 5) * 0.2);
        let free = |cell: (i32, i32)| {
            let point = centre(cell);
            let placed = disc.placed(crate::geometry::Pose::new(point.x_m, point.y_m, 0.0));
            world.map.nearest(&placed, 0.0).is_none() && !world.is_solid(point)
        };
        let cell_of = |point: Point| {
            (((point.x_m - low.x_m) / 0.2).round() as i32 + 5, ((point.y_m - low.y_m) / 0.2).round() as i32 + 5)
        };
        assert!(world.starts.len() >= 4, "{name} has {} starts", world.starts.len());
        let mut seen = vec![false; (columns * rows) as usize];
        let mut queue = VecDeque::from([cell_of(world.starts[0].pose.place())]);
        while let Some(cell) = queue.pop_front() {
            let at = (cell.1 * columns + cell.0) as usize;
            if seen[at] || !free(cell) {
                continue;
            }
            assert!(cell.0 > 2 && cell.1 > 2 && cell.0 < columns - 3 && cell.1 < rows - 3, "{name} has a hole");
            seen[at] = true;
            queue.extend([(1, 0), (-1, 0), (0, 1), (0, -1)].map(|(x, y)| (cell.0 + x, cell.1 + y)));
        }
        for start in &world.starts {
            let cell = cell_of(start.pose.place());
            assert!(seen[(cell.1 * columns + cell.0) as usize], "{name}: {:?} cannot be reached", start.pose);
        }
    }
}

#[test]
fn a_large_office_is_like_a_hospital() {
    let hospital = made("office:1:140x60");
    let (low, high) = hospital.map.extent();
    assert_eq!((high - low).x_m, 140.0);
    assert_eq!((high - low).y_m, 60.0);
    assert!(hospital.map.segments().len() > 1500, "{}", hospital.map.segments().len());
}

#[test]
fn a_wrong_name_gets_one_clear_error() {
    let error = |name: &str| World::load(name, &mut |_| Err("no such file".into())).unwrap_err().to_string();
    assert_eq!(
        error("ofice:3"),
        "ofice:3: there is no kind \"ofice\" of made world; did you mean office?; kinds are office, corridors, rooms, cave"
    );
    assert!(error("office:x").contains("\"x\" is no seed; write KIND:SEED"), "{}", error("office:x"));
    assert!(error("office:1:0x0").contains("from 6 to 1000 m"), "{}", error("office:1:0x0"));
    assert!(error("office:1:10").contains("\"10\" is no size"));
    assert!(error("office:1:NaNx9").contains("from 6 to 1000 m"));
}
