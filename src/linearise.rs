// SPDX-License-Identifier: MIT OR Apache-2.0
//! Stage 7, linearise: from the prediction of one particle to its share of Sp and Su (design §2.2).
//!
//! Reads C (kg/s), B (N), u and v (m/s), L (N s); writes the eight lanes that are mapped and smoothed:
//! lane 0 C, lanes 1–3 −[C (u − v − (1 − θ) ũ) + B + L/Δt], lane 4 K. Does not know weights or cells.
//!
//! On the cell acts Su − Sp U^{n+1}, Su = lanes 1–3 + θ Sp U^n. With θ = 1 the cell is implicit in the *change* of its velocity
//! and gets, when steady, exactly the spread force of its particles, G[C ũ]; with θ = 0 it is dragged by its own U, and
//! C (U − ũ) spread by w is a viscosity of β b²/2 (β = Sp), many times the fluid's. But U then answers the noise of the deposit,
//! damped by G, with 1/G²: in dense beds it rings. In general a mode answers with G/(1 − θ + θ G²): at most 1 for θ ≤ 1/2, at
//! most 1.02 for θ = 0.6 (docs/schemes.md). The books close for any θ, and no mode overshoots: for w ≥ 0
//! Σ_i C_i (Σ_j V_j w_ij U_j)² ≤ Σ_j V_j Sp_j U_j² (Jensen).

use crate::scheme::{Before, Scheme};
use crate::threads;

/// θ: share of the drag's level that acts at the gathered velocity.
pub const LEVEL: f64 = 0.6;

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
    #[inline(always)]
    pub fn new(scheme: &dyn Scheme, before: &Before, defect: [f64; 3], gathered: [f64; 3]) -> Self {
        let (implicit, explicit) = scheme.predict(before);
        let rest = 1.0 - LEVEL;
        let known = [0, 1, 2].map(|a| before.slip[a] - rest * gathered[a]);
        Self { drag_coefficient: before.drag_coefficient, implicit, explicit, defect, known }
    }
}

/// The predictions of all particles, by array: what a run leaves out takes no memory and reads as zero.
#[derive(Clone, Debug, Default)]
pub struct Predictions {
    drag_coefficient: Vec<f64>,
    known: Vec<[f64; 3]>,
    /// empty: C = K
    implicit: Vec<f64>,
    /// empty: B = 0
    explicit: Vec<[f64; 3]>,
    /// empty: d = 0
    defect: Vec<[f64; 3]>,
}

/// Which arrays a run needs beside K and what is known.
#[derive(Clone, Copy, Debug)]
pub struct Kept {
    /// C differs from K
    pub implicit: bool,
    /// there is a B
    pub explicit: bool,
    /// u is not the gathered velocity
    pub defect: bool,
}

/// A run of particles to write to.
pub struct Part<'a> {
    drag_coefficient: &'a mut [f64],
    known: &'a mut [[f64; 3]],
    implicit: &'a mut [f64],
    explicit: &'a mut [[f64; 3]],
    defect: &'a mut [[f64; 3]],
}

impl Predictions {
    /// Room for `n` particles, of which those from `inside` on act on nothing.
    pub fn fit(&mut self, n: usize, inside: usize, kept: Kept) {
        fn fit<T: Clone + Default>(array: &mut Vec<T>, n: usize, inside: usize, kept: bool) {
            array.resize(if kept { n } else { 0 }, T::default());
            if kept {
                array[inside..].fill(T::default());
            }
        }
        fit(&mut self.drag_coefficient, n, inside, true);
        fit(&mut self.known, n, inside, true);
        fit(&mut self.implicit, n, inside, kept.implicit);
        fit(&mut self.explicit, n, inside, kept.explicit);
        fit(&mut self.defect, n, inside, kept.defect);
    }
    /// Cut at `ends` (ascending).
    pub fn parts(&mut self, ends: impl Iterator<Item = usize> + Clone) -> Vec<Part<'_>> {
        let scalars = [&mut self.drag_coefficient, &mut self.implicit].map(|a| threads::cut(a, ends.clone()));
        let vectors =
            [&mut self.known, &mut self.explicit, &mut self.defect].map(|a| threads::cut(a, ends.clone()));
        let ([drag, implicit], [known, explicit, defect]) = (scalars, vectors);
        let all = drag.into_iter().zip(implicit).zip(known).zip(explicit).zip(defect);
        let part = |((((drag_coefficient, implicit), known), explicit), defect)| Part {
            drag_coefficient,
            known,
            implicit,
            explicit,
            defect,
        };
        all.map(part).collect()
    }
    /// Of particle i.
    #[inline(always)]
    pub fn of(&self, i: usize) -> Predicted {
        let drag_coefficient = self.drag_coefficient[i];
        Predicted {
            drag_coefficient,
            implicit: if self.implicit.is_empty() { drag_coefficient } else { self.implicit[i] },
            explicit: if self.explicit.is_empty() { [0.0; 3] } else { self.explicit[i] },
            defect: if self.defect.is_empty() { [0.0; 3] } else { self.defect[i] },
            known: self.known[i],
        }
    }
    /// Adds a force (N) to B of particle i.
    pub fn add(&mut self, i: usize, force: [f64; 3]) {
        (0..3).for_each(|a| self.explicit[i][a] += force[a]);
    }
}

impl Part<'_> {
    /// Number of particles.
    #[allow(clippy::len_without_is_empty)]
    pub fn len(&self) -> usize {
        self.known.len()
    }
    /// Writes particle k of the run.
    #[inline(always)]
    pub fn set(&mut self, k: usize, q: &Predicted) {
        (self.drag_coefficient[k], self.known[k]) = (q.drag_coefficient, q.known);
        if !self.implicit.is_empty() {
            self.implicit[k] = q.implicit;
        }
        if !self.explicit.is_empty() {
            self.explicit[k] = q.explicit;
        }
        if !self.defect.is_empty() {
            self.defect[k] = q.defect;
        }
    }
}

/// Lanes of Sp (0, kg/s), Su − θ Sp U^n (1–3, N) and K (4, kg/s) of one particle; `period` Δt in s.
#[inline(always)]
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
            let before = Before {
                drag_coefficient: 0.7,
                slip,
                mass: 0.01,
                inertia: 0.01,
                period: dt,
                last: Some(last),
            };
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
