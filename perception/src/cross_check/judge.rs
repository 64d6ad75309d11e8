//! Which of several rangers does not see what the others see: the pure part of [`super`].
//!
//! Two rangers are compared where both see something. *Thin* beams (a laser's) against thin: the nearest end in each of 72
//! sectors about the body's origin, against the other's in the same and the neighbouring sectors, because two sensors at
//! two places see an edge in different ones. *Cones* (a sonar's) against thin: the distance against the nearest thin end
//! within the cone, seen from its own place. Cones against cones are not compared: they seldom look at the same thing.
//! Equal means |d₁ − d₂| ≤ tolerance_m + tolerance_share·d. Two rangers *disagree* when at least `least_compared`
//! comparisons were to be had and more than `disagreeing_share` of them are unequal: a table's edge that one of them looks
//! over is a comparison or two, a sensor that is knocked askew or stuck is most of them.
//!
//! *Who is meant.* A ranger is outvoted when two others that agree with each other both disagree with it. Where there is
//! only one other, which disagrees, the less trusted of the two is meant. Where all disagree nobody can be named.
//! Rangers that are left out have no vote. One is left out once it has been outvoted for `after_s` without a break, and
//! comes back once it has agreed for `return_after_s`.

use super::config::CrossCheckConfig;
use messages::{Beam, Echo, Ranges};
use runtime::{Time, math};
use std::f64::consts::TAU;

/// Most rangers.
pub const MOST: usize = 6;
const SECTORS: usize = 72;
/// Beams no wider than this are thin [rad].
const THIN_RAD: f32 = 0.09;
/// Thin ends that cones are compared with; of more, every so manieth.
const MOST_ENDS: usize = 512;
const MOST_CONES: usize = 64;

#[derive(Debug, Clone, Copy, Default)]
struct Cone {
    x_m: f64,
    y_m: f64,
    /// Direction of the axis, and the cosine of half its width.
    along: (f64, f64),
    cos_half: f64,
    range_m: f64,
}

/// What one ranger sees, made ready to be compared.
#[derive(Debug, Clone)]
pub struct Profile {
    /// Nearest thin end by sector; infinite where there is none [m].
    near_m: [f64; SECTORS],
    ends: Vec<(f64, f64)>,
    cones: Vec<Cone>,
}

impl Default for Profile {
    fn default() -> Profile {
        Profile {
            near_m: [f64::INFINITY; SECTORS],
            ends: Vec::with_capacity(MOST_ENDS),
            cones: Vec::with_capacity(MOST_CONES),
        }
    }
}

impl Profile {
    /// Takes in a sample.
    pub fn take(&mut self, head: &Ranges, beams: &[Beam]) {
        self.near_m = [f64::INFINITY; SECTORS];
        self.ends.clear();
        self.cones.clear();
        let every = beams.len().div_ceil(MOST_ENDS).max(1);
        let seen = |beam: &&Beam| beam.echo == Echo::Value as u32 && beam.range_m.is_finite() && beam.range_m > 0.0;
        for (k, beam) in beams.iter().enumerate().filter(|(_, beam)| seen(beam)) {
            let (sin, cos) = math::sin_cos(f64::from(beam.bearing_rad));
            let (x, y, range_m) = (f64::from(beam.origin_x_m), f64::from(beam.origin_y_m), f64::from(beam.range_m));
            if head.beam_width_rad > THIN_RAD {
                if self.cones.len() < MOST_CONES {
                    let cos_half = math::sin_cos(0.5 * f64::from(head.beam_width_rad)).1;
                    self.cones.push(Cone { x_m: x, y_m: y, along: (cos, sin), cos_half, range_m });
                }
                continue;
            }
            let end = (x + range_m * cos, y + range_m * sin);
            let sector = sector_of(end);
            self.near_m[sector] = self.near_m[sector].min(math::hypot(end.0, end.1));
            if k % every == 0 && self.ends.len() < MOST_ENDS {
                self.ends.push(end);
            }
        }
    }

    /// Comparisons with `other`, and how many of them are unequal.
    pub fn compare(&self, other: &Profile, config: &CrossCheckConfig) -> (u32, u32) {
        let mut count = (0, 0);
        let mut note = |a: f64, b: f64| {
            count.0 += 1;
            let tolerance_m = config.tolerance_m + config.tolerance_share * a.min(b);
            count.1 += u32::from((a - b).abs() > tolerance_m);
        };
        for (sector, &own_m) in self.near_m.iter().enumerate().filter(|(_, own_m)| own_m.is_finite()) {
            let around = [SECTORS - 1, 0, 1].map(|step| other.near_m[(sector + step) % SECTORS]);
            let nearest = around.into_iter().filter(|m| m.is_finite());
            if let Some(like_m) = nearest.min_by(|a, b| (a - own_m).abs().total_cmp(&(b - own_m).abs())) {
                note(own_m, like_m);
            }
        }
        for (cone, ends) in
            self.cones.iter().map(|c| (c, &other.ends)).chain(other.cones.iter().map(|c| (c, &self.ends)))
        {
            if let Some(end_m) = nearest_in(cone, ends) {
                note(cone.range_m, end_m);
            }
        }
        count
    }
}

