//! Whole simulations, driven by a client's bytes.

use super::*;
use crate::geometry::Segment;
use crate::realism::Realism;
use crate::world::{Course, Map, Person, Post, Start, Wall};
use crate::{BodySetup, LineFaults, Setup, SetupError};
use drivers::p2os::protocol::{Argument, Framer, MAX_PACKET, command, encode_command};
use drivers::p2os::sip::Sip;
use messages::ContactCause;
use std::f64::consts::PI;

/// A client that keeps the watchdog fed and reads the SIPs.
pub(super) struct Client {
    pub simulation: Simulation,
    pub sips: Vec<Vec<Sip>>,
    framers: Vec<Framer>,
    contacts: Vec<Contact>,
}

impl Client {
    pub fn new(world: World, setup: &Setup) -> Client {
        let simulation = Simulation::new(world, setup).unwrap();
        let bodies = simulation.bodies();
        let framers = vec![Framer::new(); bodies];
        let mut client = Client { simulation, sips: vec![Vec::new(); bodies], framers, contacts: Vec::new() };
        for body in 0..bodies {
            for number in [0, 1, 2, command::OPEN] {
                client.command(body, number, Argument::None);
            }
            client.command(body, command::ENABLE, Argument::Integer(1));
        }
        client
    }

    fn command(&mut self, body: usize, number: u8, argument: Argument) {
        let mut out = [0; MAX_PACKET];
        let length = encode_command(&mut out, number, argument).unwrap();
        self.simulation.receive(body, &out[..length]);
    }

    pub fn velocity(&mut self, body: usize, mm_s: i32, deg_s: i32) {
        self.command(body, command::VEL, Argument::Integer(mm_s));
        self.command(body, command::RVEL, Argument::Integer(deg_s));
    }

    pub fn run(&mut self, seconds: f64) {
        let steps = (seconds / STEP_S).round() as usize;
        for step in 0..steps {
            self.simulation.step();
            for body in 0..self.simulation.bodies() {
                if step % 50 == 0 {
                    self.command(body, command::PULSE, Argument::None);
                }
                let mut buffer = [0; 512];
                let count = self.simulation.send(body, &mut buffer);
                let mut bytes = &buffer[..count];
                while let Some(payload) = self.framers[body].next(&mut bytes) {
                    self.sips[body].extend(Sip::parse(payload));
                }
            }
            assert!(self.simulation.clearance_m(0) > 0.0, "the body went into something");
        }
        let contacts = &mut self.contacts;
        self.simulation.take_contacts(0, |contact| contacts.push(contact));
    }

    fn sip(&self) -> Sip {
        *self.sips[0].last().expect("no SIP came")
    }

    fn contacts(&self, body: usize) -> [u64; 3] {
        self.simulation.statistics(body).contacts
    }
}

pub(super) fn perfect(bodies: &[Pose]) -> Setup {
    let body = |pose: &Pose| BodySetup { start: Some(*pose), ..BodySetup::default() };
    Setup { bodies: bodies.iter().map(body).collect(), seed: 1, realism: Realism::none() }
}

fn wall_at(x_m: f64) -> World {
    let segment = Segment::new(Point::new(x_m, -3.0), Point::new(x_m, 3.0));
    World::of(&[Wall { segment, rough: false }], &[])
}

fn walker(path: &[(f64, f64)], yields_within_m: Option<f64>) -> World {
    let path = path.iter().map(|(x, y)| Point::new(*x, *y)).collect();
    let person = Person {
        path,
        course: Course::BackAndForth,
        speed_m_s: 0.8,
        radius_m: 0.25,
        yields_within_m,
        pause_s: 0.0,
        phase: Some(0.0),
        times_s: Vec::new(),
        social: None,
    };
    World { persons: vec![person], ..World::default() }
}

const ORIGIN: Pose = Pose::new(0.0, 0.0, 0.0);
const DROVE: usize = ContactCause::Drove as usize;
const REVERSED: usize = ContactCause::ReversedBlind as usize;
const SUFFERED: usize = ContactCause::Suffered as usize;

#[test]
fn a_robot_that_drives_into_a_wall_stops_at_it_and_feels_it() {
    let mut client = Client::new(wall_at(1.0), &perfect(&[ORIGIN]));
    client.velocity(0, 300, 0);
    client.run(4.0);
    assert_eq!(client.contacts(0), [1, 0, 0], "pressing on for a second is one contact");
    let pose = client.simulation.pose(0);
    assert!((pose.x_m - 0.79).abs() < 0.002, "the front is 0.21 m ahead: {pose:?}");
    let contact = client.contacts[0];
    assert!((contact.x_m - 1.0).abs() < 0.002 && (contact.speed_m_s - 0.3).abs() < 1e-6, "{contact:?}");
    let sip = client.sip();
    assert!(sip.is_left_stalled() && sip.is_right_stalled());
    assert!(sip.front_bumpers() != 0 && sip.rear_bumpers() == 0, "{sip:?}");
    assert_eq!(client.simulation.velocity(0).linear_x_m_s, 0.0);
    // The odometry did not run on while the wheels stood.
    assert!((i32::from(sip.x.unwrap()) - 790).abs() <= 2);
}

