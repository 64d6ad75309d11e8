//! The client's side of a recorded conversation, replayed against the simulated microcontroller at the recorded times.
//!
//! The recorded robot was a third party's simulator. Where ours must differ from it (2 or 3 new readings per array and
//! SIP, type 0x33 in motion, motors off after OPEN), the manual decides.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking, also in its helpers")]

mod support;

use drivers::p2os::config::ConfigPacket;
use drivers::p2os::protocol::{Framer, Request, command, packet};
use drivers::p2os::sip::{Identity, Sip, Unwrap15};
use runtime::{Time, math};
use simulator::geometry::Pose;
use simulator::mcu::Session;
use simulator::world::World;
use simulator::{BodySetup, Realism, STEP_S, Setup, Simulation};
use support::recording::{lines, robots_payloads};

/// Where a robot believed to be at a time.
#[derive(Debug, Clone, Copy)]
struct Believed {
    at_s: f64,
    x_mm: f64,
    y_mm: f64,
    heading_deg: f64,
}

/// Sums up the positions and headings of SIPs, both unwrapped.
fn track(payloads: &[(f64, Vec<u8>)]) -> Vec<Believed> {
    let (mut x, mut y) = (Unwrap15::default(), Unwrap15::default());
    let mut here = Believed { at_s: 0.0, x_mm: 0.0, y_mm: 0.0, heading_deg: 0.0 };
    let sips = payloads.iter().filter_map(|(at_s, payload)| Some((*at_s, Sip::parse(payload)?)));
    sips.map(|(at_s, sip)| {
        let heading_deg = f64::from(sip.heading.unwrap()) * 360.0 / 4096.0;
        let turned = (heading_deg - here.heading_deg + 180.0).rem_euclid(360.0) - 180.0;
        here = Believed {
            at_s,
            x_mm: here.x_mm + f64::from(x.step(sip.x.unwrap())),
            y_mm: here.y_mm + f64::from(y.step(sip.y.unwrap())),
            heading_deg: here.heading_deg + turned,
        };
        here
    })
    .collect()
}

/// Our robot's payloads when it hears what the recorded client said.
fn replay() -> (Simulation, Vec<(f64, Vec<u8>)>) {
    let body = BodySetup { start: Some(Pose::default()), ..BodySetup::default() };
    let setup = Setup { bodies: vec![body], seed: 0, realism: Realism::none() };
    let mut simulation = Simulation::new(World::default(), &setup).unwrap();
    let mut framer = Framer::new();
    let mut payloads = Vec::new();
    let mut collect = |simulation: &mut Simulation| {
        let mut buffer = [0; 1024];
        let count = simulation.send(0, &mut buffer);
        let mut bytes = &buffer[..count];
        while let Some(payload) = framer.next(&mut bytes) {
            payloads.push((simulation.now().seconds(), payload.to_vec()));
        }
    };
    for line in lines().iter().filter(|line| line.from_client) {
        while simulation.now().seconds() + STEP_S <= line.at_s {
            simulation.step();
            collect(&mut simulation);
        }
        simulation.receive(0, &line.bytes);
        collect(&mut simulation);
    }
    simulation.advance(Time::from_seconds(20.2));
    collect(&mut simulation);
    assert_eq!((framer.checksum_errors(), framer.skipped_bytes()), (0, 0));
    (simulation, payloads)
}

#[test]
fn the_handshake_has_the_recorded_meaning() {
    let (ours, theirs) = (replay().1, robots_payloads());
    for step in 0..2 {
        assert_eq!(ours[step].1, theirs[step].1);
        assert!((ours[step].0 - theirs[step].0).abs() < 0.1);
    }
    let (our, their) = (Identity::parse(&ours[2].1).unwrap(), Identity::parse(&theirs[2].1).unwrap());
    assert_eq!((our.class, our.subclass), (their.class, their.subclass));
    assert_eq!(our.name.as_str(), "simbot");
    assert!(Sip::parse(&ours[3].1).is_some(), "nothing but a SIP follows OPEN");
}

#[test]
fn the_configuration_answers_with_what_the_client_goes_by() {
    let (ours, theirs) = (replay().1, robots_payloads());
    let config =
        |payloads: &[(f64, Vec<u8>)]| payloads.iter().find_map(|(_, payload)| ConfigPacket::parse(payload)).unwrap();
    let (our, their) = (config(&ours), config(&theirs));
    assert_eq!((our.class, our.subclass), (their.class, their.subclass));
    assert_eq!((our.sip_cycle_ms, our.watchdog_ms), (their.sip_cycle_ms, their.watchdog_ms));
    assert_eq!((our.has_front_sonar, our.has_rear_sonar), (their.has_front_sonar, their.has_rear_sonar));
    for cap in [our.translation_speed_top, our.rotation_speed_top, our.translation_acceleration_top] {
        assert!(cap > 0, "a zero makes a robot that does not move");
    }
    assert_ne!(our.serial_number.as_str(), "SIM", "that name would make the client wait for an in-band laser");
    let asked = ours.iter().filter(|(_, payload)| payload[0] == packet::CONFIG).count();
    assert_eq!(asked, 1);
}

