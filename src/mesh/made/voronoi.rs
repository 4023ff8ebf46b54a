// SPDX-License-Identifier: MIT OR Apache-2.0
//! Polyhedral cells: the Voronoi cells of a jiggled body-centred lattice, cut by the walls of the box. Every face is
//! plane, every cell convex, with about 14 faces. Cells cross cyclic sides, so cyclic patches are not plane.

use super::super::geometry::{V, add, dot, scale, sub};
use super::{Across, Made, Soup, hash};
use std::collections::HashMap;

/// A generator of a face: seed number and image of the box, or `WALL` + wall number.
type Gen = (u32, [i8; 3]);
const WALL: u32 = u32::MAX - 16;

struct Convex {
    /// position, and the three generators whose faces meet there
    vertices: Vec<(V, [Gen; 3])>,
    faces: Vec<(Gen, Vec<usize>)>,
}

impl Convex {
    /// A box; face order x-low, x-high, y-low …
    fn new(low: V, high: V) -> Self {
        let wall = |axis: usize, high: usize| (WALL + (2 * axis + high) as u32, [0i8; 3]);
        let vertices = (0..8usize).map(|v| {
            let bit = [0, 1, 2].map(|a| (v >> a) & 1);
            let x = [0, 1, 2].map(|a| if bit[a] == 1 { high[a] } else { low[a] });
            (x, [0, 1, 2].map(|a| wall(a, bit[a])))
        });
        let mut faces = Vec::new();
        for axis in 0..3 {
            for side in 0..2 {
                let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
                let at = |p: usize, q: usize| (side << axis) + (p << u) + (q << v);
                let mut face = vec![at(0, 0), at(1, 0), at(1, 1), at(0, 1)];
                if side == 0 {
                    face.reverse();
                }
                faces.push((wall(axis, side), face));
            }
        }
        Self { vertices: vertices.collect(), faces }
    }
    /// Keeps the side n · x ≤ d.
    fn clip(&mut self, n: V, d: f64, by: Gen) {
        let s: Vec<f64> = self.vertices.iter().map(|v| dot(n, v.0) - d).collect();
        let used = |f: &(Gen, Vec<usize>)| f.1.iter().any(|v| s[*v] > 0.0);
        if !self.faces.iter().any(used) {
            return;
        }
        let mut cuts: HashMap<(usize, usize), usize> = HashMap::new();
        let mut next: HashMap<usize, usize> = HashMap::new();
        let mut faces = Vec::new();
        for (of, face) in std::mem::take(&mut self.faces) {
            let (mut kept, mut exit, mut enter) = (Vec::new(), None, None);
            for i in 0..face.len() {
                let (a, b) = (face[i], face[(i + 1) % face.len()]);
                if s[a] <= 0.0 {
                    kept.push(a);
                }
                if (s[a] <= 0.0) == (s[b] <= 0.0) {
                    continue;
                }
                let vertices = &mut self.vertices;
                let cut = *cuts.entry((a.min(b), a.max(b))).or_insert_with(|| {
                    let (low, high) = (a.min(b), a.max(b));
                    let t = s[low] / (s[low] - s[high]);
                    let (p, q) = (vertices[low], vertices[high]);
                    let mut both = p.1.iter().filter(|g| q.1.contains(g));
                    let label = [*both.next().unwrap_or(&by), *both.next().unwrap_or(&by), by];
                    vertices.push((add(p.0, scale(sub(q.0, p.0), t)), label));
                    vertices.len() - 1
                });
                kept.push(cut);
                if s[a] <= 0.0 { exit = Some(cut) } else { enter = Some(cut) }
            }
            if let (Some(exit), Some(enter)) = (exit, enter) {
                next.insert(enter, exit);
            }
            if kept.len() >= 3 {
                faces.push((of, kept));
            }
        }
        if let Some(first) = next.keys().min().copied() {
            let mut cap = vec![first];
            while let Some(v) = next.get(cap.last().unwrap_or(&first)).filter(|v| **v != first) {
                cap.push(*v);
                if cap.len() > next.len() {
                    break;
                }
            }
            faces.push((by, cap));
        }
        self.faces = faces;
    }
    fn radius2(&self, x: V) -> f64 {
        let used = self.faces.iter().flat_map(|f| &f.1);
        used.map(|v| sub(self.vertices[*v].0, x)).map(|d| dot(d, d)).fold(0.0, f64::max)
    }
}

/// Seed `c` of the lattice of 2 n points (x index doubled: even and odd belong to the two sublattices).
struct Lattice<'a> {
    made: &'a Made,
    a: V,
    first: V,
}

impl Lattice<'_> {
    /// Seed of cube `c` (may lie outside of the box along cyclic axes) and sublattice; None beyond a wall.
    fn seed(&self, c: [i64; 3], sub: usize) -> Option<(Gen, V)> {
        let (mut wrapped, mut offset) = ([0usize; 3], [0i8; 3]);
        for a in 0..3 {
            let n = self.made.n[a] as i64;
            wrapped[a] = c[a].rem_euclid(n) as usize;
            offset[a] = c[a].div_euclid(n) as i8;
            if offset[a] != 0 && !self.made.cyclic[a] {
                return None;
            }
        }
        let n = self.made.n;
        let id = 2 * ((wrapped[2] * n[1] + wrapped[1]) * n[0] + wrapped[0]) + sub;
        let x = [0, 1, 2].map(|a| {
            let jiggle = self.made.jiggle * hash(wrapped, a + 3 * sub);
            let inside = wrapped[a] as f64 + self.first[a] + 0.5 * sub as f64 + jiggle;
            inside * self.a[a] + f64::from(offset[a]) * self.made.size[a]
        });
        Some(((id as u32, offset), x))
    }
}

