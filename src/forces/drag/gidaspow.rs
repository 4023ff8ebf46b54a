// SPDX-License-Identifier: MIT OR Apache-2.0
//! Ergun's packed bed, Wen & Yu's suspension, and Gidaspow's ways to put them together.

use super::power;
use crate::forces::{DragLaw, Slip};
use std::f64::consts::PI;

/// Ergun with the diameter φ_s d; type A.
#[inline]
fn ergun(s: &Slip, sphericity: f64) -> f64 {
    let (e, d) = (s.voidage, sphericity * s.diameter);
    let viscous = 150.0 * (1.0 - e) * s.kinematic_viscosity / (e * d * d);
    s.volume() * s.density * (viscous + 1.75 * s.speed / d)
}

/// Wen & Yu; `newton`: C_d = 0.44 above Re = 1000.
#[inline]
fn wen_yu(s: &Slip, newton: bool) -> f64 {
    let (log, re) = (s.voidage.ln(), s.voidage * s.reynolds());
    if newton && re > 1000.0 {
        return s.volume() * 0.75 * 0.44 * s.density * s.speed * (-1.65 * log).exp() / s.diameter;
    }
    s.stokes() * (1.0 + 0.15 * power(re, 0.687)) * (-2.65 * log).exp()
}

/// Ergun 1952; for packed beds: tends to zero in a dilute flow.
pub struct Ergun;

impl DragLaw for Ergun {
    fn name(&self) -> &'static str {
        "ergun"
    }
    fn source(&self) -> &'static str {
        "Ergun 1952, Chem. Eng. Prog. 48, 89"
    }
    fn drag_coefficient(&self, s: &Slip) -> f64 {
        ergun(s, 1.0)
    }
}

/// Wen & Yu 1966 with C_d of Schiller & Naumann, 0.44 above Re = 1000.
pub struct WenYu;

impl DragLaw for WenYu {
    fn name(&self) -> &'static str {
        "wen-yu"
    }
    fn source(&self) -> &'static str {
        "Wen & Yu 1966, Chem. Eng. Prog. Symp. Ser. 62, 100"
    }
    fn drag_coefficient(&self, s: &Slip) -> f64 {
        wen_yu(s, true)
    }
}

/// Gidaspow 1994: Ergun up to a voidage, Wen & Yu above; discontinuous there, as published.
pub struct Gidaspow {
    /// φ_s in Ergun's part
    pub sphericity: f64,
    /// last voidage of Ergun's part
    pub switch_voidage: f64,
    /// with the branch Re > 1000 (sediFoam, MFIX; the publication) or without (CFDEMcoupling)
    pub newton: bool,
}

impl DragLaw for Gidaspow {
    fn name(&self) -> &'static str {
        if self.newton { "ergun-wen-yu" } else { "gidaspow" }
    }
    fn source(&self) -> &'static str {
        if self.newton {
            "Gidaspow 1994, Multiphase Flow and Fluidization; as in sediFoam (C_d = 0.44 above Re = 1000)"
        } else {
            "Gidaspow 1994, Multiphase Flow and Fluidization; as in CFDEMcoupling (no Re > 1000 branch)"
        }
    }
    #[inline]
    fn drag_coefficient(&self, s: &Slip) -> f64 {
        if s.voidage > self.switch_voidage { wen_yu(s, self.newton) } else { ergun(s, self.sphericity) }
    }
}

/// Huilin & Gidaspow 2003: Ergun and Wen & Yu blended by ψ = ½ + atan(262.5 (ε − 0.8))/π; continuous.
pub struct Blended;

impl DragLaw for Blended {
    fn name(&self) -> &'static str {
        "gidaspow-blended"
    }
    fn source(&self) -> &'static str {
        "Huilin & Gidaspow 2003, Chem. Eng. Sci. 58, 3777"
    }
    fn drag_coefficient(&self, s: &Slip) -> f64 {
        let psi = 0.5 + (150.0 * 1.75 * (s.voidage - 0.8)).atan() / PI;
        (1.0 - psi) * ergun(s, 1.0) + psi * wen_yu(s, true)
    }
}
