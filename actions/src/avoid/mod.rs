//! Avoids what stands in the way, and what will (S2, Avoid).
//!
//! Reads `ranges`, `tracks` (optional: moving things count where they will be, too) and `detour` (optional: the
//! coordinator's word on a local minimum); writes `proposal` and `room`. Active while something is nearer than the safe
//! distance in the region of interest ahead ([`pass`]), and during a detour ([`detour`]); otherwise, and without fresh
//! ranges, it abstains.

pub mod detour;
pub mod horizon;
pub mod pass;

use horizon::Horizon;
use messages::{Axis, Beam, Detour, Proposal, Ranges, Room, Side, Track, Tracks};
use pass::{Passing, velocity_shares};
use runtime::{Body, Fault, Layer, Node, OpenError, Ports, Reader, Time, Writer};
use schemars::JsonSchema;
use serde::Deserialize;

/// Settings of [`Avoid`].
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct AvoidConfig {
    /// Obstacles nearer than this to the body's centre are avoided [m].
    pub safe_m: f64,
    /// Nothing shall come nearer to the body than this [m].
    pub danger_m: f64,
    /// Room on either side of the body on a detour [m].
    pub detour_margin_m: f64,
    /// Greatest speed [m/s].
    pub max_speed_m_s: f64,
    /// Greatest turn rate [rad/s].
    pub max_turn_rad_s: f64,
    /// An obstacle within this angle of straight ahead is dead ahead: passed on the roomier side [rad].
    pub dead_ahead_rad: f64,
    /// Ranges count up to this in the judgement of the roomier side [m].
    pub room_m: f64,
    /// Moving things count where they will be within this time [s].
    pub ahead_s: f64,
    /// Moving things are taken to be at least this big (radius) [m].
    pub walker_radius_m: f64,
    /// Urgency of the proposal, 0…1.
    pub urgency: f64,
    /// How long a proposal counts [s].
    pub valid_for_s: f64,
}

impl Default for AvoidConfig {
    fn default() -> AvoidConfig {
        AvoidConfig {
            safe_m: 0.8,
            danger_m: 0.1,
            detour_margin_m: 0.08,
            max_speed_m_s: 0.4,
            max_turn_rad_s: 0.8,
            dead_ahead_rad: 0.17,
            room_m: 3.0,
            ahead_s: 1.0,
            walker_radius_m: 0.25,
            urgency: 0.7,
            valid_for_s: 0.3,
        }
    }
}

/// The node.
pub struct Avoid {
    ranges: Reader<Ranges>,
    tracks: Reader<Tracks>,
    detour: Reader<Detour>,
    proposal: Writer<Proposal>,
    room: Writer<Room>,
    avoidance: Avoidance,
}

impl Node for Avoid {
    const TYPE: &'static str = "avoid";
    const LAYER: Layer = Layer::Actions;
    type Config = AvoidConfig;

    fn open(ports: &mut Ports, config: AvoidConfig) -> Result<Avoid, OpenError> {
        check(&config).map_err(OpenError::config)?;
        let avoidance = Avoidance::new(ports.body(), config);
        Ok(Avoid {
            ranges: ports.reader("ranges")?,
            tracks: ports.optional_reader("tracks")?,
            detour: ports.optional_reader("detour")?,
            proposal: ports.writer("proposal")?,
            room: ports.writer("room")?,
            avoidance,
        })
    }

    fn step(&mut self, now: Time) -> Result<(), Fault> {
        let config = self.avoidance.config;
        let Some(ranges) = self.ranges.fresh(now) else {
            self.avoidance.side = Side::None;
            self.proposal.write(now, &Proposal { valid_for_s: config.valid_for_s, ..Proposal::default() });
            return Ok(());
        };
        self.avoidance.look(ranges.message, ranges.tail);
        if let Some(tracks) = self.tracks.fresh(now) {
            self.avoidance.expect(tracks.tail, tracks.path_step_s);
        }
        let detour = self.detour.fresh(now).map(|detour| *detour.message).filter(|detour| detour.side != 0);
        let (proposal, room) = self.avoidance.decide(detour.as_ref());
        self.proposal.write(now, &proposal);
        self.room.write(now, &room);
        Ok(())
    }
}

/// What is ahead, and what to propose about it.
#[derive(Debug, Clone)]
pub struct Avoidance {
    /// What is ahead now.
    pub horizon: Horizon,
    passing: Passing,
    side: Side,
    config: AvoidConfig,
}

impl Avoidance {
    /// For a body.
    pub fn new(body: &Body, config: AvoidConfig) -> Avoidance {
        let passing = Passing {
            radius_m: body.half_width_m.max(body.length_ahead_m),
            danger_m: config.danger_m,
            safe_m: config.safe_m,
            dead_ahead_rad: config.dead_ahead_rad,
            room_m: config.room_m,
        };
        Avoidance { horizon: Horizon::default(), passing, side: Side::None, config }
    }

    /// Takes in what is around now.
    pub fn look(&mut self, ranges: &Ranges, beams: &[Beam]) {
        self.horizon.clear();
        self.horizon.take(ranges, beams);
    }

    /// Takes in where moving things will be; their paths have a point every `step_s`.
    pub fn expect(&mut self, tracks: &[Track], step_s: f64) {
        for track in tracks.iter().filter(|track| track.moves()) {
            self.horizon.add_path(track, step_s, self.config.ahead_s, self.config.walker_radius_m);
        }
    }

