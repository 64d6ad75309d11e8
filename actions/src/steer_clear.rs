//! Turns away from whatever exerts a force above its sector's threshold (S1, Steer Clear).
//!
//! Reads `ranges` (the eight forward sonars count); writes `proposal` and `free_sectors`, once per packet.
//!
//! - Each packet in which some sector has M > 1 ([`crate::sectors`]) asks for one small turn (3°) away from the
//!   strongest of them: a turn rate that expires with the packet. Never a computed large turn.
//! - A packet brings new readings of a few discs only, and what they show beside the way is acted upon once. Where the
//!   turn away from one side leads towards a further problem on the other, the sums of force left and right are compared,
//!   over what is acted upon; where they balance, as between two jambs, it goes straight on.
//! - While something is straight ahead every packet turns, to the side with the smaller sum of all forces. That side is
//!   kept, unless the other has become clearly the freer one, and that not over and over: a corner would hold the robot
//!   by turning it to and fro.
//! - Blocked all round: a small turning reverse. So too when the small turns do not help: the readings stay as they are,
//!   which without odometry says that the robot does, or a full circle's worth of turns has not freed the way. Each
//!   further try is longer and of another kind ([`crate::escape`]), until the way has been free for a while.
//!
//! Without fresh beams: abstains.

use crate::escape::{Escape, EscapeConfig, Side, Way};
use crate::sectors::{Forces, MAX_SECTORS, Sector};
use messages::{Axis, Beam, FreeSectors, Proposal, Ranges};
use runtime::{Fault, Layer, Node, OpenError, Ports, Reader, Time, Writer};
use schemars::JsonSchema;
use serde::Deserialize;

/// Settings of [`SteerClear`].
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SteerClearConfig {
    /// Distance from which on nothing exerts a force [m].
    pub d_max_m: f64,
    /// b in M = (a − b·d)/T_s; a is b·d_max [1/m].
    pub b_per_m: f64,
    /// Sectors, rightmost first. Default: one per forward sonar of a Pioneer, S3 the middle pair (acts from 0.5 m on),
    /// S2 the next (0.4 m), S1 the periphery (0.3 m and 0.15 m).
    pub sectors: Vec<Sector>,
    /// Sectors whose middle is within this angle are straight ahead [rad].
    pub ahead_rad: f64,
    /// Sums of force left and right that differ by no more than this balance.
    pub balance: f64,
    /// A reading no older than this is new in its packet [s].
    pub renewed_s: f64,
    /// The side that is being turned to is given up when its sum of force exceeds the other's by more than this.
    pub switch_excess: f64,
    /// How often it is given up before the way has been free for a while.
    pub most_switches: u32,
    /// The small turn that a packet with an obstacle asks for [rad].
    pub turn_per_packet_rad: f64,
    /// Time between packets [s].
    pub packet_s: f64,
    /// Speed of the reverse [m/s].
    pub reverse_m_s: f64,
    /// When and how to get out of where turning does not help.
    pub escape: EscapeConfig,
    /// Packets without obstacle after which the past is forgotten.
    pub forget_packets: u32,
    /// Beams older than this do not count [s].
    pub max_beam_age_s: f64,
    /// Urgency of a turn, 0…1; a reverse must be obeyed.
    pub urgency: f64,
}

impl Default for SteerClearConfig {
    fn default() -> SteerClearConfig {
        let deg = std::f64::consts::PI / 180.0;
        let bounds = [-105.0, -70.0, -40.0, -20.0, 0.0, 20.0, 40.0, 70.0, 105.0];
        let thresholds = [2.85, 2.7, 2.6, 2.5, 2.5, 2.6, 2.7, 2.85];
        let sectors = (0..8)
            .map(|k| Sector { from_rad: bounds[k] * deg, to_rad: bounds[k + 1] * deg, threshold: thresholds[k] })
            .collect();
        SteerClearConfig {
            d_max_m: 3.0,
            b_per_m: 1.0,
            sectors,
            ahead_rad: 20.0 * deg,
            balance: 0.05,
            renewed_s: 0.05,
            switch_excess: 1.5,
            most_switches: 2,
            turn_per_packet_rad: 3.0 * deg,
            packet_s: 0.1,
            reverse_m_s: 0.1,
            escape: EscapeConfig::default(),
            forget_packets: 30,
            max_beam_age_s: 1.0,
            urgency: 0.5,
        }
    }
}

