// SPDX-License-Identifier: MIT OR Apache-2.0
//! Stage 7, linearise: from the prediction of one particle to its share of Sp and Su (design §2.2).
//!
//! Reads C (kg/s), B (N), u and v (m/s), L (N s); writes the eight lanes that are mapped and smoothed:
//! lane 0 C, lanes 1–3 −[C (u − v − (1 − θ) ũ) + B + L/Δt], lane 4 K. Does not know weights or cells.
//!
//! On the cell acts Su − Sp U^{n+1}, Su = lanes 1–3 + θ Sp U^n. With θ = 1 the cell is implicit in the *change* of its velocity
//! and gets, when steady, exactly the spread force of its particles, G[C ũ]; with θ = 0 it is dragged by its own U, and
//! C (U − ũ) spread by w is a viscosity of β b²/2 (β = Sp), many times the fluid's. But U then answers the noise of the deposit,
//! damped by G, with 1/G²: in dense beds it rings. In general a mode answers with G/(1 − θ + θ G²); θ = 1/2 is the largest that
//! amplifies no mode. The books close for any θ, and no mode overshoots: for w ≥ 0
//! Σ_i C_i (Σ_j V_j w_ij U_j)² ≤ Σ_j V_j Sp_j U_j² (Jensen).

use crate::scheme::{Before, Scheme};

/// θ: share of the drag's level that acts at the gathered velocity.
pub const LEVEL: f64 = 0.5;

/// The predicted drag of one particle: Δt [ C (ũ + d − v) + B ].
#[derive(Clone, Copy, Debug, Default)]
pub struct Predicted {
    /// K, kg/s: what the DEM uses in its interval
    pub drag_coefficient: f64,
    /// C, kg/s
    pub implicit: f64,
    /// B, N
    pub explicit: [f64; 3],
    /// d = u − ũ, m/s: lets any interpolation enter the drag without touching the third law
    pub defect: [f64; 3],
    /// u − v − (1 − θ) ũ with the fluid of the last step, m/s
    pub known: [f64; 3],
}

impl Predicted {
    /// What the scheme makes of `before`, with ũ (m/s) of the last step.
    pub fn new(scheme: &dyn Scheme, before: &Before, defect: [f64; 3], gathered: [f64; 3]) -> Self {
        let (implicit, explicit) = scheme.predict(before);
        let rest = 1.0 - LEVEL;
        let known = [0, 1, 2].map(|a| before.slip[a] - rest * gathered[a]);
        Self { drag_coefficient: before.drag_coefficient, implicit, explicit, defect, known }
    }
}

/// Lanes of Sp (0, kg/s), Su − θ Sp U^n (1–3, N) and K (4, kg/s) of one particle; `period` Δt in s.
pub fn linearise(q: &Predicted, ledger: [f64; 3], period: f64) -> [f64; 8] {
    let su = [0, 1, 2].map(|a| -q.implicit * q.known[a] - q.explicit[a] - ledger[a] / period);
    [q.implicit, su[0], su[1], su[2], q.drag_coefficient, 0.0, 0.0, 0.0]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scheme::Last;

    #[test]
    fn fluid_gets_back_what_the_particle_is_charged_and_the_old_ledger() {
        let (v, ledger, dt, u) = ([1.0, -2.0, 0.5], [1e-3, 0.0, -2e-3], 1e-2, [3.0, 0.1, 0.2]);
        let last =
            Last { drag_coefficient: 0.5, slip: [1.0, 2.0, 0.3], drag_impulse: [1e-3; 3], mobility: 0.3 };
        for scheme in crate::scheme::all().iter().filter(|s| s.conservative()) {
            let (slip, d) = ([2.0, 1.0, 0.0], [0.1, 0.2, 0.3]);
            // u^n = slip + v; in one cell, so the gathered velocity is that of the cell
            let gathered = [0, 1, 2].map(|a| slip[a] + v[a] - d[a]);
            let before = Before { drag_coefficient: 0.7, slip, inertia: 0.01, period: dt, last: Some(last) };
            let q = Predicted::new(*scheme, &before, d, gathered);
            let s = linearise(&q, ledger, dt);
            for a in 0..3 {
                let cell = LEVEL * gathered[a];
                let on_fluid = dt * (s[1 + a] + s[0] * cell - s[0] * u[a]);
                let charged = dt * (q.implicit * (u[a] + q.defect[a] - v[a]) + q.explicit[a]);
                assert!((on_fluid + charged + ledger[a]).abs() < 1e-15);
            }
            assert!(s[0] >= 0.0);
        }
    }
}
