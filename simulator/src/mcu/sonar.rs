//! When each disc fires: one ping per array every cycle, both arrays at once, in the order that POLLING gave.

use drivers::p2os::sip::Readings;
use runtime::Time;

/// Discs in one array.
const ARRAY: usize = 8;
/// Arrays that a P3-DX has.
pub(super) const ARRAYS: usize = 2;
/// Entries of an array's firing order.
const MAX_ORDER: usize = 16;
/// Readings that fit a SIP beside its other fields.
const MAX_NEW: usize = 50;
/// Least and greatest time per ping [ms].
const CYCLE_MS: std::ops::RangeInclusive<i32> = 2..=120;

/// The firing unit.
#[derive(Debug, Clone, Copy)]
pub(super) struct SonarUnit {
    order: [[u8; MAX_ORDER]; ARRAYS],
    length: [usize; ARRAYS],
    turn: [usize; ARRAYS],
    on: [bool; ARRAYS],
    next: Time,
    /// New since the last SIP.
    pub fresh: Readings,
}

impl SonarUnit {
    /// Both arrays on, left to right.
    pub fn new() -> SonarUnit {
        let mut unit = SonarUnit {
            order: [[0; MAX_ORDER]; ARRAYS],
            length: [ARRAY; ARRAYS],
            turn: [0; ARRAYS],
            on: [true; ARRAYS],
            next: Time::ZERO,
            fresh: Readings::EMPTY,
        };
        for (array, order) in unit.order.iter_mut().enumerate() {
            for (place, disc) in order.iter_mut().enumerate() {
                *disc = (array * ARRAY + place % ARRAY) as u8;
            }
        }
        unit
    }

    /// Begins to fire at `now`.
    pub fn start(&mut self, now: Time) {
        self.next = now;
        self.turn = [0; ARRAYS];
        self.fresh = Readings::EMPTY;
    }

    /// SONAR: bit 0 on or off; bits 1 to 3 one array, none: all.
    pub fn switch(&mut self, argument: i32) {
        let on = argument & 1 != 0;
        match (argument >> 1) & 0b111 {
            0 => self.on = [on; ARRAYS],
            array => {
                if let Some(state) = self.on.get_mut(array as usize - 1) {
                    *state = on;
                }
            }
        }
    }

    /// POLLING: sonar numbers from 1 in firing order; none switches all off.
    pub fn poll(&mut self, numbers: &[u8]) {
        self.length = [0; ARRAYS];
        self.turn = [0; ARRAYS];
        for number in numbers {
            let Some(disc) = number.checked_sub(1).filter(|disc| usize::from(*disc) < ARRAYS * ARRAY) else { continue };
            let array = usize::from(disc) / ARRAY;
            if let Some(entry) = self.order[array].get_mut(self.length[array]) {
                *entry = disc;
                self.length[array] += 1;
            }
        }
    }

    /// Whether array `array` fires.
    pub fn is_on(&self, array: usize) -> bool {
        self.on[array] && self.length[array] > 0
    }

    /// SONARCYCLE, bounded as the firmware bounds it.
    pub fn cycle_ms(argument: i32) -> u8 {
        argument.clamp(*CYCLE_MS.start(), *CYCLE_MS.end()) as u8
    }

    /// Fires what is due up to `now`; `range_units` answers a disc's reading, `other` the disc that fires with it.
    pub fn fire(&mut self, now: Time, cycle_ms: u8, mut range_units: impl FnMut(usize, Option<usize>) -> u16) {
        while self.next <= now {
            self.next = self.next.after_ns(u64::from(cycle_ms) * 1_000_000);
            let mut firing = [None; ARRAYS];
            for (array, disc) in firing.iter_mut().enumerate() {
                if self.is_on(array) {
                    *disc = Some(usize::from(self.order[array][self.turn[array]]));
                    self.turn[array] = (self.turn[array] + 1) % self.length[array];
                }
            }
            for (array, disc) in firing.iter().enumerate() {
                if let Some(disc) = disc.filter(|_| self.fresh.len() < MAX_NEW) {
                    self.fresh.push(disc as u8, range_units(disc, firing[1 - array]));
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fired(unit: &mut SonarUnit, from_ms: u64, to_ms: u64) -> Vec<u8> {
        unit.fresh = Readings::EMPTY;
        for ms in (from_ms..to_ms).step_by(10) {
            unit.fire(Time::from_nanos(ms * 1_000_000), 40, |_, _| 1);
        }
        unit.fresh.iter().map(|reading| reading.number).collect()
    }

    #[test]
    fn two_or_three_discs_of_each_array_fire_per_tenth_of_a_second() {
        let mut unit = SonarUnit::new();
        unit.start(Time::ZERO);
        assert_eq!(fired(&mut unit, 0, 100), [0, 8, 1, 9, 2, 10]);
        assert_eq!(fired(&mut unit, 100, 200), [3, 11, 4, 12]);
        assert_eq!(fired(&mut unit, 200, 320), [5, 13, 6, 14, 7, 15]);
        assert_eq!(fired(&mut unit, 320, 330), [0, 8]);
    }

    #[test]
    fn polling_gives_the_order_and_an_empty_list_silence() {
        let mut unit = SonarUnit::new();
        unit.start(Time::ZERO);
        unit.poll(&[4, 5, 4, 12, 0, 40]);
        assert_eq!(fired(&mut unit, 0, 120), [3, 11, 4, 11, 3, 11]);
        unit.poll(&[]);
        assert!(fired(&mut unit, 120, 320).is_empty());
        assert!(!unit.is_on(0));
    }

    #[test]
    fn arrays_are_switched_together_or_apart() {
        let mut unit = SonarUnit::new();
        unit.switch(0b100);
        assert_eq!((unit.is_on(0), unit.is_on(1)), (true, false));
        unit.switch(0);
        assert_eq!((unit.is_on(0), unit.is_on(1)), (false, false));
        unit.switch(1);
        assert_eq!((unit.is_on(0), unit.is_on(1)), (true, true));
    }
}
