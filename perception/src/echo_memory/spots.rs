//! The spots of the memory, with their places apart: most questions are settled by the place alone, many at a time.

use super::arc::Spot;
use std::ops::Index;

/// Places that are asked about at once.
const LANES: usize = 8;

/// A bounded list of spots.
#[derive(Debug)]
pub(super) struct Spots {
    spots: Vec<Spot>,
    x_m: Vec<f64>,
    y_m: Vec<f64>,
    capacity: usize,
}

impl Spots {
    pub(super) fn new(capacity: usize) -> Spots {
        let [x_m, y_m] = [0, 1].map(|_| Vec::with_capacity(capacity));
        Spots { spots: Vec::with_capacity(capacity), x_m, y_m, capacity }
    }

    pub(super) fn len(&self) -> usize {
        self.spots.len()
    }

    pub(super) fn iter(&self) -> impl Iterator<Item = &Spot> {
        self.spots.iter()
    }

    pub(super) fn clear(&mut self) {
        self.spots.clear();
        self.x_m.clear();
        self.y_m.clear();
    }

    /// Appends a spot; false where there is no room.
    pub(super) fn push(&mut self, spot: Spot) -> bool {
        let room = self.spots.len() < self.capacity;
        if room {
            self.spots.push(spot);
            self.x_m.push(spot.x_m);
            self.y_m.push(spot.y_m);
        }
        room
    }

    pub(super) fn set(&mut self, k: usize, spot: Spot) {
        self.spots[k] = spot;
        (self.x_m[k], self.y_m[k]) = (spot.x_m, spot.y_m);
    }

    /// Keeps the spots that `keep` holds for, in order.
    pub(super) fn retain(&mut self, keep: impl FnMut(&Spot) -> bool) {
        let before = self.spots.len();
        self.spots.retain(keep);
        if self.spots.len() < before {
            self.x_m.clear();
            self.x_m.extend(self.spots.iter().map(|spot| spot.x_m));
            self.y_m.clear();
            self.y_m.extend(self.spots.iter().map(|spot| spot.y_m));
        }
    }

    /// Lists the spots whose place passes `test`, in order. `test` is best written without branches.
    pub(super) fn find(&self, found: &mut Vec<usize>, test: impl Fn(f64, f64) -> bool) {
        found.clear();
        for (chunk, (x_m, y_m)) in self.x_m.chunks(LANES).zip(self.y_m.chunks(LANES)).enumerate() {
            let places = x_m.iter().zip(y_m);
            if places.clone().fold(false, |any, (x_m, y_m)| any | test(*x_m, *y_m)) {
                let hits = places.enumerate().filter(|(_, (x_m, y_m))| test(**x_m, **y_m));
                found.extend(hits.map(|(k, _)| chunk * LANES + k));
            }
        }
    }
}

impl Index<usize> for Spots {
    type Output = Spot;

    fn index(&self, k: usize) -> &Spot {
        &self.spots[k]
    }
}
