//! The recorded conversation between a third-party client and a third-party robot.

use drivers::p2os::protocol::Framer;
use std::io::Read;

/// Who sent the bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum From {
    Client,
    Robot,
}

/// One read of the recorder.
pub struct Line {
    pub at_s: f64,
    pub from: From,
    pub bytes: Vec<u8>,
}

/// All lines in the order of their times.
pub fn lines() -> Vec<Line> {
    let path =
        concat!(env!("CARGO_MANIFEST_DIR"), "/../simulator/tests/fixtures/pioneer-traces/aria_wander__amrisim.txt.gz");
    let mut text = String::new();
    flate2::read::GzDecoder::new(std::fs::File::open(path).unwrap()).read_to_string(&mut text).unwrap();
    text.lines()
        .map(|line| {
            let mut words = line.split_whitespace();
            let at_s = words.next().unwrap().parse().unwrap();
            let from = match words.next().unwrap() {
                "C>S" => From::Client,
                "S>C" => From::Robot,
                other => panic!("direction {other}"),
            };
            let hex = words.next().unwrap();
            let bytes = (0..hex.len()).step_by(2).map(|at| u8::from_str_radix(&hex[at..at + 2], 16).unwrap()).collect();
            Line { at_s, from, bytes }
        })
        .collect()
}

/// The packets of one side with the time of their last byte, and the framer that found them.
pub fn packets(from: From) -> (Vec<(f64, Vec<u8>)>, Framer) {
    let mut framer = Framer::new();
    let mut packets = Vec::new();
    for line in lines().iter().filter(|line| line.from == from) {
        let mut input = &line.bytes[..];
        while let Some(payload) = framer.next(&mut input) {
            packets.push((line.at_s, payload.to_vec()));
        }
    }
    (packets, framer)
}
