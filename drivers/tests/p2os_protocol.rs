//! The packet layer against captured and recomputed bytes, corruption and noise.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking, also in its helpers")]

use drivers::p2os::protocol::*;
use proptest::prelude::*;

fn bytes(hex: &str) -> Vec<u8> {
    let digits: String = hex.split_whitespace().collect();
    (0..digits.len()).step_by(2).map(|at| u8::from_str_radix(&digits[at..at + 2], 16).unwrap()).collect()
}

fn sent(number: u8, argument: Argument) -> Vec<u8> {
    let mut out = [0; MAX_PACKET];
    let length = encode_command(&mut out, number, argument).unwrap();
    out[..length].to_vec()
}

fn payloads(framer: &mut Framer, mut input: &[u8]) -> Vec<Vec<u8>> {
    let mut all = Vec::new();
    while let Some(payload) = framer.next(&mut input) {
        all.push(payload.to_vec());
    }
    assert!(input.is_empty(), "the framer takes all of its input");
    all
}

#[test]
fn commands_encode_to_the_captured_bytes() {
    let vectors: [(u8, Argument, &str); 14] = [
        (command::SYNC0, Argument::None, "FA FB 03 00 00 00"),
        (command::SYNC1, Argument::None, "FA FB 03 01 00 01"),
        (command::SYNC2, Argument::None, "FA FB 03 02 00 02"),
        (command::OPEN, Argument::Integer(1), "FA FB 06 01 3B 01 00 02 3B"),
        (command::ENABLE, Argument::Integer(1), "FA FB 06 04 3B 01 00 05 3B"),
        (command::CONFIG, Argument::Integer(1), "FA FB 06 12 3B 01 00 13 3B"),
        (command::SETV, Argument::Integer(3000), "FA FB 06 06 3B B8 0B BE 46"),
        (command::HEAD, Argument::Integer(15), "FA FB 06 0C 3B 0F 00 1B 3B"),
        (command::GRIPPERVAL, Argument::Integer(-90), "FA FB 06 24 1B 5A 00 7E 1B"),
        (command::VEL, Argument::Integer(400), "FA FB 06 0B 3B 90 01 9B 3C"),
        (command::VEL, Argument::Integer(-200), "FA FB 06 0B 1B C8 00 D3 1B"),
        (command::RVEL, Argument::Integer(-30), "FA FB 06 15 1B 1E 00 33 1B"),
        (command::VEL2, Argument::Word(pack_wheels(400, 400)), "FA FB 06 20 3B 14 14 34 4F"),
        (command::SAY, Argument::Text(&[5, 60]), "FA FB 07 0F 2B 02 05 3C 11 0C"),
    ];
    for (number, argument, expected) in vectors {
        assert_eq!(sent(number, argument), bytes(expected), "command {number} {argument:?}");
    }
}

#[test]
fn a_packet_of_several_strings_keeps_its_captured_checksum() {
    let captured = bytes("FA FB 1B 02 41 4D 52 49 53 69 6D 00 50 69 6F 6E 65 65 72 00 70 33 64 78 2D 73 68 00 5F 52");
    let mut out = [0; MAX_PACKET];
    let length =
        Builder::new(&mut out, command::SYNC2).text("AMRISim").text("Pioneer").text("p3dx-sh").finish().unwrap();
    assert_eq!(&out[..length], captured);
    assert_eq!(payloads(&mut Framer::new(), &captured).len(), 1);
}

#[test]
fn arguments_outside_the_wire_format_are_refused() {
    let mut out = [0; MAX_PACKET];
    assert_eq!(encode_command(&mut out, command::VEL, Argument::Integer(65_536)), Err(EncodeError::OutOfRange));
    assert_eq!(encode_command(&mut out, command::VEL, Argument::Integer(i32::MIN)), Err(EncodeError::OutOfRange));
    assert_eq!(encode_command(&mut out, command::SAY, Argument::Text(&[0; 200])), Err(EncodeError::TooLong));
    assert!(encode_command(&mut out, command::SAY, Argument::Text(&[0; 199])).is_ok());
    assert_eq!(encode_command(&mut [0; 5], command::PULSE, Argument::None), Err(EncodeError::TooLong));
    assert_eq!(encode(&mut out, &[]), Err(EncodeError::Empty));
    assert_eq!(encode(&mut out, &[0; MAX_PAYLOAD + 1]), Err(EncodeError::TooLong));
    assert_eq!(encode(&mut out, &[0; MAX_PAYLOAD]), Ok(MAX_PACKET));
}

