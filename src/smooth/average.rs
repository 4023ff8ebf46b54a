// SPDX-License-Identifier: MIT OR Apache-2.0
//! Averaging in time by an exponential kernel (Sun & Xiao 2015, eqs. 11–14): ⟨φ⟩ⁿ = (1 − α) φⁿ + α ⟨φ⟩ⁿ⁻¹,
//! α = 1/(1 + Δt/b_t). The mean lags behind: Σ V ⟨φ⟩ is that of the past, so it is for fields that need not balance.

use crate::step::Lanes;

/// A running mean of cell fields.
#[derive(Clone, Debug, Default)]
pub struct TimeAverage {
    mean: Vec<Lanes>,
    alpha: f64,
}

impl TimeAverage {
    /// Time step and bandwidth in time, s.
    pub fn new(step: f64, bandwidth: f64) -> Self {
        Self { mean: Vec::new(), alpha: if bandwidth > 0.0 { 1.0 / (1.0 + step / bandwidth) } else { 0.0 } }
    }
    /// Replaces the fields by their mean; the first fields start it.
    pub fn apply(&mut self, lanes: &mut [Lanes]) {
        if self.mean.len() != lanes.len() {
            self.mean = lanes.to_vec();
        }
        for (mean, now) in self.mean.iter_mut().zip(lanes) {
            (0..8).for_each(|l| mean[l] = (1.0 - self.alpha) * now[l] + self.alpha * mean[l]);
            *now = *mean;
        }
    }
}
