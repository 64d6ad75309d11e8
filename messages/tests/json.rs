//! Messages as JSON and back.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking, also in its helpers")]

mod shipped;

use messages::{Beam, Command, Kind, Message, Odometry, Ranges, Schema, Twist, from_json_value, to_json_value};
use proptest::prelude::*;
use proptest::test_runner::TestRunner;
use serde_json::{Value, json};
use shipped::every_message;

/// Any bytes, with enough small numbers among them that named values occur.
fn bytes(length: usize) -> impl Strategy<Value = Vec<u8>> {
    let words = prop_oneof![any::<[u8; 8]>(), (0u8..8).prop_map(|small| [small, 0, 0, 0, small, 0, 0, 0])];
    prop::collection::vec(words, length.div_ceil(8)).prop_map(move |words| {
        let mut bytes = words.concat();
        bytes.truncate(length);
        bytes
    })
}

/// The same bytes with every NaN replaced by the canonical one, as JSON does.
fn canonical(schema: &Schema, bytes: &mut [u8]) {
    for field in &schema.fields {
        let whole = &mut bytes[field.offset..field.offset + field.size()];
        for part in whole.chunks_exact_mut(field.kind.size()) {
            canonical_element(&field.kind, part);
        }
    }
}

fn canonical_element(kind: &Kind, part: &mut [u8]) {
    match kind {
        Kind::Struct(inner) => canonical(inner, part),
        Kind::F32 if f32::from_le_bytes(part.try_into().unwrap()).is_nan() => {
            part.copy_from_slice(&f32::NAN.to_le_bytes())
        }
        Kind::F64 if f64::from_le_bytes(part.try_into().unwrap()).is_nan() => {
            part.copy_from_slice(&f64::NAN.to_le_bytes())
        }
        _ => {}
    }
}

fn round_trips<M: Message>() {
    let schema = M::schema();
    let element = schema.tail.clone();
    let tail_bytes = element.as_ref().map_or(0, |element| element.size());
    let samples = (bytes(schema.size), (0usize..4).prop_flat_map(move |count| bytes(count * tail_bytes)));
    let outcome = TestRunner::default().run(&samples, |(fixed, tail)| {
        let text = schema.to_json(&fixed, &tail).to_string();
        let read = schema.from_json(&serde_json::from_str(&text).unwrap()).unwrap();
        let (mut fixed, mut tail) = (fixed, tail);
        canonical(&schema, &mut fixed);
        if let Some(element) = &element {
            tail.chunks_exact_mut(element.kind.size()).for_each(|part| canonical_element(&element.kind, part));
        }
        prop_assert_eq!(read, (fixed, tail), "{}", text);
        Ok(())
    });
    if let Err(failure) = outcome {
        panic!("{}: {failure}", M::NAME);
    }
}

#[test]
fn every_message_survives_a_round_trip_bit_for_bit_but_for_the_payload_of_nans() {
    every_message!(round_trips);
}

fn beam(range_m: f32, echo: u32) -> Beam {
    Beam { origin_x_m: 0.1, origin_y_m: -0.0, bearing_rad: 1.5, range_m, age_s: 0.0, echo }
}

#[test]
fn a_message_reads_as_its_author_would_write_it() {
    let ranges = Ranges { min_range_m: 0.1, max_range_m: f32::INFINITY, beam_width_rad: f32::NAN, span_s: 1e-9 };
    assert_eq!(
        to_json_value(&ranges, &[beam(2.5, 1), beam(f32::NEG_INFINITY, 99)]).to_string(),
        concat!(
            r#"{"min_range_m":0.1,"max_range_m":"inf","beam_width_rad":"nan","span_s":1e-9,"tail":["#,
            r#"{"origin_x_m":0.1,"origin_y_m":-0.0,"bearing_rad":1.5,"range_m":2.5,"age_s":0.0,"echo":"value"},"#,
            r#"{"origin_x_m":0.1,"origin_y_m":-0.0,"bearing_rad":1.5,"range_m":"-inf","age_s":0.0,"echo":99}]}"#,
        )
    );
}

#[test]
fn the_typed_form_gives_back_what_it_was_given() {
    let ranges = Ranges { min_range_m: 0.1, max_range_m: 5.0, beam_width_rad: 0.26, span_s: 0.04 };
    let beams = vec![beam(1.0, 1), beam(0.0, 6)];
    assert_eq!(from_json_value(&to_json_value(&ranges, &beams)), Ok((ranges, beams)));
}

#[test]
fn integers_are_exact_to_the_last_bit() {
    let command = Command { enable: u64::MAX, ..Command::default() };
    let text = to_json_value(&command, &[]).to_string();
    assert!(text.ends_with("\"enable\":18446744073709551615}"), "{text}");
    let (read, _) = from_json_value::<Command>(&serde_json::from_str(&text).unwrap()).unwrap();
    assert_eq!(read.enable, u64::MAX);
}

#[test]
fn a_whole_number_is_a_float_too() {
    let twist = json!({"linear_x_m_s": 1, "linear_y_m_s": -2, "angular_z_rad_s": 0});
    let expected = Twist { linear_x_m_s: 1.0, linear_y_m_s: -2.0, angular_z_rad_s: 0.0 };
    assert_eq!(from_json_value(&twist), Ok((expected, vec![])));
}

#[test]
fn bytes_cut_short_show_as_null() {
    let schema = Twist::schema();
    assert_eq!(
        schema.to_json(&[0; 20], &[1, 2, 3]).to_string(),
        r#"{"linear_x_m_s":0.0,"linear_y_m_s":0.0,"angular_z_rad_s":null}"#
    );
    assert_eq!(Ranges::schema().to_json(&[0; 16], &[0; 30])["tail"].as_array().unwrap().len(), 1);
}

