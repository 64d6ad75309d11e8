//! Robot files, worlds, recordings and the clients of simulated lasers: every seed of the fuzz corpus, and seeded mutations
//! of each, through its target.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking, also in its helpers")]

#[path = "../../drivers/fuzz/files.rs"]
mod files;

#[path = "../../drivers/fuzz/mutations.rs"]
mod mutations;

#[test]
fn every_seed_of_the_corpus_passes_and_so_do_its_neighbours() {
    for (name, target) in files::TARGETS {
        mutations::run(name, target, mutations::share_of(files::TARGETS.len(), 3.0));
    }
}