fn sector_of((x, y): (f64, f64)) -> usize {
    let turns = math::atan2(y, x) / TAU + 0.5;
    ((turns * SECTORS as f64) as usize).min(SECTORS - 1)
}

/// Distance to the nearest end within the cone [m].
fn nearest_in(cone: &Cone, ends: &[(f64, f64)]) -> Option<f64> {
    let within = |&(x, y): &(f64, f64)| {
        let (dx, dy) = (x - cone.x_m, y - cone.y_m);
        let away_m = math::hypot(dx, dy);
        (dx * cone.along.0 + dy * cone.along.1 >= cone.cos_half * away_m).then_some(away_m)
    };
    ends.iter().filter_map(within).min_by(f64::total_cmp)
}

/// What is thought of one ranger.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Opinion {
    /// Whether it is left out.
    pub left_out: bool,
    /// Comparisons with those who have a vote, and how many of them were unequal.
    pub compared: u32,
    /// Of them, the unequal ones.
    pub unequal: u32,
    outvoted_since: Option<Time>,
    fine_since: Option<Time>,
}

/// The judge of up to [`MOST`] rangers, which have places in the order of trust, the most trusted first.
#[derive(Debug, Clone, Default)]
pub struct Judge {
    opinions: [Opinion; MOST],
}

/// What two rangers make of each other.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Pair {
    Silent,
    Agree,
    Disagree,
}

impl Judge {
    /// What is thought of the ranger at `place`.
    pub fn opinion(&self, place: usize) -> &Opinion {
        &self.opinions[place]
    }

    /// Judges by what each ranger sees now; `None` for one whose sample is missing or too old.
    pub fn judge(&mut self, now: Time, seen: &[Option<&Profile>], config: &CrossCheckConfig) {
        let count = seen.len().min(MOST);
        let mut pairs = [[Pair::Silent; MOST]; MOST];
        let mut compared = [(0, 0); MOST];
        for a in 0..count {
            for b in a + 1..count {
                let (Some(one), Some(other)) = (seen[a], seen[b]) else { continue };
                let (all, unequal) = one.compare(other, config);
                let disagree = f64::from(unequal) > config.disagreeing_share * f64::from(all);
                let pair = match all >= config.least_compared {
                    true if disagree => Pair::Disagree,
                    true => Pair::Agree,
                    false => Pair::Silent,
                };
                (pairs[a][b], pairs[b][a]) = (pair, pair);
                for (own, voter) in [(a, b), (b, a)] {
                    if !self.opinions[voter].left_out {
                        compared[own] = (compared[own].0 + all, compared[own].1 + unequal);
                    }
                }
            }
        }
        let votes: [bool; MOST] =
            std::array::from_fn(|place| place < count && seen[place].is_some() && !self.opinions[place].left_out);
        for place in 0..count {
            let verdict = if seen[place].is_some() { verdict(place, &pairs, &votes) } else { None };
            let opinion = &mut self.opinions[place];
            (opinion.compared, opinion.unequal) = compared[place];
            opinion.weigh(now, verdict, config);
        }
    }
}

/// Whether the ranger at `place` is outvoted; `None` where nobody can say.
fn verdict(place: usize, pairs: &[[Pair; MOST]; MOST], votes: &[bool; MOST]) -> Option<bool> {
    let others =
        |wanted: Pair| (0..MOST).filter(move |&other| other != place && votes[other] && pairs[place][other] == wanted);
    let (against, with) = (others(Pair::Disagree).count(), others(Pair::Agree).count());
    if against == 0 {
        return (with > 0).then_some(false);
    }
    if against == 1 && with == 0 {
        // One word against the other.
        return others(Pair::Disagree).next().map(|other| other < place);
    }
    let allied = others(Pair::Disagree).any(|a| others(Pair::Disagree).any(|b| pairs[a][b] == Pair::Agree));
    if allied && against > with { Some(true) } else { (with >= against).then_some(false) }
}

