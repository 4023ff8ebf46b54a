// SPDX-License-Identifier: MIT OR Apache-2.0
//! Cells around a cell, with their images through cyclics and those mirrored at walls: what a deposit that reaches
//! over several cells sees. Lengths m. Found by a walk through faces, so nothing is seen through a baffle. Does not know
//! particles.
//!
//! Where walls are not those of a box (curved, oblique, steps, baffles), mirrored cells would lie over each other without end: of a place behind
//! them only the cell counts that a straight line from `home` arrives in, mirrored at the walls it meets (a cell whose image is cut by the edge
//! between two facets may be missing); and images of one cell mirrored the same number of
//! times that lie closer than `SAME` count once. Most cells are seen where they are: the walk keeps 12 bytes of these, and a turn only
//! of the others.

use crate::mesh::geometry::{V, add, dot, length, scale, sub};
use crate::mesh::{Mesh, NONE, Side};

/// Images of a cell closer than this, relative to its size, are the same.
const SAME: f64 = 0.3;
/// Of a cosine.
const ROUNDING: f64 = 1e-6;
/// Images turned and moved by less, relative to 1 and to the size of a cell, are the same: plane walls whose points were written with few digits.
const ALIKE: f64 = 1e-3;
/// Sides a straight line passes, at most.
const LONGEST: usize = 1000;

/// A cell on the walk.
#[derive(Clone, Copy, Debug)]
struct Step {
    cell: u32,
    /// its number in `moved`; `NONE`: seen where it is
    moved: u32,
    /// the step before at the same cell
    before: u32,
}

/// How a cell is seen: rows that turn its vectors, and where the origin is, m.
#[derive(Clone, Copy, Debug)]
struct Frame {
    turn: [V; 3],
    origin: V,
}

/// An image.
#[derive(Clone, Copy, Debug)]
struct Moved {
    /// its centre, m
    at: V,
    frame: Frame,
    odd: bool,
    /// came by a wall
    behind: bool,
}

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

impl Frame {
    const OWN: Self = Self { turn: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], origin: [0.0; 3] };

    /// Where a point of the mesh is seen.
    fn seen(&self, x: V) -> V {
        add(turned(&self.turn, x), self.origin)
    }
    /// The point of the mesh that is seen there.
    fn real(&self, x: V) -> V {
        let (x, t) = (sub(x, self.origin), &self.turn);
        add(add(scale(t[0], x[0]), scale(t[1], x[1])), scale(t[2], x[2]))
    }
    /// Behind a side: shifted by a cyclic or mirrored at a wall as it is seen.
    fn beyond(&self, mesh: &Mesh, side: &Side) -> Self {
        let Self { turn: t, origin } = *self;
        if side.across != NONE {
            let moved = || sub(origin, turned(&t, mesh.shift(side)));
            return if side.shifts() { Self { origin: moved(), ..*self } } else { *self };
        }
        let p = side.plane;
        let n = turned(&t, [p[0], p[1], p[2]]);
        let d = p[3] + dot(n, origin);
        let along: V = add(add(scale(t[0], n[0]), scale(t[1], n[1])), scale(t[2], n[2]));
        let row = |r: usize| sub(t[r], scale(along, 2.0 * n[r]));
        let origin = add(origin, scale(n, 2.0 * (d - dot(n, origin))));
        Self { turn: [row(0), row(1), row(2)], origin }
    }
}

/// Are the walls not those of a box, but oblique or re-entrant? Only there mirrored cells lie over each other.
pub(super) fn bent(mesh: &Mesh) -> bool {
    // outward normals, and the innermost of their walls
    let mut walls: Vec<(V, f64)> = Vec::new();
    for side in (0..mesh.len()).flat_map(|c| mesh.sides(c)).filter(|s| s.across == NONE) {
        let (n, d) = ([side.plane[0], side.plane[1], side.plane[2]], side.plane[3]);
        let cosines = || walls.iter().map(|w| dot(w.0, n).abs());
        if cosines().any(|c| c > ROUNDING && c < 1.0 - ROUNDING * ROUNDING) {
            return true;
        }
        match walls.iter_mut().find(|w| dot(w.0, n) > 0.5) {
            Some(w) => w.1 = w.1.min(d),
            None => walls.push((n, d)),
        }
    }
    mesh.centre.iter().any(|x| walls.iter().any(|(n, d)| dot(*n, *x) > *d))
}

