//! A Pioneer with two lasers and its sonars: the ranger that lies is named and left out, whichever it is; among honest
//! ones nobody is.

use messages::{Beam, RangerVerdict, Ranges, Truth, bytemuck, path_number};
use runtime::channel::{RawReader, SampleBuffer};
use runtime::robot::{Override, Resources, Robot};
use runtime::{SimulatedHost, Time};
use sinew::built_in::{PIONEER, node_types};
use sinew::{messages, runtime};

const FIRST: &str = "/drivers/laser/ranges";
const SECOND: &str = "/drivers/second/ranges";

/// What was said at the end of each tenth of a second: who is passed on, and who is left out in words.
struct Drive {
    said: Vec<(f64, u32, String)>,
    truth: Truth,
    /// Whether what is passed on was always whole what the ranger named had said.
    faithful: bool,
}

fn sample<H: Copy + bytemuck::AnyBitPattern>(ring: &RawReader) -> Option<(u64, H, Vec<u8>)> {
    let mut buffer = SampleBuffer::new(ring.geometry());
    let read = ring.read(ring.head(), &mut buffer).ok()?;
    Some((read.stamp_ns, *bytemuck::from_bytes(buffer.fixed()), buffer.tail().to_vec()))
}

fn drive(seconds: f64, seed: u64, changes: &[(&str, &str)]) -> Drive {
    let types = node_types(&[]);
    let text = PIONEER.iter().find(|(name, _)| *name == "three_rangers.toml").unwrap().1;
    let text = std::str::from_utf8(text).unwrap();
    let robot = Robot::parse(text, "robots/pioneer", Resources::Embedded(PIONEER), &types).unwrap();
    let over = |&(key, value): &(&str, &str)| Override { key: key.into(), value: value.into() };
    let robot = robot.with_overrides(&changes.iter().map(over).collect::<Vec<_>>(), &types).unwrap();
    let mut host = SimulatedHost::new(&robot, seed, Time::ZERO).unwrap();
    let ring = |host: &SimulatedHost, path: &str| host.tree().reader(path, None).unwrap();
    let (verdict, out) = (ring(&host, "/perception/rangers/verdict"), ring(&host, "/perception/rangers/ranges"));
    let truth = ring(&host, "/simulator/world/truth");
    let sources = [FIRST, SECOND, "/drivers/base/sonar"].map(|path| (path_number(path), ring(&host, path)));
    let mut drive = Drive { said: Vec::new(), truth: Truth::default(), faithful: true };
    for tenth in 1..=(seconds * 10.0) as u64 {
        host.run_until(Time::from_seconds(0.1 * tenth as f64));
        let Some((_, said, words)) = sample::<RangerVerdict>(&verdict) else { continue };
        drive.said.push((0.1 * tenth as f64, said.used, String::from_utf8(words).unwrap()));
        if let (Some((stamp, _, beams)), Some((_, source))) =
            (sample::<Ranges>(&out), sources.iter().find(|(number, _)| *number == said.used))
        {
            let mut buffer = SampleBuffer::new(source.geometry());
            let oldest = source.head().saturating_sub(4);
            let told =
                (oldest + 1..=source.head()).find(|&number| source.stamp(number).is_ok_and(|s| s.stamp_ns == stamp));
            if let Some(number) = told
                && source.read(number, &mut buffer).is_ok()
            {
                drive.faithful &= buffer.tail()[..beams.len()] == beams[..] && beams.len() % size_of::<Beam>() == 0;
            }
        }
    }
    drive.truth = sample::<Truth>(&truth).unwrap().1;
    host.stop();
    drive
}

#[test]
fn a_laser_that_was_knocked_askew_is_named_and_left_out_and_the_robot_drives_on_by_the_other() {
    for (askew, used) in [("laser", SECOND), ("second", FIRST)] {
        let key = format!("nodes.{askew}.config.mount.heading_deg");
        let drive = drive(40.0, 3, &[(&key, "40")]);
        let named = drive.said.iter().find(|(_, _, words)| !words.is_empty()).unwrap();
        assert!(named.2.starts_with(&format!("/drivers/{askew}/ranges is left out: ")), "{}", named.2);
        assert!(named.0 < 10.0, "only after {} s", named.0);
        let after = drive.said.iter().filter(|(at, ..)| *at > named.0);
        let wrong = after.filter(|(_, by, words)| *by != path_number(used) || words.is_empty()).count();
        assert_eq!(wrong, 0, "tenths of seconds in which {askew} counted again");
        assert!(drive.faithful && drive.truth.distance_m > 4.0, "{} m", drive.truth.distance_m);
        assert_eq!(drive.truth.contacts[..2], [0, 0], "it touches nothing");
    }
}

#[test]
fn honest_rangers_agree_wherever_the_robot_wanders() {
    for seed in 1..4 {
        let drive = drive(60.0, seed, &[]);
        let accused: Vec<&(f64, u32, String)> = drive.said.iter().filter(|(_, _, words)| !words.is_empty()).collect();
        assert!(accused.is_empty(), "seed {seed}: {accused:?}");
        assert!(drive.said.iter().filter(|(at, ..)| *at > 5.0).all(|(_, used, _)| *used == path_number(FIRST)));
        assert_eq!(drive.truth.contacts[..2], [0, 0]);
    }
}
