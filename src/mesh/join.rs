// SPDX-License-Identifier: MIT OR Apache-2.0
//! Joins the pieces: global slots, faces across ranks and cyclics, sides and Laplacian rows.
//!
//! All tables are flat: a mesh of a million cells must not need a multiple of its own size while it is joined.

use super::geometry::{self, Face, V, add, dot, length, scale, sub};
use super::{Faces, Link, Mesh, MeshError, MeshPiece, NONE, Patch, PatchKind, Side};
use std::collections::HashMap;

/// A face of one cell.
#[derive(Clone, Copy)]
struct Half {
    face: u32,
    /// slot across or `NONE`
    across: u32,
    /// boundary patch, or number of the shift
    number: u32,
    /// owner of the face in its piece
    owner: bool,
}

/// Faces of all pieces, one after the other, and the halves of each cell.
struct Table {
    faces: Vec<Face>,
    start: Vec<u32>,
    halves: Vec<Half>,
}

/// Joins the pieces of all CFD ranks (rank order) to the whole mesh.
pub fn assemble(pieces: &[MeshPiece]) -> Result<Mesh, MeshError> {
    let (ids, slots) = number_cells(pieces)?;
    let patch_names = patch_names(pieces);
    let bounds = bounds(pieces);
    let shifts = Shifts::new(pieces, bounds);
    let table = halves(pieces, &slots, ids.len(), &patch_names, &shifts)?;
    build(pieces, ids, slots, table, patch_names, shifts.list, bounds)
}

/// Displacements through cyclics, sorted; number 0 is none. The ranks of one cyclic average theirs over different
/// faces, so the last bits are rounded away: 2^-44 of the box, far below what a wall is given (`locate`).
struct Shifts {
    quantum: f64,
    list: Vec<V>,
}

impl Shifts {
    fn new(pieces: &[MeshPiece], bounds: [V; 2]) -> Self {
        let quantum = length(sub(bounds[1], bounds[0])) * 0.5f64.powi(44);
        let mut s = Self { quantum, list: Vec::new() };
        s.list = pieces.iter().flat_map(|p| &p.patches).map(|p| s.rounded(p.separation)).collect();
        s.list.retain(|x| *x != [0.0; 3]);
        s.list.push([0.0; 3]);
        s.list.sort_by(|a, b| a.partial_cmp(b).unwrap_or(std::cmp::Ordering::Equal));
        s.list.dedup();
        let zero = s.list.iter().position(|x| *x == [0.0; 3]).unwrap_or(0);
        s.list[..=zero].rotate_right(1);
        s
    }
    fn rounded(&self, v: V) -> V {
        // + 0.0: no negative zero
        v.map(|x| if self.quantum > 0.0 { (x / self.quantum).round() * self.quantum + 0.0 } else { x })
    }
    fn number(&self, separation: V) -> u32 {
        let v = self.rounded(separation);
        self.list.iter().position(|x| *x == v).unwrap_or(0) as u32
    }
}

/// Names of the boundary patches in alphabetical order: no number may depend on the order of the pieces.
fn patch_names(pieces: &[MeshPiece]) -> Vec<String> {
    let boundary = |p: &&Patch| matches!(p.kind, PatchKind::Boundary | PatchKind::Empty) && p.size > 0;
    let mut names: Vec<String> =
        pieces.iter().flat_map(|p| p.patches.iter().filter(boundary).map(|p| p.name.clone())).collect();
    names.sort();
    names.dedup();
    names
}

