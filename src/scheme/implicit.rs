// SPDX-License-Identifier: MIT OR Apache-2.0
//! Implicit coupling of Radl et al. 2014, eq. 8: Sp = β, Su = β U_s, β the mean drag coefficient per volume, U_s the
//! mean velocity of the particles in the cell. Stable, but what the fluid gets is not what the particles take.
//!
//! U_s of filled cells is the mean of the particles mapped there and is not smoothed. Cells void of particles that β
//! still reaches take the mean weighted by the kernel, (G ε_s U_s)/(G ε_s), or, as in R, U_s continued into them by
//! diffusion with filled cells held fixed (`coupling.void_velocity = "pinned"`), which decays to zero away from the bed.

use super::{Before, Cells, Scheme};

/// R eq. 8.
pub struct Implicit;

/// Drag force of the last velocities, −Su of the explicit scheme; and β in lane 4 (`linearise`).
pub(super) fn explicit(before: &Before) -> (f64, [f64; 3]) {
    (0.0, before.slip.map(|s| before.drag_coefficient * s))
}

/// Mean velocity in a cell: of the particles mapped there, else of those whose kernel reaches it.
pub(super) fn solids_velocity(mapped: &[f64; 8], smoothed: &[f64; 8]) -> [f64; 3] {
    let of = |l: &[f64; 8]| if l[0] > 0.0 { [1, 2, 3].map(|a| l[a] / l[0]) } else { [0.0; 3] };
    if mapped[0] > 0.0 { of(mapped) } else { of(smoothed) }
}

impl Scheme for Implicit {
    fn name(&self) -> &'static str {
        "implicit"
    }
    fn source(&self) -> &'static str {
        "Radl et al. 2014, eq. 8"
    }
    fn conservative(&self) -> bool {
        false
    }
    fn wants_solids(&self) -> bool {
        true
    }
    fn predict(&self, before: &Before) -> (f64, [f64; 3]) {
        explicit(before)
    }
    fn sources(&self, cells: &Cells, sp: &mut [f64], su: &mut [[f64; 3]]) {
        for (j, l) in cells.smoothed.iter().enumerate() {
            let beta = l[4];
            sp[j] = beta;
            let u = match cells.pinned {
                Some(u) => u[j],
                None => solids_velocity(&cells.mapped[j], &cells.solids[j]),
            };
            su[j] = u.map(|u| beta * u);
        }
    }
}
