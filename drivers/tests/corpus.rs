//! Runs every seed of the fuzz corpus, and small mutations of each, through its target.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking, also in its helpers")]

#[path = "../fuzz/targets.rs"]
mod targets;

use std::fs;
use std::path::Path;

#[test]
fn every_seed_of_the_corpus_passes_and_so_do_its_neighbours() {
    for (name, target) in targets::TARGETS {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/corpus").join(name);
        let mut seeds = 0;
        for entry in fs::read_dir(&folder).unwrap() {
            let seed = fs::read(entry.unwrap().path()).unwrap();
            seeds += 1;
            target(&seed);
            for at in 0..seed.len() {
                let mut mutated = seed.clone();
                for value in [0, 1, 0x7F, 0xFA, 0xFB, 0xFF, !seed[at]] {
                    mutated[at] = value;
                    target(&mutated);
                }
                target(&seed[..at]);
                target(&seed[at..]);
            }
        }
        assert!(seeds >= 3, "{} has {seeds} seeds", folder.display());
    }
}
