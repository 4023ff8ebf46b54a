// SPDX-License-Identifier: MIT OR Apache-2.0
//! Maximum-entropy deposit: the weights nearest to a given bell that reproduce the particle's position, on any mesh.
//!
//! m_k ∝ V_k (exp(−r_k²/(c h)²) − cut) exp(λ·(x_k − x)) over the cells around, λ such that Σ m_k (x_k − x) = 0: Newton's
//! method on the convex log Σ (Arroyo & Ortiz 2006, local maximum entropy; the cells' volumes as prior measure are own).
//! h is the local cell size, a mean of the cube roots of the volumes around that is continuous in x; where the bell
//! falls below 1e-4 it ends without a jump. c = 0.8: narrower is noisier, wider than a bandwidth of 0.7 h allows. At walls cells
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
//! Cost on one thread with 8, 2 and 1 particles per cell: 1.5, 1.7, 1.8 us on tetrahedra, 1.0, 1.1, 1.2 on hexahedra, 1.2, 1.3, 1.5 on
//! polyhedra. A host's first particle costs the walk over the cells around, 10 to 25 us; what it finds is kept (`ring`), as the mesh does
//! not change: 16 bytes per cell, and for each that ever was a host some 850 on tetrahedra, 480 on hexahedra, 590 on polyhedra, and 24 more per image near walls and cyclics.
//! The weights themselves take 680 bytes per particle. `bell` solves for them.
//! Reads positions (m), cells; writes weights. Does not know radii.

use super::bell::{Bell, END, Solve, Table};
use super::cells::Cells;
use super::images::{Around, bent};
use super::ring::{Ring, Sizes};
use super::{Mapping, Options, Weights};
use crate::mesh::Mesh;
use crate::mesh::geometry::{V, add, cross, dot, scale, sub};
use crate::smooth::Real;
use crate::threads;
use std::sync::OnceLock;

/// Width of the bell in local cell sizes.
const WIDTH: f64 = 0.8;
/// And where that does not do.
const WIDTHS: [f64; 3] = [WIDTH, 1.5 * WIDTH, 2.25 * WIDTH];
/// Rest of the first moment that is an error, in h.
const MISSED: f64 = 1e-9;
/// Points per cell for its mean variance.
const POINTS: usize = 4;
/// Cells that one thread takes at a time.
const PIECE: usize = 4096;

/// The mapping.
#[derive(Default)]
pub struct MaxEntropy {
    sizes: Sizes,
    /// by host: the cells around it, found when it first has a particle
    rings: Vec<OnceLock<Box<Ring>>>,
}

/// What one thread keeps.
#[derive(Default)]
struct Scratch {
    around: Around,
    /// of the last hosts, by width
    tables: [Table; 3],
    /// of the last particle
    bell: Bell,
    /// number of its width
    wide: usize,
}

impl MaxEntropy {
    /// Cells and weights of one particle, left in the scratch memory; (local size in m, first moment missed in it). The
    /// cells around the host may be kept for the next time.
    fn one(&self, mesh: &Mesh, x: V, host: u32, keep: bool, s: &mut Scratch) -> (f64, f64) {
        let Scratch { around, tables, bell, wide } = s;
        let sizes = &self.sizes;
        let mut found = (0.0, f64::INFINITY);
        for (k, table) in tables.iter_mut().enumerate() {
            let width = WIDTHS[k];
            if table.host != Some(host) {
                let mut find = || Ring::find(mesh, sizes, host, width * END.sqrt(), around);
                if keep && k == 0 {
                    let ring = self.rings[host as usize].get_or_init(|| Box::new(find()));
                    table.set(width, host, ring.seen(sizes));
                } else {
                    table.set(width, host, find().seen(sizes));
                }
            }
            found = f64::dispatch(Solve { table, bell, x, width, size: sizes.cell[host as usize][3] });
            *wide = k;
            if found.1 < MISSED {
                break;
            }
        }
        found
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
            let (h, _) = self.one(mesh, x, cell, false, s);
            mean += volume(t) * s.bell.spread() * h * h;
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
         smoother's; some 57 cells; 1 to 2 us per particle, and 10 to 25 once per cell that gets one"
    }
    fn prepare(&mut self, mesh: &Mesh, _: &Options) {
        let cells = mesh.centre.iter().zip(&mesh.volume);
        let cell = cells.map(|([x, y, z], v)| [*x, *y, *z, v.cbrt()]).collect();
        self.sizes = Sizes { cell, extent: mesh.extents(), bent: bent(mesh) };
        self.rings = mesh.volume.iter().map(|_| OnceLock::new()).collect();
    }
    fn taken_out(&self) -> f64 {
        1.0
    }
    fn cell_variance(&self, mesh: &Mesh) -> Vec<f64> {
        let cells = Cells::new(mesh);
        let order = mesh.along_curve();
        let parts = threads::map(order.chunks(PIECE).collect(), |part| {
            let mut s = Scratch::default();
            part.iter().map(|c| self.variance(mesh, &cells, *c, &mut s)).collect::<Vec<f64>>()
        });
        let mut all = vec![0.0; mesh.len()];
        order.iter().zip(parts.concat()).for_each(|(c, v)| all[*c as usize] = v);
        all
    }
    fn weights(&self, mesh: &Mesh, position: &[[f64; 3]], _: &[f64], host: &[u32], out: &mut Weights) {
        assert_eq!(self.rings.len(), mesh.len(), "max-entropy: prepare() it for this mesh first");
        out.fill(host, |s: &mut Scratch, i, host, out| {
            self.one(mesh, position[i], host, true, s);
            let Bell { cell, weight, share, .. } = &s.bell;
            let mut k = 0;
            while k < cell.len() {
                // images of one cell follow each other
                let (to, mut w) = (cell[k], 0.0);
                while k < cell.len() && cell[k] == to {
                    w += weight[k] * share;
                    k += 1;
                }
                if w > 0.0 {
                    out.push(to, w);
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
    use crate::mesh::NONE;
    use crate::mesh::made::{Bend, Made};

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
            Made::hex([6, 6, 5], size).round(),
            Made::tet([4, 4, 4], size).mirrored().round(),
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
                if Locator::new(&mesh).locate(&mesh, &mut at, &mut host).is_err() {
                    assert_eq!(made.bend, Bend::Cylinder);
                    continue;
                }
                let (h, missed) = m.one(&mesh, at[0], host[0], i % 3 > 0, &mut s);
                assert!(missed < MISSED, "{made:?} {at:?}: {missed} of {h}");
                // cells four times as long as wide do not see the next ones in the bell
                let long = made.n == [6, 1, 5];
                assert!(long || s.wide == 0, "{made:?} {at:?}: widened");
            }
        }
    }
}
