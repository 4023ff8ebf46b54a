// SPDX-License-Identifier: MIT OR Apache-2.0
//! How the step's cost grows: particles and cells over two decades, together and each by itself.
//!
//! The bed always fills a quarter of the box: spheres shrink as they get more. b is in cells, so that the number of
//! sweeps stays. The exponent p of time ∝ Nᵖ is fitted by least squares on logarithms: 1 is linear; below 1 where the
//! other number, held fixed, still has its share of the time.

use super::{scene, step};
use serde::Serialize;

/// One series.
#[derive(Clone, Debug, Serialize)]
pub struct Series {
    /// what grows
    pub grows: &'static str,
    /// p
    pub exponent: f64,
    /// particles, cells, ms per step
    pub points: Vec<(usize, usize, f64)>,
}

/// Particles that fill a quarter of the box at `scene::DIAMETER`.
const FILL: f64 = 332_000.0;
/// b/h: that of b = 4 d on 166 000 cells.
pub const WIDTH: f64 = 2.1;

/// A bed in a quarter of the box whatever its numbers; `width` is b/h.
pub fn case(particles: usize, cells: usize, width: f64) -> step::Case {
    let h = (scene::BOX.iter().product::<f64>() / cells as f64).cbrt();
    step::Case {
        particles,
        diameter: scene::DIAMETER * (FILL / particles as f64).cbrt(),
        cells,
        bandwidth: width * h,
        tolerance: 1e-2,
        drag: "koch-hill",
        mapping: crate::map::DEFAULT,
        repetitions: 8,
        threads: None,
    }
}

fn milliseconds(particles: usize, cells: usize) -> Result<f64, String> {
    let cost = step::run(&case(particles, cells, WIDTH))?;
    Ok(cost.us_per_particle * particles as f64 * 1e-3)
}

/// Slope of ln y over ln x.
fn exponent(points: &[(f64, f64)]) -> f64 {
    let n = points.len() as f64;
    let mean = |f: fn(&(f64, f64)) -> f64| points.iter().map(f).sum::<f64>() / n;
    let (x, y) = (mean(|p| p.0.ln()), mean(|p| p.1.ln()));
    let up: f64 = points.iter().map(|p| (p.0.ln() - x) * (p.1.ln() - y)).sum();
    up / points.iter().map(|p| (p.0.ln() - x).powi(2)).sum::<f64>()
}

/// Measures; `largest`: particles of the largest case, with half as many cells; the smallest has a hundredth.
pub fn run(largest: usize) -> Result<Vec<Series>, String> {
    let sizes: Vec<usize> = [100.0, 31.6, 10.0, 3.16, 1.0].map(|f| (largest as f64 / f) as usize).into();
    let (top, middle) = (largest, sizes[2]);
    let series = |grows: &'static str, of: &dyn Fn(usize) -> (usize, usize)| {
        let point = |n: &usize| {
            let (particles, cells) = of(*n);
            Ok::<_, String>((particles, cells, milliseconds(particles, cells)?))
        };
        let points = sizes.iter().map(point).collect::<Result<Vec<_>, _>>()?;
        let pairs: Vec<_> = sizes.iter().zip(&points).map(|(n, p)| (*n as f64, p.2)).collect();
        Ok::<_, String>(Series { grows, exponent: exponent(&pairs), points })
    };
    Ok(vec![
        series("particles and cells", &|n| (n, n / 2))?,
        series("particles", &|n| (n, middle / 20))?,
        series("cells", &|n| (top / 10, n / 2))?,
    ])
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_exponent_of_a_power_is_found() {
        let p: Vec<_> = [1.0, 3.0, 10.0, 30.0].map(|x: f64| (x, 7.0 * x.powf(1.25))).into();
        assert!((super::exponent(&p) - 1.25).abs() < 1e-12);
    }
}
