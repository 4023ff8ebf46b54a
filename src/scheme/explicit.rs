// SPDX-License-Identifier: MIT OR Apache-2.0
//! C = 0, B = K (ũ + d − v): drag from the previous fluid velocity. Stable only for Δt below τ_f, the relaxation time
//! of the fluid (R eq. 10).

use super::{Before, Scheme};

/// R's explicit coupling, with the ledger of design §2.2.
pub struct Explicit;

impl Scheme for Explicit {
    fn name(&self) -> &'static str {
        "explicit"
    }
    fn source(&self) -> &'static str {
        "Radl et al. 2014, eq. 6; with the ledger of design §2.2"
    }
    fn predict(&self, before: &Before) -> (f64, [f64; 3]) {
        (0.0, before.slip.map(|s| before.drag_coefficient * s))
    }
}
