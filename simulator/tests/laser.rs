//! The simulated scanners as the drivers' own sessions see them.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking, also in its helpers")]

use drivers::urg::session::{Event, Port, Session, SessionConfig};
use messages::{Echo, Link, ScanBeam};
use runtime::Time;
use simulator::geometry::{Circle, Point, Pose, Segment};
use simulator::world::{Post, Wall, World};
use simulator::{BodySetup, LaserSetup, Realism, STEP_S, Setup, Simulation};

/// A scan: when its turn passed step 0, and its beams.
type Scan = (Time, Vec<ScanBeam>);

/// A room of 6 × 4 m with a post, a scanner in its middle, and a session that reads it.
struct Rig {
    simulation: Simulation,
    session: Session,
    scans: Vec<Scan>,
}

fn room() -> World {
    let corners = [(-2.0, -2.0), (4.0, -2.0), (4.0, 2.0), (-2.0, 2.0)].map(|(x, y)| Point::new(x, y));
    let walls: Vec<Wall> =
        (0..4).map(|k| Wall { segment: Segment::new(corners[k], corners[(k + 1) % 4]), rough: true }).collect();
    World::of(&walls, &[Post { circle: Circle::new(Point::new(1.5, 0.8), 0.1), rough: true }])
}

impl Rig {
    fn new(model: &str, world: World, realism: Realism, config: SessionConfig) -> Rig {
        let laser = LaserSetup { model: model.into(), x_m: 0.1, heading_rad: 0.2, ..LaserSetup::default() };
        let body = BodySetup { start: Some(Pose::default()), lasers: vec![laser], ..BodySetup::default() };
        let setup = Setup { bodies: vec![body], seed: 5, realism };
        let mut simulation = Simulation::new(world, &setup).unwrap();
        simulation.begin(Time::from_seconds(100.0));
        let mut session = Session::new(config);
        session.port(simulation.now(), Port::Open(1));
        Rig { simulation, session, scans: Vec::new() }
    }

    fn run(&mut self, seconds: f64) {
        for _ in 0..(seconds / STEP_S).round() as usize {
            self.simulation.step();
            let now = self.simulation.now();
            self.exchange(now);
            self.session.tick(now);
            while let Some(request) = self.session.next_request(now) {
                self.simulation.laser_receive(0, now, request.as_bytes());
                self.exchange(now);
            }
        }
    }

    fn exchange(&mut self, now: Time) {
        let Rig { simulation, session, scans } = self;
        simulation.laser_send(0, |bytes| {
            session.receive(now, now, bytes, |event| {
                if let Event::Scan(begun, _, beams) = event {
                    scans.push((begun, beams.to_vec()));
                }
            });
        });
    }
}

#[test]
fn every_model_is_read_beam_by_beam_as_the_map_lies() {
    for (model, beams, scans_per_s, worst_m) in
        [("sinew-720", 720, 50, 0.0006), ("utm-30lx", 1081, 40, 0.0006), ("urg-04lx", 682, 10, 0.0006)]
    {
        let mut rig = Rig::new(model, room(), Realism::none(), SessionConfig::default());
        rig.run(2.0);
        assert_eq!(rig.session.link(), Link::Up, "{model}");
        assert!(rig.scans.len() >= scans_per_s, "{model}: {} scans", rig.scans.len());
        let sensor = *rig.session.sensor().unwrap();
        let sweep = sensor.sweep(&sensor.whole(1));
        let world = room();
        let scan = &rig.scans.last().unwrap().1;
        assert_eq!(scan.len(), beams);
        for (beam, read) in scan.iter().enumerate() {
            let bearing = 0.2 + sweep.angle_min_rad + beam as f64 * sweep.angle_increment_rad;
            let true_m = world.map.cast(Point::new(0.1, 0.0), Point::unit(bearing), 50.0).unwrap();
            if true_m > sweep.range_max_m {
                assert_eq!(read.echo, Echo::Clear as u16);
            } else {
                assert_eq!(read.echo, Echo::Value as u16, "{model} beam {beam} {true_m}");
                assert!((f64::from(read.range_m) - true_m).abs() < worst_m, "{model} {beam}: {read:?} {true_m}");
            }
        }
        assert_eq!(rig.session.counts().2, 0, "no damaged message");
    }
}

