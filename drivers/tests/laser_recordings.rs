//! The drivers against conversations in which the client was not ours; their origin is in `fixtures/lasers/README.md`.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking, also in its helpers")]

mod support;

use drivers::laser::{Event, News, Session as _};
use drivers::{lms200, urg};
use messages::Echo;
use runtime::Time;
use std::io::Read;
use support::lasers::{Lms, Scanner, Scip};

/// All that one side has sent, in pieces as they were read.
fn said(name: &str, way: &str) -> Vec<Vec<u8>> {
    let path = format!("{}/tests/fixtures/lasers/{name}.txt.gz", env!("CARGO_MANIFEST_DIR"));
    let mut text = String::new();
    flate2::read::GzDecoder::new(std::fs::File::open(path).unwrap()).read_to_string(&mut text).unwrap();
    let byte = |hex: &str, at: usize| u8::from_str_radix(&hex[at..at + 2], 16).unwrap();
    text.lines()
        .map(|line| line.split_whitespace().collect::<Vec<_>>())
        .filter(|words| words[1] == way)
        .map(|words| (0..words[2].len()).step_by(2).map(|at| byte(words[2], at)).collect())
        .collect()
}

/// Distances of the room in `tests/peers/lasers/world.toml`, as far as its walls: within 3 to 5 m, but for the post.
fn is_room(range_m: f32) -> bool {
    (1.9..5.1).contains(&range_m)
}

#[test]
fn every_reply_that_hokuyolx_and_mrpt_got_passes_the_suite_of_the_scanners() {
    for name in ["hokuyolx__ust-10lx", "mrpt__ust-10lx"] {
        let messages = urg::conformance::messages(&said(name, "S>C").concat());
        let scans = messages.iter().filter(|message| message.starts_with(b"MD")).count();
        assert!(scans >= 8, "{name}: {scans} scans");
        for message in &messages {
            urg::conformance::judge(message).unwrap_or_else(|what| panic!("{name}: {what}"));
        }
    }
}

#[test]
fn every_answer_that_mrpt_got_passes_the_suite_of_the_lms() {
    let (answers, (acknowledged, refused)) = lms200::conformance::telegrams(&said("mrpt__lms200", "S>C").concat());
    let mut framer = lms200::framer::Framer::new(false);
    let asked = said("mrpt__lms200", "C>S").concat();
    let mut requests = Vec::new();
    let mut rest = &asked[..];
    while let Some(body) = framer.next(&mut rest) {
        requests.push(body.to_vec());
    }
    assert_eq!((framer.sum_errors(), refused), (0, 0));
    assert_eq!(acknowledged as usize, requests.len());
    let mut others = answers.iter().filter(|answer| answer[0] != 0xB0);
    for request in &requests {
        lms200::conformance::judge(request, others.next().unwrap()).unwrap();
    }
    let scans: Vec<_> = answers.iter().filter(|answer| answer[0] == 0xB0).collect();
    assert!(scans.len() >= 8, "{} scans", scans.len());
    scans.iter().for_each(|scan| lms200::conformance::judge(&[0x30, 1], scan).unwrap());
}

#[test]
fn our_session_reads_the_scans_that_mrpt_got_of_the_scanner() {
    let mut scanner = Scip::default();
    scanner.pretend("UST-10LX");
    let mut session = urg::session::Session::new(urg::session::SessionConfig::default());
    let mut now = Time::from_seconds(5.0);
    session.port(now, urg::session::Port::Open(1));
    while let Some(request) = session.next_request(now) {
        let answer = scanner.hear(request.as_bytes());
        session.receive(now, now, &answer, |_| {});
        session.tick(now, |_| {});
    }
    let mut scans = 0;
    for piece in said("mrpt__ust-10lx", "S>C") {
        now = now.after_s(0.02);
        session.receive(now, now, &piece, |event| {
            let Event::Scan(News { beams, .. }) = event else { return };
            scans += 1;
            assert!(beams.iter().filter(|beam| is_room(beam.range_m)).count() > 1050);
        });
        session.tick(now, |_| {});
    }
    assert!(scans >= 8 && session.is_running(), "{scans} scans");
    assert_eq!(session.state().damaged, 0, "no damaged message");
}

#[test]
fn our_session_reads_the_scans_that_mrpt_got_of_the_lms() {
    let mut laser = Lms::default();
    // As MRPT has configured it: 32 m in millimetres and a field's flag.
    laser.config[lms200::model::MEASURING_MODE] = 6;
    let config = lms200::session::SessionConfig {
        variant: lms200::model::Variant::of(180, 50),
        ..lms200::session::SessionConfig::default()
    };
    let mut session = lms200::session::Session::new(config);
    let mut now = Time::from_seconds(5.0);
    session.port(now, lms200::session::Port::Open(1));
    while let Some(request) = session.next_request(now) {
        let answer = laser.hear(request.as_bytes());
        session.receive(now, now, &answer, |_| {});
        session.tick(now, |_| {});
    }
    let mut scans = 0;
    for piece in said("mrpt__lms200", "S>C") {
        now = now.after_s(0.02);
        session.receive(now, now, &piece, |event| {
            let Event::Scan(News { beams, .. }) = event else { return };
            scans += 1;
            assert!(beams.iter().filter(|b| b.echo == Echo::Value as u16 && is_room(b.range_m)).count() > 350);
        });
        session.tick(now, |_| {});
    }
    assert!(scans >= 8 && session.is_running(), "{scans} scans");
    assert_eq!(session.state().damaged, 0, "no damaged telegram");
}

#[test]
fn the_suites_refuse_what_is_damaged() {
    let messages = urg::conformance::messages(&said("hokuyolx__ust-10lx", "S>C").concat());
    let scan = messages.iter().find(|message| message.starts_with(b"MD") && message.len() > 1000).unwrap();
    // Behind the echo every byte belongs to a sum.
    for at in (17..scan.len()).step_by(7) {
        let mut damaged = scan.clone();
        damaged[at] ^= 1;
        assert!(urg::conformance::judge(&damaged).is_err(), "byte {at}");
    }
    let (answers, _) = lms200::conformance::telegrams(&said("mrpt__lms200", "S>C").concat());
    let of = |kind: u8| answers.iter().find(|answer| answer[0] == kind).unwrap().clone();
    for (request, kind) in [(0x31, 0xB1), (0x74, 0xF4), (0x77, 0xF7), (0x3B, 0xBB), (0x30, 0xB0)] {
        let answer = of(kind);
        assert!(lms200::conformance::judge(&[request, 1], &answer).is_ok());
        assert!(lms200::conformance::judge(&[request, 1], &answer[..answer.len() - 3]).is_err(), "{kind:02X} cut");
        assert!(lms200::conformance::judge(&[request ^ 1, 1], &answer).is_err(), "{kind:02X} to another question");
    }
}
