// SPDX-License-Identifier: MIT OR Apache-2.0
//! Deposit and gather of particles that lie wholly in their host cell, or that go to a list of cells, in vectors of the machine
//! at hand.

use super::Weights;
use super::near::{Part, axpy, run};
use crate::step::Lanes;
use pulp::{Simd, WithSimd};

/// Adds Σ q / V of the particles of each cell.
pub(super) struct AddWhole<'a> {
    pub host: &'a [u32],
    pub q: &'a [Lanes],
    pub part: Part<'a>,
}
impl WithSimd for AddWhole<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(mut self, s: S) {
        let mut at = 0;
        while at < self.host.len() {
            let (end, mut sum) = (run(self.host, at), [0.0; 8]);
            self.q[at..end].iter().for_each(|q| axpy(s, 1.0, q, &mut sum));
            self.part.add(s, self.host[at], 1.0, &sum);
            at = end;
        }
    }
}

/// Adds m q / V of each particle from `first` on.
pub(super) struct Add<'a> {
    pub weights: &'a Weights,
    pub first: usize,
    pub q: &'a [Lanes],
    pub part: Part<'a>,
}
impl WithSimd for Add<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(mut self, s: S) {
        for (i, q) in (self.first..).zip(self.q) {
            for (cell, m) in self.weights.entries(i) {
                self.part.add(s, cell, m, q);
            }
        }
    }
}

/// Σ m φ of each particle from `first` on.
pub(super) struct Gather<'a> {
    pub weights: &'a Weights,
    pub first: usize,
    pub lanes: &'a [Lanes],
    pub out: &'a mut [Lanes],
}
impl WithSimd for Gather<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, s: S) {
        for (i, out) in (self.first..).zip(self.out) {
            let mut sum = [0.0; 8];
            for (cell, m) in self.weights.entries(i) {
                axpy(s, m, &self.lanes[cell as usize], &mut sum);
            }
            *out = sum;
        }
    }
}
