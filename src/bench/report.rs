// SPDX-License-Identifier: MIT OR Apache-2.0
//! The benchmark as a table and as JSON: every step and smoother side by side, measured in one run.
//!
//! Reads how thorough to be; writes numbers with their units in the field names. Ratios are of values measured in
//! the same run; absolute times are those of this machine at this moment.

use super::{grid, memory, plot, scaling, scene, smoother, step, triad};
use crate::map;
use serde::Serialize;

/// All numbers of one run.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// program version
    pub version: &'static str,
    /// GB/s of the triad on 16 MB, one thread
    pub triad_16mb_gb_per_s: f64,
    /// on 256 MB
    pub triad_256mb_gb_per_s: f64,
    /// whole coupling steps
    pub step: Steps,
    /// the smoother against the papers' way
    pub smoother: Smoother,
    /// cost of the mappings
    pub mapping: Mapping,
    /// memory of the coupler process
    pub memory: memory::Memory,
    /// how the step's cost grows
    pub scaling: Vec<scaling::Series>,
    /// the step over particles, cells and bandwidths
    pub grid: Vec<step::Cost>,
    /// the step on two threads; none where there is one core
    pub two_threads: Option<grid::Two>,
}

/// Whole coupling steps: all three passes, from locate to replies ready, Koch–Hill, model A.
#[derive(Clone, Debug, Serialize)]
pub struct Steps {
    /// N_p / N_c = 2, particle centroid, as the peer that is compared with
    pub us_per_particle_ratio_2: f64,
    /// N_p / N_c = 16, the same
    pub us_per_particle_ratio_16: f64,
    /// N_p / N_c = 2, default mapping
    pub default_us_per_particle_ratio_2: f64,
    /// N_p / N_c = 16, default mapping
    pub default_us_per_particle_ratio_16: f64,
    /// every step measured
    pub cases: Vec<step::Cost>,
}

/// The smoother's ratios; see `bench::smoother::Numbers`.
#[derive(Clone, Debug, Serialize)]
pub struct Smoother {
    /// time of seven Crank–Nicolson solves in three steps ÷ time of the default
    pub speedup_vs_cn3: f64,
    /// error of the same ÷ error of the default
    pub error_ratio_vs_cn3: f64,
    /// time of one backward Euler solve per field ÷ time of the default
    pub speedup_vs_constdiff: f64,
    /// time ÷ (bytes that must move ÷ triad at that working set)
    pub bytes_bound_ratio: f64,
    /// bytes that must move between memory and core in one application
    pub bytes: f64,
    /// fields and rows visited, bytes
    pub working_set_bytes: f64,
    /// GB/s of the triad at that working set
    pub triad_gb_per_s: f64,
    /// cells of the mesh
    pub cells: usize,
    /// cells visited
    pub active_cells: usize,
    /// finding them anew, ms
    pub plan_ms: f64,
    /// one gather, ms
    pub gather_ms: f64,
    /// every method: the speed–accuracy table
    pub methods: Vec<smoother::Cost>,
}

/// Weights alone.
#[derive(Clone, Debug, Serialize)]
pub struct Mapping {
    /// divided volume on hexahedra, µs per particle
    pub divided_us_per_particle: f64,
    /// linear deposit on hexahedra, µs per particle
    pub linear_us_per_particle: f64,
}

/// Measures; `quick`: a tenth of the size, for a first look.
pub fn run(quick: bool, mut say: impl FnMut(&str)) -> Result<Report, String> {
    say("memory");
    let memory = memory::run(if quick { 10 } else { 1 })?;
    let step = steps(quick, &mut say)?;
    say("cost over two decades of particles and cells");
    let scaling = scaling::run(if quick { 33_200 } else { 332_000 })?;
    say("grid of particles, cells and bandwidths");
    let grid = grid::run(if quick { 16_000 } else { 160_000 }, 5)?;
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let two_threads = if cores > 1 {
        say("one thread and two");
        Some(grid::two_threads(if quick { 33_200 } else { 332_000 }, if quick { 1 } else { 5 })?)
    } else {
        None
    };
    say("smoother: the default against Crank-Nicolson, backward Euler and others");
    let smoother = smoothers(quick)?;
    let weights = |c: &step::Cost| c.map_ms * 1e3 / c.particles as f64;
    Ok(Report {
        version: env!("CARGO_PKG_VERSION"),
        triad_16mb_gb_per_s: triad::bandwidth(16 << 20, 1, 40),
        triad_256mb_gb_per_s: triad::bandwidth(256 << 20, 1, 8),
        mapping: Mapping {
            divided_us_per_particle: weights(&step.cases[4]),
            linear_us_per_particle: weights(&step.cases[2]),
        },
        step,
        smoother,
        memory,
        scaling,
        grid,
        two_threads,
    })
}

