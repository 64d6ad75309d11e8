//! Runs every seed of the fuzz corpus, and seeded mutations of each, through its target.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking, also in its helpers")]

#[path = "../fuzz/targets.rs"]
mod targets;

#[path = "../fuzz/mutations.rs"]
mod mutations;

#[test]
fn every_seed_of_the_corpus_passes_and_so_do_its_neighbours() {
    for (name, target) in targets::TARGETS {
        mutations::run(name, target, mutations::share_of(targets::TARGETS.len(), 3.0));
    }
}
