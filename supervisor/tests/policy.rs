//! The policy by itself, on virtual time: sentences first, then properties over random lives.

use proptest::prelude::*;
use runtime::Time;
use supervisor::{Action, Backoff, Event, Exit, IncidentKind, Intensity, Next, NodeState, Policy, Restart};
use supervisor::{RobotState, Rule};

const KILLED: Exit = Exit::Signal { signal: 9, core: false };

/// A policy with its clock and everything it has ever asked for.
struct Bench {
    policy: Policy,
    now: Time,
    done: Vec<Action>,
}

impl Bench {
    fn new(rules: impl IntoIterator<Item = Rule>) -> Bench {
        let mut bench = Bench { policy: Policy::new(rules), now: Time::from_seconds(100.0), done: Vec::new() };
        bench.event(Event::Begin);
        bench
    }

    fn event(&mut self, event: Event) -> Vec<Action> {
        let mut actions = Vec::new();
        self.policy.handle(self.now, event, &mut actions);
        self.done.extend_from_slice(&actions);
        actions
    }

    fn die(&mut self, node: usize, exit: Exit) -> Vec<Action> {
        self.event(Event::Died { node, exit })
    }

    /// Lets time pass until the policy's next timer, and past it; seconds it took.
    fn timer(&mut self) -> Option<f64> {
        let at = self.policy.next_timer()?;
        let waited_s = at.since(self.now);
        self.now = at;
        self.event(Event::Timer);
        Some(waited_s)
    }

    fn starts_of(&self, node: usize) -> usize {
        self.done.iter().filter(|&&action| action == Action::Start { node }).count()
    }
}

fn in_group(stop_group: u8) -> Rule {
    Rule { stop_group, ..Rule::default() }
}

fn only_orders(actions: Vec<Action>) -> Vec<Action> {
    actions.into_iter().filter(|action| !matches!(action, Action::Notify(_))).collect()
}

#[test]
fn the_groups_start_from_the_highest_each_when_those_before_it_are_ready() {
    let mut bench = Bench::new([in_group(0), in_group(2), in_group(1), in_group(2)]);
    assert_eq!(bench.done, [Action::Start { node: 1 }, Action::Start { node: 3 }]);
    assert_eq!(bench.event(Event::Ready { node: 1 }), []);
    assert_eq!(bench.policy.robot(), RobotState::Starting);
    assert_eq!(bench.event(Event::Ready { node: 3 }), [Action::Start { node: 2 }]);
    assert_eq!(bench.event(Event::Ready { node: 2 }), [Action::Start { node: 0 }]);
    assert_eq!(bench.policy.robot(), RobotState::Running);
}

#[test]
fn a_node_that_never_gets_ready_holds_the_others_up_once_and_is_named() {
    let mut bench = Bench::new([in_group(0), in_group(1), in_group(2)]);
    assert_eq!(bench.timer(), Some(2.0));
    assert!(bench.done.iter().any(|action| matches!(action, Action::Notify(incident) if incident.node == 2
            && incident.kind == IncidentKind::NotReady { waited_s: 2.0 })));
    assert_eq!(bench.starts_of(1), 1);
    assert_eq!(bench.event(Event::Ready { node: 1 }), [Action::Start { node: 0 }]);
}

#[test]
fn a_node_that_does_not_report_counts_as_ready_at_its_start() {
    let bench = Bench::new([in_group(0), Rule { reports_ready: false, ..in_group(1) }]);
    assert_eq!(bench.done, [Action::Start { node: 1 }, Action::Start { node: 0 }]);
}

#[test]
fn the_first_restart_is_immediate_and_ordered_before_anything_is_told() {
    let mut bench = Bench::new([Rule::default()]);
    bench.event(Event::Ready { node: 0 });
    let actions = bench.die(0, KILLED);
    assert_eq!(actions[0], Action::Start { node: 0 });
    let kinds = actions[1..].iter().map(|action| match action {
        Action::Notify(incident) => incident.kind,
        other => panic!("{other:?}"),
    });
    let kinds: Vec<_> = kinds.collect();
    let next = Next::Restart { delay_s: 0.0 };
    assert_eq!(
        kinds,
        [IncidentKind::Died { exit: KILLED, lived_s: 0.0, next }, IncidentKind::Restarted { attempt: 1, down_s: 0.0 }]
    );
    bench.now = bench.now.after_s(0.02);
    let told = bench.event(Event::Ready { node: 0 });
    assert!(matches!(told[..], [Action::Notify(incident)]
        if matches!(incident.kind, IncidentKind::Recovered { down_s } if (down_s - 0.02).abs() < 1e-6)));
}

