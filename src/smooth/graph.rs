// SPDX-License-Identifier: MIT OR Apache-2.0
//! The operator A = −V⁻¹ L as rows: (A φ)_i = Σ_j a_ij (φ_i − φ_j), a_ij = |S|/(d V_i), 1/m².

use crate::mesh::Mesh;
use crate::step::Lanes;

pub(super) struct Graph {
    start: Vec<u32>,
    to: Vec<u32>,
    a: Vec<f64>,
    /// max over faces of (A_ii + A_jj), an upper bound of the spectrum
    pub spectrum: f64,
    /// max A_ii
    pub diagonal: f64,
}

impl Graph {
    pub fn new(mesh: &Mesh) -> Self {
        let (mut start, mut to, mut a) = (vec![0], Vec::new(), Vec::new());
        for i in 0..mesh.len() {
            for l in mesh.links(i) {
                to.push(l.to);
                a.push(l.weight / mesh.volume[i]);
            }
            start.push(to.len() as u32);
        }
        let row = |i: usize| a[start[i] as usize..start[i + 1] as usize].iter().sum::<f64>();
        let d: Vec<f64> = (0..mesh.len()).map(row).collect();
        let faces = (0..mesh.len()).flat_map(|i| mesh.links(i).iter().map(move |l| (i, l.to as usize)));
        let spectrum = faces.map(|(i, j)| d[i] + d[j]).fold(0.0, f64::max);
        let diagonal = d.iter().copied().fold(0.0, f64::max);
        Self { start, to, a, spectrum, diagonal }
    }

    /// Σ_j a_ij (φ_i − φ_j) of one row, in slot order of the neighbours.
    #[inline(always)]
    pub fn row(&self, i: usize, x: &[Lanes]) -> Lanes {
        let (own, mut sum) = (x[i], [0.0; 8]);
        for k in self.start[i] as usize..self.start[i + 1] as usize {
            let (a, other) = (self.a[k], &x[self.to[k] as usize]);
            for l in 0..8 {
                sum[l] += a * (own[l] - other[l]);
            }
        }
        sum
    }
}