#[test]
fn wheel_speeds_are_read_back_whichever_sign_the_client_sent() {
    for (left, right) in [(400, 400), (-400, 400), (400, -400), (-20, -20), (0, -20), (2540, -2540)] {
        let word = pack_wheels(left, right);
        let raw = sent(command::VEL2, Argument::Word(word));
        let signed = sent(command::VEL2, Argument::Integer(i32::from(word as i16)));
        for packet in [raw, signed] {
            let payload = payloads(&mut Framer::new(), &packet).remove(0);
            let request = Request::parse(&payload).unwrap();
            assert_eq!(unpack_wheels(request.integer()), (left, right), "{packet:02x?}");
        }
    }
    assert_eq!(unpack_wheels(i32::from(pack_wheels(9_999, -9_999))), (2540, -2540), "too fast is cut");
    assert_eq!(unpack_wheels(i32::from(pack_wheels(9, 11))), (0, 20), "rounded to the nearest");
}

#[test]
fn short_arguments_of_real_clients_count_as_zero() {
    let bare = Request::parse(&[command::SETO]).unwrap();
    assert_eq!((bare.kind, bare.integer(), bare.word(2)), (None, 0, 0));
    let kind_only = Request::parse(&[command::SETO, KIND_POSITIVE]).unwrap();
    assert_eq!((kind_only.integer(), kind_only.word(0)), (0, 0));
    let one_byte = Request::parse(&[command::VEL, KIND_NEGATIVE, 7]).unwrap();
    assert_eq!(one_byte.integer(), -7);
    let pose = Request::parse(&[command::SIM_SET_POSE, 0, 1, 0, 0, 0, 0xFE, 0xFF, 0xFF, 0xFF, 90]).unwrap();
    assert_eq!((pose.long(0), pose.long(1), pose.long(2), pose.long(3)), (1, -2, 90, 0));
    assert_eq!(Request::parse(&[]), None);
}

#[test]
fn text_is_cut_where_the_packet_ends_and_a_surplus_nul_is_left_out() {
    let surplus = Request::parse(&[command::SAY, KIND_TEXT, 2, 5, 60, 0]).unwrap();
    assert_eq!(surplus.text(), [5, 60]);
    let short = Request::parse(&[command::SAY, KIND_TEXT, 20, 5, 60]).unwrap();
    assert_eq!(short.text(), [5, 60]);
    assert_eq!(Request::parse(&[command::SAY, KIND_POSITIVE, 2, 0]).unwrap().text(), [0u8; 0]);
}

#[test]
fn a_modem_command_before_the_handshake_is_skipped() {
    let mut framer = Framer::new();
    let found = payloads(&mut framer, b"WMS2\r\xFA\xFB\x03\x00\x00\x00");
    assert_eq!(found, [[0]]);
    assert_eq!((framer.skipped_bytes(), framer.checksum_errors()), (5, 0));
}

#[test]
fn junk_that_looks_like_a_header_does_not_cost_the_packet_behind_it() {
    let mut stream = bytes("FA FB 06");
    stream.extend(sent(command::VEL, Argument::Integer(400)));
    stream.extend(sent(command::PULSE, Argument::None));
    let mut framer = Framer::new();
    let found = payloads(&mut framer, &stream);
    assert_eq!(found.len(), 2, "{found:02x?}");
    assert_eq!(found[0][0], command::VEL);
    assert_eq!((framer.checksum_errors(), framer.skipped_bytes()), (1, 3));
}

