// SPDX-License-Identifier: MIT OR Apache-2.0
//! Joins the pieces: global slots, faces across ranks and cyclics, sides and Laplacian rows.

use super::geometry::{self, Face, V, add, dot, length, scale, sub};
use super::{Faces, Link, Mesh, MeshError, MeshPiece, NONE, Patch, PatchKind, Side};
use std::collections::HashMap;

/// A face of one cell before sorting.
struct Half {
    face: Face,
    /// slot across or `NONE`
    across: u32,
    patch: u32,
    shift: V,
    /// the canonical area vector points out of this cell
    outward: bool,
    /// corners, m
    points: Vec<V>,
}

/// Joins the pieces of all CFD ranks (rank order) to the whole mesh.
pub fn assemble(pieces: &[MeshPiece]) -> Result<Mesh, MeshError> {
    let (ids, slots) = number_cells(pieces)?;
    let n = ids.len();
    let mut halves: Vec<Vec<Half>> = (0..n).map(|_| Vec::new()).collect();
    let mut patch_names: Vec<String> = Vec::new();
    for (rank, piece) in pieces.iter().enumerate() {
        let corner =
            |f: usize| -> Vec<V> { piece.face(f).iter().map(|p| piece.points[*p as usize]).collect() };
        let mut put =
            |cell: u32, face: Face, owner: bool, across: u32, patch: u32, shift: V, points: Vec<V>| {
                let slot = slots[rank][cell as usize] as usize;
                let outward = owner != face.reversed;
                halves[slot].push(Half { face, across, patch, shift, outward, points });
            };
        for f in 0..piece.neighbour.len() {
            let (points, owner, neighbour) = (corner(f), piece.owner[f], piece.neighbour[f]);
            let face = geometry::face(&points);
            let slot = |c: u32| slots[rank][c as usize];
            put(owner, face, true, slot(neighbour), NONE, [0.0; 3], points.clone());
            put(neighbour, face, false, slot(owner), NONE, [0.0; 3], points);
        }
        for (index, patch) in piece.patches.iter().enumerate() {
            let boundary = matches!(patch.kind, PatchKind::Boundary | PatchKind::Empty);
            let number =
                if boundary && patch.size > 0 { name_of(&mut patch_names, &patch.name) } else { NONE };
            let other = if boundary { None } else { Some(across(pieces, rank, index)?) };
            for i in 0..patch.size {
                let f = patch.start + i;
                let (to, shift) = match &other {
                    None => (NONE, [0.0; 3]),
                    Some((r, start)) => (slots[*r][pieces[*r].owner[start + i] as usize], patch.separation),
                };
                let points = corner(f);
                put(piece.owner[f], geometry::face(&points), true, to, number, shift, points);
            }
        }
    }
    sort_patches(&mut patch_names, &mut halves);
    let bounds = bounds(pieces);
    build(ids, slots, halves, patch_names, bounds)
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

fn name_of(names: &mut Vec<String>, name: &str) -> u32 {
    let known = names.iter().position(|n| n == name);
    known.unwrap_or_else(|| {
        names.push(name.into());
        names.len() - 1
    }) as u32
}

/// Patch numbers must not depend on the order in which pieces name them.
fn sort_patches(names: &mut [String], halves: &mut [Vec<Half>]) {
    let mut order: Vec<usize> = (0..names.len()).collect();
    order.sort_by(|a, b| names[*a].cmp(&names[*b]));
    let mut rank = vec![0; names.len()];
    order.iter().enumerate().for_each(|(new, old)| rank[*old] = new as u32);
    names.sort();
    for h in halves.iter_mut().flatten().filter(|h| h.patch != NONE) {
        h.patch = rank[h.patch as usize];
    }
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
    ids: Vec<i64>,
    slots: Vec<Vec<u32>>,
    mut halves: Vec<Vec<Half>>,
    patch_names: Vec<String>,
    bounds: [V; 2],
) -> Result<Mesh, MeshError> {
    let n = ids.len();
    let (mut centre, mut volume) = (Vec::with_capacity(n), Vec::with_capacity(n));
    for (slot, list) in halves.iter_mut().enumerate() {
        let fail = |what: String| MeshError::Cell { cell: ids[slot], what };
        if list.len() < 4 {
            return Err(fail(format!("it has {} faces", list.len())));
        }
        list.sort_by(|a, b| {
            let key = |h: &Half| (h.across, h.patch);
            let by_centre = || a.face.centre.partial_cmp(&b.face.centre).unwrap_or(std::cmp::Ordering::Equal);
            key(a).cmp(&key(b)).then_with(by_centre)
        });
        let outward =
            |h: &Half| (h.face.centre, if h.outward { h.face.area } else { scale(h.face.area, -1.0) });
        let faces: Vec<(V, V)> = list.iter().map(outward).collect();
        let (v, c) = geometry::cell(&faces);
        let gap = faces.iter().fold([0.0; 3], |s, f| add(s, f.1));
        let size = faces.iter().map(|f| length(f.1)).sum::<f64>();
        if length(gap) > 1e-6 * size {
            return Err(fail("its faces do not close".into()));
        }
        if v.is_nan() || v <= 0.0 {
            return Err(fail(format!("its volume is {v} m3")));
        }
        volume.push(v);
        centre.push(c);
    }
    let (mut side_start, mut sides) = (vec![0], Vec::new());
    let (mut link_start, mut links) = (vec![0], Vec::new());
    for (slot, list) in halves.iter().enumerate() {
        let mut row: Vec<Link> = Vec::new();
        for h in list {
            let size = length(h.face.area);
            let normal = scale(h.face.area, 1.0 / size);
            let sign = if h.outward { 1.0 } else { -1.0 };
            let offset = dot(normal, h.face.centre);
            sides.push(Side { normal, offset, sign, across: h.across, patch: h.patch, shift: h.shift });
            if h.across != NONE && h.across != slot as u32 {
                // both rows must get the same bits: measure from the lower slot; leaving `low` a position is
                // shifted, so the high cell lies at centre - shift as seen from the low one
                let (low, high) = (slot.min(h.across as usize), slot.max(h.across as usize));
                let shift = if low == slot { h.shift } else { scale(h.shift, -1.0) };
                let d = length(sub(sub(centre[high], centre[low]), shift));
                let weight = size / d;
                row.push(Link { to: h.across, weight });
            }
        }
        row.sort_by_key(|l| l.to);
        links.extend(row);
        side_start.push(sides.len() as u32);
        link_start.push(links.len() as u32);
    }
    // in the order of `sides`
    let faces = unique(halves.into_iter().map(|list| list.into_iter().map(|h| h.points).collect()).collect());
    Ok(Mesh { ids, centre, volume, slots, side_start, sides, link_start, links, patch_names, bounds, faces })
}

/// Unique points and face lists by cell, for output.
fn unique(loops: Vec<Vec<Vec<V>>>) -> Faces {
    let (mut points, mut number) = (Vec::new(), HashMap::new());
    let mut of_cell = Vec::with_capacity(loops.len());
    for cell in loops {
        let mut faces = Vec::with_capacity(cell.len());
        for corner in cell {
            let face = corner.into_iter().map(|p| {
                *number.entry(p.map(f64::to_bits)).or_insert_with(|| {
                    points.push(p);
                    points.len() as u32 - 1
                })
            });
            faces.push(face.collect());
        }
        of_cell.push(faces);
    }
    Faces { points, of_cell }
}
