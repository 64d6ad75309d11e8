//! Takes the robot through clutter to a goal: a local planner that judges whole swept plans ([`planner`]).
//!
//! Reads `ranges` (a laser's beams in the body frame), `pose` (odometry; the goal is in its frame) and `tracks`
//! (optional: what moves is then met where it will be, not where it is); writes `proposal` and `progress`. Answers the
//! long order `goto` (a place; a final heading is not turned to), and the calls `send` (a goal that nobody waits for) and
//! `cancel`. A newer order takes the place of an older one. Without an order it proposes nothing; without a fresh scan
//! or pose it proposes to stand.
//!
//! It remembers what it has seen for `memory_s`, as a raster around the robot: a local map. With `memory_s = 0` it is
//! purely reactive: every wish is made of the newest scan alone.

pub mod candidates;
pub mod clearance;
pub mod config;
pub mod guide;
pub mod memory;
mod mission;
pub mod movers;
pub mod planner;
pub mod pose;
pub mod rollout;

pub use config::FollowGapConfig;

use messages::{Axis, Done, GotoGoal, GotoProgress, GotoResult, Odometry, Proposal, Ranges, Tracks, Trigger};
use mission::Mission;
use planner::{Planner, Sight, Wish};
use pose::{Point, Pose};
use rollout::Mover;
use runtime::{CallPort, Fault, Layer, Node, OpenError, OrderPort, Ports, Reader, Sample, Time, Writer, math};

/// Most movers that are planned for; what was seen first later is left out.
const MOVERS: usize = 32;
/// What is slower stands, for the question whether it sets off [m/s].
const STANDS_M_S: f64 = 0.05;
/// Progress is told this often [s].
const REPORT_EVERY_S: f64 = 0.2;
/// A pose is carried on by its velocity for no longer than this [s].
const LONGEST_EXTRAPOLATION_S: f64 = 0.3;

/// The node.
pub struct FollowGap {
    ranges: Reader<Ranges>,
    pose: Reader<Odometry>,
    tracks: Reader<Tracks>,
    proposal: Writer<Proposal>,
    progress: Writer<GotoProgress>,
    goals: OrderPort<GotoGoal, GotoProgress, GotoResult>,
    sends: CallPort<GotoGoal, Done>,
    cancels: CallPort<Trigger, Done>,
    planner: Planner,
    movers: Vec<Mover>,
    mission: Option<Mission>,
    orders: u32,
    /// Generation and sequence of the scan that was answered last.
    answered: Option<(u64, u64)>,
    /// Generation and origin of the odometry's frame.
    frame: Option<(u64, u64)>,
    began: Option<Time>,
    /// Since when it watches what moves.
    watching: Option<Time>,
    config: FollowGapConfig,
}

impl Node for FollowGap {
    const TYPE: &'static str = "follow_gap";
    const LAYER: Layer = Layer::Actions;
    type Config = FollowGapConfig;

    fn open(ports: &mut Ports, config: FollowGapConfig) -> Result<FollowGap, OpenError> {
        if let Some(reason) = config.fault() {
            return Err(OpenError::config(reason));
        }
        let setup = config.setup(ports.body());
        Ok(FollowGap {
            ranges: ports.reader("ranges")?,
            pose: ports.reader("pose")?,
            tracks: ports.optional_reader("tracks")?,
            proposal: ports.writer("proposal")?,
            progress: ports.writer("progress")?,
            goals: ports.order("goto")?,
            sends: ports.call("send")?,
            cancels: ports.call("cancel")?,
            planner: Planner::new(setup),
            movers: Vec::with_capacity(MOVERS),
            mission: None,
            orders: 0,
            answered: None,
            frame: None,
            began: None,
            watching: None,
            config,
        })
    }

