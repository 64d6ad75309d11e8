//! How much computing a simulated second costs: one Pioneer with sixteen sonars, controller and physics, driven about
//! an office by a client that speaks the wire protocol.
//!
//! `cargo run --release -p sinew-simulator --example timing -- [world file] [seconds]`

use drivers::p2os::protocol::{Argument, Framer, MAX_PACKET, command, encode_command};
use drivers::p2os::sip::Sip;
use simulator::world::World;
use simulator::{Setup, Simulation};

const ROUNDS: usize = 7;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let office = concat!(env!("CARGO_MANIFEST_DIR"), "/../robots/pioneer/worlds/office.toml");
    let file = arguments.next().unwrap_or_else(|| office.to_owned());
    let seconds: f64 = arguments.next().map_or(Ok(300.0), |text| text.parse())?;
    let world = World::load(&file, &mut |name| std::fs::read(name).map_err(|error| error.to_string()))?;
    let mut costs_us: Vec<f64> = Vec::new();
    let mut last = None;
    for seed in 0..ROUNDS {
        let mut run = Run::new(&world, seed as u64)?;
        let before_s = cpu_s()?;
        run.drive_about(seconds);
        costs_us.push((cpu_s()? - before_s) * 1e6 / seconds);
        last = Some(run);
    }
    costs_us.sort_by(f64::total_cmp);
    let median_us = costs_us[ROUNDS / 2];
    println!("{file}: {seconds} s, {ROUNDS} seeds");
    println!(
        "CPU per simulated second: median {median_us:.0} µs, least {:.0} µs, most {:.0} µs",
        costs_us[0],
        costs_us[ROUNDS - 1]
    );
    println!("real-time factor of the simulator alone: {:.0}", 1e6 / median_us);
    if let Some(run) = last {
        println!("last run: {:?}", run.simulation.statistics(0));
    }
    Ok(())
}

/// CPU time of this process so far [s]: other programs on the machine do not count.
fn cpu_s() -> Result<f64, Box<dyn std::error::Error>> {
    let statistics = std::fs::read_to_string("/proc/self/schedstat")?;
    let nanoseconds: f64 = statistics.split_whitespace().next().unwrap_or_default().parse()?;
    Ok(nanoseconds * 1e-9)
}

struct Run {
    simulation: Simulation,
    framer: Framer,
    ranges: [u16; 16],
}

impl Run {
    fn new(world: &World, seed: u64) -> Result<Run, Box<dyn std::error::Error>> {
        let simulation = Simulation::new(world.clone(), &Setup { seed, ..Setup::default() })?;
        let mut run = Run { simulation, framer: Framer::new(), ranges: [5000; 16] };
        for number in [0, 1, 2, command::OPEN] {
            run.command(number, Argument::None);
        }
        run.command(command::ENABLE, Argument::Integer(1));
        Ok(run)
    }

    fn command(&mut self, number: u8, argument: Argument) {
        let mut out = [0; MAX_PACKET];
        let length = encode_command(&mut out, number, argument).unwrap_or(0);
        self.simulation.receive(0, &out[..length]);
    }

    /// A plain wander, good enough to see the whole office: onwards where it is free, else towards the freer side.
    fn drive_about(&mut self, seconds: f64) {
        for step in 0..(seconds * 100.0) as usize {
            self.simulation.step();
            std::hint::black_box(self.simulation.truth(0));
            let mut buffer = [0; 512];
            let count = self.simulation.send(0, &mut buffer);
            let mut bytes = &buffer[..count];
            while let Some(payload) = self.framer.next(&mut bytes) {
                if let Some(sip) = Sip::parse(payload) {
                    sip.sonar.iter().for_each(|reading| self.ranges[usize::from(reading.number)] = reading.range);
                }
            }
            if step % 10 == 0 {
                self.steer();
            }
        }
    }

    fn steer(&mut self) {
        let nearest = |discs: std::ops::Range<usize>| i32::from(*self.ranges[discs].iter().min().unwrap_or(&0));
        let (left, ahead, right) = (nearest(0..3), nearest(2..6), nearest(5..8));
        let speed = ((ahead - 350) / 2).clamp(0, 300);
        let turn = if ahead < 700 { if left > right { 40 } else { -40 } } else { ((left - right) / 50).clamp(-15, 15) };
        self.command(command::VEL, Argument::Integer(speed));
        self.command(command::RVEL, Argument::Integer(turn));
    }
}
