// SPDX-License-Identifier: MIT OR Apache-2.0
//! Filling weights cell by cell: for each particle any number of `push` and one `close`.

use super::Weights;
use crate::mesh::NONE;
use crate::threads;
use std::ops::Range;

/// Particles filled by one thread at a time.
const PIECE: usize = 4096;

impl Weights {
    /// Weights of all particles with a host, piece by piece on all threads: `one(scratch, i, host, weights)` pushes the cells of
    /// particle i and closes it.
    pub fn fill<S: Default>(&mut self, host: &[u32], one: impl Fn(&mut S, usize, u32, &mut Self) + Sync) {
        let run = |range: Range<usize>, out: &mut Self| {
            let mut scratch = S::default();
            for i in range {
                if host[i] == NONE { out.close() } else { one(&mut scratch, i, host[i], out) }
            }
        };
        self.clear();
        if threads::count() == 1 {
            return run(0..host.len(), self);
        }
        let parts = threads::map(threads::pieces(host.len(), PIECE), |range| {
            let mut part = Self::default();
            part.clear();
            run(range, &mut part);
            part
        });
        for part in parts {
            let from = self.cell.len() as u32;
            self.start.extend(part.start[1..].iter().map(|s| s + from));
            self.cell.extend(part.cell);
            self.weight.extend(part.weight);
        }
    }
    /// No particles.
    pub fn clear(&mut self) {
        self.near = None;
        self.around.clear();
        self.span.clear();
        self.start.clear();
        self.cell.clear();
        self.weight.clear();
        self.start.push(0);
    }
    /// All particles by their hosts alone.
    pub fn by_hosts(&mut self, host: &[u32]) {
        self.clear();
        self.start.clear();
        self.cell.extend_from_slice(host);
    }
    /// A cell of the particle being filled.
    #[inline]
    pub fn push(&mut self, cell: u32, weight: f64) {
        self.cell.push(cell);
        self.weight.push(weight);
    }
    /// Ends the particle.
    #[inline]
    pub fn close(&mut self) {
        self.start.push(self.cell.len() as u32);
    }
    /// Ends the particle after scaling its weights to Σ = 1.
    pub fn close_scaled(&mut self) {
        let from = self.start.last().copied().unwrap_or(0) as usize;
        let sum: f64 = self.weight[from..].iter().sum();
        self.weight[from..].iter_mut().for_each(|w| *w /= sum);
        self.close();
    }
}
