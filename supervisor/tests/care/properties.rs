//! What holds in every life: random robots, to whose nodes random things happen.

use super::{KILLED, plain};
use proptest::prelude::*;
use runtime::Time;
use supervisor::{
    Act, Action, Care, Clear, Condition, Event, Exit, Group, IncidentKind, Intensity, NodeState, Policy, Reaction,
    Request, Restart, Rule, Severity, Strategy as Fate, Supervision,
};

#[derive(Debug, Clone)]
enum Happening {
    Pass(f64),
    Timer,
    Report(usize, u8),
    Die(usize, Exit),
    Call(u8, usize),
    Stop,
}

fn happening() -> impl Strategy<Value = Happening> {
    let exit = prop_oneof![Just(Exit::Code(0)), Just(Exit::Code(1)), Just(KILLED), Just(Exit::NotStarted(2))];
    prop_oneof![
        4 => (0.0..3.0f64).prop_map(Happening::Pass),
        6 => Just(Happening::Timer),
        12 => (0usize..4, 0u8..16).prop_map(|(node, what)| Happening::Report(node, what)),
        8 => (0usize..4, exit).prop_map(|(node, exit)| Happening::Die(node, exit)),
        3 => (0u8..5, 0usize..4).prop_map(|(what, node)| Happening::Call(what, node)),
    ]
}

fn severity() -> impl Strategy<Value = Severity> {
    prop::sample::select(Severity::ALL.to_vec())
}

fn clear() -> impl Strategy<Value = Clear> {
    prop_oneof![3 => (0.0..3.0f64).prop_map(|after_s| Clear::Gone { after_s }), 2 => Just(Clear::Reset), 1 => Just(Clear::Never)]
}

fn care() -> impl Strategy<Value = Care> {
    let restart = prop_oneof![5 => Just(Restart::Always), 1 => Just(Restart::OnFailure), 1 => Just(Restart::Never)];
    let intensity = (0u32..5, 0.1..20.0f64).prop_map(|(restarts, window_s)| Intensity { restarts, window_s });
    let rule =
        (restart, intensity, 0u8..3, any::<bool>()).prop_map(|(restart, intensity, stop_group, reports_ready)| Rule {
            restart,
            intensity,
            stop_group,
            reports_ready,
            ..Rule::default()
        });
    let rungs = (severity(), severity(), severity(), clear());
    let marks = (0u32..3, 0u32..5, 0u8..12, prop_oneof![Just(0.0), 0.5..3.0f64]);
    (rule, rungs, marks, any::<[bool; 2]>(), 0.0..2.0f64).prop_map(
        |(rule, rungs, marks, [standby, restart_when_silent], absent_after_s)| {
            let (loss, silence, lateness, clear) = rungs;
            let (beats_low, beats_high, raise_most, start_deadline_s) = marks;
            Care {
                rule,
                loss,
                silence,
                lateness,
                clear,
                beats_low,
                beats_high,
                raise_most,
                start_deadline_s,
                standby,
                restart_when_silent,
                absent_after_s,
                ..plain()
            }
        },
    )
}

fn act() -> impl Strategy<Value = Act> {
    prop_oneof![
        (0usize..3).prop_map(|node| Act::Restart { node }),
        Just(Act::Execute { command: 0 }),
        Just(Act::Await { path: 0, within_s: 1.0 }),
        (0.0..2.0f64).prop_map(Act::Wait),
        Just(Act::Notify),
        Just(Act::Heal),
        severity().prop_map(Act::Raise),
    ]
}

fn reaction() -> impl Strategy<Value = Reaction> {
    use Condition::*;
    let when = prop::sample::select(vec![
        Death,
        AbnormalDeath,
        MissedLow,
        MissedHigh,
        Restart,
        Raised(None),
        Silent,
        Late,
        NotReady,
        GivenUp,
    ]);
    let lists = (prop::collection::vec(act(), 0..4), prop::collection::vec(act(), 0..3));
    (prop::option::of(0usize..3), when, lists, any::<bool>(), clear())
        .prop_map(|(node, when, (acts, fallback), again, clear)| Reaction { node, when, acts, fallback, again, clear })
}

fn plan() -> impl Strategy<Value = Supervision> {
    let strategy = prop::sample::select(vec![Fate::OneForOne, Fate::OneForAll, Fate::RestForOne]);
    let group = (strategy, 0u32..4).prop_map(|(strategy, restarts)| Group {
        members: vec![1, 0],
        strategy,
        intensity: Intensity { restarts, window_s: 10.0 },
    });
    (prop::collection::vec(care(), 3..4), prop::option::of(group), prop::collection::vec(reaction(), 0..3))
        .prop_map(|(nodes, group, reactions)| Supervision { nodes, groups: group.into_iter().collect(), reactions })
}

