// SPDX-License-Identifier: MIT OR Apache-2.0
//! R's variant without a solids velocity outside the bed: implicit (eq. 8) in cells that hold particles, explicit
//! (eq. 6) in cells void of particles.

use super::{Before, Cells, Scheme, implicit};

/// Implicit in filled cells, explicit elsewhere.
pub struct ImplicitFilled;

impl Scheme for ImplicitFilled {
    fn name(&self) -> &'static str {
        "implicit-filled"
    }
    fn source(&self) -> &'static str {
        "Radl et al. 2014, eq. 8 in filled cells, eq. 6 in void ones"
    }
    fn conservative(&self) -> bool {
        false
    }
    fn wants_solids(&self) -> bool {
        true
    }
    fn predict(&self, before: &Before) -> (f64, [f64; 3]) {
        implicit::explicit(before)
    }
    fn sources(&self, cells: &Cells, sp: &mut [f64], su: &mut [[f64; 3]]) {
        for (j, l) in cells.smoothed.iter().enumerate() {
            let mapped = &cells.mapped[j];
            (sp[j], su[j]) = if mapped[0] > 0.0 {
                (l[4], implicit::solids_velocity(mapped, mapped).map(|u| l[4] * u))
            } else {
                (0.0, [l[1], l[2], l[3]])
            };
        }
    }
}
