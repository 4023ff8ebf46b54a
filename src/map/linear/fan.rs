// SPDX-License-Identifier: MIT OR Apache-2.0
//! Cells of any shape cut into tetrahedra (centre, face point, two corners), and the weights of their points.

use super::super::Weights;
use super::super::cells::{Cells, Facet};
use crate::mesh::geometry::{V, add, cross, dot, length, scale, solve, sub};
use crate::mesh::{Mesh, NONE};

/// Symmetric 3×3 (m2).
pub(super) type Tensor = [[f64; 3]; 3];

#[derive(Default)]
pub(super) struct Fan {
    cells: Cells,
    /// by facet: face point, share of the cell across, second moment of the two about the point along their line
    face: Vec<(V, f64, Tensor)>,
    first_face: Vec<u32>,
    /// by point: cells and weights
    start: Vec<u32>,
    cell: Vec<u32>,
    weight: Vec<f64>,
    /// by point: second moment of its cells about it, m2
    spread: Vec<Tensor>,
}

fn outer(a: V) -> Tensor {
    a.map(|x| a.map(|y| x * y))
}
fn plus(a: &mut Tensor, b: &Tensor, s: f64) {
    (0..3).for_each(|i| (0..3).for_each(|j| a[i][j] += s * b[i][j]));
}
fn volume(t: [V; 4]) -> f64 {
    dot(sub(t[1], t[0]), cross(sub(t[2], t[0]), sub(t[3], t[0]))) / 6.0
}

impl Fan {
    pub fn new(mesh: &Mesh, cells: Cells) -> Self {
        let mut fan = Self { cells, start: vec![0], ..Self::default() };
        for c in 0..mesh.len() as u32 {
            fan.first_face.push(fan.face.len() as u32);
            for f in fan.cells.facets(c) {
                fan.face.push(face_point(mesh, &fan.cells, c, f));
            }
        }
        // the lowest cell of each point
        let mut home = vec![NONE; fan.cells.points()];
        for c in (0..mesh.len() as u32).rev() {
            for f in fan.cells.facets(c) {
                fan.cells.corners(f).iter().for_each(|p| home[*p as usize] = c);
            }
        }
        for (p, home) in home.iter().enumerate() {
            let mut spread = [[0.0; 3]; 3];
            if *home != NONE {
                let around = around(mesh, &fan.cells, p as u32, *home);
                let weights = entropy(&around.iter().map(|a| a.1).collect::<Vec<_>>());
                let from = fan.cell.len();
                for ((cell, d), w) in around.iter().zip(&weights) {
                    plus(&mut spread, &outer(*d), *w);
                    // mirrored images follow each other or come apart: one entry per cell
                    match fan.cell[from..].iter().position(|c| c == cell) {
                        Some(k) => fan.weight[from + k] += w,
                        None => {
                            fan.cell.push(*cell);
                            fan.weight.push(*w);
                        }
                    }
                }
            }
            fan.spread.push(spread);
            fan.start.push(fan.cell.len() as u32);
        }
        fan
    }

    /// Barycentric coordinates of x in the tetrahedron (centre, face point, corners).
    fn barycentric(t: [V; 4], x: V) -> [f64; 4] {
        let v = volume(t);
        let at = |i: usize| {
            let mut u = t;
            u[i] = x;
            volume(u) / v
        };
        let l = [at(1), at(2), at(3)];
        [1.0 - l[0] - l[1] - l[2], l[0], l[1], l[2]]
    }