/// The node.
pub struct SteerClear {
    ranges: Reader<Ranges>,
    proposal: Writer<Proposal>,
    free_sectors: Writer<FreeSectors>,
    memory: Memory,
    /// Number of the packet that was answered last.
    answered: Option<(u64, u64)>,
    config: SteerClearConfig,
}

impl Node for SteerClear {
    const TYPE: &'static str = "steer_clear";
    const LAYER: Layer = Layer::Actions;
    type Config = SteerClearConfig;

    fn open(ports: &mut Ports, config: SteerClearConfig) -> Result<SteerClear, OpenError> {
        check(&config).map_err(OpenError::config)?;
        Ok(SteerClear {
            ranges: ports.reader("ranges")?,
            proposal: ports.writer("proposal")?,
            free_sectors: ports.writer("free_sectors")?,
            memory: Memory::default(),
            answered: None,
            config,
        })
    }

    fn step(&mut self, now: Time) -> Result<(), Fault> {
        let Some(ranges) = self.ranges.fresh(now) else { return Ok(()) };
        // One turn per packet: a step that was released by something else has nothing to say.
        let packet = Some((ranges.generation, ranges.sequence));
        if packet == self.answered {
            return Ok(());
        }
        self.answered = packet;
        let (proposal, free_sectors) = steer(ranges.tail, &self.config, &mut self.memory);
        self.proposal.write(now, &proposal);
        self.free_sectors.write(now, &free_sectors);
        Ok(())
    }
}

fn check(config: &SteerClearConfig) -> Result<(), String> {
    let c = config;
    for (key, value) in [
        ("d_max_m", c.d_max_m),
        ("b_per_m", c.b_per_m),
        ("packet_s", c.packet_s),
        ("turn_per_packet_rad", c.turn_per_packet_rad),
        ("max_beam_age_s", c.max_beam_age_s),
    ] {
        if !(value.is_finite() && value > 0.0) {
            return Err(format!("{key} = {value} must be a number greater than zero"));
        }
    }
    for (key, value) in [
        ("reverse_m_s", c.reverse_m_s),
        ("ahead_rad", c.ahead_rad),
        ("switch_excess", c.switch_excess),
        ("urgency", c.urgency),
    ] {
        if !(value.is_finite() && value >= 0.0) {
            return Err(format!("{key} = {value} must be a number, zero or greater"));
        }
    }
    if c.sectors.is_empty() || c.sectors.len() > MAX_SECTORS {
        return Err(format!("{} sectors are given; write 1 to {MAX_SECTORS}", c.sectors.len()));
    }
    let mut right_rad = f64::NEG_INFINITY;
    for (k, sector) in c.sectors.iter().enumerate() {
        if !(sector.threshold.is_finite() && sector.threshold > 0.0) {
            return Err(format!("sectors[{k}].threshold = {} must be a number greater than zero", sector.threshold));
        }
        if !(sector.from_rad >= right_rad && sector.to_rad > sector.from_rad && sector.to_rad.is_finite()) {
            return Err(format!(
                "sectors[{k}] must begin where sectors[{}] ends or left of it, and end left of its beginning",
                k.max(1) - 1
            ));
        }
        right_rad = sector.to_rad;
    }
    Ok(())
}

/// What is remembered from packet to packet.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Memory {
    /// The side that is being turned to because of something straight ahead.
    kept: Option<Side>,
    /// Times that the kept side was given up for the other since the way was last free for a while.
    switches: u32,
    /// Ways out of where turning does not help.
    escape: Escape,
    /// Packets without obstacle in a row.
    free: u32,
}