    fn step(&mut self, now: Time) -> Result<(), Fault> {
        self.began.get_or_insert(now);
        let here = self.pose.fresh(now).and_then(|sample| Here::at(now, &sample));
        self.follow_frame(here.as_ref());
        self.obey(now, here.as_ref());
        let watches = self.watches(now) && here.is_some_and(|here| here.velocity.0.abs() < STANDS_M_S);
        let Some(mut mission) = self.mission.take() else { return Ok(()) };
        if mission.is_cancelled() {
            mission.cancelled();
            self.rest(now);
            return Ok(());
        }
        let wish = here.and_then(|here| self.plan(now, &here, mission.goal, mission.tolerance_m));
        match (here, wish) {
            (Some(here), Some(wish)) if wish.arrived => {
                mission.arrived(now, here.pose);
                self.rest(now);
                return Ok(());
            }
            (_, Some(_)) if watches => self.propose(now, &Wish::default()),
            (_, Some(wish)) => self.propose(now, &wish),
            // Nothing fresh to decide by: stand, unless this step was released by something else than a scan.
            (None, None) => self.propose(now, &Wish::default()),
            (Some(_), None) if self.ranges.fresh(now).is_none() => self.propose(now, &Wish::default()),
            (Some(_), None) => {}
        }
        if now.since(mission.reported) >= REPORT_EVERY_S {
            let progress = mission.progress(now, here.map(|here| here.pose), self.orders);
            self.progress.write(now, &progress);
        }
        self.mission = Some(mission);
        Ok(())
    }

    fn stop(&mut self, _now: Time) {
        if let Some(mission) = self.mission.take() {
            mission.failed("the node follow_gap is stopped");
        }
    }
}

/// Where the body is now.
#[derive(Debug, Clone, Copy)]
struct Here {
    pose: Pose,
    velocity: (f64, f64),
    frame: (u64, u64),
}

impl Here {
    /// The pose of a sample carried on to `now`; `None` when it holds a number that is none.
    fn at(now: Time, sample: &Sample<'_, Odometry>) -> Option<Here> {
        let velocity = (sample.velocity.linear_x_m_s, sample.velocity.angular_z_rad_s);
        let ahead_s = now.since(sample.stamp).clamp(0.0, LONGEST_EXTRAPOLATION_S);
        let pose = Pose::new(sample.x_m, sample.y_m, sample.heading_rad).after(velocity.0, velocity.1, ahead_s);
        let finite = pose.place.squared().is_finite() && pose.heading_rad.is_finite();
        (finite && velocity.0.is_finite() && velocity.1.is_finite()).then_some(Here {
            pose,
            velocity,
            frame: (sample.generation, sample.origin),
        })
    }
}

impl FollowGap {
    /// Forgets all when the odometry's frame is another.
    fn follow_frame(&mut self, here: Option<&Here>) {
        let Some(here) = here else { return };
        if self.frame.replace(here.frame).is_some_and(|known| known != here.frame) {
            self.planner.forget();
            self.watching = None;
            if let Some(mission) = self.mission.take() {
                mission.failed("the odometry's frame was moved under the order: give the goal anew");
            }
        }
    }

    fn obey(&mut self, now: Time, here: Option<&Here>) {
        while let Some(order) = self.goals.take() {
            match self.judge(&order.message, here) {
                Ok(goal) => {
                    let tolerance_m = self.tolerance_m(&order.message);
                    self.begin(Mission::ordered(now, goal, tolerance_m, order));
                }
                Err(reason) => order.refuse(reason),
            }
        }
        while let Some(request) = self.sends.take() {
            match self.judge(&request.message, here) {
                Ok(goal) => {
                    let tolerance_m = self.tolerance_m(&request.message);
                    self.begin(Mission::sent(now, goal, tolerance_m));
                    self.sends.answer(request, &Done { at_ns: now.nanos() });
                }
                Err(reason) => self.sends.refuse(request, reason),
            }
        }
        while let Some(request) = self.cancels.take() {
            if let Some(mission) = self.mission.take() {
                mission.cancelled();
                self.rest(now);
            }
            self.cancels.answer(request, &Done { at_ns: now.nanos() });
        }
    }

