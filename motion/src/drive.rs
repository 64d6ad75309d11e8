//! Wanted velocity to the command for the wheels, within the body's limits and the room that it has.
//!
//! Reads `velocity` (what the coordinator wants), `ranges` (a set: every ranger that watches over the body), `fallback`
//! (optional: a ranger that is asked while the whole set is silent), `base` (bumpers, stalls, readiness), `odometry`
//! (optional: to carry what was seen to now, and to remember it: [`crate::memory`]), `tracks` (optional: what moves), `timing` and `driver_timing` (optional: how
//! this node and the driver kept time in this run). Writes `command`, `wheels` and `state`.
//!
//! The stop latch stands above all: while it does not allow motion, zero is sent at once, and no power is wanted.
//! Otherwise, in this order: nothing or a stale velocity is zero; what the supervisor lets through
//! ([`crate::restraint`]); greatest speeds, of the body and of its wheels ([`crate::kinematics`]); barred directions after
//! a bump or a stall; the blind cap where no ranger looks; time to collision with what moves ([`crate::guard_zone`]); the
//! stop zone along the swept footprint ([`crate::zone`]); ramps, where the robot file says so without jerks
//! ([`crate::profile`]). Whatever is missing makes the result slower, never faster.

use crate::footprint::{Footprint, Velocity};
use crate::guard_zone::{GuardZoneConfig, MOVERS, Mover, take_movers};
use crate::kinematics::Kinematics;
use crate::memory::{self, Memory, MemoryConfig, Place};
use crate::obstacles::Obstacles;
use crate::reaction::Reaction;
use crate::restraint::{LimpLimits, explain, restrain};
use crate::safe_motion::{SafeMotion, Surroundings};
use messages::{
    BaseState, Command, MotionState, NodeStatistics, Odometry, Ranges, SupervisorState, Tracks, Twist, WheelVelocities,
};
use runtime::{Fault, Layer, Node, OpenError, Ports, Reader, Set, StopLatch, Time, Writer, math};
use schemars::JsonSchema;
use serde::Deserialize;

/// Settings of [`Drive`]. The body's size and greatest values come from the robot file's `[body]`.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct DriveConfig {
    /// Longest time from an obstacle's coming into sight to a sample that shows it [s].
    pub sense_s: f64,
    /// Longest time from that sample to the wheels' first slowing; longer where this run's own times are [s].
    pub react_s: f64,
    /// The device's part of that, from the driver's bytes to the wheels' first slowing [s].
    pub actuate_s: f64,
    /// Way left between the body and an obstacle when it has come to rest [m].
    pub margin_m: f64,
    /// Greatest pace of any point of the body when it creeps [m/s].
    pub creep_m_s: f64,
    /// Way left when the body has come to rest from creeping [m].
    pub creep_margin_m: f64,
    /// Added to either side of the body [m].
    pub side_margin_m: f64,
    /// Added to either side, too, at 0.15 m/s or faster, in proportion when slower [m].
    pub speed_margin_m: f64,
    /// Added all round when it turns at 0.3 rad/s or faster, in proportion when slower [m].
    pub turn_margin_m: f64,
    /// How much of either edge is cut off at the body's corners; 0 for a plain rectangle [m].
    pub cut_corners_m: f64,
    /// A direction that no beam younger than this looks along is blind [s].
    pub looks_max_age_s: f64,
    /// Greatest turn rate while no ranger sees anything anywhere [rad/s].
    pub blind_turn_rad_s: f64,
    /// Greatest speed on the way out of a protective stop [m/s].
    pub way_out_m_s: f64,
    /// How long a bumper or a stall must be over before motion goes on [s].
    pub release_after_s: f64,
    /// Whether a protective stop ends by itself; otherwise somebody must also have wanted zero.
    pub release_by_itself: bool,
    /// How long a command counts [s].
    pub command_valid_s: f64,
    /// Whether motor power is wanted.
    pub enable_motors: bool,
    /// The wheels, where their speeds are to be kept within bounds and told.
    pub kinematics: Option<Kinematics>,
    /// Greatest change of the acceleration where nothing forces a stop; unbounded when left out [m/s³].
    pub max_jerk_m_s3: Option<f64>,
    /// Greatest change of the turn acceleration, likewise [rad/s³].
    pub max_turn_jerk_rad_s3: Option<f64>,
    /// How much time things that move are given.
    pub guard_zone: GuardZoneConfig,
    /// Obstacles farther away than this are left out [m].
    pub horizon_m: f64,
    /// Most points of obstacles.
    pub capacity: usize,
    /// Where rangers of narrow beams do not see all round: what has left their sight is remembered.
    pub memory: Option<MemoryConfig>,
}

