//! The controller as a client sees it: bytes in, packets out, on ideal wheels.

use super::*;
use drivers::p2os::Text;
use drivers::p2os::config::ConfigPacket;
use drivers::p2os::protocol::{Argument, MAX_PACKET, command, encode, encode_command, flag, packet};
use drivers::p2os::sip::{EncoderTicks, Identity, Reading, Sip};
use proptest::prelude::*;

const STEP_S: f64 = 0.01;
const STEP_NS: u64 = 10_000_000;

fn flash() -> Flash {
    Flash {
        identity: Identity {
            name: Text::from("simbot"),
            class: Text::from("Pioneer"),
            subclass: Text::from("p3dx-sh"),
        },
        serial_number: Text::from("SINEW0001"),
        firmware: Firmware::Arcos,
        distance_m_per_unit: 0.001,
        watchdog_ms: 2000,
        sip_cycle_ms: 100,
        front_bumpers: 5,
        rear_bumpers: 5,
        ticks_per_mm: 128,
        turn_rad_per_m: 5.6,
        tops: Tops::PIONEER,
    }
}

/// A controller whose wheels turn exactly as told.
struct Rig {
    mcu: Mcu,
    now: Time,
    left_m: f64,
    right_m: f64,
    blocked: bool,
    packets: Vec<Vec<u8>>,
}

impl Rig {
    fn new() -> Rig {
        Rig { mcu: Mcu::new(flash()), now: Time::ZERO, left_m: 0.0, right_m: 0.0, blocked: false, packets: Vec::new() }
    }

    /// After handshake, OPEN and ENABLE.
    fn driving() -> Rig {
        let mut rig = Rig::new();
        for number in [0, 1, 2, command::OPEN] {
            rig.command(number, Argument::None);
        }
        rig.command(command::ENABLE, Argument::Integer(1));
        rig.packets.clear();
        rig
    }

    fn bytes(&mut self, bytes: &[u8]) {
        self.mcu.receive(self.now, bytes);
        self.collect();
    }

    fn command(&mut self, number: u8, argument: Argument) {
        let mut out = [0; MAX_PACKET];
        let length = encode_command(&mut out, number, argument).unwrap();
        self.bytes(&out[..length]);
    }

    fn run(&mut self, seconds: f64) {
        for _ in 0..(seconds / STEP_S).round() as usize {
            let drive = self.mcu.drive(self.now, STEP_S);
            self.now = self.now.after_ns(STEP_NS);
            if !self.blocked {
                let aside = drive.turn_rad_s / 5.6;
                self.left_m += (drive.speed_m_s - aside) * STEP_S;
                self.right_m += (drive.speed_m_s + aside) * STEP_S;
            }
            let driven = self.blocked && (drive.speed_m_s != 0.0 || drive.turn_rad_s != 0.0);
            let felt = Felt {
                left_ticks: (self.left_m * 128_000.0).floor() as i64,
                right_ticks: (self.right_m * 128_000.0).floor() as i64,
                left_blocked: driven,
                right_blocked: driven,
                ..Felt::default()
            };
            self.mcu.observe(self.now, felt, STEP_S);
            self.mcu.ping(self.now, |disc, _| 1000 + disc as u16);
            self.mcu.report(self.now);
            self.collect();
        }
    }

    fn collect(&mut self) {
        let mut framer = Framer::new();
        let bytes = self.mcu.outbox().to_vec();
        self.mcu.sent(bytes.len());
        let mut rest = &bytes[..];
        while let Some(payload) = framer.next(&mut rest) {
            self.packets.push(payload.to_vec());
        }
        assert_eq!((framer.checksum_errors(), framer.skipped_bytes(), framer.is_inside_packet()), (0, 0, false));
    }

    fn sip(&self) -> Sip {
        self.packets.iter().rev().find_map(|payload| Sip::parse(payload)).expect("no SIP came")
    }

    fn speed_mm_s(&mut self) -> i16 {
        self.run(0.1);
        let sip = self.sip();
        (sip.left_speed.unwrap() + sip.right_speed.unwrap()) / 2
    }
}

