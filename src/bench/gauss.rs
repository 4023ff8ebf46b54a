// SPDX-License-Identifier: MIT OR Apache-2.0
//! The field all deposits and smoothers aim at: solid fraction of the particles' exact Gaussians exp(−r²/b²), images at
//! the walls, integrated over the boxes of a lattice: that of `scene::mesh`, or a mesh that is one.
//!
//! Reads positions and bandwidths (m), volumes (m3); writes ε_s of the cells. Exact to 1.5e-7 of a particle.
//! Does not know how the coupler deposits.

use super::scene;
use crate::mesh::{Mesh, NONE};

/// erf, Abramowitz & Stegun 7.1.26: to 1.5e-7.
fn erf(x: f64) -> f64 {
    let t = 1.0 / (1.0 + 0.327_591_1 * x.abs());
    let p = [1.061_405_429, -1.453_152_027, 1.421_413_741, -0.284_496_736, 0.254_829_592];
    let y = 1.0 - p.iter().fold(0.0, |s, c| s * t + c) * t * (-x * x).exp();
    y.copysign(x)
}

/// One axis of a lattice of boxes.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    /// where cells begin, and where the last one ends, m, ascending
    pub edges: Vec<f64>,
    /// what leaves at one end comes back at the other; else the ends are walls
    pub cyclic: bool,
}

impl Axis {
    /// Share of a Gaussian at x (with its images) in each cell; first cell and shares, cut at 4 b.
    fn shares(&self, x: f64, b: f64, out: &mut Vec<f64>) -> usize {
        let (e, n) = (&self.edges, self.edges.len() - 1);
        let (low, high) = (e[0], e[n]);
        let length = high - low;
        let near = |y: f64| e.partition_point(|e| *e <= y);
        // where images of the other end may reach in, all cells are looked at
        let inside = !self.cyclic || (x - 4.0 * b > low && x + 4.0 * b < high);
        let (first, end) = if inside {
            let first = near(x - 4.0 * b).saturating_sub(1).min(n - 1);
            (first, (near(x + 4.0 * b)).clamp(first + 1, n))
        } else {
            (0, n)
        };
        let far = (4.0 * b / length).ceil().min(1e3) as i32;
        let images: Vec<f64> = (-far..=far)
            .flat_map(|m| {
                let shift = f64::from(m) * length;
                let pair = [x + 2.0 * shift, 2.0 * low - x + 2.0 * shift];
                if self.cyclic { [x + shift, f64::NAN] } else { pair }
            })
            .filter(|y| *y > low - 4.0 * b && *y < high + 4.0 * b)
            .collect();
        let below = |y: f64| images.iter().map(|x| 0.5 * erf((y - x) / b)).sum::<f64>();
        out.clear();
        let mut last = below(e[first]);
        for y in &e[first + 1..=end] {
            let next = below(*y);
            out.push(next - last);
            last = next;
        }
        first
    }
}

/// A block of boxes between planes; x runs fastest.
#[derive(Clone, Debug, PartialEq)]
pub struct Lattice {
    /// x, y, z
    pub axes: [Axis; 3],
    /// cell of the mesh of each box
    slots: Vec<u32>,
}

impl Lattice {
    /// Of `scene::mesh(scene::BOX, cells)`.
    pub fn of_scene(cells: usize) -> Self {
        let n = scene::lines(scene::BOX, cells);
        let edges = |a: usize| (0..=n[a]).map(|i| scene::BOX[a] * i as f64 / n[a] as f64).collect();
        let axes = [0, 1, 2].map(|a| Axis { edges: edges(a), cyclic: false });
        Self { axes, slots: (0..n.iter().product::<usize>() as u32).collect() }
    }

    /// Of a mesh whose cells are the boxes of such a block; none for any other mesh.
    pub fn of_mesh(mesh: &Mesh) -> Option<Self> {
        let bounds: Vec<[[f64; 3]; 2]> = (0..mesh.len()).map(|j| mesh.bounds_of(j)).collect();
        let size = (0..3).map(|a| mesh.bounds[1][a] - mesh.bounds[0][a]).fold(0.0, f64::max);
        let same = |x: f64, y: f64| (x - y).abs() <= 1e-9 * size;
        let axes = [0, 1, 2].map(|a| {
            let mut edges: Vec<f64> = bounds.iter().flat_map(|b| [b[0][a], b[1][a]]).collect();
            edges.sort_unstable_by(f64::total_cmp);
            edges.dedup_by(|x, y| same(*x, *y));
            let along = |s: &[f64; 3]| s[a].abs() > 1e-9 * size;
            Axis { edges, cyclic: mesh.shifts.iter().any(along) }
        });
        let n = [0, 1, 2].map(|a| axes[a].edges.len().saturating_sub(1));
        if n.iter().product::<usize>() != mesh.len() || mesh.is_empty() {
            return None;
        }
        let mut slots = vec![NONE; mesh.len()];
        for (j, b) in bounds.iter().enumerate() {
            let at = [0, 1, 2].map(|a| axes[a].edges.partition_point(|e| *e <= mesh.centre[j][a]));
            let i = at.map(|i| i.checked_sub(1));
            let i = [i[0]?, i[1]?, i[2]?];
            let fits = (0..3).all(|a| {
                let e = &axes[a].edges[i[a]..];
                e.len() > 1 && same(e[0], b[0][a]) && same(e[1], b[1][a])
            });
            let volume: f64 = (0..3).map(|a| b[1][a] - b[0][a]).product();
            if !fits || (mesh.volume[j] / volume - 1.0).abs() > 1e-9 {
                return None;
            }
            slots[(i[2] * n[1] + i[1]) * n[0] + i[0]] = j as u32;
        }
        (!slots.contains(&NONE)).then_some(Self { axes, slots })
    }

