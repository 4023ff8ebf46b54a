// SPDX-License-Identifier: MIT OR Apache-2.0
//! A polynomial by its factors, one after the other, in place:
//!
//!   real root r of p(X):      x ← x − τ A x,             τ = σ / (1 − r)
//!   roots u ± i v:            x ← x − s A x + t A² x,    s = 2 (1 − u) σ / n, t = σ² / n, n = (1 − u)² + v²
//!
//! with X = 1 − σ A. A sweep of a real root reads a field and writes another, 128 bytes per cell in f64 and the row;
//! a pair takes two sweeps, 160 bytes on average: the recurrence takes 256. One field of scratch.
//! Every factor is 1 at A = 0: constants and Σ V φ are kept to rounding whatever the roots are.

use super::blocked::{self, Step};
use super::factors::Factor;
use super::graph::{Graph, Rows};
use super::real::Real;
use super::recurrence::copy;
use super::sweep::reach;
use super::{Active, Direction};

/// Factors in the order they are applied, and σ.
#[derive(Clone, Debug)]
pub(super) struct Product {
    pub factors: Vec<Factor>,
    pub scale: f64,
}

impl Product {
    /// Number of sweeps.
    pub fn degree(&self) -> usize {
        self.factors.iter().map(Factor::degree).sum()
    }

    /// Applies the polynomial to `field` (in the order of rows). The result is in `field`.
    pub fn apply<T: Real>(
        &self,
        rows: &Rows<T>,
        field: &mut [[T; 8]],
        active: &Active,
        direction: Direction,
        spare: &mut [[T; 8]],
    ) {
        let (m, mut steps) = (self.degree(), Vec::new());
        let mut next = |add, factors| {
            // written for the first time: far rows must read as zero in a spread
            let zero = if direction != Direction::Gather && steps.is_empty() { m as u16 + 1 } else { 0 };
            let reach = reach(direction, m, steps.len() + 1) as u16;
            steps.push(Step { add, factors, reach, zero });
        };
        for f in &self.factors {
            match *f {
                Factor::Real { root } => next(false, [1.0, -self.scale / (1.0 - root), 0.0, 0.0]),
                Factor::Pair { real, imaginary } => {
                    let n = (1.0 - real).powi(2) + imaginary.powi(2);
                    let (first, second) = (2.0 * (1.0 - real) * self.scale / n, self.scale.powi(2) / n);
                    next(false, [0.0, 1.0, 0.0, 0.0]);
                    next(true, [-first, second, 0.0, 1.0]);
                }
            }
        }
        blocked::run(rows, active, &steps, [&mut *field, &mut *spare]);
        if m % 2 == 1 {
            copy(spare, field, active, reach(direction, m, m));
        }
    }

    /// Bytes that must move between memory and the core in one application in f64: fields once per sweep, rows once.
    pub fn bytes(&self, graph: &Graph, active: &Active, direction: Direction) -> f64 {
        let (m, mut done, mut sum) = (self.degree(), 0, 0.0);
        let mut sweep = |fields| {
            done += 1;
            sum += graph.bytes(active, reach(direction, m, done), fields);
        };
        for f in &self.factors {
            sweep(2);
            if f.degree() == 2 {
                sweep(3);
            }
        }
        if m % 2 == 1 {
            sum += 128.0 * active.rows_within(reach(direction, m, m), graph.len()) as f64;
        }
        sum
    }
}
