//! The node `governor` on a bench, and the arbiter that follows it.
#![allow(clippy::unwrap_used, reason = "tests")]

use coordinator::arbiter::Arbiter;
use coordinator::governor::Governor;
use messages::{Governance, MotionState, Stop, SupervisorState, path_number};
use runtime::{Bench, Body, OpenError, SUPERVISOR_STATE, Time};

const RULES: &str = r#"
rules = [
    { when = "limp >= 1", mode = "crawl" },
    { when = "danger > 0.6", mode = "avoid" },
    { when = "always", mode = "wander" },
]
"#;

fn at(s: f64) -> Time {
    Time::from_seconds(s)
}

fn governor() -> Bench<Governor> {
    Bench::<Governor>::builder(RULES).build().unwrap()
}

fn refused(config: &str) -> String {
    match Bench::<Governor>::builder(config).build() {
        Err(OpenError::Config { reason }) => reason,
        other => panic!("it was accepted: {:?}", other.map(|_| ())),
    }
}

/// What is wanted, and why.
fn wish(bench: &Bench<Governor>) -> (Governance, String) {
    let (_, wish, tail) = bench.read::<Governance>("state").unwrap();
    (wish, String::from_utf8(tail).unwrap())
}

/// Room ahead for this share of the full speed.
fn room(bench: &mut Bench<Governor>, s: f64, share: f64) {
    let forward_limit_m_s = share * Body::default().max_forward_m_s;
    let stop = Stop::None as u32;
    bench.feed("motion", at(s), &MotionState { forward_limit_m_s, stop, ..MotionState::default() }, &[]);
}

#[test]
fn what_stands_ahead_decides_and_the_reason_is_told_in_words() {
    let mut bench = governor();
    room(&mut bench, 1.0, 1.0);
    bench.step(at(1.0)).unwrap();
    let (state, reason) = wish(&bench);
    assert_eq!((state.decisions, state.rule, state.mode), (1, 2, path_number("wander")));
    assert_eq!(reason, "wander: always");
    room(&mut bench, 1.2, 0.25);
    bench.step(at(1.2)).unwrap();
    let (state, reason) = wish(&bench);
    assert_eq!((state.decisions, state.rule, state.mode), (2, 1, path_number("avoid")));
    assert_eq!(reason, "avoid: danger > 0.6 (danger = 0.750)");
    room(&mut bench, 1.4, 1.0);
    bench.step(at(1.4)).unwrap();
    assert_eq!(wish(&bench).0.decisions, 2, "it dwells");
}

#[test]
fn limp_mode_stands_above_everything() {
    let mut bench = governor();
    room(&mut bench, 1.0, 0.1);
    bench.feed_member(SUPERVISOR_STATE, at(1.0), &SupervisorState { limp: 1, ..SupervisorState::default() });
    bench.step(at(1.0)).unwrap();
    assert_eq!(wish(&bench).0.mode, path_number("crawl"));
}

#[test]
fn rules_that_cannot_work_are_refused_with_where_and_why() {
    assert!(refused("").contains("rules is empty"));
    let unknown = refused("rules = [{ when = \"dagner > 1\", mode = \"home\" }]");
    assert!(unknown.contains("there is no signal \"dagner\""), "{unknown}");
}

#[test]
fn the_arbiter_follows_each_decision_once_so_that_an_operator_can_overrule_it() {
    let modes = "modes = [{ name = \"wander\" }, { name = \"avoid\" }, { name = \"crawl\" }]";
    let mut bench = Bench::<Arbiter>::builder(modes).set("proposals", "/actions/*/proposal").build().unwrap();
    let mode = |bench: &Bench<Arbiter>| bench.read::<messages::CoordinatorState>("state").unwrap().1.mode;
    let mut wish = Governance { decisions: 1, mode: path_number("avoid"), ..Governance::default() };
    bench.feed("governor", at(1.0), &wish, &[]);
    bench.step(at(1.0)).unwrap();
    assert_eq!(mode(&bench), 1);
    bench.call("set_mode", &messages::SetMode { mode: 2 });
    bench.step(at(1.1)).unwrap();
    assert_eq!(mode(&bench), 2);
    bench.feed("governor", at(1.2), &wish, &[]);
    bench.step(at(1.2)).unwrap();
    assert_eq!(mode(&bench), 2, "the same decision again is none");
    wish = Governance { decisions: 2, rule: 1, mode: path_number("wander"), ..Governance::default() };
    bench.feed("governor", at(1.3), &wish, &[]);
    bench.step(at(1.3)).unwrap();
    assert_eq!(mode(&bench), 0);
    wish = Governance { decisions: 3, rule: 1, mode: path_number("fly"), ..Governance::default() };
    bench.feed("governor", at(1.4), &wish, &[]);
    bench.step(at(1.4)).unwrap();
    assert_eq!(mode(&bench), 0, "a mode that it does not have changes nothing");
}
