//! The same for what people write and for what a stranger sends to a simulated laser. Needs the whole workspace.

use runtime::Time;
use runtime::robot::{Resources, Robot};
use simulator::geometry::Pose;
use simulator::world::World;
use simulator::{BodySetup, LaserSetup, Realism, Setup, Simulation};

/// A target by its name.
pub type Target = (&'static str, fn(&[u8]));

/// All targets; each has a folder of seeds in `corpus`.
pub const TARGETS: [Target; 4] = [
    ("robot_file", robot_file),
    ("world_file", world_file),
    ("recording", recording),
    ("laser_clients", laser_clients),
];

/// Any robot file: read, or refused with a place and a reason.
pub fn robot_file(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else { return };
    let types = sinew::built_in::node_types(&[]);
    if let Err(errors) = Robot::parse(text, "robot.toml", Resources::Embedded(&[]), &types) {
        assert!(!errors.is_empty() && errors.iter().all(|error| !error.to_string().is_empty()));
    }
}

/// Any world file, of the kind that the first byte says; whatever it names is the rest of the same bytes.
pub fn world_file(data: &[u8]) {
    let Some((&kind, rest)) = data.split_first() else { return };
    let name = ["world.toml", "world.yaml", "world.txt", "world.txt#1"][usize::from(kind % 4)];
    let mut times = 0;
    let read = World::load(name, &mut |_| {
        times += 1;
        if times > 8 { Err("too many files".into()) } else { Ok(rest.to_vec()) }
    });
    if let Err(error) = read {
        assert!(!error.to_string().is_empty());
    }
}

/// Any file that should be a recording: summed up, or refused with a reason.
pub fn recording(data: &[u8]) {
    let file = std::env::temp_dir().join(format!("sinew-fuzz-{}.mcap", std::process::id()));
    if std::fs::write(&file, data).is_ok() {
        if let Err(error) = recorder::info::info(&file) {
            assert!(!error.to_string().is_empty());
        }
        let _ = std::fs::remove_file(&file);
    }
}

/// Any client of both simulated lasers: they answer, or are silent, and go on.
pub fn laser_clients(data: &[u8]) {
    let laser = |model: &str| LaserSetup { model: model.into(), ..LaserSetup::default() };
    let lasers = vec![laser("lms200"), laser("ust-10lx"), laser("urg-04lx")];
    let body = BodySetup { start: Some(Pose::default()), lasers, ..BodySetup::default() };
    let setup = Setup { bodies: vec![body], seed: 1, realism: Realism::none() };
    let Ok(mut simulation) = Simulation::new(World::default(), &setup) else { return };
    simulation.begin(Time::from_seconds(1.0));
    for piece in data.chunks(64) {
        for scanner in 0..3 {
            let now = simulation.now();
            simulation.laser_receive(scanner, now, piece);
        }
        simulation.step();
        (0..3).for_each(|scanner| simulation.laser_send(scanner, |_| {}));
    }
}
