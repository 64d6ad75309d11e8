//! Drives to a place in the map frame, by the law in [`law`] (S2, Goto).
//!
//! Reads `pose` (where the body is in the map frame), `ranges` (optional: is something at the goal?) and `stop`
//! (optional: while a protective stop holds the body, waiting is no failure); writes `proposal` and `progress`. Answers
//! the long orders `goto` (a place, perhaps a heading) and `follow` (via points), which end with who gave them, and the
//! calls `send` (a goal that nobody waits for) and `cancel`. A newer order takes the place of an older one. Without an order it proposes nothing; without a pose it proposes to stand, and gives up after a while.

pub mod config;
pub mod errand;
pub mod law;
pub mod route;

pub use config::GotoConfig;

use crate::place::Place;
use errand::{Errand, Verdict};
use law::Pace;
use messages::{
    Axis, Beam, Done, Echo, GotoGoal, GotoPath, GotoProgress, GotoResult, Odometry, Proposal, ProtectiveStop, Ranges,
    StopCause, Trigger,
};
use runtime::calls::Order;
use runtime::{CallPort, Fault, Layer, Node, OpenError, OrderPort, Ports, Reader, Time, Writer, math};

/// The node.
pub struct Goto {
    pose: Reader<Odometry>,
    ranges: Reader<Ranges>,
    stop: Reader<ProtectiveStop>,
    proposal: Writer<Proposal>,
    progress: Writer<GotoProgress>,
    goals: OrderPort<GotoGoal, GotoProgress, GotoResult>,
    paths: OrderPort<GotoPath, GotoProgress, GotoResult>,
    sends: CallPort<GotoGoal, Done>,
    cancels: CallPort<Trigger, Done>,
    mission: Option<Mission>,
    orders: u32,
    /// Within this of the body's centre nothing may stand [m].
    inner_radius_m: f64,
    config: GotoConfig,
}

/// An order under way.
struct Mission {
    errand: Errand,
    ordered: Ordered,
    /// Generation and origin of the map frame in which it was given.
    frame: (u64, u64),
    reported: Time,
    looked_at: u64,
}

/// Who ordered it.
#[expect(clippy::large_enum_variant, reason = "there is one at a time, and a box would allocate in a step")]
enum Ordered {
    Goal(Order<GotoGoal, GotoProgress, GotoResult>),
    Path(Order<GotoPath, GotoProgress, GotoResult>),
    /// Sent, and nobody waits for the end.
    Sent,
}

/// Progress is told this often [s].
const REPORT_EVERY_S: f64 = 0.2;

impl Node for Goto {
    const TYPE: &'static str = "goto";
    const LAYER: Layer = Layer::Actions;
    type Config = GotoConfig;

    fn open(ports: &mut Ports, config: GotoConfig) -> Result<Goto, OpenError> {
        config.check().map_err(OpenError::config)?;
        let body = ports.body();
        Ok(Goto {
            inner_radius_m: body.half_width_m.min(body.length_ahead_m).min(body.length_behind_m),
            pose: ports.reader("pose")?,
            ranges: ports.optional_reader("ranges")?,
            stop: ports.optional_reader("stop")?,
            proposal: ports.writer("proposal")?,
            progress: ports.writer("progress")?,
            goals: ports.order("goto")?,
            paths: ports.order("follow")?,
            sends: ports.call("send")?,
            cancels: ports.call("cancel")?,
            mission: None,
            orders: 0,
            config,
        })
    }

    fn step(&mut self, now: Time) -> Result<(), Fault> {
        let pose = self.pose.fresh(now);
        let frame = pose.as_ref().map(|sample| (sample.generation, sample.origin));
        let place = pose.and_then(|sample| Place::at(now, &sample));
        let body = place.zip(frame);
        let done = Done { at_ns: now.nanos() };
        while let Some(order) = self.goals.take() {
            match self.errand(now, body, |place, config| Errand::to(&order.message, place, now, config)) {
                Ok((errand, frame)) => self.begin(errand, frame, Ordered::Goal(order)),
                Err(reason) => order.refuse(reason),
            }
        }
        while let Some(order) = self.paths.take() {
            match self.errand(now, body, |place, config| Errand::along(&order.message, place, now, config)) {
                Ok((errand, frame)) => self.begin(errand, frame, Ordered::Path(order)),
                Err(reason) => order.refuse(reason),
            }
        }
        while let Some(request) = self.sends.take() {
            match self.errand(now, body, |place, config| Errand::to(&request.message, place, now, config)) {
                Ok((errand, frame)) => {
                    self.begin(errand, frame, Ordered::Sent);
                    self.sends.answer(request, &done);
                }
                Err(reason) => self.sends.refuse(request, reason),
            }
        }
        while let Some(request) = self.cancels.take() {
            if let Some(mission) = self.mission.take() {
                mission.ordered.cancelled();
                self.rest(now);
            }
            self.cancels.answer(request, &done);
        }
        self.pursue(now, place, frame);
        Ok(())
    }

    fn stop(&mut self, _now: Time) {
        if let Some(mission) = self.mission.take() {
            mission.ordered.failed("the node goto is stopped");
        }
    }
}

