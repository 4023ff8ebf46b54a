// SPDX-License-Identifier: MIT OR Apache-2.0
//! Stage 3, map: which cells a particle's volume goes to, and the deposit and gather with these weights.
//!
//! Reads positions (m), radii (m), host cells; writes weights with Σ_k m_ik = 1. Deposit and gather are adjoint.
//! New mappings implement `Mapping` and join `all`. Does not know what is deposited.

mod bell;
mod cells;
mod divided;
mod entropy;
mod exp;
mod fill;
mod images;
mod kernel;
mod linear;
mod lists;
mod near;
mod ring;
mod satellite;
mod two_grid;
mod weights;

pub use cells::{Cells, Facet};
pub use divided::DividedVolume;
pub use entropy::MaxEntropy;
pub use kernel::Kernel;
pub use linear::Linear;
pub use satellite::SatellitePoints;
pub use two_grid::TwoGrid;

pub use near::Lines;
pub use weights::{BATCH, Weights};

use crate::mesh::Mesh;

/// What some mappings need to know.
#[derive(Clone, Copy, Debug, Default)]
pub struct Options {
    /// b of `kernel`, m
    pub bandwidth: f64,
    /// cell size of the coarse grid of `two-grid`, m
    pub grid: f64,
}

/// A way to distribute particles over cells.
pub trait Mapping: Send + Sync {
    /// Name in case.toml.
    fn name(&self) -> &'static str;
    /// Paper and equation.
    fn source(&self) -> &'static str;
    /// What it keeps, its error and its cost.
    fn properties(&self) -> &'static str;
    /// Work done once per mesh; needed before `weights`.
    fn prepare(&mut self, _mesh: &Mesh, _options: &Options) {}
    /// Variance the deposit adds along each link beyond that of a cell of the mesh (m2, aligned with `mesh.links`, the same in both rows):
    /// the smoother may take T = b²/4 − variance/2 there. Empty: none.
    fn link_variance(&self, _mesh: &Mesh) -> Vec<f64> {
        Vec::new()
    }
    /// The same by cell, without direction: mean over the particles of a cell (m2). `mesh` is the one it was prepared for. Empty: none.
    fn cell_variance(&self, _mesh: &Mesh) -> Vec<f64> {
        Vec::new()
    }
    /// Share of `cell_variance` that is taken out of the smoother's T along the links it goes by.
    fn taken_out(&self) -> f64 {
        0.0
    }
    /// The deposit has the bandwidth already: nothing is to be smoothed after it.
    fn smooths(&self) -> bool {
        false
    }
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
    fn properties(&self) -> &'static str {
        "conservative, positive, not continuous; first moment off by up to half a cell; costs nothing"
    }
    fn weights(&self, _: &Mesh, _: &[[f64; 3]], _: &[f64], host: &[u32], out: &mut Weights) {
        out.by_hosts(host);
    }
}

/// What is used unless another is asked for: see `resolve`.
pub const DEFAULT: &str = "auto";

/// The mapping meant by a name: `auto` is `max-entropy` on tetrahedra, where `linear` cannot halve the error of the particle centroid (docs/bench.md),
/// and `linear`, which costs a fifth, elsewhere.
pub fn resolve<'a>(name: &'a str, mesh: &Mesh) -> &'a str {
    match name {
        DEFAULT if mesh.tetrahedral() => "max-entropy",
        DEFAULT => "linear",
        _ => name,
    }
}

/// The mapping meant by a name, not yet prepared.
pub fn by_name(name: &str, mesh: &Mesh) -> Option<Box<dyn Mapping>> {
    let name = resolve(name, mesh);
    all().into_iter().find(|m| m.name() == name)
}

/// What is taken out of T on each link for the variance that the deposit has itself, m2: of its two cells the mean. `mesh`: the one
/// the mapping was prepared for; `linked`: the same cells with the links of the smoother. None: nothing.
pub fn taken_out(mapping: &dyn Mapping, mesh: &Mesh, linked: &Mesh) -> Option<Vec<f64>> {
    let share = mapping.taken_out();
    let cells = if share > 0.0 { mapping.cell_variance(mesh) } else { return None };
    let link = |i: usize, j: u32| (share * 0.5 * (cells[i] + cells[j as usize])).max(0.0);
    let row = |i: usize| linked.links(i).iter().map(move |l| link(i, l.to));
    Some((0..linked.len()).flat_map(row).collect())
}

/// All mappings.
pub fn all() -> Vec<Box<dyn Mapping>> {
    vec![
        Box::new(ParticleCentroid),
        Box::<SatellitePoints>::default(),
        Box::<DividedVolume>::default(),
        Box::<Linear>::default(),
        Box::<MaxEntropy>::default(),
        Box::<Kernel>::default(),
        Box::<TwoGrid>::default(),
    ]
}
