//! The parser against a conversation in which nobody of this project wrote either side.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking, also in its helpers")]

mod support;

use drivers::p2os::config::ConfigPacket;
use drivers::p2os::model;
use drivers::p2os::protocol::*;
use drivers::p2os::sip::{Identity, Sip, Unwrap15};
use runtime::math;
use support::recording::{From, packets};

fn sips() -> Vec<(f64, Sip)> {
    packets(From::Robot).0.iter().filter_map(|(at, payload)| Some((*at, Sip::parse(payload)?))).collect()
}

#[test]
fn every_byte_of_both_sides_belongs_to_a_packet() {
    for (side, count) in [(From::Robot, 1311), (From::Client, 233)] {
        let (packets, framer) = packets(side);
        assert_eq!((framer.checksum_errors(), framer.skipped_bytes()), (0, 0), "{side:?}");
        assert!(!framer.is_inside_packet(), "{side:?} ends with a whole packet");
        assert_eq!(packets.len(), count, "{side:?}");
    }
}

#[test]
fn the_robot_echoes_the_handshake_and_says_who_it_is() {
    let (packets, _) = packets(From::Robot);
    assert_eq!(packets[0].1, [command::SYNC0]);
    assert_eq!(packets[1].1, [command::SYNC1]);
    let identity = Identity::parse(&packets[2].1).unwrap();
    assert_eq!(
        (identity.name.as_str(), identity.class.as_str(), identity.subclass.as_str()),
        ("AMRISim", "Pioneer", "p3dx-sh")
    );
    assert!(model::find(identity.class.as_str(), identity.subclass.as_str()).is_some());
    assert!(Sip::parse(&packets[3].1).is_some(), "a SIP follows OPEN");
}

#[test]
fn the_configuration_holds_what_the_robot_is_known_to_be() {
    let (packets, _) = packets(From::Robot);
    let configs: Vec<_> = packets.iter().filter_map(|(_, payload)| ConfigPacket::parse(payload)).collect();
    let [config] = configs[..] else { panic!("{} configurations", configs.len()) };
    assert_eq!((config.class.as_str(), config.subclass.as_str()), ("Pioneer", "p3dx-sh"));
    assert_eq!((config.serial_number.as_str(), config.name.as_str()), ("SIM", "AMRISim"));
    assert_eq!((config.sip_cycle_ms, config.watchdog_ms, config.pwm_max), (100, 2000, 400));
    assert_eq!((config.rotation_speed_top, config.translation_speed_top), (9999, 9999));
    assert_eq!((config.rotation_speed_max, config.translation_speed_max), (150, 3000));
    assert_eq!((config.rotation_acceleration, config.translation_acceleration), (100, 300));
    assert_eq!((config.has_front_sonar, config.has_rear_sonar, config.firmware.as_str()), (1, 1, "S.0"));
}

#[test]
fn a_configuration_is_encoded_as_it_was_sent() {
    let (packets, _) = packets(From::Robot);
    let payload = &packets.iter().find(|(_, payload)| payload[0] == packet::CONFIG).unwrap().1;
    let mut out = [0; MAX_PACKET];
    let length = ConfigPacket::parse(payload).unwrap().encode(&mut out).unwrap();
    assert_eq!(&out[3..length - 2], payload);
}

#[test]
fn every_sip_is_encoded_as_it_was_sent() {
    for (at, payload) in packets(From::Robot).0.iter().filter(|(_, payload)| packet::is_sip(payload[0])) {
        let mut out = [0; MAX_PACKET];
        let length = Sip::parse(payload).unwrap().encode(&mut out).unwrap();
        assert_eq!(&out[3..length - 2], payload, "SIP at {at} s");
    }
}

#[test]
fn sips_come_at_ten_hertz_with_sixteen_sonars_and_a_charged_battery() {
    let sips = sips();
    assert_eq!(sips.len(), 191);
    let mean = (sips[190].0 - sips[0].0) / 190.0;
    assert!((mean - 0.1).abs() < 0.005, "{mean}");
    for (_, sip) in &sips {
        let numbers: Vec<_> = sip.sonar.iter().map(|reading| reading.number).collect();
        assert_eq!(numbers, (0..16).collect::<Vec<_>>());
        assert!(sip.sonar.iter().all(|reading| (100..=5000).contains(&reading.range)));
        assert_eq!((sip.battery_dv, sip.battery_fine_dv), (Some(130), Some(130)));
        assert_eq!(sip.flags.unwrap() & !flag::MOTORS, flag::SONAR_ARRAYS);
        assert_eq!((sip.front_bumpers(), sip.rear_bumpers()), (0, 0));
        assert!(!sip.is_left_stalled() && !sip.is_right_stalled());
        assert_eq!(sip.temperature_c, Some(-127));
    }
    // The client lets go of the motors before it leaves.
    let is_on = |sip: &Sip| sip.flags.unwrap() & flag::MOTORS != 0;
    assert!(is_on(&sips[0].1) && !is_on(&sips[190].1));
}

