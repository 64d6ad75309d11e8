//! The start-ups of independent clients, command by command as their sources and our captures show them: each command is
//! answered as the suite wants, and the scans come that the client has asked for.
//!
//! SICK: sicktoolbox, Player, MRPT, AriaCoda. SCIP 2.0: urg_library, hokuyolx, MRPT, AriaCoda.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking, also in its helpers")]

mod support;

use drivers::laser::conformance::{Server, listen};
use drivers::lms200::conformance::telegrams;
use drivers::lms200::protocol::{Scan, mode, push};
use drivers::urg::conformance::messages;
use drivers::urg::protocol::Reply;
use drivers::{lms200, urg};
use simulator::Realism;
use support::lasers::Wire;

/// `20 00` and the password.
fn install() -> Vec<u8> {
    [&[0x20, mode::INSTALL], mode::PASSWORD].concat()
}

/// `77`: the configuration as the laser has told it, its first `bytes`, in millimetres.
fn configure(told: &[u8], bytes: usize) -> Vec<u8> {
    let mut config = told[1..=bytes].to_vec();
    config[lms200::model::UNIT] = 1;
    [&[0x77], &config[..]].concat()
}

/// Sends a telegram; gives its answer, which the suite has judged. Scans in between are left out.
fn ask(laser: &mut Wire, body: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::new();
    push(&mut bytes, 0, body);
    laser.send(&bytes);
    let (answers, (acknowledged, refused)) = telegrams(&listen(laser, 0.5));
    assert_eq!((acknowledged, refused), (1, 0), "{body:02X?}");
    let answer = answers.into_iter().find(|answer| !matches!(answer[0], 0xB0 | 0xB7)).unwrap();
    lms200::conformance::judge(body, &answer).unwrap_or_else(|what| panic!("{body:02X?}: {what}"));
    assert_ne!(answer[0], 0x92, "{body:02X?} is not understood");
    answer
}

/// Values of each scan of the next second, the first one's number before them.
fn streamed(laser: &mut Wire) -> Vec<(usize, usize)> {
    let (found, _) = telegrams(&listen(laser, 1.0));
    found.iter().filter_map(|body| Scan::parse(body)).map(|scan| (scan.first, scan.iter().count())).collect()
}

fn check_streams(client: &str, laser: &mut Wire, first: usize, count: usize) {
    let scans = streamed(laser);
    assert!(scans.len() >= 2, "{client}: {} scans", scans.len());
    assert!(scans.iter().all(|scan| *scan == (first, count)), "{client}: {scans:?}");
}

#[test]
fn sicktoolbox_starts_and_leaves() {
    let mut laser = Wire::new("lms200", Realism::none());
    for body in [&[0x20, 0x40][..], &[0x20, 0x25], &[0x3A], &[0x31], &[0x74], &[0x20, 0x24]] {
        ask(&mut laser, body);
    }
    check_streams("sicktoolbox", &mut laser, 0, 181);
    for body in [&[0x20, 0x25][..], &[0x20, 0x42]] {
        ask(&mut laser, body);
    }
    listen(&mut laser, 0.5);
    assert_eq!(streamed(&mut laser), []);
}

#[test]
fn player_starts_with_a_short_configuration_and_streams_a_part() {
    let mut laser = Wire::new("lms200", Realism::none());
    ask(&mut laser, &[0x20, 0x25]);
    ask(&mut laser, &[0x3A]);
    assert_eq!(ask(&mut laser, &install())[1], 0);
    ask(&mut laser, &[0x31]);
    let told = ask(&mut laser, &[0x74]);
    assert_eq!(ask(&mut laser, &configure(&told, 7))[1], 1, "seven bytes are a configuration");
    assert_eq!(ask(&mut laser, &[0x20, 0x27, 1, 0, 181, 0])[1], 0);
    check_streams("Player", &mut laser, 0, 181);
}

#[test]
fn mrpt_starts_with_half_degrees() {
    let mut laser = Wire::new("lms200", Realism::none());
    ask(&mut laser, &[0x20, 0x25]);
    ask(&mut laser, &[0x31]);
    assert_eq!(ask(&mut laser, &install())[1], 0);
    let told = ask(&mut laser, &[0x74]);
    assert_eq!(ask(&mut laser, &configure(&told, 34))[1], 1);
    ask(&mut laser, &[0x20, 0x25]);
    assert_eq!(ask(&mut laser, &[0x3B, 180, 0, 50, 0])[..6], [0xBB, 1, 180, 0, 50, 0]);
    ask(&mut laser, &[0x20, 0x24]);
    check_streams("MRPT", &mut laser, 0, 361);
}

#[test]
fn ariacoda_starts_from_a_reset_with_a_resolution_of_zero() {
    let mut laser = Wire::new("lms200", Realism::none());
    let mut reset = Vec::new();
    push(&mut reset, 0, &[0x10]);
    laser.send(&reset);
    let (answers, _) = telegrams(&listen(&mut laser, 1.0));
    // It waits for the telegram of power-on.
    assert!(answers.iter().any(|answer| answer[0] == 0x90 && answer[1..].starts_with(b"LMS")), "{answers:02X?}");
    ask(&mut laser, &[0x20, 0x40]);
    assert_eq!(ask(&mut laser, &[0x3B, 180, 0, 0, 0])[1], 1, "zero leaves the resolution as it is");
    assert_eq!(ask(&mut laser, &install())[1], 0);
    let told = ask(&mut laser, &[0x74]);
    assert_eq!(ask(&mut laser, &configure(&told, 32))[1], 1);
    ask(&mut laser, &[0x20, 0x24]);
    check_streams("AriaCoda", &mut laser, 0, 181);
}

