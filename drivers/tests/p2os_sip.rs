//! SIP, encoder packet and identity: captured bytes, every prefix, every turn of the counters.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking, also in its helpers")]

use drivers::p2os::config::ConfigPacket;
use drivers::p2os::protocol::*;
use drivers::p2os::sip::*;
use proptest::prelude::*;

/// A SIP with 16 sonars, captured from a third-party robot.
const CAPTURED: &str = "FA FB 56 32 0000 0000 0000 0000 0000 82 0000 0000 1F00 00 10 00C00B 019A02 029503 03F801 042002 \
                        059503 060805 076C11 088813 098813 0AE60D 0B6F10 0C0808 0D6508 0E840B 0F8813 000000FFFF8200000000 \
                        000000008100CE1F";

fn captured() -> Vec<u8> {
    let digits: String = CAPTURED.split_whitespace().collect();
    (0..digits.len()).step_by(2).map(|at| u8::from_str_radix(&digits[at..at + 2], 16).unwrap()).collect()
}

fn payload(packet: &[u8]) -> Vec<u8> {
    let mut input = packet;
    Framer::new().next(&mut input).expect("a whole packet").to_vec()
}

fn full() -> Sip {
    let mut sip = Sip {
        kind: packet::SIP_MOVING,
        x: Some(0x7FFF),
        y: Some(1),
        heading: Some(-2048),
        left_speed: Some(-300),
        right_speed: Some(310),
        battery_dv: Some(121),
        stall_left: Some(0b0010_0001),
        stall_right: Some(0b0001_0010),
        control: Some(-7),
        flags: Some(flag::MOTORS | flag::STOP_BUTTON),
        compass: Some(90),
        has_sonar: true,
        analog_port: Some(1),
        gripper: Some(2),
        analog: Some(3),
        digital_in: Some(4),
        digital_out: Some(5),
        battery_fine_dv: Some(1210),
        charge_state: Some(-1),
        turn_rate_decideg_s: Some(-345),
        faults: Some(6),
        sideways_speed: Some(-8),
        temperature_c: Some(-20),
        charge_percent: Some(77),
        clock_us: Some(0xDEAD_BEEF),
        flags3: Some(9),
        ..Sip::default()
    };
    for (number, range) in [(3, 1234), (11, 5000), (4, 160), (12, 0)] {
        assert!(sip.sonar.push(number, range));
    }
    sip
}

fn encoded(sip: &Sip) -> Vec<u8> {
    let mut out = [0; MAX_PACKET];
    let length = sip.encode(&mut out).unwrap();
    out[..length].to_vec()
}

#[test]
fn a_captured_sip_reads_as_what_it_says() {
    let sip = Sip::parse(&payload(&captured())).unwrap();
    assert_eq!((sip.kind, sip.battery_dv, sip.battery_fine_dv), (packet::SIP_STOPPED, Some(130), Some(130)));
    assert_eq!(sip.flags, Some(0x1F));
    let ranges: Vec<u16> = sip.sonar.iter().map(|reading| reading.range).collect();
    assert_eq!(ranges, [3008, 666, 917, 504, 544, 917, 1288, 4460, 5000, 5000, 3558, 4207, 2056, 2149, 2948, 5000]);
    assert_eq!((sip.digital_in, sip.digital_out, sip.temperature_c), (Some(255), Some(255), Some(-127)));
    assert_eq!((sip.clock_us, sip.flags3), (None, None));
    assert_eq!(encoded(&sip), captured());
}

#[test]
fn every_field_survives_the_wire() {
    let sip = full();
    assert_eq!(Sip::parse(&payload(&encoded(&sip))), Some(sip));
    assert!(encoded(&sip).len() <= MAX_SIP_PACKET);
}

#[test]
fn bumpers_and_stalls_are_told_apart() {
    let sip = full();
    assert!(sip.is_left_stalled() && !sip.is_right_stalled());
    assert_eq!((sip.front_bumpers(), sip.rear_bumpers()), (0b1001, 0b1_0000));
}

