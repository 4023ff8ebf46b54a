// SPDX-License-Identifier: MIT OR Apache-2.0
//! Meshes made by formula, for tests and the bench: a box of hexahedra (graded or jiggled), of tetrahedra or of
//! polyhedra, with walls or cyclic faces, in one piece or cut over ranks. Lengths m. Time and memory grow linearly
//! with the number of cells. Knows the piece format a CFD rank sends, nothing of particles.

mod boxes;
mod pieces;
mod voronoi;

use super::geometry::V;
use super::{Mesh, MeshPiece, assemble};

/// What the cells are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shape {
    /// n cells
    Hex,
    /// each hexahedron cut into six tetrahedra along its main diagonal: 6 n cells, conforming
    Tet,
    /// Voronoi cells of a body-centred lattice (about truncated octahedra, 14 plane faces): 2 n cells
    Poly,
}

/// What a box is bent into; x and y have walls then.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Bend {
    /// it stays a box
    None,
    /// a cylinder along z
    Cylinder,
    /// half a ring around z, its inner radius as large as its width
    HalfRing,
}

/// A box of cells with its lower corner at the origin.
#[derive(Clone, Debug, PartialEq)]
pub struct Made {
    /// what the cells are
    pub shape: Shape,
    /// lattice cells along each axis
    pub n: [usize; 3],
    /// m
    pub size: V,
    /// size of the last lattice cell ÷ size of the first, geometric (hex and tet)
    pub grading: V,
    /// inner points (poly: seeds) are pushed about by up to half of this fraction of a lattice cell; hex faces
    /// then warp
    pub jiggle: f64,
    /// cyclic axes; walls otherwise
    pub cyclic: [bool; 3],
    /// tet: every other hexahedron along each axis is mirrored, so that the tetrahedra have no common direction
    pub mirrored: bool,
    /// hex and tet: what the box is bent into
    pub bend: Bend,
}

impl Made {
    /// A uniform box with walls.
    pub fn new(shape: Shape, n: [usize; 3], size: V) -> Self {
        let jiggle = if shape == Shape::Poly { 0.2 } else { 0.0 };
        Self {
            shape,
            n,
            size,
            grading: [1.0; 3],
            jiggle,
            cyclic: [false; 3],
            mirrored: false,
            bend: Bend::None,
        }
    }
    /// Uniform hexahedra.
    pub fn hex(n: [usize; 3], size: V) -> Self {
        Self::new(Shape::Hex, n, size)
    }
    /// Hexahedra graded 4:1 in x and z.
    pub fn graded(n: [usize; 3], size: V) -> Self {
        Self { grading: [4.0, 1.0, 4.0], ..Self::new(Shape::Hex, n, size) }
    }
    /// Tetrahedra, inner points jiggled.
    pub fn tet(n: [usize; 3], size: V) -> Self {
        Self { jiggle: 0.2, ..Self::new(Shape::Tet, n, size) }
    }
    /// Polyhedra with plane faces.
    pub fn poly(n: [usize; 3], size: V) -> Self {
        Self::new(Shape::Poly, n, size)
    }
    /// Cyclic along the axes marked (hex and tet need one lattice cell there, poly three).
    pub fn cyclic(self, cyclic: [bool; 3]) -> Self {
        Self { cyclic, ..self }
    }
    /// Tetrahedra without a common direction; even numbers of lattice cells along cyclic axes.
    pub fn mirrored(self) -> Self {
        Self { mirrored: true, ..self }
    }
    /// Bent into a cylinder along z.
    pub fn round(self) -> Self {
        Self { bend: Bend::Cylinder, ..self }
    }
    /// Bent into half a ring around z: walls that are curved outwards and inwards.
    pub fn ring(self) -> Self {
        Self { bend: Bend::HalfRing, ..self }
    }
    /// Inner points or seeds pushed about.
    pub fn jiggled(self, jiggle: f64) -> Self {
        Self { jiggle, ..self }
    }
    /// Number of cells.
    pub fn cells(&self) -> usize {
        let per = match self.shape {
            Shape::Hex => 1,
            Shape::Tet => 6,
            Shape::Poly => 2,
        };
        per * self.n.iter().product::<usize>()
    }

    /// The pieces of `ranks` CFD ranks; `rank_of` gives the rank of a cell from a point near its centre (m).
    pub fn pieces(&self, ranks: usize, rank_of: impl Fn(V) -> usize) -> Vec<MeshPiece> {
        let soup = match self.shape {
            Shape::Hex => boxes::hex(self),
            Shape::Tet => boxes::tet(self),
            Shape::Poly => voronoi::poly(self),
        };
        let rank: Vec<usize> = soup.near_centre.iter().map(|c| rank_of(*c).min(ranks - 1)).collect();
        pieces::cut(&soup, ranks, &rank)
    }
    /// In one piece.
    pub fn whole(&self) -> Vec<MeshPiece> {
        self.pieces(1, |_| 0)
    }
    /// Made and joined.
    ///
    /// # Panics
    /// If the numbers asked for do not make a mesh (no cells, size ≤ 0).
    pub fn mesh(&self) -> Mesh {
        assemble(&self.whole()).unwrap_or_else(|e| panic!("made mesh: {e}"))
    }
}

/// What lies behind a face.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Across {
    Cell(u32),
    /// wall number (2 axis + high)
    Wall(u8),
    /// the half towards `offset` (images of the box) of a pair; the cell there
    Cyclic(u32, [i8; 3]),
}

/// A whole mesh before it is cut: faces with loops seen from outside of the owner.
#[derive(Default)]
struct Soup {
    points: Vec<V>,
    start: Vec<u32>,
    loops: Vec<u32>,
    owner: Vec<u32>,
    across: Vec<Across>,
    near_centre: Vec<V>,
    size: V,
}

impl Soup {
    fn put(&mut self, owner: usize, across: Across, points: impl IntoIterator<Item = u32>) {
        if self.start.is_empty() {
            self.start.push(0);
        }
        self.loops.extend(points);
        self.start.push(self.loops.len() as u32);
        self.owner.push(owner as u32);
        self.across.push(across);
    }
    fn face(&self, f: usize) -> &[u32] {
        &self.loops[self.start[f] as usize..self.start[f + 1] as usize]
    }
}

/// A number in [−0.5, 0.5) that depends on three integers and an axis only.
fn hash(c: [usize; 3], axis: usize) -> f64 {
    let mut x = c.iter().chain([&axis]).fold(0x9e37_79b9_7f4a_7c15_u64, |h, v| {
        (h ^ (*v as u64).wrapping_add(0x7f4a_7c15)).wrapping_mul(0xbf58_476d_1ce4_e5b9).rotate_left(29)
    });
    x ^= x >> 31;
    x = x.wrapping_mul(0x94d0_49bb_1331_11eb);
    (x >> 11) as f64 / (1u64 << 53) as f64 - 0.5
}
