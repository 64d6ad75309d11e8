//! What stands in for a fuzzer where there is none: every kept seed, cut at every place, and mutations of it drawn from one
//! seed, for a while.

use runtime::clock;
use std::fs;
use std::path::Path;

/// Mutations that are tried in any case, however slow the machine is.
const LEAST: u32 = 200;

/// The time of one target [s]: all of `targets` take `seconds`, or a minute with SINEW_LONG=1.
pub fn share_of(targets: usize, seconds: f64) -> f64 {
    let long = std::env::var_os("SINEW_LONG").is_some_and(|value| value == "1");
    (if long { 60.0 } else { seconds }) / targets as f64
}

/// Runs the corpus of `name` and what is made of it through `target`.
pub fn run(name: &str, target: fn(&[u8]), seconds: f64) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join(CORPUS).join(name);
    let mut files: Vec<_> = fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.sort();
    let seeds: Vec<Vec<u8>> = files.iter().map(|file| fs::read(file).unwrap()).collect();
    assert!(seeds.len() >= 2, "{} has {} seeds", folder.display(), seeds.len());
    let begun = clock::now();
    for seed in &seeds {
        target(seed);
        let step = seed.len().div_ceil(64).max(1);
        for at in (0..seed.len()).step_by(step) {
            target(&seed[..at]);
            target(&seed[at..]);
        }
    }
    let mut random = 0x9E37_79B9_7F4A_7C15_u64;
    let mut draw = move |below: usize| {
        random ^= random << 13;
        random ^= random >> 7;
        random ^= random << 17;
        (random >> 33) as usize % below.max(1)
    };
    let mut tried = 0;
    while tried < LEAST || clock::now().since(begun) < seconds {
        let mut bytes = seeds[draw(seeds.len())].clone();
        for _ in 0..=draw(4) {
            mutate(&mut bytes, &seeds, &mut draw);
        }
        target(&bytes);
        tried += 1;
    }
}

fn mutate(bytes: &mut Vec<u8>, seeds: &[Vec<u8>], draw: &mut impl FnMut(usize) -> usize) {
    const TELLING: [u8; 12] = [0, 1, 2, 6, b'\n', b'0', b'9', 0x7F, 0x80, 0xFA, 0xFB, 0xFF];
    let at = draw(bytes.len());
    match draw(6) {
        0 if !bytes.is_empty() => bytes[at] ^= 1 << draw(8),
        1 if !bytes.is_empty() => bytes[at] = TELLING[draw(TELLING.len())],
        2 => bytes.insert(at.min(bytes.len()), draw(256) as u8),
        3 if !bytes.is_empty() => {
            let length = draw(16).min(bytes.len() - at);
            bytes.drain(at..at + length);
        }
        // A piece twice, or a piece of another seed.
        4 if !bytes.is_empty() => {
            let piece = bytes[at..bytes.len().min(at + 1 + draw(32))].to_vec();
            bytes.splice(at..at, piece);
        }
        _ => {
            let other = &seeds[draw(seeds.len())];
            let from = draw(other.len());
            let piece = &other[from..other.len().min(from + 1 + draw(64))];
            let at = at.min(bytes.len());
            bytes.splice(at..at, piece.iter().copied());
        }
    }
}

/// Where the corpus lies, seen from either crate whose tests run it.
const CORPUS: &str = "../drivers/fuzz/corpus";
