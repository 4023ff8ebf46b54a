// SPDX-License-Identifier: MIT OR Apache-2.0
//! The field all deposits and smoothers aim at: solid fraction of the particles' exact Gaussians exp(−r²/b²), images at
//! the walls, integrated over the boxes of `scene::mesh`.

use super::scene;

/// erf, Abramowitz & Stegun 7.1.26: to 1.5e-7.
fn erf(x: f64) -> f64 {
    let t = 1.0 / (1.0 + 0.327_591_1 * x.abs());
    let p = [1.061_405_429, -1.453_152_027, 1.421_413_741, -0.284_496_736, 0.254_829_592];
    let y = 1.0 - p.iter().fold(0.0, |s, c| s * t + c) * t * (-x * x).exp();
    y.copysign(x)
}

/// Share of a Gaussian at x (with its two nearest images) in each cell of an axis; first cell and shares, cut at 4 b.
fn shares(x: f64, length: f64, cells: usize, b: f64, out: &mut Vec<f64>) -> usize {
    let h = length / cells as f64;
    let first = (((x - 4.0 * b) / h).floor().max(0.0) as usize).min(cells - 1);
    let end = (((x + 4.0 * b) / h).ceil() as usize).clamp(first + 1, cells);
    let below = |y: f64| [x, -x, 2.0 * length - x].iter().map(|x| 0.5 * erf((y - x) / b)).sum::<f64>();
    out.clear();
    let mut last = below(first as f64 * h);
    for i in first..end {
        let next = below((i + 1) as f64 * h);
        out.push(next - last);
        last = next;
    }
    first
}

/// ε_s of spheres of volume `sphere` (m3) in every cell of `scene::mesh(scene::BOX, cells)`, b in m.
pub fn solid_fraction(position: &[[f64; 3]], sphere: f64, cells: usize, b: f64) -> Vec<f64> {
    let n = scene::lines(scene::BOX, cells);
    let volume = scene::BOX.iter().product::<f64>() / n.iter().product::<usize>() as f64;
    let mut field = vec![0.0; n.iter().product()];
    let mut w = [Vec::new(), Vec::new(), Vec::new()];
    for p in position {
        let first: [usize; 3] = std::array::from_fn(|a| shares(p[a], scene::BOX[a], n[a], b, &mut w[a]));
        for (k, z) in (first[2]..).zip(&w[2]) {
            for (j, y) in (first[1]..).zip(&w[1]) {
                let at = (k * n[1] + j) * n[0] + first[0];
                let f = sphere / volume * z * y;
                field[at..].iter_mut().zip(&w[0]).for_each(|(to, x)| *to += f * x);
            }
        }
    }
    field
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_gaussians_hold_all_of_the_solid() {
        let p = [[0.1, 0.001, 0.03], [0.2639, 0.05, 0.0]];
        let n = super::scene::lines(super::scene::BOX, 2000);
        let f = super::solid_fraction(&p, 1e-9, 2000, 4.8e-3);
        let v = super::scene::BOX.iter().product::<f64>() / n.iter().product::<usize>() as f64;
        assert!((f.iter().sum::<f64>() * v / 2e-9 - 1.0).abs() < 1e-5);
        assert!(f.iter().all(|x| *x >= -1e-12));
    }
}
