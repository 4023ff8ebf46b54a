// SPDX-License-Identifier: MIT OR Apache-2.0
//! Maximum-entropy deposit: the weights nearest to a given bell that reproduce the particle's position, on any mesh.
//!
//! m_k ∝ V_k (exp(−r_k²/(c h)²) − cut) exp(λ·(x_k − x)) over the cells around, λ such that Σ m_k (x_k − x) = 0: Newton's
//! method on the convex log Σ (Arroyo & Ortiz 2006, local maximum entropy; the cells' volumes as prior measure are own).
//! h is the local cell size, a mean of the cube roots of the volumes around that is continuous in x; where the bell
//! falls below `CUT` it ends without a jump. c = 0.8: narrower is noisier, wider than a bandwidth of 0.7 h allows. At walls cells
//! are mirrored and the mirrored weight goes to the real cell; cyclics are passed (`images`). Positive, conservative,
//! continuous, exact first moment (mirrored cells at their own places); gather is the adjoint and exact for linear fields
//! away from walls.
//!
//! The deposit has a variance of its own, about c² h²/2 per axis, nearly the same for all particles and without direction.
//! What it is beyond a cell's is taken out of T (`taken_out`): on tetrahedra, for which this deposit is, all of it is best or within 15 %
//! of it up to b/h = 2; half would be better at b/h = 4 there and from 2 on on hexahedra and polyhedra (docs/bench.md).
//! If Newton's method does not reach 1e-9 h (x outside of all centres in the bell, as between cells more than some four
//! times as long as wide), the bell is widened by half, and again; weights are then not continuous. Beyond lengths of some
//! twelve widths the last weights stand: their sum and sign are right, their first moment is not.
//! Cells are looked for as far as the bells of the host and its neighbours reach; a cell much larger than these, behind them, may be
//! missed, and weights jump at the host's border.
//! Reads positions (m), cells; writes weights. Does not know radii.

use super::cells::Cells;
use super::images::Around;
use super::{Mapping, Options, Weights};
use crate::mesh::geometry::{V, add, cross, dot, length, scale, sub};
use crate::mesh::{Mesh, NONE};
use crate::threads;

/// Width of the bell in local cell sizes.
const WIDTH: f64 = 0.8;
/// Where the bell ends, of its top.
const CUT: f64 = 1e-4;
/// (r / (c h))² there: −ln CUT.
const END: f64 = 9.210_340_371_976_184;
/// Rest of the first moment, in h.
const EXACT: f64 = 1e-11;
/// Rest of the first moment that is an error, in h.
const MISSED: f64 = 1e-9;
/// Points per cell for its mean variance.
const POINTS: usize = 4;
/// Cells that one thread takes at a time.
const PIECE: usize = 4096;

/// The mapping.
#[derive(Default)]
pub struct MaxEntropy {
    /// cube root of the volume, m
    size: Vec<f64>,
    /// furthest corner from the centre, m
    extent: Vec<f64>,
}

/// What one thread keeps: cells around the last host, and the particle's.
#[derive(Default)]
struct Scratch {
    /// host of `around`; none at first
    host: Option<(u32, f64)>,
    around: Around,
    cells: Vec<u32>,
    way: Vec<V>,
    prior: Vec<f64>,
    weight: Vec<f64>,
}