#[test]
fn a_second_touch_after_a_gap_is_a_second_contact_and_bumpers_open_again() {
    let mut client = Client::new(wall_at(1.0), &perfect(&[ORIGIN]));
    client.velocity(0, 300, 0);
    client.run(4.0);
    client.velocity(0, -100, 0);
    client.run(1.5);
    assert_eq!((client.sip().front_bumpers(), client.sip().is_left_stalled()), (0, false));
    client.velocity(0, 300, 0);
    client.run(2.0);
    assert_eq!(client.contacts(0), [2, 0, 0]);
}

#[test]
fn backing_into_a_wall_is_reversing_blind() {
    let mut client = Client::new(wall_at(-1.0), &perfect(&[ORIGIN]));
    client.velocity(0, -300, 0);
    client.run(4.0);
    assert_eq!(client.contacts(0), [0, 1, 0]);
    assert!((client.simulation.pose(0).x_m + 1.0 - 0.301).abs() < 0.002);
    assert!(client.sip().rear_bumpers() != 0 && client.sip().front_bumpers() == 0);
}

#[test]
fn the_tail_that_swings_into_a_wall_was_driven_there() {
    let wall = Segment::new(Point::new(-3.0, 0.26), Point::new(3.0, 0.26));
    let world = World::of(&[Wall { segment: wall, rough: false }], &[]);
    let mut client = Client::new(world, &perfect(&[ORIGIN]));
    client.velocity(0, 0, -40);
    client.run(2.0);
    assert_eq!(client.contacts(0), [1, 0, 0]);
    assert!(client.contacts[0].x_m < 0.0, "{:?}", client.contacts);
}

#[test]
fn somebody_who_walks_into_a_standing_robot_is_to_blame() {
    let mut client = Client::new(walker(&[(3.0, 0.0), (-3.0, 0.0)], None), &perfect(&[ORIGIN]));
    client.run(5.0);
    assert_eq!(client.contacts(0), [0, 0, 1]);
    assert_eq!(client.contacts[0].cause, ContactCause::Suffered as u64);
    assert!((client.contacts[0].speed_m_s - 0.8).abs() < 1e-6);
    assert!(client.sip().front_bumpers() != 0);
    assert_eq!(client.simulation.pose(0), ORIGIN, "the robot is not pushed");
}

#[test]
fn somebody_who_yields_never_touches_a_standing_robot() {
    let mut client = Client::new(walker(&[(3.0, 0.0), (-3.0, 0.0)], Some(0.4)), &perfect(&[ORIGIN]));
    client.run(10.0);
    assert_eq!(client.contacts(0), [0; 3]);
    let clearance_m = client.simulation.statistics(0).least_clearance_m;
    assert!((0.38..0.42).contains(&clearance_m), "{clearance_m}");
}

#[test]
fn a_robot_that_drives_into_somebody_who_stands_is_to_blame() {
    let mut client = Client::new(walker(&[(3.0, 0.0), (-3.0, 0.0)], Some(0.5)), &perfect(&[ORIGIN]));
    client.run(5.0);
    client.velocity(0, 200, 0);
    client.run(5.0);
    assert_eq!(client.contacts(0), [1, 0, 0]);
}

#[test]
fn between_two_that_close_in_the_faster_is_to_blame() {
    for (mm_s, cause) in [(300, SUFFERED), (1000, DROVE)] {
        let mut client = Client::new(walker(&[(6.0, 0.0), (-6.0, 0.0)], None), &perfect(&[ORIGIN]));
        client.command(0, command::SETV, Argument::Integer(1200));
        client.command(0, command::SETA, Argument::Integer(2000));
        client.velocity(0, mm_s, 0);
        client.run(6.0);
        let mut expected = [0; 3];
        expected[cause] = 1;
        assert_eq!(client.contacts(0), expected, "{mm_s}");
    }
}

