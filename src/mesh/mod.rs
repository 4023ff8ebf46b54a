// SPDX-License-Identifier: MIT OR Apache-2.0
//! The coupler's own copy of the mesh: pieces of the CFD ranks joined by global cell id.
//!
//! Reads pieces (points m, faces, owner/neighbour, patches); writes geometry (`geometry`), what lies across
//! each face (`join`) and the Laplacian's graph (`join`: across faces; `voronoi`: between centres). The result is the same to the bit however the mesh is split:
//! every face is computed from one canonical description, sums run in global-id order. Does not know particles.

mod clip;
pub(crate) mod geometry;
mod join;
pub mod made;
mod pairs;
mod piece;
mod voronoi;

pub use join::assemble;
pub use piece::{MeshPiece, Patch, PatchKind};

use thiserror::Error;

/// Slot number of "no cell".
pub const NONE: u32 = u32::MAX;

/// One side of a cell; 40 bytes, since there are six per cell and every locate reads them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Side {
    /// unit normal out of this cell, and normal · face centre (m); seen from the other cell the same bits, negated
    pub plane: [f64; 4],
    /// cell across, or `NONE` at a boundary
    pub across: u32,
    /// bit 31: the face's own normal points into this cell; the rest: boundary patch, or number of the shift
    tag: u32,
}

const INWARD: u32 = 1 << 31;

impl Side {
    fn new(plane: [f64; 4], across: u32, inward: bool, number: u32) -> Self {
        Self { plane, across, tag: number | if inward { INWARD } else { 0 } }
    }
    /// Distance of a point beyond this side, m; negative: towards the cell.
    #[inline(always)]
    pub fn beyond(&self, x: &[f64; 3]) -> f64 {
        let p = &self.plane;
        (p[0] * x[0] + p[1] * x[1] + p[2] * x[2]) - p[3]
    }
    /// Does the face's own normal, the same for both cells, point out of this one?
    pub fn outward(&self) -> bool {
        self.tag & INWARD == 0
    }
    /// Boundary patch (index into `patch_names`); only where `across` is `NONE`.
    pub fn patch(&self) -> u32 {
        self.tag & !INWARD
    }
    /// Leads through a cyclic?
    #[inline(always)]
    pub fn shifts(&self) -> bool {
        self.across != NONE && self.tag & !INWARD != 0
    }
}

/// A row entry of the Laplacian.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Link {
    /// neighbour slot
    pub to: u32,
    /// |S_f| / d_f, m, of faces of the mesh or of the Voronoi diagram of the centres
    pub weight: f64,
}

/// The whole mesh; cells in the order of their global ids ("slots").
#[derive(Clone, Debug, PartialEq)]
pub struct Mesh {
    /// global id per slot, ascending
    pub ids: Vec<i64>,
    /// cell centres, m
    pub centre: Vec<[f64; 3]>,
    /// cell volumes, m3
    pub volume: Vec<f64>,
    /// piece → local cell → slot
    pub slots: Vec<Vec<u32>>,
    /// first side of each slot in `sides`; one more at the end
    pub side_start: Vec<u32>,
    /// sides of all cells
    pub sides: Vec<Side>,
    /// what is added to a position that leaves through a side (cyclic), m; number 0: nothing
    pub shifts: Vec<[f64; 3]>,
    /// first link of each slot in `links`; one more at the end
    pub link_start: Vec<u32>,
    /// Laplacian entries, by neighbour slot within a row
    pub links: Vec<Link>,
    /// names of boundary patches
    pub patch_names: Vec<String>,
    /// lower and upper corner, m
    pub bounds: [[f64; 3]; 2],
    /// points and faces
    pub faces: Faces,
}

/// Points and face loops, for writing the mesh out and for cutting cells.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Faces {
    /// unique points, m
    pub points: Vec<[f64; 3]>,
    /// first corner of each face in `corners`; one more at the end
    pub start: Vec<u32>,
    /// point numbers
    pub corners: Vec<u32>,
    /// per side of the mesh: its face
    pub of_side: Vec<u32>,
}

impl Faces {
    /// Point numbers of a face.
    pub fn corners(&self, face: u32) -> &[u32] {
        &self.corners[self.start[face as usize] as usize..self.start[face as usize + 1] as usize]
    }
}

