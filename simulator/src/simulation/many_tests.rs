//! Several whole robots in one world: they hear, meet and hinder each other.

use super::tests::{Client, perfect};
use super::*;

fn ranges_mm(client: &Client, body: usize) -> [u16; 16] {
    let mut ranges = [0; 16];
    for reading in client.sips[body].iter().flat_map(|sip| sip.sonar.to_vec()) {
        ranges[usize::from(reading.number)] = reading.range;
    }
    ranges
}

#[test]
fn robots_in_a_row_hear_each_other_and_nobody_hears_himself() {
    let poses = [0.0, 1.5, 4.0].map(|x_m| Pose::new(x_m, 0.0, 0.0));
    let mut client = Client::new(World::default(), &perfect(&poses));
    client.run(1.0);
    // From a front disc, 0.166 m ahead, to the tail of the next one.
    let tail_m = -client.simulation.footprint(0).corners().iter().map(|corner| corner.x_m).fold(0.0, f64::min);
    let gap_mm = |apart_m: f64| (apart_m - 0.166 - tail_m) * 1e3;
    let [first, second, third] = [0, 1, 2].map(|body| ranges_mm(&client, body));
    assert!((f64::from(first[3]) - gap_mm(1.5)).abs() < 15.0, "{first:?}");
    assert!((f64::from(second[3]) - gap_mm(2.5)).abs() < 15.0, "{second:?}");
    assert_eq!((third[3], third[4]), (5000, 5000), "nobody is ahead of the last one: {third:?}");
    assert!(third[11] < 5000 && first[11] == 5000, "and the last one hears who is behind: {third:?}");
}

#[test]
fn eight_that_drive_at_each_other_touch_and_never_overlap() {
    let poses: Vec<Pose> = (0..8)
        .map(|k| {
            let bearing_rad = std::f64::consts::TAU * f64::from(k) / 8.0;
            let place = Point::unit(bearing_rad) * 2.5;
            Pose::new(place.x_m, place.y_m, runtime::math::wrap_angle(bearing_rad + std::f64::consts::PI))
        })
        .collect();
    let mut client = Client::new(World::default(), &perfect(&poses));
    for _ in 0..20 {
        (0..8).for_each(|body| client.velocity(body, 300, 0));
        client.run(0.5);
        for body in 0..8 {
            assert!(client.simulation.clearance_m(body) > 0.0, "{body}");
        }
    }
    for body in 0..8 {
        assert!(client.simulation.pose(body).place().norm() < 1.2, "{:?}", client.simulation.pose(body));
        assert!(client.simulation.statistics(body).contacts.iter().sum::<u64>() >= 1, "{body} met nobody");
    }
}
