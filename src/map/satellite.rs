// SPDX-License-Identifier: MIT OR Apache-2.0
//! 29 satellite points: the sphere's volume in 29 equal parts, each to the cell its point lies in.
//!
//! m_ik = (points of i in k)/29. Points: the centre; 14 at 0.6276 R and 14 at 0.9085 R (`divided_points.csv`, in
//! radii), the volume centroids of two shells of 14/29 of the volume about a core of 1/29. Source: Radl et al. 2014,
//! with the point set CFDEMcoupling's `divided` model uses. A point is found by walking from the host cell through faces; cyclic faces
//! and rank borders are faces like any other, so nothing is folded back there. A point beyond a wall goes to the
//! cell where the walk stops at that wall (CFDEMcoupling: to the host cell). Error: 0.03 to 0.05 (rms) of a cell's
//! share against the exact overlap for cells of 0.5 to 5 diameters; second moment 0.168 R² in x, y and 0.252 R² in z
//! instead of 0.2 R². Keeps Σ m = 1, positive; not continuous.

use super::cells::Cells;
use super::{Mapping, Options, Weights};
use crate::mesh::Mesh;
use crate::mesh::geometry::{add, scale};

/// The mapping.
#[derive(Default)]
pub struct SatellitePoints {
    cells: Cells,
    points: Vec<[f64; 3]>,
}

fn points() -> Vec<[f64; 3]> {
    let number = |s: &str| s.parse::<f64>().unwrap_or(f64::NAN);
    let row = |l: &str| {
        let w: Vec<f64> = l.split(',').map(number).collect();
        [w[1], w[2], w[3]]
    };
    include_str!("divided_points.csv").lines().skip(1).map(row).collect()
}

impl Mapping for SatellitePoints {
    fn name(&self) -> &'static str {
        "satellite-points"
    }
    fn source(&self) -> &'static str {
        "Radl et al. 2014 (CFDEMcoupling's divided): 29 points of equal volume"
    }
    fn properties(&self) -> &'static str {
        "conservative, positive, not continuous; error of a share 0.03 to 0.05; 0.1 to 2 us per particle"
    }
    fn prepare(&mut self, mesh: &Mesh, _: &Options) {
        self.cells = Cells::new(mesh);
        self.points = points();
    }
    fn weights(&self, mesh: &Mesh, position: &[[f64; 3]], radius: &[f64], host: &[u32], out: &mut Weights) {
        assert_eq!(self.cells.len(), mesh.len(), "satellite-points: prepare() it for this mesh first");
        out.fill(host, |found: &mut Vec<(u32, u32)>, i, h, out| {
            let (x, r) = (position[i], radius[i]);
            // outermost point 0.9086 R
            if self.cells.depth(h, x) >= 0.9086 * r {
                out.push(h, 1.0);
                return out.close();
            }
            found.clear();
            for p in &self.points {
                let mut y = add(x, scale(*p, r));
                let cell = self.cells.walk(mesh, h, &mut y);
                match found.iter_mut().find(|f| f.0 == cell) {
                    Some(f) => f.1 += 1,
                    None => found.push((cell, 1)),
                }
            }
            for (cell, n) in found.iter() {
                out.push(*cell, f64::from(*n) / self.points.len() as f64);
            }
            out.close();
        });
    }
}
