//! What people and programs ask for.

use runtime::Time;

use super::unit::{Intent, Standby};
use super::watch::{intent_of, tell_end};
use super::{Phase, Policy, notify};
use crate::backoff::RecentRestarts;
use crate::event::{Action, IncidentKind, Request};
use crate::state::NodeState;

impl Policy {
    /// Why `request` would be refused now, if so: the state that it does not fit.
    pub fn refusal(&self, request: Request) -> Option<String> {
        if self.phase != Phase::Up {
            return Some(format!("the robot is {}", self.robot().word()));
        }
        let node = match request {
            Request::Reset => {
                let stops = "a cause of the emergency stop is still there";
                return (!self.ladder.may_reset()).then(|| stops.to_owned());
            }
            Request::Start { node }
            | Request::Stop { node }
            | Request::Restart { node }
            | Request::Replace { node } => node,
        };
        let Some(unit) = self.units.get(node) else { return Some("there is no such node".to_owned()) };
        use NodeState::*;
        let fits = match (request, unit.state) {
            (Request::Start { .. }, state) => !state.is_alive(),
            (Request::Stop { .. }, Stopped | Ended { .. } | GivenUp | Unkillable) => false,
            (Request::Restart { .. }, Unkillable) => false,
            (Request::Replace { .. }, Running { .. }) => {
                !matches!(unit.standby, Standby::Starting { other: true } | Standby::Ready { other: true })
            }
            (Request::Replace { .. }, _) => false,
            _ => true,
        };
        (!fits).then(|| format!("it is {}", unit.state.word()))
    }

    pub(super) fn call(&mut self, now: Time, request: Request, actions: &mut Vec<Action>) {
        let node = match request {
            Request::Reset => 0,
            Request::Start { node }
            | Request::Stop { node }
            | Request::Restart { node }
            | Request::Replace { node } => node,
        };
        if node >= self.units.len() {
            return;
        }
        if self.refusal(request).is_some() {
            notify(actions, node, now, IncidentKind::Refused { request });
            return;
        }
        let unit = &mut self.units[node];
        match request {
            Request::Reset => {
                for cause in self.ladder.reset() {
                    tell_end(now, cause, actions);
                }
            }
            Request::Start { .. } => {
                (unit.attempts, unit.recent) = (0, RecentRestarts::new(unit.care.rule.intensity));
                unit.down_since = Some(now);
                unit.start(node, now, actions);
            }
            Request::Stop { .. } | Request::Restart { .. } => match unit.state {
                NodeState::Starting { .. } | NodeState::Running { .. } => {
                    let intent = intent_of(request);
                    if intent == Intent::Stop && std::mem::take(&mut unit.standby).is_alive() {
                        actions.push(Action::KillStandby { node });
                    }
                    if unit.trial.take().is_some() {
                        actions.push(Action::Accept { node });
                    }
                    unit.terminate(node, now, intent, actions);
                }
                // Its group is about to start it anew anyhow.
                NodeState::Terminating { .. } | NodeState::Killing { .. }
                    if unit.intent == Intent::Regroup && intent_of(request) == Intent::Restart => {}
                NodeState::Terminating { .. } | NodeState::Killing { .. } => unit.intent = intent_of(request),
                _ if intent_of(request) == Intent::Stop => unit.end(NodeState::Stopped),
                _ => {
                    unit.down_since = Some(now);
                    unit.start(node, now, actions);
                }
            },
            Request::Replace { .. } => {
                if unit.standby.is_alive() {
                    actions.push(Action::KillStandby { node });
                }
                unit.standby = Standby::Starting { other: true };
                actions.push(Action::StartStandby { node, other: true });
            }
        }
        notify(actions, node, now, IncidentKind::Asked { request });
    }
}
