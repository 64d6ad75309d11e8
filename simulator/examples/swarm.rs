//! How fast swarms are simulated: `cargo run --release -p sinew-simulator --example swarm -- [threads]`.
//!
//! The figures of record come from `sinew bench simulator`; this is the short way while working on the engine.

use simulator::swarm::{Kind, Swarm};
use simulator::world::World;
use std::time::Instant;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let threads: usize = std::env::args().nth(1).map_or(Ok(1), |text| text.parse())?;
    for (world, kind, count) in [
        ("office:1:140x60", Kind::simple(12, 2.0), 1000),
        ("cave:1", Kind::pioneer_with_sonars(), 100),
        ("cave:1", Kind::pioneer_with_laser(180, 8.0), 100),
        ("office:1:140x60", Kind::simple(12, 2.0), 10_000),
    ] {
        let map = World::load(world, &mut |file| Err(format!("{file} is not read")))?;
        let begin = Instant::now();
        let mut swarm = Swarm::new(map, kind.clone(), count, 0.1, 1)?;
        let placed_s = begin.elapsed().as_secs_f64();
        swarm.use_threads(threads)?;
        (0..10).for_each(|_| swarm.step());
        let (begin, from_s) = (Instant::now(), swarm.time_s());
        while begin.elapsed().as_secs_f64() < 1.0 {
            swarm.step();
        }
        let factor = (swarm.time_s() - from_s) / begin.elapsed().as_secs_f64();
        println!(
            "{count} {} in {world}: {factor:.1} × real time on {threads} threads, placed in {placed_s:.2} s",
            kind.name
        );
    }
    Ok(())
}
