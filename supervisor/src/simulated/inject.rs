//! How a fault of the list happens to the simulated robot, and how long what follows from it takes.

use super::faults::Stream;
use super::planned::PlannedFault;
use super::{Later, SupervisedHost};
use crate::event::Event;
use crate::severity::Severity;
use runtime::Time;

/// Code of the emergency stops that faults raise.
const STOP_CODE: u16 = 1;

impl SupervisedHost {
    /// When the next fault happens.
    pub(super) fn next_fault(&self) -> Option<Time> {
        self.faults.get(self.upcoming).map(|fault| fault.at(self.start))
    }

    /// A duration that depends on seed, process and moment alone, so that one fault less leaves all others as they are [s].
    pub(super) fn drawn_s(&self, crew: usize, what: u64, least_s: f64, most_s: f64) -> f64 {
        let moment = self.host.now().nanos() ^ (crew as u64) << 56 ^ what << 48;
        let number = (moment ^ moment >> 29).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        least_s + (most_s - least_s) * Stream::new(self.seed, number ^ number >> 32).uniform()
    }

    pub(super) fn inject(&mut self, now: Time, fault: &PlannedFault) {
        let index = fault.node().and_then(|path| self.host.index_of(path));
        let crew = index.and_then(|index| self.crews.iter().position(|crew| crew.nodes.contains(&index)));
        let kind = match (fault, index, crew) {
            (&PlannedFault::Burst { share, for_s, seed, .. }, ..) => {
                self.lose_bytes(share, seed);
                self.burst_until = self.burst_until.max(now.after_s(for_s));
                self.later(now.after_s(for_s), Later::EndBurst);
                3
            }
            (PlannedFault::Command { program, for_s, .. }, ..) => {
                self.refused.push((program.clone(), now.after_s(*for_s)));
                6
            }
            (&PlannedFault::Supervisor { for_s, .. }, ..) => {
                self.absent_until = self.absent_until.max(now.after_s(for_s));
                5
            }
            (fault, Some(index), Some(crew)) if self.alive(crew) => {
                let Some(kind) = self.inject_into(now, fault, index, crew) else { return };
                kind
            }
            // What is dead already has no faults.
            _ => return,
        };
        self.chronicle.faults[kind] += 1;
    }

    /// A fault of node `index`, or of its whole process; answers its kind.
    fn inject_into(&mut self, now: Time, fault: &PlannedFault, index: usize, crew: usize) -> Option<usize> {
        Some(match *fault {
            PlannedFault::Death { when, writes, .. } => {
                match when.in_step() {
                    Some(when) => self.host.kill_in_step(index, writes, when),
                    None => self.bury(crew),
                }
                0
            }
            PlannedFault::Hang { for_s, .. } => {
                for node in self.crews[crew].nodes.clone() {
                    self.host.hang(node, for_s);
                }
                1
            }
            PlannedFault::Slowdown { factor, for_s, .. } => {
                for node in self.crews[crew].nodes.clone() {
                    self.host.slow_down(node, factor, now.after_s(for_s));
                }
                2
            }
            PlannedFault::Stop { gone_after_s, reset_after_s, .. } => {
                let (node, code) = (crew, STOP_CODE);
                self.later(now, Later::Tell(Event::Raised { node, code, severity: Severity::Stop }));
                let gone = now.after_s(gone_after_s);
                self.later(gone, Later::Tell(Event::Lowered { node, code }));
                // An impatient person, and a patient one.
                self.later(now.after_s(reset_after_s), Later::Person);
                self.later(gone.after_s(1.5), Later::Person);
                4
            }
            PlannedFault::Burst { .. } | PlannedFault::Supervisor { .. } | PlannedFault::Command { .. } => return None,
        })
    }

    /// The lines to devices lose a share of their bytes from now on.
    fn lose_bytes(&mut self, share: f64, seed: u32) {
        for (number, name) in self.host.links().names().into_iter().enumerate() {
            let mut random = Stream::new(u64::from(seed), number as u64);
            let lose = move |_, _, byte| (random.uniform() >= share).then_some(byte);
            if let Some(link) = self.host.links().link(&name) {
                link.set_fault(lose);
            }
        }
    }
}