impl Opinion {
    fn weigh(&mut self, now: Time, outvoted: Option<bool>, config: &CrossCheckConfig) {
        match outvoted {
            Some(true) => {
                self.fine_since = None;
                let since = *self.outvoted_since.get_or_insert(now);
                self.left_out |= now.since(since) >= config.after_s;
            }
            Some(false) => {
                self.outvoted_since = None;
                let since = *self.fine_since.get_or_insert(now);
                self.left_out &= now.since(since) < config.return_after_s;
            }
            None => (self.outvoted_since, self.fine_since) = (None, None),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LASER: Ranges = Ranges { min_range_m: 0.0, max_range_m: 8.0, beam_width_rad: 0.0, span_s: 0.0 };
    const SONAR: Ranges = Ranges { beam_width_rad: 0.5, ..LASER };

    /// A rectangular room about the body, through beams from (x, 0), turned by `askew` and stretched by `factor`.
    fn room(head: &Ranges, x: f64, askew: f64, factor: f64) -> Profile {
        let step = if head.beam_width_rad > 0.0 { 0.4 } else { 0.02 };
        let beams: Vec<Beam> = (0..(3.0 / step) as usize)
            .map(|k| {
                let bearing = -1.5 + step * k as f64;
                let (sin, cos) = math::sin_cos(bearing);
                let wall = |along: f64, way: f64| if along > 1e-9 { way / along } else { f64::INFINITY };
                let range = wall(cos, 3.0 - x).min(wall(sin, 1.2)).min(wall(-sin, 2.0)) * factor;
                let echo = Echo::Value as u32;
                Beam {
                    origin_x_m: x as f32,
                    bearing_rad: (bearing + askew) as f32,
                    range_m: range as f32,
                    echo,
                    ..Beam::default()
                }
            })
            .collect();
        let mut profile = Profile::default();
        profile.take(head, &beams);
        profile
    }

    /// Who is left out after a second of seeing the same.
    fn left_out(seen: &[Option<&Profile>]) -> Vec<usize> {
        let mut judge = Judge::default();
        for k in 0..=20 {
            judge.judge(Time::from_seconds(10.0 + 0.05 * f64::from(k)), seen, &CrossCheckConfig::default());
        }
        (0..seen.len()).filter(|&place| judge.opinion(place).left_out).collect()
    }

    #[test]
    fn rangers_at_different_places_of_the_body_agree_about_a_room() {
        let (a, b, sonar) = (room(&LASER, 0.1, 0.0, 1.0), room(&LASER, -0.2, 0.0, 1.0), room(&SONAR, 0.0, 0.0, 1.0));
        for (one, other) in [(&a, &b), (&a, &sonar), (&sonar, &b)] {
            let (all, unequal) = one.compare(other, &CrossCheckConfig::default());
            assert!(all >= 4 && unequal * 4 <= all, "{unequal} of {all}");
        }
        assert!(left_out(&[Some(&a), Some(&b), Some(&sonar)]).is_empty());
    }

    #[test]
    fn the_one_that_two_others_contradict_is_left_out_wherever_it_stands_in_the_order_of_trust() {
        let (fine, other) = (room(&LASER, 0.1, 0.0, 1.0), room(&LASER, 0.0, 0.0, 1.0));
        for askew in [room(&LASER, 0.1, 0.7, 1.0), room(&LASER, 0.1, 0.0, 1.8), room(&LASER, 0.1, 0.0, 0.4)] {
            assert_eq!(left_out(&[Some(&askew), Some(&fine), Some(&other)]), [0]);
            assert_eq!(left_out(&[Some(&fine), Some(&askew), Some(&other)]), [1]);
        }
    }

    #[test]
    fn of_two_that_disagree_the_less_trusted_is_left_out_and_of_three_that_all_disagree_nobody() {
        let (fine, short, long) =
            (room(&LASER, 0.1, 0.0, 1.0), room(&LASER, 0.1, 0.0, 0.4), room(&LASER, 0.1, 0.0, 2.5));
        assert_eq!(left_out(&[Some(&short), Some(&fine)]), [1]);
        assert!(left_out(&[Some(&fine), Some(&short), Some(&long)]).is_empty());
        assert_eq!(left_out(&[Some(&fine), None, Some(&short)]), [2], "a silent one has no vote");
    }

    #[test]
    fn a_sonar_alone_contradicts_a_laser_that_is_askew() {
        let (sonar, askew) = (room(&SONAR, 0.0, 0.0, 1.0), room(&LASER, 0.1, 0.0, 2.5));
        assert_eq!(left_out(&[Some(&sonar), Some(&askew)]), [1]);
    }

    #[test]
    fn a_moments_contradiction_leaves_nobody_out_and_who_agrees_again_comes_back() {
        let config = CrossCheckConfig::default();
        let (fine, other, askew) =
            (room(&LASER, 0.1, 0.0, 1.0), room(&LASER, 0.0, 0.0, 1.0), room(&LASER, 0.1, 0.7, 1.0));
        let mut judge = Judge::default();
        let mut at = |s: f64, third: &Profile| {
            judge.judge(Time::from_seconds(s), &[Some(&fine), Some(&other), Some(third)], &config);
            judge.opinion(2).left_out
        };
        assert!(!at(1.0, &askew) && !at(1.4, &askew) && !at(1.45, &fine) && !at(1.9, &askew));
        assert!(at(2.5, &askew));
        assert!(at(3.0, &fine) && at(4.9, &fine) && !at(5.1, &fine));
    }

    #[test]
    fn too_little_in_common_is_no_contradiction() {
        let mut lonely = Profile::default();
        let echo = Echo::Value as u32;
        lonely.take(
            &LASER,
            &[Beam { range_m: 0.3, echo, ..Beam::default() }, Beam { range_m: f32::NAN, echo, ..Beam::default() }],
        );
        let fine = room(&LASER, 0.1, 0.0, 1.0);
        assert!(left_out(&[Some(&fine), Some(&lonely)]).is_empty());
    }
}
