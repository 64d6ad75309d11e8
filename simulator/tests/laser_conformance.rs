//! The drivers' suites of what every laser must do, run against the simulated ones.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking, also in its helpers")]

use drivers::laser::conformance::Server;
use drivers::{lms200, urg};
use simulator::geometry::Pose;
use simulator::world::World;
use simulator::{BodySetup, LaserSetup, Realism, STEP_S, Setup, Simulation};

/// A simulated laser at the end of a perfect wire.
struct Wire {
    simulation: Simulation,
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

fn wire(model: &str, realism: Realism) -> Wire {
    let laser = LaserSetup { model: model.into(), ..LaserSetup::default() };
    let body = BodySetup { start: Some(Pose::default()), lasers: vec![laser], ..BodySetup::default() };
    let setup = Setup { bodies: vec![body], seed: 7, realism };
    Wire { simulation: Simulation::new(World::default(), &setup).unwrap() }
}

#[test]
fn the_simulated_lms_does_what_every_lms_must_do() {
    for realism in [Realism::none(), Realism::default()] {
        lms200::conformance::check(&mut wire("lms200", realism)).unwrap_or_else(|failure| panic!("{failure}"));
    }
}

#[test]
fn the_simulated_scip_scanners_do_what_every_scip_scanner_must_do() {
    for model in ["urg-04lx", "utm-30lx", "ust-10lx", "sinew-720"] {
        for realism in [Realism::none(), Realism::default()] {
            urg::conformance::check(&mut wire(model, realism)).unwrap_or_else(|failure| panic!("{model}: {failure}"));
        }
    }
}