/// The steps alone.
pub fn steps(quick: bool, mut say: impl FnMut(&str)) -> Result<Steps, String> {
    let part = if quick { 10 } else { 1 };
    let case = |particles: usize, cells: usize, mapping| step::Case {
        particles: particles / part,
        diameter: scene::DIAMETER,
        cells: cells / part,
        bandwidth: 4.8e-3,
        tolerance: 1e-2,
        drag: "koch-hill",
        mapping,
        repetitions: if quick { 5 } else { 12 },
        threads: None,
    };
    let mut cases = Vec::new();
    for (particles, cells, mapping) in [
        (332_000, 166_000, "particle-centroid"),
        (332_640, 20_700, "particle-centroid"),
        (332_000, 166_000, map::DEFAULT),
        (332_640, 20_700, map::DEFAULT),
        (332_000, 166_000, "divided-volume"),
    ] {
        say(&format!("step: {mapping}, {} particles on {} cells", particles / part, cells / part));
        cases.push(step::run(&case(particles, cells, mapping))?);
    }
    Ok(Steps {
        us_per_particle_ratio_2: cases[0].us_per_particle,
        us_per_particle_ratio_16: cases[1].us_per_particle,
        default_us_per_particle_ratio_2: cases[2].us_per_particle,
        default_us_per_particle_ratio_16: cases[3].us_per_particle,
        cases,
    })
}

/// The smoothers alone.
pub fn smoothers(quick: bool) -> Result<Smoother, String> {
    let scene = smoother::Case {
        cells: if quick { 17_000 } else { 170_000 },
        width: 4.0,
        tolerance: 1e-4,
        filled: 0.25,
        repetitions: if quick { 5 } else { 15 },
        rounds: if quick { 2 } else { 5 },
    };
    let mut others: Vec<_> = [1e-1, 1e-2, 1e-3, 1e-6, 1e-8].map(|t| ("chebyshev", t)).into();
    others.extend([1e-2, 1e-4].map(|t| ("uniformization", t)));
    others.extend([("chebyshev-u", 1e-2), ("forward-euler", 1e-2)]);
    others.extend(["crank-nicolson-1", "backward-euler"].map(|name| (name, 1e-6)));
    let s = smoother::run(&scene, &others)?;
    Ok(Smoother {
        speedup_vs_cn3: s.speedup_vs_cn3,
        error_ratio_vs_cn3: s.error_ratio_vs_cn3,
        speedup_vs_constdiff: s.speedup_vs_constdiff,
        bytes_bound_ratio: s.bytes_bound_ratio,
        bytes: s.bytes,
        working_set_bytes: s.working_set,
        triad_gb_per_s: s.triad,
        cells: s.cells,
        active_cells: s.active,
        plan_ms: 1e3 * s.plan_seconds,
        gather_ms: 1e3 * s.gather_seconds,
        methods: s.methods,
    })
}

impl Report {
    /// For people.
    pub fn table(&self) -> String {
        let mut t = self.step.table();
        t += "cost of the step over two decades, default mapping, b/h = 2.1: particles, cells, ms\n";
        for s in &self.scaling {
            let points = s.points.iter().map(|p| format!("  {} {} {:.3}", p.0, p.1, p.2)).collect::<String>();
            t += &format!("  {:20} N^{:.2}: {points}\n", s.grows, s.exponent);
        }
        t += "grid, default mapping, us per particle (JSON: by stage)\n     cells particles";
        t += &grid::WIDTHS.map(|w| format!("  b/h = {w}")).concat();
        for row in self.grid.chunks(grid::WIDTHS.len()) {
            t += &format!("\n  {:8} {:9}", row[0].cells, row[0].particles);
            t += &row.iter().map(|c| format!(" {:8.3}", c.us_per_particle)).collect::<String>();
        }
        t += "\n";
        if let Some(two) = &self.two_threads {
            t += &format!(
                "two threads: step {:.2} x faster than on one, triad {:.2} x; ratio {:.2}\n",
                two.step_speedup, two.triad_speedup, two.ratio
            );
        }
        t += &format!(
            "memory: {:.0} bytes per cell, {:.0} per particle\n",
            self.memory.bytes_per_cell, self.memory.bytes_per_particle
        );
        format!(
            "{t}{}machine: triad {:.0} GB/s on 16 MB, {:.0} GB/s on 256 MB",
            self.smoother.table(),
            self.triad_16mb_gb_per_s,
            self.triad_256mb_gb_per_s
        )
    }
}

