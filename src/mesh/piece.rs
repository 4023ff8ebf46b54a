// SPDX-License-Identifier: MIT OR Apache-2.0
//! The part of the mesh one CFD rank sends (MESH frame), checked for consistency.

use super::MeshError;
use voidage_wire::{Frame, WireError, field};

/// What lies behind a patch; codes of `voidage.h`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PatchKind {
    /// wall, inlet, outlet, symmetry: no flux of the smoothing
    Boundary,
    /// other side in the same piece
    Cyclic,
    /// cells of another rank
    Processor,
    /// cells of another rank across a cyclic
    ProcessorCyclic,
    /// front and back of 2-D cases
    Empty,
}

/// A patch of a piece.
#[derive(Clone, Debug, PartialEq)]
pub struct Patch {
    /// what lies behind
    pub kind: PatchKind,
    /// name
    pub name: String,
    /// first face
    pub start: usize,
    /// number of faces
    pub size: usize,
    /// processor kinds: the other rank
    pub neighbour_rank: usize,
    /// cyclic: the neighbour patch; processorCyclic: the refer patch (index in this piece)
    pub neighbour_patch: usize,
    /// a position leaving here continues at position + separation, m
    pub separation: [f64; 3],
}

/// The mesh of one CFD rank.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MeshPiece {
    /// CFD rank
    pub rank: usize,
    /// m
    pub points: Vec<[f64; 3]>,
    /// n_faces + 1 offsets into `face_points`
    pub face_starts: Vec<u32>,
    /// point numbers of all faces
    pub face_points: Vec<u32>,
    /// cell each face belongs to
    pub owner: Vec<u32>,
    /// cell across, internal faces only
    pub neighbour: Vec<u32>,
    /// global id per cell
    pub cell_ids: Vec<i64>,
    /// boundary and links
    pub patches: Vec<Patch>,
}

impl MeshPiece {
    /// Reads a MESH frame.
    pub fn from_frame(rank: usize, f: &Frame) -> Result<Self, WireError> {
        let numbers =
            |name| -> Result<Vec<u32>, WireError> { Ok(f.i64s(name)?.iter().map(|x| *x as u32).collect()) };
        let table = f.i64s(field::PATCHES)?;
        let n = table.len() / 5;
        let names = String::from_utf8_lossy(f.bytes(field::PATCH_NAMES)?).into_owned();
        let mut names = names.lines().map(str::to_owned);
        let separations = f.vectors_of(field::PATCH_SEPARATIONS, n)?;
        let kinds = [
            PatchKind::Boundary,
            PatchKind::Cyclic,
            PatchKind::Processor,
            PatchKind::ProcessorCyclic,
            PatchKind::Empty,
        ];
        let patch = |(row, separation): (&[i64], &[f64; 3])| {
            let kind = usize::try_from(row[0]).ok().and_then(|k| kinds.get(k));
            Ok(Patch {
                kind: *kind.ok_or_else(|| WireError::Damaged(format!("patch kind {}", row[0])))?,
                name: names.next().unwrap_or_default(),
                start: row[1] as usize,
                size: row[2] as usize,
                neighbour_rank: row[3] as usize,
                neighbour_patch: row[4] as usize,
                separation: *separation,
            })
        };
        let points = f.f64s(field::POINTS)?;
        Ok(Self {
            rank,
            points: points.chunks_exact(3).map(|p| [p[0], p[1], p[2]]).collect(),
            face_starts: numbers(field::FACE_STARTS)?,
            face_points: numbers(field::FACE_POINTS)?,
            owner: numbers(field::OWNER)?,
            neighbour: numbers(field::NEIGHBOUR)?,
            cell_ids: f.i64s(field::CELL_IDS)?.to_vec(),
            patches: table.chunks_exact(5).zip(separations).map(patch).collect::<Result<_, WireError>>()?,
        })
    }

    /// Number of faces.
    pub fn faces(&self) -> usize {
        self.owner.len()
    }
    /// Point numbers of a face.
    pub fn face(&self, f: usize) -> &[u32] {
        &self.face_points[self.face_starts[f] as usize..self.face_starts[f + 1] as usize]
    }

    /// Refuses arrays that do not fit together.
    pub fn check(&self) -> Result<(), MeshError> {
        let fail = |what: String| Err(MeshError::Broken { rank: self.rank, what });
        let (n, faces) = (self.cell_ids.len(), self.faces());
        if self.face_starts.len() != faces + 1 || self.neighbour.len() > faces {
            return fail(format!("{faces} owners, {} face starts", self.face_starts.len()));
        }
        let increasing = self.face_starts.windows(2).all(|w| w[0].checked_add(3).is_some_and(|e| e <= w[1]));
        if !increasing || self.face_starts.last().is_some_and(|e| *e as usize != self.face_points.len()) {
            return fail("face lists are damaged (a face needs three points)".into());
        }
        if self.face_points.iter().any(|p| *p as usize >= self.points.len()) {
            return fail("a face names a point that does not exist".into());
        }
        if self.owner.iter().chain(&self.neighbour).any(|c| *c as usize >= n) {
            return fail("a face names a cell that does not exist".into());
        }
        if let Some(i) = self.points.iter().position(|p| p.iter().any(|x| !x.is_finite())) {
            return fail(format!("point {i} is {:?}", self.points[i]));
        }
        let mut next = self.neighbour.len();
        for p in &self.patches {
            if p.size > 0 && p.start != next || p.start.saturating_add(p.size) > faces.max(p.start) {
                return fail(format!("patch {} starts at face {}, {next} is due", p.name, p.start));
            }
            next = next.saturating_add(p.size);
        }
        if next != faces { fail(format!("patches cover {next} of {faces} faces")) } else { Ok(()) }
    }
}
