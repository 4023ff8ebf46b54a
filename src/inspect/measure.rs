// SPDX-License-Identifier: MIT OR Apache-2.0
//! Magnitudes of the terms in one exchange, whether it is at hand or recorded: root mean squares over the particles, in
//! the order of their table, on one thread, so that the bits depend on nothing else.
//!
//! Reads particles with their hosts, fluid, voidage, sources and drive, SI units; writes sums. Where particles and fluid of
//! the exchange before are known, accelerations are differences; else they follow from the forces. Does not know
//! recordings, nor what is made of the numbers.

use super::{Scene, Term};
use crate::config::{Config, Continuity, Feedback, GravityTreatment, Model};
use crate::forces::{self, DragLaw, history::History, lift, parcel::ParticleStress};
use crate::interpolate::gradient;
use crate::mesh::{Mesh, NONE};
use crate::particles::Particles;
use crate::step::{Drive, Fluid, Sources};
use crate::sums::norm;
use std::collections::HashMap;
use std::f64::consts::PI;

type V = [f64; 3];

/// What the exchange before left, to measure accelerations.
#[derive(Clone, Debug, Default)]
pub struct Before {
    /// particle velocity by id, m/s
    pub velocity: HashMap<i64, V>,
    /// fluid velocity by cell slot, m/s
    pub fluid: Vec<V>,
}

impl Before {
    /// Of an exchange.
    pub fn of(p: &Particles, fluid: &[V]) -> Self {
        let velocity = p.id.iter().copied().zip(p.velocity.iter().copied()).collect();
        Self { velocity, fluid: fluid.to_vec() }
    }
}

/// One exchange.
#[derive(Clone, Copy)]
#[allow(missing_docs)]
pub struct View<'a> {
    pub mesh: &'a Mesh,
    pub particles: &'a Particles,
    /// host cell of each particle; those without are left out
    pub hosts: &'a [u32],
    pub fluid: &'a Fluid,
    pub sources: &'a Sources,
    pub drive: &'a Drive,
    pub before: Option<&'a Before>,
}

/// Root mean square.
#[derive(Default)]
struct Rms(f64, f64);
impl Rms {
    fn add(&mut self, x: f64) {
        self.0 += x * x;
        self.1 += 1.0;
    }
    fn value(&self) -> f64 {
        if self.1 > 0.0 { (self.0 / self.1).sqrt() } else { 0.0 }
    }
}

/// Sums over exchanges.
#[derive(Default)]
pub struct Sums {
    drag: Rms,
    weight: Rms,
    archimedes: Rms,
    pressure: Rms,
    viscous: Rms,
    added: Rms,
    history: Rms,
    /// the history force as computed, where it is on and the particles bring its memory
    remembered: Rms,
    /// Σ of what a lasting mean acceleration would give, and its number
    lasting: (V, f64),
    lift: Rms,
    magnus: Rms,
    stress: Rms,
    hindrance: Rms,
    continuity: Rms,
    feedback: Rms,
    /// Σ K/(V ε) of the cells, kg/(m3 s)
    exchange: Rms,
    /// Σ V of the particles, m3
    solids: f64,
    exchanges: f64,
    /// accelerations are differences
    measured: bool,
}

