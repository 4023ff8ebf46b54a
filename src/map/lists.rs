// SPDX-License-Identifier: MIT OR Apache-2.0
//! Deposit and gather of particles that lie wholly in their host cell, or that go to a list of cells, in vectors of the machine
//! at hand.

use super::Weights;
use super::near::{axpy, run};
use crate::smooth::Real;
use crate::step::Lanes;
use pulp::{Simd, WithSimd};

/// Adds Σ q / V of the particles of each cell to those from `from` on that `part` holds.
pub(super) struct AddWhole<'a> {
    pub volume: &'a [f64],
    pub host: &'a [u32],
    pub q: &'a [Lanes],
    pub from: usize,
    pub part: &'a mut [Lanes],
}
impl WithSimd for AddWhole<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, s: S) {
        let mut at = 0;
        while at < self.host.len() {
            let (host, end) = (self.host[at] as usize, run(self.host, at));
            let mut sum = [0.0; 8];
            for q in &self.q[at..end] {
                for (sum, q) in f64::vectors_mut::<S>(&mut sum).iter_mut().zip(f64::vectors::<S>(q)) {
                    *sum = s.add_f64s(*sum, *q);
                }
            }
            axpy(s, 1.0 / self.volume[host], &sum, &mut self.part[host - self.from]);
            at = end;
        }
    }
}

/// Adds m q / V of each particle to the cells from `from` on that `part` holds.
pub(super) struct Add<'a> {
    /// first entry of each particle; one more at the end
    pub start: &'a [u32],
    pub weights: &'a Weights,
    pub volume: &'a [f64],
    pub q: &'a [Lanes],
    pub from: usize,
    pub part: &'a mut [Lanes],
}
impl WithSimd for Add<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, s: S) {
        for (i, q) in self.q.iter().enumerate() {
            let entries = self.start[i] as usize..self.start[i + 1] as usize;
            for (cell, m) in self.weights.cell[entries.clone()].iter().zip(&self.weights.weight[entries]) {
                if let Some(to) = self.part.get_mut((*cell as usize).wrapping_sub(self.from)) {
                    axpy(s, m / self.volume[*cell as usize], q, to);
                }
            }
        }
    }
}

/// Σ m φ of each particle.
pub(super) struct Gather<'a> {
    /// first entry of each particle; one more at the end
    pub start: &'a [u32],
    pub weights: &'a Weights,
    pub lanes: &'a [Lanes],
    pub out: &'a mut [Lanes],
}
impl WithSimd for Gather<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, s: S) {
        for (i, out) in self.out.iter_mut().enumerate() {
            let (entries, mut sum) = (self.start[i] as usize..self.start[i + 1] as usize, [0.0; 8]);
            for (cell, m) in self.weights.cell[entries.clone()].iter().zip(&self.weights.weight[entries]) {
                axpy(s, *m, &self.lanes[*cell as usize], &mut sum);
            }
            *out = sum;
        }
    }
}
