// SPDX-License-Identifier: MIT OR Apache-2.0
//! Stage 7, coupling schemes: how the impulse of the coming interval is predicted for the fluid (design §2.2).
//!
//! J_i ≈ Δt [ C_i (ũ_i + d_i − v_i) + B_i ], ũ_i the gathered fluid velocity *after* the fluid step. Reads K (kg/s),
//! slip (m/s) and, if the scheme wants it, what the particle did in its last interval; writes C (kg/s) and B (N).
//! A conservative scheme leaves the rest to the ledger, so the third law holds whatever it predicts. The schemes of
//! Radl et al. 2014 replace Sp and Su cell by cell and have no ledger: their third-law error is measured and
//! reported. A new scheme implements `Scheme` in a file of its own and joins `all`. `docs/schemes.md` compares them.

mod adaptive;
mod conservative;
mod explicit;
mod filled;
mod history;
mod implicit;
mod split;
pub mod testbench;

pub use adaptive::ConservativeAdaptive;
pub use conservative::Conservative;
pub use explicit::Explicit;
pub use filled::ImplicitFilled;
pub use history::{History, Last};
pub use implicit::Implicit;
pub use split::Split;

use crate::step::Lanes;

/// What a scheme may look at for one particle, at the exchange before the fluid step.
#[derive(Clone, Copy, Debug)]
pub struct Before {
    /// K, kg/s
    pub drag_coefficient: f64,
    /// ũ + d − v with the fluid of the previous step, m/s
    pub slip: [f64; 3],
    /// particle mass, kg
    pub mass: f64,
    /// particle mass and added mass, kg
    pub inertia: f64,
    /// Δt, s
    pub period: f64,
    /// the last interval; `None` for a particle without one (first interval, just inserted)
    pub last: Option<Last>,
}

/// What a scheme may look at to form Sp and Su of the cells; by cell slot.
pub struct Cells<'a> {
    /// smoothed lanes of `linearise`: 1–3 −B, 4 K (C = 0 and no ledger here)
    pub smoothed: &'a [Lanes],
    /// smoothed ε_s (0) and ε_s U_s (1–3)
    pub solids: &'a [Lanes],
    /// ε_s and ε_s U_s as mapped, not smoothed; empty unless `wants_solids`
    pub mapped: &'a [Lanes],
    /// fluid velocity of the last step, m/s
    pub fluid: &'a [[f64; 3]],
    /// solids velocity continued into void cells with filled ones held fixed, m/s; `None`: the kernel's mean there
    pub pinned: Option<&'a [[f64; 3]]>,
}

/// How the drag impulse is split between fluid matrix and right-hand side.
pub trait Scheme: Sync {
    /// Name in case.toml.
    fn name(&self) -> &'static str;
    /// Paper and equation.
    fn source(&self) -> &'static str;
    /// True: what is charged plus the change of the ledger is what the DEM took, to rounding.
    fn conservative(&self) -> bool {
        true
    }
    /// True: the DEM sends what its last interval was (`History`).
    fn wants_history(&self) -> bool {
        false
    }
    /// True: the mapped and smoothed solids momentum is needed (`Cells`).
    fn wants_solids(&self) -> bool {
        false
    }
    /// True: C = K and B = 0 for every particle.
    fn wholly_implicit(&self) -> bool {
        false
    }
    /// C (kg/s, ≥ 0) and B (N).
    fn predict(&self, before: &Before) -> (f64, [f64; 3]);
    /// Sp (kg/(m3 s), ≥ 0) and Su (N/m3) of the cells, for a scheme that is not conservative.
    fn sources(&self, _cells: &Cells, _sp: &mut [f64], _su: &mut [[f64; 3]]) {}
}

/// All schemes.
pub fn all() -> &'static [&'static dyn Scheme] {
    &[&Conservative, &ConservativeAdaptive, &Explicit, &Implicit, &Split, &ImplicitFilled]
}

/// The scheme of that name.
pub fn by_name(name: &str) -> Option<&'static dyn Scheme> {
    all().iter().copied().find(|s| s.name() == name)
}
