//! Layouts are a promise to recordings and to other languages.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking, also in its helpers")]

mod shipped;

use std::fmt::Debug;
use std::fs;
use std::path::Path;

use messages::{
    ContactCause, Echo, Encoding, Field, GotoState, Kind, Link, Message, Schema, SegmentShape, Side, Stop, StopCause,
    TrackMotion, TrackState, Wish,
};
use shipped::every_message;

/// Name, size of the fixed part [byte] and layout hash of every shipped message, by name.
const LAYOUTS: &[(&str, usize, u64)] = &[
    ("Axis", 32, 0xbc02_7dd5_ac3d_9736),
    ("BaseState", 64, 0x306b_2454_e681_b2eb),
    ("Beam", 24, 0x7d41_2096_9ad8_e1e6),
    ("Command", 40, 0x5e00_ce3a_2767_8168),
    ("Contact", 32, 0xdbba_cb0a_b290_8f39),
    ("CoordinatorState", 40, 0xdcf1_414a_1e80_6ca4),
    ("Detour", 32, 0x67c0_cd05_421d_bb4e),
    ("Done", 8, 0x920f_09b8_ae5d_0329),
    ("FreeSectors", 152, 0x26eb_558f_ca03_54ee),
    ("GotoGoal", 32, 0x181d_6843_ea13_c8ec),
    ("GotoPath", 408, 0x9020_56b9_973b_6413),
    ("GotoProgress", 56, 0x2fde_93eb_308a_9a71),
    ("GotoResult", 56, 0xca92_93b0_fece_525b),
    ("Governance", 24, 0x9d40_53c3_07be_db94),
    ("Image", 16, 0x02d8_cfcb_2b36_d86e),
    ("InputCursor", 32, 0x4370_2a67_4c35_0c94),
    ("LaserScan", 48, 0xee1c_5d02_7b56_169b),
    ("LaserState", 32, 0x10ca_9f58_5fc3_c53f),
    ("Load", 40, 0x65a8_78c0_bbc1_bf32),
    ("ModeState", 16, 0x655c_3a06_501d_129a),
    ("MotionState", 80, 0x0a96_2901_8dc2_dabd),
    ("MoveProgress", 24, 0x6ba5_19db_660a_eebf),
    ("MoveRequest", 24, 0xa2ec_5c0c_e872_b9fa),
    ("NodeLoad", 96, 0x276c_3770_acbc_a053),
    ("NodePeriod", 16, 0xca2b_760a_dd36_d186),
    ("NodeStatistics", 152, 0x57a9_b8cf_728a_1946),
    ("Notice", 16, 0x2be1_805b_0f50_aa0b),
    ("Odometry", 200, 0xd236_4438_8487_504c),
    ("Periods", 16, 0x8be3_0d15_e4ab_e6d4),
    ("Proposal", 112, 0x1b8f_7b10_6048_5186),
    ("ProtectiveStop", 24, 0x9dd2_4589_9021_958d),
    ("RangerVerdict", 24, 0x2c36_fe30_d74c_1668),
    ("Ranges", 16, 0xd40a_7f3b_a98d_f009),
    ("Room", 56, 0x8ba7_f460_1e08_ed04),
    ("ScanBeam", 8, 0x5241_9a97_92fe_322a),
    ("Segment", 104, 0x9260_6476_fb7f_dc90),
    ("Segments", 16, 0x06d6_2b8c_0505_4ea7),
    ("SetMode", 8, 0xf832_c237_1d7c_26e9),
    ("SetPose", 24, 0x9320_5049_dedd_6b94),
    ("Sound", 16, 0x2b97_d221_0b71_2ccc),
    ("StepEvents", 16, 0xbe5a_8583_77ec_fbb8),
    ("StepInputs", 40, 0xa811_196f_630f_0ed0),
    ("SupervisorState", 24, 0x1dc4_e173_7ec8_64da),
    ("Switch", 8, 0xa461_43bc_51c2_bc5a),
    ("Track", 256, 0xa4ac_1f24_f08a_4da2),
    ("Tracks", 72, 0x29f2_4bea_2f9e_40f1),
    ("Trigger", 8, 0x6991_0448_f9f2_80b7),
    ("Truth", 88, 0x7d1a_fa5b_7340_174b),
    ("Twist", 24, 0x0c66_3de7_b0de_9fd9),
    ("WheelVelocities", 32, 0x9d92_541e_6d2b_e630),
];

fn schema<M: Message>() -> Schema {
    M::schema()
}

#[test]
fn no_layout_changes_by_accident() {
    let schemas = every_message!(schema);
    let changed: Vec<String> = schemas
        .iter()
        .map(|schema| (schema.name.as_str(), schema.size, schema.hash()))
        .filter(|entry| !LAYOUTS.contains(entry))
        .map(|(name, size, hash)| format!("(\"{name}\", {size}, {hash:#018x})"))
        .collect();
    assert!(
        changed.is_empty(),
        "layouts changed: recordings and other languages depend on them; update the table and CHANGELOG if meant: {changed:?}"
    );
    assert_eq!(schemas.len(), LAYOUTS.len(), "the table has a message that is no longer shipped");
}

#[test]
fn the_table_has_every_message_of_the_crate() {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let texts = fs::read_dir(source).unwrap().map(|entry| entry.unwrap().path()).filter(|path| path.is_file());
    let derived: usize = texts.map(|path| fs::read_to_string(path).unwrap().matches(", Message)]").count()).sum();
    assert_eq!(derived, LAYOUTS.len(), "add new messages to tests/shipped and to the table");
}

