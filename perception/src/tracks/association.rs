//! Which track a measurement belongs to: the global nearest neighbour within gates.
//!
//! Of all ways to give each track at most one measurement and each measurement at most one track, the one with the least
//! sum of costs, a track without a measurement costing as much as the gate. Pairs outside the gate never count, so the
//! problem falls into small groups that share no track and no measurement; each is solved exactly by shortest augmenting
//! paths (Kuhn–Munkres in Jonker and Volgenant's form), groups of a single pair at once.

/// A track and a measurement that may belong together.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pair {
    /// Index of the track.
    pub row: u32,
    /// Index of the measurement.
    pub column: u32,
    /// Squared distance in standard deviations.
    pub cost: f64,
}

/// Groups with more tracks or measurements than this are solved by taking the cheapest pair again and again: such a
/// crowd is beyond telling apart anyway, and a step must stay short.
const MOST_IN_GROUP: usize = 48;
/// Costs of pairs outside the gate.
const NEVER: f64 = 1e12;
/// No measurement.
pub const NONE: u32 = u32::MAX;

/// Solves assignments; keeps its memory.
#[derive(Debug, Clone)]
pub struct Association {
    pairs: Vec<Pair>,
    most_pairs: usize,
    /// Union-find over rows, then columns.
    parent: Vec<u32>,
    assigned: Vec<u32>,
    taken: Vec<bool>,
    rows: Vec<u32>,
    columns: Vec<u32>,
    work: Work,
}

impl Association {
    /// Room for so many tracks and measurements.
    pub fn new(most_rows: usize, most_columns: usize) -> Association {
        let most_pairs = 16 * most_rows.max(most_columns);
        Association {
            pairs: Vec::with_capacity(most_pairs),
            most_pairs,
            parent: Vec::with_capacity(most_rows + most_columns),
            assigned: Vec::with_capacity(most_rows),
            taken: Vec::with_capacity(most_columns),
            rows: Vec::with_capacity(MOST_IN_GROUP),
            columns: Vec::with_capacity(MOST_IN_GROUP),
            work: Work::new(),
        }
    }

    /// Forgets the pairs of the scan before.
    pub fn begin(&mut self) {
        self.pairs.clear();
    }

    /// A pair within its gate.
    pub fn may_be(&mut self, pair: Pair) {
        if self.pairs.len() < self.most_pairs {
            self.pairs.push(pair);
        }
    }

    /// The measurement of each of `rows` tracks, or [`NONE`]; a track without one costs `gate`.
    pub fn solve(&mut self, rows: usize, columns: usize, gate: f64) -> &[u32] {
        self.assigned.clear();
        self.assigned.resize(rows, NONE);
        self.taken.clear();
        self.taken.resize(columns, false);
        self.parent.clear();
        self.parent.extend(0..(rows + columns) as u32);
        for k in 0..self.pairs.len() {
            let (a, b) = (self.root(self.pairs[k].row), self.root(rows as u32 + self.pairs[k].column));
            let (low, high) = (a.min(b), a.max(b));
            self.parent[high as usize] = low;
        }
        for k in 0..self.parent.len() {
            self.parent[k] = self.root(k as u32);
        }
        let parent = &self.parent;
        self.pairs.sort_unstable_by_key(|pair| (parent[pair.row as usize], pair.row, pair.column));
        let mut first = 0;
        while first < self.pairs.len() {
            let group = self.parent[self.pairs[first].row as usize];
            let mut end = first + 1;
            while end < self.pairs.len() && self.parent[self.pairs[end].row as usize] == group {
                end += 1;
            }
            self.solve_group(first, end, gate);
            first = end;
        }
        &self.assigned
    }

    fn root(&mut self, mut node: u32) -> u32 {
        while self.parent[node as usize] != node {
            self.parent[node as usize] = self.parent[self.parent[node as usize] as usize];
            node = self.parent[node as usize];
        }
        node
    }