#[test]
fn a_crash_loop_is_slowed_down_and_then_given_up() {
    let mut bench = Bench::new([in_group(0), in_group(0)]);
    let mut pauses_s = Vec::new();
    bench.event(Event::Ready { node: 1 });
    while bench.policy.node(0) != NodeState::GivenUp {
        bench.die(0, Exit::Code(1));
        if let NodeState::Pausing { until } = bench.policy.node(0) {
            pauses_s.push(until.since(bench.now));
            bench.now = until;
            bench.event(Event::Timer);
        }
    }
    let expected = [0.1, 0.2, 0.4, 0.8, 1.6, 3.2, 5.0, 5.0, 5.0];
    assert_eq!(pauses_s.len(), expected.len());
    assert!(pauses_s.iter().zip(expected).all(|(pause, expected)| (pause - expected).abs() < 1e-6), "{pauses_s:?}");
    assert_eq!(bench.starts_of(0), 11, "the first start and ten restarts");
    assert_eq!(bench.policy.robot(), RobotState::Degraded);
    assert!(bench.policy.node(1).is_alive(), "the rest of the robot goes on");
}

#[test]
fn a_healthy_spell_resets_the_back_off() {
    let mut bench = Bench::new([Rule::default()]);
    for _ in 0..3 {
        bench.die(0, KILLED);
        while matches!(bench.policy.node(0), NodeState::Pausing { .. }) {
            bench.timer();
        }
    }
    bench.event(Event::Ready { node: 0 });
    bench.now = bench.now.after_s(2.0);
    assert_eq!(bench.die(0, KILLED)[0], Action::Start { node: 0 });
}

#[test]
fn time_before_ready_does_not_count_as_healthy() {
    let mut bench = Bench::new([Rule::default()]);
    bench.die(0, KILLED);
    bench.now = bench.now.after_s(10.0);
    bench.die(0, KILLED);
    assert!(matches!(bench.policy.node(0), NodeState::Pausing { .. }));
}

#[test]
fn restart_rules_decide_which_ends_are_followed_by_a_start() {
    for (restart, exit, again) in [
        (Restart::Always, Exit::Code(0), true),
        (Restart::OnFailure, Exit::Code(0), false),
        (Restart::OnFailure, Exit::Code(1), true),
        (Restart::OnFailure, Exit::NotStarted(2), true),
        (Restart::Never, KILLED, false),
    ] {
        let mut bench = Bench::new([Rule { restart, ..Rule::default() }, Rule::default()]);
        bench.die(0, exit);
        assert_eq!(bench.starts_of(0) == 2, again, "{restart:?} after {exit:?}");
        assert_eq!(bench.policy.robot() == RobotState::Degraded, !again && !exit.is_success());
    }
}

#[test]
fn it_is_done_when_nothing_is_left_to_supervise() {
    let mut bench = Bench::new([Rule { restart: Restart::OnFailure, ..Rule::default() }]);
    assert_eq!(bench.die(0, Exit::Code(0)).last(), Some(&Action::Done));
    assert_eq!(bench.policy.next_timer(), None);
    assert_eq!(bench.event(Event::StopRequested), []);
}

#[test]
fn an_ordered_stop_goes_group_by_group_and_the_highest_last() {
    let mut bench = Bench::new([2, 0, 1, 0].map(|group| Rule { reports_ready: false, ..in_group(group) }));
    assert_eq!(bench.event(Event::StopRequested), [Action::Terminate { node: 1 }, Action::Terminate { node: 3 }]);
    assert_eq!(bench.die(3, Exit::Code(0)), []);
    assert_eq!(bench.die(1, Exit::Code(0)), [Action::Terminate { node: 2 }]);
    assert_eq!(bench.die(2, Exit::Signal { signal: 15, core: false }), [Action::Terminate { node: 0 }]);
    assert_eq!(bench.die(0, Exit::Code(0)), [Action::Done]);
}

#[test]
fn a_node_that_ignores_the_request_is_killed_after_its_grace() {
    let mut bench = Bench::new([Rule { grace_s: 0.5, ..Rule::default() }]);
    bench.event(Event::StopRequested);
    assert_eq!(bench.timer(), Some(0.5));
    assert!(bench.done.contains(&Action::Kill { node: 0 }));
    assert_eq!(bench.die(0, KILLED), [Action::Done]);
}

