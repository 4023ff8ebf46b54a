// SPDX-License-Identifier: MIT OR Apache-2.0
//! What smoothing costs and how exact it is: the default against the papers' way, on the bed of `scene`.
//!
//! Times in seconds on the calling thread, best of several; errors relative in L2 (V norm) against exp(Δ_T) to 1e-13.

use super::{scene, triad};
use crate::locate::Locator;
use crate::mesh::{Mesh, NONE};
use crate::smooth::{Active, Diffusion, Direction, Field, Graph, Scratch, Smoother, on};
use serde::Serialize;
use std::sync::Arc;
use std::time::Instant;

/// Cells, bandwidth in cell sizes, tolerance, share of the box that is filled.
#[derive(Clone, Copy, Debug)]
pub struct Case {
    /// about so many
    pub cells: usize,
    /// b/h
    pub width: f64,
    /// of the default smoother
    pub tolerance: f64,
    /// share of the box filled with spheres
    pub filled: f64,
    /// times each measurement is repeated
    pub repetitions: usize,
}

/// One method.
#[derive(Clone, Debug, Serialize)]
pub struct Cost {
    /// name in case.toml
    pub name: &'static str,
    /// one application on seven fields, s
    pub seconds: f64,
    /// of ε_s
    pub error: f64,
    /// smallest ε_s
    pub least: f64,
    /// |Σ V φ' − Σ V φ| / Σ V φ of ε_s
    pub conservation: f64,
    /// sweeps or iterations in all
    pub degree: usize,
}

/// What was measured.
#[derive(Clone, Debug)]
pub struct Numbers {
    /// number of cells
    pub cells: usize,
    /// rows visited
    pub active: usize,
    /// finding the active rows anew, s
    pub plan_seconds: f64,
    /// every method; the default first
    pub methods: Vec<Cost>,
    /// the default, gathering, s
    pub gather_seconds: f64,
    /// bytes that must move (spread), those of the whole working set, and GB/s of the triad at that working set
    pub bytes: f64,
    /// size of the fields and rows visited
    pub working_set: f64,
    /// GB/s
    pub triad: f64,
    /// time of the default ÷ (bytes ÷ triad)
    pub bytes_bound_ratio: f64,
    /// time of Crank–Nicolson in three steps ÷ time of the default
    pub speedup_vs_cn3: f64,
    /// error of Crank–Nicolson in three steps ÷ error of the default
    pub error_ratio_vs_cn3: f64,
    /// time of one backward Euler solve per field ÷ time of the default
    pub speedup_vs_constdiff: f64,
}

/// Raw fields of a bed of spheres: ε_s, ε_s U_s, and a force (seven lanes); occupied cells.
pub fn fields(mesh: &Mesh, filled: f64) -> Result<(Field, Vec<u32>), String> {
    let sphere = std::f64::consts::PI / 6.0 * scene::DIAMETER.powi(3);
    let count = (filled * scene::BOX.iter().product::<f64>() * scene::PACKING / sphere) as usize;
    let mut p = scene::bed(scene::BOX, count, scene::DIAMETER);
    let mut hosts = vec![NONE; count];
    let lost = Locator::new(mesh).locate(mesh, &mut p.position, &mut hosts);
    lost.map_err(|l| format!("{} spheres outside", l.len()))?;
    let mut field = Field::zero(mesh.len());
    for (i, h) in hosts.iter().enumerate() {
        let (v, u) = (sphere / mesh.volume[*h as usize], p.velocity[i]);
        let add = [v, v * u[0], v * u[1], v * u[2], -50.0 * v * u[0], 90.0 * v, -50.0 * v * u[2], 0.0];
        (0..8).for_each(|l| field[*h as usize][l] += add[l]);
    }
    hosts.sort_unstable();
    hosts.dedup();
    Ok((field, hosts))
}

/// Measures the default smoother and these others.
pub fn run(case: &Case, others: &[&str]) -> Result<Numbers, String> {
    let mesh = scene::mesh(scene::BOX, case.cells);
    let (raw, occupied) = fields(&mesh, case.filled)?;
    let h = mesh.volume[0].cbrt();
    let t = Diffusion::uniform(case.width * h).links(&mesh);
    let graph = Arc::new(Graph::new(&mesh, &t));
    let make = |name: &str, tolerance| on(name, &mesh, &t, &graph, tolerance).ok_or(format!("no {name}"));
    let mut scratch = Scratch::new(mesh.len());
    let mut exact = raw.clone();
    make("chebyshev", 1e-13)?.apply(&mut exact, &Active::whole(mesh.len()), Direction::Spread, &mut scratch);
    let norm = |f: &dyn Fn(usize) -> f64| (0..mesh.len()).map(f).sum::<f64>();
    let size = norm(&|j| mesh.volume[j] * exact[j][0].powi(2));
    let total = norm(&|j| mesh.volume[j] * raw[j][0]);
    let mut active = Active::default();
    let mut time = |s: &mut dyn Smoother, active: &Active, direction, times: usize| {
        let (mut best, mut field) = (f64::INFINITY, raw.clone());
        for _ in 0..times {
            field.copy_from_slice(&raw);
            let begin = Instant::now();
            s.apply(&mut field, active, direction, &mut scratch);
            best = best.min(begin.elapsed().as_secs_f64());
        }
        (best, field)
    };
    let cost = |s: &dyn Smoother, seconds, field: &Field| Cost {
        name: s.name(),
        seconds,
        error: (norm(&|j| mesh.volume[j] * (field[j][0] - exact[j][0]).powi(2)) / size).sqrt(),
        least: field.iter().map(|l| l[0]).fold(f64::INFINITY, f64::min),
        conservation: (norm(&|j| mesh.volume[j] * field[j][0]) / total - 1.0).abs(),
        degree: s.degree(),
    };
    let mut main = make("chebyshev", case.tolerance)?;
    let begin = Instant::now();
    main.plan(&occupied, &mut active);
    let plan_seconds = begin.elapsed().as_secs_f64();
    let (seconds, field) = time(&mut *main, &active, Direction::Spread, case.repetitions);
    let mut methods = vec![cost(&*main, seconds, &field)];
    let (gather_seconds, _) = time(&mut *main, &active, Direction::Gather, case.repetitions);
    for name in others {
        let mut s = make(name, case.tolerance)?;
        let mut rows = Active::default();
        s.plan(&occupied, &mut rows);
        let times = if s.bytes(&rows, Direction::Spread) > 0.0 { case.repetitions } else { 2 };
        let (seconds, field) = time(&mut *s, &rows, Direction::Spread, times);
        methods.push(cost(&*s, seconds, &field));
    }
    let find = |name| methods.iter().find(|m| m.name == name).cloned();
    let ratio = |name, of: fn(&Cost) -> f64| find(name).map_or(f64::NAN, |m| of(&m) / of(&methods[0]));
    let bytes = main.bytes(&active, Direction::Spread);
    let working_set = active.rows.len() as f64 * (3.0 * 64.0 + 76.0);
    let triad = triad::bandwidth(working_set as usize, 1, 40);
    Ok(Numbers {
        cells: mesh.len(),
        active: active.rows.len(),
        plan_seconds,
        gather_seconds,
        bytes,
        working_set,
        triad,
        bytes_bound_ratio: seconds / (bytes / (triad * 1e9)),
        speedup_vs_cn3: ratio("crank-nicolson", |m| m.seconds),
        error_ratio_vs_cn3: ratio("crank-nicolson", |m| m.error),
        speedup_vs_constdiff: ratio("constdiff", |m| m.seconds),
        methods,
    })
}