/// The world beside the policy, judged after every event.
struct World {
    plan: Supervision,
    policy: Policy,
    now: Time,
    alive: Vec<bool>,
    standby: Vec<bool>,
    /// Starts after deaths that nobody asked for, per node.
    restarts: Vec<Vec<Time>>,
    group_starts: Vec<Time>,
    tickets: Vec<u32>,
    freedom: [bool; 3],
    done: bool,
}

impl World {
    fn new(plan: Supervision) -> World {
        let nodes = plan.nodes.len();
        let mut world = World {
            policy: Policy::supervising(plan.clone()),
            plan,
            now: Time::from_seconds(100.0),
            alive: vec![false; nodes],
            standby: vec![false; nodes],
            restarts: vec![Vec::new(); nodes],
            group_starts: Vec::new(),
            tickets: Vec::new(),
            freedom: [false; 3],
            done: false,
        };
        world.event(Event::Begin);
        world
    }

    fn event(&mut self, event: Event) {
        let latched = self.policy.latched();
        let may_reset = self.policy.refusal(Request::Reset).is_none();
        let mut actions = Vec::new();
        self.policy.handle(self.now, event, &mut actions);
        for &action in &actions {
            self.judge(action);
        }
        if latched && !self.policy.latched() {
            assert!(event == Event::Call(Request::Reset) && may_reset, "{event:?} let the emergency stop go");
        }
        let level = self.policy.severity();
        let wanted = [level >= Severity::Limp, level >= Severity::Hold, level >= Severity::Stop];
        assert!(self.done || self.freedom[..2] == wanted[..2], "told {:?} at {level:?}", self.freedom);
        if let Some(at) = self.policy.next_timer() {
            assert!(at > self.now, "a timer in the past would spin: {event:?} {:?}", self.policy);
        }
        for (node, &alive) in self.alive.iter().enumerate() {
            assert_eq!(alive, self.policy.node(node).is_alive(), "node {node}");
        }
    }

    fn judge(&mut self, action: Action) {
        assert!(!self.done, "{action:?} after Done");
        match action {
            Action::Start { node } => {
                assert!(!std::mem::replace(&mut self.alive[node], true), "node {node} has two living instances");
            }
            Action::Promote { node } => {
                assert!(std::mem::replace(&mut self.standby[node], false), "nobody waits for node {node}");
                assert!(!std::mem::replace(&mut self.alive[node], true), "node {node} has two living instances");
            }
            Action::Terminate { node } | Action::Kill { node } => assert!(self.alive[node]),
            Action::StartStandby { node, .. } => assert!(!std::mem::replace(&mut self.standby[node], true)),
            Action::KillStandby { node } => assert!(std::mem::replace(&mut self.standby[node], false)),
            Action::Limp { on } => assert!(std::mem::replace(&mut self.freedom[0], on) != on),
            Action::Hold { on } => {
                assert!(std::mem::replace(&mut self.freedom[1], on) != on);
                assert!(on || !self.policy.latched(), "free to move under an emergency stop");
            }
            Action::Stop { .. } => self.freedom[2] = true,
            Action::Execute { ticket, .. } | Action::Await { ticket, .. } => self.tickets.push(ticket),
            Action::Notify(incident) => match incident.kind {
                // Told of starts that nobody asked for.
                IncidentKind::Restarted { .. } | IncidentKind::TookOver { .. } => {
                    self.restarts[incident.node].push(self.now);
                }
                IncidentKind::WithGroup { began: true, .. } if self.group_starts.last() != Some(&self.now) => {
                    self.group_starts.push(self.now);
                }
                _ => {}
            },
            Action::Reprioritise { node, above } => assert!(above <= self.plan.nodes[node].raise_most),
            Action::Revert { .. } | Action::Accept { .. } | Action::Dismiss { .. } | Action::Heal { .. } => {}
            Action::Done => {
                assert!(!self.alive.contains(&true), "done with living processes");
                self.done = true;
            }
        }
    }

    fn happen(&mut self, happening: &Happening) {
        let nodes = self.plan.nodes.len();
        match *happening {
            Happening::Pass(seconds) => {
                self.now = self.now.after_s(seconds);
                self.event(Event::Timer);
            }
            Happening::Timer => {
                if let Some(at) = self.policy.next_timer() {
                    self.now = at;
                    self.event(Event::Timer);
                }
            }
            Happening::Report(node, what) => self.report(node % nodes, what),
            Happening::Die(3, exit) => {
                if let Some(node) = self.standby.iter().position(|&waits| waits) {
                    self.standby[node] = false;
                    self.event(Event::StandbyDied { node, exit });
                }
            }
            Happening::Die(node, exit) => {
                self.alive[node] = false;
                self.event(Event::Died { node, exit });
            }
            Happening::Call(what, node) => {
                let node = node % nodes;
                let request = [
                    Request::Start { node },
                    Request::Stop { node },
                    Request::Restart { node },
                    Request::Replace { node },
                    Request::Reset,
                ][usize::from(what)];
                self.event(Event::Call(request));
            }
            Happening::Stop => self.event(Event::StopRequested),
        }
    }