/// Answers one packet.
pub fn steer(beams: &[Beam], config: &SteerClearConfig, memory: &mut Memory) -> (Proposal, FreeSectors) {
    let (a, b) = (config.b_per_m * config.d_max_m, config.b_per_m);
    let forces = Forces::of(beams, &config.sectors, a, b, config.max_beam_age_s);
    let free_sectors = forces.free_sectors(&config.sectors);
    let sees = Sight::of(&forces, config);
    memory.take_in(&sees, &forces, config);
    let mut proposal = Proposal {
        urgency: config.urgency,
        // Half a packet longer, so that a packet that comes late does not interrupt the turn.
        valid_for_s: 1.5 * config.packet_s,
        ..Proposal::default()
    };
    let turn = |side: Side| Axis::exact(side.sign() * config.turn_per_packet_rad / config.packet_s);
    let no_forward = Axis { cap_positive: 0.0, ..Axis::NONE };
    if let Some(way_out) = memory.escape.way_out() {
        proposal.forward = match way_out.way {
            Way::Back => Axis { cap_positive: 0.0, ..Axis::exact(-config.reverse_m_s) },
            Way::Nowhere => no_forward,
            Way::On => Axis::NONE,
        };
        proposal.turn = way_out.side.map_or(Axis::NONE, turn);
        proposal.urgency = 1.0;
    } else if let Some(side) = sees.away(memory.kept, config.balance) {
        proposal.turn = turn(side);
        if sees.ahead && memory.escape.holds() {
            proposal.forward = no_forward;
        }
    }
    (proposal, free_sectors)
}

/// What is known after one packet.
#[derive(Debug, Clone, Copy)]
struct Sight {
    /// Whether this packet renewed a sector that is acted upon.
    renewed: bool,
    /// Whether some sector on the left, on the right, straight ahead is acted upon.
    left: bool,
    right: bool,
    ahead: bool,
    /// Whether every known sector is acted upon.
    blocked: bool,
    /// Sums of force over the sectors that are acted upon, and over all.
    left_sum: f64,
    right_sum: f64,
    left_all: f64,
    right_all: f64,
}

impl Sight {
    fn of(forces: &Forces, config: &SteerClearConfig) -> Sight {
        let mut sight = Sight {
            renewed: false,
            left: false,
            right: false,
            ahead: false,
            blocked: true,
            left_sum: 0.0,
            right_sum: 0.0,
            left_all: 0.0,
            right_all: 0.0,
        };
        for (k, sector) in config.sectors.iter().enumerate().take(forces.count) {
            let side = if sector.middle_rad() >= 0.0 { Side::Left } else { Side::Right };
            let (acts, force) = (forces.acts(k), forces.force[k]);
            let (any, sum, all) = match side {
                Side::Left => (&mut sight.left, &mut sight.left_sum, &mut sight.left_all),
                Side::Right => (&mut sight.right, &mut sight.right_sum, &mut sight.right_all),
            };
            *all += force;
            sight.blocked &= acts;
            if !acts {
                continue;
            }
            *any = true;
            *sum += force;
            sight.ahead |= sector.middle_rad().abs() <= config.ahead_rad;
            sight.renewed |= forces.age_s[k] <= config.renewed_s;
        }
        sight
    }

    /// By how much the sum of force on `side` exceeds the other side's.
    fn excess(&self, side: Side) -> f64 {
        (self.left_sum - self.right_sum) * side.sign()
    }

    fn acts(&self) -> bool {
        self.left || self.right
    }

    /// The side with less force.
    fn roomier(&self) -> Side {
        if self.left_all > self.right_all { Side::Right } else { Side::Left }
    }

    /// The side to turn to, if at all.
    fn away(&self, kept: Option<Side>, balance: f64) -> Option<Side> {
        if self.ahead {
            return kept.or(Some(self.roomier()));
        }
        let difference = self.left_sum - self.right_sum;
        let balanced = self.left && self.right && difference.abs() <= balance;
        if !self.renewed || balanced {
            return None;
        }
        Some(if difference > 0.0 { Side::Right } else { Side::Left })
    }
}

