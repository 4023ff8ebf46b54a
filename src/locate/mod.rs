// SPDX-License-Identifier: MIT OR Apache-2.0
//! Stage 2, locate: the host cell of each particle.
//!
//! Reads positions (m) and where to look first; writes cell slots and positions brought back through cyclic
//! faces. A point on a face belongs to the cell its normal points out of, so to exactly one. On meshes with
//! plane faces the answer does not depend on the first guess; on warped faces the guess is not used.

mod bins;

use crate::mesh::{Mesh, NONE, Side};
use crate::threads;
use bins::{Bins, Lists};
use std::sync::OnceLock;

/// A particle without a host cell.
#[derive(Clone, Debug, PartialEq)]
pub struct Lost {
    /// position in the list
    pub index: usize,
    /// m
    pub position: [f64; 3],
    /// boundary patch it left through, if known
    pub near: Option<String>,
}

/// A coarse grid of first guesses, and a tolerance for boundaries.
pub struct Locator {
    bins: Bins,
    seed: Vec<u32>,
    planar: bool,
    /// cells near each place, made when first a particle is not found on its way
    near: OnceLock<Lists>,
}

/// Distance a point may lie outside a boundary face, relative to the cell size: rounding only.
const BOUNDARY: f64 = 1e-10;

enum Walk {
    Found(u32),
    Boundary(u32),
    Failed,
}

impl Locator {
    /// About one bin per cell.
    pub fn new(mesh: &Mesh) -> Self {
        let bins = Bins::new(mesh);
        let mut seed = vec![NONE; bins.len()];
        for (slot, c) in mesh.centre.iter().enumerate() {
            let b = bins.of(*c);
            if seed[b] == NONE {
                seed[b] = slot as u32;
            }
        }
        let mut last = 0;
        for s in &mut seed {
            if *s == NONE { *s = last } else { last = *s }
        }
        Self { bins, seed, planar: planar(mesh), near: OnceLock::new() }
    }

    /// The cell that holds `x`, by looking at all cells near: the one whose worst side is violated least (0: inside), the
    /// lowest id of equals. Between warped faces a point may be in no cell or in several.
    fn search(&self, mesh: &Mesh, x: [f64; 3]) -> Option<u32> {
        let near = self
            .near
            .get_or_init(|| Lists::new(mesh, &self.bins, if self.planar { 1e-6 } else { 5.0 * GAP }));
        let best = |strict| {
            let mut best: Option<(f64, u32)> = None;
            for cell in near.of(self.bins.of(x)) {
                if let Some(worst) = violated(mesh, *cell as usize, &x, self.planar, strict)
                    && best.is_none_or(|b| worst < b.0)
                {
                    best = Some((worst, *cell));
                }
            }
            best.map(|b| b.1)
        };
        // on an edge each of its faces may send the point on, by rounding
        best(self.planar).or_else(|| best(false))
    }

    /// Finds all host cells. `host`: in: guesses or `NONE`; out: slots. Errors list every lost particle.
    pub fn locate(&self, mesh: &Mesh, position: &mut [[f64; 3]], host: &mut [u32]) -> Result<(), Vec<Lost>> {
        const PIECE: usize = 4096;
        let pieces = position.chunks_mut(PIECE).zip(host.chunks_mut(PIECE)).enumerate().collect();
        let lost = threads::map(pieces, |(k, (x, h))| self.locate_piece(mesh, k * PIECE, x, h)).concat();
        if lost.is_empty() { Ok(()) } else { Err(lost) }
    }

    fn locate_piece(
        &self,
        mesh: &Mesh,
        first: usize,
        position: &mut [[f64; 3]],
        host: &mut [u32],
    ) -> Vec<Lost> {
        let mut lost = Vec::new();
        for (k, (x, h)) in position.iter_mut().zip(host.iter_mut()).enumerate() {
            let index = first + k;
            let guess = if self.planar && *h != NONE { *h } else { self.seed[self.bins.of(*x)] };
            let mut y = *x;
            *h = match self.walk(mesh, guess, &mut y) {
                Walk::Found(slot) => slot,
                Walk::Boundary(patch) => match self.search(mesh, y) {
                    Some(slot) => slot,
                    None => {
                        let near = mesh.patch_names.get(patch as usize).cloned();
                        lost.push(Lost { index, position: *x, near });
                        NONE
                    }
                },
                Walk::Failed => self.search(mesh, y).unwrap_or_else(|| {
                    lost.push(Lost { index, position: *x, near: None });
                    NONE
                }),
            };
            if *h != NONE {
                *x = y;
            }
        }
        lost
    }
}

/// How far `x` lies beyond a side (> 0: outside), and whether it belongs to the cell across.
fn beyond(mesh: &Mesh, side: &Side, x: &[f64; 3]) -> (f64, bool) {
    let s = side.beyond(x);
    // on the face (s = 0): inside the cell the normal leaves, outside the other; of the two images on a pair of
    // cyclic faces the lower one is inside
    let on = || match mesh.shift(side).iter().find(|x| **x != 0.0) {
        Some(shift) => *shift < 0.0,
        None => !side.outward(),
    };
    (s, s > 0.0 || (s == 0.0 && on()))
}

