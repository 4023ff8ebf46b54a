// SPDX-License-Identifier: MIT OR Apache-2.0
//! Bandwidth by particle size (Sun & Xiao 2015, §4.1: different wakes in a polydisperse bed): particles up to a diameter
//! are smoothed with a bandwidth of their own.
//!
//! Every class has its own operator G_c = exp(Δ_{T_c}), and a particle of class c is spread and gathered by G_c alone, so
//! φ = Σ_c G_c φ_c conserves, preserves constants, keeps signs and is adjoint to its gather as each G_c is. The classes lie
//! side by side: cell j of class c is row c n + j of one graph of n cells per class without links between classes, so
//! every smoother and the active cells work on it unchanged. ε at a particle is the sum over all classes. Cost: the
//! active cells of each class, at the degree of the largest bandwidth; nothing with one class.
//!
//! Reads limits and bandwidths (m), radii (m); writes rows. Does not know what the lanes mean.

use super::Diffusion;
use crate::map::Weights;
use crate::mesh::{Mesh, NONE};
use crate::step::Lanes;

/// Classes of diameters; the last one has no upper limit.
#[derive(Clone, Debug, PartialEq)]
pub struct Classes {
    /// largest diameter of each class but the last, m, ascending
    limits: Vec<f64>,
    /// b of each class, m
    bandwidths: Vec<f64>,
    /// cells of the mesh
    cells: usize,
}

impl Classes {
    /// `list`: (largest diameter, bandwidth) in m, ascending; `bandwidth`: of all larger particles.
    pub fn new(mesh: &Mesh, list: &[[f64; 2]], bandwidth: f64) -> Self {
        let limits = list.iter().map(|c| c[0]).collect();
        let bandwidths = list.iter().map(|c| c[1]).chain([bandwidth]).collect();
        Self { limits, bandwidths, cells: mesh.len() }
    }
    /// All particles alike.
    pub fn one(mesh: &Mesh) -> Self {
        Self::new(mesh, &[], 0.0)
    }
    /// Number of classes.
    pub fn count(&self) -> usize {
        self.bandwidths.len()
    }
    /// Rows of all classes.
    pub fn rows(&self) -> usize {
        self.cells * self.count()
    }
    /// Class of a particle.
    pub fn of(&self, radius: f64) -> usize {
        self.limits.iter().filter(|d| 2.0 * radius > **d).count()
    }
    /// b of a particle, m.
    pub fn bandwidth(&self, radius: f64) -> f64 {
        self.bandwidths[self.of(radius)]
    }
    /// Cell of a row.
    pub fn cell(&self, row: u32) -> usize {
        if self.count() == 1 { row as usize } else { row as usize % self.cells }
    }
    /// Row of a cell in the class of a particle; no cell stays none.
    pub fn row(&self, cell: u32, radius: f64) -> u32 {
        if cell == NONE || self.count() == 1 { cell } else { (self.of(radius) * self.cells) as u32 + cell }
    }

    /// Ids, volumes and Laplacian of all classes side by side: all that smoothers and deposits look at.
    pub fn mesh(&self, mesh: &Mesh) -> Mesh {
        let (n, count) = (mesh.len(), self.count());
        let mut all = Mesh { sides: Vec::new(), side_start: vec![0], ..mesh.clone() };
        (all.ids, all.volume) = (mesh.ids.repeat(count), mesh.volume.repeat(count));
        for c in 1..count {
            let (cells, links) = ((c * n) as u32, (c * mesh.links.len()) as u32);
            all.links.extend(mesh.links.iter().map(|l| crate::mesh::Link { to: l.to + cells, ..*l }));
            all.link_start.extend(mesh.link_start[1..].iter().map(|s| s + links));
        }
        all
    }
    /// T of the links of `mesh()`, m2; `like`: what else it depends on.
    pub fn links(&self, mesh: &Mesh, like: &Diffusion) -> Vec<f64> {
        self.bandwidths.iter().flat_map(|b| Diffusion { bandwidth: *b, ..*like }.links(mesh)).collect()
    }

    /// Moves weights given by cell to the rows of each particle's class.
    pub fn shift(&self, weights: &mut Weights, radius: &[f64]) {
        if self.count() == 1 {
            return;
        }
        if weights.start.is_empty() {
            weights.cell.iter_mut().zip(radius).for_each(|(c, r)| *c = self.row(*c, *r));
            return;
        }
        for (i, r) in radius.iter().enumerate() {
            let range = weights.start[i] as usize..weights.start[i + 1] as usize;
            weights.cell[range].iter_mut().for_each(|c| *c = self.row(*c, *r));
        }
    }