#[test]
fn the_constants_of_a_message_agree_with_its_schema() {
    fn agrees<M: Message>() -> bool {
        let schema = M::schema();
        let tail_bytes = schema.tail.as_ref().map_or(1, |tail| tail.size());
        (M::NAME, size_of::<M>(), M::HAS_TAIL, size_of::<M::Tail>(), M::layout_hash())
            == (&schema.name, schema.size, schema.tail.is_some(), tail_bytes, schema.hash())
    }
    assert_eq!(every_message!(agrees), [true; LAYOUTS.len()]);
}

#[test]
fn every_schema_reads_back_from_its_text() {
    for schema in every_message!(schema) {
        assert_eq!(Schema::from_text(&schema.to_text()), Ok(schema));
    }
}

#[test]
fn the_name_of_a_shipped_field_says_its_unit() {
    let suffixes = [
        ("m", "_m"),
        ("m/s", "_m_s"),
        ("rad", "_rad"),
        ("rad/s", "_rad_s"),
        ("s", "_s"),
        ("ns", "_ns"),
        ("V", "_v"),
        ("px", "_px"),
        ("byte", "_bytes"),
    ];
    for schema in every_message!(schema) {
        for field in schema.fields.iter().filter(|field| !matches!(field.kind, Kind::Struct(_))) {
            let of_name = suffixes
                .iter()
                .filter(|(_, suffix)| field.name.ends_with(suffix))
                .max_by_key(|(_, suffix)| suffix.len());
            let named = of_name.map(|(unit, _)| *unit);
            // Mixed units are listed with commas and cannot be part of a name.
            let stated = field.unit.as_deref().filter(|unit| !unit.contains(','));
            assert_eq!(named, stated, "{}.{}", schema.name, field.name);
            assert!(!field.doc.is_empty(), "{}.{} says nothing about itself", schema.name, field.name);
        }
    }
}

#[test]
fn the_names_in_the_schemas_are_those_of_the_enums() {
    use {ContactCause::*, Echo::*};
    check::<messages::Beam, _>("echo", [Echo::None, Value, Clear, TooNear, Off, LinkLost, Fault], |echo| echo as u64);
    let link = [Link::Connecting, Link::Up, Link::NoPort, Link::Silent, Link::Lost, Link::Foreign];
    check::<messages::ScanBeam, _>("echo", [Echo::None, Value, Clear, TooNear, Off, LinkLost, Fault], |echo| {
        echo as u64
    });
    check::<messages::BaseState, _>("link", link, |link| link as u64);
    check::<messages::LaserState, _>("link", link, |link| link as u64);
    let encoding = [Encoding::Mono8, Encoding::Rgb8, Encoding::Bgr8, Encoding::Yuyv, Encoding::Jpeg];
    check::<messages::Image, _>("encoding", encoding, |encoding| encoding as u64);
    check::<messages::Axis, _>("wish", [Wish::Abstain, Wish::Exact, Wish::Word], |wish| wish as u64);
    let stop = [Stop::None, Stop::StaleVelocity, Stop::Blind, Stop::Zone, Stop::Bumper, Stop::Stall, Stop::Base];
    let stop = stop.into_iter().chain([Stop::Held, Stop::Limp, Stop::Latch]);
    check::<messages::MotionState, _>("stop", stop, |stop| stop as u64);
    let state = [TrackState::Tentative, TrackState::Confirmed, TrackState::Coasting];
    check::<messages::Track, _>("state", state, |state| state as u64);
    let motion = [TrackMotion::Unknown, TrackMotion::Still, TrackMotion::Moving];
    check::<messages::Track, _>("motion", motion, |motion| motion as u64);
    let shape = [SegmentShape::Speck, SegmentShape::Round, SegmentShape::Straight];
    check::<messages::Segment, _>("shape", shape, |shape| shape as u64);
    let state = [GotoState::Idle, GotoState::Driving, GotoState::Turning, GotoState::Lost];
    check::<messages::GotoProgress, _>("state", state, |state| state as u64);
    let cause = [StopCause::None, StopCause::Bumper, StopCause::Zone, StopCause::Held];
    check::<messages::ProtectiveStop, _>("cause", cause, |cause| cause as u64);
    check::<messages::Room, _>("side", [Side::None, Side::Left, Side::Right], |side| side as u64);
    check::<messages::Detour, _>("side", [Side::None, Side::Left, Side::Right], |side| side as u64);
    check::<messages::Contact, _>("cause", [Drove, ReversedBlind, Suffered], |cause| cause as u64);

    fn check<M: Message, E: Debug + Copy>(field: &str, variants: impl IntoIterator<Item = E>, number: fn(E) -> u64) {
        let schema = M::schema();
        let field: &Field = schema.fields.iter().find(|candidate| candidate.name == field).unwrap();
        let mut count = 0;
        for variant in variants {
            let words = format!("{variant:?}");
            let snake = words.char_indices().fold(String::new(), |snake, (index, letter)| {
                let gap = if index > 0 && letter.is_uppercase() { "_" } else { "" };
                format!("{snake}{gap}{}", letter.to_ascii_lowercase())
            });
            assert_eq!(field.values[number(variant) as usize], snake);
            count += 1;
        }
        assert_eq!(field.values.len(), count, "{} of {} has values without a variant", field.name, schema.name);
    }
}
