// SPDX-License-Identifier: MIT OR Apache-2.0
//! Di Felice's law and its voidage functions: K = (π/8) C_d ρ d² ε^(2−Ξ) |u|, C_d = (0.63 + 4.8/√Re)², Re with ε.

use super::power;
use crate::forces::{DragLaw, Slip};
use std::f64::consts::{LN_10, PI};

/// (π/8) C_d ρ d² |u|, kg/s.
#[inline]
fn dalla_valle(s: &Slip, re: f64) -> f64 {
    let root = 0.63 * re.sqrt() + 4.8;
    PI / 8.0 * s.density * s.diameter * root * root * s.kinematic_viscosity / s.voidage
}

/// exp(−(1.5 − log10 Re)²/2); 0 at Re = 0.
#[inline]
fn bell(re: f64) -> f64 {
    let t = 1.5 - re.ln() * (1.0 / LN_10);
    (-0.5 * t * t).exp()
}

/// Di Felice 1994: Ξ = 3.7 − 0.65 exp(−(1.5 − log10 Re)²/2).
pub struct DiFelice;

impl DragLaw for DiFelice {
    fn name(&self) -> &'static str {
        "di-felice"
    }
    fn source(&self) -> &'static str {
        "Di Felice 1994, Int. J. Multiphase Flow 20, 153"
    }
    #[inline]
    fn drag_coefficient(&self, s: &Slip) -> f64 {
        let re = s.voidage * s.reynolds();
        let xi = 3.7 - 0.65 * bell(re);
        dalla_valle(s, re) * ((2.0 - xi) * s.voidage.ln()).exp()
    }
}

/// Rong, Dong & Yu 2013: Ξ = 2.65 (ε + 1) − (5.3 − 3.5 ε) ε² exp(−(1.5 − log10 Re)²/2).
pub struct Rong;

impl DragLaw for Rong {
    fn name(&self) -> &'static str {
        "rong"
    }
    fn source(&self) -> &'static str {
        "Rong, Dong & Yu 2013, Chem. Eng. Sci. 99, 44 (Di Felice with another exponent)"
    }
    fn drag_coefficient(&self, s: &Slip) -> f64 {
        let (e, re) = (s.voidage, s.voidage * s.reynolds());
        let xi = 2.65 * (e + 1.0) - (5.3 - 3.5 * e) * e * e * bell(re);
        dalla_valle(s, re) * ((2.0 - xi) * e.ln()).exp()
    }
}

/// Di Felice's single sphere times the factor of Tang et al. relative to their own single sphere.
pub struct DiFeliceTang {
    /// as CFDEMcoupling has it: Ξ = 2 − lg X/lg ε instead of −lg X/lg ε, 1/ε² times the publication (6 times in a
    /// packing). It also sets X = 1 at Re < 1e-15; here it is continuous.
    pub cfdem: bool,
}

impl DragLaw for DiFeliceTang {
    fn name(&self) -> &'static str {
        if self.cfdem { "di-felice-tang-cfdem" } else { "di-felice-tang" }
    }
    fn source(&self) -> &'static str {
        if self.cfdem {
            "CFDEMcoupling, voidageFunctionTang: 1/eps^2 times the factor of Tang et al. 2015"
        } else {
            "Di Felice 1994 with the voidage function of Tang et al. 2015, AIChE J. 61, 688"
        }
    }
    fn drag_coefficient(&self, s: &Slip) -> f64 {
        let (e, re) = (s.voidage, s.voidage * s.reynolds());
        let (phi, e2, r) = (1.0 - e, e * e, power(re, 0.657));
        let e4 = 1.0 / (e2 * e2);
        let suspension =
            (1.5 * phi.max(0.0).sqrt() + 1.0) * e2 + 10.0 * phi / e2 + (0.0644 * e4 + 0.169 * e) * r
                - 0.00456 * re * e4
                + 0.11 * (e - 2.0) * (e - 1.0) * re;
        let share = if self.cfdem { 1.0 } else { e2 };
        dalla_valle(s, re) * share * suspension / (0.2334 * r - 0.00456 * re + 1.0)
    }
}