impl Default for DriveConfig {
    fn default() -> DriveConfig {
        DriveConfig {
            sense_s: 0.1,
            react_s: 0.2,
            actuate_s: 0.03,
            margin_m: 0.04,
            creep_m_s: 0.05,
            creep_margin_m: 0.015,
            side_margin_m: 0.01,
            speed_margin_m: 0.01,
            turn_margin_m: 0.015,
            cut_corners_m: 0.0,
            looks_max_age_s: 0.6,
            blind_turn_rad_s: 0.2,
            way_out_m_s: 0.05,
            release_after_s: 0.5,
            release_by_itself: true,
            command_valid_s: 0.3,
            enable_motors: true,
            kinematics: None,
            max_jerk_m_s3: None,
            max_turn_jerk_rad_s3: None,
            guard_zone: GuardZoneConfig::default(),
            horizon_m: 1.5,
            capacity: 512,
            memory: None,
        }
    }
}

/// The node.
pub struct Drive {
    velocity: Reader<Twist>,
    ranges: Set<Ranges>,
    fallback: Reader<Ranges>,
    base: Reader<BaseState>,
    odometry: Reader<Odometry>,
    tracks: Reader<Tracks>,
    movers: Vec<Mover>,
    timing: Reader<NodeStatistics>,
    driver_timing: Reader<NodeStatistics>,
    supervision: Reader<SupervisorState>,
    limp: LimpLimits,
    reaction: Reaction,
    command: Writer<Command>,
    wheels: Writer<WheelVelocities>,
    state: Writer<MotionState>,
    latch: StopLatch,
    obstacles: Obstacles,
    memory: Option<Memory>,
    /// What is remembered where the body stands is none.
    under_body: Footprint,
    /// Tells whether the set of ranges is another than at the last step.
    fingerprint: Fingerprint,
    last_step: Option<Time>,
    safe: SafeMotion,
    config: DriveConfig,
}

impl Node for Drive {
    const TYPE: &'static str = "drive";
    const LAYER: Layer = Layer::Motion;
    type Config = DriveConfig;

    fn open(ports: &mut Ports, config: DriveConfig) -> Result<Drive, OpenError> {
        check(&config).map_err(OpenError::config)?;
        let safe = SafeMotion::new(ports.body(), &config);
        Ok(Drive {
            velocity: ports.reader("velocity")?,
            ranges: ports.set("ranges")?,
            fallback: ports.optional_reader("fallback")?,
            base: ports.reader("base")?,
            odometry: ports.optional_reader("odometry")?,
            tracks: ports.optional_reader("tracks")?,
            movers: Vec::with_capacity(MOVERS),
            timing: ports.optional_reader("timing")?,
            driver_timing: ports.optional_reader("driver_timing")?,
            supervision: ports.supervision(),
            limp: LimpLimits::of(ports.limp(), ports.body().blind_cap_m_s),
            reaction: Reaction::new(config.react_s, config.actuate_s),
            command: ports.writer("command")?,
            wheels: ports.writer("wheels")?,
            state: ports.writer("state")?,
            latch: ports.stop_latch(),
            obstacles: Obstacles::with_room_for(
                config.capacity,
                config.memory.map_or(0, |memory| memory.capacity),
                config.horizon_m,
            ),
            memory: config.memory.map(Memory::new),
            under_body: Footprint::of(ports.body(), config.cut_corners_m).shrunk(UNDER_BODY_M),
            fingerprint: Fingerprint::default(),
            last_step: None,
            safe,
            config,
        })
    }