impl Sums {
    /// Adds an exchange, and what it tells of sizes and speeds to `s`; `law`: drag law of the case.
    pub fn add(&mut self, s: &mut Scene, view: &View, c: &Config, law: Option<&'static dyn DragLaw>) {
        let (f, View { mesh, particles: p, hosts, fluid, sources: q, drive, before }) = (&c.file, *view);
        self.exchanges += 1.0;
        s.particles.add(p.len() as f64);
        let (rho, nu) = (f.fluid.density, f.fluid.kinematic_viscosity);
        let (all, by_type) = (f.dem.coarse_graining.of_all(), f.dem.coarse_graining.by_type());
        let ratio_of = |i: usize| {
            let of_type = |k: &i64| by_type.get(usize::try_from(*k).ok()?).copied();
            p.asked.kind.get(i).and_then(of_type).unwrap_or(all)
        };
        let at = |field: &[V], j: usize| field.get(j).copied().unwrap_or_default();
        let stress = ParticleStress {
            pressure: if f.forces.particle_stress > 0.0 { f.forces.particle_stress } else { 10.0 },
            exponent: f.forces.particle_stress_exponent,
            close_packing: f.forces.close_packing,
            floor: 1e-7,
        };
        let parcels = all > 1.0 || !by_type.is_empty() || f.forces.particle_stress > 0.0;
        let tau: Vec<V> = if parcels {
            q.voidage.iter().map(|e| [stress.stress(1.0 - e), 0.0, 0.0]).collect()
        } else {
            Vec::new()
        };
        let mut coefficient = vec![0.0; mesh.len()];
        for i in (0..p.len()).filter(|i| hosts[*i] != NONE) {
            let (j, v, mass, d) = (hosts[i] as usize, p.volume(i), p.mass[i], 2.0 * p.radius[i]);
            let ratio = ratio_of(i);
            let primary = d / ratio;
            self.solids += v;
            s.diameter.add(d);
            s.density.add(mass / v);
            let e = q.voidage[j].clamp(1e-3, 1.0);
            s.solid_fraction_seen.add(1.0 - e);
            self.weight.add(mass * s.gravity);
            self.archimedes.add(rho * v * s.gravity);
            let p_j = at(&fluid.pressure_gradient, j);
            self.pressure.add(v * norm([0, 1, 2].map(|a| p_j[a] + f.fluid.mean_pressure_gradient[a])));
            self.viscous.add(v * norm(at(&fluid.stress_divergence, j)));
            let Some(k) = drive.drag_coefficient.get(i).copied() else { continue };
            let slip = [0, 1, 2].map(|a| drive.velocity[i][a] - p.velocity[i][a]);
            let drag = k * norm(slip);
            s.slip.add(norm(slip));
            self.drag.add(drag);
            coefficient[j] += k;
            if k > 0.0 {
                s.relaxation.add(mass / k);
            }
            if let Some(law) = law.filter(|_| !parcels) {
                let at = |voidage| forces::Slip {
                    diameter: primary,
                    voidage,
                    speed: norm(slip),
                    kinematic_viscosity: nu,
                    density: rho,
                };
                let alone = law.drag_coefficient(&at(1.0));
                if alone > 0.0 {
                    self.hindrance.add(law.drag_coefficient(&at(e)) / alone - 1.0);
                }
            }
            let grad = gradient(mesh, &fluid.velocity, j);
            let u = fluid.velocity[j];
            let along = [0, 1, 2].map(|a| u[0] * grad[a][0] + u[1] * grad[a][1] + u[2] * grad[a][2]);
            let earlier = before.and_then(|b| Some((b.velocity.get(&p.id[i])?, b.fluid.get(j)?)));
            let relative = match earlier {
                Some((v0, u0)) => {
                    self.measured = true;
                    let rate = |a: usize| (u[a] - u0[a] - (p.velocity[i][a] - v0[a])) / s.period;
                    [0, 1, 2].map(|a| rate(a) + along[a])
                }
                None => [0, 1, 2]
                    .map(|a| along[a] - (k * slip[a] + drive.force[i][a]) / mass - f.fluid.gravity[a]),
            };
            self.added.add(0.5 * rho * v * norm(relative));
            // the mean acceleration lasts as long as the slip relaxes, what differs from particle to particle one step
            let basset = 2.0 * ratio.powi(3) * forces::history::coefficient(primary, rho, nu);
            let remembered = if k > 0.0 { (mass / k).max(s.period) } else { s.period };
            self.history.add(basset * s.period.sqrt() * norm(relative));
            (0..3).for_each(|a| self.lasting.0[a] += basset * remembered.sqrt() * relative[a]);
            self.lasting.1 += 1.0;
            if let Some(memory) = p.asked.memory.get(i).filter(|_| f.forces.history) {
                let slip = [0, 1, 2].map(|a| u[a] - p.velocity[i][a]);
                let integral = History::from(memory).advance(slip, s.period);
                self.remembered.add(0.5 * basset * norm(integral));
            }
            let vorticity = [grad[2][1] - grad[1][2], grad[0][2] - grad[2][0], grad[1][0] - grad[0][1]];
            let shear =
                lift::Shear { diameter: primary, slip, vorticity, kinematic_viscosity: nu, density: rho };
            let law = lift::by_name("loth");
            self.lift.add(law.map_or(0.0, |l| ratio.powi(3) * norm(l.force(&shear))));
            let omega = p.asked.spin.get(i).copied().unwrap_or_default();
            let turn = [0, 1, 2].map(|a| 0.5 * vorticity[a] - omega[a]);
            self.magnus.add(ratio.powi(3) * PI / 8.0 * rho * primary.powi(3) * norm(turn) * norm(slip));
            if parcels {
                self.stress.add(norm(forces::Extra::stress_force(mesh, &tau, j, v, 1.0 - q.voidage[j])));
            }
        }
        let length = s.length().unwrap_or(0.0);
        for j in 0..mesh.len() {
            let (e, old, u) = (q.voidage[j], q.voidage_old[j], norm(fluid.velocity[j]));
            s.fluid_speed.add(u);
            if coefficient[j] == 0.0 {
                continue;
            }
            s.solid_fraction_cells.add(1.0 - e);
            self.exchange.add(coefficient[j] / (mesh.volume[j] * e.max(1e-3)));
            if u > 0.0 {
                self.continuity.add((e - old) / s.period * mesh.volume[j].cbrt() / (e * u));
                let given = [0, 1, 2].map(|a| q.su[j][a] - q.sp[j] * fluid.velocity[j][a]);
                self.feedback.add(norm(given) * length / (rho * e * u * u));
            }
        }
    }

