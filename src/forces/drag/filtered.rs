// SPDX-License-Identifier: MIT OR Apache-2.0
//! Beetstra's law filtered for cells too large to show the clusters (Radl & Sundaresan 2014).
//!
//! Reads `Around::cell_volume` (m3); K × (1 − h(φ)/(a(φ) L/V^⅓ + 1)) × exp(k (1 − ratio)), L = (u_t²/g) Fr^(−2/3).

use super::factor::bvk;
use super::{DragOptions, SMALL};
use crate::forces::{Around, DragLaw, Slip};

/// Acceleration of gravity of the filter's scales, m/s2 (a constant of the published functions).
const G: f64 = 9.81;

/// a(φ): upper φ, coefficients, φ0.
const A: [(f64, [f64; 4], f64); 6] = [
    (0.016, [21.51, 0.0, 0.0, 0.0], 0.0),
    (0.100, [1.96, 29.40, 164.91, -1923.0], 0.0),
    (0.180, [4.63, 4.68, -412.04, 2254.0], 0.10),
    (0.250, [3.52, -17.99, 128.80, -603.0], 0.18),
    (0.400, [2.68, -8.20, 2.18, 112.33], 0.25),
    (f64::INFINITY, [1.79, 0.0, 0.0, 0.0], 0.0),
];
/// h(φ), likewise.
const H: [(f64, [f64; 4], f64); 8] = [
    (0.03, [0.0, 7.97, 0.0, 0.0], 0.0),
    (0.08, [0.239, 4.640, -4.410, 253.630], 0.03),
    (0.12, [0.492, 6.100, 33.630, -789.600], 0.08),
    (0.18, [0.739, 5.010, -61.100, 310.800], 0.12),
    (0.34, [0.887, 1.030, -5.170, 5.990], 0.18),
    (0.48, [0.943, -0.170, -2.290, -9.120], 0.34),
    (0.55, [0.850, -1.350, -6.130, -132.600], 0.48),
    (f64::INFINITY, [0.680, -2.340, -225.200, 0.0], 0.55),
];

fn piecewise(table: &[(f64, [f64; 4], f64)], phi: f64) -> f64 {
    let (_, c, start) = table.iter().find(|t| phi < t.0).unwrap_or(&table[table.len() - 1]);
    let x = phi - start;
    c[0] + x * (c[1] + x * (c[2] + x * c[3]))
}

/// The filtered law.
pub struct BeetstraFiltered {
    /// L, m; 0: not filtered
    length: f64,
    /// exp(k (1 − ratio))
    parcel: f64,
}

impl BeetstraFiltered {
    /// Without a filter: what `all` lists.
    pub const PLAIN: Self = Self { length: 0.0, parcel: 1.0 };

    /// The length L from the terminal velocity of the primary particle.
    pub fn new(o: &DragOptions) -> Self {
        let (u, d) = (terminal_velocity(o), o.filter_diameter);
        let froude = u * u / (G * d);
        let length = u * u / G * froude.powf(-2.0 / 3.0);
        Self { length, parcel: (o.parcel_factor * (1.0 - o.ratio)).exp() }
    }

    fn correction(&self, voidage: f64, cell_volume: f64) -> f64 {
        if self.length == 0.0 || cell_volume <= 0.0 {
            return 1.0;
        }
        let phi = (1.0 - voidage).max(0.0);
        let cells = self.length / cell_volume.cbrt();
        1.0 - piecewise(&H, phi) / (piecewise(&A, phi) * cells + 1.0)
    }
}

/// Of one sphere by Beetstra's law at ε = 1, m/s.
fn terminal_velocity(o: &DragOptions) -> f64 {
    let (d, gap) = (o.filter_diameter, (o.filter_density - o.density).abs());
    let mut u = d * d * gap * G / (18.0 * o.density * o.kinematic_viscosity);
    for _ in 0..100 {
        let re = u * d / o.kinematic_viscosity + SMALL;
        let next = (4.0 / 3.0 * gap * G * d * re / (24.0 * bvk(1.0, re, false) * o.density)).sqrt();
        let done = (next - u).abs() < 1e-6 * u;
        u = next;
        if done {
            break;
        }
    }
    u
}

impl DragLaw for BeetstraFiltered {
    fn name(&self) -> &'static str {
        "beetstra-filtered"
    }
    fn source(&self) -> &'static str {
        "Radl & Sundaresan 2014, Chem. Eng. Sci. 117, 416, on Beetstra et al. 2007"
    }
    fn looks_around(&self) -> bool {
        true
    }
    fn drag_coefficient(&self, s: &Slip) -> f64 {
        self.drag_coefficient_in(s, &Around::alike(s.diameter))
    }
    fn drag_coefficient_in(&self, s: &Slip, a: &Around) -> f64 {
        let re = s.voidage * s.reynolds() + SMALL;
        s.stokes()
            * s.voidage
            * bvk(s.voidage, re, false)
            * self.correction(s.voidage, a.cell_volume)
            * self.parcel
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_filter_reduces_the_drag_in_large_cells_only() {
        // FCC catalyst in air as in the publication: d 75 µm, 1500 kg/m3; u_t = 0.2184 m/s there by Wen & Yu,
        // Beetstra's factor at ε = 1 is 6 % smaller
        let o = DragOptions {
            filter_diameter: 75e-6,
            filter_density: 1500.0,
            density: 1.3,
            kinematic_viscosity: 1.8e-5 / 1.3,
            ..DragOptions::default()
        };
        let u = terminal_velocity(&o);
        assert!((u / 0.2184 - 1.062).abs() < 0.01, "{u}");
        let law = BeetstraFiltered::new(&o);
        let slip =
            Slip { diameter: 75e-6, voidage: 0.8, speed: 0.2, kinematic_viscosity: 1.4e-5, density: 1.3 };
        let k = |h: f64| {
            let around = Around { sauter_diameter: 75e-6, mean_diameter: 0.0, cell_volume: h * h * h };
            law.drag_coefficient_in(&slip, &around) / law.drag_coefficient(&slip)
        };
        assert!(k(1e-7) > 0.999 && k(0.01) < 0.6 && k(0.1) < k(0.01), "{} {} {}", k(1e-7), k(0.01), k(0.1));
        // the limit of very large cells: 1 − h(0.2), by hand 0.887 + 1.03·0.02 − 5.17·0.02² + 5.99·0.02³
        assert!((k(1e6) - (1.0 - 0.905_579_92)).abs() < 1e-6, "{}", k(1e6));
        let parcels = BeetstraFiltered::new(&DragOptions { parcel_factor: 0.05, ratio: 3.0, ..o });
        let gain = parcels.drag_coefficient(&slip) / law.drag_coefficient(&slip);
        assert!((gain - (-0.1f64).exp()).abs() < 1e-14);
    }

    #[test]
    fn the_tables_have_no_jumps_beyond_their_digits() {
        for (table, last) in [(&A[1..5], 0.4), (&H[..7], 0.55)] {
            for t in table.iter().filter(|t| t.0 < last) {
                let (below, above) = (piecewise(table, t.0 * (1.0 - 1e-12)), piecewise(table, t.0));
                assert!((below - above).abs() < 0.02 * above.abs().max(0.5), "{}: {below} {above}", t.0);
            }
        }
    }
}
