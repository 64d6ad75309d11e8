//! The drivers' suites of what every laser must do, run against the simulated ones.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking, also in its helpers")]

mod support;

use drivers::{lms200, urg};
use simulator::Realism;
use support::lasers::Wire;

#[test]
fn the_simulated_lms_does_what_every_lms_must_do() {
    for realism in [Realism::none(), Realism::default()] {
        lms200::conformance::check(&mut Wire::new("lms200", realism)).unwrap_or_else(|failure| panic!("{failure}"));
    }
}

#[test]
fn the_simulated_scip_scanners_do_what_every_scip_scanner_must_do() {
    for model in ["urg-04lx", "utm-30lx", "ust-10lx", "sinew-720"] {
        for realism in [Realism::none(), Realism::default()] {
            let mut wire = Wire::new(model, realism);
            urg::conformance::check(&mut wire).unwrap_or_else(|failure| panic!("{model}: {failure}"));
        }
    }
}
