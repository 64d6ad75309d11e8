//! What a run was like for one body.

use crate::body::STANDING_M_S;
use messages::ContactCause;

/// Sums since the start of the run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Statistics {
    /// Simulated time [s].
    pub time_s: f64,
    /// Time during which the true speed along the body's axis exceeded 1 cm/s [s].
    pub moving_s: f64,
    /// Way of the centre of rotation, backwards counted too [m].
    pub distance_m: f64,
    /// Least distance of the outline from anything; +∞ in an empty world [m].
    pub least_clearance_m: f64,
    /// Contacts by cause: drove, reversed blind, suffered.
    pub contacts: [u64; 3],
    moving_distance_m: f64,
}

impl Default for Statistics {
    fn default() -> Statistics {
        Statistics {
            time_s: 0.0,
            moving_s: 0.0,
            distance_m: 0.0,
            least_clearance_m: f64::INFINITY,
            contacts: [0; 3],
            moving_distance_m: 0.0,
        }
    }
}

impl Statistics {
    /// Mean of the speed's magnitude over the time in which it exceeded 1 cm/s; 0 when it never did [m/s].
    pub fn mean_speed_m_s(&self) -> f64 {
        if self.moving_s > 0.0 { self.moving_distance_m / self.moving_s } else { 0.0 }
    }

    /// Contacts that the robot caused: it drove or reversed into something.
    pub fn contacts_caused(&self) -> u64 {
        self.contacts[ContactCause::Drove as usize] + self.contacts[ContactCause::ReversedBlind as usize]
    }

    /// Contacts that others caused.
    pub fn contacts_suffered(&self) -> u64 {
        self.contacts[ContactCause::Suffered as usize]
    }

    pub(crate) fn travelled(&mut self, way_m: f64, dt_s: f64) {
        self.time_s += dt_s;
        self.distance_m += way_m.abs();
        if way_m.abs() > STANDING_M_S * dt_s {
            self.moving_s += dt_s;
            self.moving_distance_m += way_m.abs();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mean_speed_leaves_the_standing_out() {
        let mut statistics = Statistics::default();
        assert_eq!(statistics.mean_speed_m_s(), 0.0);
        for _ in 0..100 {
            statistics.travelled(0.003, 0.01);
            statistics.travelled(-0.001, 0.01);
            statistics.travelled(0.00005, 0.01);
        }
        assert!((statistics.mean_speed_m_s() - 0.2).abs() < 1e-9);
        assert!((statistics.distance_m - 0.405).abs() < 1e-9 && (statistics.time_s - 3.0).abs() < 1e-9);
    }
}
