//! Makes a list of faults with which a mission fails as short as it gets, and each of them as plain as it gets.
//!
//! Delta debugging (Zeller and Hildebrandt, IEEE TSE 28, 2002): of n parts of the list, is one enough, or can one be
//! left out? Where neither holds the parts become smaller, until no single fault can be left out. Then durations and
//! factors are halved, deaths moved between steps and times rounded, as long as the mission fails.

use std::collections::BTreeSet;
use supervisor::{PlannedFault, When};

/// Below this nothing is halved any more, durations in seconds.
const LEAST: f64 = 1e-3;

/// Whether the mission fails with these faults.
pub type Fails<'a, E> = dyn FnMut(&[PlannedFault]) -> Result<bool, E> + 'a;

/// The faults that are left of `all`, with which the mission fails; it must fail with `all`, and must not without any.
pub fn shrink<E>(all: &[PlannedFault], fails: &mut Fails<'_, E>) -> Result<Vec<PlannedFault>, E> {
    let few = fewest(all, fails)?;
    let plain = plainest(few, fails)?;
    // A plainer fault may do what two did before.
    fewest(&plain, fails)
}

/// A part of `all` of which no fault can be left out.
pub fn fewest<E>(all: &[PlannedFault], fails: &mut Fails<'_, E>) -> Result<Vec<PlannedFault>, E> {
    let pick = |places: &[usize]| places.iter().map(|&place| all[place].clone()).collect::<Vec<PlannedFault>>();
    // Only what passed is looked up again.
    let mut passed: BTreeSet<Vec<usize>> = BTreeSet::new();
    let mut left: Vec<usize> = (0..all.len()).collect();
    let mut parts = 2;
    while left.len() > 1 {
        parts = parts.min(left.len());
        let bounds: Vec<usize> = (0..=parts).map(|k| k * left.len() / parts).collect();
        let part = |k: usize| left[bounds[k]..bounds[k + 1]].to_vec();
        let rest = |k: usize| [&left[..bounds[k]], &left[bounds[k + 1]..]].concat();
        let tries = (0..parts).map(|k| (part(k), 2));
        // Of two parts each is the other's rest.
        let rests = (0..parts).filter(|_| parts > 2).map(|k| (rest(k), (parts - 1).max(2)));
        let mut found = None;
        for (places, next) in tries.chain(rests) {
            if passed.contains(&places) {
                continue;
            }
            if fails(&pick(&places))? {
                found = Some((places, next));
                break;
            }
            passed.insert(places);
        }
        match found {
            Some((places, next)) => (left, parts) = (places, next),
            None if parts == left.len() => break,
            None => parts *= 2,
        }
    }
    Ok(pick(&left))
}

/// The same faults, each as plain as it gets.
pub fn plainest<E>(mut faults: Vec<PlannedFault>, fails: &mut Fails<'_, E>) -> Result<Vec<PlannedFault>, E> {
    for place in 0..faults.len() {
        loop {
            let mut better = None;
            for plainer in plainer(&faults[place]) {
                let mut tried = faults.clone();
                tried[place] = plainer;
                if fails(&tried)? {
                    better = Some(tried);
                    break;
                }
            }
            match better {
                Some(tried) => faults = tried,
                None => break,
            }
        }
    }
    Ok(faults)
}