    fn report(&mut self, node: usize, what: u8) {
        let event = match what {
            0..=4 => Event::Ready { node },
            5 => Event::Missed { node, beats: 2, starved: false },
            6 => Event::Missed { node, beats: 9, starved: true },
            7 => Event::Missed { node, beats: 9, starved: false },
            8 => Event::Beat { node },
            9 => Event::Late { node, misses: 2, idle: 0.4 },
            10 => Event::Late { node, misses: 2, idle: 0.0 },
            11 => Event::Stale { node, age_s: 1.0 },
            12 => Event::Fresh { node },
            13 => Event::Raised { node, code: 7, severity: Severity::Limp },
            14 => Event::Lowered { node, code: 7 },
            _ if self.standby[node] => Event::StandbyReady { node },
            _ => match self.tickets.pop() {
                Some(ticket) => Event::Outcome { ticket, success: ticket % 2 == 0 },
                None => Event::Attached { node },
            },
        };
        self.event(event);
    }

    /// From now on nothing else goes wrong: what starts gets ready, what is told to end does, time passes.
    fn calm_down(&mut self) {
        for _ in 0..400 {
            if self.done {
                return;
            }
            let state = |world: &World, node| world.policy.node(node);
            for node in 0..self.plan.nodes.len() {
                match state(self, node) {
                    NodeState::Starting { .. } => self.event(Event::Ready { node }),
                    NodeState::Terminating { .. } | NodeState::Killing { .. } | NodeState::Unkillable => {
                        self.happen(&Happening::Die(node, KILLED));
                    }
                    _ => {}
                }
                if self.done {
                    return;
                }
                self.event(Event::Ready { node });
                self.event(Event::Beat { node });
                self.event(Event::Fresh { node });
                self.event(Event::Lowered { node, code: 7 });
            }
            self.happen(&Happening::Timer);
        }
    }
}

fn most_within(times: &[Time], window_s: f64) -> usize {
    let within = |first: usize| times[first..].iter().take_while(|at| at.since(times[first]) < window_s).count();
    (0..times.len()).map(within).max().unwrap_or(0)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 1500, failure_persistence: None, ..ProptestConfig::default() })]

    /// Nobody lives twice, no timer spins, what the host was told is what the ladder says, no emergency stop lets go by
    /// itself, intensities bound restarts, and once nothing else goes wrong every node runs, has ended, or is given up
    /// and the robot stands on the rung that its loss asks for.
    #[test]
    fn no_life_breaks_the_invariants(plan in plan(), life in prop::collection::vec(happening(), 0..150)) {
        let mut world = World::new(plan);
        for happening in &life {
            world.happen(happening);
        }
        let asked = life.iter().any(|h| matches!(h, Happening::Call(0, _)))
            || world.plan.reactions.iter().any(|r| !r.acts.is_empty() || !r.fallback.is_empty());
        for (node, care) in world.plan.nodes.iter().enumerate() {
            let Intensity { restarts, window_s } = care.rule.intensity;
            let shares = world.plan.groups.iter().any(|g| g.strategy != Fate::OneForOne && g.members.contains(&node));
            if !shares && !asked {
                prop_assert!(most_within(&world.restarts[node], window_s) <= restarts as usize, "{:?}", world.restarts[node]);
            }
        }
        for group in &world.plan.groups {
            prop_assert!(most_within(&world.group_starts, group.intensity.window_s) <= group.intensity.restarts as usize);
        }
        world.calm_down();
        for (node, care) in world.plan.nodes.iter().enumerate() {
            let state = world.policy.node(node);
            let settled = matches!(state, NodeState::Running { .. } | NodeState::Ended { .. } | NodeState::GivenUp | NodeState::Stopped);
            prop_assert!(world.done || settled, "node {node} is {state:?}");
            if !world.done && matches!(state, NodeState::GivenUp | NodeState::Stopped) {
                prop_assert!(world.policy.severity() >= care.loss, "{:?} with {state:?}", world.policy.severity());
            }
        }
        world.happen(&Happening::Stop);
        world.calm_down();
        prop_assert!(world.done, "still alive: {:?}", world.alive);
    }
}
