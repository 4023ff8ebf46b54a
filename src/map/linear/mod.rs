// SPDX-License-Identifier: MIT OR Apache-2.0
//! Linear deposit: weights that reproduce the particle's position, Σ_k m_ik x_k = x_i, positive on any mesh.
//!
//! In cells of a rectilinear block (`block`) the weights are tri-linear between cell centres (cloud in cell): along
//! each axis t = (x − x_c)·n/d to the neighbour, 1 − t to the cell. Elsewhere (`fan`) the cell is cut into
//! tetrahedra (centre, face point, two corners); the particle's barycentric coordinates are handed on: the
//! centre's to the cell, the face point's to the two cells (the point where the line between their centres meets
//! the face, moved inside), a corner's to the cells around it with positive weights of largest entropy that reproduce the corner
//! (Arroyo & Ortiz 2006). At walls cells are mirrored and the mirrored weight goes to the real cell, which is
//! the deposit of the mirrored particle too. Positive, conservative, continuous within a block and within the rest;
//! gather with the same weights is the adjoint and interpolates fields linearly (exact for linear fields away from
//! walls where face lines meet their faces). A block ends one cell before cells that are not rectilinear; there the
//! weights jump, with the same sum and first moment.
//! Source: cloud in cell: Birdsall & Fuss 1969; this construction on polyhedra: own.
//! Error: the deposit adds a variance, h²/12 per axis beyond a cell's own on a uniform block; `link_variance` gives it per face. T = b²/4 is
//! left alone: the two-point Laplacian's kernel is too peaked, and the deposit's spread offsets that. Gains over the particle centroid by
//! mesh and b/h: docs/bench.md.

mod block;
mod fan;
mod rings;

pub use rings::{Fraction, Rings};
pub(super) use rings::{PLACE, ROOM, shares};

use super::cells::Cells;
use super::{Mapping, Options, Weights};
use crate::mesh::{Mesh, NONE};
use crate::threads;
use block::Block;
use fan::Fan;
use std::sync::Arc;

/// Particles that one thread takes at a time.
const PIECE: usize = 4096;

/// The mapping.
#[derive(Default)]
pub struct Linear {
    block: Block,
    /// all cells are in blocks
    blocks: bool,
    fan: Fan,
}

impl Mapping for Linear {
    fn name(&self) -> &'static str {
        "linear"
    }
    fn source(&self) -> &'static str {
        "cloud in cell (Birdsall & Fuss 1969), on polyhedra by tetrahedra and corner weights of largest entropy"
    }
    fn properties(&self) -> &'static str {
        "conservative, positive, first moment kept (skew faces: 0.004 h off on average); own variance known; 0.01 us per particle on \
         hexahedra, 0.2 to 1 elsewhere"
    }
    fn prepare(&mut self, mesh: &Mesh, _: &Options) {
        self.block = Block::new(mesh);
        self.blocks = (0..mesh.len()).all(|c| self.block.holds(c));
        self.fan = if self.blocks { Fan::default() } else { Fan::new(mesh, Cells::new(mesh)) };
    }
    fn weights(&self, mesh: &Mesh, position: &[[f64; 3]], _: &[f64], host: &[u32], out: &mut Weights) {
        assert_eq!(self.block.rings.len(), mesh.len(), "linear: prepare() it for this mesh first");
        if !self.blocks {
            return out.fill(host, |_: &mut (), i, h, out| {
                if self.block.holds(h as usize) {
                    let fraction = self.block.fraction(mesh, h as usize, position[i]);
                    let (cell, weight) = self.block.rings.eight(h, fraction);
                    (0..8).filter(|c| weight[*c] > 0.0).for_each(|c| out.push(cell[c], weight[c]));
                } else {
                    self.fan.weights(mesh, h, position[i], out);
                }
                out.close();
            });
        }
        let mut fraction = out.near.take().unwrap_or_default().1;
        out.by_hosts(host);
        fraction.resize(host.len(), [0.0; 3]);
        let parts = fraction.chunks_mut(PIECE).zip(host.chunks(PIECE).zip(position.chunks(PIECE)));
        threads::map(parts.collect(), |(to, (host, position))| {
            for ((to, h), x) in to.iter_mut().zip(host).zip(position).filter(|p| *p.0.1 != NONE) {
                *to = self.block.fraction(mesh, *h as usize, *x);
            }
        });
        out.near = Some((Arc::clone(&self.block.rings), fraction));
    }
    fn link_variance(&self, mesh: &Mesh) -> Vec<f64> {
        // by side of a cell; the two cells of a link by volume
        let tensor: Vec<_> = (0..mesh.len())
            .map(|c| if self.block.holds(c) { None } else { Some(self.fan.variance(mesh, c as u32)) })
            .collect();
        let half = |cell: usize, way: [f64; 3], distance: f64| match &tensor[cell] {
            None => self.block.variance(mesh, cell, way, distance),
            Some(e) => {
                let row = |a: usize| e[a][0] * way[0] + e[a][1] * way[1] + e[a][2] * way[2];
                way[0] * row(0) + way[1] * row(1) + way[2] * row(2)
            }
        };
        let mut list = Vec::with_capacity(mesh.links.len());
        for i in 0..mesh.len() {
            for link in mesh.links(i) {
                let j = link.to as usize;
                let (low, high) = (i.min(j), i.max(j));
                let Some((way, distance)) = way(mesh, low, high) else {
                    list.push(0.0);
                    continue;
                };
                let (v, w) = (mesh.volume[low], mesh.volume[high]);
                let sum = v * half(low, way, distance) + w * half(high, way.map(|x| -x), distance);
                list.push(sum / (v + w));
            }
        }
        list
    }
}

/// Unit vector and distance from the centre of `low` to that of `high` across their common side (the first one
/// between them; all sides between two cells lie on one line but for tiny cyclic boxes).
fn way(mesh: &Mesh, low: usize, high: usize) -> Option<([f64; 3], f64)> {
    let side = mesh.sides(low).iter().find(|s| s.across as usize == high)?;
    let d = mesh.way(low, side);
    let size = crate::mesh::geometry::length(d);
    (size > 0.0).then(|| (d.map(|x| x / size), size))
}