#[test]
fn the_handshake_echoes_each_sync_and_tells_who_it_is() {
    let mut rig = Rig::new();
    // Bytes captured from a third-party client, behind the junk that it sends first on a serial line.
    rig.bytes(b"WMS2\r");
    rig.bytes(&[0xFA, 0xFB, 3, 0, 0, 0]);
    rig.bytes(&[0xFA, 0xFB, 3, 1, 0, 1]);
    rig.bytes(&[0xFA, 0xFB, 3, 2, 0, 2]);
    assert_eq!(rig.packets, [b"\x00".to_vec(), b"\x01".to_vec(), b"\x02simbot\0Pioneer\0p3dx-sh\0".to_vec()]);
    assert_eq!(rig.mcu.session(), Session::Ready);
    rig.run(1.0);
    assert_eq!(rig.packets.len(), 3, "nothing but the echoes before OPEN");
}

#[test]
fn the_identity_is_the_captured_packet_to_the_byte() {
    let identity = Identity { name: Text::from("AMRISim"), ..flash().identity };
    let mut mcu = Mcu::new(Flash { identity, ..flash() });
    mcu.receive(Time::ZERO, &[0xFA, 0xFB, 3, 0, 0, 0, 0xFA, 0xFB, 3, 1, 0, 1]);
    mcu.sent(mcu.outbox().len());
    mcu.receive(Time::ZERO, &[0xFA, 0xFB, 3, 2, 0, 2]);
    let captured = "FAFB1B02414D524953696D0050696F6E65657200703364782D7368005F52";
    let hex: String = mcu.outbox().iter().map(|byte| format!("{byte:02X}")).collect();
    assert_eq!(hex, captured);
}

#[test]
fn a_sync_out_of_order_starts_the_sequence_anew() {
    let mut rig = Rig::new();
    for number in [0, 2, 1, 0, 1, 2] {
        rig.command(number, Argument::None);
    }
    let kinds: Vec<u8> = rig.packets.iter().map(|payload| payload[0]).collect();
    assert_eq!(kinds, [0, 0, 1, 2]);
    // A client that lost the last echo begins again.
    rig.command(0, Argument::None);
    assert_eq!(rig.mcu.session(), Session::Waiting(1));
}

#[test]
fn stop_and_other_commands_before_the_handshake_are_ignored() {
    let mut rig = Rig::new();
    for number in [0, command::STOP, 1, command::ENABLE, 2, command::STOP] {
        rig.command(number, Argument::None);
    }
    assert_eq!(rig.packets.len(), 3);
    assert_eq!(rig.mcu.session(), Session::Ready);
}

#[test]
fn open_is_taken_bare_and_with_an_argument_and_sips_come_every_tenth_of_a_second() {
    for open in [&[0xFA, 0xFB, 3, 1, 0, 1][..], &[0xFA, 0xFB, 6, 1, 0x3B, 1, 0, 2, 0x3B]] {
        let mut rig = Rig::new();
        for number in [0, 1, 2] {
            rig.command(number, Argument::None);
        }
        rig.bytes(open);
        rig.packets.clear();
        rig.run(1.0);
        assert_eq!(rig.packets.len(), 10);
        let sip = rig.sip();
        assert_eq!(sip.kind, packet::SIP_STOPPED);
        assert_eq!(sip.flags.unwrap(), 0b110, "both arrays fire, the motors are off");
        assert_eq!((sip.x, sip.heading, sip.battery_dv, sip.battery_fine_dv), (Some(0), Some(0), Some(127), Some(127)));
        let readings: Vec<usize> = rig.packets.iter().map(|payload| Sip::parse(payload).unwrap().sonar.len()).collect();
        assert!(readings.iter().all(|count| (4..=6).contains(count)), "{readings:?}");
        assert!(rig.packets.iter().all(|payload| payload.len() + 5 <= 59), "a line of 9600 baud carries them");
    }
}

#[test]
fn the_sip_is_the_captured_packet_to_the_byte() {
    let ranges = [
        0x0BC0, 0x029A, 0x0395, 0x01F8, 0x0220, 0x0395, 0x0508, 0x116C, 0x1388, 0x1388, 0x0DE6, 0x106F, 0x0808, 0x0865,
        0x0B84, 0x1388,
    ];
    let mut rig = Rig::driving();
    rig.command(command::BATTEST, Argument::Integer(130));
    for (disc, range) in ranges.into_iter().enumerate() {
        rig.mcu.core.sonar.fresh.push(disc as u8, range);
    }
    // The captured robot reported four arrays and no state of charge.
    let sip = Sip { flags: Some(0x001F), charge_percent: Some(0), ..rig.mcu.core.sip(&flash()) };
    let mut out = [0; MAX_PACKET];
    let length = sip.encode(&mut out).unwrap();
    let hex: String = out[..length].iter().map(|byte| format!("{byte:02X}")).collect();
    let captured = [
        "FAFB56320000000000000000000082000000001F00001000C00B019A0202950303F801042002059503060805",
        "076C110888130988130AE60D0B6F100C08080D65080E840B0F8813000000FFFF8200000000000000008100CE1F",
    ];
    assert_eq!(hex, captured.concat());
}

