// SPDX-License-Identifier: MIT OR Apache-2.0
//! Averaging in time by an exponential kernel (Sun & Xiao 2015, eqs. 11–14): ⟨φ⟩ⁿ = (1 − α) φⁿ + α ⟨φ⟩ⁿ⁻¹,
//! α = 1/(1 + Δt/b_t), first order in Δt/b_t.
//!
//! The step applies it to ε_s after smoothing in space; the last mean is one minus the last voidage, so nothing else is
//! kept, restarted or recorded. What it does to conservation: the solids are where they were over the past b_t; their
//! volume is kept while none comes or goes (`solid_volume_error` of monitor.csv tells when not). Sp, Su and the gather are not averaged:
//! drag and every explicit force keep action = −reaction. In model A the fluid has −⟨ε_s⟩(∇p − ∇·τ), the particles the share of
//! the ε_s of now: the difference is the third law's error (`action_reaction_error`). Model B has no such term. The mean
//! ε_s and its rate fit each other in the fluid's continuity; a solids flux of now would not fit them.

/// A running mean; of one value per cell, kept by its user.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TimeAverage {
    alpha: f64,
}

impl TimeAverage {
    /// Time step and bandwidth in time b_t, s; `None` without one.
    pub fn new(step: f64, bandwidth: f64) -> Option<Self> {
        (bandwidth > 0.0).then(|| Self { alpha: 1.0 / (1.0 + step / bandwidth) })
    }
    /// The mean from the value of now and the last mean.
    #[inline]
    pub fn next(self, now: f64, last: f64) -> f64 {
        (1.0 - self.alpha) * now + self.alpha * last
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_jump_is_forgotten_over_the_bandwidth() {
        // eq. 12: d⟨φ⟩/dt = (φ − ⟨φ⟩)/b_t, ⟨φ⟩ = 1 − e^{−t/b_t}; eq. 13 is its backward Euler step
        for (dt, allowed) in [(1e-2, 2e-3), (1e-3, 2e-4)] {
            let a = TimeAverage::new(dt, 1.0).unwrap();
            let (mut mean, steps) = (0.0, (1.0f64 / dt).round() as usize);
            (0..steps).for_each(|_| mean = a.next(1.0, mean));
            let exact = 1.0 - (-1.0f64).exp();
            assert!((mean - exact).abs() < allowed, "{dt}: {mean} {exact}");
        }
        assert_eq!(TimeAverage::new(1.0, 0.0), None);
        assert!((TimeAverage::new(1e-3, 0.05).unwrap().next(0.3, 0.3) - 0.3).abs() < 1e-15);
    }
}
