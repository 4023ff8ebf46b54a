// SPDX-License-Identifier: MIT OR Apache-2.0
//! Deposit and gather of particles that lie between the eight centres of a block, in vectors of the machine at hand. Particles
//! of one cell follow each other: where there are several, the 27 cells around it are summed, or read, in one place.
//!
//! Reads hosts and places between centres; adds to cell fields or reads them. Which way a run goes depends on its length alone.

use super::linear::{Fraction, PLACE, ROOM, Rings, shares};
use crate::smooth::Real;
use crate::step::Lanes;
use pulp::{Simd, WithSimd};

/// From so many particles of one cell on it is less work to sum, or to copy, the 27 first.
const DENSE: usize = 6;

/// Fields of cells or particles, each in one line of the cache.
#[repr(align(64))]
pub struct Lines<const N: usize>(pub [Lanes; N]);

/// Where the particles from `at` on with the same host end.
#[inline(always)]
pub(super) fn run(host: &[u32], at: usize) -> usize {
    let mut end = at + 1;
    while end < host.len() && host[end] == host[at] {
        end += 1;
    }
    end
}

/// A run of cells that a deposit may write.
pub(super) struct Part<'a> {
    /// of all cells, m3
    pub volume: &'a [f64],
    /// its first cell
    pub from: usize,
    pub cells: &'a mut [Lanes],
}
impl Part<'_> {
    /// Adds m q / V to a cell, if it is one of the run.
    #[inline(always)]
    pub(super) fn add<S: Simd>(&mut self, s: S, cell: u32, m: f64, q: &Lanes) {
        if let Some(to) = self.cells.get_mut((cell as usize).wrapping_sub(self.from)) {
            axpy(s, m / self.volume[cell as usize], q, to);
        }
    }
}

/// Adds m q / V of each particle.
pub(super) struct Add<'a> {
    pub rings: &'a Rings,
    pub host: &'a [u32],
    pub fraction: &'a [Fraction],
    pub q: &'a [Lanes],
    pub part: Part<'a>,
}

/// `to` += share × q
#[inline(always)]
pub(super) fn axpy<S: Simd>(s: S, share: f64, q: &Lanes, to: &mut Lanes) {
    let share = s.splat_f64s(share);
    for (to, q) in f64::vectors_mut::<S>(to).iter_mut().zip(f64::vectors::<S>(q)) {
        *to = s.add_f64s(*to, s.mul_f64s(share, *q));
    }
}

impl WithSimd for Add<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(mut self, s: S) {
        let mut at = 0;
        let mut sum = Lines([[0.0; 8]; ROOM]);
        while at < self.host.len() {
            let (host, end) = (self.host[at], run(self.host, at));
            let particles = self.fraction[at..end].iter().zip(&self.q[at..end]);
            if end - at < DENSE {
                for (fraction, q) in particles {
                    let (cells, weights) = self.rings.eight(host, *fraction);
                    for c in 0..8 {
                        self.part.add(s, cells[c], weights[c], q);
                    }
                }
            } else {
                for (fraction, q) in particles {
                    let (octant, weights) = shares(*fraction);
                    for c in 0..8 {
                        axpy(s, weights[c], q, &mut sum.0[PLACE[octant][c] % ROOM]);
                    }
                }
                for (sum, offset) in sum.0[..27].iter_mut().zip(self.rings.ring(host)) {
                    self.part.add(s, host.wrapping_add_signed(*offset), 1.0, sum);
                    *sum = [0.0; 8];
                }
            }
            at = end;
        }
    }
}

/// Σ m φ of each particle.
pub(super) struct Gather<'a> {
    pub rings: &'a Rings,
    pub host: &'a [u32],
    pub fraction: &'a [Fraction],
    pub lanes: &'a [Lanes],
    pub out: &'a mut [Lanes],
}

impl Gather<'_> {
    #[inline(always)]
    fn one<'b, S: Simd>(s: S, fraction: Fraction, of: impl Fn(usize, usize) -> &'b Lanes, out: &mut Lanes) {
        let (octant, weights) = shares(fraction);
        // two sums, half as long to wait for
        let mut sum = Lines([[0.0; 8]; 2]);
        for c in 0..8 {
            axpy(s, weights[c], of(octant, c), &mut sum.0[c & 1]);
        }
        axpy(s, 1.0, &sum.0[1].clone(), &mut sum.0[0]);
        *out = sum.0[0];
    }
}

impl WithSimd for Gather<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, s: S) {
        let mut at = 0;
        let mut near = Lines([[0.0; 8]; ROOM]);
        while at < self.host.len() {
            let (host, end) = (self.host[at], run(self.host, at));
            let ring = self.rings.ring(host);
            let lanes = |k: usize| &self.lanes[host.wrapping_add_signed(ring[k % ROOM]) as usize];
            let particles = self.fraction[at..end].iter().zip(&mut self.out[at..end]);
            if end - at < DENSE {
                for (fraction, out) in particles {
                    Self::one(s, *fraction, |octant, c| lanes(PLACE[octant][c]), out);
                }
            } else {
                near.0[..27].iter_mut().enumerate().for_each(|(k, to)| *to = *lanes(k));
                for (fraction, out) in particles {
                    Self::one(s, *fraction, |octant, c| &near.0[PLACE[octant][c] % ROOM], out);
                }
            }
            at = end;
        }
    }
}