    pub fn weights(&self, mesh: &Mesh, cell: u32, x: V, out: &mut Weights) {
        let facets = self.cells.facets(cell);
        let centre = mesh.centre[cell as usize];
        let first = self.first_face[cell as usize] as usize;
        let d = sub(x, centre);
        // the facet the ray from the centre through x meets first
        let (mut best, mut exit) = (f64::NEG_INFINITY, 0);
        for (i, f) in facets.iter().enumerate() {
            let n = [f.plane[0], f.plane[1], f.plane[2]];
            let reach = f.plane[3] - dot(n, centre);
            let t = dot(n, d) / reach;
            if reach > 0.0 && t > best {
                (best, exit) = (t, i);
            }
        }
        let mut found: (f64, usize, u32, u32, [f64; 4]) = (f64::NEG_INFINITY, 0, 0, 0, [0.0; 4]);
        let mut look = |i: usize| {
            let corners = self.cells.corners(&facets[i]);
            let mut a = corners[corners.len() - 1];
            for b in corners {
                let t = [centre, self.face[first + i].0, self.cells.point(a), self.cells.point(*b)];
                let l = Self::barycentric(t, x);
                let least = l.iter().copied().fold(f64::INFINITY, f64::min);
                if least > found.0 {
                    found = (least, i, a, *b, l);
                }
                a = *b;
            }
            found.0
        };
        if look(exit) < -1e-12 {
            (0..facets.len()).for_each(|i| {
                look(i);
            });
        }
        let (_, i, a, b, l) = found;
        let l = l.map(|x| x.max(0.0));
        let sum: f64 = l.iter().sum();
        let l = l.map(|x| x / sum);
        let across = self.face[first + i].1;
        let mut put = |cell: u32, w: f64| {
            if w > 0.0 {
                out.push(cell, w);
            }
        };
        put(cell, l[0] + l[1] * (1.0 - across));
        if facets[i].across != NONE {
            put(facets[i].across, l[1] * across);
        }
        for (p, l) in [(a, l[2]), (b, l[3])] {
            if l > 0.0 {
                for k in self.start[p as usize] as usize..self.start[p as usize + 1] as usize {
                    put(self.cell[k], l * self.weight[k]);
                }
            }
        }
    }

    /// Mean over the cell of the deposit's second moment about the particle (mirrored cells at their own places) minus
    /// the cell's own second moment. In a tetrahedron with points p and weights of spread C_p:
    /// ¼ Σ (C_p + p pᵀ) − 2 ⟨x xᵀ⟩, ⟨x xᵀ⟩ = (Σ p pᵀ + Σp Σpᵀ)/20, all from the cell's centre.
    pub fn variance(&self, mesh: &Mesh, cell: u32) -> Tensor {
        let mut sum = [[0.0; 3]; 3];
        let mut all = 0.0;
        let centre = mesh.centre[cell as usize];
        let first = self.first_face[cell as usize] as usize;
        for (i, f) in self.cells.facets(cell).iter().enumerate() {
            let (point, _, along) = &self.face[first + i];
            let corners = self.cells.corners(f);
            for k in 0..corners.len() {
                let (a, b) = (corners[k], corners[(k + 1) % corners.len()]);
                let t = [centre, *point, self.cells.point(a), self.cells.point(b)];
                let v = volume(t).abs();
                all += v;
                let p = t.map(|x| sub(x, centre));
                let mut e = [[0.0; 3]; 3];
                plus(&mut e, along, 0.25);
                plus(&mut e, &self.spread[a as usize], 0.25);
                plus(&mut e, &self.spread[b as usize], 0.25);
                p.iter().for_each(|p| plus(&mut e, &outer(*p), 0.25 - 0.1));
                plus(&mut e, &outer(p.iter().fold([0.0; 3], |s, p| add(s, *p))), -0.1);
                plus(&mut sum, &e, v);
            }
        }
        sum.map(|row| row.map(|x| x / all))
    }
}

/// The point of a facet, the share of the cell across there, and the spread along the line between the centres.
fn face_point(mesh: &Mesh, cells: &Cells, cell: u32, f: &Facet) -> (V, f64, Tensor) {
    let corners: Vec<V> = cells.corners(f).iter().map(|p| cells.point(*p)).collect();
    let middle = scale(corners.iter().fold([0.0; 3], |s, p| add(s, *p)), 1.0 / corners.len() as f64);
    let n = [f.plane[0], f.plane[1], f.plane[2]];
    let own = mesh.centre[cell as usize];
    let reach = f.plane[3] - dot(n, own);
    let (line, share) = if f.across == NONE {
        (scale(n, 2.0 * reach), 0.5)
    } else {
        let d = mesh.way(cell as usize, &mesh.sides[f.side as usize]);
        (d, (reach / dot(n, d)).clamp(0.0, 1.0))
    };
    let target = add(own, scale(line, share));
    // as far from the middle towards the target as stays inside by 2 %
    let mut far = 1.0f64;
    for k in 0..corners.len() {
        let (p, q) = (corners[k], corners[(k + 1) % corners.len()]);
        let inward = cross(n, sub(q, p));
        let (a, b) = (dot(inward, sub(middle, p)), dot(inward, sub(target, p)));
        if b < 0.02 * a {
            far = far.min(0.98 * a / (a - b));
        }
    }
    let point = add(middle, scale(sub(target, middle), far));
    // off the line by less than the face's size: the spread about the point stays that of the two centres
    let (mut spread, to) = ([[0.0; 3]; 3], sub(own, point));
    plus(&mut spread, &outer(to), 1.0 - share);
    plus(&mut spread, &outer(add(to, line)), share);
    (point, if f.across == NONE { 0.0 } else { share }, spread)
}

