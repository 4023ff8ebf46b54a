// SPDX-License-Identifier: MIT OR Apache-2.0
//! T of every link of the mesh (m2), from which the operator is built: G = exp(Δ_T), Δ_T φ = V⁻¹ Σ_f T_f |S|/d δφ.
//!
//! T = b²/4 gives the Gaussian of bandwidth b (its variance along an axis is 2T = b²/2). A deposit that spreads a
//! particle by itself has a variance of its own, which is taken out: T = max(0, b²/4 − var/2). Cells larger than a
//! limit keep what they are given (SX §2.2.3, limitation 1). The result is the same for both rows of a face, so
//! that all four properties of G hold whatever T is.

use crate::mesh::Mesh;

/// What T of the links depends on.
#[derive(Clone, Copy, Debug, Default)]
pub struct Diffusion<'a> {
    /// b, m
    pub bandwidth: f64,
    /// b of each cell, m; replaces `bandwidth`; a link takes the smaller of its two cells'
    pub of_cells: Option<&'a [f64]>,
    /// variance of the deposit along each link of `mesh.links`, m2, symmetric
    pub variance: Option<&'a [f64]>,
    /// cells larger than this (cube root of the volume, m) are not smoothed; 0: no limit
    pub largest_cell: f64,
}

impl Diffusion<'_> {
    /// The Gaussian of bandwidth b (m) everywhere.
    pub fn uniform(bandwidth: f64) -> Self {
        Self { bandwidth, ..Self::default() }
    }
    /// T of each link, m2, in the order of `mesh.links`.
    pub fn links(&self, mesh: &Mesh) -> Vec<f64> {
        let width = |c: usize| {
            let large = self.largest_cell > 0.0 && mesh.volume[c].cbrt() > self.largest_cell;
            if large { 0.0 } else { self.of_cells.map_or(self.bandwidth, |b| b[c]) }
        };
        let mut t = Vec::with_capacity(mesh.links.len());
        for i in 0..mesh.len() {
            let own = width(i);
            for l in mesh.links(i) {
                let b = own.min(width(l.to as usize));
                let variance = self.variance.map_or(0.0, |v| v[t.len()]);
                t.push((0.25 * b * b - 0.5 * variance).max(0.0));
            }
        }
        t
    }
}