#[test]
fn sips_are_as_plausible_as_the_recorded_ones() {
    let ours = replay().1;
    let sips: Vec<(f64, Sip)> = ours.iter().filter_map(|(at_s, payload)| Some((*at_s, Sip::parse(payload)?))).collect();
    assert!((190..=200).contains(&sips.len()), "{}", sips.len());
    for pair in sips.windows(2) {
        assert!((pair[1].0 - pair[0].0 - 0.1).abs() < 0.011, "at {} s", pair[1].0);
    }
    let enables: Vec<f64> =
        commands().iter().filter(|(_, number, _)| *number == command::ENABLE).map(|(at_s, ..)| *at_s).collect();
    let [enabled_s, disabled_s] = enables[..] else { panic!("{enables:?}") };
    for (at_s, sip) in &sips {
        assert!((110..=130).contains(&sip.battery_dv.unwrap()));
        assert!((4..=6).contains(&sip.sonar.len()), "at {at_s} s");
        assert!(sip.sonar.iter().all(|reading| reading.range == 5000), "the world is empty");
        let moves = sip.left_speed.unwrap().abs().max(sip.right_speed.unwrap().abs()) > 5;
        assert!(!moves || sip.kind == packet::SIP_MOVING, "at {at_s} s");
        assert_eq!(sip.flags.unwrap() & 1 == 1, (enabled_s..disabled_s).contains(at_s), "at {at_s} s");
    }
    assert!(sips.iter().any(|(_, sip)| sip.kind == packet::SIP_MOVING));
}

/// The recorded client's commands with one integer argument: time, number, value.
fn commands() -> Vec<(f64, u8, i32)> {
    let mut framer = Framer::new();
    let mut commands = Vec::new();
    for line in lines().iter().filter(|line| line.from_client) {
        let mut bytes = &line.bytes[..];
        while let Some(payload) = framer.next(&mut bytes) {
            let request = Request::parse(payload).unwrap();
            commands.push((line.at_s, request.number, request.integer()));
        }
    }
    commands
}

#[test]
fn the_robot_turns_to_every_heading_that_the_recorded_client_asks_for() {
    let ours = replay().1;
    let heads: Vec<(f64, i32)> = commands()
        .iter()
        .filter(|(_, number, _)| *number == command::HEAD)
        .map(|(at_s, _, value)| (*at_s, *value))
        .collect();
    let asked = |at_s: f64| heads.iter().rev().find(|(sent_s, _)| *sent_s < at_s).map(|(_, value)| f64::from(*value));
    let (mut compared, mut arrived) = (0, 0);
    for (at_s, sip) in ours.iter().filter_map(|(at_s, payload)| Some((*at_s, Sip::parse(payload)?))) {
        // A command takes effect in the step after it has come.
        if let (Some(before), Some(now)) = (asked(at_s - 0.02), asked(at_s)) {
            if before == now && at_s < 19.8 {
                let control_deg = f64::from(sip.control.unwrap()) * 360.0 / 4096.0;
                assert!((control_deg - now).abs() < 0.1, "set-point at {at_s} s: {control_deg}, asked {now}");
                compared += 1;
            }
            // From 2.5 s on the client's wishes move on slowly enough for the ramps to follow.
            if (2.5..14.0).contains(&at_s) && !(7.7..8.1).contains(&at_s) {
                let heading_deg = f64::from(sip.heading.unwrap()) * 360.0 / 4096.0;
                assert!((heading_deg - now).abs() < 3.0, "heading at {at_s} s: {heading_deg}, asked {now}");
                arrived += 1;
            }
        }
    }
    assert!(compared > 100 && arrived > 100, "{compared} {arrived}");
}

#[test]
fn the_decoded_odometry_agrees_with_the_recorded_one() {
    let (ours, theirs) = (track(&replay().1), track(&robots_payloads()));
    let way = |track: &[Believed], from_s: f64, to_s: f64| -> f64 {
        track
            .windows(2)
            .filter(|pair| pair[0].at_s >= from_s && pair[1].at_s <= to_s)
            .map(|pair| math::hypot(pair[1].x_mm - pair[0].x_mm, pair[1].y_mm - pair[0].y_mm))
            .sum()
    };
    // The client drives, turns on the spot, drives, turns, and drives 1.5 m on at 400 mm/s. The recorded simulator
    // began each motion up to 0.2 s later and ran 4 % slower than its own clock.
    for (from_s, to_s) in [(1.0, 5.0), (7.0, 11.0), (14.0, 18.6), (0.0, 20.2)] {
        let (our, their) = (way(&ours, from_s, to_s), way(&theirs, from_s, to_s));
        assert!((our - their).abs() < 0.05 * their + 0.2 * 400.0, "{from_s} to {to_s} s: {our} mm and {their} mm");
    }
    assert!(way(&ours, 3.5, 7.6) < 1.0 && way(&ours, 10.6, 14.0) < 1.0, "it turns on the spot");
    let cruise = way(&ours, 15.7, 18.6) / (18.6 - 15.7);
    assert!((cruise - 400.0).abs() < 16.0, "{cruise} mm/s");
    // The client always asks for 15° more than the recorded robot had turned, which turned slowly; ours keeps up with
    // what is asked, so that it is up to 15° ahead (either way), and the difference never grows.
    for their in &theirs {
        let our =
            ours.iter().min_by(|a, b| (a.at_s - their.at_s).abs().total_cmp(&(b.at_s - their.at_s).abs())).unwrap();
        let ahead_deg = our.heading_deg - their.heading_deg;
        assert!((-15.5..15.5).contains(&ahead_deg), "at {} s: {ahead_deg}", their.at_s);
    }
}

#[test]
fn the_recorded_clients_close_ends_the_session() {
    let (mut simulation, _) = replay();
    let controller = simulation.controller(0).unwrap();
    assert_eq!(controller.session(), Session::Waiting(0));
    assert!(controller.take_hung_up() && !controller.motors_enabled());
}