impl Goto {
    /// The errand that `make` makes, with its frame; or why there is none.
    fn errand(
        &mut self,
        now: Time,
        body: Option<(Place, (u64, u64))>,
        make: impl FnOnce(Place, &GotoConfig) -> Result<Errand, &'static str>,
    ) -> Result<(Errand, (u64, u64)), &'static str> {
        let (place, frame) = body.ok_or("nobody knows where the body is: no pose has come lately")?;
        let errand = make(place, &self.config)?;
        let (x_m, y_m) = errand.goal();
        let radius_m = self.inner_radius_m;
        match self.ranges.fresh(now) {
            Some(ranges) if is_occupied(ranges.tail, &place, x_m, y_m, radius_m) => Err("something stands at the goal"),
            _ => Ok((errand, frame)),
        }
    }

    fn begin(&mut self, errand: Errand, frame: (u64, u64), mut ordered: Ordered) {
        if let Some(former) = self.mission.take() {
            former.ordered.failed("a newer order took its place");
        }
        ordered.accept();
        self.orders = self.orders.wrapping_add(1);
        self.mission = Some(Mission { errand, ordered, frame, reported: Time::ZERO, looked_at: 0 });
    }

    fn pursue(&mut self, now: Time, place: Option<Place>, frame: Option<(u64, u64)>) {
        let Some(mut mission) = self.mission.take() else { return };
        if mission.ordered.is_cancelled() {
            mission.ordered.cancelled();
            return self.rest(now);
        }
        if frame.is_some_and(|frame| frame != mission.frame) {
            mission.ordered.failed("the map frame was moved under the order: give the goal anew");
            return self.rest(now);
        }
        if let (Some(place), Some(ranges)) = (place, self.ranges.fresh(now))
            && ranges.sequence != mission.looked_at
        {
            mission.looked_at = ranges.sequence;
            let (x_m, y_m) = mission.errand.goal();
            let occupied = is_occupied(ranges.tail, &place, x_m, y_m, self.inner_radius_m);
            if mission.errand.finds_goal_occupied(now, occupied, &self.config) {
                mission.ordered.failed("something stands at the goal");
                return self.rest(now);
            }
        }
        let waits = self.stop.fresh(now).is_some_and(|stop| stop.cause != StopCause::None as u32);
        match mission.errand.advance(now, place, waits, &self.config) {
            Verdict::Go(pace) => {
                self.proposal.write(now, &propose(pace, &self.config));
                if now.since(mission.reported) >= REPORT_EVERY_S {
                    mission.reported = now;
                    let progress = mission.errand.progress(now, self.orders, &self.config);
                    mission.ordered.progress(&progress);
                    self.progress.write(now, &progress);
                }
                self.mission = Some(mission);
            }
            Verdict::Arrived => {
                let result = mission.errand.result(now);
                mission.ordered.done(&result);
                self.rest(now);
            }
            Verdict::Failed(reason) => {
                mission.ordered.failed(reason);
                self.rest(now);
            }
        }
    }

    /// Takes back the last proposal, and says that nothing is ordered.
    fn rest(&mut self, now: Time) {
        self.proposal.write(now, &Proposal { valid_for_s: self.config.valid_for_s, ..Proposal::default() });
        self.progress.write(now, &GotoProgress { orders: self.orders, ..GotoProgress::default() });
    }
}

impl Ordered {
    fn accept(&mut self) {
        match self {
            Ordered::Goal(order) => order.accept(),
            Ordered::Path(order) => order.accept(),
            Ordered::Sent => {}
        }
    }

    fn progress(&mut self, progress: &GotoProgress) {
        match self {
            Ordered::Goal(order) => order.progress(progress),
            Ordered::Path(order) => order.progress(progress),
            Ordered::Sent => {}
        }
    }

    fn is_cancelled(&self) -> bool {
        match self {
            Ordered::Goal(order) => order.is_cancelled(),
            Ordered::Path(order) => order.is_cancelled(),
            Ordered::Sent => false,
        }
    }

    fn done(self, result: &GotoResult) {
        match self {
            Ordered::Goal(order) => order.done(result),
            Ordered::Path(order) => order.done(result),
            Ordered::Sent => {}
        }
    }

    fn failed(self, reason: &'static str) {
        match self {
            Ordered::Goal(order) => order.failed(reason),
            Ordered::Path(order) => order.failed(reason),
            Ordered::Sent => {}
        }
    }

    fn cancelled(self) {
        match self {
            Ordered::Goal(order) => order.cancelled(),
            Ordered::Path(order) => order.cancelled(),
            Ordered::Sent => {}
        }
    }
}

fn propose(pace: Pace, config: &GotoConfig) -> Proposal {
    Proposal {
        forward: Axis::exact(pace.forward_m_s),
        turn: Axis::exact(pace.turn_rad_s),
        urgency: config.urgency,
        valid_for_s: config.valid_for_s,
        ..Proposal::default()
    }
}

/// Whether a beam ends within `radius_m` of the point (`x_m`, `y_m`) of the map: the body cannot stand there.
fn is_occupied(beams: &[Beam], place: &Place, x_m: f64, y_m: f64, radius_m: f64) -> bool {
    let (goal_x, goal_y) = place.body_from_map(x_m, y_m);
    let values = beams.iter().filter(|beam| beam.echo == Echo::Value as u32);
    values.into_iter().any(|beam| {
        let (sin, cos) = math::sin_cos(f64::from(beam.bearing_rad));
        let range_m = f64::from(beam.range_m);
        let dx = f64::from(beam.origin_x_m) + range_m * cos - goal_x;
        let dy = f64::from(beam.origin_y_m) + range_m * sin - goal_y;
        dx * dx + dy * dy < radius_m * radius_m
    })
}
