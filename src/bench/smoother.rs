// SPDX-License-Identifier: MIT OR Apache-2.0
//! What smoothing costs and how exact it is: the default against the papers' way, on the bed of `scene`.
//!
//! Times are CPU seconds of the calling thread, medians; errors relative in L2 (V norm) against exp(Δ_T) to 1e-13.

use super::{gauss, scene, triad};
use crate::locate::Locator;
use crate::mesh::{Mesh, NONE};
use crate::particles::Particles;
use crate::smooth::{Active, Diffusion, Direction, Field, Graph, Scratch, Smoother, on};
use crate::sums::sum;
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
    /// applications of the default per round
    pub repetitions: usize,
    /// rounds of the default, Crank–Nicolson and backward Euler, each with the triad
    pub rounds: usize,
}

/// One method.
#[derive(Clone, Debug, Serialize)]
pub struct Cost {
    /// name in case.toml
    pub name: &'static str,
    /// asked of it (solves: of their residual 1e-6)
    pub tolerance: f64,
    /// one application on seven fields, s
    pub seconds: f64,
    /// of ε_s
    pub error: f64,
    /// of ε_s, against the exact Gaussians of the particles (deposit: particle centroid)
    pub error_gaussian: f64,
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
    /// bytes that must move (spread) between memory and core
    pub bytes: f64,
    /// size of the fields and rows visited
    pub working_set: f64,
    /// GB/s of the triad at that working set
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

/// Volume of a sphere, m3.
fn sphere() -> f64 {
    std::f64::consts::PI / 6.0 * scene::DIAMETER.powi(3)
}

/// Spheres that fill a share of the box.
fn bed(filled: f64) -> Particles {
    let count = (filled * scene::BOX.iter().product::<f64>() * scene::PACKING / sphere()) as usize;
    scene::bed(scene::BOX, count, scene::DIAMETER)
}

/// Raw fields of a bed of spheres: ε_s, ε_s U_s, and a force (seven lanes); occupied cells.
pub fn fields(mesh: &Mesh, filled: f64) -> Result<(Field, Vec<u32>), String> {
    let (sphere, mut p) = (sphere(), bed(filled));
    let count = p.len();
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

/// What the default takes at b/h = 4, and what it is compared with in every round.
const DEFAULT: &str = "chebyshev";
const COMPARED: [&str; 2] = ["crank-nicolson", "constdiff"];

/// CPU time of this thread in one call, s: what other programs take of the machine is not in it.
fn timed(f: impl FnOnce()) -> f64 {
    let begin = triad::cpu_seconds();
    f();
    triad::cpu_seconds() - begin
}

/// The middle value; NaN if there is none.
pub fn median(mut x: Vec<f64>) -> f64 {
    x.sort_by(f64::total_cmp);
    x.get(x.len() / 2).copied().unwrap_or(f64::NAN)
}

/// One smoother with its rows.
struct Entry {
    smoother: Box<dyn Smoother>,
    active: Active,
    seconds: Vec<f64>,
}

/// Measures the default and what it is compared with side by side, round by round, and these others once.
/// Ratios are medians over the rounds of the values within a round.
pub fn run(case: &Case, others: &[(&str, f64)]) -> Result<Numbers, String> {
    let mesh = scene::mesh(scene::BOX, case.cells);
    let (raw, occupied) = fields(&mesh, case.filled)?;
    let h = mesh.volume[0].cbrt();
    let t = Diffusion::uniform(case.width * h).links(&mesh);
    let graph = Arc::new(Graph::new(&mesh, &t));
    let make = |name: &str, tolerance| {
        let smoother = on(name, &mesh, &t, &graph, tolerance).ok_or(format!("no {name}"))?;
        let mut active = Active::default();
        let begin = Instant::now();
        smoother.plan(&occupied, &mut active);
        Ok::<_, String>((Entry { smoother, active, seconds: Vec::new() }, begin.elapsed().as_secs_f64()))
    };
    let mut scratch = Scratch::new(mesh.len());
    let mut exact = raw.clone();
    let whole = Active::whole(mesh.len());
    make(DEFAULT, 1e-13)?.0.smoother.apply(&mut exact, &whole, Direction::Spread, &mut scratch);
    let norm = |f: &dyn Fn(usize) -> f64| sum((0..mesh.len()).map(f));
    let size = norm(&|j| mesh.volume[j] * exact[j][0].powi(2));
    let total = norm(&|j| mesh.volume[j] * raw[j][0]);
    let gaussian = gauss::solid_fraction(&bed(case.filled).position, sphere(), case.cells, case.width * h);
    let gaussian_size = norm(&|j| mesh.volume[j] * gaussian[j].powi(2));
    let mut field = raw.clone();
    let mut time = |e: &mut Entry, direction, times: usize, field: &mut Field| {
        let once = |_| {
            field.copy_from_slice(&raw);
            timed(|| e.smoother.apply(field, &e.active, direction, &mut scratch))
        };
        median((0..times).map(once).collect())
    };
    let cost = |e: &Entry, tolerance, field: &Field| Cost {
        name: e.smoother.name(),
        tolerance,
        seconds: median(e.seconds.clone()),
        error: (norm(&|j| mesh.volume[j] * (field[j][0] - exact[j][0]).powi(2)) / size).sqrt(),
        error_gaussian: (norm(&|j| mesh.volume[j] * (field[j][0] - gaussian[j]).powi(2)) / gaussian_size)
            .sqrt(),
        least: field.iter().map(|l| l[0]).fold(f64::INFINITY, f64::min),
        conservation: (norm(&|j| mesh.volume[j] * field[j][0]) / total - 1.0).abs(),
        degree: e.smoother.degree(),
    };
    let (main, plan_seconds) = make(DEFAULT, case.tolerance)?;
    let (active, bytes) = (main.active.clone(), main.smoother.bytes(&main.active, Direction::Spread));
    let working_set = graph.bytes(&active, main.smoother.degree(), 2);
    let mut entries = vec![main];
    for name in COMPARED {
        entries.push(make(name, case.tolerance)?.0);
    }
    let (mut methods, mut triads, mut bound) = (Vec::new(), Vec::new(), Vec::new());
    for round in 0..case.rounds {
        for (i, e) in entries.iter_mut().enumerate() {
            let seconds = time(e, Direction::Spread, if i == 0 { case.repetitions } else { 1 }, &mut field);
            e.seconds.push(seconds);
            if round + 1 == case.rounds {
                methods.push(cost(e, case.tolerance, &field));
            }
        }
        triads.push(triad::bandwidth(working_set as usize, 1, 2 * case.repetitions));
        bound.push(entries[0].seconds[round] / (bytes / (triads[round] * 1e9)));
    }
    let gather_seconds = time(&mut entries[0], Direction::Gather, case.repetitions, &mut field);
    for (name, tolerance) in others {
        let mut e = make(name, *tolerance)?.0;
        let times = if e.smoother.bytes(&e.active, Direction::Spread) > 0.0 { case.repetitions } else { 1 };
        e.seconds = vec![time(&mut e, Direction::Spread, times, &mut field)];
        methods.push(cost(&e, *tolerance, &field));
    }
    let speedup =
        |i: usize| median((0..case.rounds).map(|r| entries[i].seconds[r] / entries[0].seconds[r]).collect());
    Ok(Numbers {
        cells: mesh.len(),
        active: active.rows.len(),
        plan_seconds,
        gather_seconds,
        bytes,
        working_set,
        triad: median(triads),
        bytes_bound_ratio: median(bound),
        speedup_vs_cn3: speedup(1),
        error_ratio_vs_cn3: methods[1].error / methods[0].error,
        speedup_vs_constdiff: speedup(2),
        methods,
    })
}
