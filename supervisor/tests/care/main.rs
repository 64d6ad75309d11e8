//! Care beyond births and deaths: hangs, silence, groups, standbys, replacements, the severity ladder, reactions.
//! Sentences here, properties over random lives in [`properties`].
#![allow(clippy::unwrap_used, reason = "a test fails by panicking, also in its helpers")]

mod properties;

use runtime::Time;
use supervisor::{
    Act, Action, Care, Clear, Condition, Event, Exit, Group, IncidentKind, Intensity, NodeState, Policy, Reaction,
    Request, Restart, Rule, Severity, Strategy as Fate, Supervision,
};

const KILLED: Exit = Exit::Signal { signal: 9, core: false };

struct Bench {
    policy: Policy,
    now: Time,
}

impl Bench {
    /// A robot whose nodes all run.
    fn running(plan: Supervision) -> Bench {
        let mut bench = Bench { policy: Policy::supervising(plan), now: Time::from_seconds(100.0) };
        bench.event(Event::Begin);
        for node in 0..bench.policy.nodes() {
            bench.event(Event::Ready { node });
        }
        bench
    }

    fn event(&mut self, event: Event) -> Vec<Action> {
        let mut actions = Vec::new();
        self.policy.handle(self.now, event, &mut actions);
        actions
    }

    /// Orders without what is only told.
    fn orders(&mut self, event: Event) -> Vec<Action> {
        self.event(event).into_iter().filter(|action| !matches!(action, Action::Notify(_))).collect()
    }

    fn die(&mut self, node: usize) -> Vec<Action> {
        self.orders(Event::Died { node, exit: KILLED })
    }

    fn after(&mut self, seconds: f64) -> Vec<Action> {
        self.now = self.now.after_s(seconds);
        self.orders(Event::Timer)
    }

    fn call(&mut self, request: Request) -> Vec<Action> {
        self.orders(Event::Call(request))
    }
}

fn one(care: Care) -> Supervision {
    Supervision { nodes: vec![care], ..Supervision::default() }
}

fn group(strategy: Fate, restarts: u32) -> Supervision {
    let intensity = Intensity { restarts, window_s: 60.0 };
    Supervision {
        nodes: vec![Care::default(); 4],
        groups: vec![Group { members: vec![0, 1, 2], strategy, intensity }],
        ..Supervision::default()
    }
}

const LOSS: Care = Care { loss: Severity::Hold, clear: Clear::Gone { after_s: 2.0 }, absent_after_s: 0.5, ..plain() };

const fn plain() -> Care {
    Care {
        rule: Rule {
            restart: Restart::Always,
            backoff: supervisor::Backoff { first_s: 0.0, step_s: 0.1, longest_s: 5.0, healthy_s: 2.0 },
            intensity: Intensity { restarts: 10, window_s: 60.0 },
            stop_group: 0,
            reports_ready: true,
            ready_within_s: 2.0,
            grace_s: 2.0,
        },
        loss: Severity::Warn,
        clear: Clear::Gone { after_s: 0.0 },
        absent_after_s: 1.0,
        start_deadline_s: 0.0,
        beats_low: 0,
        beats_high: 0,
        silence: Severity::Warn,
        restart_when_silent: false,
        lateness: Severity::Warn,
        raise_most: 0,
        calm_s: 10.0,
        standby: false,
        trial_s: 1.0,
    }
}

#[test]
fn a_hung_node_is_killed_and_started_again_and_a_starved_one_is_left_alone() {
    let care = Care { beats_low: 2, beats_high: 5, ..plain() };
    let mut bench = Bench::running(one(care));
    assert_eq!(bench.orders(Event::Missed { node: 0, beats: 50, starved: true }), []);
    assert_eq!(bench.orders(Event::Missed { node: 0, beats: 5, starved: false }), [Action::Kill { node: 0 }]);
    assert_eq!(bench.die(0), [Action::Start { node: 0 }]);
}

#[test]
fn missed_beats_below_the_high_mark_raise_the_priority_once() {
    let mut bench = Bench::running(one(Care { beats_low: 2, beats_high: 5, raise_most: 8, ..plain() }));
    let missed = |beats| Event::Missed { node: 0, beats, starved: false };
    assert_eq!(bench.orders(missed(1)), []);
    assert_eq!(bench.orders(missed(2)), [Action::Reprioritise { node: 0, above: 5 }]);
    assert_eq!(bench.orders(missed(3)), []);
}