    fn step(&mut self, now: Time) -> Result<(), Fault> {
        self.take_ranges(now);
        let gap_s = self.last_step.map_or(0.0, |last| now.since(last));
        let dt_s = gap_s.min(LONGEST_STEP_S);
        self.last_step = Some(now);
        self.measure(gap_s);
        let asked = self.velocity.fresh(now).map(|twist| velocity_of(&twist));
        let supervised = self.supervision.latest().map(|state| *state.message);
        let (wanted, restrained) = match asked.filter(|v| v.is_finite()) {
            Some(asked) => {
                let (wanted, stop) = restrain(asked, supervised.as_ref(), self.limp);
                (Some(wanted), stop)
            }
            None => (None, None),
        };
        let measured = self.odometry.fresh(now).map(|odometry| velocity_of(&odometry.velocity));
        let measured = measured.filter(|v| v.is_finite()).unwrap_or(self.safe.sent());
        let base = self.base.fresh(now).map(|base| *base.message);
        let seen = self.obstacles.carry(now, measured, self.ranges.max_age_s());
        self.recall(now);
        self.movers.clear();
        if let Some(tracks) = self.tracks.fresh(now) {
            take_movers(&mut self.movers, tracks.tail, now.since(tracks.stamp), measured);
        }
        let surroundings = Surroundings { points: self.obstacles.points(), seen, movers: &self.movers };
        let moves = self.latch.allows_motion();
        let decided = self.safe.decide(now, dt_s, wanted.filter(|_| moves), base.as_ref(), &surroundings);
        let explained = explain(decided, asked, restrained);
        let state = if moves { explained } else { self.safe.halt(explained) };
        let command = Command {
            velocity: state.sent,
            valid_for_s: self.config.command_valid_s,
            enable: u64::from(self.config.enable_motors && moves),
        };
        self.command.write(now, &command);
        if let Some(kinematics) = &self.config.kinematics {
            self.wheels.write(now, &kinematics.wheels(velocity_of(&state.sent)));
        }
        self.state.write(now, &state);
        Ok(())
    }
}

/// What overlaps the body's edge by no more than this may be there in truth [m].
const UNDER_BODY_M: f64 = 0.03;
/// A pose is carried on by its velocity for no longer than this [s].
const LONGEST_EXTRAPOLATION_S: f64 = 0.3;
/// A step after a longer pause counts as this long, so that no pause allows a jump [s].
const LONGEST_STEP_S: f64 = 0.1;

impl Drive {
    /// Reckons with the times of this run.
    fn measure(&mut self, gap_s: f64) {
        self.reaction.stepped(gap_s);
        if let Some(statistics) = self.timing.latest() {
            self.reaction.own(&statistics);
        }
        if let Some(statistics) = self.driver_timing.latest() {
            self.reaction.driver(&statistics);
        }
        self.safe.reckon_with(self.config.sense_s + self.reaction.seconds());
    }

    /// Turns beams into points again, if there are other samples than at the last step.
    fn take_ranges(&mut self, now: Time) {
        let max_age_s = self.ranges.max_age_s();
        let mut fingerprint = Fingerprint::default();
        let mut silent = true;
        self.ranges.each(|_, sample| {
            silent &= now.since(sample.stamp) > max_age_s;
            fingerprint.add(sample.sequence, sample.generation);
        });
        let fallback = if silent { self.fallback.fresh(now) } else { None };
        if let Some(sample) = &fallback {
            fingerprint.add(sample.sequence, !sample.generation);
        }
        if fingerprint == self.fingerprint {
            return;
        }
        self.fingerprint = fingerprint;
        let obstacles = &mut self.obstacles;
        obstacles.clear();
        let (memory, odometry, mut ranger) = (&mut self.memory, &mut self.odometry, 0);
        match fallback {
            Some(sample) => obstacles.take(sample.stamp, sample.message, sample.tail),
            None => self.ranges.each(|_, sample| {
                obstacles.take(sample.stamp, sample.message, sample.tail);
                if let Some(memory) = memory.as_mut().filter(|_| f64::from(sample.beam_width_rad) < memory::NARROW_RAD)
                    && let Some(place) = place_at(odometry, sample.stamp, memory)
                {
                    memory.take(ranger, sample.stamp, &place, sample.tail);
                }
                ranger += 1;
            }),
        }
    }