    /// The cells of these rows, ascending.
    pub fn cells_of(&self, rows: &[u32], out: &mut Vec<u32>) {
        out.clear();
        out.extend(rows.iter().map(|r| self.cell(*r) as u32));
        out.sort_unstable();
        out.dedup();
    }
    /// Sums lanes over the classes into `total` by cell, class by class; `cells` are those of `rows`.
    pub fn sum(&self, lanes: &[Lanes], rows: &[u32], cells: &[u32], total: &mut [Lanes]) {
        cells.iter().for_each(|j| total[*j as usize] = [0.0; 8]);
        // rows ascend, so the classes come in their order
        for row in rows {
            let to = &mut total[self.cell(*row)];
            to.iter_mut().zip(&lanes[*row as usize]).for_each(|(t, l)| *t += l);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::made::Made;
    use crate::smooth::{Active, Direction, Scratch, by_name};
    use crate::sums::sum;

    #[test]
    fn classes_go_by_diameter() {
        let mesh = Made::hex([4, 3, 2], [1.0; 3]).mesh();
        let c = Classes::new(&mesh, &[[1e-3, 4e-3], [2e-3, 8e-3]], 2e-2);
        assert_eq!([4e-4, 5e-4, 6e-4, 1e-3, 3e-3].map(|r| c.of(r)), [0, 0, 1, 1, 2]);
        assert_eq!((c.row(5, 3e-3), c.row(5, 1e-4), c.row(NONE, 3e-3)), (53, 5, NONE));
        let mut w = Weights::default();
        w.by_hosts(&[1, 2, NONE]);
        c.shift(&mut w, &[3e-3, 7e-4, 3e-3]);
        assert_eq!(w.cell, [49, 26, NONE]);
        w.clear();
        for cells in [&[(1, 0.5), (2, 0.5)][..], &[(3, 1.0)]] {
            cells.iter().for_each(|(c, m)| w.push(*c, *m));
            w.close();
        }
        c.shift(&mut w, &[7e-4, 1e-4]);
        assert_eq!(w.cell, [25, 26, 3]);
    }

    #[test]
    fn every_class_is_smoothed_by_its_own_bandwidth_and_nothing_is_lost() {
        let mesh = Made::graded([8, 6, 5], [0.06, 0.04, 0.05]).mesh();
        let (n, list) = (mesh.len(), [[1e-3, 0.006], [2e-3, 0.02]]);
        let c = Classes::new(&mesh, &list, 0.03);
        let (all, like) = (c.mesh(&mesh), Diffusion { largest_cell: 0.012, ..Diffusion::default() });
        for name in ["chebyshev", "uniformization", "direct"] {
            let mut g = by_name(name, &all, &c.links(&mesh, &like), 1e-9).unwrap();
            let mut lanes = vec![[0.0; 8]; c.rows()];
            for (k, (b, at)) in [(0.006, 20), (0.02, 100), (0.03, 60)].into_iter().enumerate() {
                let mut one = vec![[0.0; 8]; n];
                one[at][0] = 1.0;
                lanes[k * n + at][0] = 1.0;
                let t = Diffusion { bandwidth: b, ..like }.links(&mesh);
                let mut alone = by_name(name, &mesh, &t, 1e-9).unwrap();
                alone.apply(&mut one, &Active::whole(n), Direction::Spread, &mut Scratch::default());
                one.iter().enumerate().for_each(|(j, l)| lanes[k * n + j][1] = l[0]);
            }
            let expected: Vec<f64> = lanes.iter().map(|l| l[1]).collect();
            let given: Vec<f64> = lanes.iter().map(|l| l[0]).collect();
            lanes.iter_mut().for_each(|l| l[1] = 3.0);
            g.apply(&mut lanes, &Active::whole(c.rows()), Direction::Spread, &mut Scratch::default());
            assert!(lanes.iter().zip(&expected).all(|(l, e)| (l[0] - e).abs() < 1e-8), "{name}");
            assert!(lanes.iter().all(|l| (l[1] - 3.0).abs() < 1e-12), "{name}: constants");
            let rows: Vec<u32> = (0..c.rows() as u32).collect();
            let (mut cells, mut total) = (Vec::new(), vec![[7.0; 8]; n]);
            c.cells_of(&rows, &mut cells);
            c.sum(&lanes, &rows, &cells, &mut total);
            let mass = |f: &[f64], v: &[f64]| sum(f.iter().zip(v).map(|(f, v)| f * v));
            let found = mass(&total.iter().map(|l| l[0]).collect::<Vec<_>>(), &mesh.volume);
            assert!((found / mass(&given, &all.volume) - 1.0).abs() < 1e-12, "{name}");
        }
    }
}