#[test]
fn motors_are_off_after_open_and_motion_commands_do_nothing_until_enable() {
    let mut rig = Rig::driving();
    rig.command(command::ENABLE, Argument::Integer(0));
    rig.command(command::VEL, Argument::Integer(200));
    assert_eq!(rig.speed_mm_s(), 0);
    rig.command(command::ENABLE, Argument::Integer(1));
    assert_eq!(rig.speed_mm_s(), 0, "what was told before stays without effect");
    rig.command(command::VEL, Argument::Integer(200));
    rig.run(1.0);
    assert!((rig.speed_mm_s() - 200).abs() <= 1);
    let sip = rig.sip();
    assert_eq!(sip.kind, packet::SIP_MOVING);
    assert_eq!(sip.flags.unwrap() & flag::MOTORS, flag::MOTORS);
}

#[test]
fn silence_stops_the_robot_and_the_next_command_resumes_the_old_motion() {
    let mut rig = Rig::driving();
    rig.command(command::VEL, Argument::Integer(300));
    rig.run(1.9);
    assert!((rig.speed_mm_s() - 300).abs() <= 1);
    rig.run(1.5);
    assert_eq!(rig.speed_mm_s(), 0);
    assert!(rig.mcu.motors_enabled());
    rig.command(command::PULSE, Argument::None);
    rig.run(1.5);
    assert!((rig.speed_mm_s() - 300).abs() <= 1, "PULSE brings the old motion back");
    // STOP before PULSE takes it away.
    rig.run(3.0);
    rig.command(command::STOP, Argument::None);
    rig.command(command::PULSE, Argument::None);
    rig.run(1.0);
    assert_eq!(rig.speed_mm_s(), 0);
}

#[test]
fn pulses_alone_keep_the_robot_moving() {
    let mut rig = Rig::driving();
    rig.command(command::VEL, Argument::Integer(100));
    for _ in 0..10 {
        rig.run(1.0);
        rig.command(command::PULSE, Argument::None);
    }
    assert!((rig.speed_mm_s() - 100).abs() <= 1);
}

#[test]
fn turning_agrees_in_wheel_speeds_rate_and_heading() {
    let mut rig = Rig::driving();
    rig.command(command::RVEL, Argument::Integer(-30));
    rig.run(2.0);
    let sip = rig.sip();
    assert!((sip.turn_rate_decideg_s.unwrap() + 300).abs() <= 2, "{sip:?}");
    let (left, right) = (f64::from(sip.left_speed.unwrap()), f64::from(sip.right_speed.unwrap()));
    // DiffConvFactor of the clients' tables: (right − left)/2 · 0.0056 rad/s.
    assert!(((right - left) / 2.0 * 0.0056 + 30.0_f64.to_radians()).abs() < 0.006, "{left} {right}");
    let before = sip.heading.unwrap();
    rig.command(command::PULSE, Argument::None);
    rig.run(1.0);
    let turned = rig.sip().heading.unwrap() - before;
    assert!((f64::from(turned) + 30.0 / 360.0 * 4096.0).abs() <= 2.0, "{turned}");
    assert_eq!(rig.sip().x, Some(0));
}

