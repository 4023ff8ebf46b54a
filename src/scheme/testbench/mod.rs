// SPDX-License-Identifier: MIT OR Apache-2.0
//! A fluid and a particle program in miniature, around the real coupling step: where is a scheme stable, does it keep
//! the third law, is its steady drag right, and how far is it from a resolved solution?
//!
//! A periodic column of cells; the fluid's momentum equation without pressure and viscosity, ρ ∂U/∂t = Su − Sp U + f;
//! Stokes particles whose interval is integrated as the fix does it (`dem`). Everything is linear, so the map over
//! x = Δt/τ_p, mass loading and cell size / particle diameter is complete. `docs/schemes.md` has its results,
//! `examples/extremes.rs` makes them. Nothing here is used by a coupled run.

mod bench;
mod column;
mod dem;
mod plot;
mod reference;
mod survey;

pub use bench::{Bench, Step};
pub use column::column;
pub use plot::svg;
pub use reference::Resolved;
pub use survey::{CELLS, LOADINGS, Outcome, RATIOS, Row, csv, measure, survey};

use super::Scheme;

/// What the particles do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// moved by the fluid alone; it starts at U0, they at rest
    Free,
    /// under weight, borne by the fluid; all starts at rest
    Settling,
    /// at rest whatever the fluid does; a body force brings it to U0
    Held,
    /// each held with probability ½ in each interval, which the coupler cannot know before
    RandomlyHeld,
}

impl Mode {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Free, Self::Settling, Self::Held, Self::RandomlyHeld];
    /// For tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Free => "free",
            Self::Settling => "settling",
            Self::Held => "held",
            Self::RandomlyHeld => "randomly held",
        }
    }
}

/// One point of the map.
#[derive(Clone, Copy)]
pub struct Point {
    /// the scheme
    pub scheme: &'static dyn Scheme,
    /// what the particles do
    pub mode: Mode,
    /// x = Δt/τ_p
    pub ratio: f64,
    /// particle mass ÷ fluid mass
    pub loading: f64,
    /// cell size ÷ particle diameter
    pub cell: f64,
    /// start where drag and force balance
    pub steady: bool,
    /// particles keep their places (for comparison with `Resolved`)
    pub fixed: bool,
}

/// Δt, s
pub(super) const PERIOD: f64 = 1e-3;
/// ρ_f, kg/m3
pub(super) const DENSITY: f64 = 1.2;
/// d, m
pub(super) const DIAMETER: f64 = 1e-3;
/// DEM steps per interval
pub(super) const INTERVAL: usize = 10;
/// Number of cells of the column
pub(super) const LENGTH: usize = 16;
/// Number of particles
pub(super) const PARTICLES: usize = 48;
/// b/d
pub(super) const BANDWIDTH: f64 = 3.0;
/// mean ε_s
pub(super) const SOLID_FRACTION: f64 = 0.2;