fn halves(
    pieces: &[MeshPiece],
    slots: &[Vec<u32>],
    cells: usize,
    names: &[String],
    shifts: &Shifts,
) -> Result<Table, MeshError> {
    let mut start = vec![0u32; cells + 1];
    for (piece, slots) in pieces.iter().zip(slots) {
        for c in piece.owner.iter().chain(&piece.neighbour) {
            start[slots[*c as usize] as usize + 1] += 1;
        }
    }
    (0..cells).for_each(|i| start[i + 1] += start[i]);
    let mut next = start.clone();
    let empty = Half { face: 0, across: NONE, number: 0, owner: true };
    let mut halves = vec![empty; start[cells] as usize];
    let mut faces = Vec::with_capacity(pieces.iter().map(MeshPiece::faces).sum());
    let mut put = |slot: u32, half: Half| {
        let at = &mut next[slot as usize];
        halves[*at as usize] = half;
        *at += 1;
    };
    let mut corner = Vec::new();
    for (rank, piece) in pieces.iter().enumerate() {
        let first = faces.len() as u32;
        for f in 0..piece.faces() {
            corner.clear();
            corner.extend(piece.face(f).iter().map(|p| piece.points[*p as usize]));
            faces.push(geometry::face(&corner));
        }
        let slot = |c: u32| slots[rank][c as usize];
        for (f, neighbour) in piece.neighbour.iter().enumerate() {
            let (a, b) = (slot(piece.owner[f]), slot(*neighbour));
            let face = first + f as u32;
            put(a, Half { face, across: b, number: 0, owner: true });
            put(b, Half { face, across: a, number: 0, owner: false });
        }
        for (index, patch) in piece.patches.iter().enumerate() {
            let boundary = matches!(patch.kind, PatchKind::Boundary | PatchKind::Empty);
            let other = if boundary { None } else { Some(across(pieces, rank, index)?) };
            let number = if boundary {
                names.iter().position(|n| *n == patch.name).unwrap_or(0) as u32
            } else {
                shifts.number(patch.separation)
            };
            for i in 0..patch.size {
                let f = patch.start + i;
                let across = other.map_or(NONE, |(r, s)| slots[r][pieces[r].owner[s + i] as usize]);
                put(slot(piece.owner[f]), Half { face: first + f as u32, across, number, owner: true });
            }
        }
    }
    Ok(Table { faces, start, halves })
}

fn number_cells(pieces: &[MeshPiece]) -> Result<(Vec<i64>, Vec<Vec<u32>>), MeshError> {
    let mut ids: Vec<i64> = Vec::new();
    for p in pieces {
        p.check()?;
        ids.extend(&p.cell_ids);
    }
    ids.sort_unstable();
    if let Some(w) = ids.windows(2).find(|w| w[0] == w[1]) {
        return Err(MeshError::Cell { cell: w[0], what: "this global id came twice".into() });
    }
    if ids.is_empty() {
        return Err(MeshError::Unmatched("the mesh has no cells".into()));
    }
    let slot = |id: &i64| ids.binary_search(id).unwrap_or_default() as u32;
    let slots = pieces.iter().map(|p| p.cell_ids.iter().map(slot).collect()).collect();
    Ok((ids, slots))
}

/// Rank and first face of the patch that faces patch `index` of `rank`.
fn across(pieces: &[MeshPiece], rank: usize, index: usize) -> Result<(usize, usize), MeshError> {
    let patch = &pieces[rank].patches[index];
    let found: Option<(usize, &Patch)> = match patch.kind {
        PatchKind::Cyclic => pieces[rank].patches.get(patch.neighbour_patch).map(|p| (rank, p)),
        PatchKind::Processor => pieces.get(patch.neighbour_rank).and_then(|other| {
            let back = |p: &&Patch| p.kind == PatchKind::Processor && p.neighbour_rank == rank;
            Some((patch.neighbour_rank, other.patches.iter().find(back)?))
        }),
        PatchKind::ProcessorCyclic => pieces.get(patch.neighbour_rank).and_then(|other| {
            // the two halves of a cyclic refer to each other by name, on every rank
            let refer = pieces[rank].patches.get(patch.neighbour_patch)?;
            let partner = &pieces[rank].patches.get(refer.neighbour_patch)?.name;
            let back = |p: &&Patch| {
                p.kind == PatchKind::ProcessorCyclic
                    && p.neighbour_rank == rank
                    && other.patches.get(p.neighbour_patch).is_some_and(|r| r.name == *partner)
            };
            Some((patch.neighbour_rank, other.patches.iter().find(back)?))
        }),
        _ => None,
    };
    match found {
        Some((r, p)) if p.size == patch.size => Ok((r, p.start)),
        Some((r, p)) => Err(MeshError::Unmatched(format!(
            "patch {} of rank {rank} has {} faces, {} of rank {r} has {}",
            patch.name, patch.size, p.name, p.size
        ))),
        None => Err(MeshError::Unmatched(format!("patch {} of rank {rank} has no other side", patch.name))),
    }
}

fn bounds(pieces: &[MeshPiece]) -> [V; 2] {
    let mut b = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
    for p in pieces.iter().flat_map(|p| &p.points) {
        for a in 0..3 {
            b[0][a] = b[0][a].min(p[a]);
            b[1][a] = b[1][a].max(p[a]);
        }
    }
    b
}