    /// Share of the mesh's volume that is solid, from all exchanges.
    pub fn solid_fraction(&self, mesh: &Mesh) -> f64 {
        self.solids / self.exchanges / mesh.volume.iter().sum::<f64>()
    }
    /// ρ_f ε V/Σ K, s; `density` ρ_f, kg/m3. None without drag.
    pub fn fluid_relaxation(&self, density: f64) -> Option<f64> {
        (self.exchange.1 > 0.0).then(|| density / self.exchange.value())
    }

    /// The terms, each with its magnitude, into `s`.
    pub fn terms(&self, s: &mut Scene, c: &Config) {
        let x = self;
        let f = &c.file;
        let scale = x.drag.value().max(x.weight.value()).max(f64::MIN_POSITIVE);
        let to = if x.drag.value() >= x.weight.value() { "drag" } else { "weight" };
        let acceleration =
            if x.measured { "measured accelerations" } else { "accelerations from the forces" };
        let mut put = |name, relative: f64, to, how, now, on, off| {
            s.terms.push(Term { name, relative, to, how, now, on, off });
        };
        let model_a = f.coupling.model == Model::A;
        put("drag", x.drag.value() / scale, to, "recorded", f.forces.drag != "none", None, None);
        put(
            "pressure gradient",
            x.pressure.value() / scale,
            to,
            "recorded, not smoothed",
            model_a && f.forces.pressure_gradient,
            Some("coupling.model = \"A\", forces.pressure_gradient = true"),
            Some("coupling.model = \"B\", forces.pressure_gradient = false"),
        );
        put(
            "viscous stress",
            x.viscous.value() / scale,
            to,
            "recorded, not smoothed",
            model_a && f.forces.viscous_stress,
            Some("coupling.model = \"A\", forces.viscous_stress = true"),
            Some("forces.viscous_stress = false (model B)"),
        );
        let archimedes = f.fluid.gravity_treatment == GravityTreatment::Archimedes;
        put(
            "Archimedes",
            x.archimedes.value() / scale,
            to,
            "rho_f V g",
            archimedes || f.fluid.gravity_treatment == GravityTreatment::InPressure,
            Some("fluid.gravity_treatment = \"archimedes\""),
            Some("fluid.gravity_treatment = \"none\""),
        );
        put(
            "added mass",
            x.added.value() / scale,
            to,
            acceleration,
            f.forces.added_mass.on(),
            Some("forces.added_mass = 0.5"),
            Some("forces.added_mass = 0"),
        );
        let lasting = norm(x.lasting.0) / x.lasting.1.max(1.0);
        // the tail of the past fades slowly, long after the acceleration: where the force is there, it tells
        let (estimate, real) = (x.history.value().hypot(lasting), x.remembered.value());
        let history = estimate.max(real) / scale;
        put(
            "history (Basset)",
            history,
            to,
            if real > estimate {
                "force as computed"
            } else {
                "mean acceleration lasting m/K, rest one step"
            },
            f.forces.history,
            Some("forces.history = true"),
            Some("forces.history = false"),
        );
        put(
            "lift",
            x.lift.value() / scale,
            to,
            "Loth, vorticity of the cells",
            f.forces.lift != "none",
            Some("forces.lift = \"loth\""),
            Some("forces.lift = \"none\""),
        );
        put("rotation (Magnus)", x.magnus.value() / scale, to, "Rubinow & Keller", false, None, None);
        if x.stress.1 > 0.0 {
            put(
                "particle stress (MP-PIC)",
                x.stress.value() / scale,
                to,
                "P of the case, or 10 Pa",
                f.forces.particle_stress > 0.0,
                Some("forces.particle_stress = 10"),
                Some("forces.particle_stress = 0"),
            );
        }
        if x.hindrance.1 > 0.0 {
            put(
                "voidage in the drag",
                x.hindrance.value(),
                "drag alone",
                "|K(eps)/K(1) - 1|",
                true,
                None,
                None,
            );
        }
        put(
            "voidage rate in continuity",
            x.continuity.value(),
            "eps U/h",
            "d eps/dt recorded",
            f.coupling.feedback == Feedback::TwoWay && f.coupling.continuity != Continuity::SolidsFlux,
            Some("coupling.continuity = \"voidage-rate\""),
            Some("coupling.feedback = \"one-way\""),
        );
        put(
            "feedback on the fluid",
            x.feedback.value(),
            "rho U2/L",
            "Su - Sp U recorded",
            f.coupling.feedback == Feedback::TwoWay,
            Some("coupling.feedback = \"two-way\""),
            Some("coupling.feedback = \"one-way\""),
        );
        super::decide::smoothing(s, f.smooth.method != "none");
    }
}
