// SPDX-License-Identifier: MIT OR Apache-2.0
//! The forces beside drag, pressure gradient and Archimedes, and the coarse-graining ratio: what a run uses of them.
//!
//! Reads the fluid's last two velocities by cell; writes the explicit force of each particle (N), whose reaction goes
//! to Su through the particle's own weights, and the torque, which has none. Does not know schemes or the ledger.

use super::history::{self, History, Memory};
use super::lift::{Lift, Shear};
use super::parcel::{ParticleStress, felderhof};
use super::rotation;
use crate::interpolate::gradient;
use crate::mesh::{Mesh, NONE};
use std::f64::consts::PI;

/// What is switched on; the default is nothing.
#[derive(Clone)]
pub struct Extra {
    /// parcel diameter / primary diameter, of all particles
    pub ratio: f64,
    /// the same by particle type (NaN: of a type that has none); empty: `ratio` holds for all
    pub ratio_by_type: Vec<f64>,
    /// lift law
    pub lift: Option<&'static dyn Lift>,
    /// C_a; the part −C_a ρ V dv/dt is applied implicitly by the particle program
    pub added_mass: f64,
    /// C_a of each particle by solid fraction and density ratio, instead of `added_mass`
    pub felderhof: bool,
    /// Basset's history force
    pub history: bool,
    /// torque of the fluid's rotation
    pub torque: bool,
    /// MP-PIC stress
    pub stress: Option<ParticleStress>,
    /// each particle is told its added mass, be there any or not: it may be switched on during the run
    pub added_mass_sent: bool,
    /// the memory of the history force travels, be it on or not
    pub memory_sent: bool,
}

impl Default for Extra {
    fn default() -> Self {
        Self {
            ratio: 1.0,
            ratio_by_type: Vec::new(),
            lift: None,
            added_mass: 0.0,
            felderhof: false,
            history: false,
            torque: false,
            stress: None,
            added_mass_sent: false,
            memory_sent: false,
        }
    }
}

/// What the forces look at of one particle, SI units.
#[derive(Clone, Copy, Debug)]
pub struct Each {
    /// of the parcel, m
    pub radius: f64,
    /// coarse-graining ratio
    pub ratio: f64,
    /// u − v, m/s
    pub slip: [f64; 3],
    /// C_a
    pub added_mass: f64,
}

/// ∇ × U from ∂U_a/∂x_b in row a.
fn curl(g: &[[f64; 3]; 3]) -> [f64; 3] {
    [g[2][1] - g[1][2], g[0][2] - g[2][0], g[1][0] - g[0][1]]
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
        self.lift.is_some() || self.added() || self.history
    }
    /// Is there an added mass?
    pub fn added(&self) -> bool {
        self.added_mass > 0.0 || self.felderhof
    }
    /// The particle program gets the added mass of each particle.
    pub fn sends_added_mass(&self) -> bool {
        self.felderhof || self.added_mass_sent
    }
    /// The particle program keeps the memory of the history force.
    pub fn sends_memory(&self) -> bool {
        self.history || self.memory_sent
    }
    /// Coarse-graining ratio of particle i; `kind`: types of all particles.
    #[inline]
    pub fn ratio(&self, kind: &[i64], i: usize) -> f64 {
        if self.ratio_by_type.is_empty() {
            return self.ratio;
        }
        let of = |k: &i64| self.ratio_by_type.get(usize::try_from(*k).ok()?).copied();
        kind.get(i).and_then(of).unwrap_or(f64::NAN)
    }
    /// C_a at a solid fraction and ρ_p/ρ_f.
    pub fn coefficient(&self, solid_fraction: f64, density_ratio: f64) -> f64 {
        if self.felderhof { felderhof(solid_fraction, density_ratio) } else { self.added_mass }
    }

    /// Force (N) of each particle with a host into `out`: lift, C_a ρ V DU/Dt of the added mass, history. `memory`: what
    /// the history left last time, `keep`: what it leaves now. Particles of one cell should follow each other.
    pub fn compute(
        &self,
        flow: &Flow,
        hosts: &[u32],
        each: impl Fn(usize) -> Each,
        memory: &[Memory],
        out: &mut [[f64; 3]],
        keep: &mut [Memory],
    ) {
        let with_gradient = self.lift.is_some() || self.added();
        let (mut last, mut g) = (NONE, [[0.0; 3]; 3]);
        for (i, &host) in hosts.iter().enumerate() {
            if with_gradient && host != last {
                (last, g) = (host, gradient(flow.mesh, flow.velocity, host as usize));
            }
            let Each { radius, ratio, slip, added_mass } = each(i);
            let parcel = ratio.powi(3);
            let diameter = 2.0 * radius / ratio;
            let lift = self.lift.map_or([0.0; 3], |l| {
                let (kinematic_viscosity, density) = (flow.kinematic_viscosity, flow.density);
                l.force(&Shear { diameter, slip, vorticity: curl(&g), kinematic_viscosity, density })
            });
            let mass = added_mass * flow.density * PI / 6.0 * diameter.powi(3);
            let u = flow.velocity[host as usize];
            for a in 0..3 {
                let rate = flow.before.get(host as usize).map_or(0.0, |b| (u[a] - b[a]) / flow.period);
                let along = u[0] * g[a][0] + u[1] * g[a][1] + u[2] * g[a][2];
                out[i][a] = parcel * (lift[a] + mass * (rate + along));
            }
            if self.history {
                let mut past = memory.get(i).map_or_else(History::default, History::from);
                let integral = past.advance(slip, flow.period);
                let size = parcel * history::coefficient(diameter, flow.density, flow.kinematic_viscosity);
                (0..3).for_each(|a| out[i][a] += size * integral[a]);
                keep[i] = Memory::from(&past);
            }
        }
    }

    /// Torque K_ω (W − ω) on a particle in a cell where the fluid's velocity gradient is `g`: K_ω (N m s) and W = ½ ∇ × U
    /// (rad/s); `nu` (m2/s), `density` (kg/m3) of the fluid, `spin` ω (rad/s).
    pub fn torque(
        (nu, density): (f64, f64),
        g: &[[f64; 3]; 3],
        radius: f64,
        ratio: f64,
        spin: [f64; 3],
    ) -> (f64, [f64; 3]) {
        let rotation = curl(g).map(|x| 0.5 * x);
        let slip = [0, 1, 2].map(|a| rotation[a] - spin[a]);
        let k = rotation::coefficient(2.0 * radius / ratio, slip, nu, density);
        (k * ratio.powi(5), rotation)
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