impl Scratch {
    /// log Σ of prior exp(λ·d / h), the weights at λ left in `weight`.
    fn at(&mut self, lambda: V, h: f64) -> f64 {
        let l = scale(lambda, 1.0 / h);
        let e = |d: &V| dot(l, *d);
        // the largest exponent out: no overflow
        let top = self.way.iter().map(e).fold(f64::NEG_INFINITY, f64::max);
        let mut sum = 0.0;
        self.weight.clear();
        for (d, p) in self.way.iter().zip(&self.prior) {
            let w = p * (e(d) - top).exp();
            sum += w;
            self.weight.push(w);
        }
        self.weight.iter_mut().for_each(|w| *w /= sum);
        top + sum.ln()
    }
    /// Weights with Σ m d = 0; what is left of it, in h.
    fn solve(&mut self, h: f64) -> f64 {
        let mut lambda = [0.0; 3];
        let mut value = self.at(lambda, h);
        let mut left = f64::INFINITY;
        for _ in 0..60 {
            let (mut g, mut m) = ([0.0; 3], [0.0; 6]);
            for (d, w) in self.way.iter().zip(&self.weight) {
                let (d, u) = (scale(*d, 1.0 / h), scale(*d, w / h));
                g = add(g, u);
                let products = [u[0] * d[0], u[1] * d[1], u[2] * d[2], u[0] * d[1], u[1] * d[2], u[2] * d[0]];
                (0..6).for_each(|k| m[k] += products[k]);
            }
            left = length(g);
            if left < EXACT || length(lambda) > 300.0 {
                break;
            }
            // the ridge keeps it solvable where all cells lie in a plane
            let s = [
                [m[0] - g[0] * g[0] + 1e-12, m[3] - g[0] * g[1], m[5] - g[0] * g[2]],
                [m[3] - g[0] * g[1], m[1] - g[1] * g[1] + 1e-12, m[4] - g[1] * g[2]],
                [m[5] - g[0] * g[2], m[4] - g[1] * g[2], m[2] - g[2] * g[2] + 1e-12],
            ];
            let inverse = [cross(s[1], s[2]), cross(s[2], s[0]), cross(s[0], s[1])];
            let det = dot(s[0], inverse[0]);
            let step: V = [0, 1, 2].map(|a| (0..3).map(|b| inverse[b][a] * g[b]).sum::<f64>() / det);
            let mut t = 1.0;
            loop {
                let next = sub(lambda, scale(step, t));
                let v = self.at(next, h);
                if v <= value + 1e-14 || t < 1e-6 {
                    (lambda, value) = (next, v);
                    break;
                }
                t *= 0.5;
            }
        }
        left
    }
}

impl MaxEntropy {
    /// Cells, ways and weights of one particle, left in the scratch memory; (local size in m, first moment missed in it).
    fn one(&self, mesh: &Mesh, x: V, host: u32, s: &mut Scratch) -> (f64, f64) {
        let mut width = WIDTH;
        loop {
            let sides = mesh.sides(host as usize).iter().filter(|f| f.across != NONE);
            let largest =
                sides.map(|f| self.size[f.across as usize]).fold(self.size[host as usize], f64::max);
            let reach = self.extent[host as usize] + width * END.sqrt() * largest;
            if s.host != Some((host, width)) {
                s.around.find(mesh, &self.extent, host, reach);
                s.host = Some((host, width));
            }
            // local size: by a bell of each cell's own size, (1 − q/END)⁸ instead of exp(−q)
            let (mut sum, mut all) = (0.0, 0.0);
            for i in &s.around.list {
                let (d, h) = (sub(i.at, x), self.size[i.cell as usize]);
                let rest = 1.0 - dot(d, d) / (END * width * width * h * h);
                if rest > 0.0 {
                    let bell = rest.powi(8);
                    sum += bell * h;
                    all += bell;
                }
            }
            let h = if all > 0.0 { sum / all } else { self.size[host as usize] };
            s.cells.clear();
            s.way.clear();
            s.prior.clear();
            let scale = -1.0 / (width * width * h * h);
            for i in &s.around.list {
                let d = sub(i.at, x);
                let q = scale * dot(d, d);
                if q > -END {
                    s.cells.push(i.cell);
                    s.way.push(d);
                    s.prior.push(mesh.volume[i.cell as usize] * (q.exp() - CUT));
                }
            }
            let missed = if s.cells.is_empty() { f64::INFINITY } else { s.solve(h) };
            if missed < MISSED || width > 2.0 * WIDTH {
                return (h, missed);
            }
            width *= 1.5;
        }
    }

    /// Mean variance of the deposits of particles in a cell less the cell's own, per axis, m2.
    fn variance(&self, mesh: &Mesh, cells: &Cells, cell: u32, s: &mut Scratch) -> f64 {
        let centre = mesh.centre[cell as usize];
        let list: Vec<[V; 4]> = cells.tetrahedra(mesh, cell).map(|t| t.map(|p| sub(p, centre))).collect();
        let volume = |t: &[V; 4]| dot(sub(t[1], t[0]), cross(sub(t[2], t[0]), sub(t[3], t[0]))).abs() / 6.0;
        let (mut own, mut all) = (0.0, 0.0);
        for t in &list {
            // ∫ |y|² over a tetrahedron: V (Σ p² + (Σ p)²) / 20
            let sum = t.iter().fold([0.0; 3], |s, p| add(s, *p));
            own += volume(t) * (t.iter().map(|p| dot(*p, *p)).sum::<f64>() + dot(sum, sum)) / 20.0;
            all += volume(t);
        }
        let (mut mean, mut weight) = (0.0, 0.0);
        let step = list.len().div_ceil(POINTS).max(1);
        for t in list.iter().step_by(step) {
            let x = add(centre, scale(t.iter().fold([0.0; 3], |s, p| add(s, *p)), 0.25));
            self.one(mesh, x, cell, s);
            let of = s.way.iter().zip(&s.weight).map(|(d, w)| w * dot(*d, *d)).sum::<f64>();
            mean += volume(t) * of;
            weight += volume(t);
        }
        if weight > 0.0 { (mean / weight - own / all) / 3.0 } else { 0.0 }
    }
}