/// # Panics
/// With fewer than three lattice cells along a cyclic axis: a cell would meet its own image.
pub(super) fn poly(m: &Made) -> Soup {
    assert!(
        (0..3).all(|a| !m.cyclic[a] || m.n[a] >= 3),
        "polyhedra need three lattice cells along cyclic axes"
    );
    // walls 0.3 of a lattice cell from the first and last layer of seeds: between the heights of the vertices
    let a = [0, 1, 2].map(|a| m.size[a] / (m.n[a] as f64 + if m.cyclic[a] { 0.0 } else { 0.1 }));
    let first = m.cyclic.map(|c| if c { 0.25 } else { 0.3 });
    let lattice = Lattice { made: m, a, first };
    let mut near: Vec<([i64; 3], i64)> = (-2..=2)
        .flat_map(|k| {
            (-2..=2).flat_map(move |j| (-2..=2).flat_map(move |i| [([i, j, k], 0), ([i, j, k], 1)]))
        })
        .collect();
    let distance = |d: &([i64; 3], i64)| {
        (0..3).map(|x| ((d.0[x] as f64 + 0.5 * d.1 as f64) * a[x]).powi(2)).sum::<f64>()
    };
    near.sort_by(|p, q| distance(p).total_cmp(&distance(q)));
    let mut soup = Soup { size: m.size, ..Soup::default() };
    let mut base: HashMap<[Gen; 4], V> = HashMap::new();
    let mut number: HashMap<([Gen; 4], [i8; 3]), u32> = HashMap::new();
    for id in 0..2 * m.n.iter().product::<usize>() {
        let (cube, odd) = (id / 2, id % 2);
        let c = [cube % m.n[0], (cube / m.n[0]) % m.n[1], cube / (m.n[0] * m.n[1])].map(|i| i as i64);
        let Some((own, x)) = lattice.seed(c, odd) else { continue };
        let far = |high: bool| {
            [0, 1, 2].map(|i| match (m.cyclic[i], high) {
                (true, h) => x[i] + if h { 2.0 * a[i] } else { -2.0 * a[i] },
                (false, h) => {
                    if h {
                        m.size[i]
                    } else {
                        0.0
                    }
                }
            })
        };
        let mut cell = Convex::new(far(false), far(true));
        let mut reach = 4.0 * cell.radius2(x);
        for (d, other) in &near {
            // sublattice of the neighbour, relative: 1 adds half a cube, which may carry over
            let half = odd as i64 + other;
            let to = [0, 1, 2].map(|i| c[i] + d[i] + half / 2);
            let Some((by, y)) = lattice.seed(to, (half % 2) as usize) else { continue };
            let n = sub(y, x);
            let d2 = dot(n, n);
            if by != own && d2 < reach {
                cell.clip(n, dot(n, scale(add(x, y), 0.5)), by);
                reach = 4.0 * cell.radius2(x);
            }
        }
        soup.near_centre.push(x);
        let keys: Vec<([Gen; 4], [i8; 3], V)> = cell
            .vertices
            .iter()
            .map(|(x, g)| {
                let mut key = [own, g[0], g[1], g[2]];
                key.sort_unstable();
                let o = key[0].1;
                for k in key.iter_mut().filter(|k| k.0 < WALL) {
                    (0..3).for_each(|a| k.1[a] -= o[a]);
                }
                (key, o, [0, 1, 2].map(|a| x[a] - f64::from(o[a]) * m.size[a]))
            })
            .collect();
        let size = m.size;
        let mut point = |soup: &mut Soup, key: ([Gen; 4], [i8; 3]), x: V| {
            let x = *base.entry(key.0).or_insert(x);
            *number.entry(key).or_insert_with(|| {
                soup.points.push([0, 1, 2].map(|a| x[a] + f64::from(key.1[a]) * size[a]));
                soup.points.len() as u32 - 1
            })
        };
        for ((by, offset), face) in &cell.faces {
            if *by >= WALL {
                let list: Vec<u32> =
                    face.iter().map(|v| point(&mut soup, (keys[*v].0, keys[*v].1), keys[*v].2)).collect();
                soup.put(id, Across::Wall((by - WALL) as u8), list);
                continue;
            }
            // each pair is put once, from one side
            if *offset < [0; 3] || (*offset == [0; 3] && (*by as usize) < id) {
                continue;
            }
            let list: Vec<u32> =
                face.iter().map(|v| point(&mut soup, (keys[*v].0, keys[*v].1), keys[*v].2)).collect();
            if *offset == [0; 3] {
                soup.put(id, Across::Cell(*by), list);
                continue;
            }
            soup.put(id, Across::Cyclic(*by, *offset), list);
            let back = |o: [i8; 3]| [0, 1, 2].map(|a| o[a] - offset[a]);
            let list: Vec<u32> = face
                .iter()
                .rev()
                .map(|v| point(&mut soup, (keys[*v].0, back(keys[*v].1)), keys[*v].2))
                .collect();
            soup.put(*by as usize, Across::Cyclic(id as u32, offset.map(|x| -x)), list);
        }
    }
    soup
}