    /// Adds what is remembered to what is seen.
    fn recall(&mut self, now: Time) {
        let Some(memory) = &mut self.memory else { return };
        let Some(place) = place_at(&mut self.odometry, now, memory) else { return };
        let obstacles = &mut self.obstacles;
        memory.recall(now, &place, &self.under_body, |point| obstacles.remember(point));
    }
}

/// Where the body was at `time`, in the frame that `memory` is kept in; `None` when that is not known.
fn place_at(odometry: &mut Reader<Odometry>, time: Time, memory: &mut Memory) -> Option<Place> {
    let pose = odometry.at(time)?;
    memory.keep_to_frame(pose.generation, pose.origin);
    let ahead_s = time.since(pose.stamp);
    let Twist { linear_x_m_s: v, angular_z_rad_s: w, .. } = pose.velocity;
    let numbers = [pose.x_m, pose.y_m, pose.heading_rad, v, w];
    if ahead_s > LONGEST_EXTRAPOLATION_S || !numbers.iter().all(|n| n.is_finite()) {
        return None;
    }
    let (sin, cos) = math::sin_cos(pose.heading_rad + 0.5 * w * ahead_s);
    let way_m = v * ahead_s;
    Some(Place::new(pose.x_m + way_m * cos, pose.y_m + way_m * sin, pose.heading_rad + w * ahead_s))
}

/// Tells one choice of samples from another.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
struct Fingerprint(u64);

impl Fingerprint {
    fn add(&mut self, sequence: u64, generation: u64) {
        let mixed = self.0.rotate_left(21) ^ sequence ^ generation.rotate_left(40) ^ 1;
        self.0 = mixed.wrapping_mul(0x9E37_79B9_7F4A_7C15);
    }
}

fn velocity_of(twist: &Twist) -> Velocity {
    Velocity::new(twist.linear_x_m_s, twist.angular_z_rad_s)
}

fn check(config: &DriveConfig) -> Result<(), String> {
    let c = config;
    for (key, value) in [
        ("sense_s", c.sense_s),
        ("react_s", c.react_s),
        ("actuate_s", c.actuate_s),
        ("margin_m", c.margin_m),
        ("creep_m_s", c.creep_m_s),
        ("creep_margin_m", c.creep_margin_m),
        ("side_margin_m", c.side_margin_m),
        ("speed_margin_m", c.speed_margin_m),
        ("turn_margin_m", c.turn_margin_m),
        ("cut_corners_m", c.cut_corners_m),
        ("looks_max_age_s", c.looks_max_age_s),
        ("blind_turn_rad_s", c.blind_turn_rad_s),
        ("way_out_m_s", c.way_out_m_s),
        ("release_after_s", c.release_after_s),
        ("command_valid_s", c.command_valid_s),
        ("horizon_m", c.horizon_m),
    ] {
        if !value.is_finite() || value < 0.0 {
            return Err(format!("{key} = {value} must be a number, zero or greater"));
        }
    }
    for (key, value) in [("max_jerk_m_s3", c.max_jerk_m_s3), ("max_turn_jerk_rad_s3", c.max_turn_jerk_rad_s3)] {
        if value.is_some_and(|value| !(value > 0.0 && value.is_finite())) {
            return Err(format!(
                "{key} = {} must be a number above 0; leave it out for no bound",
                value.unwrap_or(0.0)
            ));
        }
    }
    c.kinematics.map_or(Ok(()), |kinematics| kinematics.check())?;
    c.guard_zone.check()?;
    c.memory.map_or(Ok(()), |memory| memory.check())?;
    if c.command_valid_s == 0.0 {
        return Err("command_valid_s = 0 would make every command stale at once; write 0.3 or so".into());
    }
    if !(16..=8192).contains(&c.capacity) {
        return Err(format!("capacity = {} must be 16 to 8192 points", c.capacity));
    }
    Ok(())
}
