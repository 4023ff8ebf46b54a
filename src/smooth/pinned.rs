// SPDX-License-Identifier: MIT OR Apache-2.0
//! R's smoothing of the solids velocity with filled cells held fixed (Radl et al. 2014, eq. 5 and below): cells that hold
//! particles keep the mean velocity of these, cells void of particles take the solution of (V + L_T) U = 0 between them.
//!
//! One backward Euler step of the diffusion with T = b²/4 from a field that is zero in void cells, T ↔ L² of
//! CFDEMcoupling (which pins by a large number; here the filled cells are exact). The matrix of the void cells is an
//! M-matrix: values lie between zero and those of the filled cells around, and fall off as e^{−x/√T}.
//!
//! Not conservative and not self-adjoint: a velocity is continued, not a momentum. It serves the scheme `implicit` only,
//! whose third-law error is measured. Conjugate gradients with the diagonal as preconditioner, to 1e-8, from zero each
//! time (nothing is kept), three components together, sums in the order of the cells. The filled cells
//! change from step to step, so a factorisation would have to be made anew each time: it is the oracle of the tests.

use crate::mesh::Mesh;
use crate::step::Lanes;

type V = [f64; 3];

/// Residual at which a solve ends, relative to the first.
const TOLERANCE: f64 = 1e-8;
/// Iterations after which it ends anyway.
const LIMIT: usize = 1000;

/// Continues velocities into cells void of particles.
#[derive(Clone, Debug)]
pub struct Pinned {
    start: Vec<u32>,
    to: Vec<u32>,
    /// T |S|/d, m3
    conductance: Vec<f64>,
    volume: Vec<f64>,
    /// V + Σ T |S|/d, m3
    diagonal: Vec<f64>,
    filled: Vec<bool>,
    velocity: Vec<V>,
    residual: Vec<V>,
    direction: Vec<V>,
    product: Vec<V>,
    /// of the last solve
    pub iterations: usize,
}

impl Pinned {
    /// `diffusion`: T of each link of the mesh, m2.
    pub fn new(mesh: &Mesh, diffusion: &[f64]) -> Self {
        let n = mesh.len();
        let conductance: Vec<f64> = mesh.links.iter().zip(diffusion).map(|(l, t)| t * l.weight).collect();
        let range = |i: usize| mesh.link_start[i] as usize..mesh.link_start[i + 1] as usize;
        let diagonal = (0..n).map(|i| mesh.volume[i] + conductance[range(i)].iter().sum::<f64>()).collect();
        Self {
            start: mesh.link_start.clone(),
            to: mesh.links.iter().map(|l| l.to).collect(),
            conductance,
            volume: mesh.volume.clone(),
            diagonal,
            filled: vec![false; n],
            velocity: vec![[0.0; 3]; n],
            residual: vec![[0.0; 3]; n],
            direction: vec![[0.0; 3]; n],
            product: vec![[0.0; 3]; n],
            iterations: 0,
        }
    }

    /// A x of a row; `x` of all cells.
    fn row(&self, i: usize, x: &[V]) -> V {
        let mut sum = x[i].map(|x| self.volume[i] * x);
        for k in self.start[i] as usize..self.start[i + 1] as usize {
            let (c, other) = (self.conductance[k], x[self.to[k] as usize]);
            (0..3).for_each(|a| sum[a] += c * (x[i][a] - other[a]));
        }
        sum
    }

