// SPDX-License-Identifier: MIT OR Apache-2.0
//! Coupling schemes: how the impulse of the coming interval is predicted for the fluid (design §2.2).
//!
//! J_i ≈ Δt [ C_i (ũ_i + d_i − v_i) + B_i ], ũ_i the gathered fluid velocity *after* the fluid step. Whatever
//! a scheme predicts, the ledger carries the rest, so every scheme here keeps the third law.

/// What a scheme may look at for one particle, at the exchange before the fluid step.
#[derive(Clone, Copy, Debug)]
pub struct Before {
    /// K, kg/s
    pub drag_coefficient: f64,
    /// ũ + d − v with the fluid of the previous step, m/s
    pub slip: [f64; 3],
}

/// How the drag impulse is split between fluid matrix and right-hand side.
pub trait Scheme: Sync {
    /// Name in case.toml.
    fn name(&self) -> &'static str;
    /// Paper and equation.
    fn source(&self) -> &'static str;
    /// C (kg/s, ≥ 0) and B (N).
    fn predict(&self, before: &Before) -> (f64, [f64; 3]);
}

/// C = K, B = 0: drag implicit in the coming fluid velocity, exact when steady.
pub struct Conservative;

impl Scheme for Conservative {
    fn name(&self) -> &'static str {
        "conservative"
    }
    fn source(&self) -> &'static str {
        "design §2.2, first choice of (C, B)"
    }
    fn predict(&self, before: &Before) -> (f64, [f64; 3]) {
        (before.drag_coefficient, [0.0; 3])
    }
}

/// C = 0, B = K (ũ + d − v): drag from the previous fluid velocity, stable only for Δt below τ_f (R eq. 10).
pub struct Explicit;

impl Scheme for Explicit {
    fn name(&self) -> &'static str {
        "explicit"
    }
    fn source(&self) -> &'static str {
        "Radl et al. 2014, explicit coupling; with the ledger of design §2.2"
    }
    fn predict(&self, before: &Before) -> (f64, [f64; 3]) {
        (0.0, before.slip.map(|s| before.drag_coefficient * s))
    }
}

/// All schemes.
pub fn all() -> &'static [&'static dyn Scheme] {
    &[&Conservative, &Explicit]
}

/// The scheme of that name.
pub fn by_name(name: &str) -> Option<&'static dyn Scheme> {
    all().iter().copied().find(|s| s.name() == name)
}
