//! A lead-acid battery that slowly runs down.

/// Voltage when full [V].
const FULL_V: f64 = 12.7;
/// Voltage at which nothing is left [V].
const EMPTY_V: f64 = 10.5;
/// Fall per hour at rest and, on top of it, while the motors turn [V/h].
const REST_V_PER_H: f64 = 0.3;
const MOTION_V_PER_H: f64 = 0.4;

/// The battery.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Battery {
    volts: f64,
    /// BATTEST: pretended voltage [dV]; 0 for none.
    pretended_dv: u16,
}

impl Battery {
    pub fn new(volts: f64) -> Battery {
        Battery { volts, pretended_dv: 0 }
    }

    /// Lets time pass.
    pub fn drain(&mut self, dt_s: f64, moves: bool) {
        let per_hour = if moves { REST_V_PER_H + MOTION_V_PER_H } else { REST_V_PER_H };
        self.volts = (self.volts - per_hour * dt_s / 3600.0).max(0.0);
    }

    /// BATTEST.
    pub fn pretend(&mut self, decivolts: i32) {
        self.pretended_dv = decivolts.clamp(0, 255) as u16;
    }

    /// Voltage as the controller measures it [dV].
    pub fn decivolts(&self) -> u16 {
        if self.pretended_dv > 0 { self.pretended_dv } else { (self.volts * 10.0).round() as u16 }
    }

    /// What is left [%].
    pub fn charge_percent(&self) -> u8 {
        let volts = f64::from(self.decivolts()) / 10.0;
        (100.0 * (volts - EMPTY_V) / (FULL_V - EMPTY_V)).clamp(0.0, 100.0).round() as u8
    }
}

impl Default for Battery {
    fn default() -> Battery {
        Battery::new(FULL_V)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_hour_of_driving_costs_more_than_an_hour_of_rest() {
        let (mut rests, mut drives) = (Battery::default(), Battery::default());
        for _ in 0..3600 {
            rests.drain(1.0, false);
            drives.drain(1.0, true);
        }
        assert_eq!((rests.decivolts(), drives.decivolts()), (124, 120));
        assert!(drives.charge_percent() < rests.charge_percent());
    }

    #[test]
    fn a_pretended_voltage_hides_the_true_one() {
        let mut battery = Battery::default();
        battery.pretend(108);
        assert_eq!(battery.decivolts(), 108);
        battery.pretend(0);
        assert_eq!((battery.decivolts(), battery.charge_percent()), (127, 100));
    }
}
