//! What a supervisor that takes over knows of the one before it: back-offs, intensities, trials, and what holds the robot
//! back. The policy's past goes through the text in which it is left, as between two processes.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking, also in its helpers")]

use runtime::Time;
use supervisor::{
    Action, Adopted, Care, Clear, Event, Exit, Group, Intensity, NodeState, Past, Policy, RobotPast, Rule, Severity,
    Strategy, Supervision,
};

const KILLED: Exit = Exit::Signal { signal: 9, core: false };

fn at(s: f64) -> Time {
    Time::from_seconds(s)
}

fn orders(policy: &mut Policy, now: Time, event: Event) -> Vec<Action> {
    let mut actions = Vec::new();
    policy.handle(now, event, &mut actions);
    actions.into_iter().filter(|action| !matches!(action, Action::Notify(_))).collect()
}

fn running(plan: &Supervision) -> Policy {
    let mut policy = Policy::supervising(plan.clone());
    orders(&mut policy, at(100.0), Event::Begin);
    for node in 0..policy.nodes() {
        orders(&mut policy, at(100.0), Event::Ready { node });
    }
    policy
}

/// The policy of the next supervisor, by what this one would leave it.
fn successor(plan: &Supervision, policy: &Policy, now: Time) -> Policy {
    let mut next = Policy::supervising(plan.clone());
    for node in 0..policy.nodes() {
        let known = match policy.node(node) {
            NodeState::Pausing { until } => Adopted::Pausing { until },
            NodeState::Regrouping { until } => Adopted::Regrouping { until },
            NodeState::Running { since } => Adopted::Alive { ready: true, started: since },
            NodeState::Starting { since } => Adopted::Alive { ready: false, started: since },
            NodeState::GivenUp => Adopted::GivenUp,
            other => panic!("{other:?}"),
        };
        let text = serde_json::to_string(&policy.past(node)).unwrap();
        next.adopt(node, known, &serde_json::from_str::<Past>(&text).unwrap());
    }
    let text = serde_json::to_string(&policy.robot_past()).unwrap();
    next.adopt_robot(now, &serde_json::from_str::<RobotPast>(&text).unwrap());
    next
}

fn one(care: Care) -> Supervision {
    Supervision { nodes: vec![care], ..Supervision::default() }
}

#[test]
fn a_pause_ends_when_it_would_have_ended_and_the_next_one_is_longer() {
    let plan = one(Care::default());
    let mut policy = running(&plan);
    let died = Event::Died { node: 0, exit: KILLED };
    assert_eq!(orders(&mut policy, at(100.5), died), [Action::Start { node: 0 }]);
    assert_eq!(orders(&mut policy, at(100.6), died), [], "0.1 s of back-off");
    let mut next = successor(&plan, &policy, at(100.65));
    assert_eq!(orders(&mut next, at(100.65), Event::Begin), [], "it does not begin anew at once");
    assert_eq!(next.next_timer().map(Time::nanos), policy.next_timer().map(Time::nanos));
    assert_eq!(orders(&mut next, at(100.7), Event::Timer), [Action::Start { node: 0 }]);
    orders(&mut next, at(100.75), died);
    assert!(matches!(next.node(0), NodeState::Pausing { until } if (until.since(at(100.75)) - 0.2).abs() < 1e-9));
}

#[test]
fn restarts_before_the_takeover_count_towards_giving_up() {
    let rule = Rule { intensity: Intensity { restarts: 3, window_s: 60.0 }, ..Rule::default() };
    let plan = one(Care::plain(rule));
    let mut policy = running(&plan);
    let mut now = at(100.0);
    for _ in 0..3 {
        now = now.after_s(10.0);
        assert_eq!(orders(&mut policy, now, Event::Died { node: 0, exit: KILLED }), [Action::Start { node: 0 }]);
        orders(&mut policy, now, Event::Ready { node: 0 });
        policy = successor(&plan, &policy, now);
        orders(&mut policy, now, Event::Begin);
    }
    orders(&mut policy, now.after_s(10.0), Event::Died { node: 0, exit: KILLED });
    assert_eq!(policy.node(0), NodeState::GivenUp);
}