#[test]
fn a_process_that_hangs_in_the_kernel_does_not_keep_the_next_group_from_stopping() {
    let mut bench = Bench::new([0, 1].map(|group| Rule { reports_ready: false, ..in_group(group) }));
    bench.event(Event::StopRequested);
    bench.timer();
    assert!(!bench.done.contains(&Action::Terminate { node: 1 }));
    bench.timer();
    assert_eq!(bench.policy.node(0), NodeState::Unkillable);
    assert!(bench.done.contains(&Action::Terminate { node: 1 }));
    assert_eq!(bench.die(1, Exit::Code(0)), [], "done only when no process is left");
    assert_eq!(bench.die(0, KILLED), [Action::Done]);
}

#[test]
fn a_second_request_kills_everything_at_once() {
    let mut bench = Bench::new([0, 1].map(|group| Rule { reports_ready: false, ..in_group(group) }));
    bench.event(Event::StopRequested);
    assert_eq!(bench.event(Event::KillRequested), [Action::Kill { node: 0 }, Action::Kill { node: 1 }]);
    assert_eq!(bench.event(Event::KillRequested), []);
}

#[test]
fn a_pause_is_cut_short_by_the_stop() {
    let mut bench = Bench::new([Rule::default()]);
    bench.die(0, KILLED);
    bench.die(0, KILLED);
    assert!(matches!(bench.policy.node(0), NodeState::Pausing { .. }));
    assert_eq!(bench.event(Event::StopRequested), [Action::Done]);
}

#[test]
fn a_crash_while_stopping_is_told() {
    let mut bench = Bench::new([Rule::default()]);
    bench.event(Event::StopRequested);
    let actions = bench.die(0, Exit::Signal { signal: 11, core: false });
    assert!(matches!(actions[0], Action::Notify(incident)
        if matches!(incident.kind, IncidentKind::Died { next: Next::Stop, .. })));
    assert_eq!(only_orders(actions), [Action::Done]);
}

// Properties.

/// What the world does next.
#[derive(Debug, Clone)]
enum Happening {
    Pass(f64),
    Timer,
    Ready(usize),
    Die(usize, Exit),
    Stop,
    Kill,
}

fn happening() -> impl Strategy<Value = Happening> {
    let exit = prop_oneof![Just(Exit::Code(0)), Just(Exit::Code(1)), Just(KILLED), Just(Exit::NotStarted(2)),];
    prop_oneof![
        4 => (0.0..3.0f64).prop_map(Happening::Pass),
        4 => Just(Happening::Timer),
        4 => (0usize..4).prop_map(Happening::Ready),
        8 => ((0usize..4), exit).prop_map(|(node, exit)| Happening::Die(node, exit)),
        1 => Just(Happening::Stop),
        1 => Just(Happening::Kill),
    ]
}

fn rule() -> impl Strategy<Value = Rule> {
    let restart = prop_oneof![3 => Just(Restart::Always), 1 => Just(Restart::OnFailure), 1 => Just(Restart::Never)];
    let backoff = (0.0..0.3f64, 0.0..0.3f64, 0.0..2.0f64, 0.0..3.0f64)
        .prop_map(|(first_s, step_s, longest_s, healthy_s)| Backoff { first_s, step_s, longest_s, healthy_s });
    let intensity = (0u32..6, 0.1..20.0f64).prop_map(|(restarts, window_s)| Intensity { restarts, window_s });
    let times = (any::<bool>(), 0.0..2.0f64, 0.0..2.0f64);
    (restart, backoff, intensity, 0u8..3, times).prop_map(|(restart, backoff, intensity, stop_group, times)| {
        let (reports_ready, ready_within_s, grace_s) = times;
        Rule { restart, backoff, intensity, stop_group, reports_ready, ready_within_s, grace_s }
    })
}

/// The world beside the policy: which processes live, judged after every event.
struct World {
    bench: Bench,
    rules: Vec<Rule>,
    alive: Vec<bool>,
    starts: Vec<Vec<Time>>,
    stopping: bool,
    done: bool,
}

impl World {
    fn new(rules: Vec<Rule>) -> World {
        let bench = Bench::new(rules.clone());
        let first = bench.done.clone();
        let nodes = rules.len();
        let mut world = World {
            bench,
            rules,
            alive: vec![false; nodes],
            starts: vec![Vec::new(); nodes],
            stopping: false,
            done: false,
        };
        world.judge(&first);
        world
    }

