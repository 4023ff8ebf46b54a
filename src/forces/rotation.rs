// SPDX-License-Identifier: MIT OR Apache-2.0
//! Torque of the fluid on a spinning sphere: T = K_ω (½ ∇ × U − ω), K_ω in N m s.
//!
//! Reads the fluid's gradient and the spin (rad/s); the particle program applies the torque with its current ω in every
//! step of its own (explicit for K_ω Δt/I ≤ 0.2, else exactly relaxing, as the drag). Linear momentum is not touched and
//! the third law of the books is that of linear momentum; the couple on the fluid is not given back, as in the peers: in
//! cells larger than a particle it is below what the mesh resolves. A parcel of diameter ratio r turns as its primaries do:
//! K_ω of the primary × r⁵, as its moment of inertia.

use crate::sums::norm;
use std::f64::consts::PI;

/// K_ω = π μ d³ (Rubinow & Keller 1961), × C_R Re/(64π) above Re_ω = d² |Ω|/ν = 32 (Dennis, Singh & Ingham 1980).
pub fn coefficient(diameter: f64, spin_slip: [f64; 3], kinematic_viscosity: f64, density: f64) -> f64 {
    let re = diameter * diameter * norm(spin_slip) / kinematic_viscosity;
    // 12.9/√Re + 128.4/Re meets 64π/Re within 0.3 % at Re = 32
    let factor = if re <= 32.0 { 1.0 } else { (12.9 * re.sqrt() + 128.4) / (64.0 * PI) };
    PI * density * kinematic_viscosity * diameter.powi(3) * factor
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn creeping_torque_is_that_of_kirchhoff_and_the_branches_meet() {
        let k = |rate: f64| coefficient(2e-3, [0.0, rate, 0.0], 1e-5, 1.2);
        assert!((k(1.0) / (8.0 * PI * 1.2e-5 * 1e-9) - 1.0).abs() < 1e-14, "8 π μ r³");
        let edge = 32.0 * 1e-5 / 4e-6;
        assert!((k(edge * 1.000_001) / k(edge) - 1.0).abs() < 0.003);
        assert!(
            (k(1000.0 / 32.0 * edge) / k(edge) - 2.668).abs() < 0.01,
            "{}",
            k(1000.0 / 32.0 * edge) / k(edge)
        );
    }
}
