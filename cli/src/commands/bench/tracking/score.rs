//! What tracks are worth, by truth: found or not, how far off, and whether a thing keeps its number.

use super::super::report::Value;
use runtime::math;
use std::collections::BTreeMap;

/// A track is a thing's when their centres are no farther apart than this [m].
const MATCH_M: f64 = 0.5;
/// Velocities count from so long after a thing came into sight [s].
const SETTLE_S: f64 = 0.5;
/// Shorter and longer times out of sight are no occlusions [s].
const OCCLUSION_S: [f64; 2] = [0.1, 2.0];
/// A thing must have been followed for so long before it is lost from sight [s].
const FOLLOWED_S: f64 = 0.5;
/// Back in sight, a thing has so long to be found again [s].
const AGAIN_S: f64 = 0.3;

/// A thing as it is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Truth {
    pub number: u64,
    pub x_m: f64,
    pub y_m: f64,
    pub velocity_x_m_s: f64,
    pub velocity_y_m_s: f64,
    pub visible: bool,
}

/// A thing as it is tracked.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Seen {
    pub id: u64,
    pub x_m: f64,
    pub y_m: f64,
    pub velocity_x_m_s: f64,
    pub velocity_y_m_s: f64,
    /// Seen in this very scan.
    pub now: bool,
    /// Whether the tracker says that it moves, if it says so at all.
    pub moves: Option<bool>,
}

/// What happened to one thing so far.
#[derive(Debug, Clone, Copy, Default)]
struct History {
    id: Option<u64>,
    /// In sight without a break since.
    since: Option<f64>,
    /// Out of sight since, and the number that it had.
    gone: Option<(f64, u64)>,
    /// Back in sight since, and the number that it should have.
    back: Option<(f64, u64)>,
}

/// Sums over steps, things and runs.
#[derive(Debug, Clone, Default)]
pub struct Score {
    visible: u64,
    found: u64,
    position: Sum,
    velocity: Sum,
    switches: u64,
    occlusions: u64,
    kept: u64,
    seen: u64,
    ghosts: u64,
    moving: [u64; 2],
    histories: BTreeMap<u64, History>,
}

#[derive(Debug, Clone, Copy, Default)]
struct Sum {
    squares: f64,
    count: u64,
}

impl Sum {
    fn add(&mut self, x: f64, y: f64) {
        self.squares += x * x + y * y;
        self.count += 1;
    }

    fn rms(&self) -> f64 {
        (self.squares / self.count.max(1) as f64).sqrt()
    }
}

impl Score {
    /// One scan.
    pub fn step(&mut self, t: f64, truths: &[Truth], seen: &[Seen]) {
        let mut used = vec![false; seen.len()];
        let mut pairs: Vec<Option<usize>> = vec![None; truths.len()];
        let off = |truth: &Truth, track: &Seen| math::hypot(truth.x_m - track.x_m, truth.y_m - track.y_m);
        // A thing keeps its track while it is near; the others take the nearest.
        for (k, truth) in truths.iter().enumerate().filter(|(_, truth)| truth.visible) {
            let id = self.histories.get(&truth.number).and_then(|history| history.id);
            let same = seen.iter().position(|track| Some(track.id) == id);
            if let Some(j) = same.filter(|&j| !used[j] && off(truth, &seen[j]) < MATCH_M) {
                (pairs[k], used[j]) = (Some(j), true);
            }
        }
        for (k, truth) in truths.iter().enumerate().filter(|(_, truth)| truth.visible) {
            if pairs[k].is_none() {
                let free = (0..seen.len()).filter(|&j| !used[j] && off(truth, &seen[j]) < MATCH_M);
                pairs[k] = free.min_by(|&a, &b| off(truth, &seen[a]).total_cmp(&off(truth, &seen[b])));
                if let Some(j) = pairs[k] {
                    used[j] = true;
                }
            }
        }
        for (truth, pair) in truths.iter().zip(&pairs) {
            self.one(t, truth, pair.map(|j| &seen[j]));
        }
        for (track, used) in seen.iter().zip(used).filter(|(track, _)| track.now) {
            self.seen += 1;
            let part = |truth: &Truth| off(truth, track) < 2.0 * MATCH_M;
            if !used && !truths.iter().any(part) && track.moves != Some(false) {
                self.ghosts += 1;
            }
        }
    }

