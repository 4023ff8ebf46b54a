// SPDX-License-Identifier: MIT OR Apache-2.0
//! Filling weights particle by particle: `clear`, then for each particle any number of `push` and one `close`.

use super::Weights;

impl Weights {
    /// No particles.
    pub fn clear(&mut self) {
        self.start.clear();
        self.cell.clear();
        self.weight.clear();
        self.start.push(0);
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