    /// Solids velocity of all cells (m/s) from ε_s and ε_s U_s as mapped (lanes 0 and 1 to 3).
    pub fn solve(&mut self, mapped: &[Lanes]) -> &[V] {
        let n = mapped.len();
        for (j, l) in mapped.iter().enumerate() {
            self.filled[j] = l[0] > 0.0;
            self.velocity[j] = if self.filled[j] { [1, 2, 3].map(|a| l[a] / l[0]) } else { [0.0; 3] };
        }
        // void cells are the unknowns; a filled one has no residual and no direction
        for i in 0..n {
            let r = self.row(i, &self.velocity);
            self.residual[i] = if self.filled[i] { [0.0; 3] } else { r.map(|x| -x) };
            let d = self.diagonal[i];
            self.direction[i] = self.residual[i].map(|r| r / d);
        }
        let scaled = |s: &Self| {
            let mut sum = [0.0; 3];
            for i in 0..n {
                let d = s.diagonal[i];
                (0..3).for_each(|a| sum[a] += s.residual[i][a] * s.residual[i][a] / d);
            }
            sum
        };
        let first = scaled(self);
        let mut rho = first;
        self.iterations = 0;
        let done = |rho: V| (0..3).all(|a| rho[a] <= TOLERANCE * TOLERANCE * first[a]);
        while !done(rho) && self.iterations < LIMIT {
            self.iterations += 1;
            let mut curvature = [0.0; 3];
            for i in 0..n {
                let p = if self.filled[i] { [0.0; 3] } else { self.row(i, &self.direction) };
                (0..3).for_each(|a| curvature[a] += self.direction[i][a] * p[a]);
                self.product[i] = p;
            }
            let ratio = |x: f64, y: f64| if y > 0.0 { x / y } else { 0.0 };
            let alpha = [0, 1, 2].map(|a| ratio(rho[a], curvature[a]));
            for i in 0..n {
                for a in 0..3 {
                    self.velocity[i][a] += alpha[a] * self.direction[i][a];
                    self.residual[i][a] -= alpha[a] * self.product[i][a];
                }
            }
            let next = scaled(self);
            let beta = [0, 1, 2].map(|a| ratio(next[a], rho[a]));
            for i in 0..n {
                let d = self.diagonal[i];
                for a in 0..3 {
                    self.direction[i][a] = self.residual[i][a] / d + beta[a] * self.direction[i][a];
                }
            }
            rho = next;
        }
        &self.velocity
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::made::Made;
    use crate::smooth::Diffusion;
    use faer::Mat;
    use faer::linalg::solvers::Solve;
    use faer::sparse::linalg::solvers::Lu;
    use faer::sparse::{SparseColMat, Triplet};

    fn mapped(n: usize, filled: impl Fn(usize) -> Option<V>) -> Vec<Lanes> {
        let lanes = |u: V| [0.3, 0.3 * u[0], 0.3 * u[1], 0.3 * u[2], 0.0, 0.0, 0.0, 0.0];
        (0..n).map(|j| filled(j).map_or([0.0; 8], lanes)).collect()
    }

    #[test]
    fn beside_a_wall_of_particles_the_velocity_falls_off_geometrically() {
        // 400 cells in a row, h = 1 mm, filled up to x = 0.1: U_k = q^k, q + 1/q = 2 + h²/T
        let mesh = Made::hex([400, 1, 1], [0.4, 1e-3, 1e-3]).mesh();
        let b = 4e-3f64;
        let mut p = Pinned::new(&mesh, &Diffusion::uniform(b).links(&mesh));
        let field = mapped(400, |j| (mesh.centre[j][0] < 0.1).then_some([2.0, -1.0, 0.0]));
        let u = p.solve(&field);
        let c = 2.0 + 1e-6 / (0.25 * b * b);
        let q = 0.5 * (c - (c * c - 4.0).sqrt());
        for (j, u) in u.iter().enumerate() {
            let k = ((mesh.centre[j][0] - 0.0995) / 1e-3).round();
            let expected = if k < 0.5 { 1.0 } else { q.powf(k) };
            assert!((u[0] - 2.0 * expected).abs() < 1e-7 && (u[1] + expected).abs() < 1e-7, "{k}: {u:?}");
            assert_eq!(u[2], 0.0);
        }
    }

    #[test]
    fn filled_cells_are_kept_to_the_bit_and_the_rest_is_the_direct_solution() {
        let mesh = Made::tet([4, 3, 4], [0.06, 0.04, 0.05]).mesh();
        let n = mesh.len();
        let t = Diffusion::uniform(0.02).links(&mesh);
        let field = mapped(n, |j| (j * 37 % 11 == 0).then_some([1.0 + j as f64, -3.0, (j as f64).sin()]));
        let mut p = Pinned::new(&mesh, &t);
        let got = p.solve(&field).to_vec();
        assert!(p.iterations < 100, "{}", p.iterations);
        let value = |j: usize, a: usize| field[j][1 + a] / field[j][0];
        let mut entries = Vec::new();
        for i in 0..n {
            if field[i][0] > 0.0 {
                entries.push(Triplet::new(i, i, 1.0));
                (0..3).for_each(|a| assert_eq!(got[i][a], value(i, a)));
                continue;
            }
            let mut own = mesh.volume[i];
            for (k, l) in mesh.links(i).iter().enumerate() {
                let c = t[mesh.link_start[i] as usize + k] * l.weight;
                own += c;
                entries.push(Triplet::new(i, l.to as usize, -c));
            }
            entries.push(Triplet::new(i, i, own));
        }
        let matrix = SparseColMat::<usize, f64>::try_new_from_triplets(n, n, &entries).unwrap();
        let lu: Lu<usize, f64> = matrix.sp_lu().unwrap();
        let x = lu.solve(&Mat::from_fn(n, 3, |i, a| if field[i][0] > 0.0 { value(i, a) } else { 0.0 }));
        let size = n as f64;
        for i in 0..n {
            (0..3).for_each(|a| assert!((got[i][a] - x[(i, a)]).abs() < 1e-7 * size, "{i} {a}"));
            // between zero and the extremes of the filled cells
            assert!(got[i][1] >= -3.0 - 1e-6 && got[i][1] <= 1e-6);
        }
    }

    #[test]
    fn nothing_filled_is_nothing_to_do() {
        let mesh = Made::hex([3, 3, 3], [1.0; 3]).mesh();
        let mut p = Pinned::new(&mesh, &Diffusion::uniform(0.5).links(&mesh));
        assert!(p.solve(&mapped(27, |_| None)).iter().all(|u| *u == [0.0; 3]));
        assert!(p.solve(&mapped(27, |_| Some([1.0; 3]))).iter().all(|u| *u == [1.0; 3]));
        assert_eq!(p.iterations, 0);
    }
}