impl Report {
    /// The speed–accuracy table as a picture.
    pub fn plot(&self) -> String {
        let title = format!("Smoothing seven fields, {} cells, b/h = 4, one thread", self.smoother.cells);
        plot::svg(&self.smoother.methods, &title)
    }
}

impl Steps {
    /// For people.
    pub fn table(&self) -> String {
        let mut t = String::from(
            "coupling step, one thread: locate to replies ready, Koch-Hill, model A, b = 4 d, tolerance 1e-2\n  \
             mapping              particles    cells  sweeps  us/particle   locate  order    map  solids  forces sources  gather   drive (ms)\n",
        );
        for c in &self.cases {
            t += &format!(
                "  {:18} {:11} {:8} {:7} {:12.3} {:8.2} {:6.2} {:6.1} {:7.2} {:7.2} {:7.2} {:7.2} {:7.2}\n",
                c.mapping,
                c.particles,
                c.cells,
                c.degree,
                c.us_per_particle,
                c.locate_ms,
                c.arrange_ms,
                c.map_ms,
                c.solids_ms,
                c.forces_ms,
                c.sources_ms,
                c.gather_ms,
                c.drive_ms
            );
        }
        t
    }
}

impl Smoother {
    /// For people.
    pub fn table(&self) -> String {
        let mut t = format!(
            "smoother, one thread: seven fields, {} cells, b/h = 4, a quarter of the box filled; CPU time\n  \
             method               tolerance        ms      error vs Gaussian   least eps_s   conservation  sweeps\n",
            self.cells
        );
        for m in &self.methods {
            t += &format!(
                "  {:20} {:9.0e} {:9.2} {:10.2e} {:11.2e} {:13.2e} {:14.1e} {:7}\n",
                m.name,
                m.tolerance,
                m.seconds * 1e3,
                m.error,
                m.error_gaussian,
                m.least,
                m.conservation,
                m.degree
            );
        }
        t + &format!(
            "  default against Crank-Nicolson in 3 steps: {:.1} x faster, error {:.0} x smaller; against one backward \
             Euler solve per field: {:.1} x faster\n  {:.2} x the time its {:.0} MB need at the triad's {:.0} GB/s \
             ({:.1} MB); finding the {} active cells {:.2} ms, a gather {:.2} ms\n",
            self.speedup_vs_cn3,
            self.error_ratio_vs_cn3,
            self.speedup_vs_constdiff,
            self.bytes_bound_ratio,
            self.bytes * 1e-6,
            self.triad_gb_per_s,
            self.working_set_bytes * 1e-6,
            self.active_cells,
            self.plan_ms,
            self.gather_ms
        )
    }
}

#[cfg(test)]
mod tests {
    #[test]
    fn a_small_bench_has_every_number() {
        let case = super::step::Case {
            particles: 2000,
            diameter: super::scene::DIAMETER,
            cells: 1000,
            bandwidth: 4.8e-3,
            tolerance: 1e-2,
            drag: "koch-hill",
            mapping: "divided-volume",
            repetitions: 2,
            threads: None,
        };
        let c = super::step::run(&case).unwrap();
        assert!(c.us_per_particle.is_finite() && c.map_ms > 0.0 && c.solid_volume_error < 1e-12);
        let text = serde_json::to_string(&c).unwrap();
        assert!(text.contains("\"us_per_particle\""));
        let unknown = super::step::Case { mapping: "none", ..case };
        assert!(super::step::run(&unknown).unwrap_err().contains("mapping none is not known"));
    }
}
