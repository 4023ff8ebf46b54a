// SPDX-License-Identifier: MIT OR Apache-2.0
//! Rectilinear blocks of hexahedra, at any angle: three pairs of parallel sides at right angles, centres of
//! neighbours on the normals, and the 26 cells around it reached the same way in any order of steps. Tri-linear
//! weights between cell centres. Directions and distances that agree to nine digits count as one.

use super::rings::{Fraction, OWN, Rings};
use crate::mesh::geometry::{V, dot, length, scale};
use crate::mesh::{Mesh, NONE, Side};
use std::collections::HashMap;
use std::sync::Arc;

/// All cells of a mesh.
#[derive(Debug, Default)]
pub(super) struct Block {
    /// three directions
    frames: Vec<[V; 3]>,
    /// 1/distance to the centres below and above (0 at a wall), 1/m
    steps: Vec<[f64; 2]>,
    /// frame of a cell and its steps along the three directions
    cells: Vec<(u32, [u32; 3])>,
    /// the cells around each; those not in a block have none
    pub rings: Arc<Rings>,
}

/// Rounding of directions (radians).
const STRAIGHT: f64 = 1e-7;
/// Digits of a table's keys.
const DIGITS: f64 = 1e9;

fn out(s: &Side) -> V {
    [s.plane[0], s.plane[1], s.plane[2]]
}
/// The only side towards `way`: which it is.
fn place(mesh: &Mesh, cell: usize, way: V) -> Option<usize> {
    let sides = mesh.sides(cell).iter().enumerate();
    let mut list = sides.filter(|s| dot(out(s.1), way) > 1.0 - STRAIGHT * STRAIGHT).map(|s| s.0);
    let first = list.next()?;
    list.next().is_none().then_some(first)
}
/// The only side towards `way`.
fn towards(mesh: &Mesh, cell: usize, way: V) -> Option<&Side> {
    place(mesh, cell, way).map(|k| &mesh.sides(cell)[k])
}

/// Number of `value` in `table`, which grows if it is new.
fn number<K: std::hash::Hash + Eq, T>(
    known: &mut HashMap<K, u32>,
    table: &mut Vec<T>,
    key: K,
    value: T,
) -> u32 {
    *known.entry(key).or_insert_with(|| {
        table.push(value);
        table.len() as u32 - 1
    })
}

/// A cell that may be in a block.
struct Candidate {
    n: [V; 3],
    /// 1/distance to the centres below and above (0 at a wall), 1/m
    inverse: [[f64; 2]; 3],
    /// which of its sides are below and above along each direction
    sides: Sides,
}
type Sides = [[u8; 2]; 3];

impl Block {
    pub fn new(mesh: &Mesh) -> Self {
        let mut block = Self::default();
        let (mut frames, mut steps, mut sides) = (HashMap::new(), HashMap::new(), Vec::new());
        for cell in 0..mesh.len() {
            let Some(c) = candidate(mesh, cell) else {
                block.cells.push((NONE, [0; 3]));
                sides.push(Sides::default());
                continue;
            };
            sides.push(c.sides);
            let key = c.n.map(|n| n.map(|x| (x * DIGITS).round() as i64));
            let frame = number(&mut frames, &mut block.frames, key, c.n);
            let of = c.inverse.map(|i| {
                let key = i.map(|x| x.to_bits() >> 22); // 30 bits after the point
                number(&mut steps, &mut block.steps, key, i)
            });
            block.cells.push((frame, of));
        }
        let rings = Rings::new(mesh.len(), |cell| block.ring(mesh, cell, &sides));
        block.rings = Arc::new(rings);
        block
    }
    pub fn holds(&self, cell: usize) -> bool {
        self.rings.hold(cell)
    }
    /// Where x lies between the centre of its cell and the next ones.
    #[inline(always)]
    pub fn fraction(&self, mesh: &Mesh, cell: usize, x: V) -> Fraction {
        let (frame, steps) = &self.cells[cell];
        let (n, centre, mut t) = (&self.frames[*frame as usize], &mesh.centre[cell], [0.0; 3]);
        for a in 0..3 {
            let d =
                (x[0] - centre[0]) * n[a][0] + (x[1] - centre[1]) * n[a][1] + (x[2] - centre[2]) * n[a][2];
            let inverse = &self.steps[steps[a] as usize];
            t[a] = (d * if d > 0.0 { inverse[1] } else { inverse[0] }).clamp(-1.0, 1.0);
        }
        t
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

    /// The 27 cells around one (`NONE`: behind a wall).
    fn ring(&self, mesh: &Mesh, cell: usize, known: &[Sides]) -> Option<[u32; 27]> {
        let (frame, own) = self.cells[cell];
        if frame == NONE {
            return None;
        }
        let (n, close) = (&self.frames[frame as usize], 1e-7 * mesh.volume[cell].cbrt());
        let next = |at: usize, a: usize, step: i32| {
            if self.cells[at].0 == frame {
                return Some(&mesh.sides(at)[usize::from(known[at][a][usize::from(step > 0)])]);
            }
            towards(mesh, at, scale(n[a], f64::from(step)))
        };
        let mut ring = [NONE; 27];
        ring[OWN] = cell as u32;
        for (k, slot) in ring.iter_mut().enumerate() {
            let steps = [k % 3, k / 3 % 3, k / 9].map(|s| s as i32 - 1);
            let some: Vec<usize> = (0..3).filter(|a| steps[*a] != 0).collect();
            let orders: &[&[usize]] = match some[..] {
                [] => continue,
                [_] => &[&[0]],
                [_, _] => &[&[0, 1], &[1, 0]],
                _ => &[&[0, 1, 2], &[1, 2, 0], &[2, 0, 1], &[0, 2, 1], &[1, 0, 2], &[2, 1, 0]],
            };
            let mut found: Option<Option<u32>> = None;
            for order in orders {
                // the centre must lie where the steps say: the product of one-dimensional weights keeps the first moment
                let (mut at, mut sum) = (Some(cell as u32), [0.0; 3]);
                for a in order.iter().map(|o| some[*o]) {
                    let Some(cell) = at else { break };
                    let side = next(cell as usize, a, steps[a])?;
                    at = (side.across != NONE).then_some(side.across);
                    if at.is_some() {
                        let d = mesh.way(cell as usize, side);
                        (0..3).for_each(|b| sum[b] += d[b]);
                    }
                }
                if found.is_some_and(|f| f != at) {
                    return None;
                }
                found = Some(at);
                for a in 0..3 {
                    let inverse = self.steps[own[a] as usize][usize::from(steps[a] > 0)];
                    let want = if steps[a] == 0 { 0.0 } else { f64::from(steps[a]) / inverse };
                    if at.is_some() && (dot(sum, n[a]) - want).abs() > close {
                        return None;
                    }
                }
            }
            *slot = found.flatten().unwrap_or(NONE);
        }
        Some(ring)
    }
}

fn candidate(mesh: &Mesh, cell: usize) -> Option<Candidate> {
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
    let (mut inverse, mut which) = ([[0.0; 2]; 3], Sides::default());
    for a in 0..3 {
        for high in 0..2 {
            let way = scale(n[a], if high == 1 { 1.0 } else { -1.0 });
            let k = place(mesh, cell, way)?;
            which[a][high] = k as u8;
            let side = &sides[k];
            if side.across != NONE {
                let d = mesh.way(cell, side);
                let size = length(d);
                if dot(d, way) < size * (1.0 - 1e-12) {
                    return None;
                }
                inverse[a][high] = 1.0 / size;
            }
        }
    }
    Some(Candidate { n, inverse, sides: which })
}