    /// ε_s by cell of spheres at these places, with volumes (m3) and bandwidths (m) of their own.
    pub fn solid_fraction(
        &self,
        position: &[[f64; 3]],
        volume: impl Fn(usize) -> f64,
        b: impl Fn(usize) -> f64,
    ) -> Vec<f64> {
        let n = [0, 1, 2].map(|a| self.axes[a].edges.len() - 1);
        let mut field = vec![0.0; self.slots.len()];
        let mut w = [Vec::new(), Vec::new(), Vec::new()];
        for (i, p) in position.iter().enumerate() {
            let first: [usize; 3] = std::array::from_fn(|a| self.axes[a].shares(p[a], b(i), &mut w[a]));
            let sphere = volume(i);
            for (k, z) in (first[2]..).zip(&w[2]) {
                for (j, y) in (first[1]..).zip(&w[1]) {
                    let at = (k * n[1] + j) * n[0] + first[0];
                    let f = sphere * z * y;
                    field[at..].iter_mut().zip(&w[0]).for_each(|(to, x)| *to += f * x);
                }
            }
        }
        let mut by_cell = vec![0.0; field.len()];
        let size = |i: usize, a: usize| self.axes[a].edges[i + 1] - self.axes[a].edges[i];
        for (at, (f, slot)) in field.iter().zip(&self.slots).enumerate() {
            let volume = size(at % n[0], 0) * size(at / n[0] % n[1], 1) * size(at / n[0] / n[1], 2);
            by_cell[*slot as usize] = f / volume;
        }
        by_cell
    }
}

/// ε_s of spheres of volume `sphere` (m3) in every cell of `scene::mesh(scene::BOX, cells)`, b in m.
pub fn solid_fraction(position: &[[f64; 3]], sphere: f64, cells: usize, b: f64) -> Vec<f64> {
    Lattice::of_scene(cells).solid_fraction(position, |_| sphere, |_| b)
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

    #[test]
    fn a_mesh_of_boxes_is_known_for_one_and_the_kernel_agrees() {
        use super::{Lattice, scene};
        use crate::map::{Kernel, Mapping, Options, Weights};
        use crate::mesh::made::Made;
        let size = [0.02, 0.02, 0.03];
        let mesh = Made::hex([5, 5, 8], size).mesh();
        let lattice = Lattice::of_mesh(&mesh).unwrap();
        let (a, c) = (Lattice::of_mesh(&scene::mesh(scene::BOX, 2000)).unwrap(), Lattice::of_scene(2000));
        let edges = |l: &Lattice| l.axes.iter().flat_map(|a| a.edges.clone()).collect::<Vec<_>>();
        assert!(a.slots == c.slots && edges(&a).iter().zip(edges(&c)).all(|(x, y)| (x - y).abs() < 1e-12));
        let (p, r, b) = (vec![[0.003, 0.0101, 0.004], [0.015, 0.019, 0.021]], vec![5e-4; 2], 4e-3);
        let field = lattice.solid_fraction(&p, |_| 1e-9, |_| b);
        // the kernel mapping: the same Gaussian by quadrature over tetrahedra
        let mut kernel = Kernel::default();
        kernel.prepare(&mesh, &Options { bandwidth: b, grid: 0.0 });
        let inside = |j: usize, x: [f64; 3]| mesh.sides(j).iter().all(|s| s.beyond(&x) <= 0.0);
        let hosts: Vec<u32> =
            p.iter().map(|x| (0..mesh.len()).find(|j| inside(*j, *x)).unwrap() as u32).collect();
        let mut w = Weights::default();
        kernel.weights(&mesh, &p, &r, &hosts, &mut w);
        let mut other = vec![0.0; mesh.len()];
        for (c, x) in w.cell.iter().zip(&w.weight) {
            other[*c as usize] += 1e-9 * x / mesh.volume[*c as usize];
        }
        let gap: f64 = field.iter().zip(&other).map(|(a, b)| (a - b) * (a - b)).sum();
        let all: f64 = field.iter().map(|a| a * a).sum();
        assert!((gap / all).sqrt() < 1e-3, "{}", (gap / all).sqrt());
        // other meshes are no lattice
        assert_eq!(Lattice::of_mesh(&Made::tet([3, 3, 3], size).mesh()), None);
    }
}