impl Mapping for MaxEntropy {
    fn name(&self) -> &'static str {
        "max-entropy"
    }
    fn source(&self) -> &'static str {
        "local maximum entropy (Arroyo & Ortiz 2006) with the cells' volumes as prior"
    }
    fn properties(&self) -> &'static str {
        "conservative, positive, continuous, first moment exact on any mesh; own variance nearly uniform, taken out of the \
         smoother's; some 57 cells; 10 to 35 us per particle"
    }
    fn prepare(&mut self, mesh: &Mesh, _: &Options) {
        self.size = mesh.volume.iter().map(|v| v.cbrt()).collect();
        self.extent = mesh.extents();
    }
    fn taken_out(&self) -> f64 {
        1.0
    }
    fn cell_variance(&self, mesh: &Mesh) -> Vec<f64> {
        let cells = Cells::new(mesh);
        let parts = threads::map(threads::pieces(mesh.len(), PIECE), |range| {
            let mut s = Scratch::default();
            range.map(|c| self.variance(mesh, &cells, c as u32, &mut s)).collect::<Vec<f64>>()
        });
        parts.concat()
    }
    fn weights(&self, mesh: &Mesh, position: &[[f64; 3]], _: &[f64], host: &[u32], out: &mut Weights) {
        assert_eq!(self.size.len(), mesh.len(), "max-entropy: prepare() it for this mesh first");
        out.fill(host, |s: &mut Scratch, i, host, out| {
            self.one(mesh, position[i], host, s);
            let mut k = 0;
            while k < s.cells.len() {
                // images of one cell follow each other
                let (cell, mut w) = (s.cells[k], 0.0);
                while k < s.cells.len() && s.cells[k] == cell {
                    w += s.weight[k];
                    k += 1;
                }
                if w > 0.0 {
                    out.push(cell, w);
                }
            }
            out.close();
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::locate::Locator;
    use crate::mesh::made::Made;

    /// Mirrored cells enclose every particle, at walls and in corners, in boxes of one cell too.
    #[test]
    fn the_first_moment_is_reached_everywhere() {
        let size = [0.06, 0.04, 0.05];
        let x = [true, false, false];
        for made in [
            Made::hex([1; 3], size),
            Made::hex([6, 1, 5], size).cyclic(x),
            Made::hex([6, 4, 5], size).jiggled(0.3),
            Made::graded([6, 4, 5], size),
            Made::tet([1; 3], size),
            Made::tet([3, 2, 3], size),
            Made::tet([4, 2, 4], size).mirrored().cyclic([true, false, true]),
            Made::poly([4, 3, 3], size).cyclic(x),
        ] {
            let mesh = made.mesh();
            let mut m = MaxEntropy::default();
            m.prepare(&mesh, &Options::default());
            let mut s = Scratch::default();
            let mut seed = 9;
            let mut random = || crate::bench::scene::random(&mut seed);
            for i in 0..500 {
                let near = if i % 2 == 0 { 1.0 } else { 1e-3 };
                let mut at = [size.map(|s| s * (1e-9 + near * random()))];
                let mut host = [NONE];
                Locator::new(&mesh).locate(&mesh, &mut at, &mut host).unwrap();
                let (h, missed) = m.one(&mesh, at[0], host[0], &mut s);
                assert!(missed < MISSED, "{made:?} {at:?}: {missed} of {h}");
                // cells four times as long as wide do not see the next ones in the bell
                let long = made.n == [6, 1, 5];
                assert!(long || s.host.is_some_and(|h| h.1 == WIDTH), "{made:?} {at:?}: widened");
            }
        }
    }
}
