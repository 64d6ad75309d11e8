//! A room with a simulated laser in it, and what reads it: a driver's own session, or bare bytes.

use drivers::laser::conformance::Server;
use drivers::laser::{Event, Session};
use drivers::port::Port;
use messages::{Echo, ScanBeam};
use runtime::Time;
use simulator::geometry::{Circle, Point, Pose, Segment};
use simulator::world::{Post, Wall, World};
use simulator::{BodySetup, LaserSetup, Realism, STEP_S, Setup, Simulation};

/// Where the laser of a [`Rig`] is ahead of the origin, and where it looks.
pub const X_M: f64 = 0.1;
pub const HEADING_RAD: f64 = 0.2;

/// A room of 6 × 4 m with a post.
pub fn room() -> World {
    let corners = [(-2.0, -2.0), (4.0, -2.0), (4.0, 2.0), (-2.0, 2.0)].map(|(x, y)| Point::new(x, y));
    let walls: Vec<Wall> =
        (0..4).map(|k| Wall { segment: Segment::new(corners[k], corners[(k + 1) % 4]), rough: true }).collect();
    World::of(&walls, &[Post { circle: Circle::new(Point::new(1.5, 0.8), 0.1), rough: true }])
}

/// What a beam of a [`Rig`] in `world` truly meets, `bearing_rad` from where the laser looks [m].
pub fn true_m(world: &World, bearing_rad: f64) -> f64 {
    world.map.cast(Point::new(X_M, 0.0), Point::unit(HEADING_RAD + bearing_rad), 50.0).unwrap()
}

fn simulation(world: World, laser: LaserSetup, realism: Realism, seed: u64) -> Simulation {
    let body = BodySetup { start: Some(Pose::default()), lasers: vec![laser], ..BodySetup::default() };
    let mut simulation = Simulation::new(world, &Setup { bodies: vec![body], seed, realism }).unwrap();
    simulation.begin(Time::from_seconds(100.0));
    simulation
}

/// A scan as the driver reads it.
#[derive(Debug, Clone, PartialEq)]
pub struct Scan {
    /// When its first beam was taken, as the driver says.
    pub first: Time,
    /// When it came.
    pub came: Time,
    pub beams: Vec<ScanBeam>,
}

/// A laser and the session that reads it.
pub struct Rig<S> {
    pub simulation: Simulation,
    pub session: S,
    pub scans: Vec<Scan>,
}

impl<S: Session> Rig<S> {
    pub fn new(model: &str, world: World, realism: Realism, mut session: S) -> Rig<S> {
        let laser = LaserSetup { model: model.into(), x_m: X_M, heading_rad: HEADING_RAD, ..LaserSetup::default() };
        let simulation = simulation(world, laser, realism, 5);
        session.port(simulation.now(), Port::Open(1));
        Rig { simulation, session, scans: Vec::new() }
    }

    pub fn run(&mut self, seconds: f64) {
        for _ in 0..(seconds / STEP_S).round() as usize {
            self.simulation.step();
            let now = self.simulation.now();
            self.exchange(now);
            self.session.tick(now, |_| {});
            while let Some(request) = self.session.next_request(now) {
                self.simulation.laser_receive(0, now, request.as_ref());
                self.exchange(now);
            }
        }
    }

    fn exchange(&mut self, now: Time) {
        let Rig { simulation, session, scans } = self;
        simulation.laser_send(0, |bytes| {
            session.receive(now, now, bytes, |event| {
                if let Event::Scan(news) = event {
                    scans.push(Scan { first: news.first, came: now, beams: news.beams.to_vec() });
                }
            });
        });
    }

    pub fn newest(&self) -> &[ScanBeam] {
        &self.scans.last().unwrap().beams
    }

    /// Standard deviation of what one beam reads [m].
    pub fn sigma_m(&self, beam: usize) -> f64 {
        let readings = self.scans.iter().map(|scan| scan.beams[beam]).filter(|b| b.echo == Echo::Value as u16);
        let readings: Vec<f64> = readings.map(|b| f64::from(b.range_m)).collect();
        let mean = readings.iter().sum::<f64>() / readings.len() as f64;
        (readings.iter().map(|r| (r - mean) * (r - mean)).sum::<f64>() / readings.len() as f64).sqrt()
    }
}

/// A laser at the end of a perfect wire.
pub struct Wire {
    simulation: Simulation,
}

impl Wire {
    pub fn new(model: &str, realism: Realism) -> Wire {
        let laser = LaserSetup { model: model.into(), ..LaserSetup::default() };
        Wire { simulation: simulation(World::default(), laser, realism, 7) }
    }
}

impl Server for Wire {
    fn send(&mut self, bytes: &[u8]) {
        let now = self.simulation.now();
        self.simulation.laser_receive(0, now, bytes);
    }

    fn receive(&mut self, bytes: &mut Vec<u8>) {
        self.simulation.laser_send(0, |said| bytes.extend_from_slice(said));
    }

    fn advance(&mut self, seconds: f64) {
        for _ in 0..(seconds / STEP_S).round() as usize {
            self.simulation.step();
        }
    }
}