fn build(
    pieces: &[MeshPiece],
    ids: Vec<i64>,
    slots: Vec<Vec<u32>>,
    table: Table,
    patch_names: Vec<String>,
    shifts: Vec<V>,
    bounds: [V; 2],
) -> Result<Mesh, MeshError> {
    let n = ids.len();
    let Table { faces: geometry, start, mut halves } = table;
    let face = |h: &Half| &geometry[h.face as usize];
    let outward = |h: &Half| h.owner != face(h).reversed;
    let (mut centre, mut volume) = (Vec::with_capacity(n), Vec::with_capacity(n));
    let mut flat = Vec::new();
    for slot in 0..n {
        let list = &mut halves[start[slot] as usize..start[slot + 1] as usize];
        let fail = |what: String| MeshError::Cell { cell: ids[slot], what };
        if list.len() < 4 {
            return Err(fail(format!("it has {} faces", list.len())));
        }
        list.sort_by(|a, b| {
            let key = |h: &Half| (h.across, if h.across == NONE { h.number } else { 0 });
            let by_centre =
                || face(a).centre.partial_cmp(&face(b).centre).unwrap_or(std::cmp::Ordering::Equal);
            key(a).cmp(&key(b)).then_with(by_centre)
        });
        flat.clear();
        let out = |h: &Half| if outward(h) { face(h).area } else { scale(face(h).area, -1.0) };
        flat.extend(list.iter().map(|h| (face(h).centre, out(h))));
        let (v, c) = geometry::cell(&flat);
        let gap = flat.iter().fold([0.0; 3], |s, f| add(s, f.1));
        let size = flat.iter().map(|f| length(f.1)).sum::<f64>();
        if length(gap) > 1e-6 * size {
            return Err(fail("its faces do not close".into()));
        }
        if v.is_nan() || v <= 0.0 {
            return Err(fail(format!("its volume is {v} m3")));
        }
        volume.push(v);
        centre.push(c);
    }
    let mut sides = Vec::with_capacity(halves.len());
    let (mut link_start, mut links) = (Vec::with_capacity(n + 1), Vec::with_capacity(halves.len()));
    link_start.push(0);
    for slot in 0..n {
        let first = links.len();
        for h in &halves[start[slot] as usize..start[slot + 1] as usize] {
            let size = length(face(h).area);
            let normal = scale(face(h).area, 1.0 / size);
            let sign = if outward(h) { 1.0 } else { -1.0 };
            let plane = [normal[0], normal[1], normal[2], dot(normal, face(h).centre)].map(|x| sign * x);
            sides.push(Side::new(plane, h.across, !outward(h), h.number));
            if h.across != NONE && h.across != slot as u32 {
                // both rows must get the same bits: measure from the lower slot; leaving `low` a position is
                // shifted, so the high cell lies at centre - shift as seen from the low one
                let (low, high) = (slot.min(h.across as usize), slot.max(h.across as usize));
                let shift = shifts[h.number as usize];
                let shift = if low == slot { shift } else { scale(shift, -1.0) };
                let d = length(sub(sub(centre[high], centre[low]), shift));
                links.push(Link { to: h.across, weight: size / d });
            }
        }
        links[first..].sort_by_key(|l| l.to);
        link_start.push(links.len() as u32);
    }
    links.shrink_to_fit();
    drop(geometry);
    let of_side = halves.iter().map(|h| h.face).collect();
    drop(halves);
    let faces = loops(pieces, of_side);
    let side_start = start;
    Ok(Mesh {
        ids,
        centre,
        volume,
        slots,
        side_start,
        sides,
        shifts,
        link_start,
        links,
        patch_names,
        bounds,
        faces,
    })
}

/// Unique points and face loops. Only points on faces between ranks are in several pieces.
fn loops(pieces: &[MeshPiece], of_side: Vec<u32>) -> Faces {
    let mut shared: HashMap<[u64; 3], u32> = HashMap::new();
    let mut f = Faces { start: vec![0], of_side, ..Faces::default() };
    for piece in pieces {
        let mut border = vec![false; if pieces.len() > 1 { piece.points.len() } else { 0 }];
        if pieces.len() > 1 {
            for p in piece.patches.iter().filter(|p| p.kind == PatchKind::Processor) {
                let points = (p.start..p.start + p.size).flat_map(|f| piece.face(f));
                points.for_each(|p| border[*p as usize] = true);
            }
        }
        let mut number = Vec::with_capacity(piece.points.len());
        for (i, p) in piece.points.iter().enumerate() {
            let mut new = || {
                f.points.push(*p);
                f.points.len() as u32 - 1
            };
            number.push(if border.get(i) == Some(&true) {
                *shared.entry(p.map(f64::to_bits)).or_insert_with(new)
            } else {
                new()
            });
        }
        for face in 0..piece.faces() {
            f.corners.extend(piece.face(face).iter().map(|p| number[*p as usize]));
            f.start.push(f.corners.len() as u32);
        }
    }
    f
}
