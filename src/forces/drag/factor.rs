// SPDX-License-Identifier: MIT OR Apache-2.0
//! Laws from resolved simulations of arrays of spheres: K = 3π μ d ε F(φ, Re), Re with the superficial slip ε |u|.
//!
//! F is the drag without the share of the mean pressure gradient: type A.

use super::{SMALL, by_voidage, power};
use crate::forces::{Around, DragLaw, Slip};
use std::f64::consts::LN_10;

/// F of Beetstra, van der Hoef & Kuipers; `cpl`: with the denominator of the CPL library.
#[inline]
pub(super) fn bvk(e: f64, re: f64, cpl: bool) -> f64 {
    let phi = (1.0 - e).max(SMALL);
    let log = re.ln();
    let viscous = 10.0 * phi / (e * e) + e * e * (1.0 + 1.5 * phi.sqrt());
    let top = 1.0 / e + 3.0 * e * phi + 8.4 * (-0.343 * log).exp();
    let bottom = if cpl {
        1.0 + (3.0 * LN_10 * phi).exp() * (1.0 + 4.0 * phi) / re.sqrt()
    } else {
        1.0 + (3.0 * LN_10 * phi - 0.5 * (1.0 + 4.0 * phi) * log).exp()
    };
    viscous + 0.413 * re / (24.0 * e * e) * top / bottom
}

/// Beetstra, van der Hoef & Kuipers 2007, monodisperse.
pub struct Beetstra {
    /// as the CPL library has it: (1 + 4φ) multiplies Re^−½ instead of its exponent
    pub cpl: bool,
}

impl DragLaw for Beetstra {
    fn name(&self) -> &'static str {
        if self.cpl { "beetstra-cpl" } else { "beetstra" }
    }
    fn source(&self) -> &'static str {
        if self.cpl {
            "CPL library: Beetstra et al. 2007 with (1 + 4 phi) beside, not in, the exponent of Re"
        } else {
            "Beetstra, van der Hoef & Kuipers 2007, AIChE J. 53, 489"
        }
    }
    #[inline]
    fn drag_coefficient(&self, s: &Slip) -> f64 {
        let re = s.voidage * s.reynolds() + SMALL;
        s.stokes() * s.voidage * bvk(s.voidage, re, self.cpl)
    }
}

/// Beetstra et al. 2007, polydisperse: F(φ, Re of the Sauter diameter) (y + 0.064 y³), y = d/d_S.
pub struct BeetstraPoly;

impl DragLaw for BeetstraPoly {
    fn name(&self) -> &'static str {
        "beetstra-polydisperse"
    }
    fn source(&self) -> &'static str {
        "Beetstra, van der Hoef & Kuipers 2007, AIChE J. 53, 489, eq. 22; Sauter diameter from the smoothed fields"
    }
    fn looks_around(&self) -> bool {
        true
    }
    /// All particles alike: y = 1 (the correction is 1.064 then, as published).
    fn drag_coefficient(&self, s: &Slip) -> f64 {
        self.drag_coefficient_in(s, &Around::alike(s.diameter))
    }
    fn drag_coefficient_in(&self, s: &Slip, a: &Around) -> f64 {
        let y = s.diameter / a.sauter_diameter;
        let re = s.voidage * s.reynolds() / y + SMALL;
        s.stokes() * s.voidage * bvk(s.voidage, re, false) * (y + 0.064 * y * y * y)
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
    #[inline]
    fn drag_coefficient(&self, s: &Slip) -> f64 {
        self.with(s, Self::factors(s.voidage))
    }
    fn coefficients(&self, slips: &[Slip], out: &mut [f64]) {
        by_voidage(slips, out, Self::factors, |s, f| self.with(s, f));
    }
}

impl KochHill {
    /// F_0 and F_3.
    #[inline]
    fn factors(e: f64) -> (f64, f64) {
        let phi = (1.0 - e).clamp(SMALL, 1.0 - SMALL);
        let e3 = e * e * e;
        let f0 = if phi < 0.4 {
            (1.0 + 3.0 * (phi / 2.0).sqrt() + phi * (135.0 / 64.0 * phi.ln() + 16.14))
                / (1.0 + phi * (0.681 + phi * (8.16 * phi - 8.48)))
        } else {
            10.0 * phi / e3
        };
        (f0, 0.0673 + 0.212 * phi + 0.0232 / (e3 * e * e))
    }
    #[inline]
    fn with(&self, s: &Slip, (f0, f3): (f64, f64)) -> f64 {
        let e = s.voidage;
        s.stokes() * e * e * (f0 + 0.5 * f3 * e * s.reynolds())
    }
}

/// Tenneti, Garg & Subramaniam 2011. Their F holds the share of the mean pressure gradient: × ε for type A.
pub struct Tenneti {
    /// as NGA2 has it: only the inertial part of the single sphere is divided by ε³, Re is without ε, and the
    /// share of the mean pressure gradient is left in
    pub nga2: bool,
}

impl DragLaw for Tenneti {
    fn name(&self) -> &'static str {
        if self.nga2 { "tenneti-nga2" } else { "tenneti" }
    }
    fn source(&self) -> &'static str {
        if self.nga2 {
            "NGA2: Tenneti et al. 2011 with the creeping part not divided by eps^3 and Re without eps"
        } else {
            "Tenneti, Garg & Subramaniam 2011, Int. J. Multiphase Flow 37, 1072"
        }
    }
    fn drag_coefficient(&self, s: &Slip) -> f64 {
        let (e, phi) = (s.voidage, (1.0 - s.voidage).max(0.0));
        let re = if self.nga2 { s.reynolds() } else { e * s.reynolds() };
        let (e3, inertia) = (e * e * e, 0.15 * power(re, 0.687));
        let (alone, share) = if self.nga2 { (1.0 + inertia / e3, 1.0) } else { ((1.0 + inertia) / e3, e) };
        let phi3 = phi * phi * phi;
        let crowd = 5.81 * phi / e3 + 0.48 * phi.cbrt() / (e3 * e);
        s.stokes() * e * share * (alone + crowd + phi3 * re * (0.95 + 0.61 * phi3 / (e * e)))
    }
}

/// Tang, Peters, Kuipers, Kriebitzsch & van der Hoef 2015.
pub struct Tang;

impl DragLaw for Tang {
    fn name(&self) -> &'static str {
        "tang"
    }
    fn source(&self) -> &'static str {
        "Tang et al. 2015, AIChE J. 61, 688"
    }
    fn drag_coefficient(&self, s: &Slip) -> f64 {
        let (e, phi) = (s.voidage, (1.0 - s.voidage).max(0.0));
        let (e2, re) = (e * e, e * s.reynolds());
        let viscous = 10.0 * phi / e2 + e2 * (1.0 + 1.5 * phi.sqrt());
        let e4 = 1.0 / (e2 * e2);
        let inertia =
            (0.11 * phi * (1.0 + phi) - 0.00456 * e4) * re + (0.169 * e + 0.0644 * e4) * power(re, 0.657);
        s.stokes() * e * (viscous + inertia)
    }
}