#[test]
fn any_prefix_of_a_sip_is_read_as_far_as_it_goes() {
    let sip = full();
    let whole = payload(&encoded(&sip));
    for length in 1..=whole.len() {
        let part = Sip::parse(&whole[..length]).unwrap();
        let again = Sip::parse(&payload(&encoded(&part))).unwrap();
        // Half a field is no field: the shorter packet says the same.
        assert_eq!(again, part, "{length} bytes");
        let agrees = |there: bool, equal: bool| !there || equal;
        assert!(agrees(part.x.is_some(), part.x == sip.x), "{length} bytes");
        assert!(agrees(part.flags.is_some(), part.flags == sip.flags), "{length} bytes");
        assert!(agrees(part.flags3.is_some(), part == sip), "{length} bytes");
        assert!(sip.sonar.starts_with(&part.sonar), "{length} bytes");
        assert!(agrees(part.analog_port.is_some(), part.sonar == sip.sonar), "{length} bytes");
    }
    assert_eq!(Sip::parse(&[]), None);
    assert_eq!(Sip::parse(&[packet::SIP_STOPPED]).unwrap().x, None);
}

#[test]
fn a_p2os_sip_ends_after_the_digital_outputs() {
    let sip = Sip { battery_fine_dv: None, ..full() };
    let read = Sip::parse(&payload(&encoded(&sip))).unwrap();
    assert_eq!((read.digital_out, read.battery_fine_dv, read.turn_rate_decideg_s), (Some(5), None, None));
}

#[test]
fn other_packets_are_no_sips() {
    for kind in (0..=255u8).filter(|kind| !(0x30..=0x34).contains(kind)) {
        assert_eq!(Sip::parse(&[kind, 0, 0]), None, "{kind:#x}");
    }
}

#[test]
fn positions_unwrap_through_both_ends_of_their_fifteen_bits() {
    for signed in [false, true] {
        let (mut counter, mut sum) = (Unwrap15::default(), 0);
        let mut expected = 0i32;
        counter.step(0);
        for step in [200, 16_000, 16_000, 16_000, -16_384, -16_000, -16_000, -16_000, -40] {
            expected += step;
            // Some robots send 15 bits, some a wrapping 16-bit integer.
            let raw = if signed { expected as u16 } else { expected as u16 & 0x7FFF };
            sum += counter.step(raw);
            assert_eq!(sum, expected, "signed {signed}");
        }
    }
}

#[test]
fn an_identity_is_read_and_missing_texts_are_empty() {
    let mut out = [0; MAX_PACKET];
    let identity = Identity { name: "simbot".into(), class: "Pioneer".into(), subclass: "p3dx".into() };
    let length = identity.encode(&mut out).unwrap();
    assert_eq!(Identity::parse(&payload(&out[..length])), Some(identity));
    assert_eq!(Identity::parse(b"\x02simbot\0Pio"), Some(Identity { name: "simbot".into(), ..Identity::default() }));
    assert_eq!(Identity::parse(&[command::SYNC1]), None);
    let odd = Identity::parse(b"\x02\xFF\x1b[31m\0\0\0").unwrap();
    assert_eq!(odd.name.as_str(), "??[31m", "what a terminal would act upon is not shown");
}

#[test]
fn encoder_ticks_keep_their_sign() {
    let mut out = [0; MAX_PACKET];
    let ticks = EncoderTicks { left: -70_000, right: i32::MAX };
    let length = ticks.encode(&mut out).unwrap();
    assert_eq!(EncoderTicks::parse(&payload(&out[..length])), Some(ticks));
    assert_eq!(EncoderTicks::parse(&[packet::ENCODER, 1, 2, 3]), None);
}

proptest! {
    #[test]
    fn no_payload_makes_a_parser_panic(payload in prop::collection::vec(any::<u8>(), 0..=MAX_PAYLOAD), kind in
        prop_oneof![Just(2u8), Just(0x20), Just(0x32), Just(0x33), Just(0x90), any::<u8>()]) {
        let mut payload = payload;
        if let Some(first) = payload.first_mut() { *first = kind; }
        let mut out = [0; MAX_PACKET];
        if let Some(sip) = Sip::parse(&payload) {
            let length = sip.encode(&mut out).unwrap();
            prop_assert_eq!(Sip::parse(&out[3..length - 2]), Some(sip));
        }
        if let Some(config) = ConfigPacket::parse(&payload) {
            let _ = config.encode(&mut out);
        }
        let _ = (Identity::parse(&payload), EncoderTicks::parse(&payload));
    }
}
