// SPDX-License-Identifier: MIT OR Apache-2.0
//! Stage 3, map: which cells a particle's volume goes to, and the deposit and gather with these weights.
//!
//! Reads positions (m), radii (m), host cells; writes weights with Σ_k m_ik = 1. Deposit and gather are adjoint.
//! New mappings implement `Mapping` and join `all`. Does not know what is deposited.

mod weights;

pub use weights::Weights;

use crate::mesh::Mesh;

/// A way to distribute particles over cells.
pub trait Mapping {
    /// Name in case.toml.
    fn name(&self) -> &'static str;
    /// Paper and equation.
    fn source(&self) -> &'static str;
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
        out.weight.clear();
        out.cell.clear();
        out.cell.extend_from_slice(host);
    }
}

/// All mappings.
pub fn all() -> Vec<Box<dyn Mapping>> {
    vec![Box::new(ParticleCentroid)]
}
