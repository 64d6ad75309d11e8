//! Faults of the simulated host: deaths in mid-step, slow-downs, last wills, and what detectors look at.

use super::SimulatedHost;
use crate::channel::Death;
use crate::device::Direction;
use crate::time::Time;

impl SimulatedHost {
    /// Lets node `index` die in its next step, while it publishes its sample number `writes` of that step, counted from
    /// 0: the earlier ones are out, this one is left as a kill at `when` leaves it. A node that publishes less dies at
    /// the end of its step.
    pub fn kill_in_step(&mut self, index: usize, writes: u32, when: Death) {
        if let Some(running) = &self.slots[index].running {
            running.opened.ports.doom().arm(writes, when);
            self.slots[index].doomed = true;
        }
    }

    /// The next node that has died in mid-step since the last look, and when.
    pub fn take_death(&mut self) -> Option<(usize, Time)> {
        self.deaths.pop_front()
    }

    /// Makes every step of node `index` take `factor` times as long until `until`.
    pub fn slow_down(&mut self, index: usize, factor: f64, until: Time) {
        self.slots[index].slowed = (factor.max(0.0), until);
    }

    /// When the step began that keeps node `index` busy at this moment; `None` when it is idle or dead.
    pub fn busy_since(&self, index: usize) -> Option<Time> {
        let slot = &self.slots[index];
        (slot.running.is_some() && slot.busy_until > self.now).then_some(slot.busy_since)
    }

    /// Steps and missed deadlines of node `index` in this life.
    pub fn punctuality(&self, index: usize) -> Option<(u64, u64)> {
        self.slots[index].running.as_ref().map(|running| (running.counted.steps(), running.counted.missed_deadlines()))
    }

    /// The last step of node `index` is over, and it stops in order: it says its last word to its device.
    pub fn stop_node(&mut self, index: usize) {
        if let Some(running) = &mut self.slots[index].running {
            running.opened.node.stop(self.now);
        }
        self.kill(index);
    }

    /// Writes `bytes` to the device of node `index`, which is dead: what the guard does for it.
    pub fn write_will(&mut self, index: usize, bytes: &[u8]) {
        for (link, direction) in &self.slots[index].devices {
            if *direction == Direction::ToClient {
                link.take_over_client(self.now, bytes);
            }
        }
        self.release_device_readers();
    }

    /// Another mode of steps for node `index` from now on: the period of its grid, which goes on at its present phase.
    pub fn set_period(&mut self, index: usize, period_ns: u64) {
        let slot = &mut self.slots[index];
        slot.spec.period_ns = Some(period_ns);
        if let Some(running) = &mut slot.running {
            running.set_period(period_ns);
        }
        self.plan(index);
    }
}