/// Plainer forms of a fault, the plainest first; each step ends, as every form is smaller or rounder.
fn plainer(fault: &PlannedFault) -> Vec<PlannedFault> {
    let mut forms = Vec::new();
    let mut form = |change: &dyn Fn(&mut PlannedFault)| {
        let mut changed = fault.clone();
        change(&mut changed);
        if changed != *fault {
            forms.push(changed);
        }
    };
    match fault {
        PlannedFault::Death { .. } => form(&|fault| {
            if let PlannedFault::Death { when, writes, .. } = fault {
                (*when, *writes) = (When::AtOnce, 0);
            }
        }),
        PlannedFault::Slowdown { .. } => {
            form(&|fault| {
                if let PlannedFault::Slowdown { for_s, .. } = fault {
                    *for_s = halved(*for_s);
                }
            });
            form(&|fault| {
                if let PlannedFault::Slowdown { factor, .. } = fault {
                    *factor = halved(*factor);
                }
            });
        }
        PlannedFault::Hang { .. }
        | PlannedFault::Burst { .. }
        | PlannedFault::Supervisor { .. }
        | PlannedFault::Command { .. } => form(&|fault| {
            if let PlannedFault::Hang { for_s, .. }
            | PlannedFault::Burst { for_s, .. }
            | PlannedFault::Supervisor { for_s, .. }
            | PlannedFault::Command { for_s, .. } = fault
            {
                *for_s = halved(*for_s);
            }
        }),
        PlannedFault::Stop { .. } => form(&|fault| {
            if let PlannedFault::Stop { gone_after_s, .. } = fault {
                *gone_after_s = halved(*gone_after_s);
            }
        }),
    }
    let at_s = fault.at_s();
    for grid in [1.0, 10.0, 100.0, 1000.0] {
        let rounded_s = (at_s * grid).round() / grid;
        if rounded_s == at_s {
            break;
        }
        forms.push(fault.clone().moved_to(rounded_s));
    }
    forms
}

/// Half of it, in whole thousandths; as it is when that is too little.
fn halved(value: f64) -> f64 {
    let half = (value * 500.0).round() / 1000.0;
    if half < LEAST || half >= value { value } else { half }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::convert::Infallible;

    fn hang(at_s: f64, for_s: f64) -> PlannedFault {
        PlannedFault::Hang { at_s, node: "/drivers/base".into(), for_s }
    }

    fn run(count: u32, wanted: impl Fn(&[PlannedFault]) -> bool) -> (Vec<PlannedFault>, u32) {
        let all: Vec<PlannedFault> = (0..count).map(|k| hang(f64::from(k) + 0.123_456, 4.0)).collect();
        let mut runs = 0;
        let mut fails = |faults: &[PlannedFault]| {
            runs += 1;
            Ok::<bool, Infallible>(wanted(faults))
        };
        let left = shrink(&all, &mut fails).unwrap();
        (left, runs)
    }

    fn has(faults: &[PlannedFault], second: f64) -> bool {
        faults.iter().any(|fault| fault.at_s().floor() == second)
    }

    #[test]
    fn two_faults_that_only_fail_together_are_found_among_many() {
        let (left, runs) = run(64, |faults| has(faults, 7.0) && has(faults, 50.0));
        let expected = [hang(7.0, LEAST), hang(50.0, LEAST)];
        assert_eq!(left, expected);
        assert!(runs < 200, "{runs}");
    }

    #[test]
    fn one_fault_is_halved_and_rounded_as_long_as_the_mission_fails() {
        let long = |fault: &PlannedFault| matches!(fault, PlannedFault::Hang { for_s, .. } if *for_s >= 0.3);
        let (left, _) = run(33, |faults| faults.iter().any(|f| f.at_s() > 20.1 && f.at_s() < 20.3 && long(f)));
        assert_eq!(left, [hang(20.12, 0.5)], "not at 20.1 s, not half as long");
    }

    #[test]
    fn faults_that_are_all_needed_all_stay() {
        let (left, _) = run(5, |faults| faults.len() == 5);
        assert_eq!(left.len(), 5);
    }

    #[test]
    fn what_is_left_is_the_same_every_time_and_no_fault_of_it_can_be_left_out() {
        // Fails with any three of the even ones, or with 1 and 2 together.
        let odd = |faults: &[PlannedFault]| {
            let even = faults.iter().filter(|fault| fault.at_s().floor() % 2.0 == 0.0).count();
            even >= 3 || (has(faults, 1.0) && has(faults, 2.0))
        };
        let (left, _) = run(20, odd);
        assert_eq!((left.clone(), left.len() <= 3), (run(20, odd).0, true));
        for place in 0..left.len() {
            let mut fewer = left.clone();
            fewer.remove(place);
            assert!(!odd(&fewer));
        }
    }
}