#[test]
fn a_late_node_is_raised_while_processors_are_idle_up_to_its_ceiling_and_lowered_when_it_is_calm() {
    let mut bench = Bench::running(one(Care { raise_most: 8, calm_s: 10.0, ..plain() }));
    let late = |idle| Event::Late { node: 0, misses: 3, idle };
    assert_eq!(bench.orders(late(0.5)), [Action::Reprioritise { node: 0, above: 5 }]);
    assert_eq!(bench.orders(late(0.5)), [Action::Reprioritise { node: 0, above: 8 }]);
    assert_eq!(bench.orders(late(0.5)), []);
    assert_eq!(bench.after(9.9), []);
    assert_eq!(bench.after(0.1), [Action::Reprioritise { node: 0, above: 3 }]);
    assert_eq!(bench.after(10.0), [Action::Reprioritise { node: 0, above: 0 }]);
    assert_eq!(bench.after(100.0), []);
}

#[test]
fn no_priority_is_raised_where_no_processor_is_to_be_had() {
    let mut bench = Bench::running(one(Care { raise_most: 8, lateness: Severity::Limp, ..plain() }));
    assert_eq!(bench.orders(Event::Late { node: 0, misses: 3, idle: 0.01 }), [Action::Limp { on: true }]);
    assert_eq!(bench.after(10.0), [Action::Limp { on: false }]);
}

#[test]
fn a_node_that_hangs_before_it_is_ready_is_killed_at_its_deadline() {
    let care = Care { start_deadline_s: 3.0, ..plain() };
    let mut bench = Bench { policy: Policy::supervising(one(care)), now: Time::from_seconds(1.0) };
    bench.event(Event::Begin);
    assert_eq!(bench.after(2.9), []);
    assert_eq!(bench.after(0.1), [Action::Kill { node: 0 }]);
    assert_eq!(bench.die(0), [Action::Start { node: 0 }]);
}

#[test]
fn one_for_all_stops_the_others_in_reverse_and_starts_all_in_order() {
    let mut bench = Bench::running(group(Fate::OneForAll, 3));
    assert_eq!(bench.die(1), [Action::Terminate { node: 2 }, Action::Terminate { node: 0 }]);
    assert_eq!(bench.orders(Event::Died { node: 2, exit: Exit::Code(0) }), []);
    let started = bench.orders(Event::Died { node: 0, exit: Exit::Code(0) });
    assert_eq!(started, [0, 1, 2].map(|node| Action::Start { node }));
}

#[test]
fn rest_for_one_leaves_alone_what_was_started_before() {
    let mut bench = Bench::running(group(Fate::RestForOne, 3));
    assert_eq!(bench.die(1), [Action::Terminate { node: 2 }]);
    assert_eq!(bench.die(2), [1, 2].map(|node| Action::Start { node }));
    assert_eq!(bench.policy.node(0), NodeState::Running { since: bench.now });
}

#[test]
fn a_group_that_dies_too_often_is_given_up_together() {
    let mut bench = Bench::running(group(Fate::OneForAll, 0));
    assert_eq!(bench.die(0), [Action::Terminate { node: 2 }, Action::Terminate { node: 1 }]);
    bench.die(1);
    bench.die(2);
    for node in 0..3 {
        assert_eq!(bench.policy.node(node), NodeState::GivenUp);
    }
    assert!(bench.policy.node(3).is_alive(), "who is in no group goes on");
}

#[test]
fn a_warm_standby_takes_over_at_once_and_gets_a_successor() {
    let mut bench = Bench { policy: Policy::supervising(one(Care { standby: true, ..plain() })), now: Time::ZERO };
    bench.event(Event::Begin);
    assert_eq!(bench.orders(Event::Ready { node: 0 }), [Action::StartStandby { node: 0, other: false }]);
    assert_eq!(bench.die(0), [Action::Start { node: 0 }], "it was not ready yet");
    bench.event(Event::Ready { node: 0 });
    bench.event(Event::StandbyReady { node: 0 });
    assert_eq!(bench.die(0), [Action::Promote { node: 0 }]);
    assert_eq!(bench.orders(Event::Ready { node: 0 }), [Action::StartStandby { node: 0, other: false }]);
}

#[test]
fn a_replacement_takes_over_between_two_steps_and_a_failing_one_is_sent_back() {
    let mut bench = Bench::running(one(plain()));
    let replace = Request::Replace { node: 0 };
    assert_eq!(bench.call(replace), [Action::StartStandby { node: 0, other: true }]);
    assert_eq!(bench.orders(Event::StandbyReady { node: 0 }), [Action::Terminate { node: 0 }]);
    assert_eq!(bench.orders(Event::Died { node: 0, exit: Exit::Code(0) }), [Action::Promote { node: 0 }]);
    bench.event(Event::Ready { node: 0 });
    assert_eq!(bench.die(0), [Action::Revert { node: 0 }, Action::Start { node: 0 }]);
    bench.event(Event::Ready { node: 0 });
    // One that survives its trial is the node from then on.
    bench.call(replace);
    bench.event(Event::StandbyReady { node: 0 });
    bench.die(0);
    bench.event(Event::Ready { node: 0 });
    assert_eq!(bench.after(1.0), [Action::Accept { node: 0 }]);
    assert_eq!(bench.die(0), [Action::Start { node: 0 }]);
}

