// SPDX-License-Identifier: MIT OR Apache-2.0
//! A scene measured on a recording: at most `SAMPLES` of its exchanges, spread over all.
//!
//! Reads particles, fluid, voidage and drive as recorded; forces are root mean squares over the particles. Where the
//! exchange before is recorded too, accelerations are differences; else they follow from the forces.

use super::{Scene, Term};
use crate::config::{Config, Continuity, Feedback, GravityTreatment, Model};
use crate::forces::{self, lift, parcel::ParticleStress};
use crate::interpolate::gradient;
use crate::locate::Locator;
use crate::mesh::NONE;
use crate::particles::Particles;
use crate::record::RecordError;
use crate::record::moment::{Messages, Moments};
use crate::sums::norm;
use std::collections::HashMap;
use std::f64::consts::PI;
use std::io::{Read, Seek};
use voidage_wire::{field, kind};

/// Exchanges looked at.
const SAMPLES: usize = 5;
type V = [f64; 3];

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

/// Sums over the samples.
#[derive(Default)]
struct Forces {
    drag: Rms,
    weight: Rms,
    archimedes: Rms,
    pressure: Rms,
    viscous: Rms,
    added: Rms,
    history: Rms,
    /// Σ of what a lasting mean acceleration would give, and its number
    lasting: (V, f64),
    lift: Rms,
    magnus: Rms,
    stress: Rms,
    hindrance: Rms,
    continuity: Rms,
    feedback: Rms,
    measured: bool,
}

/// Spin of all particles (1/s), in the order of `p`; zero where the DEM does not send it.
fn spin(m: &Messages, p: &Particles) -> Result<Vec<V>, RecordError> {
    let frames = m.frames(kind::PARTICLES)?;
    let one = |o: &(u32, u32)| -> Option<V> {
        let all = frames.get(o.0 as usize)?.f64s(field::ANGULAR_VELOCITY).ok()?;
        all.get(3 * o.1 as usize..)?.get(..3).map(|v| [v[0], v[1], v[2]])
    };
    Ok(p.origin.iter().map(|o| one(o).unwrap_or_default()).collect())
}

/// What the exchange before left, to measure accelerations.
struct Before {
    velocity: HashMap<i64, V>,
    fluid: Vec<V>,
}

/// Measures the scene of a recording with the settings of `c`.
pub fn scene<R: Read + Seek>(m: &mut Moments<R>, c: &Config) -> Result<Scene, RecordError> {
    let f = &c.file;
    let law = forces::by_name(&f.forces.drag);
    let g = norm(f.fluid.gravity);
    let mut s = Scene {
        cells: Some(m.mesh.len()),
        bounds: Some(m.mesh.bounds),
        fluid_density: f.fluid.density,
        kinematic_viscosity: f.fluid.kinematic_viscosity,
        gravity: g,
        bandwidth: f.smooth.bandwidth,
        smoothed: f.smooth.method != "none",
        period: c.period(),
        dem_step: f.dem.time_step,
        explicit: f.coupling.scheme == "explicit",
        ..Scene::default()
    };
    m.mesh.volume.iter().for_each(|v| s.cell_size.add(v.cbrt()));
    let total: f64 = m.mesh.volume.iter().sum();
    let locator = Locator::new(&m.mesh);
    let mut x = Forces::default();
    let (mut solids, mut exchange, mut samples) = (0.0, Rms::default(), 0);
    let n = m.exchanges.len();
    let mut chosen: Vec<usize> = (0..SAMPLES.min(n)).map(|i| (i + 1) * n / SAMPLES.min(n) - 1).collect();
    chosen.dedup();
    let mut list = Vec::new();
    for at in chosen {
        let k = m.exchanges[at].0;
        let earlier = match at.checked_sub(1).filter(|b| m.exchanges[*b].0 == k - 1) {
            None => None,
            Some(b) => match m.at(b)? {
                None => None,
                Some(e) => {
                    let p = e.particles()?;
                    let velocity = p.id.iter().copied().zip(p.velocity.iter().copied()).collect();
                    Some(Before { velocity, fluid: e.fluid(&m.mesh)?.velocity })
                }
            },
        };
        let Some(now) = m.at(at)? else { continue };
        list.push(k);
        samples += 1;
        one(&mut s, &mut x, m, &now, earlier.as_ref(), c, law, &locator, &mut solids, &mut exchange)?;
    }
    if samples == 0 {
        return Err(RecordError::NoExchange);
    }
    s.from = format!("exchanges {list:?} of {n} recorded");
    s.solid_fraction = Some(solids / f64::from(samples) / total);
    if exchange.1 > 0.0 {
        s.fluid_relaxation = Some(f.fluid.density / exchange.value());
    }
    terms(&mut s, &x, c);
    Ok(s)
}

