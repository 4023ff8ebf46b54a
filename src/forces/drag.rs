// SPDX-License-Identifier: MIT OR Apache-2.0
//! The drag laws. Written in C_d |u_r| so that nothing divides by the slip.

use super::{DragLaw, Slip};
use std::f64::consts::PI;

/// Keeps logarithms and negative powers finite; far below any physical value.
const SMALL: f64 = 1e-15;

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
        newton.max(s.stokes() * (1.0 + 0.15 * s.reynolds().powf(0.687)))
    }
}

/// Di Felice 1994: C_d = (0.63 + 4.8/√Re)², voidage function ε^(2−Ξ).
pub struct DiFelice;

impl DragLaw for DiFelice {
    fn name(&self) -> &'static str {
        "di-felice"
    }
    fn source(&self) -> &'static str {
        "Di Felice 1994, Int. J. Multiphase Flow 20, 153"
    }
    fn drag_coefficient(&self, s: &Slip) -> f64 {
        let re = s.voidage * s.reynolds();
        let bell = if re > 0.0 { 0.65 * (-0.5 * (1.5 - re.log10()).powi(2)).exp() } else { 0.0 };
        let cd_u = (0.63 * re.sqrt() + 4.8).powi(2) * s.kinematic_viscosity / (s.diameter * s.voidage);
        PI / 8.0 * s.density * s.diameter * s.diameter * cd_u * s.voidage.powf(2.0 - (3.7 - bell))
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
        let re = s.voidage * s.reynolds();
        if re > 1000.0 {
            return s.volume() * 0.75 * 0.44 * s.density * s.speed * s.voidage.powf(-1.65) / s.diameter;
        }
        s.stokes() * (1.0 + 0.15 * re.powf(0.687)) * s.voidage.powf(-2.65)
    }
}

/// Gidaspow 1994: Ergun for ε ≤ 0.8, Wen & Yu above; discontinuous there, as published.
pub struct Gidaspow;

impl DragLaw for Gidaspow {
    fn name(&self) -> &'static str {
        "gidaspow"
    }
    fn source(&self) -> &'static str {
        "Gidaspow 1994, Multiphase Flow and Fluidization; as in CFDEMcoupling (no Re > 1000 branch)"
    }
    fn drag_coefficient(&self, s: &Slip) -> f64 {
        let (e, d) = (s.voidage, s.diameter);
        if e > 0.8 {
            return s.stokes() * (1.0 + 0.15 * (e * s.reynolds()).powf(0.687)) * e.powf(-2.65);
        }
        let viscous = 150.0 * (1.0 - e) * s.kinematic_viscosity / (e * d * d);
        s.volume() * s.density * (viscous + 1.75 * s.speed / d)
    }
}

/// Beetstra, van der Hoef & Kuipers 2007, monodisperse.
pub struct Beetstra;

impl DragLaw for Beetstra {
    fn name(&self) -> &'static str {
        "beetstra"
    }
    fn source(&self) -> &'static str {
        "Beetstra, van der Hoef & Kuipers 2007, AIChE J. 53, 489"
    }
    fn drag_coefficient(&self, s: &Slip) -> f64 {
        let (e, phi) = (s.voidage, (1.0 - s.voidage).max(SMALL));
        let re = e * s.reynolds() + SMALL;
        let viscous = 10.0 * phi / (e * e) + e * e * (1.0 + 1.5 * phi.sqrt());
        let top = 1.0 / e + 3.0 * e * phi + 8.4 * re.powf(-0.343);
        let bottom = 1.0 + 10f64.powf(3.0 * phi) * re.powf(-0.5 * (1.0 + 4.0 * phi));
        s.stokes() * e * (viscous + 0.413 * re / (24.0 * e * e) * top / bottom)
    }
}

/// Koch & Hill 2001.
pub struct KochHill;

impl DragLaw for KochHill {
    fn name(&self) -> &'static str {
        "koch-hill"
    }
    fn source(&self) -> &'static str {
        "Koch & Hill 2001, Annu. Rev. Fluid Mech. 33, 619"
    }
    fn drag_coefficient(&self, s: &Slip) -> f64 {
        let (e, phi) = (s.voidage, (1.0 - s.voidage).clamp(SMALL, 1.0 - SMALL));
        let f0 = if phi < 0.4 {
            (1.0 + 3.0 * (phi / 2.0).sqrt() + 135.0 / 64.0 * phi * phi.ln() + 16.14 * phi)
                / (1.0 + 0.681 * phi - 8.48 * phi * phi + 8.16 * phi.powi(3))
        } else {
            10.0 * phi / e.powi(3)
        };
        let f3 = 0.0673 + 0.212 * phi + 0.0232 / e.powi(5);
        s.stokes() * e * e * (f0 + 0.5 * f3 * e * s.reynolds())
    }
}

/// Syamlal & O'Brien 1987, with C_d of Dalla Valle.
pub struct SyamlalOBrien;

impl DragLaw for SyamlalOBrien {
    fn name(&self) -> &'static str {
        "syamlal-obrien"
    }
    fn source(&self) -> &'static str {
        "Syamlal & O'Brien 1987 (MFIX)"
    }
    fn drag_coefficient(&self, s: &Slip) -> f64 {
        let (e, re) = (s.voidage, s.reynolds());
        let log = e.ln(); // one logarithm for both powers
        let a = (4.14 * log).exp();
        let b = if e <= 0.85 { 0.8 * (1.28 * log).exp() } else { (2.65 * log).exp() };
        let v = 0.5 * (a - 0.06 * re + ((0.06 * re).powi(2) + 0.12 * re * (2.0 * b - a) + a * a).sqrt());
        let cd_u = (0.63 * re.sqrt() + 4.8 * v.sqrt()).powi(2) * s.kinematic_viscosity / s.diameter;
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