impl Memory {
    fn take_in(&mut self, sees: &Sight, forces: &Forces, config: &SteerClearConfig) {
        self.free = if sees.acts() { 0 } else { self.free.saturating_add(1) };
        if self.free >= config.forget_packets {
            *self = Memory { free: self.free, ..Memory::default() };
            return;
        }
        let worse = self.kept.is_some_and(|side| sees.excess(side) > config.switch_excess);
        if worse && self.switches < config.most_switches {
            self.kept = self.kept.map(Side::other);
            self.switches += 1;
        } else {
            self.kept = if sees.ahead { sees.away(self.kept, config.balance) } else { None };
        }
        let boxed_in = sees.blocked && sees.acts();
        let side = self.kept.unwrap_or(sees.roomier());
        self.escape.take_in(forces, sees.acts(), boxed_in, side, &config.escape);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use messages::Echo;
    use proptest::prelude::*;

    const BEARINGS_DEG: [f32; 8] = [90.0, 50.0, 30.0, 10.0, -10.0, -30.0, -50.0, -90.0];

    /// Beams of the eight forward sonars, leftmost first as the Pioneer counts them; 5 m and more is no echo.
    fn beams(ranges_m: [f32; 8]) -> Vec<Beam> {
        let beam = |k: usize| Beam {
            origin_x_m: 0.1,
            origin_y_m: 0.0,
            bearing_rad: BEARINGS_DEG[k].to_radians(),
            range_m: ranges_m[k],
            age_s: 0.0,
            echo: if ranges_m[k] >= 5.0 { Echo::Clear } else { Echo::Value } as u32,
        };
        (0..8).map(beam).collect()
    }

    fn turn_of(ranges_m: [f32; 8], memory: &mut Memory) -> f64 {
        let (proposal, _) = steer(&beams(ranges_m), &SteerClearConfig::default(), memory);
        if proposal.turn == Axis::NONE { 0.0 } else { proposal.turn.value }
    }

    const OPEN: [f32; 8] = [5.0; 8];

    fn with(changes: &[(usize, f32)]) -> [f32; 8] {
        let mut ranges = OPEN;
        for &(k, range_m) in changes {
            ranges[k] = range_m;
        }
        ranges
    }

    #[test]
    fn an_open_room_calls_for_no_turn() {
        let (proposal, free) = steer(&beams(OPEN), &SteerClearConfig::default(), &mut Memory::default());
        assert_eq!((proposal.turn, proposal.forward), (Axis::NONE, Axis::NONE));
        assert_eq!((free.free, free.longest_run, free.mask), (8, 8, 0xFF));
        assert!(free.run_bearing_rad.abs() < 1e-9);
    }

    #[test]
    fn an_obstacle_on_the_left_asks_for_three_degrees_to_the_right_per_packet() {
        let (proposal, free) = steer(&beams(with(&[(2, 0.35)])), &SteerClearConfig::default(), &mut Memory::default());
        let per_packet_rad = proposal.turn.value * 0.1;
        assert!((per_packet_rad + 3.0_f64.to_radians()).abs() < 1e-9, "{per_packet_rad}");
        assert!(proposal.valid_for_s < 0.2, "it expires with the packet");
        assert_eq!(free.free, 7);
    }

    #[test]
    fn the_front_reacts_farther_than_the_periphery() {
        assert!(turn_of(with(&[(3, 0.45)]), &mut Memory::default()) < 0.0);
        assert_eq!(turn_of(with(&[(0, 0.45)]), &mut Memory::default()), 0.0);
    }

    #[test]
    fn a_turn_that_leads_to_a_further_problem_gives_way_to_the_sums_of_force() {
        // The strongest is on the left, but the right is narrower as a whole.
        let ranges = with(&[(2, 0.2), (3, 0.4), (4, 0.45), (5, 0.25), (6, 0.2), (7, 0.1)]);
        assert!(turn_of(ranges, &mut Memory::default()) > 0.0);
    }

    #[test]
    fn the_side_is_kept_while_something_is_straight_ahead() {
        let mut memory = Memory::default();
        assert!(turn_of(with(&[(3, 0.3), (4, 0.35)]), &mut memory) < 0.0);
        assert!(turn_of(with(&[(3, 0.35), (4, 0.3)]), &mut memory) < 0.0, "not to and fro in a corner");
    }

    #[test]
    fn between_jambs_it_goes_straight_on_where_the_forces_balance_and_else_turns_to_the_freer_side() {
        let mut memory = Memory::default();
        assert_eq!(turn_of(with(&[(0, 0.10), (7, 0.13)]), &mut memory), 0.0);
        assert!(turn_of(with(&[(0, 0.08), (1, 0.2), (7, 0.10)]), &mut memory) < 0.0);
        assert!(turn_of(with(&[(0, 0.10), (6, 0.2), (7, 0.08)]), &mut memory) > 0.0);
    }

    #[test]
    fn what_stands_beside_the_way_is_acted_upon_once_per_reading() {
        let mut jamb = beams(with(&[(1, 0.2)]));
        let (config, mut memory) = (SteerClearConfig::default(), Memory::default());
        assert!(steer(&jamb, &config, &mut memory).0.turn.value < 0.0);
        jamb.iter_mut().for_each(|beam| beam.age_s = 0.1);
        assert_eq!(steer(&jamb, &config, &mut memory).0.turn, Axis::NONE);
    }

    #[test]
    fn blocked_all_round_it_backs_out_turning() {
        let mut memory = Memory::default();
        let (proposal, free) = steer(&beams([0.1; 8]), &SteerClearConfig::default(), &mut memory);
        assert_eq!(proposal.forward.value, -0.1);
        assert_eq!((proposal.forward.cap_positive, proposal.urgency), (0.0, 1.0));
        assert!(proposal.turn.value != 0.0);
        assert_eq!(free.free, 0);
    }

    #[test]
    fn readings_that_stay_as_they_are_while_it_turns_end_in_a_reverse() {
        let config = SteerClearConfig::default();
        let mut memory = Memory::default();
        let dead_end = beams(with(&[(3, 0.3), (4, 0.3)]));
        let packets = (1..100).find(|_| steer(&dead_end, &config, &mut memory).0.forward.value < 0.0);
        assert_eq!(packets, Some(config.escape.still_packets + 1));
    }

    #[test]
    fn without_beams_it_abstains() {
        let (proposal, free) = steer(&[], &SteerClearConfig::default(), &mut Memory::default());
        assert_eq!((proposal.forward, proposal.turn, free.free), (Axis::NONE, Axis::NONE, 0));
    }

    #[test]
    fn a_setting_out_of_bounds_is_named() {
        assert_eq!(check(&SteerClearConfig::default()), Ok(()));
        let mut config = SteerClearConfig::default();
        config.sectors[3].threshold = 0.0;
        assert!(check(&config).unwrap_err().starts_with("sectors[3].threshold"));
        config = SteerClearConfig::default();
        config.sectors.swap(0, 1);
        assert!(check(&config).unwrap_err().starts_with("sectors[1]"));
    }

    proptest! {
        #[test]
        fn whatever_the_beams_say_the_proposal_is_a_number_and_small(
            packets in prop::collection::vec(prop::array::uniform8(prop_oneof![0.0..6.0f32, Just(f32::NAN)]), 1..60),
        ) {
            let config = SteerClearConfig::default();
            let mut memory = Memory::default();
            let most = config.turn_per_packet_rad / config.packet_s;
            for packet in packets {
                let (proposal, free) = steer(&beams(packet), &config, &mut memory);
                prop_assert!(proposal.turn.value.abs() <= most && proposal.forward.value.abs() <= config.reverse_m_s);
                prop_assert!(free.force.iter().all(|m| m.is_finite()));
                prop_assert!(free.longest_run <= free.free && free.free <= free.sectors);
            }
        }

        #[test]
        fn left_and_right_are_treated_alike(packet in prop::array::uniform8(0.05..5.0f32)) {
            let mut mirrored = packet;
            mirrored.reverse();
            let one = turn_of(packet, &mut Memory::default());
            let other = turn_of(mirrored, &mut Memory::default());
            prop_assert!((one + other).abs() < 1e-12);
        }
    }
}
