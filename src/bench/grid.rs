// SPDX-License-Identifier: MIT OR Apache-2.0
//! The step over a grid of particles, cells and bandwidths; and on two threads, beside the machine's own gain from two.
//!
//! As in `scaling` the bed always fills a quarter of the box, here by loosely packed spheres; b is in cells. Reads how large the largest case is; writes costs by
//! stage.

use super::{scaling, scene, step, triad};
use serde::Serialize;

/// b/h of the grid.
pub const WIDTHS: [f64; 3] = [1.0, 2.0, 4.0];
/// Particles per cell of the grid.
const CROWDS: [f64; 3] = [0.5, 2.0, 8.0];

/// The step on two threads.
#[derive(Clone, Debug, Serialize)]
pub struct Two {
    /// wall time on one thread ÷ on two; default mapping, N_p/N_c = 2
    pub step_speedup: f64,
    /// bandwidth of the triad on two threads ÷ on one, at the step's working set
    pub triad_speedup: f64,
    /// step ÷ triad
    pub ratio: f64,
    /// stages of the best step on one thread, wall time
    pub one: step::Cost,
    /// and on two
    pub two: step::Cost,
}

/// Costs in the order: cells, particles per cell, b/h.
pub fn run(largest_cells: usize, repetitions: usize) -> Result<Vec<step::Cost>, String> {
    let mut list = Vec::new();
    for cells in [16, 4, 1].map(|f| largest_cells / f) {
        for crowd in CROWDS {
            for width in WIDTHS {
                let particles = (crowd * cells as f64) as usize;
                let case = scaling::case(particles, cells, width);
                // a fifth of the solids: narrow kernels leave several spheres in one cell
                let diameter = 0.6 * case.diameter;
                list.push(step::run(&step::Case { repetitions, diameter, ..case })?);
            }
        }
    }
    Ok(list)
}

/// Particles in the working set of the two-thread comparison have about this many bytes, cells this many.
const BYTES: [f64; 2] = [370.0, 920.0];

/// Measures in turn on one thread and on two, `rounds` times; medians.
pub fn two_threads(particles: usize, rounds: usize) -> Result<Two, String> {
    let cells = particles / 2;
    let case = step::Case {
        particles,
        cells,
        diameter: scene::DIAMETER,
        bandwidth: 4.8e-3,
        ..scaling::case(particles, cells, scaling::WIDTH)
    };
    let time = |n: usize| step::run(&step::Case { threads: Some(n), ..case.clone() });
    let bytes = (BYTES[0] * particles as f64 + BYTES[1] * cells as f64) as usize;
    let (mut steps, mut triads) = (Vec::new(), Vec::new());
    let (mut one, mut two) = (step::Cost::default(), step::Cost::default());
    for _ in 0..rounds {
        (one, two) = (time(1)?, time(2)?);
        steps.push(one.us_per_particle_median / two.us_per_particle_median);
        triads.push(triad::bandwidth(bytes, 2, 8) / triad::bandwidth(bytes, 1, 8));
    }
    let (step_speedup, triad_speedup) = (super::smoother::median(steps), super::smoother::median(triads));
    Ok(Two { step_speedup, triad_speedup, ratio: step_speedup / triad_speedup, one, two })
}