impl Locator {
    fn walk(&self, mesh: &Mesh, from: u32, x: &mut [f64; 3]) -> Walk {
        let mut cell = from;
        // where the walk was at step 1, 2, 4, 8 …: a cell met again at the same point is a cycle (warped faces)
        let (mut seen, mut next_mark) = ((NONE, *x), 1);
        for step in 0..100_000 {
            if seen == (cell, *x) {
                return Walk::Failed;
            }
            if step == next_mark {
                (seen, next_mark) = ((cell, *x), 2 * next_mark);
            }
            // nearly always: strictly inside, no side needs a closer look
            let sides = mesh.sides(cell as usize);
            if sides.iter().fold(true, |inside, s| inside & (s.beyond(x) < 0.0)) {
                return Walk::Found(cell);
            }
            let tolerance = BOUNDARY * mesh.volume[cell as usize].cbrt();
            let (mut inner, mut wall) = (None::<(f64, usize)>, None::<u32>);
            for (i, side) in sides.iter().enumerate() {
                let (distance, leaves) = beyond(mesh, side, x);
                if side.across == NONE {
                    if distance > tolerance {
                        wall = wall.or(Some(side.patch()));
                    }
                } else if leaves && inner.is_none_or(|b| distance > b.0) {
                    inner = Some((distance, i));
                }
            }
            match (inner, wall) {
                (Some((_, i)), _) => {
                    cell = sides[i].across;
                    let shift = mesh.shift(&sides[i]);
                    (0..3).for_each(|a| x[a] += shift[a]);
                }
                (None, Some(patch)) => return Walk::Boundary(patch),
                (None, None) => return Walk::Found(cell),
            }
        }
        Walk::Failed
    }
}

/// Largest gap or overlap between cells of a warped mesh that a point may lie in, relative to the cell size.
pub(crate) const GAP: f64 = 0.1;

/// How far `x` lies beyond the worst side of a cell (0: inside); none: not in it. `strict`: nor if it belongs across a side.
fn violated(mesh: &Mesh, cell: usize, x: &[f64; 3], planar: bool, strict: bool) -> Option<f64> {
    let size = mesh.volume[cell].cbrt();
    let allowed = if planar { BOUNDARY * size } else { GAP * size };
    let mut worst = 0.0f64;
    for side in mesh.sides(cell) {
        let (distance, leaves) = beyond(mesh, side, x);
        let limit = if side.across == NONE { BOUNDARY * size } else { allowed };
        if distance > limit || (strict && leaves) {
            return None;
        }
        worst = worst.max(if side.across == NONE { 0.0 } else { distance });
    }
    Some(worst)
}

/// All faces flat to rounding? Then cells are convex cuts and the walk's end is unique.
fn planar(mesh: &Mesh) -> bool {
    (0..mesh.len()).all(|slot| {
        let tolerance = 1e-9 * mesh.volume[slot].cbrt();
        let flat = |(side, points): (&Side, &[u32])| {
            points.iter().all(|p| side.beyond(&mesh.faces.points[*p as usize]).abs() <= tolerance)
        };
        mesh.sides(slot).iter().zip(mesh.loops(slot)).all(flat)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::made::Made;

    /// Looking at the cells near finds what looking at all of them does, inside, outside and between warped faces.
    #[test]
    fn cells_near_are_enough() {
        let size = [0.06, 0.04, 0.05];
        for made in [
            Made::hex([6, 4, 5], size).jiggled(0.3),
            Made::graded([9, 8, 7], size),
            Made::tet([4, 3, 4], size).cyclic([true, false, false]),
            Made::poly([4, 3, 3], size),
        ] {
            let mesh = made.mesh();
            let locator = Locator::new(&mesh);
            let (mut seed, mut outside) = (3, 0);
            for _ in 0..4000 {
                let x = size.map(|s| s * (1.2 * crate::bench::scene::random(&mut seed) - 0.1));
                let all = (0..mesh.len()).filter_map(|c| {
                    Some((violated(&mesh, c, &x, locator.planar, locator.planar)?, c as u32))
                });
                let best = all.min_by(|a, b| a.0.total_cmp(&b.0));
                assert_eq!(locator.search(&mesh, x), best.map(|b| b.1), "{made:?} {x:?}");
                outside += usize::from(best.is_none());
            }
            assert!((500..3500).contains(&outside), "{outside}");
        }
    }

    /// Edges and corners belong to a cell, whatever the rounding of the faces that meet there.
    #[test]
    fn points_on_edges_are_in_a_cell() {
        for made in [
            Made::hex([10, 10, 10], [0.1; 3]),
            Made::graded([9, 8, 7], [0.06, 0.04, 0.05]),
            Made::tet([4, 3, 4], [0.06, 0.04, 0.05]).cyclic([true, false, false]),
            Made::poly([4, 3, 3], [0.06, 0.04, 0.05]),
        ] {
            let mesh = made.mesh();
            let locator = Locator::new(&mesh);
            let mut x = mesh.faces.points.clone();
            let mut host = vec![NONE; x.len()];
            let lost = locator.locate(&mesh, &mut x, &mut host);
            assert_eq!(lost, Ok(()), "{made:?}");
        }
    }
}