    fn event(&mut self, event: Event) -> Vec<Action> {
        let actions = self.bench.event(event);
        self.judge(&actions);
        actions
    }

    fn judge(&mut self, actions: &[Action]) {
        for &action in actions {
            assert!(!self.done, "{action:?} after Done");
            match action {
                Action::Start { node } => {
                    assert!(!self.stopping, "node {node} started after the request to stop");
                    assert!(!self.alive[node], "node {node} has two living instances");
                    self.alive[node] = true;
                    self.starts[node].push(self.bench.now);
                }
                Action::Terminate { node } | Action::Kill { node } => {
                    assert!(self.stopping && self.alive[node], "node {node} stopped without cause");
                }
                Action::Notify(_) => {}
                // A given-up node is told with its cause; none of these lives asks for more.
                other if other != Action::Done => panic!("{other:?}"),
                _ => {
                    assert!(!self.alive.contains(&true), "done with living processes");
                    self.done = true;
                }
            }
        }
        if let Some(at) = self.bench.policy.next_timer() {
            assert!(at > self.bench.now, "a timer in the past would spin");
        }
        for (node, &alive) in self.alive.iter().enumerate() {
            assert_eq!(alive, self.bench.policy.node(node).is_alive(), "node {node}");
        }
    }

    fn happen(&mut self, happening: &Happening) {
        let nodes = self.rules.len();
        match *happening {
            Happening::Pass(seconds) => {
                // A host never sleeps past the timer by choice, but may be late.
                self.bench.now = self.bench.now.after_s(seconds);
                self.event(Event::Timer);
            }
            Happening::Timer => {
                if let Some(at) = self.bench.policy.next_timer() {
                    self.bench.now = at;
                    self.event(Event::Timer);
                }
            }
            Happening::Ready(node) => {
                self.event(Event::Ready { node: node % nodes });
            }
            Happening::Die(node, exit) => {
                let (node, before) = (node % nodes, self.bench.policy.node(node % nodes));
                let was_alive = std::mem::replace(&mut self.alive[node], false);
                let actions = self.event(Event::Died { node, exit });
                // Also the dead are reported dead now and then: it must do no harm.
                assert!(was_alive || actions.is_empty(), "{actions:?} for a node that was {before:?}");
            }
            Happening::Stop => {
                self.stopping = true;
                self.event(Event::StopRequested);
            }
            Happening::Kill => {
                self.stopping = true;
                self.event(Event::KillRequested);
            }
        }
    }

    /// Restarts in any window never exceed the intensity.
    fn restarts_are_bounded(&self) {
        for (rule, starts) in self.rules.iter().zip(&self.starts) {
            let restarts = &starts[starts.len().min(1)..];
            for (first, at) in restarts.iter().enumerate() {
                let in_window =
                    restarts[first..].iter().take_while(|later| later.since(*at) < rule.intensity.window_s).count();
                assert!(in_window <= rule.intensity.restarts as usize, "{in_window} restarts in a window: {rule:?}");
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 1024, failure_persistence: None, ..ProptestConfig::default() })]

    /// Two instances never live at once, nothing starts after the stop, restarts are bounded, and whatever the
    /// nodes do (obey, ignore SIGTERM, die by themselves) every process is stopped in the end and Done comes last.
    #[test]
    fn no_life_breaks_the_invariants(
        rules in prop::collection::vec(rule(), 1..4),
        life in prop::collection::vec(happening(), 0..120),
        obedient in prop::collection::vec(any::<bool>(), 4),
    ) {
        let mut world = World::new(rules);
        for happening in &life {
            world.happen(happening);
        }
        world.restarts_are_bounded();
        world.happen(&Happening::Stop);
        // Each round an order is obeyed or a timer passes: nodes × (terminate, kill, overdue) bounds them.
        for _ in 0..world.rules.len() * 6 + 6 {
            if world.done {
                break;
            }
            let doomed = (0..world.alive.len()).find(|&node| world.alive[node] && match world.bench.policy.node(node) {
                NodeState::Terminating { .. } => obedient[node],
                NodeState::Killing { .. } | NodeState::Unkillable => true,
                _ => false,
            });
            match doomed {
                Some(node) => world.happen(&Happening::Die(node, KILLED)),
                None => world.happen(&Happening::Timer),
            }
        }
        prop_assert!(world.done, "still alive: {:?}", world.alive);
    }
}
