// SPDX-License-Identifier: MIT OR Apache-2.0
//! The scene of the benchmarks: a bed of spheres at the bottom of a box, air above.
//!
//! Writes a mesh of hexahedra, particles (SI units) and a smooth fluid field. All of it follows from the numbers
//! given: no clock, no random device.

use crate::mesh::{Mesh, made::Made};
use crate::particles::Particles;
use crate::step::Fluid;

/// The box of the peer's measurement (264 x 120 x 60 mm, spheres of 1.2 mm): y is up.
pub const BOX: [f64; 3] = [0.264, 0.12, 0.06];
/// Diameter of the spheres, m.
pub const DIAMETER: f64 = 1.2e-3;
/// Solid volume fraction of the bed.
pub const PACKING: f64 = 0.6;

/// A deterministic random number in [0, 1).
pub fn random(seed: &mut u64) -> f64 {
    *seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    (*seed >> 11) as f64 / (1u64 << 53) as f64
}

/// A mesh of about `cells` cubes in a box.
pub fn mesh(size: [f64; 3], cells: usize) -> Mesh {
    Made::hex(lines(size, cells), size).mesh()
}

/// Its cells along each axis.
pub fn lines(size: [f64; 3], cells: usize) -> [usize; 3] {
    let h = (size.iter().product::<f64>() / cells as f64).cbrt();
    size.map(|s| ((s / h).round() as usize).max(1))
}

/// `n` spheres in a bed of `PACKING` on the bottom (y = 0): a lattice, every sphere pushed about by a third of its
/// spacing; ids in random order, small random velocities.
pub fn bed(size: [f64; 3], n: usize, diameter: f64) -> Particles {
    let volume = std::f64::consts::PI / 6.0 * diameter.powi(3);
    let spacing = (volume / PACKING).cbrt();
    let lines = [size[0], size[2]].map(|s| (s / spacing).floor().max(1.0));
    let layers = (n as f64 / (lines[0] * lines[1])).ceil();
    let height = (n as f64 * volume / PACKING / (size[0] * size[2])).min(size[1]);
    let step = [size[0] / lines[0], height / layers, size[2] / lines[1]];
    let mut seed = 1;
    let mut p = Particles::default();
    for k in 0..n {
        let layer = (k as f64 / (lines[0] * lines[1])).floor();
        let rest = k as f64 - layer * lines[0] * lines[1];
        let at = [rest % lines[0], layer, (rest / lines[0]).floor()];
        let x = [0, 1, 2].map(|a| (at[a] + 0.5 + 0.33 * (2.0 * random(&mut seed) - 1.0)) * step[a]);
        p.position.push(x);
        p.velocity.push([0.0; 3].map(|_: f64| 0.1 * (random(&mut seed) - 0.5)));
        p.ledger.push([0.0; 3].map(|_: f64| 1e-12 * (random(&mut seed) - 0.5)));
        p.radius.push(0.5 * diameter);
        p.mass.push(1000.0 * volume);
        p.origin.push((0, k as u32));
    }
    p.id = (1..=n as i64).collect();
    for i in (1..n).rev() {
        p.id.swap(i, (random(&mut seed) * (i + 1) as f64) as usize);
    }
    p
}

/// Air that rises through the bed.
pub fn air(mesh: &Mesh) -> Fluid {
    let wave =
        |c: &[f64; 3], k: f64| [0.1 * (k * c[1]).sin(), 0.9 + 0.1 * (k * c[0]).cos(), 0.1 * (k * c[2]).sin()];
    let field = |k: f64, s: f64| mesh.centre.iter().map(|c| wave(c, k).map(|x| s * x)).collect();
    Fluid {
        velocity: field(60.0, 1.0),
        pressure_gradient: field(80.0, -6000.0),
        stress_divergence: field(90.0, 1.0),
    }
}