/// The frame in which a straight line from the centre of a cell arrives at a place.
fn arrival(mesh: &Mesh, home: u32, to: V) -> Option<Frame> {
    let (mut cell, mut frame) = (home, Frame::OWN);
    for _ in 0..LONGEST {
        let (a, b) = (frame.real(mesh.centre[home as usize]), frame.real(to));
        let way = sub(b, a);
        let (mut least, mut next) = (1.0, None);
        for side in mesh.sides(cell as usize) {
            let n = [side.plane[0], side.plane[1], side.plane[2]];
            let (speed, left) = (dot(n, way), side.plane[3] - dot(n, a));
            if speed > 0.0 && left < least * speed {
                (least, next) = (left / speed, Some(side));
            }
        }
        let Some(side) = next else { return Some(frame) };
        frame = frame.beyond(mesh, side);
        cell = if side.across == NONE { cell } else { side.across };
    }
    None
}

impl Around {
    /// All cells whose centres are closer to that of `home` than `reach` (m) and are reached through such; `extent`:
    /// distance of the furthest corner of each cell from its centre (m); `bent`: the mesh's walls are.
    pub fn find(&mut self, mesh: &Mesh, extent: &[f64], home: u32, reach: f64, bent: bool) {
        let checked = bent.then_some(home);
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
                    let wall = side.across == NONE;
                    if from.is_none() && !wall && !side.shifts() {
                        // most have been seen just there
                        let (to, last) = (side.across as usize, self.last[side.across as usize]);
                        let elsewhere = || self.walk[last as usize].moved != NONE;
                        if last == NONE || elsewhere() && !self.met(mesh, extent, to, mesh.centre[to], false)
                        {
                            self.step(side.across, NONE);
                        }
                        continue;
                    }
                    let (frame, odd, behind) =
                        from.map_or((Frame::OWN, false, false), |i| (i.frame, i.odd, i.behind));
                    let frame = frame.beyond(mesh, side);
                    let to = if wall { cell } else { side.across };
                    let at = frame.seen(mesh.centre[to as usize]);
                    let new = Moved { at, frame, odd: odd != wall, behind: behind || wall };
                    self.see(mesh, extent, to, new, checked);
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

    /// An image, unless it has been seen, or is behind walls and not what a straight line from the cell `checked` arrives in.
    fn see(&mut self, mesh: &Mesh, extent: &[f64], cell: u32, new: Moved, checked: Option<u32>) {
        if self.met(mesh, extent, cell as usize, new.at, new.odd) {
            return;
        }
        let alike = |f: Frame| {
            let turned = |r: usize| length(sub(f.turn[r], new.frame.turn[r]));
            let moved = length(sub(f.seen(mesh.centre[cell as usize]), new.at));
            (0..3).all(|r| turned(r) < ALIKE) && moved < ALIKE * extent[cell as usize]
        };
        if new.behind && checked.is_some_and(|home| !arrival(mesh, home, new.at).is_some_and(alike)) {
            return;
        }
        self.moved.push(new);
        self.step(cell, self.moved.len() as u32 - 1);
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::made::{Bend, Made};

    /// Behind walls curved outwards or inwards each place is seen once: the cells around fill a ball, whatever walls cut it; cells are counted whole by their centres, and
    /// some behind the edge between two walls are not reached.
    #[test]
    fn images_fill_the_space_once() {
        let size = [0.05, 0.05, 0.04];
        for made in [
            Made::hex([10, 10, 8], size).round(),
            Made::tet([6, 6, 5], size).mirrored().round(),
            Made::hex([10, 10, 8], size),
            Made::hex([10, 10, 8], size).round().cyclic([false, false, true]),
            Made::hex([5, 24, 8], [0.025, 0.1, 0.04]).ring(),
            Made::hex([5, 24, 8], [0.025, 0.1, 0.04]).ring().cyclic([false, false, true]),
        ] {
            let mesh = made.mesh();
            let (extent, radius) = (mesh.extents(), 0.015);
            let bent = bent(&mesh);
            assert_eq!(bent, made.bend != Bend::None);
            let mut around = Around::default();
            let (mut least, mut most, mut mean) = (f64::INFINITY, 0.0f64, 0.0);
            for home in 0..mesh.len() {
                around.find(&mesh, &extent, home as u32, radius, bent);
                let volume: f64 = around.seen().map(|(c, _)| mesh.volume[c as usize]).sum();
                let share = volume / (4.0 / 3.0 * std::f64::consts::PI * radius.powi(3));
                (least, most, mean) = (least.min(share), most.max(share), mean + share / mesh.len() as f64);
            }
            println!("{made:?}: {least:.3} {mean:.3} {most:.3}");
            assert!(
                (0.85..1.1).contains(&mean) && least > 0.6 && most < 1.4,
                "{made:?}: {least} {mean} {most}"
            );
        }
    }
}