#[test]
fn positions_agree_with_the_integrated_wheel_speeds() {
    let model = model::find("pioneer", "P3DX-SH").unwrap();
    let (mut x, mut y) = (Unwrap15::default(), Unwrap15::default());
    let (mut told, mut integrated) = ([0.0; 2], [0.0; 2]);
    let (mut way_m, mut negative) = (0.0, false);
    let mut last: Option<(f64, f64, f64)> = None; // time, speed, heading of the SIP before
    for (at, sip) in sips() {
        told[0] += f64::from(x.step(sip.x.unwrap())) * model.distance_m_per_unit;
        told[1] += f64::from(y.step(sip.y.unwrap())) * model.distance_m_per_unit;
        negative |= sip.x.unwrap() > 0x8000;
        let heading = f64::from(sip.heading.unwrap()) * model.heading_rad_per_unit;
        let speed = f64::from(i32::from(sip.left_speed.unwrap()) + i32::from(sip.right_speed.unwrap())) / 2.0
            * model.speed_m_s_per_unit;
        if let Some((before, old_speed, old_heading)) = last {
            let step = (speed + old_speed) / 2.0 * (at - before);
            let course = old_heading + math::wrap_angle(heading - old_heading) / 2.0;
            integrated[0] += step * math::cos(course);
            integrated[1] += step * math::sin(course);
            way_m += step.abs();
        }
        last = Some((at, speed, heading));
        let error = math::hypot(told[0] - integrated[0], told[1] - integrated[1]);
        // The reader's time stamps jitter by some 10 ms, at 0.4 m/s a few millimetres each.
        assert!(error < 0.03 + 0.03 * way_m, "{error} m apart after {way_m} m at {at} s");
    }
    assert!(way_m > 2.0, "the robot drove: {way_m} m");
    assert!(negative, "the recording passes below zero, where 16-bit and 15-bit positions differ");
}

#[test]
fn headings_agree_with_the_integrated_turn_rate_and_with_the_wheels() {
    let model = model::find("Pioneer", "p3dx-sh").unwrap();
    let mut last: Option<(f64, f64, f64)> = None;
    let (mut told, mut integrated) = (0.0, 0.0);
    for (at, sip) in sips() {
        let heading = f64::from(sip.heading.unwrap()) * model.heading_rad_per_unit;
        let rate = f64::from(sip.turn_rate_decideg_s.unwrap()) * model::TURN_RATE_RAD_S_PER_UNIT;
        let difference = f64::from(sip.right_speed.unwrap() - sip.left_speed.unwrap()) * model.speed_m_s_per_unit;
        assert!((rate - difference / 2.0 * model.turn_rad_per_m).abs() < 0.02, "wheels and turn rate at {at} s");
        if let Some((before, old_rate, old_heading)) = last {
            told += math::wrap_angle(heading - old_heading);
            integrated += (rate + old_rate) / 2.0 * (at - before);
        }
        last = Some((at, rate, heading));
    }
    assert!(told > 2.0, "the robot turned: {told} rad");
    assert!((told - integrated).abs() < 0.05 * told, "{told} told, {integrated} integrated");
}

#[test]
fn commands_of_the_vendors_client_are_decoded_as_what_they_are() {
    let (packets, _) = packets(From::Client);
    let commands: Vec<(u8, Option<u8>, i32)> = packets
        .iter()
        .map(|(_, payload)| Request::parse(payload).unwrap())
        .map(|request| (request.number, request.kind, request.integer()))
        .collect();
    assert_eq!(commands[..3], [(0, None, 0), (1, None, 0), (2, None, 0)], "SYNC0 to SYNC2");
    let plus = Some(KIND_POSITIVE);
    let minus = Some(KIND_NEGATIVE);
    for expected in [
        (command::OPEN, plus, 1),
        (command::CONFIG, plus, 1),
        (command::BATTERYINFO, plus, 1),
        (command::SETV, plus, 3000),
        (command::SETA, plus, 300),
        (command::SETA, minus, -300),
        (command::SETRV, plus, 150),
        (command::SETRA, plus, 100),
        (command::SETRA, minus, -100),
        (command::GRIPPERVAL, minus, -90), // the simulated laser's old start angle
        (command::ENABLE, plus, 1),
        (command::SOUNDTOG, plus, 0),
        (command::HEAD, plus, 15),
        (command::CLOSE, plus, 1),
    ] {
        assert!(commands.contains(&expected), "{expected:?}");
    }
    let speeds: Vec<i32> = commands.iter().filter(|(number, ..)| *number == command::VEL).map(|c| c.2).collect();
    assert_eq!(speeds.len(), 67);
    assert!(speeds.iter().all(|speed| (-400..=400).contains(speed)), "{speeds:?}");
    assert!(commands.iter().filter(|c| c.0 == command::RVEL).all(|c| c.2.abs() <= 150));
}
