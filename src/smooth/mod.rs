// SPDX-License-Identifier: MIT OR Apache-2.0
//! Stage 4, smooth: G = exp(Δ_T), on eight fields at once (design §2.1).
//!
//! Reads the Laplacian's graph of the mesh and T of its links (`diffusion`); works on cell fields in place. G
//! conserves Σ V φ, preserves constants, keeps signs and is self-adjoint in the V inner product; every smoother
//! says which of these it keeps, its error and its cost. New smoothers implement `Smoother` and join `by_name`.
//! Does not know particles.
//!
//! Measured on made meshes (b = 8 mm, point source; second moments relative to b²/2): hexahedra 1.0000 along all three axes;
//! polyhedra (plane faces, seeds jiggled by 20 %) 0.998, 1.000, 1.000; jiggled tetrahedra without a common direction 0.997 to 1.017, mixed 0.02;
//! else nothing mixed. The two-point flux has no non-orthogonal correction: where all tetrahedra lie along one diagonal, the kernel is
//! drawn out along it, 1.6 along and 0.73 across. Along the links of the Voronoi diagram of the centres (`smooth.links = "voronoi"`) it is
//! 0.99 to 1.00 in all directions there, and the centre of the kernel stays where it was.

mod active;
mod average;
mod blocked;
mod classes;
pub mod coefficients;
mod diffusion;
mod direct;
pub mod factors;
mod field;
mod graph;
mod pcg;
mod pinned;
mod polynomial;
mod product;
mod real;
mod recurrence;
mod sweep;
pub mod wake;

pub use active::Active;
pub use average::TimeAverage;
pub use classes::Classes;
pub use diffusion::Diffusion;
pub use direct::Direct;
pub use field::{Field, Scratch};
pub use graph::Graph;
pub use pcg::Implicit;
pub use pinned::Pinned;
pub use polynomial::{Polynomial, Single};
pub(crate) use real::Real;

use crate::mesh::Mesh;
use crate::step::Lanes;
use std::sync::Arc;

/// Which values are needed: both give the bits of a sweep over the whole mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    /// the field is zero outside the occupied cells; all of the result is right
    Spread,
    /// any field; the result is right in the occupied cells only
    Gather,
    /// some lanes to spread, others to gather
    Both,
}

/// Does a field ≥ 0 stay ≥ 0?
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Positivity {
    /// on any mesh, by proof
    Proven,
    /// in every measurement at tolerances ≤ 1e-2 on filled beds, not by proof
    Measured,
    /// no
    No,
}

/// What a smoother keeps, its error and its cost.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Properties {
    /// Σ V φ, to rounding
    pub conservative: bool,
    /// constants, to rounding
    pub constants: bool,
    /// ⟨Gφ, ψ⟩_V = ⟨φ, Gψ⟩_V, to rounding
    pub self_adjoint: bool,
    /// signs
    pub positive: Positivity,
    /// against exp(Δ_T)
    pub error: &'static str,
    /// work of one application
    pub cost: &'static str,
}

/// A way to smooth cell fields.
pub trait Smoother: Send + Sync {
    /// Name in case.toml.
    fn name(&self) -> &'static str;
    /// What it keeps, its error, its cost.
    fn properties(&self) -> Properties;
    /// Number of sweeps over the mesh per application, of the last one if it varies.
    fn degree(&self) -> usize;
    /// Finds the rows to visit when these cells (slots) are occupied.
    fn plan(&self, occupied: &[u32], active: &mut Active);
    /// Smooths all lanes, by whichever direction is needed.
    fn apply(&mut self, lanes: &mut [Lanes], active: &Active, direction: Direction, scratch: &mut Scratch);
    /// Bytes that must move in one application; 0: not known.
    fn bytes(&self, _: &Active, _: Direction) -> f64 {
        0.0
    }
}

/// No smoothing: cells much larger than the bandwidth.
pub struct Unsmoothed;

