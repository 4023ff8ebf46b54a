// SPDX-License-Identifier: MIT OR Apache-2.0
//! Memory of a process that does what the coupler does: mesh, particles, fluid, the step and its smoothers.
//!
//! Largest resident size from /proc/self/status (kernel's `VmHWM`), two steps of `bench::step`, in four sizes one after
//! the other, each larger than the last so that what was freed is used again. Bytes per particle follow from the two with few
//! cells, bytes per cell from the two with few particles; the mesh is assembled from its pieces in there, as in a run.

use super::{scene, step};
use serde::Serialize;

/// Bytes per thing.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Memory {
    /// default mapping, smoother and uniformization on one graph
    pub bytes_per_cell: f64,
    /// with the scene's own table of particles
    pub bytes_per_particle: f64,
    /// of the process before
    pub base_bytes: f64,
}

/// Largest resident size so far, bytes; 0 where the system does not tell.
fn peak() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:"));
    line.and_then(|l| l.trim().strip_suffix(" kB")).and_then(|l| l.trim().parse().ok()).unwrap_or(0.0)
        * 1024.0
}

/// Measures; must run before anything large. `part`: sizes are divided by it.
pub fn run(part: usize) -> Result<Memory, String> {
    let base_bytes = peak();
    let measure = |particles: usize, cells: usize| {
        let cost = step::run(&step::Case {
            particles: particles / part,
            diameter: scene::DIAMETER * (part as f64).cbrt(),
            cells: cells / part,
            bandwidth: 4.8e-3,
            tolerance: 1e-2,
            drag: "koch-hill",
            mapping: crate::map::DEFAULT,
            repetitions: 1,
            threads: None,
        })?;
        Ok::<_, String>((peak() - base_bytes, particles as f64 / part as f64, cost.cells as f64))
    };
    let (few, p, _) = measure(33_200, 16_600)?;
    let (crowd, q, _) = measure(332_000, 16_600)?;
    let (small, _, m) = measure(33_200, 166_000)?;
    let (large, _, n) = measure(33_200, 664_000)?;
    let (bytes_per_cell, bytes_per_particle) = ((large - small) / (n - m), (crowd - few) / (q - p));
    Ok(Memory { bytes_per_cell, bytes_per_particle, base_bytes })
}
