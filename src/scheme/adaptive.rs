// SPDX-License-Identifier: MIT OR Apache-2.0
//! C between what a free and what a held particle takes, after its mobility in the last interval; B what the last
//! impulse differed from that.
//!
//! Free for Δt a particle takes J = K* Δt (u − v), K* = (m/Δt)(1 − e^{−x}), x = K Δt/(m + m_a); held it takes K Δt (u − v). So
//! C = K* + (K − K*) θ, θ = 1 − mobility, and B = J_last/Δt − C_last (u − v)_last carries what steady forces (weight,
//! contacts) add. C_last is formed with the K that drove the last interval: a change of K is no force.

use super::{Before, Scheme};

/// Second choice of (C, B) of design §2.2.
pub struct ConservativeAdaptive;

/// C for the mobility and drag coefficient at hand, kg/s.
fn coefficient(k: f64, theta: f64, before: &Before) -> f64 {
    let free = -before.mass / before.period * (-k * before.period / before.inertia).exp_m1();
    free + (k - free) * theta
}

impl Scheme for ConservativeAdaptive {
    fn name(&self) -> &'static str {
        "conservative-adaptive"
    }
    fn source(&self) -> &'static str {
        "design §2.2, C and B from the last interval, with ledger"
    }
    fn wants_history(&self) -> bool {
        true
    }
    fn predict(&self, before: &Before) -> (f64, [f64; 3]) {
        let k = before.drag_coefficient;
        let Some(last) = before.last else { return (k, [0.0; 3]) };
        let theta = 1.0 - last.mobility;
        let then = coefficient(last.drag_coefficient, theta, before);
        let rest = [0, 1, 2].map(|a| last.drag_impulse[a] / before.period - then * last.slip[a]);
        (coefficient(k, theta, before), rest)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scheme::History;

    #[test]
    fn a_free_particle_with_added_mass_is_known_as_free() {
        // (m + ma) dv/dt = m g + K (u − v), exact; m Δv = impulse + m g Δt, as the fix reports it
        let (m, added, k, dt): (f64, f64, f64, f64) = (2.0, 1.0, 3.0, 0.5);
        let (g, u) = ([0.0, -9.81, 0.0], [1.0, 0.5, 0.0]);
        let interval = |v: [f64; 3]| {
            let share = -(-k * dt / (m + added)).exp_m1();
            let new = [0, 1, 2].map(|a| v[a] + share * (u[a] + m * g[a] / k - v[a]));
            (new, [0, 1, 2].map(|a: usize| m * (new[a] - v[a]) - m * g[a] * dt))
        };
        let start = [0.3, 0.0, 0.1];
        let (v, impulse) = interval(start);
        let history = History {
            impulse: vec![impulse],
            drag_coefficient: vec![k],
            drive: vec![u],
            force: vec![[0.0; 3]],
            velocity: vec![start],
        };
        let last = history.last(0, v, m, g, dt).unwrap();
        assert!((last.mobility - 1.0).abs() < 1e-12, "{}", last.mobility);
        let slip = [0, 1, 2].map(|a| u[a] - v[a]);
        let before =
            Before { drag_coefficient: k, slip, mass: m, inertia: m + added, period: dt, last: Some(last) };
        let (c, b) = ConservativeAdaptive.predict(&before);
        let taken = interval(v).1;
        for a in 0..3 {
            let told = dt * (c * slip[a] + b[a]);
            assert!((told - taken[a]).abs() < 1e-12, "{told}, taken {}", taken[a]);
        }
    }

    /// Exact interval of a free or held particle; what is charged for the next one with fluid u2, and what it takes.
    fn charged_and_taken(x: f64, weight: f64, held: bool) -> (f64, f64) {
        let (m, dt, u1, u2) = (2.0, 0.5, 1.0, 3.0);
        let k = x * m / dt;
        let interval = |u: f64, v: f64| {
            let end = u + weight / k;
            let free = v + (end - v) * -(-x).exp_m1();
            if held { (0.0, k * (u - v) * dt) } else { (free, m * (free - v) - weight * dt) }
        };
        let (v1, j1) = interval(u1, 0.0);
        let history = History {
            impulse: vec![[j1, 0.0, 0.0]],
            drag_coefficient: vec![k],
            drive: vec![[u1, 0.0, 0.0]],
            force: vec![[0.0; 3]],
            velocity: vec![[0.0; 3]],
        };
        let last = history.last(0, [v1, 0.0, 0.0], m, [weight / m, 0.0, 0.0], dt);
        let slip = [u1 - v1, 0.0, 0.0];
        let (c, b) = ConservativeAdaptive.predict(&Before {
            drag_coefficient: k,
            slip,
            mass: m,
            inertia: m,
            period: dt,
            last,
        });
        (dt * (c * (u2 - v1) + b[0]), interval(u2, v1).1)
    }

    #[test]
    fn exact_for_free_and_for_held_particles_at_any_x() {
        for x in [1e-3, 0.1, 1.0, 10.0, 1e3, 1e6] {
            for (weight, held) in [(0.0, false), (-0.7, false), (0.0, true)] {
                let (charged, taken) = charged_and_taken(x, weight, held);
                // rounding of m Δv − weight Δt
                assert!(
                    (charged - taken).abs() < 1e-9 * taken.abs().max(1.0),
                    "{x} {weight} {held}: {charged} {taken}"
                );
            }
        }
    }

    #[test]
    fn without_a_last_interval_it_is_the_conservative_scheme() {
        let before = Before {
            drag_coefficient: 3.0,
            slip: [1.0; 3],
            mass: 1.0,
            inertia: 1.0,
            period: 1.0,
            last: None,
        };
        assert_eq!(ConservativeAdaptive.predict(&before), (3.0, [0.0; 3]));
    }
}