#[test]
fn a_flipped_bit_costs_one_packet_only() {
    let mut stream = Vec::new();
    for speed in 0..20 {
        stream.extend(sent(command::VEL, Argument::Integer(speed)));
    }
    for at in 0..stream.len() {
        let mut damaged = stream.clone();
        damaged[at] ^= 0x10;
        let mut framer = Framer::new();
        let mut found = payloads(&mut framer, &damaged);
        framer.give_up();
        while framer.is_inside_packet() {
            found.extend(payloads(&mut framer, &[]));
            framer.give_up();
        }
        assert_eq!(found.len(), 19, "bit flipped in byte {at}");
    }
}

#[test]
fn a_packet_that_stops_half_way_is_given_up_for_the_next() {
    let mut framer = Framer::new();
    assert!(payloads(&mut framer, &bytes("FA FB 50 32 00")).is_empty());
    assert!(framer.is_inside_packet());
    framer.give_up();
    assert_eq!(payloads(&mut framer, &sent(command::PULSE, Argument::None)), [[0]]);
    assert!(!framer.is_inside_packet());
}

#[test]
fn the_firmware_side_ignores_what_is_longer_than_a_command_may_be() {
    let mut out = [0; MAX_PACKET];
    let longest = encode(&mut out, &[1; 202]).unwrap();
    assert_eq!(payloads(&mut Framer::with_max_count(MAX_COMMAND_COUNT), &out[..longest]).len(), 1);
    let longer = encode(&mut out, &[1; 203]).unwrap();
    assert_eq!(payloads(&mut Framer::with_max_count(MAX_COMMAND_COUNT), &out[..longer]).len(), 0);
}

proptest! {
    #[test]
    fn whatever_is_encoded_is_found_again_however_it_is_cut(
        messages in prop::collection::vec(prop::collection::vec(any::<u8>(), 1..=MAX_PAYLOAD), 1..8),
        cuts in prop::collection::vec(1usize..40, 1..60),
    ) {
        let mut stream = Vec::new();
        for message in &messages {
            let mut out = [0; MAX_PACKET];
            let length = encode(&mut out, message).unwrap();
            stream.extend_from_slice(&out[..length]);
        }
        let mut framer = Framer::new();
        let mut found = Vec::new();
        let mut rest = &stream[..];
        for cut in cuts.iter().cycle() {
            let (piece, behind) = rest.split_at((*cut).min(rest.len()));
            found.extend(payloads(&mut framer, piece));
            rest = behind;
            if rest.is_empty() { break; }
        }
        prop_assert_eq!(found, messages);
        prop_assert_eq!((framer.checksum_errors(), framer.skipped_bytes()), (0, 0));
    }

    #[test]
    fn noise_never_panics_and_every_byte_is_accounted_for(noise in prop::collection::vec(
        prop_oneof![3 => any::<u8>(), 1 => Just(0xFAu8), 1 => Just(0xFBu8), 1 => 0u8..8], 0..2000)) {
        let mut framer = Framer::new();
        let mut in_packets = 0;
        for payload in payloads(&mut framer, &noise) {
            in_packets += payload.len() + OVERHEAD;
            if let Some(request) = Request::parse(&payload) {
                let _ = (request.integer(), request.text(), request.long(1), unpack_wheels(request.integer()));
            }
        }
        framer.clear();
        prop_assert_eq!(in_packets as u64 + framer.skipped_bytes(), noise.len() as u64);
    }

    #[test]
    fn cutting_does_not_change_what_is_found_in_noise(noise in prop::collection::vec(
        prop_oneof![2 => any::<u8>(), 2 => Just(0xFAu8), 2 => Just(0xFBu8), 2 => 0u8..6], 0..400)) {
        let whole = payloads(&mut Framer::new(), &noise);
        let mut framer = Framer::new();
        let single: Vec<_> = noise.iter().flat_map(|byte| payloads(&mut framer, &[*byte])).collect();
        prop_assert_eq!(whole, single);
    }
}
