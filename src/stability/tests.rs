// SPDX-License-Identifier: MIT OR Apache-2.0
//! Against limits known in closed form or from the same exchange written down for one cell.

use super::*;
use crate::config::{foam, recorded};
use crate::particles::{Asked, Totals};
use crate::scheme::{History, testbench::column};
use std::f64::consts::PI;

const CASE: &str = r#"
format = 1
[fluid]
density = 1.2
kinematic_viscosity = 1.5e-5
gravity = [0.0, 0.0, 0.0]
[dem]
script = "in.dem"
time_step = 1e-5
[coupling]
interval = 10
[smooth]
bandwidth = 2e-3
[forces]
drag = "stokes"
"#;
const CELLS: usize = 12;
const H: f64 = 1e-3;
const D: f64 = 4e-4;

/// A sphere in the middle of each cell of a ring.
fn scene() -> (Config, Mesh, Particles, Vec<[f64; 3]>) {
    let control = foam::Control { start: 0.0, end: 1.0, step: 1e-4, adjustable: false };
    let config = recorded(CASE, &[], control).unwrap();
    let mesh = column(CELLS, H, H);
    let n = CELLS;
    let particles = Particles {
        id: (0..n as i64).collect(),
        origin: (0..n as u32).map(|i| (0, i)).collect(),
        position: (0..n).map(|i| [(i as f64 + 0.5) * H, 0.5 * H, 0.5 * H]).collect(),
        velocity: vec![[0.1, 0.0, 0.0]; n],
        radius: vec![0.5 * D; n],
        mass: vec![1000.0 * PI / 6.0 * D.powi(3); n],
        ledger: vec![[0.0; 3]; n],
        history: History::default(),
        asked: Asked::default(),
        totals: Totals::default(),
    };
    let fluid = vec![[0.3, 0.0, 0.0]; n];
    (config, mesh, particles, fluid)
}

/// τ_p and particle mass / fluid mass.
fn times() -> (f64, f64) {
    let (m, k) = (1000.0 * PI / 6.0 * D.powi(3), 3.0 * PI * 1.8e-5 * D);
    let fluid = 1.2 * (H.powi(3) - PI / 6.0 * D.powi(3));
    (m / k, m / fluid)
}

#[test]
fn explicit_bears_two_thirds_of_the_relaxation_time_of_the_fluid_when_particles_are_held() {
    let (config, mesh, particles, fluid) = scene();
    let s = Scene { exchange: 1, config: &config, mesh: &mesh, particles: &particles, fluid: &fluid };
    let (tau_p, z) = times();
    let tau_f = tau_p / z;
    // with a = Δt/τ_f and the ledger: U' = U − a (2 U − U_before), so z² − (1 − 2a) z − a = 0, and z = −1 at a = 2/3
    let g = s.map("explicit", true, 0.3 * tau_f, 3.0 * tau_f).unwrap();
    let limit = g.limit.unwrap() / tau_f;
    assert!((limit * 1.5 - 1.0).abs() < 0.03, "{limit}");
    // the same exchange again changes nothing, one with twice the drag halves the limit
    let mut low = g.clone();
    s.lower(&mut low, 0.01 * tau_f, 30.0 * tau_f).unwrap();
    assert_eq!(low.limit, g.limit);
    let thick = Config {
        file: {
            let mut f = config.file.clone();
            f.fluid.kinematic_viscosity *= 2.0;
            f
        },
        ..config.clone()
    };
    let s2 = Scene { config: &thick, exchange: 2, ..s };
    s2.lower(&mut low, 0.01 * tau_f, 30.0 * tau_f).unwrap();
    assert!((low.limit.unwrap() / g.limit.unwrap() - 0.5).abs() < 0.02 && low.found[1].0 == 2);
    let (far, due) = (s.growth("explicit", 5.0 * tau_f, true).unwrap(), (9.0 + 101.0_f64.sqrt()) / 2.0);
    assert!((far / due - 1.0).abs() < 0.01, "{far}, due {due}");
}

#[test]
fn explicit_with_free_particles_is_that_of_one_cell() {
    let (config, mesh, particles, fluid) = scene();
    let s = Scene { exchange: 1, config: &config, mesh: &mesh, particles: &particles, fluid: &fluid };
    let (tau_p, z) = times();
    // U, v and L/m of the uniform mode, disturbed without momentum
    let alone = |x: f64| {
        let (mut u, mut v, mut l) = (z, -1.0, 0.0);
        let mut rate = 0.0;
        for k in 0..400 {
            let next = u - z * x * (u - v) - z * l;
            let taken = -(-x).exp_m1() * (next - v);
            (l, v, u) = (taken - x * (u - v), v + taken, next);
            let size = (u * u / z + v * v + l * l).sqrt();
            (u, v, l) = (u / size, v / size, l / size);
            rate += if k >= 200 { size.ln() } else { 0.0 };
        }
        (rate / 200.0).exp()
    };
    for x in [0.5 / z, 1.2 / z, 3.0 / z] {
        let (got, due) = (s.growth("explicit", x * tau_p, false).unwrap(), alone(x));
        assert!(due < NEUTRAL && got < NEUTRAL || (got / due - 1.0).abs() < 0.02, "x {x}: {got}, due {due}");
    }
}

#[test]
fn conservative_bears_all() {
    let (config, mesh, particles, fluid) = scene();
    let s = Scene { exchange: 1, config: &config, mesh: &mesh, particles: &particles, fluid: &fluid };
    let tau_f = times().0 / times().1;
    for held in [false, true] {
        let g = s.map("conservative", held, 0.01 * tau_f, 1e5 * tau_f).unwrap();
        assert_eq!(g.limit, None, "{:?}", g.points);
        let s = picture(&[g], &[("tau_f", tau_f)], held);
        assert!(s.contains("conservative") && s.contains("tau_f"));
    }
}

#[test]
fn an_exchange_keeps_momentum_with_added_mass_too() {
    let (mut config, mesh, particles, mut fluid) = scene();
    config.file.fluid.gravity = [0.0, -9.81, 0.0];
    fluid.iter_mut().enumerate().for_each(|(j, u)| u[1] = 0.1 * (j as f64).sin());
    for added in [0.0, 0.5] {
        config.file.forces.added_mass = crate::config::AddedMass::Coefficient(added);
        for scheme in ["conservative", "conservative-adaptive", "explicit"] {
            config.file.coupling.scheme = scheme.into();
            let (mut f, base) = Frozen::new(&config, mesh.clone(), particles.clone(), &fluid, false).unwrap();
            // U of the step before differs, so the fluid accelerates
            let one = f.exchange(&base).unwrap();
            let two = f.exchange(&one).unwrap();
            // less Archimedes' force, which has no reaction
            let weight = particles.mass.iter().sum::<f64>() * -9.81 * config.period() * (1.0 - 1.2 / 1000.0);
            let size = weight.abs() + crate::sums::norm(f.momentum(&one));
            let change = [0, 1, 2].map(|a| f.momentum(&two)[a] - f.momentum(&one)[a]);
            for (a, due) in [0.0, weight, 0.0].into_iter().enumerate() {
                assert!((change[a] - due).abs() < 1e-13 * size, "{scheme} {added}: {change:?}, {weight}");
            }
        }
    }
}