    /// The goal of an order, or why it cannot be driven to.
    fn judge(&self, goal: &GotoGoal, here: Option<&Here>) -> Result<Point, &'static str> {
        if !(goal.x_m.is_finite() && goal.y_m.is_finite()) {
            return Err("the goal is not a number: give x and y in metres");
        }
        if goal.x_m.abs() > FARTHEST_M || goal.y_m.abs() > FARTHEST_M {
            return Err("the goal lies farther than 10 km away: lengths are in metres");
        }
        if here.is_none() {
            return Err("nobody knows where the body is: no pose has come lately");
        }
        Ok(Point::new(goal.x_m, goal.y_m))
    }

    fn tolerance_m(&self, goal: &GotoGoal) -> f64 {
        if goal.tolerance_m > 0.0 && goal.tolerance_m.is_finite() { goal.tolerance_m } else { self.config.tolerance_m }
    }

    fn begin(&mut self, mission: Mission) {
        if let Some(former) = self.mission.take() {
            former.failed("a newer order took its place");
        }
        self.orders = self.orders.wrapping_add(1);
        self.answered = None;
        self.mission = Some(mission);
    }

    /// Whether it has not yet seen for long enough what moves: a velocity takes some scans, and whoever sets off before
    /// sets off blindly. Without tracks there is nothing to wait for.
    fn watches(&mut self, now: Time) -> bool {
        if self.config.tracking && self.watching.is_none() && self.tracks.fresh(now).is_some() {
            self.watching = Some(now);
        }
        self.watching.is_some_and(|since| now.since(since) < self.config.watch_s)
    }

    /// What the planner wants; `None` without a scan that has not been answered yet.
    fn plan(&mut self, now: Time, here: &Here, goal: Point, tolerance_m: f64) -> Option<Wish> {
        self.take_movers(now, here);
        let began = self.began.unwrap_or(now);
        let scan = self.ranges.fresh(now)?;
        let scan_id = (scan.generation, scan.sequence);
        if self.answered == Some(scan_id) {
            return None;
        }
        let scan_pose = pose_at(&mut self.pose, scan.stamp)?;
        self.answered = Some(scan_id);
        let sight = Sight {
            pose: here.pose,
            velocity: here.velocity,
            scan_pose,
            beams: scan.tail,
            movers: &self.movers,
            goal,
            tolerance_m,
            time_s: now.since(began),
        };
        Some(self.planner.step(&sight))
    }

    /// The tracks that move, where they are now.
    fn take_movers(&mut self, now: Time, here: &Here) {
        self.movers.clear();
        if !self.config.tracking {
            return;
        }
        let Some(tracks) = self.tracks.fresh(now) else { return };
        if tracks.origin != here.frame.1 {
            return;
        }
        let age_s = now.since(tracks.stamp).clamp(0.0, LONGEST_EXTRAPOLATION_S);
        self.movers.extend(movers::of_tracks(tracks.tail, age_s).take(MOVERS));
    }

    fn propose(&mut self, now: Time, wish: &Wish) {
        let proposal = Proposal {
            forward: Axis::exact(wish.forward_m_s),
            turn: Axis::exact(wish.turn_rad_s),
            urgency: self.config.urgency,
            valid_for_s: self.config.valid_for_s,
            ..Proposal::default()
        };
        self.proposal.write(now, &proposal);
    }

    /// Takes back the last proposal, and says that nothing is ordered.
    fn rest(&mut self, now: Time) {
        self.proposal.write(now, &Proposal { valid_for_s: self.config.valid_for_s, ..Proposal::default() });
        self.progress.write(now, &GotoProgress { orders: self.orders, ..GotoProgress::default() });
    }
}

/// No goal is farther than this [m].
const FARTHEST_M: f64 = 10_000.0;

/// Where the body was at `time`: between two samples, or carried on from the newest before.
fn pose_at(poses: &mut Reader<Odometry>, time: Time) -> Option<Pose> {
    if let Some((before, after)) = poses.around(time) {
        let whole_s = after.stamp.since(before.stamp);
        let share = if whole_s > 0.0 { time.since(before.stamp) / whole_s } else { 0.0 };
        let turned_rad = math::wrap_angle(after.heading_rad - before.heading_rad);
        return Some(Pose::new(
            before.x_m + share * (after.x_m - before.x_m),
            before.y_m + share * (after.y_m - before.y_m),
            before.heading_rad + share * turned_rad,
        ));
    }
    let sample = poses.at(time)?;
    (time.since(sample.stamp) <= LONGEST_EXTRAPOLATION_S)
        .then(|| Here::at(time, &sample).map(|here| here.pose))
        .flatten()
}
