// SPDX-License-Identifier: MIT OR Apache-2.0
//! Stage 3, map: which cells a particle's volume goes to, and the deposit and gather with these weights.
//!
//! Reads positions (m), radii (m), host cells; writes weights with Σ_k m_ik = 1. Deposit and gather are adjoint.
//! New mappings implement `Mapping` and join `all`. Does not know what is deposited.

use crate::mesh::{Mesh, NONE};
use crate::step::Lanes;

/// Weights of all particles: particle i goes to `cell[k]` by `weight[k]`, k from `start[i]` to `start[i+1]`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Weights {
    /// first entry of each particle; one more at the end
    pub start: Vec<u32>,
    /// cell slots
    pub cell: Vec<u32>,
    /// m_ik
    pub weight: Vec<f64>,
}

/// A way to distribute particles over cells.
pub trait Mapping {
    /// Name in case.toml.
    fn name(&self) -> &'static str;
    /// Paper and equation.
    fn source(&self) -> &'static str;
    /// Σ_k m_ik = 1 to rounding.
    fn conservative(&self) -> bool {
        true
    }
    /// Fills `out`. A particle without host (`NONE`) gets no weight.
    fn weights(&self, mesh: &Mesh, position: &[[f64; 3]], radius: &[f64], host: &[u32], out: &mut Weights);
}

/// All of a particle goes to its host cell.
pub struct ParticleCentroid;

impl Mapping for ParticleCentroid {
    fn name(&self) -> &'static str {
        "particle-centroid"
    }
    fn source(&self) -> &'static str {
        "Sun & Xiao 2015, eq. 4"
    }
    fn weights(&self, _: &Mesh, _: &[[f64; 3]], _: &[f64], host: &[u32], out: &mut Weights) {
        out.start.clear();
        out.cell.clear();
        out.weight.clear();
        out.start.push(0);
        for h in host {
            if *h != NONE {
                out.cell.push(*h);
                out.weight.push(1.0);
            }
            out.start.push(out.cell.len() as u32);
        }
    }
}

/// All mappings.
pub fn all() -> Vec<Box<dyn Mapping>> {
    vec![Box::new(ParticleCentroid)]
}

impl Weights {
    fn entries(&self, i: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
        let range = self.start[i] as usize..self.start[i + 1] as usize;
        range.map(|k| (self.cell[k] as usize, self.weight[k]))
    }
    /// Adds Σ_i m_ik q_i / V_k to each cell, particle by particle in their (id) order.
    pub fn deposit(&self, mesh: &Mesh, lanes: &mut [Lanes], quantity: impl Fn(usize) -> Lanes) {
        for i in 0..self.start.len().saturating_sub(1) {
            let q = quantity(i);
            for (cell, m) in self.entries(i) {
                let (to, share) = (&mut lanes[cell], m / mesh.volume[cell]);
                (0..8).for_each(|a| to[a] += share * q[a]);
            }
        }
    }
    /// Σ_k m_ik φ_k of particle i.
    pub fn gather(&self, lanes: &[Lanes], i: usize) -> Lanes {
        let range = self.start[i] as usize..self.start[i + 1] as usize;
        if range.len() == 1 && self.weight[range.start] == 1.0 {
            return lanes[self.cell[range.start] as usize];
        }
        let mut sum = [0.0; 8];
        for (cell, m) in self.entries(i) {
            (0..8).for_each(|a| sum[a] += m * lanes[cell][a]);
        }
        sum
    }
}