/// Cells around a point, cyclic images and images mirrored at walls through the point too: (cell, centre − point).
fn around(mesh: &Mesh, cells: &Cells, point: u32, home: u32) -> Vec<(u32, V)> {
    let tolerance = 1e-6 * mesh.volume[home as usize].cbrt();
    let mut seen: Vec<(u32, V)> = vec![(home, cells.point(point))];
    let mut walls: Vec<V> = Vec::new();
    let mut i = 0;
    while i < seen.len() {
        let (cell, x) = seen[i];
        for f in cells.facets(cell) {
            let here = |p: &u32| (0..3).all(|a| (cells.point(*p)[a] - x[a]).abs() < tolerance);
            if !cells.corners(f).iter().any(here) {
                continue;
            }
            if f.across == NONE {
                let n = [f.plane[0], f.plane[1], f.plane[2]];
                if !walls.iter().any(|w| dot(*w, n) > 1.0 - 1e-6) {
                    walls.push(n);
                }
                continue;
            }
            let y = add(x, mesh.shift(&mesh.sides[f.side as usize]));
            let same = |s: &(u32, V)| s.0 == f.across && length(sub(s.1, y)) < 10.0 * tolerance;
            if !seen.iter().any(same) {
                seen.push((f.across, y));
            }
        }
        i += 1;
    }
    let mut list: Vec<(u32, V)> = seen.iter().map(|(c, x)| (*c, sub(mesh.centre[*c as usize], *x))).collect();
    // three mirrors at most: an edge or corner of the box; curved walls give many planes, their first three count
    walls.sort_by(|p, q| p.partial_cmp(q).unwrap_or(std::cmp::Ordering::Equal));
    for n in walls.iter().take(3) {
        let mirrored: Vec<_> =
            list.iter().map(|(c, d)| (*c, sub(*d, scale(*n, 2.0 * dot(*n, *d))))).collect();
        list.extend(mirrored);
    }
    list.sort_by(|p, q| p.partial_cmp(q).unwrap_or(std::cmp::Ordering::Equal));
    list
}

/// Positive weights of points `d` with Σ w = 1, Σ w d = 0 nearly as even as near ones may be: w ∝ exp(−β d²/s² + λ·d)
/// (local maximum entropy), λ by Newton's method on the convex log Σ.
fn entropy(d: &[V]) -> Vec<f64> {
    /// Larger: nearer cells count more.
    const BETA: f64 = 4.0;
    let s2 = d.iter().map(|x| dot(*x, *x)).sum::<f64>() / d.len() as f64;
    let s = s2.sqrt();
    let at = |lambda: V| -> (f64, Vec<f64>) {
        let e: Vec<f64> = d.iter().map(|x| dot(lambda, *x) / s - BETA * dot(*x, *x) / s2).collect();
        let top = e.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let w: Vec<f64> = e.iter().map(|e| (e - top).exp()).collect();
        let sum: f64 = w.iter().sum();
        (top + sum.ln(), w.iter().map(|w| w / sum).collect())
    };
    let mut lambda = [0.0; 3];
    let (mut value, mut w) = at(lambda);
    for _ in 0..50 {
        let g = d.iter().zip(&w).fold([0.0; 3], |m, (x, w)| add(m, scale(*x, w / s)));
        if length(g) < 1e-14 {
            break;
        }
        let mut h = [[0.0; 3]; 3];
        d.iter().zip(&w).for_each(|(x, w)| plus(&mut h, &outer(scale(*x, 1.0 / s)), *w));
        plus(&mut h, &outer(g), -1.0);
        (0..3).for_each(|a| h[a][a] += 1e-10);
        let step = solve(&h, g);
        let mut t = 1.0;
        loop {
            let next = sub(lambda, scale(step, t));
            let (v, u) = at(next);
            if v <= value || t < 1e-6 {
                (lambda, value, w) = (next, v, u);
                break;
            }
            t *= 0.5;
        }
        // a corner outside of the centres around it (a bad cell): weights stay positive, the moment is not reached
        if length(lambda) > 200.0 {
            break;
        }
    }
    w
}
