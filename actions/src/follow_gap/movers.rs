//! What moves, as far as the memory agrees.
//!
//! A tracker in clutter makes movers of what stands: pieces of one thing come into sight and go, and their middle seems to
//! run. What truly moves comes to places that were free just before. So a mover is believed when fewer than half of the
//! beams that end on it end where beams have ended for longer than `OLD_MS`. Where it is hidden, what was believed before
//! is believed still.

use super::pose::Point;
use super::rollout::Mover;
use messages::Track;

/// What is slower counts as standing [m/s].
const MOVES_M_S: f64 = 0.2;
/// What was seen first less than this ago may not move as it seems to [s].
const KNOWN_S: f64 = 0.15;

/// A place that has been hit for longer was taken before any mover worth the name came [ms].
const OLD_MS: u32 = 500;
/// Beams count as a mover's when they end within this of its disc [m].
const OWN_M: f64 = 0.15;
/// Most movers; later ones are left out.
const MOST: usize = 32;

/// The movers that tracks stand for, `age_s` after their stamp.
pub fn of_tracks(tracks: &[Track], age_s: f64) -> impl Iterator<Item = Mover> {
    tracks.iter().filter_map(move |track| of_track(track, age_s))
}

/// The mover that a track stands for; `None` for what stands or is not known well enough.
fn of_track(track: &Track, age_s: f64) -> Option<Mover> {
    let place = Point::new(track.odom_x_m, track.odom_y_m);
    let velocity = Point::new(track.odom_velocity_x_m_s, track.odom_velocity_y_m_s);
    let finite = place.squared().is_finite() && velocity.squared().is_finite() && track.radius_m.is_finite();
    let counts = track.moves() && velocity.length_m() > MOVES_M_S && track.age_s > KNOWN_S;
    (finite && counts).then(|| Mover {
        id: track.id,
        seen: track.unseen_s <= 0.0,
        place: place.plus(velocity, age_s),
        velocity,
        radius_m: track.radius_m,
    })
}

#[derive(Debug, Clone, Copy, Default)]
struct Case {
    mover: Mover,
    old: u32,
    young: u32,
}

/// The movers of one step, and who was believed in the step before.
#[derive(Debug)]
pub struct Movers {
    cases: Vec<Case>,
    believed: Vec<Mover>,
    before: Vec<u64>,
}

impl Default for Movers {
    fn default() -> Movers {
        Movers { cases: Vec::with_capacity(MOST), believed: Vec::with_capacity(MOST), before: Vec::with_capacity(MOST) }
    }
}

impl Movers {
    /// Begins a step: this is said to move.
    pub fn begin(&mut self, said: &[Mover]) {
        self.before.clear();
        self.before.extend(self.believed.iter().map(|mover| mover.id));
        self.believed.clear();
        self.cases.clear();
        self.cases.extend(said.iter().take(MOST).map(|mover| Case { mover: *mover, old: 0, young: 0 }));
    }

    /// A beam ended here, where beams have ended for `age_ms`; `None` where nobody remembers.
    pub fn look_at(&mut self, point: Point, age_ms: Option<u32>) {
        for case in self.cases.iter_mut().filter(|case| is_on(&case.mover, point)) {
            match age_ms {
                Some(age_ms) if age_ms > OLD_MS => case.old += 1,
                _ => case.young += 1,
            }
        }
    }

    /// Decides whom to believe.
    pub fn decide(&mut self) {
        for case in &self.cases {
            let shown = case.old + case.young;
            let known = self.before.contains(&case.mover.id);
            let believes = if shown > 0 { case.young > case.old } else { known || case.mover.seen };
            if believes {
                self.believed.push(case.mover);
            }
        }
    }

    /// Those who are believed.
    pub fn believed(&self) -> &[Mover] {
        &self.believed
    }

    /// Whether a point is part of one of them.
    pub fn hold(&self, point: Point) -> bool {
        self.believed.iter().any(|mover| is_on(mover, point))
    }
}

fn is_on(mover: &Mover, point: Point) -> bool {
    let reach_m = mover.radius_m + OWN_M;
    point.to(mover.place).squared() < reach_m * reach_m
}

#[cfg(test)]
mod tests {
    use super::*;

    const MOVER: Mover =
        Mover { id: 7, seen: true, place: Point::new(2.0, 0.0), velocity: Point::new(0.0, 1.0), radius_m: 0.5 };

    fn step(movers: &mut Movers, said: &[Mover], beams: &[(f64, Option<u32>)]) -> usize {
        movers.begin(said);
        for (x_m, age_ms) in beams {
            movers.look_at(Point::new(*x_m, 0.0), *age_ms);
        }
        movers.decide();
        movers.believed().len()
    }

    #[test]
    fn a_mover_on_places_that_have_long_been_taken_is_not_believed() {
        let mut movers = Movers::default();
        assert_eq!(step(&mut movers, &[MOVER], &[(1.5, Some(40)), (1.6, Some(60)), (1.7, Some(2000))]), 1);
        assert!(movers.hold(Point::new(1.6, 0.0)) && !movers.hold(Point::new(1.0, 0.0)));
        assert_eq!(step(&mut movers, &[MOVER], &[(1.5, Some(4000)), (1.6, Some(60)), (1.7, Some(2000))]), 0);
    }

    #[test]
    fn a_mover_that_is_hidden_is_believed_when_it_was_before() {
        let hidden = Mover { seen: false, ..MOVER };
        let mut movers = Movers::default();
        assert_eq!(step(&mut movers, &[hidden], &[]), 0);
        assert_eq!(step(&mut movers, &[MOVER], &[(1.5, None)]), 1);
        assert_eq!(step(&mut movers, &[hidden], &[]), 1);
        assert_eq!(step(&mut movers, &[], &[]), 0);
        assert_eq!(step(&mut movers, &[hidden], &[]), 0, "gone for a step is gone");
    }
}
