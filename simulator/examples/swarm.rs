//! CPU time of a swarm's step, for the rows of `sinew bench simulator` that are swarms.
//!
//! `cargo run --release -p sinew-simulator --example swarm -- [seconds of CPU time per row] [row]`

use simulator::swarm::{Kind, Swarm};
use simulator::world::World;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let seconds: f64 = arguments.next().map_or(Ok(1.0), |text| text.parse())?;
    let only = arguments.next();
    let hospital = "office:1:140x60";
    let rows = [
        ("cave_laser", "cave:1", Kind::pioneer_with_laser(180, 8.0), 100),
        ("cave_sonars", "cave:1", Kind::pioneer_with_sonars(), 100),
        ("hospital", hospital, Kind::simple(12, 2.0), 1000),
        ("simple_10000", hospital, Kind::simple(12, 2.0), 10_000),
        ("office_laser", "office:1:50x50", Kind::pioneer_with_laser(180, 10.0), 50),
    ];
    for (row, world, kind, robots) in rows {
        if only.as_deref().is_some_and(|only| only != row) {
            continue;
        }
        let rays = kind.ray_count() * robots;
        let world = World::load(world, &mut |_| Err("it is made".into()))?;
        let mut swarm = Swarm::new(world, kind, robots, 0.1, 1)?;
        (0..10).for_each(|_| swarm.step());
        let (begin, mut steps) = (cpu_s()?, 0);
        let spent_s = loop {
            swarm.step();
            steps += 1;
            let spent_s = cpu_s()? - begin;
            if spent_s > seconds {
                break spent_s;
            }
        };
        let step_s = spent_s / f64::from(steps);
        println!(
            "{row}: {:.0} µs a step, {:.1} × real time, {:.0} ns a ray, {steps} steps",
            step_s * 1e6,
            0.1 / step_s,
            step_s * 1e9 / rays as f64
        );
    }
    Ok(())
}

fn cpu_s() -> Result<f64, Box<dyn std::error::Error>> {
    let statistics = std::fs::read_to_string("/proc/self/schedstat")?;
    let nanoseconds: f64 = statistics.split_whitespace().next().unwrap_or_default().parse()?;
    Ok(nanoseconds * 1e-9)
}
