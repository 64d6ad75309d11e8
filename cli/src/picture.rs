//! A run as an SVG picture: what was collected of it, handed to the simulator's drawing.

use crate::exit::Failure;
use crate::experiments::chart::{Chart, Series};
use crate::simulation::{Moment, Run, TrackPoint};
use messages::{Beam, Contact, ContactCause, Echo, Truth};
use runtime::robot::Robot;
use runtime::{Body, Layer};
use simulator::geometry::{Circle, Footprint, Point, Pose};
use simulator::svg::{self, RobotPicture, SonarBeam, SonarForce};
use simulator::world::World;
use simulator::{BodySetup, people_along};

/// The picture of a simulated run: the robot stands where it felt the greatest force.
pub fn of_run(robot: &Robot, run: &Run) -> Result<String, Failure> {
    let result = &run.result;
    let mut facts = facts(&run.track);
    facts.push(("least clearance", format!("{:.3} m", result.least_clearance_m)));
    facts.push(("mean speed while moving", format!("{:.3} m/s", result.mean_speed_m_s)));
    if let Some(moment) = &run.moment {
        facts.push(("robot and forces at", format!("{:.1} s", moment.time_s)));
    }
    let title = format!("{}, seed {}", robot.name, result.seed);
    draw(robot, &title, &run.track, run.moment.as_ref(), &facts, Some(result.seed))
}

/// A simulated run's speeds and clearance against time.
pub fn of_speeds(robot: &Robot, run: &Run) -> String {
    // As many points as there are places in the picture.
    let every = run.track.len().div_ceil(700).max(1);
    let line = |name: &str, colour: usize, value: fn(&Truth) -> f64| {
        let points = run.track.iter().step_by(every).map(|point| (point.time_s, value(&point.truth))).collect();
        Series::line(name, colour, points)
    };
    let series = [
        line("clearance [m], up to 2 m", 8, |truth| truth.clearance_m.min(2.0)),
        line("turn rate [rad/s]", 4, |truth| truth.velocity.angular_z_rad_s),
        line("speed [m/s]", 0, |truth| truth.velocity.linear_x_m_s),
    ];
    let title = format!("{}, seed {}", robot.name, run.result.seed);
    let (x, y) = ("time since the start [s]", "by truth");
    Chart { title: &title, x, y, series: &series, bounds: &[], is_map: false }.svg()
}

/// The picture of a run through one of BARN's worlds.
pub fn of_crossing(robot: &Robot, title: &str, track: &[TrackPoint]) -> Result<String, Failure> {
    draw(robot, title, track, None, &facts(track), None)
}

/// The picture of a live run.
pub fn of_track(robot: &Robot, track: &[TrackPoint]) -> Result<String, Failure> {
    draw(robot, &robot.name, track, None, &facts(track), None)
}

/// The world that the robot's simulated twin stands in, if it has one.
pub fn world_of(robot: &Robot) -> Option<World> {
    let node = robot.nodes.iter().find(|node| node.kind.layer == Layer::Simulator)?;
    let name = node.config.get("world")?.as_str()?;
    World::load(name, &mut |file| robot.resources.read(file)).ok()
}

/// What the world's file says and nothing here obeys.
pub fn notes_of(robot: &Robot) -> Vec<String> {
    world_of(robot).map(|world| world.notes).unwrap_or_default()
}

fn facts(track: &[TrackPoint]) -> Vec<(&'static str, String)> {
    let (Some(first), Some(last)) = (track.first(), track.last()) else { return Vec::new() };
    let [drove, reversed, suffered] = last.truth.contacts;
    vec![
        ("time", format!("{:.0} s", last.time_s - first.time_s)),
        ("distance", format!("{:.1} m", last.truth.distance_m)),
        ("contacts caused", format!("{}", drove + reversed)),
        ("contacts suffered", format!("{suffered}")),
    ]
}