#[test]
fn of_two_robots_one_drove_and_the_other_suffered() {
    let mut client = Client::new(World::default(), &perfect(&[ORIGIN, Pose::new(1.5, 0.0, PI / 2.0)]));
    client.velocity(0, 300, 0);
    client.run(5.0);
    assert_eq!((client.contacts(0), client.contacts(1)), ([1, 0, 0], [0, 0, 1]));
    // The front of one ends at the side of the other.
    assert!((client.simulation.pose(0).x_m - (1.5 - 0.2 - 0.21)).abs() < 0.002);
    let near = client.sip();
    assert!(near.front_bumpers() != 0);
    client.velocity(0, -100, 0);
    client.run(2.0);
    client.velocity(0, 0, 0);
    // The other backs off along its own axis and turns its tail away: nothing touches.
    client.velocity(1, 200, 0);
    client.run(2.0);
    assert_eq!(client.contacts(0)[REVERSED], 0);
}

#[test]
fn a_robot_at_a_wall_can_turn_away_from_it() {
    let mut client = Client::new(wall_at(1.0), &perfect(&[Pose::new(0.0, 0.0, 0.5)]));
    client.velocity(0, 300, 0);
    client.run(5.0);
    assert_eq!(client.contacts(0)[DROVE], 1);
    // Left, until the tail would swing into the wall.
    client.velocity(0, 0, 40);
    client.run(1.5);
    let turned_rad = client.simulation.pose(0).heading_rad;
    assert!(turned_rad > 1.0, "{turned_rad}");
    assert_eq!(client.contacts(0), [1, 0, 0]);
    assert!(!client.sip().is_left_stalled() && client.sip().front_bumpers() == 0);
}

#[test]
fn with_perfect_wheels_the_odometry_is_the_truth() {
    let start = Pose::new(2.0, -1.0, 0.7);
    let mut client = Client::new(World::default(), &perfect(&[start]));
    for (mm_s, deg_s) in [(400, 20), (200, -45), (-300, 10), (0, 60), (500, 0), (0, 0)] {
        client.velocity(0, mm_s, deg_s);
        client.run(2.0);
    }
    let here = start.body_from_world(client.simulation.pose(0).place());
    let sip = client.sip();
    let signed = |raw: u16| f64::from((raw << 1) as i16 >> 1) * 0.001;
    assert!((signed(sip.x.unwrap()) - here.x_m).abs() < 0.002, "{sip:?} {here:?}");
    assert!((signed(sip.y.unwrap()) - here.y_m).abs() < 0.002, "{sip:?} {here:?}");
    let turned = runtime::math::wrap_angle(client.simulation.pose(0).heading_rad - 0.7);
    assert!((f64::from(sip.heading.unwrap()) * 2.0 * PI / 4096.0 - turned).abs() < 0.002);
}

#[test]
fn the_odometry_drifts_within_its_bounds_when_wheels_are_real() {
    let setup = Setup { realism: Realism::default(), ..perfect(&[ORIGIN]) };
    let mut client = Client::new(World::default(), &setup);
    client.velocity(0, 500, 0);
    client.run(20.0);
    let pose = client.simulation.pose(0);
    let sip = client.sip();
    let error = (f64::from(sip.x.unwrap()) * 0.001 - pose.x_m).abs();
    assert!(error > 0.001 && error < 0.5, "{error}");
    assert!(client.simulation.statistics(0).distance_m > 8.0);
}

#[test]
fn sonar_readings_in_the_sip_are_the_distances_of_the_world() {
    let mut client = Client::new(wall_at(2.0), &perfect(&[ORIGIN]));
    client.run(1.0);
    let mut ranges = [0; 16];
    for reading in client.sips[0].iter().flat_map(|sip| sip.sonar.to_vec()) {
        ranges[usize::from(reading.number)] = reading.range;
    }
    // Discs 3 and 4 sit 0.166 m ahead and look 10° aside: the wall's foot lies within the cone.
    assert_eq!((ranges[3], ranges[4]), (1834, 1834));
    assert_eq!((ranges[0], ranges[12]), (5000, 5000));
}

#[test]
fn the_same_seed_gives_the_same_run_and_another_seed_another() {
    let run = |seed| {
        let mut world = walker(&[(3.0, -2.0), (-3.0, 2.0)], Some(0.3));
        world.persons[0].phase = None;
        world.map = wall_at(4.0).map;
        let setup = Setup { seed, realism: Realism::default(), ..perfect(&[ORIGIN]) };
        let mut client = Client::new(world, &setup);
        for k in 0..20 {
            client.velocity(0, 100 * (k % 5) - 100, 15 * (k % 7) - 45);
            client.run(0.7);
        }
        (client.simulation.hash(), client.simulation.pose(0), client.sip())
    };
    assert_eq!(run(5), run(5));
    assert_ne!(run(5).0, run(6).0);
}