    /// The proposal for the present horizon, and the room in it.
    pub fn decide(&mut self, detour: Option<&Detour>) -> (Proposal, Room) {
        let (passing, config, horizon) = (&self.passing, &self.config, &self.horizon);
        let obstacle = passing.obstacle(horizon);
        let (right_m, left_m) = horizon.room_m(config.room_m);
        let bearing = detour.map_or(0.0, |detour| detour.bearing_rad);
        let is_ahead = bearing.abs() <= std::f64::consts::FRAC_PI_2;
        let width_m = passing.radius_m + config.detour_margin_m;
        let mut room = Room {
            nearest_m: obstacle.map_or(f64::INFINITY, |obstacle| obstacle.nearest_m),
            nearest_bearing_rad: obstacle.map_or(0.0, |o| o.nearest_rad - std::f64::consts::FRAC_PI_2),
            left_m,
            right_m,
            // What lies behind the body is not seen.
            towards_m: if is_ahead { horizon.free_m(bearing, width_m, config.room_m) } else { 0.0 },
            ..Room::default()
        };
        let shares = match (detour, obstacle) {
            (Some(detour), _) => {
                self.side = if detour.side == Side::Right as u32 { Side::Right } else { Side::Left };
                let way = detour::around(horizon, self.side, bearing, width_m, config.safe_m);
                room.direction_rad = way.direction_rad;
                Some(velocity_shares(way.direction_rad, way.free_m / config.safe_m))
            }
            (None, Some(obstacle)) => {
                self.side = passing.side(&obstacle, horizon, self.side);
                room.direction_rad = passing.direction_rad(&obstacle, self.side);
                Some(velocity_shares(room.direction_rad, obstacle.nearest_m / config.safe_m))
            }
            (None, None) => {
                self.side = Side::None;
                None
            }
        };
        room.active = u32::from(shares.is_some());
        room.side = self.side as u32;
        let mut proposal = Proposal { valid_for_s: config.valid_for_s, urgency: config.urgency, ..Proposal::default() };
        if let Some((speed_share, turn_share)) = shares {
            proposal.forward = Axis::exact(speed_share * config.max_speed_m_s);
            proposal.turn = Axis::exact(turn_share * config.max_turn_rad_s);
        }
        (proposal, room)
    }
}

fn check(config: &AvoidConfig) -> Result<(), String> {
    let c = config;
    for (key, value) in [
        ("safe_m", c.safe_m),
        ("max_speed_m_s", c.max_speed_m_s),
        ("max_turn_rad_s", c.max_turn_rad_s),
        ("room_m", c.room_m),
        ("urgency", c.urgency),
        ("valid_for_s", c.valid_for_s),
    ] {
        if !(value > 0.0 && value.is_finite()) {
            return Err(format!("{key} = {value} must be a number above 0"));
        }
    }
    for (key, value) in [
        ("danger_m", c.danger_m),
        ("detour_margin_m", c.detour_margin_m),
        ("dead_ahead_rad", c.dead_ahead_rad),
        ("ahead_s", c.ahead_s),
        ("walker_radius_m", c.walker_radius_m),
    ] {
        if !(value >= 0.0 && value.is_finite()) {
            return Err(format!("{key} = {value} must be a number, zero or greater"));
        }
    }
    if c.danger_m >= c.safe_m {
        return Err(format!("danger_m = {} must be less than safe_m = {}", c.danger_m, c.safe_m));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn avoidance(discs: &[(f64, f64, f64)]) -> Avoidance {
        let body = Body { length_ahead_m: 0.25, half_width_m: 0.25, ..Body::default() };
        let mut avoidance = Avoidance::new(&body, AvoidConfig::default());
        discs.iter().for_each(|&(x, y, radius)| avoidance.horizon.add_disc(x, y, radius));
        avoidance
    }

    #[test]
    fn in_the_open_it_abstains() {
        let (proposal, room) = avoidance(&[]).decide(None);
        assert_eq!((proposal.forward, proposal.turn), (Axis::NONE, Axis::NONE));
        assert_eq!((room.active, room.nearest_m, room.towards_m), (0, f64::INFINITY, 3.0));
    }

    #[test]
    fn it_turns_away_and_slows_before_an_obstacle() {
        let (proposal, room) = avoidance(&[(0.7, -0.1, 0.1)]).decide(None);
        assert!(proposal.turn.value > 0.0 && proposal.forward.value < 0.4 && proposal.forward.value >= 0.0);
        assert_eq!((room.active, room.side), (1, Side::Left as u32));
    }

    #[test]
    fn on_a_detour_it_is_active_in_the_open_too() {
        let detour = Detour { side: Side::Left as u32, bearing_rad: -0.4, ..Detour::default() };
        let (proposal, room) = avoidance(&[]).decide(Some(&detour));
        assert!(proposal.forward.value > 0.0 && proposal.turn.value < 0.0);
        assert_eq!((room.active, room.towards_m), (1, 3.0));
        let behind = Detour { bearing_rad: 2.0, ..detour };
        assert_eq!(avoidance(&[]).decide(Some(&behind)).1.towards_m, 0.0, "what lies behind is not seen");
    }

    #[test]
    fn a_setting_out_of_bounds_is_named() {
        assert_eq!(check(&AvoidConfig::default()), Ok(()));
        assert!(check(&AvoidConfig { safe_m: f64::NAN, ..AvoidConfig::default() }).unwrap_err().contains("safe_m"));
        let config = AvoidConfig { danger_m: 0.9, ..AvoidConfig::default() };
        assert_eq!(check(&config).unwrap_err(), "danger_m = 0.9 must be less than safe_m = 0.8");
    }
}
