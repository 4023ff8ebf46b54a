// SPDX-License-Identifier: MIT OR Apache-2.0
//! Cells around a cell, with their images through cyclics and those mirrored at walls: what a deposit that reaches
//! over several cells sees. Lengths m. Found by a walk through faces, so nothing is seen through a baffle. Does not know
//! particles.
//!
//! Where walls are not plane (warped, curved, steps), images of one cell mirrored the same number of times that lie
//! closer than `SAME` count once.

use crate::mesh::geometry::{V, add, dot, length, scale, sub};
use crate::mesh::{Mesh, NONE};

/// Images of a cell closer than this, relative to its size, are the same.
const SAME: f64 = 0.3;

/// A cell as it is seen: its centre, m.
#[derive(Clone, Copy, Debug)]
pub(super) struct Seen {
    pub cell: u32,
    pub at: V,
}

/// And how it got there.
#[derive(Clone, Copy, Debug)]
struct Image {
    cell: u32,
    at: V,
    /// rows: turns its vectors
    turn: [V; 3],
    /// where its origin is seen, m
    origin: V,
    odd: bool,
    /// the image before of the same cell
    before: u32,
}

/// The cells around one of them, by number; images of one cell follow each other.
#[derive(Clone, Debug, Default)]
pub(super) struct Around {
    pub list: Vec<Seen>,
    walk: Vec<Image>,
    /// by cell: its last image; `NONE`: not seen
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
        self.list.clear();
        let middle = mesh.centre[home as usize];
        let unit = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        self.see(mesh, extent, home, unit, [0.0; 3], false);
        let mut k = 0;
        while k < self.walk.len() {
            let from = self.walk[k];
            k += 1;
            let d = sub(from.at, middle);
            if dot(d, d) > reach * reach {
                continue;
            }
            self.list.push(Seen { cell: from.cell, at: from.at });
            for side in mesh.sides(from.cell as usize) {
                if side.across != NONE {
                    let moved = || sub(from.origin, turned(&from.turn, mesh.shift(side)));
                    let origin = if side.shifts() { moved() } else { from.origin };
                    self.see(mesh, extent, side.across, from.turn, origin, from.odd);
                    continue;
                }
                // mirrored at the wall as it is seen
                let p = side.plane;
                let n = turned(&from.turn, [p[0], p[1], p[2]]);
                let d = p[3] + dot(n, from.origin);
                let t = &from.turn;
                let along: V = add(add(scale(t[0], n[0]), scale(t[1], n[1])), scale(t[2], n[2]));
                let row = |r: usize| sub(t[r], scale(along, 2.0 * n[r]));
                let turn = [row(0), row(1), row(2)];
                let origin = add(from.origin, scale(n, 2.0 * (d - dot(n, from.origin))));
                self.see(mesh, extent, from.cell, turn, origin, !from.odd);
            }
        }
        self.walk.iter().for_each(|i| self.last[i.cell as usize] = NONE);
        // stable: images of one cell in the order of the walk
        self.list.sort_by_key(|i| i.cell);
    }

    fn see(&mut self, mesh: &Mesh, extent: &[f64], cell: u32, turn: [V; 3], origin: V, odd: bool) {
        let at = add(turned(&turn, mesh.centre[cell as usize]), origin);
        let mut k = self.last[cell as usize];
        while k != NONE {
            let image = &self.walk[k as usize];
            if image.odd == odd && length(sub(image.at, at)) < SAME * extent[cell as usize] {
                return;
            }
            k = image.before;
        }
        let before = std::mem::replace(&mut self.last[cell as usize], self.walk.len() as u32);
        self.walk.push(Image { cell, at, turn, origin, odd, before });
    }
}
