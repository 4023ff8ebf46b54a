// SPDX-License-Identifier: MIT OR Apache-2.0
//! Rectilinear blocks of hexahedra, at any angle: three pairs of parallel sides at right angles, centres of
//! neighbours on the normals, and the 26 cells around it reached the same way in any order of steps. Tri-linear
//! weights between cell centres.

use super::super::Weights;
use crate::mesh::geometry::{V, dot, length, scale, sub};
use crate::mesh::{Mesh, NONE, Side};

/// What a cell needs: axis, 1/distance to the neighbours below and above (0 at a wall).
#[derive(Clone, Copy, Debug, Default)]
struct Axis {
    n: V,
    inverse: [f64; 2],
}

/// All cells; those not in a block have `ring` entry `NOT`.
#[derive(Debug, Default)]
pub(super) struct Block {
    axes: Vec<[Axis; 3]>,
    /// the 27 cells of each cell by (1 + step) in base 3, itself in the middle (`NONE`: behind a wall); `NOT` in
    /// the middle: not in a block
    ring: Vec<[u32; 27]>,
}

const NOT: u32 = NONE - 1;
/// Rounding of directions (radians).
const STRAIGHT: f64 = 1e-7;

fn out(s: &Side) -> V {
    [s.plane[0], s.plane[1], s.plane[2]]
}
/// The vector to the centre across.
fn step(mesh: &Mesh, cell: usize, s: &Side) -> V {
    sub(sub(mesh.centre[s.across as usize], mesh.shift(s)), mesh.centre[cell])
}
/// The only side towards `way`.
fn towards(mesh: &Mesh, cell: usize, way: V) -> Option<&Side> {
    let mut list = mesh.sides(cell).iter().filter(|s| dot(out(s), way) > 1.0 - STRAIGHT * STRAIGHT);
    let first = list.next()?;
    list.next().is_none().then_some(first)
}

impl Block {
    pub fn new(mesh: &Mesh) -> Self {
        let mut block = Self::default();
        for cell in 0..mesh.len() {
            let made = cell_of(mesh, cell);
            let mut none = [NONE; 27];
            none[13] = NOT;
            let (axes, ring) = made.unwrap_or(([Axis::default(); 3], none));
            block.axes.push(axes);
            block.ring.push(ring);
        }
        block
    }
    pub fn len(&self) -> usize {
        self.ring.len()
    }
    pub fn holds(&self, cell: usize) -> bool {
        self.ring[cell][13] != NOT
    }
    /// False: not in a block.
    #[inline]
    pub fn weights(&self, mesh: &Mesh, cell: usize, x: V, out: &mut Weights) -> bool {
        let (ring, axes) = (&self.ring[cell], &self.axes[cell]);
        if ring[13] == NOT {
            return false;
        }
        let d = sub(x, mesh.centre[cell]);
        let (mut t, mut way) = ([0.0; 3], [0usize; 3]);
        for a in 0..3 {
            let s = dot(d, axes[a].n);
            let high = usize::from(s > 0.0);
            t[a] = s.abs() * axes[a].inverse[high];
            let unit = [1, 3, 9][a];
            way[a] = if high == 1 { 13 + unit } else { 13 - unit };
        }
        for corner in 0..8usize {
            let (mut w, mut at) = (1.0, 13usize);
            for a in 0..3 {
                if corner >> a & 1 == 1 {
                    w *= t[a];
                    at = at + way[a] - 13;
                } else {
                    w *= 1.0 - t[a];
                }
            }
            if w > 0.0 {
                out.push(ring[at], w);
            }
        }
        true
    }
    /// Mean over the cell's half towards `way` of the deposit's variance along it minus that of the cell itself:
    /// ⟨y (d − y)⟩ − ⟨y²⟩ for y from 0 to h/2.
    pub fn variance(&self, mesh: &Mesh, cell: usize, way: V, d: f64) -> f64 {
        let faces = [way, scale(way, -1.0)].map(|w| {
            let side = towards(mesh, cell, w);
            side.map_or(0.0, |s| s.plane[3] - dot(out(s), mesh.centre[cell]))
        });
        let h = faces[0] + faces[1];
        d * h / 4.0 - h * h / 6.0
    }
}

fn cell_of(mesh: &Mesh, cell: usize) -> Option<([Axis; 3], [u32; 27])> {
    let sides = mesh.sides(cell);
    if sides.len() != 6 {
        return None;
    }
    // three directions: those of the sides whose largest component is positive, by axis
    let mut n: Vec<V> = Vec::new();
    for s in sides {
        let v = out(s);
        let big = (0..3).fold(0, |b, a| if v[a].abs() > v[b].abs() + 1e-6 { a } else { b });
        if v[big] > 0.0 {
            n.push(v);
        }
    }
    n.sort_by(|p, q| q.partial_cmp(p).unwrap_or(std::cmp::Ordering::Equal));
    let n: [V; 3] = n.try_into().ok()?;
    if dot(n[0], n[1]).abs() > STRAIGHT
        || dot(n[1], n[2]).abs() > STRAIGHT
        || dot(n[0], n[2]).abs() > STRAIGHT
    {
        return None;
    }
    let mut axes = n.map(|n| Axis { n, inverse: [0.0; 2] });
    for axis in &mut axes {
        for high in 0..2 {
            let way = scale(axis.n, if high == 1 { 1.0 } else { -1.0 });
            let side = towards(mesh, cell, way)?;
            if side.across != NONE {
                let d = step(mesh, cell, side);
                let size = length(d);
                if dot(d, way) < size * (1.0 - 1e-12) {
                    return None;
                }
                axis.inverse[high] = 1.0 / size;
            }
        }
    }
    let mut ring = [NONE; 27];
    for (k, slot) in ring.iter_mut().enumerate() {
        let steps = [k % 3, k / 3 % 3, k / 9].map(|s| s as i32 - 1);
        let mut found: Option<Option<u32>> = None;
        for order in [[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1], [1, 0, 2], [2, 1, 0]] {
            let mut at = cell as u32;
            for a in order {
                if steps[a] != 0 && at != NONE {
                    at = towards(mesh, at as usize, scale(n[a], f64::from(steps[a])))?.across;
                }
            }
            let at = (at != NONE).then_some(at);
            if found.is_some_and(|f| f != at) {
                return None;
            }
            found = Some(at);
        }
        *slot = found.flatten().unwrap_or(NONE);
        // the centre must lie where the steps say: the product of one-dimensional weights keeps the first moment
        if *slot != NONE && steps.iter().filter(|s| **s != 0).count() > 1 {
            let (mut at, mut sum) = (cell, [0.0; 3]);
            for a in 0..3 {
                if steps[a] != 0 {
                    let side = towards(mesh, at, scale(n[a], f64::from(steps[a])))?;
                    let d = step(mesh, at, side);
                    (0..3).for_each(|b| sum[b] += d[b]);
                    at = side.across as usize;
                }
            }
            for a in 0..3 {
                let inverse = axes[a].inverse[usize::from(steps[a] > 0)];
                let want = if steps[a] == 0 { 0.0 } else { f64::from(steps[a]) / inverse };
                if (dot(sum, n[a]) - want).abs() > 1e-7 * mesh.volume[cell].cbrt() {
                    return None;
                }
            }
        }
    }
    Some((axes, ring))
}