fn draw(
    robot: &Robot,
    title: &str,
    track: &[TrackPoint],
    moment: Option<&Moment>,
    facts: &[(&str, String)],
    seed: Option<u64>,
) -> Result<String, Failure> {
    let world = world_of(robot).unwrap_or_default();
    let points: Vec<svg::TrackPoint> = track
        .iter()
        .map(|point| svg::TrackPoint {
            x_m: point.truth.x_m,
            y_m: point.truth.y_m,
            speed_m_s: point.truth.velocity.linear_x_m_s.abs(),
        })
        .collect();
    let (ways, persons) = people(&world, seed, track);
    let footprint = outline(&robot.body)?;
    let beams: Vec<SonarBeam> = moment.iter().flat_map(|moment| moment.beams.iter().map(beam)).collect();
    let forces: Vec<SonarForce> = moment.map(forces).unwrap_or_default();
    let shown = moment.map(|moment| moment.truth).or_else(|| track.last().map(|point| point.truth));
    let picture = svg::Picture {
        world: &world,
        persons: &persons,
        ways: &ways,
        track: &points,
        contacts: &contacts(track),
        robot: shown.map(|truth| RobotPicture {
            pose: Pose::new(truth.x_m, truth.y_m, truth.heading_rad),
            footprint: &footprint,
            beams: &beams,
            forces: &forces,
        }),
        title,
        facts,
    };
    Ok(svg::render(&picture))
}

/// Where the people went and are at the end; where that cannot be told, where they begin.
fn people(world: &World, seed: Option<u64>, track: &[TrackPoint]) -> (Vec<Vec<Point>>, Vec<Circle>) {
    let poses: Vec<(f64, Pose)> = track
        .iter()
        .map(|point| (point.time_s, Pose::new(point.truth.x_m, point.truth.y_m, point.truth.heading_rad)))
        .collect();
    let ways = match seed {
        Some(seed) if !world.persons.is_empty() => {
            people_along(world.clone(), seed, BodySetup::default(), &poses).unwrap_or_default()
        }
        _ => Vec::new(),
    };
    if ways.is_empty() {
        return (Vec::new(), world.persons.iter().map(|person| person.start(0.0).disc).collect());
    }
    let ends = ways.iter().map(|way| way.end).collect();
    (ways.into_iter().map(|way| way.points).collect(), ends)
}

fn outline(body: &Body) -> Result<Footprint, Failure> {
    let cut_m = 0.25 * body.half_width_m;
    Footprint::cut_rectangle(body.length_ahead_m, body.length_behind_m, body.half_width_m, cut_m)
        .ok_or_else(|| Failure::from("the body's footprint has no area"))
}

fn beam(beam: &Beam) -> SonarBeam {
    SonarBeam {
        origin_x_m: f64::from(beam.origin_x_m),
        origin_y_m: f64::from(beam.origin_y_m),
        bearing_rad: f64::from(beam.bearing_rad),
        range_m: (beam.echo == Echo::Value as u32).then_some(f64::from(beam.range_m)),
    }
}

/// The force in each sector, shown at the sonar that looks into it; sectors count from the right.
fn forces(moment: &Moment) -> Vec<SonarForce> {
    let mut ahead: Vec<&Beam> =
        moment.beams.iter().filter(|beam| beam.origin_x_m > 0.0 && beam.bearing_rad.abs() < 1.6).collect();
    ahead.sort_by(|a, b| a.bearing_rad.total_cmp(&b.bearing_rad));
    let force = moment.sectors.force.iter();
    ahead
        .iter()
        .zip(force)
        .map(|(beam, force)| SonarForce { bearing_rad: f64::from(beam.bearing_rad), force: *force })
        .collect()
}

/// Where the counters of contacts rose.
fn contacts(track: &[TrackPoint]) -> Vec<Contact> {
    let mut found = Vec::new();
    for pair in track.windows(2) {
        for cause in [ContactCause::Drove, ContactCause::ReversedBlind, ContactCause::Suffered] {
            let (before, after) = (&pair[0].truth, &pair[1].truth);
            if after.contacts[cause as usize] > before.contacts[cause as usize] {
                found.push(Contact { x_m: after.x_m, y_m: after.y_m, speed_m_s: 0.0, cause: cause as u64 });
            }
        }
    }
    found
}