#[test]
fn no_motion_ever_takes_a_body_into_an_obstacle() {
    let mut seed = 11_u64;
    let mut noise = move || {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (seed >> 11) as f64 / (1u64 << 53) as f64
    };
    let posts: Vec<Post> = (0..40)
        .map(|_| Post {
            circle: Circle::new(Point::new(noise() * 8.0 - 4.0, noise() * 8.0 - 4.0), 0.02 + 0.2 * noise()),
            rough: true,
        })
        .filter(|post| post.circle.centre.norm() > 0.9)
        .collect();
    let corners = [(-4.0, -4.0), (4.0, -4.0), (4.0, 4.0), (-4.0, 4.0)].map(|(x, y)| Point::new(x, y));
    let walls: Vec<Wall> =
        (0..4).map(|k| Wall { segment: Segment::new(corners[k], corners[(k + 1) % 4]), rough: false }).collect();
    let mut world = walker(&[(3.0, 3.0), (-3.0, -3.0)], Some(0.1));
    world.map = Map::new(&walls, &posts);
    let mut client = Client::new(world, &perfect(&[ORIGIN]));
    client.command(0, command::SETA, Argument::Integer(2000));
    for _ in 0..150 {
        // The run asserts after every step that the outline is clear of everything.
        client.velocity(0, (noise() * 1200.0 - 500.0) as i32, (noise() * 200.0 - 100.0) as i32);
        client.run(0.4);
    }
    assert!(client.contacts(0)[DROVE] > 5 && client.contacts(0)[REVERSED] > 0, "{:?}", client.contacts(0));
    let way = client.simulation.statistics(0).distance_m;
    assert!(way > 3.0, "it got stuck after {way} m");
}

#[test]
fn a_start_is_drawn_from_the_seed_within_its_spread() {
    let start = Start { pose: Pose::new(1.0, 1.0, 0.0), spread_m: 0.2, spread_rad: 0.3 };
    let pose = |seed| {
        let world = World { starts: vec![start], ..World::default() };
        Simulation::new(world, &Setup { seed, ..Setup::default() }).unwrap().pose(0)
    };
    assert_eq!(pose(1), pose(1));
    assert_ne!(pose(1), pose(2));
    for seed in 0..50 {
        let Pose { x_m, y_m, heading_rad } = pose(seed);
        assert!((x_m - 1.0).abs() <= 0.2 && (y_m - 1.0).abs() <= 0.2 && heading_rad.abs() <= 0.3);
    }
}

#[test]
fn what_cannot_begin_says_why() {
    let said = |world: World, setup: &Setup| Simulation::new(world, setup).unwrap_err().to_string();
    let no_start = said(World::default(), &Setup::default());
    assert!(no_start.contains("body 0 has no start") && no_start.contains("[[start]]"), "{no_start}");
    let inside = said(wall_at(0.1), &perfect(&[ORIGIN]));
    assert!(inside.contains("cannot start at (0.000, 0.000)"), "{inside}");
    let unknown = BodySetup { model: "p3dy".into(), ..BodySetup::default() };
    let unknown = said(World::default(), &Setup { bodies: vec![unknown], ..Setup::default() });
    assert!(unknown.contains("unknown model \"p3dy\"; known are p3dx-sh, p3dx"), "{unknown}");
    let mut setup = perfect(&[ORIGIN]);
    setup.realism.sonar.lost = 1.5;
    assert!(said(World::default(), &setup).contains("sonar.lost = 1.5"));
    assert!(matches!(
        Simulation::new(World::default(), &perfect(&[ORIGIN, ORIGIN])),
        Err(SetupError::Occupied { body: 1, .. })
    ));
}

#[test]
fn a_silent_controller_says_nothing_and_goes_on_afterwards() {
    let mut client = Client::new(World::default(), &perfect(&[ORIGIN]));
    client.velocity(0, 100, 0);
    client.run(1.0);
    client.simulation.silence(0, true);
    client.sips[0].clear();
    client.run(1.0);
    assert!(client.sips[0].is_empty());
    client.simulation.silence(0, false);
    client.run(1.0);
    assert!(client.sips[0].len() >= 9);
}

#[test]
fn a_bad_line_loses_packets_and_corrupts_none_unseen() {
    let mut setup = perfect(&[ORIGIN]);
    setup.realism.line = LineFaults { lose_byte: 0.002, corrupt_byte: 0.002, ..LineFaults::default() };
    let mut client = Client::new(wall_at(2.0), &setup);
    client.run(60.0);
    let framer = &client.framers[0];
    assert!(framer.checksum_errors() > 5 && framer.skipped_bytes() > 100);
    assert!((300..600).contains(&client.sips[0].len()), "{}", client.sips[0].len());
}