#[test]
fn head_dhead_and_dchead_turn_to_where_they_say_the_short_way() {
    let mut rig = Rig::driving();
    let degrees = |rig: &Rig| f64::from(rig.sip().heading.unwrap()) * 360.0 / 4096.0;
    rig.command(command::HEAD, Argument::Integer(170));
    rig.run(1.9);
    rig.command(command::PULSE, Argument::None);
    rig.run(1.9);
    assert!((degrees(&rig) - 170.0).abs() < 0.2, "{}", degrees(&rig));
    assert!((rig.sip().control.unwrap() - 1934).abs() <= 1);
    rig.command(command::HEAD, Argument::Integer(-170));
    rig.run(1.9);
    assert!((degrees(&rig) + 170.0).abs() < 0.2, "20° on, through the half turn: {}", degrees(&rig));
    rig.command(command::DHEAD, Argument::Integer(-30));
    rig.run(1.9);
    assert!((degrees(&rig) - 160.0).abs() < 0.2, "{}", degrees(&rig));
    rig.command(command::DCHEAD, Argument::Integer(10));
    rig.run(1.9);
    assert!((degrees(&rig) - 170.0).abs() < 0.2, "{}", degrees(&rig));
}

#[test]
fn move_travels_the_way_and_stops_and_both_axes_act_together() {
    let mut rig = Rig::driving();
    rig.command(command::MOVE, Argument::Integer(250));
    rig.command(command::HEAD, Argument::Integer(20));
    rig.run(1.9);
    rig.command(command::PULSE, Argument::None);
    rig.run(1.0);
    assert_eq!(rig.speed_mm_s(), 0);
    let way = 0.5 * (rig.left_m + rig.right_m);
    assert!((way - 0.25).abs() < 0.002, "{way}");
    assert!((f64::from(rig.sip().heading.unwrap()) * 360.0 / 4096.0 - 20.0).abs() < 0.2);
}

#[test]
fn vel2_drives_the_wheels_in_both_of_the_forms_that_clients_send() {
    // Player: the raw two bytes with 3B; AriaCoda: the signed word, so perhaps 1B with its magnitude.
    for payload in [[32, 0x3B, 5, (-5_i8) as u8], [32, 0x1B, 0xFB, 0x04]] {
        let mut rig = Rig::driving();
        let mut out = [0; MAX_PACKET];
        let length = encode(&mut out, &payload).unwrap();
        rig.bytes(&out[..length]);
        rig.run(1.5);
        let sip = rig.sip();
        assert_eq!((sip.left_speed, sip.right_speed), (Some(-100), Some(100)), "{payload:?}");
        // VEL takes the place of both wheel speeds.
        rig.command(command::VEL, Argument::Integer(100));
        rig.run(1.5);
        let sip = rig.sip();
        assert!((sip.left_speed.unwrap() - 100).abs() <= 1 && (sip.right_speed.unwrap() - 100).abs() <= 1, "{sip:?}");
    }
}

#[test]
fn the_settings_shape_the_motion_and_end_with_the_session() {
    let mut rig = Rig::driving();
    rig.command(command::SETV, Argument::Integer(150));
    rig.command(command::SETA, Argument::Integer(1000));
    rig.command(command::SETA, Argument::Integer(-2000));
    rig.command(command::VEL, Argument::Integer(400));
    rig.run(0.2);
    assert!((rig.speed_mm_s() - 150).abs() <= 1, "0.15 m/s after 0.15 s, and no faster");
    rig.command(command::CONFIG, Argument::Integer(1));
    rig.run(0.1);
    let config = rig.packets.iter().find_map(|payload| ConfigPacket::parse(payload)).expect("no CONFIGpac");
    assert_eq!((config.translation_speed_max, config.translation_acceleration), (150, 1000));
    assert_eq!((config.translation_deceleration, config.watchdog_ms, config.sip_cycle_ms), (2000, 2000, 100));
    assert_eq!((config.subclass.as_str(), config.name.as_str()), ("p3dx-sh", "simbot"));
    assert!(config.translation_speed_top > 0 && config.rotation_speed_top > 0 && config.rotation_acceleration > 0);
    rig.command(command::CLOSE, Argument::Integer(1));
    assert!(rig.mcu.take_hung_up() && !rig.mcu.take_hung_up());
    assert_eq!(rig.mcu.core.settings, Settings::FACTORY);
    rig.packets.clear();
    rig.run(1.0);
    assert!(rig.packets.is_empty() && !rig.mcu.motors_enabled());
}

