// SPDX-License-Identifier: MIT OR Apache-2.0
//! Implicit coupling with the explicit remainder (Radl et al. 2012, "split impl./expl." of R): the cell gets the drag
//! of the last velocities F, and β times the change of its own velocity: F + β (U^{n+1} − U^n). The solids velocity
//! drops out: Sp = β, Su = β U^n − F. Equal to the sum of the particle forces at t^n; not conservative beyond that.

use super::{Before, Cells, Scheme, implicit};

/// Implicit with the explicit remainder.
pub struct Split;

impl Scheme for Split {
    fn name(&self) -> &'static str {
        "split"
    }
    fn source(&self) -> &'static str {
        "Radl et al. 2014, eqs. 6 and 8, split after Radl et al. 2012"
    }
    fn conservative(&self) -> bool {
        false
    }
    fn predict(&self, before: &Before) -> (f64, [f64; 3]) {
        implicit::explicit(before)
    }
    fn sources(&self, cells: &Cells, sp: &mut [f64], su: &mut [[f64; 3]]) {
        for (j, l) in cells.smoothed.iter().enumerate() {
            sp[j] = l[4];
            su[j] = [0, 1, 2].map(|a| l[4] * cells.fluid[j][a] + l[1 + a]);
        }
    }
}