#[test]
fn a_replacement_that_cannot_start_changes_nothing() {
    let mut bench = Bench::running(one(plain()));
    bench.call(Request::Replace { node: 0 });
    let told = bench.event(Event::StandbyDied { node: 0, exit: Exit::Code(1) });
    assert!(told.iter().any(|a| matches!(a, Action::Notify(i) if i.kind == IncidentKind::Reverted)), "{told:?}");
    assert!(matches!(bench.policy.node(0), NodeState::Running { .. }));
}

#[test]
fn a_node_that_matters_holds_the_robot_once_it_has_been_away_too_long_and_until_it_is_well_again() {
    let mut bench = Bench::running(one(LOSS));
    bench.die(0);
    assert_eq!(bench.after(0.4), []);
    assert_eq!(bench.after(0.1), [Action::Hold { on: true }, Action::Limp { on: true }]);
    assert_eq!(bench.orders(Event::Ready { node: 0 }), []);
    assert_eq!(bench.after(1.9), []);
    assert_eq!(bench.after(0.1), [Action::Hold { on: false }, Action::Limp { on: false }]);
}

#[test]
fn what_slows_the_robot_down_comes_before_everything_else() {
    let rule = Rule { intensity: Intensity { restarts: 0, window_s: 1.0 }, ..plain().rule };
    let mut bench =
        Bench::running(Supervision { nodes: vec![Care { rule, ..LOSS }, plain()], ..Supervision::default() });
    let actions = bench.event(Event::Died { node: 0, exit: KILLED });
    assert_eq!(actions[0], Action::Hold { on: true });
}

#[test]
fn an_emergency_stop_waits_for_a_person_and_a_reset_for_its_cause() {
    let care = Care { silence: Severity::Stop, clear: Clear::Gone { after_s: 0.0 }, ..plain() };
    let mut bench = Bench::running(one(care));
    assert_eq!(bench.orders(Event::Stale { node: 0, age_s: 1.0 })[0], Action::Stop { node: 0 });
    assert_eq!(bench.call(Request::Reset), [], "the cause is still there");
    assert!(bench.policy.refusal(Request::Reset).is_some());
    bench.event(Event::Fresh { node: 0 });
    assert_eq!(bench.after(1e5), []);
    assert_eq!(bench.policy.severity(), Severity::Stop);
    assert_eq!(bench.call(Request::Reset), [Action::Hold { on: false }, Action::Limp { on: false }]);
}

#[test]
fn a_stopped_node_stays_stopped_until_somebody_starts_it() {
    let mut bench = Bench::running(Supervision { nodes: vec![plain(), plain()], ..Supervision::default() });
    assert_eq!(bench.call(Request::Stop { node: 0 }), [Action::Terminate { node: 0 }]);
    assert_eq!(bench.orders(Event::Died { node: 0, exit: Exit::Code(0) }), []);
    assert_eq!((bench.after(1e4), bench.policy.node(0)), (vec![], NodeState::Stopped));
    assert_eq!(bench.call(Request::Start { node: 0 }), [Action::Start { node: 0 }]);
    assert_eq!(bench.policy.refusal(Request::Start { node: 0 }).as_deref(), Some("it is starting"));
    assert!(bench.policy.refusal(Request::Start { node: 7 }).unwrap().contains("no such node"));
}

#[test]
fn a_reaction_does_its_acts_in_order_and_its_fallback_when_one_fails() {
    let reaction = Reaction {
        node: Some(0),
        when: Condition::AbnormalDeath,
        acts: vec![Act::Execute { command: 3 }, Act::Heal, Act::Await { path: 1, within_s: 2.0 }],
        fallback: vec![Act::Raise(Severity::Hold)],
        again: false,
        clear: Clear::Reset,
    };
    let mut bench = Bench::running(Supervision { reactions: vec![reaction], ..one(plain()) });
    let ticket = 0;
    assert_eq!(bench.die(0), [Action::Start { node: 0 }, Action::Execute { ticket, command: 3 }]);
    let orders = bench.orders(Event::Outcome { ticket, success: true });
    assert_eq!(orders, [Action::Heal { node: 0 }, Action::Await { ticket: 1, path: 1, within_s: 2.0 }]);
    // A host that answers nothing counts as a failure.
    assert_eq!(bench.after(3.0), [Action::Hold { on: true }, Action::Limp { on: true }]);
    bench.event(Event::Ready { node: 0 });
    bench.event(Event::Beat { node: 0 });
    assert_eq!(bench.after(1e3), [], "it waits for a person");
    assert_eq!(bench.call(Request::Reset), [Action::Hold { on: false }, Action::Limp { on: false }]);
}
