// SPDX-License-Identifier: MIT OR Apache-2.0
//! Stage 5, interpolate: the fluid velocity that enters the drag.
//!
//! Reads the fluid velocity of the cells (m/s) and the gathered velocity; writes u at a particle.
//! Whatever is chosen, the difference d = u − ũ goes through the defect correction (design §2.2).

use crate::mesh::Mesh;

/// How u_i is read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FluidVelocity {
    /// ũ_i = Σ_k m_ik (G U)_k, adjoint of the spreading; biased by (b²/4) ∇²U
    Gather,
    /// U of the host cell
    HostCell,
    /// host cell and its least-squares gradient
    Linear,
}

impl FluidVelocity {
    /// Names in case.toml.
    pub const NAMES: &[&str] = &["gather", "host-cell", "linear"];
    /// By name.
    pub fn by_name(name: &str) -> Option<Self> {
        let all = [Self::Gather, Self::HostCell, Self::Linear];
        Self::NAMES.iter().position(|n| *n == name).map(|i| all[i])
    }
}

/// u at a particle in cell `host` at `position` (m); `gathered` is ũ.
pub fn fluid_velocity(
    how: FluidVelocity,
    mesh: &Mesh,
    fluid: &[[f64; 3]],
    host: usize,
    position: [f64; 3],
    gathered: [f64; 3],
) -> [f64; 3] {
    let u = fluid[host];
    match how {
        FluidVelocity::Gather => gathered,
        FluidVelocity::HostCell => u,
        FluidVelocity::Linear => {
            let r = [0, 1, 2].map(|a| position[a] - mesh.centre[host][a]);
            let g = gradient(mesh, fluid, host);
            [0, 1, 2].map(|c| u[c] + r[0] * g[c][0] + r[1] * g[c][1] + r[2] * g[c][2])
        }
    }
}

/// Least-squares gradient of the velocity over the face neighbours; directions without neighbours get zero.
pub fn gradient(mesh: &Mesh, fluid: &[[f64; 3]], host: usize) -> [[f64; 3]; 3] {
    let (mut m, mut b) = ([[0.0; 3]; 3], [[0.0; 3]; 3]);
    for side in mesh.sides(host).iter().filter(|s| s.across != crate::mesh::NONE) {
        let other = side.across as usize;
        let r = mesh.way(host, side);
        let w = 1.0 / (r[0] * r[0] + r[1] * r[1] + r[2] * r[2]);
        for i in 0..3 {
            (0..3).for_each(|j| m[i][j] += w * r[i] * r[j]);
            (0..3).for_each(|c| b[c][i] += w * r[i] * (fluid[other][c] - fluid[host][c]));
        }
    }
    // 2-D and 1-D meshes: a direction without neighbours has no equation
    for i in 0..3 {
        if m[i][i] < 1e-12 {
            m[i] = [0.0; 3];
            (0..3).for_each(|j| m[j][i] = 0.0);
            m[i][i] = 1.0;
            (0..3).for_each(|c| b[c][i] = 0.0);
        }
    }
    let cof = |i: usize, j: usize| {
        let (a, b, c, d) = ((i + 1) % 3, (i + 2) % 3, (j + 1) % 3, (j + 2) % 3);
        m[a][c] * m[b][d] - m[a][d] * m[b][c]
    };
    let det = m[0][0] * cof(0, 0) + m[0][1] * cof(0, 1) + m[0][2] * cof(0, 2);
    if det.abs() < 1e-12 {
        return [[0.0; 3]; 3];
    }
    [0, 1, 2].map(|c| [0, 1, 2].map(|i| (0..3).map(|j| cof(j, i) * b[c][j]).sum::<f64>() / det))
}
