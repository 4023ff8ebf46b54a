// SPDX-License-Identifier: MIT OR Apache-2.0
//! What must close in each exchange (design §3.1), as plain functions used by tests and the running coupler.
//!
//! Reads sums in SI units; does not know where they come from.

use crate::sums::norm;
use serde::{Deserialize, Serialize};

/// The action-reaction books of one exchange, N s.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Books {
    /// Σ impulse charged, from the coupler
    pub charged: [f64; 3],
    /// Σ old ledger given to the fluid
    pub old_ledger: [f64; 3],
    /// Σ impulse of external forces inside `charged` (Archimedes, mean pressure gradient): no reaction
    pub external: [f64; 3],
    /// Σ |charged + old ledger|
    pub scale: f64,
    /// Σ impulse the fluid reports to have given, from its own matrix and final fields
    pub reaction: [f64; 3],
}

impl Books {
    /// |action − reaction| / Σ|action|; 0/0 = 0. `charged_by_dem` replaces the coupler's own sum once the DEM
    /// has reported what it took minus what it kept in the ledger.
    pub fn error(&self, charged_by_dem: Option<[f64; 3]>) -> f64 {
        let charged = charged_by_dem.unwrap_or(self.charged);
        let gap = [0, 1, 2].map(|a| charged[a] + self.old_ledger[a] - self.external[a] - self.reaction[a]);
        ratio(norm(gap), self.scale)
    }
}

/// a / b with 0/0 = 0.
pub fn ratio(a: f64, b: f64) -> f64 {
    if a == 0.0 { 0.0 } else { a / b }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_unbalanced_book_shows() {
        let mut b =
            Books { charged: [2.0, 0.0, 0.0], reaction: [2.0, 0.0, 0.0], scale: 2.0, ..Books::default() };
        assert_eq!(b.error(None), 0.0);
        assert_eq!(b.error(Some([2.2, 0.0, 0.0])), 0.10000000000000009);
        b.external = [0.5, 0.0, 0.0];
        assert_eq!(b.error(None), 0.25);
        assert_eq!(Books::default().error(None), 0.0);
    }
}
