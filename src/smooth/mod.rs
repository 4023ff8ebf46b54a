// SPDX-License-Identifier: MIT OR Apache-2.0
//! Stage 4, smooth: G = exp(T Δ_h), T = b²/4, on eight fields at once (design §2.1).
//!
//! Reads the Laplacian's graph of the mesh; works on cell fields in place. G conserves Σ V φ, preserves
//! constants, keeps signs and is self-adjoint in the V inner product; every smoother says what it keeps.
//! New smoothers implement `Smoother` and join `by_name`. Does not know particles.

mod active;
mod chebyshev;
mod graph;
mod uniformization;

pub use active::Active;
pub use chebyshev::Chebyshev;
pub use uniformization::Uniformization;

use crate::mesh::Mesh;
use crate::step::Lanes;

/// A way to smooth cell fields.
pub trait Smoother {
    /// Name in case.toml.
    fn name(&self) -> &'static str;
    /// What it keeps and its error, for the documentation.
    fn properties(&self) -> &'static str;
    /// Conserves Σ V φ, keeps constants and is self-adjoint, all to rounding.
    fn conservative(&self) -> bool {
        true
    }
    /// Number of sweeps over the mesh per application.
    fn degree(&self) -> usize;
    /// Smooths all lanes. Fields that are zero outside the occupied cells come out as from a sweep over the
    /// whole mesh, to the bit; of other fields only the values in occupied cells are smoothed.
    fn apply(&mut self, lanes: &mut [Lanes], active: &Active);
}

/// No smoothing: cells much larger than the bandwidth.
pub struct Unsmoothed;

impl Smoother for Unsmoothed {
    fn name(&self) -> &'static str {
        "none"
    }
    fn properties(&self) -> &'static str {
        "identity: conservative, positive, self-adjoint, exact for b = 0"
    }
    fn degree(&self) -> usize {
        0
    }
    fn apply(&mut self, _: &mut [Lanes], _: &Active) {}
}

/// Names in case.toml.
pub const NAMES: &[&str] = &["chebyshev", "uniformization", "none"];

/// The smoother of that name for bandwidth b (m) and relative tolerance.
pub fn by_name(name: &str, mesh: &Mesh, bandwidth: f64, tolerance: f64) -> Option<Box<dyn Smoother>> {
    match name {
        "chebyshev" => Some(Box::new(Chebyshev::new(mesh, bandwidth, tolerance))),
        "uniformization" => Some(Box::new(Uniformization::new(mesh, bandwidth, tolerance))),
        "none" => Some(Box::new(Unsmoothed)),
        _ => None,
    }
}

#[cfg(test)]
mod tests;