#[test]
fn stop_decelerates_and_e_stop_does_not_wait_for_the_ramp() {
    let way = |stop: u8| {
        let mut rig = Rig::driving();
        rig.command(command::VEL, Argument::Integer(600));
        rig.run(1.9);
        rig.command(command::PULSE, Argument::None);
        rig.run(1.0);
        let before = rig.left_m;
        rig.command(stop, Argument::None);
        rig.run(1.9);
        assert_eq!(rig.speed_mm_s(), 0);
        assert!(rig.mcu.motors_enabled());
        rig.left_m - before
    };
    // v²/2d with 0.6 m/s² and with the tyres' 3 m/s².
    assert!((way(command::STOP) - 0.3).abs() < 0.005, "{}", way(command::STOP));
    assert!((way(command::E_STOP) - 0.06).abs() < 0.005, "{}", way(command::E_STOP));
}

#[test]
fn seto_is_taken_bare_without_value_and_with_values() {
    for payload in [&[7][..], &[7, 0x3B], &[7, 0x3B, 1, 0, 2, 0, 3, 0]] {
        let mut rig = Rig::driving();
        rig.command(command::VEL, Argument::Integer(200));
        rig.command(command::RVEL, Argument::Integer(20));
        rig.run(1.5);
        assert!(rig.sip().x.unwrap() > 100);
        rig.command(command::STOP, Argument::None);
        rig.run(1.5);
        let mut out = [0; MAX_PACKET];
        let length = encode(&mut out, payload).unwrap();
        rig.bytes(&out[..length]);
        rig.run(0.2);
        let sip = rig.sip();
        assert_eq!((sip.x, sip.y, sip.heading), (Some(0), Some(0), Some(0)));
    }
}

#[test]
fn a_stalled_wheel_is_told_loses_power_and_tries_again() {
    let mut rig = Rig::driving();
    rig.command(command::VEL, Argument::Integer(200));
    rig.run(1.0);
    rig.blocked = true;
    rig.run(0.5);
    let sip = rig.sip();
    assert!(sip.is_left_stalled() && sip.is_right_stalled());
    assert_eq!(rig.speed_mm_s(), 0);
    rig.blocked = false;
    rig.command(command::PULSE, Argument::None);
    rig.run(0.9);
    let sip = rig.sip();
    assert!(!sip.is_left_stalled() && !sip.is_right_stalled());
    assert!((rig.speed_mm_s() - 200).abs() <= 1);
}

#[test]
fn encoder_and_io_packets_follow_the_sip_as_often_as_asked() {
    let mut rig = Rig::driving();
    rig.command(command::ENCODER, Argument::Integer(1));
    rig.command(command::IOREQUEST, Argument::Integer(2));
    rig.command(command::VEL, Argument::Integer(100));
    rig.run(1.0);
    let kinds: Vec<u8> = rig.packets.iter().map(|payload| payload[0]).collect();
    assert_eq!(kinds[..3], [packet::SIP_MOVING, packet::ENCODER, packet::IO]);
    assert_eq!(kinds.iter().filter(|kind| **kind == packet::ENCODER).count(), 1);
    assert_eq!(kinds.iter().filter(|kind| **kind == packet::IO).count(), 10);
    rig.command(command::ENCODER, Argument::Integer(2));
    rig.run(0.1);
    let ticks = rig.packets.iter().rev().find_map(|payload| EncoderTicks::parse(payload)).unwrap();
    assert_eq!(ticks.left, (rig.left_m * 128_000.0).floor() as i32);
}

#[test]
fn wrong_checksums_long_counts_and_unknown_commands_are_dropped_without_a_word() {
    let mut rig = Rig::driving();
    rig.bytes(&[0xFA, 0xFB, 6, 11, 0x3B, 0xC8, 0, 0, 0]);
    let mut long = [0; MAX_PACKET];
    let mut payload = [0; 204];
    payload[..4].copy_from_slice(&[11, 0x3B, 200, 0]);
    let length = encode(&mut long, &payload).unwrap();
    rig.bytes(&long[..length]);
    rig.command(199, Argument::Integer(5));
    rig.command(command::SAY, Argument::Text(&[5, 60]));
    rig.command(command::BATTERYINFO, Argument::Integer(1));
    assert_eq!(rig.speed_mm_s(), 0);
    assert_eq!(rig.packets.len(), 1, "only the SIP");
    // A command split over many reads is one command.
    let mut out = [0; MAX_PACKET];
    let length = encode_command(&mut out, command::VEL, Argument::Integer(200)).unwrap();
    for byte in &out[..length] {
        rig.bytes(&[*byte]);
    }
    rig.run(1.0);
    assert!((rig.speed_mm_s() - 200).abs() <= 1);
}

