// SPDX-License-Identifier: MIT OR Apache-2.0
//! From a case to the objects of a run: methods by name, settings for the partners, agreement of the programs.

use crate::auto::{self, Watch};
use crate::config::{Config, Feedback, Flow, GravityTreatment, InInterval, Model};
use crate::interpolate::FluidVelocity;
use crate::map::Mapping;
use crate::mesh::Mesh;
use crate::output::restart::State;
use crate::partners::Partners;
use crate::smooth::{self, Classes, Diffusion, Pinned, Smoother};
use crate::step::{CouplingStep, Setup};
use crate::{forces, map, scheme, threads};
use std::borrow::Cow;
use voidage_wire::{Transport, Welcome};

/// The forces beside drag.
pub fn extra(c: &Config) -> forces::Extra {
    let (f, x) = (&c.file, &c.file.forces);
    let stress = forces::parcel::ParticleStress {
        pressure: x.particle_stress,
        exponent: x.particle_stress_exponent,
        close_packing: x.close_packing,
        floor: 1e-7,
    };
    forces::Extra {
        ratio: f.dem.coarse_graining.of_all(),
        ratio_by_type: f.dem.coarse_graining.by_type(),
        lift: forces::lift::by_name(&x.lift),
        added_mass: x.added_mass.coefficient(),
        felderhof: x.added_mass.law(),
        history: x.history,
        torque: x.torque,
        stress: (x.particle_stress > 0.0).then_some(stress),
        added_mass_sent: auto::live(f, auto::ADDED_MASS),
        memory_sent: auto::live(f, auto::HISTORY),
    }
}

/// The step's settings.
pub fn setup(c: &Config) -> Result<Setup, String> {
    let f = &c.file;
    let unknown = |what: &str, name: &str| format!("{what} = \"{name}\" is not known");
    let archimedes = f.fluid.gravity_treatment == GravityTreatment::Archimedes;
    let model_a = f.coupling.model == Model::A;
    let x = &f.forces;
    let options = forces::DragOptions {
        sphericity: x.sphericity,
        switch_voidage: x.switch_voidage,
        filter_diameter: x.filter_diameter,
        filter_density: x.filter_density,
        density: f.fluid.density,
        kinematic_viscosity: f.fluid.kinematic_viscosity,
        parcel_factor: 0.05,
        ratio: f.dem.coarse_graining.of_all(),
    };
    Ok(Setup {
        drag: forces::build(&f.forces.drag, &options)
            .ok_or_else(|| unknown("forces.drag", &f.forces.drag))?,
        scheme: scheme::by_name(&f.coupling.scheme)
            .ok_or_else(|| unknown("coupling.scheme", &f.coupling.scheme))?,
        fluid_velocity: FluidVelocity::by_name(&f.interpolate.fluid_velocity)
            .ok_or_else(|| unknown("interpolate.fluid_velocity", &f.interpolate.fluid_velocity))?,
        model_b: !model_a,
        two_way: f.coupling.feedback == Feedback::TwoWay,
        pressure_force: model_a && f.forces.pressure_gradient,
        archimedes: if archimedes { f.fluid.gravity } else { [0.0; 3] },
        mean_pressure_gradient: if model_a { f.fluid.mean_pressure_gradient } else { [0.0; 3] },
        gravity: f.fluid.gravity,
        solids_flux: f.coupling.continuity == crate::config::Continuity::SolidsFlux,
        density: f.fluid.density,
        kinematic_viscosity: f.fluid.kinematic_viscosity,
        period: c.period(),
        voidage_min: f.limits.voidage_min,
        exclude_outside: f.limits.outside == "exclude",
        extra: extra(c),
        average: smooth::TimeAverage::new(c.period(), f.smooth.time),
    })
}

/// Threads for the stages; none if one is enough.
pub fn pool(c: &Config) -> Result<Option<rayon::ThreadPool>, String> {
    threads::pool(c.file.run.threads as usize)
}