    fn one(&mut self, t: f64, truth: &Truth, track: Option<&Seen>) {
        let history = self.histories.entry(truth.number).or_default();
        if !truth.visible {
            if let (Some(id), Some(since), None) = (history.id, history.since, history.gone)
                && t - since > FOLLOWED_S
            {
                history.gone = Some((t, id));
            }
            (history.since, history.back) = (None, None);
            return;
        }
        let since = *history.since.get_or_insert(t);
        if let Some((gone, id)) = history.gone.take()
            && (OCCLUSION_S[0]..OCCLUSION_S[1]).contains(&(t - gone))
        {
            history.back = Some((t, id));
        }
        if let Some((back, id)) = history.back
            && (track.is_some() || t - back > AGAIN_S)
        {
            self.occlusions += 1;
            self.kept += u64::from(track.is_some_and(|track| track.id == id));
            history.back = None;
        }
        self.visible += 1;
        let Some(track) = track else { return };
        self.found += 1;
        self.position.add(track.x_m - truth.x_m, track.y_m - truth.y_m);
        if t - since > SETTLE_S {
            let (vx, vy) = (truth.velocity_x_m_s, truth.velocity_y_m_s);
            self.velocity.add(track.velocity_x_m_s - vx, track.velocity_y_m_s - vy);
            if let Some(moves) = track.moves {
                self.moving[usize::from(moves)] += 1;
            }
        }
        if history.id.is_some_and(|id| id != track.id) {
            self.switches += 1;
        }
        history.id = Some(track.id);
    }

    /// The run is over: what comes next are other things.
    pub fn end(&mut self) {
        self.histories.clear();
    }

    /// Share of occlusions after which a thing had the same number.
    pub fn kept_share(&self) -> f64 {
        self.kept as f64 / self.occlusions.max(1) as f64
    }

    /// The figures, named after `way`.
    pub fn values(&self, way: &str, out: &mut Vec<Value>) {
        let share = |part: u64, whole: u64| part as f64 / whole.max(1) as f64;
        let mut add = |what: &str, value: f64, unit: &str| out.push(Value::new(format!("{way}_{what}"), value, unit));
        add("found", share(self.found, self.visible), "of visible");
        add("position_rmse", self.position.rms(), "m");
        add("velocity_rmse", self.velocity.rms(), "m/s");
        add("identity_switches", self.switches as f64, "times");
        add("occlusions", self.occlusions as f64, "times");
        add("identity_kept", self.kept_share(), "of occlusions");
        add("ghosts", share(self.ghosts, self.seen), "of seen tracks");
        if self.moving != [0, 0] {
            add("moving_told", share(self.moving[1], self.moving[0] + self.moving[1]), "of found");
        }
        add("n_visible", self.visible as f64, "things × scans");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn truth(x_m: f64, visible: bool) -> Truth {
        Truth { number: 1, x_m, y_m: 0.0, velocity_x_m_s: 1.0, velocity_y_m_s: 0.0, visible }
    }

    fn seen(id: u64, x_m: f64) -> Seen {
        Seen { id, x_m, y_m: 0.0, velocity_x_m_s: 0.5, velocity_y_m_s: 0.0, now: true, moves: None }
    }

    #[test]
    fn a_thing_that_comes_back_with_its_number_has_been_kept_and_with_another_not() {
        for (id, kept, switches) in [(1, 1.0, 0), (2, 0.0, 1)] {
            let mut score = Score::default();
            for k in 0..20 {
                score.step(0.1 * f64::from(k), &[truth(0.0, true)], &[seen(1, 0.1)]);
            }
            for k in 20..25 {
                score.step(0.1 * f64::from(k), &[truth(0.0, false)], &[]);
            }
            score.step(2.5, &[truth(0.0, true)], &[seen(id, 0.1)]);
            assert_eq!((score.occlusions, score.kept_share(), score.switches), (1, kept, switches));
        }
    }

    #[test]
    fn errors_are_root_mean_squares_over_what_was_found() {
        let mut score = Score::default();
        for k in 0..20 {
            score.step(0.1 * f64::from(k), &[truth(0.0, true)], &[seen(1, 0.3), seen(2, 9.0)]);
        }
        score.step(2.0, &[truth(0.0, true)], &[seen(1, 3.0)]);
        assert!((score.position.rms() - 0.3).abs() < 1e-12 && (score.velocity.rms() - 0.5).abs() < 1e-12);
        assert_eq!((score.found, score.visible, score.ghosts), (20, 21, 21));
    }
}
