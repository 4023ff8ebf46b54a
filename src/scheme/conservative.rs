// SPDX-License-Identifier: MIT OR Apache-2.0
//! C = K, B = 0: drag implicit in the coming fluid velocity; exact when steady, stable at any Δt/τ_p and loading, but
//! the fluid reacts about x = Δt/τ_p steps late when x ≫ 1 and particles are free.

use super::{Before, Scheme};

/// First choice of (C, B) of design §2.2.
pub struct Conservative;

impl Scheme for Conservative {
    fn name(&self) -> &'static str {
        "conservative"
    }
    fn source(&self) -> &'static str {
        "design §2.2, C = K, B = 0, with ledger"
    }
    fn wholly_implicit(&self) -> bool {
        true
    }
    fn predict(&self, before: &Before) -> (f64, [f64; 3]) {
        (before.drag_coefficient, [0.0; 3])
    }
}