#[test]
fn a_replacement_on_trial_stays_on_trial() {
    let plan = one(Care::default());
    let mut policy = running(&plan);
    let request = supervisor::Request::Replace { node: 0 };
    orders(&mut policy, at(101.0), Event::Call(request));
    orders(&mut policy, at(101.1), Event::StandbyReady { node: 0 });
    orders(&mut policy, at(101.2), Event::Died { node: 0, exit: Exit::Code(0) });
    orders(&mut policy, at(101.3), Event::Ready { node: 0 });
    assert!(policy.on_trial(0));
    let mut next = successor(&plan, &policy, at(101.4));
    orders(&mut next, at(101.4), Event::Begin);
    let actions = orders(&mut next, at(101.5), Event::Died { node: 0, exit: KILLED });
    assert_eq!(actions, [Action::Revert { node: 0 }, Action::Start { node: 0 }]);
    let mut later = successor(&plan, &policy, at(101.4));
    orders(&mut later, at(101.4), Event::Begin);
    assert_eq!(orders(&mut later, at(102.3), Event::Timer), [Action::Accept { node: 0 }]);
}

#[test]
fn what_waits_for_a_person_goes_on_waiting_and_what_was_over_ends_by_itself() {
    let rule = Rule { intensity: Intensity { restarts: 0, window_s: 60.0 }, ..Rule::default() };
    let care = |clear| Care { loss: Severity::Hold, clear, ..Care::plain(rule) };
    let plan = Supervision {
        nodes: vec![care(Clear::Reset), care(Clear::Gone { after_s: 0.5 }), Care::default()],
        ..Supervision::default()
    };
    let mut policy = running(&plan);
    for node in 0..2 {
        orders(&mut policy, at(101.0), Event::Died { node, exit: KILLED });
        orders(&mut policy, at(102.0), Event::Call(supervisor::Request::Start { node }));
        orders(&mut policy, at(102.1), Event::Ready { node });
    }
    assert_eq!((policy.severity(), policy.causes().len()), (Severity::Hold, 2));
    let mut next = successor(&plan, &policy, at(102.2));
    assert_eq!(orders(&mut next, at(102.2), Event::Begin), [], "the robot is held already");
    orders(&mut next, at(103.0), Event::Timer);
    assert_eq!((next.severity(), next.causes().len()), (Severity::Hold, 1));
    let actions = orders(&mut next, at(104.0), Event::Call(supervisor::Request::Reset));
    assert_eq!(actions, [Action::Hold { on: false }, Action::Limp { on: false }]);
}

#[test]
fn a_node_that_cannot_be_had_holds_the_robot_until_it_is_back_whoever_supervises_then() {
    let rule = Rule { intensity: Intensity { restarts: 0, window_s: 60.0 }, ..Rule::default() };
    let fragile = Care { loss: Severity::Limp, clear: Clear::Gone { after_s: 0.0 }, ..Care::plain(rule) };
    // Two nodes, or the run would be over.
    let plan = Supervision { nodes: vec![fragile, Care::default()], ..Supervision::default() };
    let mut policy = running(&plan);
    orders(&mut policy, at(101.0), Event::Died { node: 0, exit: KILLED });
    assert_eq!((policy.node(0), policy.severity()), (NodeState::GivenUp, Severity::Limp));
    let mut next = successor(&plan, &policy, at(102.0));
    assert_eq!(orders(&mut next, at(102.0), Event::Begin), []);
    assert_eq!(next.severity(), Severity::Limp);
    orders(&mut next, at(103.0), Event::Call(supervisor::Request::Start { node: 0 }));
    assert_eq!(orders(&mut next, at(103.1), Event::Ready { node: 0 }), [Action::Limp { on: false }]);
}

#[test]
fn a_groups_restarts_before_the_takeover_count_too() {
    let group = Group {
        members: vec![0, 1],
        strategy: Strategy::OneForAll,
        intensity: Intensity { restarts: 1, window_s: 60.0 },
    };
    let plan = Supervision { nodes: vec![Care::default(); 3], groups: vec![group], ..Supervision::default() };
    let mut policy = running(&plan);
    let died = |node| Event::Died { node, exit: KILLED };
    orders(&mut policy, at(103.0), died(0));
    orders(&mut policy, at(103.1), died(1));
    orders(&mut policy, at(103.2), Event::Timer);
    for node in 0..2 {
        orders(&mut policy, at(103.3), Event::Ready { node });
    }
    let mut next = successor(&plan, &policy, at(104.0));
    orders(&mut next, at(104.0), Event::Begin);
    orders(&mut next, at(110.0), died(0));
    assert_eq!(next.node(0), NodeState::GivenUp);
}
