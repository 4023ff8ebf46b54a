// SPDX-License-Identifier: MIT OR Apache-2.0
//! Cells around a cell, with their images through cyclics and those mirrored at walls: what a deposit that reaches
//! over several cells sees. Lengths m. Found by a walk through faces, so nothing is seen through a baffle. Does not know
//! particles.
//!
//! Where walls are not plane (warped, curved, steps), images of one cell mirrored the same number of times that lie
//! closer than `SAME` count once. Most cells are seen where they are: the walk keeps 12 bytes of these, and a turn only
//! of the others.

use crate::mesh::geometry::{V, add, dot, length, scale, sub};
use crate::mesh::{Mesh, NONE};

/// Images of a cell closer than this, relative to its size, are the same.
const SAME: f64 = 0.3;

/// A cell on the walk.
#[derive(Clone, Copy, Debug)]
struct Step {
    cell: u32,
    /// its number in `moved`; `NONE`: seen where it is
    moved: u32,
    /// the step before at the same cell
    before: u32,
}

/// How an image got where it is seen.
#[derive(Clone, Copy, Debug)]
struct Moved {
    /// its centre, m
    at: V,
    /// rows: turns its vectors
    turn: [V; 3],
    /// where its origin is seen, m
    origin: V,
    odd: bool,
}

const UNIT: [V; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// The cells around one of them.
#[derive(Clone, Debug, Default)]
pub(super) struct Around {
    walk: Vec<Step>,
    moved: Vec<Moved>,
    /// steps within reach: cell × 2³² + number of the step, ascending
    list: Vec<u64>,
    /// by cell: its last step; `NONE`: not seen
    last: Vec<u32>,
}

fn turned(turn: &[V; 3], x: V) -> V {
    [dot(turn[0], x), dot(turn[1], x), dot(turn[2], x)]
}

impl Around {
    /// All cells whose centres are closer to that of `home` than `reach` (m) and are reached through such; `extent`:
    /// distance of the furthest corner of each cell from its centre (m).
    pub fn find(&mut self, mesh: &Mesh, extent: &[f64], home: u32, reach: f64) {
        self.last.resize(mesh.len(), NONE);
        self.walk.clear();
        self.moved.clear();
        self.list.clear();
        let middle = mesh.centre[home as usize];
        self.step(home, NONE);
        let mut k = 0;
        while k < self.walk.len() {
            let Step { cell, moved, .. } = self.walk[k];
            let at = self.moved.get(moved as usize).map_or(mesh.centre[cell as usize], |i| i.at);
            let d = sub(at, middle);
            if dot(d, d) <= reach * reach {
                let from = self.moved.get(moved as usize).copied();
                self.list.push(u64::from(cell) << 32 | k as u64);
                for side in mesh.sides(cell as usize) {
                    if side.across == NONE {
                        self.mirror(mesh, extent, cell, side.plane, from);
                    } else if from.is_none() && !side.shifts() {
                        // most have been seen just there
                        let (to, last) = (side.across as usize, self.last[side.across as usize]);
                        let elsewhere = || self.walk[last as usize].moved != NONE;
                        if last == NONE || elsewhere() && !self.met(mesh, extent, to, mesh.centre[to], false)
                        {
                            self.step(side.across, NONE);
                        }
                    } else {
                        let (turn, origin, odd) =
                            from.map_or((UNIT, [0.0; 3], false), |i| (i.turn, i.origin, i.odd));
                        let moved = || sub(origin, turned(&turn, mesh.shift(side)));
                        let origin = if side.shifts() { moved() } else { origin };
                        self.see(mesh, extent, side.across, turn, origin, odd);
                    }
                }
            }
            k += 1;
        }
        self.walk.iter().for_each(|i| self.last[i.cell as usize] = NONE);
        self.list.sort_unstable();
    }

    /// What `find` found, by cell: images of one follow each other, in the order of the walk. Its place, if it is not its own.
    pub fn seen(&self) -> impl Iterator<Item = (u32, Option<V>)> {
        let place = |moved: u32| self.moved.get(moved as usize).map(|i| i.at);
        self.list.iter().map(move |e| ((e >> 32) as u32, place(self.walk[*e as u32 as usize].moved)))
    }

    /// A cell at a wall, mirrored at it as it is seen.
    fn mirror(&mut self, mesh: &Mesh, extent: &[f64], cell: u32, plane: [f64; 4], from: Option<Moved>) {
        let (t, origin, odd) = from.map_or((UNIT, [0.0; 3], false), |i| (i.turn, i.origin, i.odd));
        let n = turned(&t, [plane[0], plane[1], plane[2]]);
        let d = plane[3] + dot(n, origin);
        let along: V = add(add(scale(t[0], n[0]), scale(t[1], n[1])), scale(t[2], n[2]));
        let row = |r: usize| sub(t[r], scale(along, 2.0 * n[r]));
        let origin = add(origin, scale(n, 2.0 * (d - dot(n, origin))));
        self.see(mesh, extent, cell, [row(0), row(1), row(2)], origin, !odd);
    }

    /// An image, unless it has been seen.
    fn see(&mut self, mesh: &Mesh, extent: &[f64], cell: u32, turn: [V; 3], origin: V, odd: bool) {
        let at = add(turned(&turn, mesh.centre[cell as usize]), origin);
        if !self.met(mesh, extent, cell as usize, at, odd) {
            self.moved.push(Moved { at, turn, origin, odd });
            self.step(cell, self.moved.len() as u32 - 1);
        }
    }

    /// Has the cell been seen there?
    #[inline]
    fn met(&self, mesh: &Mesh, extent: &[f64], cell: usize, at: V, odd: bool) -> bool {
        let mut k = self.last[cell];
        while k != NONE {
            let step = self.walk[k as usize];
            let own = (mesh.centre[cell], false);
            let (there, other) = self.moved.get(step.moved as usize).map_or(own, |i| (i.at, i.odd));
            if other == odd && (there == at || length(sub(there, at)) < SAME * extent[cell]) {
                return true;
            }
            k = step.before;
        }
        false
    }

    #[inline]
    fn step(&mut self, cell: u32, moved: u32) {
        let before = std::mem::replace(&mut self.last[cell as usize], self.walk.len() as u32);
        self.walk.push(Step { cell, moved, before });
    }
}
