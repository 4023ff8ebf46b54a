// SPDX-License-Identifier: MIT OR Apache-2.0
//! Laws from the single sphere: Stokes, Schiller & Naumann, and those scaled by the terminal-velocity ratio.

use super::{by_voidage, power};
use crate::forces::{DragLaw, Slip};
use std::f64::consts::PI;

/// Stokes 1851: K = 3π μ d.
pub struct Stokes;

impl DragLaw for Stokes {
    fn name(&self) -> &'static str {
        "stokes"
    }
    fn source(&self) -> &'static str {
        "Stokes 1851, creeping flow around one sphere"
    }
    fn drag_coefficient(&self, s: &Slip) -> f64 {
        s.stokes()
    }
}

/// Schiller & Naumann 1935: single sphere, C_d = max(0.44, 24/Re (1 + 0.15 Re^0.687)).
pub struct SchillerNaumann;

impl DragLaw for SchillerNaumann {
    fn name(&self) -> &'static str {
        "schiller-naumann"
    }
    fn source(&self) -> &'static str {
        "Schiller & Naumann 1935, Z. Ver. Dtsch. Ing. 77"
    }
    fn drag_coefficient(&self, s: &Slip) -> f64 {
        let newton = 0.44 * PI / 8.0 * s.density * s.diameter * s.diameter * s.speed;
        newton.max(s.stokes() * (1.0 + 0.15 * power(s.reynolds(), 0.687)))
    }
}

/// A and B of Garside & Al-Dibouni 1977.
#[inline]
fn powers(e: f64) -> (f64, f64) {
    let log = e.ln(); // one logarithm for both
    let b = if e <= 0.85 { 0.8 * (1.28 * log).exp() } else { (2.65 * log).exp() };
    ((4.14 * log).exp(), b)
}

/// Ratio of the terminal velocities in the suspension and alone, Garside & Al-Dibouni 1977.
#[inline]
fn velocity_ratio((a, b): (f64, f64), re: f64) -> f64 {
    0.5 * (a - 0.06 * re + ((0.06 * re).powi(2) + 0.12 * re * (2.0 * b - a) + a * a).sqrt())
}

/// Syamlal & O'Brien 1987, with C_d of Dalla Valle.
pub struct SyamlalOBrien;

impl SyamlalOBrien {
    #[inline]
    fn with(&self, s: &Slip, powers: (f64, f64)) -> f64 {
        let re = s.reynolds();
        let v = velocity_ratio(powers, re);
        let cd_u = (0.63 * re.sqrt() + 4.8 * v.sqrt()).powi(2) * s.kinematic_viscosity / s.diameter;
        s.volume() * s.voidage * 0.75 * cd_u * s.density / (s.diameter * v * v)
    }
}

impl DragLaw for SyamlalOBrien {
    fn name(&self) -> &'static str {
        "syamlal-obrien"
    }
    fn source(&self) -> &'static str {
        "Syamlal & O'Brien 1987 (MFIX)"
    }
    fn drag_coefficient(&self, s: &Slip) -> f64 {
        self.with(s, powers(s.voidage))
    }
    fn coefficients(&self, slips: &[Slip], out: &mut [f64]) {
        by_voidage(slips, out, powers, |s, p| self.with(s, p));
    }
}

/// sediFoam's "NoCorrection": V_r as Syamlal & O'Brien, C_d = 24/Re + 4/√Re + 0.4 of the uncorrected Re.
pub struct NoCorrection;

impl DragLaw for NoCorrection {
    fn name(&self) -> &'static str {
        "no-correction"
    }
    fn source(&self) -> &'static str {
        "sediFoam NoCorrection; Stokes limit below its floor Re = 1e-3"
    }
    fn drag_coefficient(&self, s: &Slip) -> f64 {
        let (e, re) = (s.voidage, s.reynolds());
        let v = velocity_ratio(powers(e), re);
        let cd_u = (24.0 + 4.0 * re.sqrt() + 0.4 * re) * s.kinematic_viscosity / s.diameter;
        s.volume() * e * 0.75 * cd_u * s.density / (s.diameter * v * v)
    }
}

/// No drag at all.
pub struct NoDrag;

impl DragLaw for NoDrag {
    fn name(&self) -> &'static str {
        "none"
    }
    fn source(&self) -> &'static str {
        "no drag"
    }
    fn drag_coefficient(&self, _: &Slip) -> f64 {
        0.0
    }
}