#[test]
fn scans_come_evenly_and_are_stamped_when_their_turn_began() {
    let mut rig = Rig::new("utm-30lx", room(), Realism::none(), SessionConfig::default());
    rig.run(3.0);
    let gaps = rig.scans.windows(2).map(|pair| pair[1].0.since(pair[0].0));
    for gap in gaps {
        assert!((gap - 0.025).abs() < 0.0011, "{gap} s between two stamps of whole milliseconds");
    }
}

#[test]
fn the_same_seed_gives_the_same_scans_and_noise_is_as_large_as_the_model_says() {
    let noisy = |seed_shift: bool| {
        let mut rig = Rig::new("utm-30lx", room(), Realism::default(), SessionConfig::default());
        rig.run(if seed_shift { 1.0 } else { 2.0 });
        rig.scans
    };
    let (long, short) = (noisy(false), noisy(true));
    assert!(short.iter().zip(&long).all(|(a, b)| a == b));
    // Beam 0 looks at a wall: its readings spread by σ = 1 cm.
    let readings: Vec<f64> =
        long.iter().map(|scan| scan.1[0]).filter(|beam| beam.echo == 1).map(|beam| f64::from(beam.range_m)).collect();
    let mean = readings.iter().sum::<f64>() / readings.len() as f64;
    let sigma = (readings.iter().map(|r| (r - mean) * (r - mean)).sum::<f64>() / readings.len() as f64).sqrt();
    assert!((0.006..0.014).contains(&sigma), "{sigma} m");
    let dropped = long.iter().flat_map(|scan| &scan.1).filter(|beam| beam.echo == Echo::Clear as u16).count();
    assert!(dropped > 0, "some echoes are lost");
}

#[test]
fn a_part_of_the_field_clusters_and_intensities_can_be_asked_for() {
    let config =
        SessionConfig { between_rad: (-0.5, 0.5), cluster: 3, skip: 1, intensities: true, ..SessionConfig::default() };
    let mut rig = Rig::new("utm-30lx", room(), Realism::none(), config);
    rig.run(2.0);
    let scan = &rig.scans.last().unwrap().1;
    assert_eq!(scan.len(), 77);
    assert!(scan.iter().all(|beam| beam.intensity > 100));
    assert!((rig.scans[1].0.since(rig.scans[0].0) - 0.05).abs() < 0.0011);
}

#[test]
fn another_model_than_wanted_is_foreign_and_says_so() {
    let config = SessionConfig { model: "ust-10lx".into(), ..SessionConfig::default() };
    let mut rig = Rig::new("utm-30lx", room(), Realism::none(), config);
    rig.run(2.0);
    assert_eq!(rig.session.link(), Link::Foreign);
    assert!(rig.scans.is_empty());
}

#[test]
fn lost_and_corrupt_bytes_cost_scans_but_never_give_wrong_ones() {
    let mut realism = Realism::none();
    realism.line.lose_byte = 2e-5;
    realism.line.corrupt_byte = 2e-5;
    let mut rig = Rig::new("sinew-720", room(), realism, SessionConfig::default());
    rig.run(20.0);
    let right = &Rig::right();
    assert!(rig.scans.len() > 300, "{}", rig.scans.len());
    assert!(rig.session.counts().2 > 10, "{:?}", rig.session.counts());
    // A sum of six bits misses one damage in 64: so few scans may differ, in few beams.
    let wrong = rig.scans.iter().filter(|scan| scan.1 != *right).count();
    assert!(wrong < rig.scans.len() / 50, "{wrong} of {}", rig.scans.len());
}

impl Rig {
    fn right() -> Vec<ScanBeam> {
        let mut rig = Rig::new("sinew-720", room(), Realism::none(), SessionConfig::default());
        rig.run(1.0);
        rig.scans.pop().unwrap().1
    }
}