#[test]
fn the_older_model_counts_in_its_own_units_and_ends_its_sip_early() {
    let mut rig = Rig::driving();
    rig.mcu.flash.distance_m_per_unit = 0.000_485;
    rig.mcu.flash.firmware = Firmware::P2os;
    rig.command(command::MOVE, Argument::Integer(485));
    rig.run(1.9);
    rig.command(command::PULSE, Argument::None);
    rig.run(1.9);
    let sip = rig.sip();
    assert!((i32::from(sip.x.unwrap()) - 1000).abs() <= 4, "{sip:?}");
    assert_eq!((sip.digital_out, sip.battery_fine_dv), (Some(0xFF), None));
}

#[test]
fn positions_wrap_at_fifteen_bits() {
    let mut rig = Rig::driving();
    rig.mcu.core.odometer.x_m = -0.005;
    rig.run(0.1);
    assert_eq!(rig.sip().x, Some(0x7FFB));
    rig.mcu.core.odometer.x_m = 32.770;
    rig.run(0.1);
    assert_eq!(rig.sip().x, Some(2));
}

#[test]
fn the_sonar_obeys_its_switch_and_its_order() {
    let mut rig = Rig::driving();
    rig.command(command::SONAR, Argument::Integer(0));
    rig.run(0.2);
    assert_eq!((rig.sip().sonar.len(), rig.sip().flags.unwrap() & flag::SONAR_ARRAYS), (0, 0));
    rig.command(command::SONAR, Argument::Integer(1));
    rig.command(command::POLLING, Argument::Text(&[4, 5]));
    rig.run(0.2);
    let sip = rig.sip();
    assert!(sip.sonar.iter().all(|reading| [3, 4].contains(&reading.number)) && !sip.sonar.is_empty());
    assert_eq!(sip.sonar[0], Reading { number: sip.sonar[0].number, range: 1000 + u16::from(sip.sonar[0].number) });
}

#[test]
fn the_stop_button_and_an_empty_battery_take_the_motors_power() {
    let mut rig = Rig::driving();
    rig.command(command::E_STALL, Argument::Integer(1));
    rig.mcu.press_stop_button(true);
    rig.run(0.1);
    assert_eq!(rig.sip().flags.unwrap() & (flag::MOTORS | flag::STOP_BUTTON), flag::STOP_BUTTON);
    rig.mcu.press_stop_button(false);
    rig.command(command::ENABLE, Argument::Integer(1));
    assert!(rig.mcu.motors_enabled());
    rig.command(command::BATTEST, Argument::Integer(108));
    assert!(rig.mcu.low_battery() && rig.mcu.motors_enabled());
    rig.command(command::BATTEST, Argument::Integer(100));
    rig.run(0.1);
    assert!(!rig.mcu.motors_enabled());
    assert_eq!(rig.sip().battery_dv, Some(100));
}

#[test]
fn a_restarted_controller_waits_for_its_handshake_and_its_encoders_count_on() {
    let mut rig = Rig::driving();
    rig.command(command::MOVE, Argument::Integer(100));
    rig.run(1.5);
    rig.mcu.restart();
    rig.packets.clear();
    rig.run(0.5);
    assert!(rig.packets.is_empty());
    assert_eq!(rig.mcu.session(), Session::Waiting(0));
    assert_eq!((rig.mcu.core.odometer.x_m, rig.mcu.core.odometer.left_m_s), (0.0, 0.0));
}

proptest! {
    #[test]
    fn no_bytes_panic_the_controller(chunks in prop::collection::vec(prop::collection::vec(any::<u8>(), 0..64), 0..40)) {
        let mut rig = Rig::driving();
        for chunk in chunks {
            rig.mcu.receive(rig.now, &chunk);
            rig.run(0.05);
        }
    }

    #[test]
    fn no_command_panics_the_controller(
        commands in prop::collection::vec(prop::collection::vec(any::<u8>(), 1..12), 0..60),
    ) {
        let mut rig = Rig::driving();
        for payload in commands {
            let mut out = [0; MAX_PACKET];
            let length = encode(&mut out, &payload).unwrap();
            rig.mcu.receive(rig.now, &out[..length]);
            rig.run(0.05);
            prop_assert!(rig.mcu.outbox().len() < 4096);
        }
    }
}