    fn solve_group(&mut self, first: usize, end: usize, gate: f64) {
        let pairs = &mut self.pairs[first..end];
        if let [pair] = pairs {
            self.assigned[pair.row as usize] = pair.column;
            return;
        }
        self.rows.clear();
        self.columns.clear();
        let mut crowd = false;
        for pair in pairs.iter() {
            for (list, number) in [(&mut self.rows, pair.row), (&mut self.columns, pair.column)] {
                if !list.contains(&number) {
                    crowd |= list.len() == MOST_IN_GROUP;
                    if !crowd {
                        list.push(number);
                    }
                }
            }
        }
        if crowd {
            pairs.sort_unstable_by(|a, b| {
                a.cost.total_cmp(&b.cost).then(a.row.cmp(&b.row)).then(a.column.cmp(&b.column))
            });
            for pair in pairs.iter() {
                let (row, column) = (pair.row as usize, pair.column as usize);
                if self.assigned[row] == NONE && !self.taken[column] {
                    self.assigned[row] = pair.column;
                    self.taken[column] = true;
                }
            }
            return;
        }
        let (rows, columns) = (&self.rows, &self.columns);
        self.work.begin(rows.len(), columns.len(), gate);
        let place = |list: &[u32], number| list.iter().position(|&n| n == number).unwrap_or(0);
        for pair in pairs.iter() {
            self.work.set(place(rows, pair.row), place(columns, pair.column), pair.cost);
        }
        self.work.solve();
        for (k, &row) in rows.iter().enumerate() {
            if let Some(column) = self.work.column_of(k).and_then(|c| columns.get(c)) {
                self.assigned[row as usize] = *column;
            }
        }
    }
}

/// A dense problem of n rows and m columns, followed by a column of its own for each row: no measurement.
#[derive(Debug, Clone)]
struct Work {
    rows: usize,
    columns: usize,
    real_columns: usize,
    cost: Vec<f64>,
    // Potentials of rows and columns, the row of each column, the way back, the least reduced costs: all from 1, 0 is
    // the row that is being added.
    u: Vec<f64>,
    v: Vec<f64>,
    row_of: Vec<usize>,
    way: Vec<usize>,
    least: Vec<f64>,
    used: Vec<bool>,
}

impl Work {
    fn new() -> Work {
        let (rows, columns) = (MOST_IN_GROUP, 2 * MOST_IN_GROUP);
        Work {
            rows: 0,
            columns: 0,
            real_columns: 0,
            cost: Vec::with_capacity(rows * columns),
            u: Vec::with_capacity(rows + 1),
            v: Vec::with_capacity(columns + 1),
            row_of: Vec::with_capacity(columns + 1),
            way: Vec::with_capacity(columns + 1),
            least: Vec::with_capacity(columns + 1),
            used: Vec::with_capacity(columns + 1),
        }
    }

    fn begin(&mut self, rows: usize, columns: usize, gate: f64) {
        (self.rows, self.columns, self.real_columns) = (rows, columns + rows, columns);
        self.cost.clear();
        self.cost.resize(self.rows * self.columns, NEVER);
        for r in 0..rows {
            self.cost[r * self.columns + columns + r] = gate;
        }
    }

    fn set(&mut self, row: usize, column: usize, cost: f64) {
        self.cost[row * self.columns + column] = cost;
    }

    fn solve(&mut self) {
        let (n, m) = (self.rows, self.columns);
        for (list, length) in [(&mut self.u, n + 1), (&mut self.v, m + 1)] {
            list.clear();
            list.resize(length, 0.0);
        }
        self.row_of.clear();
        self.row_of.resize(m + 1, 0);
        self.way.clear();
        self.way.resize(m + 1, 0);
        for row in 1..=n {
            self.row_of[0] = row;
            self.least.clear();
            self.least.resize(m + 1, f64::INFINITY);
            self.used.clear();
            self.used.resize(m + 1, false);
            let mut at = 0;
            loop {
                self.used[at] = true;
                let r = self.row_of[at];
                let (mut delta, mut next) = (f64::INFINITY, 0);
                for j in 1..=m {
                    if self.used[j] {
                        continue;
                    }
                    let reduced = self.cost[(r - 1) * m + j - 1] - self.u[r] - self.v[j];
                    if reduced < self.least[j] {
                        self.least[j] = reduced;
                        self.way[j] = at;
                    }
                    if self.least[j] < delta {
                        delta = self.least[j];
                        next = j;
                    }
                }
                for j in 0..=m {
                    if self.used[j] {
                        self.u[self.row_of[j]] += delta;
                        self.v[j] -= delta;
                    } else {
                        self.least[j] -= delta;
                    }
                }
                at = next;
                if self.row_of[at] == 0 {
                    break;
                }
            }
            while at != 0 {
                let before = self.way[at];
                self.row_of[at] = self.row_of[before];
                at = before;
            }
        }
    }