/// The mapping by name, ready for the mesh.
pub fn mapping(c: &Config, mesh: &Mesh) -> Result<Box<dyn Mapping>, String> {
    let name = &c.file.map.method;
    let found = map::by_name(name, mesh);
    let mut mapping = found.ok_or_else(|| format!("map.method = \"{name}\" is not known"))?;
    mapping.prepare(mesh, &map::Options { bandwidth: c.file.smooth.bandwidth, grid: c.file.map.grid });
    Ok(mapping)
}

/// Classes of particle sizes.
pub fn classes(c: &Config, mesh: &Mesh) -> Classes {
    Classes::new(mesh, &c.file.smooth.by_diameter, c.file.smooth.bandwidth)
}

/// The mesh with the links that smoothing goes along.
pub fn linked<'a>(c: &Config, mesh: &'a Mesh) -> Cow<'a, Mesh> {
    if links(c, mesh) == "voronoi" { Cow::Owned(mesh.with_voronoi_links()) } else { Cow::Borrowed(mesh) }
}

/// The links meant by `smooth.links`: `auto` is `voronoi` on tetrahedra, whose faces are oblique to the lines between centres. Those of the
/// faces, which are there, if nothing is smoothed.
pub fn links<'a>(c: &'a Config, mesh: &Mesh) -> &'a str {
    match c.file.smooth.links.as_str() {
        _ if !smooths(c) => "faces",
        "auto" if mesh.tetrahedral() => "voronoi",
        "auto" => "faces",
        name => name,
    }
}

/// Something is smoothed.
fn smooths(c: &Config) -> bool {
    c.file.smooth.method != "none" || c.file.coupling.void_velocity == "pinned"
}

/// R's continuation of the solids velocity, if it is asked for; `mesh` is the linked one.
pub fn pinned(c: &Config, mesh: &Mesh) -> Option<Pinned> {
    let s = &c.file.smooth;
    let t = Diffusion { bandwidth: s.bandwidth, largest_cell: s.largest_cell, ..Diffusion::default() };
    (c.file.coupling.void_velocity == "pinned").then(|| Pinned::new(mesh, &t.links(mesh)))
}

/// The smoother asked for and the positive one for redone steps, on the rows of all classes; `mesh` is the linked one,
/// `variance` is taken out.
pub fn smoothers(
    c: &Config,
    mesh: &Mesh,
    variance: Option<&[f64]>,
) -> Result<[Box<dyn Smoother>; 2], String> {
    let s = &c.file.smooth;
    let like = Diffusion { largest_cell: s.largest_cell, variance, ..Diffusion::default() };
    let classes = classes(c, mesh);
    let t = classes.links(mesh, &like);
    let unknown = || format!("smooth.method = \"{}\" is not known", s.method);
    if classes.count() == 1 {
        return smooth::pair(&s.method, mesh, &t, s.tolerance).ok_or_else(unknown);
    }
    smooth::pair(&s.method, &classes.mesh(mesh), &t, s.tolerance).ok_or_else(unknown)
}

/// The coupling step of a case on a mesh.
pub fn step(c: &Config, mesh: Mesh) -> Result<CouplingStep, String> {
    let mapping = mapping(c, &mesh)?;
    // the partners are silent meanwhile, whatever run.threads says
    let all = threads::pool(threads::cores())?;
    let (linked, variance) = threads::within(all.as_ref(), || {
        let linked = linked(c, &mesh);
        let variance = if smooths(c) { map::taken_out(&*mapping, &mesh, &linked) } else { None };
        (linked, variance)
    });
    let [smoother, positive] = smoothers(c, &linked, variance.as_deref())?;
    let (classes, pinned) = (classes(c, &mesh), pinned(c, &linked));
    drop(linked);
    let step = CouplingStep::new(mesh, setup(c)?, mapping, smoother, positive);
    Ok(step.with_classes(classes).with_pinned(pinned).with_watch(Watch::new(c)))
}