#[allow(clippy::too_many_arguments)] // sums of one loop
fn one<R: Read + Seek>(
    s: &mut Scene,
    x: &mut Forces,
    m: &Moments<R>,
    now: &Messages,
    before: Option<&Before>,
    c: &Config,
    law: Option<&'static dyn forces::DragLaw>,
    locator: &Locator,
    solids: &mut f64,
    exchange: &mut Rms,
) -> Result<(), RecordError> {
    let (f, mesh) = (&c.file, &m.mesh);
    let mut p = now.particles()?;
    let (fluid, q, drive) = (now.fluid(mesh)?, now.sources(mesh)?, now.drive(&p)?);
    let omega = spin(now, &p)?;
    let mut hosts = vec![NONE; p.len()];
    // those outside keep no host and are left out
    for lost in locator.locate(mesh, &mut p.position, &mut hosts).err().unwrap_or_default() {
        hosts[lost.index] = NONE;
    }
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
        *solids += v;
        s.diameter.add(d);
        s.density.add(mass / v);
        let e = q.voidage[j].clamp(1e-3, 1.0);
        s.solid_fraction_seen.add(1.0 - e);
        x.weight.add(mass * s.gravity);
        x.archimedes.add(rho * v * s.gravity);
        x.pressure.add(v * norm(at(&fluid.pressure_gradient, j)));
        x.viscous.add(v * norm(at(&fluid.stress_divergence, j)));
        let Some(k) = drive.drag_coefficient.get(i).copied() else { continue };
        let slip = [0, 1, 2].map(|a| drive.velocity[i][a] - p.velocity[i][a]);
        let drag = k * norm(slip);
        s.slip.add(norm(slip));
        x.drag.add(drag);
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
                x.hindrance.add(law.drag_coefficient(&at(e)) / alone - 1.0);
            }
        }
        let grad = gradient(mesh, &fluid.velocity, j);
        let u = fluid.velocity[j];
        let along = [0, 1, 2].map(|a| u[0] * grad[a][0] + u[1] * grad[a][1] + u[2] * grad[a][2]);
        let earlier = before.and_then(|b| Some((b.velocity.get(&p.id[i])?, b.fluid.get(j)?)));
        let relative = match earlier {
            Some((v0, u0)) => {
                x.measured = true;
                let rate = |a: usize| (u[a] - u0[a] - (p.velocity[i][a] - v0[a])) / s.period;
                [0, 1, 2].map(|a| rate(a) + along[a])
            }
            None => {
                [0, 1, 2].map(|a| along[a] - (k * slip[a] + drive.force[i][a]) / mass - f.fluid.gravity[a])
            }
        };
        x.added.add(0.5 * rho * v * norm(relative));
        // the mean acceleration lasts as long as the slip relaxes, what differs from particle to particle one step
        let basset = 2.0 * ratio.powi(3) * forces::history::coefficient(primary, rho, nu);
        let remembered = if k > 0.0 { (mass / k).max(s.period) } else { s.period };
        x.history.add(basset * s.period.sqrt() * norm(relative));
        (0..3).for_each(|a| x.lasting.0[a] += basset * remembered.sqrt() * relative[a]);
        x.lasting.1 += 1.0;
        let vorticity = [grad[2][1] - grad[1][2], grad[0][2] - grad[2][0], grad[1][0] - grad[0][1]];
        let shear = lift::Shear { diameter: primary, slip, vorticity, kinematic_viscosity: nu, density: rho };
        let law = lift::all().iter().find(|l| l.name() == "loth");
        x.lift.add(law.map_or(0.0, |l| ratio.powi(3) * norm(l.force(&shear))));
        let turn = [0, 1, 2].map(|a| 0.5 * vorticity[a] - omega[i][a]);
        x.magnus.add(ratio.powi(3) * PI / 8.0 * rho * primary.powi(3) * norm(turn) * norm(slip));
        if parcels {
            x.stress.add(norm(forces::Extra::stress_force(mesh, &tau, j, v, 1.0 - q.voidage[j])));
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
        exchange.add(coefficient[j] / (mesh.volume[j] * e.max(1e-3)));
        if u > 0.0 {
            x.continuity.add((e - old) / s.period * mesh.volume[j].cbrt() / (e * u));
            let given = [0, 1, 2].map(|a| q.su[j][a] - q.sp[j] * fluid.velocity[j][a]);
            x.feedback.add(norm(given) * length / (rho * e * u * u));
        }
    }
    Ok(())
}

fn terms(s: &mut Scene, x: &Forces, c: &Config) {
    let f = &c.file;
    let scale = x.drag.value().max(x.weight.value()).max(f64::MIN_POSITIVE);
    let to = if x.drag.value() >= x.weight.value() { "drag" } else { "weight" };
    let acceleration = if x.measured { "measured accelerations" } else { "accelerations from the forces" };
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
    let history = x.history.value().hypot(lasting) / scale;
    put(
        "history (Basset)",
        history,
        to,
        "mean acceleration lasting m/K, rest one step",
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
        put("voidage in the drag", x.hindrance.value(), "drag alone", "|K(eps)/K(1) - 1|", true, None, None);
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