    /// The real column that row `row` was given.
    fn column_of(&self, row: usize) -> Option<usize> {
        (1..=self.real_columns).find(|&j| self.row_of[j] == row + 1).map(|j| j - 1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const GATE: f64 = 9.21;

    fn solve(costs: &[&[f64]]) -> Vec<u32> {
        let columns = costs.first().map_or(0, |row| row.len());
        let mut association = Association::new(costs.len(), columns);
        association.begin();
        for (r, row) in costs.iter().enumerate() {
            for (c, &cost) in row.iter().enumerate().filter(|(_, cost)| **cost < GATE) {
                association.may_be(Pair { row: r as u32, column: c as u32, cost });
            }
        }
        association.solve(costs.len(), columns, GATE).to_vec()
    }

    fn total(costs: &[&[f64]], given: &[u32]) -> f64 {
        given.iter().enumerate().map(|(r, &c)| if c == NONE { GATE } else { costs[r][c as usize] }).sum()
    }

    #[test]
    fn the_pairs_as_a_whole_are_the_nearest_not_each_one_alone() {
        // The nearest of track 0 is measurement 0, but that would leave track 1 without one.
        assert_eq!(solve(&[&[1.0, 2.0], &[1.5, 50.0]]), [1, 0]);
    }

    #[test]
    fn a_track_outside_every_gate_gets_nothing() {
        assert_eq!(solve(&[&[50.0, 20.0], &[1.0, 50.0]]), [NONE, 0]);
        assert_eq!(solve(&[&[3.0], &[2.0], &[1.0]]), [NONE, NONE, 0]);
    }

    #[test]
    fn a_crowd_beyond_the_limit_is_still_assigned_one_to_one() {
        let count = 2 * MOST_IN_GROUP;
        let costs: Vec<Vec<f64>> =
            (0..count).map(|r| (0..count).map(|c| 4.0 * (r as f64 - c as f64).abs()).collect()).collect();
        let rows: Vec<&[f64]> = costs.iter().map(Vec::as_slice).collect();
        assert_eq!(solve(&rows), (0..count as u32).collect::<Vec<_>>());
    }

    /// Every way there is.
    fn least(costs: &[&[f64]], row: usize, taken: &mut Vec<bool>) -> f64 {
        if row == costs.len() {
            return 0.0;
        }
        let mut best = GATE + least(costs, row + 1, taken);
        for c in 0..taken.len() {
            if !taken[c] && costs[row][c] < GATE {
                taken[c] = true;
                best = best.min(costs[row][c] + least(costs, row + 1, taken));
                taken[c] = false;
            }
        }
        best
    }

    proptest! {
        #[test]
        fn no_other_assignment_costs_less(rows in 1usize..6, columns in 1usize..6, seed in prop::collection::vec(0.0..14.0f64, 25)) {
            let costs: Vec<&[f64]> = (0..rows).map(|r| &seed[r * 5..r * 5 + columns.min(5)]).collect();
            let given = solve(&costs);
            let mut used: Vec<u32> = given.iter().copied().filter(|&c| c != NONE).collect();
            used.sort_unstable();
            used.dedup();
            prop_assert_eq!(used.len(), given.iter().filter(|&&c| c != NONE).count());
            let best = least(&costs, 0, &mut vec![false; costs[0].len()]);
            prop_assert!((total(&costs, &given) - best).abs() < 1e-9, "{given:?} {} {best}", total(&costs, &given));
        }
    }
}