impl Smoother for Unsmoothed {
    fn name(&self) -> &'static str {
        "none"
    }
    fn properties(&self) -> Properties {
        Properties {
            conservative: true,
            constants: true,
            self_adjoint: true,
            positive: Positivity::Proven,
            error: "exact for b = 0",
            cost: "none",
        }
    }
    fn degree(&self) -> usize {
        0
    }
    fn plan(&self, occupied: &[u32], active: &mut Active) {
        active.only(occupied);
    }
    fn apply(&mut self, _: &mut [Lanes], _: &Active, _: Direction, _: &mut Scratch) {}
}

/// What is used unless another is asked for.
pub const DEFAULT: &str = "gaussian";

/// Names in case.toml.
pub const NAMES: &[&str] = &[
    DEFAULT,
    "chebyshev",
    "chebyshev-u",
    "uniformization",
    "forward-euler",
    "crank-nicolson",
    "crank-nicolson-1",
    "backward-euler",
    "constdiff",
    "direct",
    "none",
];

/// Above this tolerance `chebyshev` keeps the kernel's variance exactly; below, the plain series is nearer to exp(Δ_T).
const MATCHED: f64 = 1e-3;
/// Tolerances from here on may be met by explicit Euler steps.
const LOOSE: f64 = 1e-2;
/// Normalised residual at which the implicit solves end (OpenFOAM's `tolerance`; the papers' baseline).
const SOLVED: f64 = 1e-6;
/// Steps of `backward-euler`.
const EULER_STEPS: usize = 4;

/// The smoother of that name; `diffusion`: T of each link of the mesh (m2), see [`Diffusion`].
pub fn by_name(name: &str, mesh: &Mesh, diffusion: &[f64], tolerance: f64) -> Option<Box<dyn Smoother>> {
    on(name, mesh, diffusion, &Arc::new(Graph::new(mesh, diffusion)), tolerance)
}

/// The smoother of that name and the positive one for steps that must be redone, on one graph.
pub fn pair(name: &str, mesh: &Mesh, diffusion: &[f64], tolerance: f64) -> Option<[Box<dyn Smoother>; 2]> {
    let graph = Arc::new(Graph::new(mesh, diffusion));
    let positive = if name == "none" { "none" } else { "uniformization" };
    let make = |name| on(name, mesh, diffusion, &graph, tolerance);
    Some([make(name)?, make(positive)?])
}

/// On a graph made already.
pub fn on(
    name: &str,
    mesh: &Mesh,
    t: &[f64],
    graph: &Arc<Graph>,
    tolerance: f64,
) -> Option<Box<dyn Smoother>> {
    let graph = Arc::clone(graph);
    Some(match name {
        DEFAULT => {
            // where cells are about as large as b, steps of Euler are nearer to the particles' Gaussians, positive and no dearer; but not
            // within 1e-2 of exp(Δ_T), should that be asked for
            let series = Polynomial::chebyshev(Arc::clone(&graph), tolerance, tolerance > MATCHED);
            let euler = tolerance >= LOOSE && Polynomial::euler_steps(&graph) <= series.degree() as f64;
            Box::new(if euler { Polynomial::forward_euler(graph) } else { series })
        }
        "chebyshev" => Box::new(Polynomial::chebyshev(graph, tolerance, tolerance > MATCHED)),
        "chebyshev-u" => Box::new(Polynomial::second_kind(graph, tolerance)),
        "uniformization" => Box::new(Polynomial::uniformization(graph, tolerance)),
        "forward-euler" => Box::new(Polynomial::forward_euler(graph)),
        "crank-nicolson" => Box::new(Implicit::new("crank-nicolson", mesh, t, 3, 0.5, SOLVED)),
        "crank-nicolson-1" => Box::new(Implicit::new("crank-nicolson-1", mesh, t, 1, 0.5, SOLVED)),
        "backward-euler" => Box::new(Implicit::new("backward-euler", mesh, t, EULER_STEPS, 1.0, SOLVED)),
        "constdiff" => Box::new(Implicit::new("constdiff", mesh, t, 1, 1.0, SOLVED)),
        "direct" => Box::new(Direct::new(mesh, t)?),
        "none" => Box::new(Unsmoothed),
        _ => return None,
    })
}
