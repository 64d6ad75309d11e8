//! The drivers' suite of what every Pioneer must do, run against the simulated ones.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking, also in its helpers")]

use drivers::p2os::conformance::{Server, check};
use simulator::geometry::Pose;
use simulator::world::World;
use simulator::{BodySetup, Realism, STEP_S, Setup, Simulation};

/// A simulated robot in an empty world at the end of a perfect wire.
struct Wire {
    simulation: Simulation,
}

impl Server for Wire {
    fn send(&mut self, bytes: &[u8]) {
        self.simulation.receive(0, bytes);
    }

    fn receive(&mut self, bytes: &mut Vec<u8>) {
        let mut buffer = [0; 4096];
        let count = self.simulation.send(0, &mut buffer);
        bytes.extend_from_slice(&buffer[..count]);
    }

    fn advance(&mut self, seconds: f64) {
        for _ in 0..(seconds / STEP_S).round() as usize {
            self.simulation.step();
        }
    }
}

fn conforms(model: &str, realism: Realism) {
    let body = BodySetup { model: model.into(), start: Some(Pose::default()), ..BodySetup::default() };
    let setup = Setup { bodies: vec![body], seed: 7, realism };
    let simulation = Simulation::new(World::default(), &setup).unwrap();
    check(&mut Wire { simulation }).unwrap_or_else(|failure| panic!("{model}: {failure}"));
}

#[test]
fn both_models_do_what_every_pioneer_must_do() {
    conforms("p3dx-sh", Realism::none());
    conforms("p3dx", Realism::none());
}

#[test]
fn imperfect_wheels_and_ears_change_nothing_about_that() {
    conforms("p3dx-sh", Realism::default());
}
