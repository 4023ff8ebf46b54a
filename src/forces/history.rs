// SPDX-License-Identifier: MIT OR Apache-2.0
//! Basset's history force with bounded memory: the kernel's tail as ten exponentials, updated in place.
//!
//! F = (3/2) d² ρ √(πν) ∫ g(τ)/√(t−τ) dτ, g = d(u−v)/dt. Reads the slip (m/s) at each exchange; state: last slip and
//! ten vectors per particle, to be carried by the exchange. A step change is remembered within 4 % for 20 000 periods.
//! Does not know particles' owners. A law with its tests; no case can switch it on yet.

use std::f64::consts::{E, PI};

const TERMS: usize = 10;
/// (a_i, t_i/Δt): √Δt K ≈ Σ a_i √(e/t_i) exp(−t/2t_iΔt); form, t_i and the first a_i of van Hinsberg, ten Thije
/// Boonkkamp & Clercx 2011, J. Comput. Phys. 230, 1465; the others fitted for t ≤ 4e4 Δt, largest error 2.3 %.
const TAIL: [(f64, f64); TERMS] = [
    (0.234774813, 0.1),
    (0.285495762, 0.3),
    (0.284794167, 1.0),
    (0.327727514, 3.0),
    (0.223618587, 10.0),
    (0.436672887, 40.0),
    (0.325264121, 190.0),
    (0.481518980, 1000.0),
    (0.389857117, 6500.0),
    (0.913355533, 50000.0),
];

/// The memory of one particle.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct History {
    /// slip at the last exchange, m/s; None: not seen yet
    pub slip: Option<[f64; 3]>,
    /// integrals of the exponentials, m/s^1.5
    pub tail: [[f64; 3]; TERMS],
}

impl History {
    /// ∫ g/√(t−τ) dτ (m/s^1.5) after a step of `period` (s) in which the slip went linearly to `slip`.
    ///
    /// The last period is integrated exactly (2 √Δt g), what is older by the exponentials.
    pub fn advance(&mut self, slip: [f64; 3], period: f64) -> [f64; 3] {
        let last = self.slip.replace(slip).unwrap_or(slip);
        let root = period.sqrt();
        let mut sum = [0.0; 3];
        for ((a, t), tail) in TAIL.iter().zip(&mut self.tail) {
            let decay = (-0.5 / t).exp();
            for x in 0..3 {
                sum[x] += decay * tail[x];
                // this period joins the tail: ∫ over it of a √(e/tΔt) exp(−τ/2tΔt)
                let rate = (slip[x] - last[x]) / period;
                tail[x] = decay * tail[x] + a * (E / t).sqrt() * root * 2.0 * t * (1.0 - decay) * rate;
            }
        }
        [0, 1, 2].map(|x| sum[x] + 2.0 * (slip[x] - last[x]) / root)
    }
}

/// (3/2) d² ρ √(πν), N per m/s^1.5.
pub fn coefficient(diameter: f64, density: f64, kinematic_viscosity: f64) -> f64 {
    1.5 * diameter * diameter * density * (PI * kinematic_viscosity).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_memory_of_a_step_change_decays_as_the_exact_integral() {
        // slip ramps to 1 within one period: ∫ = 2 (√t − √(t−Δt))/Δt after it
        let dt = 1e-3;
        let mut h = History::default();
        h.advance([0.0; 3], dt);
        for n in 1..20_000 {
            let got = h.advance([1.0, 0.0, -2.0], dt);
            let t = n as f64 * dt;
            let exact = 2.0 / (t.sqrt() + (t - dt).max(0.0).sqrt());
            if n < 5 || n % 997 == 0 {
                assert!((got[0] / exact - 1.0).abs() < 0.04, "{n}: {} {exact}", got[0]);
            }
            assert!((got[2] + 2.0 * got[0]).abs() < 1e-9 * got[0] && got[1] == 0.0);
        }
    }

    #[test]
    fn a_constant_acceleration_gives_twice_the_root_of_time() {
        let dt = 1e-2;
        let mut h = History::default();
        for n in 0..1000 {
            let got = h.advance([n as f64 * dt, 0.0, 0.0], dt);
            let exact = 2.0 * (n as f64 * dt).sqrt();
            assert!((got[0] - exact).abs() <= 0.02 * exact, "{n}: {} {exact}", got[0]);
        }
    }
}