fn complaint<M: Message>(value: Value) -> String {
    M::schema().from_json(&value).unwrap_err().to_string()
}

/// A default command with one value replaced or removed.
fn command(pointer: &str, value: Option<Value>) -> Value {
    let mut command = to_json_value(&Command::default(), &[]);
    let (parent, key) = pointer.rsplit_once('/').unwrap();
    let parent = command.pointer_mut(parent).unwrap().as_object_mut().unwrap();
    match value {
        Some(value) => parent.insert(key.to_owned(), value),
        None => parent.shift_remove(key),
    };
    command
}

#[test]
fn a_missing_field_is_named_by_its_path() {
    assert_eq!(
        complaint::<Command>(command("/velocity/linear_x_m_s", None)),
        "`velocity.linear_x_m_s` of Command: missing; give a number, \"nan\", \"inf\" or \"-inf\" [m/s]"
    );
    assert_eq!(
        complaint::<Ranges>(json!({"min_range_m": 0, "max_range_m": 1, "beam_width_rad": 0, "span_s": 0})),
        "`tail` of Ranges: missing; give an array, each element an object, \
         Beam {origin_x_m, origin_y_m, bearing_rad, range_m, age_s, echo}"
    );
}

#[test]
fn an_unknown_key_brings_the_nearest_one() {
    assert_eq!(
        complaint::<Command>(command("/velocity/linear_x_ms", Some(json!(1)))),
        "`velocity.linear_x_ms` of Command: no such field; did you mean `linear_x_m_s`? \
         (known: linear_x_m_s, linear_y_m_s, angular_z_rad_s)"
    );
    assert_eq!(
        complaint::<Command>(command("/tail", Some(json!([])))),
        "`tail` of Command: no such field; known: velocity, valid_for_s, enable"
    );
}

#[test]
fn a_wrong_type_says_what_is_there_and_what_should_be() {
    let cases = [
        ("/velocity", json!([0.2, 0, 0]), "`velocity` of Command: is an array of 3, but must be an object, Twist {"),
        (
            "/valid_for_s",
            json!("soon"),
            "`valid_for_s` of Command: is the string \"soon\", but must be a number, \"nan\"",
        ),
        ("/valid_for_s", json!(null), "is null, but must be a number"),
        ("/enable", json!(true), "is true, but must be an integer from 0 to 18446744073709551615"),
        ("/enable", json!(1.5), "is 1.5, but must be an integer"),
        ("/enable", json!(-1), "is -1, but must be an integer from 0"),
        ("/enable", json!("x".repeat(1000)), "…, but must be an integer"),
    ];
    for (pointer, value, expected) in cases {
        let complaint = complaint::<Command>(command(pointer, Some(value)));
        assert!(complaint.contains(expected), "expected {expected:?} in {complaint:?}");
        assert!(complaint.len() < 200, "too long to read: {complaint}");
    }
    assert!(complaint::<Command>(json!(7)).starts_with("Command: is 7, but must be an object, Command {velocity"));
}

#[test]
fn places_in_arrays_and_tails_are_counted_from_zero() {
    let mut ranges = to_json_value(&Ranges::default(), &[beam(1.0, 1), beam(1.0, 1)]);
    ranges["tail"][1]["echo"] = json!("to_near");
    assert_eq!(
        complaint::<Ranges>(ranges.clone()),
        "`tail[1].echo` of Ranges: \"to_near\" is none of its values; did you mean `too_near`? \
         (known: none, value, clear, too_near, off, link_lost, fault)"
    );
    ranges["tail"][1]["echo"] = json!(1u64 << 32);
    assert!(complaint::<Ranges>(ranges).contains("is 4294967296, but must be one of none, value"));

    let mut odometry = to_json_value(&Odometry::default(), &[]);
    odometry["pose_covariance"][3] = json!({});
    assert!(complaint::<Odometry>(odometry.clone()).starts_with("`pose_covariance[3]` of Odometry: is an object, but"));
    odometry["pose_covariance"] = json!([1, 2]);
    assert_eq!(
        complaint::<Odometry>(odometry),
        "`pose_covariance` of Odometry: is an array of 2, but must be an array of exactly 9, each a number, \
         \"nan\", \"inf\" or \"-inf\" [m², m·rad, rad²]"
    );
}

#[test]
fn numbers_that_do_not_fit_are_refused_and_the_greatest_that_fit_are_not() {
    #[derive(Debug, Clone, Copy, PartialEq, Message)]
    #[repr(C)]
    struct Small {
        float: f32,
        signed: i8,
        unsigned: u8,
        wide: i16,
    }
    let read = |float: f64, signed: i64, unsigned: u64, wide: i64| {
        from_json_value::<Small>(&json!({"float": float, "signed": signed, "unsigned": unsigned, "wide": wide}))
    };
    let greatest = Small { float: f32::MAX, signed: i8::MIN, unsigned: u8::MAX, wide: i16::MAX };
    assert_eq!(read(f32::MAX.into(), -128, 255, 32767), Ok((greatest, vec![])));
    for (wrong, path) in [
        (read(1e39, 0, 0, 0), "float"),
        (read(0.0, -129, 0, 0), "signed"),
        (read(0.0, 128, 0, 0), "signed"),
        (read(0.0, 0, 256, 0), "unsigned"),
        (read(0.0, 0, 0, 32768), "wide"),
    ] {
        assert_eq!(wrong.unwrap_err().path, path);
    }
}
