// SPDX-License-Identifier: MIT OR Apache-2.0
//! What one coupling step costs: all three passes, from locate to replies ready, on one scene.
//!
//! Reads numbers of particles and cells and a bandwidth (m); writes CPU time per particle, its share by stage, and
//! the errors the step itself reports. Receiving and sending are not in it.

use super::scene;
use super::triad::cpu_seconds;
use crate::forces::Extra;
use crate::interpolate::FluidVelocity;
use crate::map;
use crate::smooth;
use crate::step::{CouplingStep, Seconds, Setup};
use crate::{forces, scheme, threads};
use serde::Serialize;
use std::time::Instant;

/// The step to be timed.
#[derive(Clone, Debug)]
pub struct Case {
    /// number of particles
    pub particles: usize,
    /// of the spheres, m
    pub diameter: f64,
    /// number of cells wanted
    pub cells: usize,
    /// b, m
    pub bandwidth: f64,
    /// tolerance of the smoother
    pub tolerance: f64,
    /// drag law
    pub drag: &'static str,
    /// mapping
    pub mapping: &'static str,
    /// timed repetitions
    pub repetitions: usize,
    /// threads of the step, timed by the clock on the wall; none: this thread alone, by its CPU time
    pub threads: Option<usize>,
}

/// What it cost.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Cost {
    /// mapping
    pub mapping: &'static str,
    /// particles
    pub particles: usize,
    /// cells
    pub cells: usize,
    /// b, m
    pub bandwidth: f64,
    /// sweeps of the smoother per pass
    pub degree: usize,
    /// best step, µs per particle
    pub us_per_particle: f64,
    /// median step, µs per particle
    pub us_per_particle_median: f64,
    /// best step by stage, ms
    pub locate_ms: f64,
    /// order by cell
    pub arrange_ms: f64,
    /// weights
    pub map_ms: f64,
    /// pass a
    pub solids_ms: f64,
    /// drag and prediction
    pub forces_ms: f64,
    /// pass b
    pub sources_ms: f64,
    /// pass c, smoothing
    pub gather_ms: f64,
    /// pass c, replies
    pub drive_ms: f64,
    /// largest error of the solid volume
    pub solid_volume_error: f64,
}

/// The settings all step benchmarks share: air, model A, all three passes.
pub fn setup(drag: &str) -> Result<Setup, String> {
    Ok(Setup {
        drag: forces::by_name(drag).ok_or_else(|| format!("drag law {drag} is not known"))?,
        scheme: scheme::by_name("conservative").ok_or("no scheme")?,
        fluid_velocity: FluidVelocity::Gather,
        model_b: false,
        two_way: true,
        pressure_force: true,
        archimedes: [0.0, -9.81, 0.0],
        mean_pressure_gradient: [0.0; 3],
        gravity: [0.0, -9.81, 0.0],
        solids_flux: false,
        density: 1.2,
        kinematic_viscosity: 1.5e-5,
        period: 2e-4,
        voidage_min: 0.0,
        exclude_outside: false,
        average: None,
        extra: Extra::default(),
    })
}

/// Runs the step once to warm up, then `repetitions` times; particles move a little in between, as in a bed.
pub fn run(case: &Case) -> Result<Cost, String> {
    let mesh = scene::mesh(scene::BOX, case.cells);
    let fluid = scene::air(&mesh);
    let mapping = map::by_name(case.mapping, &mesh);
    let mut mapping = mapping.ok_or_else(|| format!("mapping {} is not known", case.mapping))?;
    mapping.prepare(&mesh, &map::Options { bandwidth: case.bandwidth, grid: 2.4 * case.diameter });
    let name = mapping.name();
    let t = smooth::Diffusion::uniform(case.bandwidth).links(&mesh);
    let graph = std::sync::Arc::new(smooth::Graph::new(&mesh, &t));
    let smoother = |name| smooth::on(name, &mesh, &t, &graph, case.tolerance).ok_or("no smoother");
    let (main, positive) = (smoother(smooth::DEFAULT)?, smoother("uniformization")?);
    let (cells, degree) = (mesh.len(), main.degree());
    let mut step = CouplingStep::new(mesh, setup(case.drag)?, mapping, main, positive);
    let mut p = scene::bed(scene::BOX, case.particles, case.diameter);
    let mut seed = 7;
    let mut cost = Cost {
        mapping: name,
        particles: p.len(),
        cells,
        bandwidth: case.bandwidth,
        degree,
        us_per_particle: f64::INFINITY,
        ..Cost::default()
    };
    let mut all = Vec::new();
    let pool = |n| rayon::ThreadPoolBuilder::new().num_threads(n).build();
    let pool = case.threads.map(pool).transpose().map_err(|e| e.to_string())?;
    let start = Instant::now();
    let clock = || if case.threads.is_some() { start.elapsed().as_secs_f64() } else { cpu_seconds() };
    for k in 0..=case.repetitions {
        let begin = clock();
        threads::within(pool.as_ref(), || {
            step.before_fluid(&mut p, k == 0)?;
            step.after_fluid(&p, &fluid, k == 0)
        })
        .map_err(|e| e.to_string())?;
        let us = (clock() - begin) * 1e6 / p.len() as f64;
        cost.solid_volume_error = cost.solid_volume_error.max(step.facts.solid_volume_error);
        for x in &mut p.position {
            (0..3).for_each(|a| x[a] += 2e-5 * (scene::random(&mut seed) - 0.5));
            (0..3).for_each(|a| x[a] = x[a].clamp(0.0, scene::BOX[a]));
        }
        if k > 1 {
            all.push(us);
            if us < cost.us_per_particle {
                cost.us_per_particle = us;
                cost.take(&step.seconds);
            }
        }
    }
    all.sort_by(f64::total_cmp);
    cost.us_per_particle_median = all.get(all.len() / 2).copied().unwrap_or(f64::NAN);
    Ok(cost)
}

impl Cost {
    fn take(&mut self, s: &Seconds) {
        let ms = |x: f64| x * 1e3;
        (self.locate_ms, self.arrange_ms, self.map_ms) = (ms(s.locate), ms(s.arrange), ms(s.map));
        (self.solids_ms, self.forces_ms, self.sources_ms) = (ms(s.solids), ms(s.forces), ms(s.sources));
        (self.gather_ms, self.drive_ms) = (ms(s.gather), ms(s.drive));
    }
}