/// What the partners are told (names in `docs/wire.md`).
pub fn welcome(c: &Config, resume: Option<&State>) -> Welcome {
    let f = &c.file;
    let yes = f64::from;
    let mut w = Welcome::default();
    let extra = extra(c);
    let mut set = |k: &str, v: f64| w.settings.insert(k.into(), v);
    set("dem.time_step", f.dem.time_step);
    set("dem.explicit_limit", 0.2);
    set("dem.constant_force", yes(f.dem.force == InInterval::Constant));
    set("coupling.resumed", yes(resume.is_some()));
    set("coupling.first_exchange", resume.map_or(0.0, |s| s.exchange as f64));
    set("dem.added_mass", f.forces.added_mass.coefficient() * f.fluid.density);
    set("coupling.interval", f64::from(f.coupling.interval));
    set("fluid.density", f.fluid.density);
    set("fluid.kinematic_viscosity", f.fluid.kinematic_viscosity);
    set("fluid.time_step", c.period());
    let model_a = f.coupling.model == Model::A;
    set("fluid.model", if model_a { 1.0 } else { 2.0 });
    set("fluid.continuity", yes(f.coupling.continuity == crate::config::Continuity::SolidsFlux));
    set("fluid.two_way", yes(f.coupling.feedback == Feedback::TwoWay));
    set("fluid.frozen", yes(f.fluid.flow == Flow::Frozen));
    let in_pressure = f.fluid.gravity_treatment == GravityTreatment::InPressure;
    for (a, axis) in ["x", "y", "z"].iter().enumerate() {
        set(&format!("fluid.mean_pressure_gradient.{axis}"), f.fluid.mean_pressure_gradient[a]);
        set(&format!("fluid.gravity.{axis}"), if in_pressure { f.fluid.gravity[a] } else { 0.0 });
    }
    // what no force and no scheme needs is not sent
    set("send.history", yes(scheme::by_name(&f.coupling.scheme).is_some_and(|s| s.wants_history())));
    set("send.type", yes(!f.dem.coarse_graining.by_type().is_empty()));
    set("send.angular_velocity", yes(f.forces.torque));
    set("drive.added_mass", yes(extra.sends_added_mass()));
    set("drive.rotation", yes(f.forces.torque));
    set("drive.memory", if extra.sends_memory() { forces::history::Memory::WIDTH as f64 } else { 0.0 });
    set("send.pressure_gradient", yes(model_a && f.forces.pressure_gradient));
    set("send.stress_divergence", yes(model_a && f.forces.viscous_stress));
    w
}

/// The programs must agree on time steps; each says its own in its hello.
pub fn agree<T: Transport>(c: &Config, partners: &Partners<T>, resume: Option<&State>) -> Result<(), String> {
    for i in partners.dem().chain(partners.cfd()) {
        let Some(h) = partners.hello(i) else { continue };
        let dem = partners.dem().contains(&i);
        let (wanted, key) = if dem {
            (c.file.dem.time_step, "dem.time_step")
        } else {
            (c.period(), "dem.time_step x coupling.interval")
        };
        if (h.time_step / wanted - 1.0).abs() > 1e-9 {
            return Err(format!(
                "{} runs with a time step of {:e} s, {key} is {wanted:e} s: make them equal",
                h.program, h.time_step
            ));
        }
        let Some(s) = resume else { continue };
        if dem && h.step != s.dem_step {
            return Err(format!(
                "{} starts at step {}, the restart set is of step {}: the script must read ${{voidage_restart_file}} \
                 and neither run steps nor reset_timestep before the coupled run",
                h.program, h.step, s.dem_step
            ));
        }
        if !dem && (h.time - s.time).abs() > 0.01 * c.period() {
            return Err(format!(
                "{} starts at t = {} s, the restart set is of t = {} s: a stock solver needs, in controlDict, \
                 startFrom startTime; startTime {};",
                h.program, h.time, s.time, s.time
            ));
        }
    }
    Ok(())
}

/// CPU time of this process, s.
pub fn cpu_seconds() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let rest = stat.rfind(')').map_or("", |i| &stat[i + 2..]);
    let ticks: f64 = rest.split(' ').skip(11).take(2).filter_map(|x| x.parse::<f64>().ok()).sum();
    ticks / 100.0
}
