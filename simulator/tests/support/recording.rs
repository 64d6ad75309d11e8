//! The recorded conversation between a third-party client and a third-party robot; see the fixture's README.

use drivers::p2os::protocol::Framer;
use std::io::Read;

/// One read of the recorder.
pub struct Line {
    pub at_s: f64,
    /// Whether the client sent it.
    pub from_client: bool,
    pub bytes: Vec<u8>,
}

/// All lines in the order of their times.
pub fn lines() -> Vec<Line> {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/fixtures/pioneer-traces/aria_wander__amrisim.txt.gz");
    let mut text = String::new();
    flate2::read::GzDecoder::new(std::fs::File::open(path).unwrap()).read_to_string(&mut text).unwrap();
    text.lines()
        .map(|line| {
            let words: Vec<&str> = line.split_whitespace().collect();
            let hex = words[2];
            let byte = |at| u8::from_str_radix(&hex[at..at + 2], 16).unwrap();
            Line {
                at_s: words[0].parse().unwrap(),
                from_client: words[1] == "C>S",
                bytes: (0..hex.len()).step_by(2).map(byte).collect(),
            }
        })
        .collect()
}

/// The recorded robot's payloads with the time of their last byte.
pub fn robots_payloads() -> Vec<(f64, Vec<u8>)> {
    let mut framer = Framer::new();
    let mut payloads = Vec::new();
    for line in lines().iter().filter(|line| !line.from_client) {
        let mut bytes = &line.bytes[..];
        while let Some(payload) = framer.next(&mut bytes) {
            payloads.push((line.at_s, payload.to_vec()));
        }
    }
    payloads
}
