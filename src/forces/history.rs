// SPDX-License-Identifier: MIT OR Apache-2.0
//! Basset's history force with bounded memory: the kernel's tail as ten exponentials, updated in place.
//!
//! F = (3/2) d² ρ √(πν) ∫ g(τ)/√(t−τ) dτ, g = d(u−v)/dt. Reads the slip (m/s) at each exchange; state: last slip and
//! ten vectors per particle, which travel with the particle (`Memory`): the particle program keeps them, through its
//! restart files too, and the coupler keeps nothing. A step change is remembered within 4 % for 20 000 periods.
//! Does not know particles' owners.
//!
//! The force is explicit: its newest part, 2 (slip − last slip)/√Δt, acts like an added mass one period late, so it is
//! stable while [`explicit_ratio`] < 1.

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

/// A history as it travels with the particle: seen at all (1, else 0), last slip, tail; all zero for a new particle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Memory(pub [f64; Self::WIDTH]);

impl Memory {
    /// Numbers per particle.
    pub const WIDTH: usize = 4 + 3 * TERMS;
}

impl Default for Memory {
    fn default() -> Self {
        Self([0.0; Self::WIDTH])
    }
}

impl From<&Memory> for History {
    fn from(m: &Memory) -> Self {
        let v = |k: usize| [m.0[k], m.0[k + 1], m.0[k + 2]];
        Self { slip: (m.0[0] != 0.0).then(|| v(1)), tail: std::array::from_fn(|n| v(4 + 3 * n)) }
    }
}

impl From<&History> for Memory {
    fn from(h: &History) -> Self {
        let mut m = Self::default();
        m.0[0] = f64::from(u8::from(h.slip.is_some()));
        m.0[1..4].copy_from_slice(&h.slip.unwrap_or_default());
        m.0[4..].copy_from_slice(h.tail.as_flattened());
        m
    }
}

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

/// What the newest part of the force does to a particle's velocity in one period, over what it answers to: a change of
/// slip δ changes the velocity by this times δ a period later. Stable below 1 (alone it runs away from 1.3 on).
pub fn explicit_ratio(diameter: f64, density: f64, particle_density: f64, nu: f64, period: f64) -> f64 {
    let mass = particle_density * PI / 6.0 * diameter.powi(3);
    coefficient(diameter, density, nu) * 2.0 * period.sqrt() / mass
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_memory_comes_back_as_it_was() {
        let mut h = History::default();
        assert_eq!(Memory::from(&h), Memory::default());
        for n in 0..5 {
            h.advance([0.1 * f64::from(n), 1.0, -2.0], 1e-3);
        }
        assert_eq!(History::from(&Memory::from(&h)), h);
        assert_eq!(History::from(&Memory::default()), History::default());
    }

    #[test]
    fn beyond_a_ratio_of_one_the_explicit_force_runs_away() {
        // m dv/dt = F(−v) alone, started with a kick
        let (d, rho, nu, dt) = (1e-3, 1000.0, 1e-6, 1e-3);
        for (particle, stable) in [(4000.0, true), (330.0, true), (200.0, false)] {
            let ratio = explicit_ratio(d, rho, particle, nu, dt);
            assert_eq!(ratio < 1.0, stable, "{ratio}"); // runs away from 1.3 on: the older past pulls back
            let (mut h, mut v, mut most) = (History::default(), 1.0f64, 0.0f64);
            h.advance([0.0; 3], dt);
            for _ in 0..200 {
                let f = coefficient(d, rho, nu) * h.advance([-v, 0.0, 0.0], dt)[0];
                v += f * dt / (particle * PI / 6.0 * d * d * d);
                most = most.max(v.abs());
            }
            assert_eq!(most < 2.0, stable, "{particle}: {most}");
        }
    }

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
