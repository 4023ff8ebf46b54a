// SPDX-License-Identifier: MIT OR Apache-2.0
//! The coupler's own copy of the mesh: pieces of the CFD ranks joined by global cell id.
//!
//! Reads pieces (points m, faces, owner/neighbour, patches); writes geometry (`geometry`), what lies across
//! each face (`join`) and the Laplacian's graph. The result is the same to the bit however the mesh is split:
//! every face is computed from one canonical description, sums run in global-id order. Does not know particles.

mod geometry;
mod join;
pub mod made;
mod piece;

pub use join::assemble;
pub use piece::{MeshPiece, Patch, PatchKind};

use thiserror::Error;

/// Slot number of "no cell".
pub const NONE: u32 = u32::MAX;

/// One side of a cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Side {
    /// unit normal of the face; the same vector for both cells of a face
    pub normal: [f64; 3],
    /// normal · face centre, m
    pub offset: f64,
    /// +1: the normal points out of this cell, −1: into it
    pub sign: f64,
    /// cell across, or `NONE` at a boundary
    pub across: u32,
    /// boundary patch (index into `patch_names`), else `NONE`
    pub patch: u32,
    /// what to add to a position that leaves here (cyclic), m
    pub shift: [f64; 3],
}

/// A row entry of the Laplacian.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Link {
    /// neighbour slot
    pub to: u32,
    /// |S_f| / d_f, m
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
    /// first link of each slot in `links`; one more at the end
    pub link_start: Vec<u32>,
    /// Laplacian entries, by neighbour slot within a row
    pub links: Vec<Link>,
    /// names of boundary patches
    pub patch_names: Vec<String>,
    /// lower and upper corner, m
    pub bounds: [[f64; 3]; 2],
    /// points of each cell's faces, for output: unique points and face lists by slot
    pub faces: Faces,
}

/// Face loops by cell, for writing the mesh out.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Faces {
    /// unique points, m
    pub points: Vec<[f64; 3]>,
    /// per slot: list of faces, each a list of point numbers
    pub of_cell: Vec<Vec<Vec<u32>>>,
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
    /// Sides of a cell.
    pub fn sides(&self, slot: usize) -> &[Side] {
        &self.sides[self.side_start[slot] as usize..self.side_start[slot + 1] as usize]
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