impl Mesh {
    /// Number of cells.
    pub fn len(&self) -> usize {
        self.ids.len()
    }
    /// No cell at all.
    pub fn is_empty(&self) -> bool {
        self.ids.is_empty()
    }
    /// More than a quarter of the cells are tetrahedra.
    pub fn tetrahedral(&self) -> bool {
        4 * (0..self.len()).filter(|i| self.sides(*i).len() == 4).count() > self.len()
    }
    /// Cells along a curve through their centres (Morton's): those that follow each other are near each other, however the mesh is numbered.
    pub fn along_curve(&self) -> Vec<u32> {
        let [low, high] = self.bounds;
        let place = |x: f64, a: usize| ((x - low[a]) / (high[a] - low[a]) * 1024.0).clamp(0.0, 1023.0) as u32;
        // ten bits of each axis in turn
        let key = |c: &[f64; 3]| {
            let p = [0, 1, 2].map(|a| place(c[a], a));
            (0..30).rev().fold(0u32, |key, b| key << 1 | p[b % 3] >> (b / 3) & 1)
        };
        let mut all: Vec<(u32, u32)> = self.centre.iter().map(key).zip(0..).collect();
        all.sort_unstable();
        all.into_iter().map(|e| e.1).collect()
    }
    /// Sides of a cell.
    pub fn sides(&self, slot: usize) -> &[Side] {
        &self.sides[self.side_start[slot] as usize..self.side_start[slot + 1] as usize]
    }
    /// Point numbers of the faces of a cell, in the order of its sides.
    pub fn loops(&self, slot: usize) -> impl Iterator<Item = &[u32]> {
        let range = self.side_start[slot] as usize..self.side_start[slot + 1] as usize;
        self.faces.of_side[range].iter().map(|f| self.faces.corners(*f))
    }
    /// Numbers of a cell's points, ascending, each once.
    pub fn corners(&self, slot: usize) -> Vec<u32> {
        let mut all: Vec<u32> = self.loops(slot).flatten().copied().collect();
        all.sort_unstable();
        all.dedup();
        all
    }
    /// Lower and upper corner of the box around a cell, m.
    pub fn bounds_of(&self, slot: usize) -> [[f64; 3]; 2] {
        let mut b = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
        for p in self.loops(slot).flatten().map(|p| self.faces.points[*p as usize]) {
            for a in 0..3 {
                (b[0][a], b[1][a]) = (b[0][a].min(p[a]), b[1][a].max(p[a]));
            }
        }
        b
    }
    /// What is added to a position that leaves through a side, m.
    pub fn shift(&self, side: &Side) -> [f64; 3] {
        if side.shifts() { self.shifts[side.patch() as usize] } else { [0.0; 3] }
    }
    /// From the centre of a cell to that across one of its sides, m.
    pub fn way(&self, cell: usize, side: &Side) -> [f64; 3] {
        let (to, shift, from) = (self.centre[side.across as usize], self.shift(side), self.centre[cell]);
        [0, 1, 2].map(|a| to[a] - shift[a] - from[a])
    }
    /// Furthest corner of each cell from its centre, m.
    pub fn extents(&self) -> Vec<f64> {
        let far = |c: usize| {
            let of =
                |p: &u32| geometry::length(geometry::sub(self.faces.points[*p as usize], self.centre[c]));
            self.loops(c).flatten().map(of).fold(0.0, f64::max)
        };
        (0..self.len()).map(far).collect()
    }
    /// Mean angle between the faces' normals and the lines between the centres on both sides, by area, degrees (checkMesh:
    /// "mesh non-orthogonality average", there by face).
    pub fn non_orthogonality(&self) -> f64 {
        let (mut sum, mut all) = (0.0, 0.0);
        for i in 0..self.len() {
            for s in self.sides(i).iter().filter(|s| s.across != NONE) {
                let d = self.way(i, s);
                let (n, size) = ([s.plane[0], s.plane[1], s.plane[2]], geometry::length(d));
                // the link's weight × d is the area
                let area = self.links(i).iter().find(|l| l.to == s.across).map_or(0.0, |l| l.weight * size);
                sum += area * (geometry::dot(n, d) / size).clamp(-1.0, 1.0).acos().to_degrees();
                all += area;
            }
        }
        if all > 0.0 { sum / all } else { 0.0 }
    }
    /// Laplacian row of a cell.
    pub fn links(&self, slot: usize) -> &[Link] {
        &self.links[self.link_start[slot] as usize..self.link_start[slot + 1] as usize]
    }
}

/// A mesh that cannot be used.
#[derive(Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum MeshError {
    /// Arrays do not fit together.
    #[error("rank {rank}: {what}")]
    Broken {
        /// CFD rank
        rank: usize,
        /// what is wrong
        what: String,
    },
    /// Bad geometry.
    #[error("cell {cell}: {what}; run checkMesh")]
    Cell {
        /// global id
        cell: i64,
        /// what is wrong
        what: String,
    },
    /// Parts do not match.
    #[error("{0}; decompose the case again")]
    Unmatched(String),
}
