// SPDX-License-Identifier: MIT OR Apache-2.0
//! Statistical kernel: each cell gets the integral of the particle's Gaussian over it; a reference, slow.
//!
//! m_ik = ∫_k Σ_images exp(−|y − x|²/b²) dV / Σ_k (the same). Source: Sun & Xiao 2015, eq. 6. Images are the
//! particle mirrored at the plane walls near it, so that nothing leaves; cyclic images come from walking through cyclic
//! faces. Integrals by tetrahedra (centre, face centre, corners), four points each, exact to second degree: for b at least the cell
//! size. The Gaussian is cut at 4 b (1e-7 of it). b is `smooth.bandwidth`; smoothing should then be off. Keeps
//! Σ m = 1, positive, continuous but for the cut. Cost: about (8 b/h)³ cells per particle, milliseconds at b/h = 4.

use super::cells::Cells;
use super::{Mapping, Options, Weights};
use crate::mesh::geometry::{V, add, cross, dot, length, scale, sub};
use crate::mesh::{Mesh, NONE};
use std::collections::HashSet;

/// The mapping.
#[derive(Default)]
pub struct Kernel {
    cells: Cells,
    bandwidth: f64,
}

/// Radius at which the Gaussian is cut, in bandwidths.
const CUT: f64 = 4.0;
/// Images kept: enough for the corner of a box thinner than the cut.
const IMAGES: usize = 200;

impl Kernel {
    /// ∫ exp(−|y − x|²/b²) over the images' sum and one cell.
    fn integral(&self, mesh: &Mesh, cell: u32, images: &[V]) -> f64 {
        // Hammer & Stroud 1956: four points, second degree
        const A: f64 = 0.585_410_196_624_968_5;
        const B: f64 = 0.138_196_601_125_010_5;
        let s = -1.0 / (self.bandwidth * self.bandwidth);
        let value = |y: V| images.iter().map(|x| sub(y, *x)).map(|d| (s * dot(d, d)).exp()).sum::<f64>();
        let mut sum = 0.0;
        for t in self.cells.tetrahedra(mesh, cell) {
            let v = dot(sub(t[1], t[0]), cross(sub(t[2], t[0]), sub(t[3], t[0]))).abs() / 6.0;
            let all = t.iter().fold([0.0; 3], |s, p| add(s, *p));
            sum += 0.25 * v * t.iter().map(|p| value(add(scale(*p, A - B), scale(all, B)))).sum::<f64>();
        }
        sum
    }
}

impl Mapping for Kernel {
    fn name(&self) -> &'static str {
        "kernel"
    }
    fn source(&self) -> &'static str {
        "Sun & Xiao 2015, eq. 6: Gaussian with images at walls"
    }
    fn properties(&self) -> &'static str {
        "conservative, positive, continuous; second-degree quadrature; (8 b/h)^3 cells, milliseconds per particle"
    }
    fn smooths(&self) -> bool {
        true
    }
    fn prepare(&mut self, mesh: &Mesh, options: &Options) {
        self.cells = Cells::new(mesh);
        self.bandwidth = options.bandwidth;
    }
    fn weights(&self, mesh: &Mesh, position: &[[f64; 3]], _: &[f64], host: &[u32], out: &mut Weights) {
        assert_eq!(self.cells.len(), mesh.len(), "kernel: prepare() it for this mesh first");
        assert!(self.bandwidth > 0.0, "kernel: the bandwidth is {}", self.bandwidth);
        let cut = CUT * self.bandwidth;
        out.fill(host, |_: &mut (), i, h, out| {
            let x = position[i];
            // cells within the cut, each with the particle's position as seen from there
            let mut visited = vec![(h, x)];
            let grain = 0.1 * self.bandwidth;
            let key = |c: u32, y: V| (c, [0, 1, 2].map(|a| ((y[a] - x[a]) / grain).round() as i64));
            let mut seen = HashSet::from([key(h, x)]);
            let mut walls: Vec<(V, f64)> = Vec::new();
            let mut i = 0;
            while i < visited.len() {
                let (cell, y) = visited[i];
                i += 1;
                if length(sub(mesh.centre[cell as usize], y)) > cut + mesh.volume[cell as usize].cbrt() {
                    continue;
                }
                for f in self.cells.facets(cell) {
                    let n = [f.plane[0], f.plane[1], f.plane[2]];
                    if f.across == NONE {
                        // distance of the wall from the particle, the same in every cyclic image
                        let d = f.plane[3] - dot(n, y);
                        let same = |w: &(V, f64)| {
                            dot(w.0, n) > 1.0 - 1e-9 && (w.1 - d).abs() < 1e-6 * self.bandwidth
                        };
                        if d < cut && !walls.iter().any(same) {
                            walls.push((n, d));
                        }
                        continue;
                    }
                    let z = add(y, mesh.shift(&mesh.sides[f.side as usize]));
                    if seen.insert(key(f.across, z)) {
                        visited.push((f.across, z));
                    }
                }
            }
            // images relative to the particle
            let mut images: Vec<V> = vec![[0.0; 3]];
            let mut i = 0;
            while i < images.len() && images.len() < IMAGES {
                for (n, d) in &walls {
                    let image = add(images[i], scale(*n, 2.0 * (d - dot(*n, images[i]))));
                    let same = |o: &V| length(sub(*o, image)) < 1e-6 * self.bandwidth;
                    if length(image) < 2.0 * cut && !images.iter().any(same) {
                        images.push(image);
                    }
                }
                i += 1;
            }
            for (cell, y) in &visited {
                let near: Vec<V> = images.iter().map(|d| add(*y, *d)).collect();
                let w = self.integral(mesh, *cell, &near);
                if w > 0.0 {
                    out.push(*cell, w);
                }
            }
            if out.cell.len() == *out.start.last().unwrap_or(&0) as usize {
                out.push(h, 1.0); // b so small against the cell that no quadrature point sees the Gaussian
            }
            out.close_scaled();
        });
    }
}
