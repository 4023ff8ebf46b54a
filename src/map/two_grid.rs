// SPDX-License-Identifier: MIT OR Apache-2.0
//! Two grids: particles are deposited on a coarse Cartesian grid and from there on the mesh.
//!
//! m_ik = |coarse cell of x_i ∩ cell k| / |coarse cell ∩ mesh|, the overlap measured by the tetrahedra (centre, face
//! centre, corners) of cell k whose centroids lie in the coarse cell. Source: Deb & Tafti 2013 (Powder Technol. 246,
//! 553), two-grid formulation. A coarse cell without any (mesh coarser than the grid) hands over to the host
//! cell. Error: a box filter of the coarse size, first moment off by up to half of it, plus the sampling of the overlap; smoothing should
//! follow or replace it. Keeps Σ m = 1, positive; not continuous. Cost: one look-up, then (grid/h)³ cells.
//! The grid covers the mesh's bounds from their lower corner; `map.grid` is its largest cell size.

use super::cells::Cells;
use super::{Mapping, Options, Weights};
use crate::mesh::Mesh;
use crate::mesh::geometry::{V, cross, dot, sub};

/// The mapping.
#[derive(Default)]
pub struct TwoGrid {
    ready: usize,
    lower: V,
    step: V,
    n: [usize; 3],
    start: Vec<u32>,
    cell: Vec<u32>,
    share: Vec<f64>,
}

impl TwoGrid {
    fn index(&self, x: V) -> usize {
        let i = [0, 1, 2].map(|a| (((x[a] - self.lower[a]) / self.step[a]) as usize).min(self.n[a] - 1));
        (i[2] * self.n[1] + i[1]) * self.n[0] + i[0]
    }
}

impl Mapping for TwoGrid {
    fn name(&self) -> &'static str {
        "two-grid"
    }
    fn source(&self) -> &'static str {
        "Deb & Tafti 2013: deposit on a coarse grid, then transfer"
    }
    fn properties(&self) -> &'static str {
        "conservative, positive, not continuous; box filter of map.grid; (grid/h)^3 cells per particle"
    }
    fn prepare(&mut self, mesh: &Mesh, options: &Options) {
        assert!(options.grid > 0.0, "two-grid: the grid size is {}", options.grid);
        let extent = [0, 1, 2].map(|a| mesh.bounds[1][a] - mesh.bounds[0][a]);
        self.lower = mesh.bounds[0];
        self.n = extent.map(|e| ((e / options.grid - 1e-9).ceil() as usize).clamp(1, 1 << 20));
        self.step = [0, 1, 2].map(|a| extent[a] / self.n[a] as f64);
        let cells = Cells::new(mesh);
        // (coarse cell, cell, volume), cells ascending within a coarse cell
        let mut list: Vec<(usize, u32, f64)> = Vec::new();
        for c in 0..mesh.len() as u32 {
            let from = list.len();
            for t in cells.tetrahedra(mesh, c) {
                let v = dot(sub(t[1], t[0]), cross(sub(t[2], t[0]), sub(t[3], t[0]))).abs() / 6.0;
                let to = self.index([0, 1, 2].map(|a| 0.25 * (t[0][a] + t[1][a] + t[2][a] + t[3][a])));
                match list[from..].iter_mut().find(|l| l.0 == to) {
                    Some(l) => l.2 += v,
                    None => list.push((to, c, v)),
                }
            }
        }
        list.sort_by_key(|l| (l.0, l.1));
        let coarse = self.n.iter().product();
        (self.start, self.cell, self.share) = (vec![0], Vec::new(), Vec::new());
        let mut at = 0;
        for i in 0..coarse {
            let count = list[at..].iter().take_while(|l| l.0 == i).count();
            let own = &list[at..at + count];
            let all: f64 = own.iter().map(|l| l.2).sum();
            self.cell.extend(own.iter().map(|l| l.1));
            self.share.extend(own.iter().map(|l| l.2 / all));
            self.start.push(self.cell.len() as u32);
            at += count;
        }
        self.ready = mesh.len();
    }
    fn weights(&self, mesh: &Mesh, position: &[[f64; 3]], _: &[f64], host: &[u32], out: &mut Weights) {
        assert_eq!(self.ready, mesh.len(), "two-grid: prepare() it for this mesh first");
        out.fill(host, |_: &mut (), i, h, out| {
            let at = self.index(position[i]);
            let range = self.start[at] as usize..self.start[at + 1] as usize;
            if range.is_empty() {
                out.push(h, 1.0);
            }
            range.for_each(|k| out.push(self.cell[k], self.share[k]));
            out.close();
        });
    }
}