/// Sends lines one by one: each is echoed with its status. Gives the scans that follow the last one.
fn converse(model: &str, lines: &[(&str, &str)]) -> (Wire, Vec<Vec<u8>>) {
    let mut laser = Wire::new(model, Realism::none());
    let mut scans = Vec::new();
    for (line, status) in lines {
        laser.send(format!("{line}\n").as_bytes());
        let heard = messages(&listen(&mut laser, 0.4));
        heard
            .iter()
            .try_for_each(|message| urg::conformance::judge(message))
            .unwrap_or_else(|what| panic!("{line}: {what}"));
        let replies: Vec<Reply> = heard.iter().map(|message| Reply::parse(message).unwrap()).collect();
        let own = replies.iter().find(|reply| reply.echo == line.as_bytes()).map(|reply| reply.status);
        assert_eq!(
            own.map(|own| String::from_utf8_lossy(&own).into_owned()).as_deref(),
            Some(*status),
            "{model} {line}"
        );
        scans = heard.iter().filter(|message| Reply::parse(message).unwrap().status == *b"99").cloned().collect();
    }
    (laser, scans)
}

/// The area in digits, as PP tells it.
fn area(model: &str) -> (String, usize) {
    let (_, sensor) = urg::model::named(model).unwrap();
    let whole = sensor.whole(1);
    (format!("{:04}{:04}", whole.start, whole.end), whole.count())
}

const MODELS: [&str; 3] = ["urg-04lx", "utm-30lx", "ust-10lx"];

fn characters(message: &[u8]) -> usize {
    // Behind echo, status and stamp: lines of 64 characters and a sum.
    message.split(|byte| *byte == b'\n').skip(3).filter(|line| !line.is_empty()).map(|line| line.len() - 1).sum()
}

#[test]
fn urg_library_starts_streams_and_leaves() {
    for model in MODELS {
        let (area, count) = area(model);
        let stream = format!("MD{area}01000");
        let (mut laser, scans) = converse(model, &[("QT", "00"), ("PP", "00"), (&stream, "00")]);
        assert!(!scans.is_empty() && scans.iter().all(|scan| characters(scan) == 3 * count), "{model}");
        laser.send(b"QT\n");
        listen(&mut laser, 0.2);
        assert!(listen(&mut laser, 0.5).is_empty(), "{model} streams on");
        // One scan on request.
        let get = format!("GD{area}01");
        let (_, scans) = converse(model, &[("QT", "00"), ("PP", "00"), ("BM", "00"), (&get, "00"), ("QT", "00")]);
        assert!(scans.is_empty());
    }
}

#[test]
fn hokuyolx_sets_its_clock_and_asks_for_counted_scans() {
    for model in MODELS {
        let (area, count) = area(model);
        let (get, stream) = (format!("GD{area}01"), format!("MD{area}01005"));
        let mut lines = vec![("%ST", "00"), ("TM0", "00")];
        lines.extend([("TM1", "00"); 10]);
        lines.extend([("TM2", "00"), ("PP", "00"), ("BM", "00"), (&get, "00"), (&stream, "00")]);
        let (mut laser, mut scans) = converse(model, &lines);
        scans.extend(messages(&listen(&mut laser, 1.0)));
        let left: Vec<&[u8]> = scans.iter().map(|scan| &scan[13..15]).collect();
        assert_eq!(left, [b"04", b"03", b"02", b"01", b"00"], "{model} counts down");
        assert!(scans.iter().all(|scan| characters(scan) == 3 * count), "{model}");
    }
}

#[test]
fn mrpt_starts_from_either_dialect() {
    for model in MODELS {
        let (area, count) = area(model);
        let stream = format!("MD{area}01000");
        let lines = [
            ("QT", "00"),
            ("QT", "00"),
            ("SCIP2.0", "0E"),
            ("BM", "00"),
            ("HS0", "00"),
            ("PP", "00"),
            ("VV", "00"),
            (&stream, "00"),
        ];
        let (_, scans) = converse(model, &lines);
        assert!(!scans.is_empty() && scans.iter().all(|scan| characters(scan) == 3 * count), "{model}");
    }
}

#[test]
fn ariacoda_resets_and_asks_for_a_rate() {
    for (model, rate) in [("urg-04lx", "00"), ("utm-30lx", "00"), ("ust-10lx", "0F")] {
        let (area, count) = area(model);
        let stream = format!("MS{area}01000");
        let lines = [
            ("RS", "00"),
            ("SCIP2.0", "0E"),
            ("RS", "00"),
            ("VV", "00"),
            ("SS115200", rate),
            ("PP", "00"),
            (&stream, "00"),
        ];
        let (_, scans) = converse(model, &lines);
        assert!(!scans.is_empty() && scans.iter().all(|scan| characters(scan) == 2 * count), "{model}");
    }
}

#[test]
fn a_rate_is_set_once_and_only_where_the_model_has_a_line() {
    let lines = [("SS115200", "00"), ("SS115200", "03"), ("SS123456", "04"), ("SS11520x", "01"), ("SS1152", "0F")];
    converse("urg-04lx", &lines);
    converse("ust-10lx", &[("SS115200", "0F")]);
}
