// SPDX-License-Identifier: MIT OR Apache-2.0
//! Parcels: the stress between particles that no contacts resolve (MP-PIC).
//!
//! Reads the solid fraction; writes τ (Pa). The force on a parcel is −V/ε_s ∇τ. It is internal to the particles and
//! has no reaction on the fluid: external in the books.

/// Snider 2001: τ = P ε_s^β / max(ε_cp − ε_s, α (1 − ε_s)).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ParticleStress {
    /// P, Pa
    pub pressure: f64,
    /// β, 2 to 5
    pub exponent: f64,
    /// ε_cp
    pub close_packing: f64,
    /// α, removes the singularity
    pub floor: f64,
}

impl ParticleStress {
    /// τ, Pa.
    pub fn stress(&self, solid_fraction: f64) -> f64 {
        let s = solid_fraction.max(0.0);
        self.pressure * s.powf(self.exponent) / (self.close_packing - s).max(self.floor * (1.0 - s))
    }
}

/// Added-mass coefficient at solid fraction φ and density ratio s = ρ_p/ρ_f.
///
/// Felderhof 1991 as fitted in CFDEMcoupling, which computes it and then uses 0.5.
pub fn felderhof(phi: f64, s: f64) -> f64 {
    let log = s.ln();
    0.5 + (0.047 * log + 0.13) * phi + (-0.066 * log - 0.58) * phi * phi + 1.42 * phi * phi * phi
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_stress_grows_towards_close_packing_and_stays_finite_beyond() {
        let p = ParticleStress { pressure: 10.0, exponent: 2.0, close_packing: 0.6, floor: 1e-7 };
        assert_eq!(p.stress(0.0), 0.0);
        assert!((p.stress(0.5) - 25.0).abs() < 1e-12);
        assert!(p.stress(0.59) > p.stress(0.5) && p.stress(0.7).is_finite() && p.stress(0.7) > 1e6);
    }

    #[test]
    fn felderhof_is_one_half_alone() {
        assert_eq!(felderhof(0.0, 2.5), 0.5);
        assert!((felderhof(0.1, 1.0) - (0.5 + 0.013 - 0.0058 + 0.00142)).abs() < 1e-15);
    }
}
