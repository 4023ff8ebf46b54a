// SPDX-License-Identifier: MIT OR Apache-2.0
//! The forces beside drag, pressure gradient and Archimedes, and the coarse-graining ratio: what a run uses of them.
//!
//! Reads the fluid's last two velocities by cell; writes the explicit force of each particle (N), whose reaction goes
//! to Su through the particle's own weights. Does not know schemes or the ledger.

use super::lift::{Lift, Shear};
use super::parcel::ParticleStress;
use crate::interpolate::gradient;
use crate::mesh::{Mesh, NONE};
use std::f64::consts::PI;

/// What is switched on; the default is nothing.
#[derive(Clone, Copy)]
pub struct Extra {
    /// parcel diameter / primary diameter
    pub ratio: f64,
    /// lift law
    pub lift: Option<&'static dyn Lift>,
    /// C_a; the part −C_a ρ V dv/dt is applied implicitly by the particle program
    pub added_mass: f64,
    /// MP-PIC stress
    pub stress: Option<ParticleStress>,
}

impl Default for Extra {
    fn default() -> Self {
        Self { ratio: 1.0, lift: None, added_mass: 0.0, stress: None }
    }
}

/// The fluid's last steps by cell.
pub struct Flow<'a> {
    /// mesh of the fields
    pub mesh: &'a Mesh,
    /// U, m/s
    pub velocity: &'a [[f64; 3]],
    /// U one step earlier, m/s; empty: not known
    pub before: &'a [[f64; 3]],
    /// time between the two, s
    pub period: f64,
    /// ρ_f, kg/m3
    pub density: f64,
    /// ν, m2/s
    pub kinematic_viscosity: f64,
}

impl Extra {
    /// Is there an explicit force to compute?
    pub fn forces(&self) -> bool {
        self.lift.is_some() || self.added_mass > 0.0
    }

    /// Force (N) of each particle with a host into `out`: lift, and C_a ρ V DU/Dt of the added mass. `radius` (m) and
    /// `slip` (u − v, m/s) by particle; particles of one cell should follow each other.
    pub fn compute(
        &self,
        flow: &Flow,
        hosts: &[u32],
        radius: &[f64],
        slip: impl Fn(usize) -> [f64; 3],
        out: &mut [[f64; 3]],
    ) {
        let (mut last, mut g) = (NONE, [[0.0; 3]; 3]);
        for (i, &host) in hosts.iter().enumerate() {
            if host != last {
                (last, g) = (host, gradient(flow.mesh, flow.velocity, host as usize));
            }
            let parcel = self.ratio.powi(3);
            let diameter = 2.0 * radius[i] / self.ratio;
            let lift = self.lift.map_or([0.0; 3], |l| {
                let vorticity = [g[2][1] - g[1][2], g[0][2] - g[2][0], g[1][0] - g[0][1]];
                let (kinematic_viscosity, density) = (flow.kinematic_viscosity, flow.density);
                l.force(&Shear { diameter, slip: slip(i), vorticity, kinematic_viscosity, density })
            });
            let mass = self.added_mass * flow.density * PI / 6.0 * diameter.powi(3);
            let u = flow.velocity[host as usize];
            for a in 0..3 {
                let rate = flow.before.get(host as usize).map_or(0.0, |b| (u[a] - b[a]) / flow.period);
                let along = u[0] * g[a][0] + u[1] * g[a][1] + u[2] * g[a][2];
                out[i][a] = parcel * (lift[a] + mass * (rate + along));
            }
        }
    }

    /// Force (N) of the particles' stress, −V/ε_s ∇τ; `tau` (Pa) by cell in component 0.
    pub fn stress_force(
        mesh: &Mesh,
        tau: &[[f64; 3]],
        host: usize,
        volume: f64,
        solid_fraction: f64,
    ) -> [f64; 3] {
        let g = gradient(mesh, tau, host)[0];
        g.map(|x| -volume / solid_fraction.max(1e-6) * x)
    }
}
