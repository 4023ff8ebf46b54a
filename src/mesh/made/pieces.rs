// SPDX-License-Identifier: MIT OR Apache-2.0
//! Cuts a made mesh into the pieces CFD ranks would send: internal faces, walls, cyclic patches, processor patches
//! (faces in one order on both ranks) and their cyclic kind.

use super::super::{MeshPiece, Patch, PatchKind};
use super::{Across, Soup};
use std::collections::HashMap;

const WALLS: [&str; 6] = ["x-low", "x-high", "y-low", "y-high", "z-low", "z-high"];

/// Where a face of a rank goes: internal, wall, cyclic, processor, processor-cyclic, in patch order.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Place {
    Wall(u8),
    Cyclic([i8; 3]),
    Processor(usize),
    ProcessorCyclic(usize, [i8; 3]),
}

pub(super) fn cut(soup: &Soup, ranks: usize, rank: &[usize]) -> Vec<MeshPiece> {
    let mut local = vec![0u32; rank.len()];
    let mut pieces: Vec<MeshPiece> =
        (0..ranks).map(|rank| MeshPiece { rank, face_starts: vec![0], ..MeshPiece::default() }).collect();
    for (cell, r) in rank.iter().enumerate() {
        local[cell] = pieces[*r].cell_ids.len() as u32;
        pieces[*r].cell_ids.push(cell as i64);
    }
    let offsets = offsets(soup);
    let mut number: Vec<HashMap<u32, u32>> = vec![HashMap::new(); ranks];
    let mut put = |piece: &mut MeshPiece, owner: usize, face: &[u32], turned: bool| {
        for i in 0..face.len() {
            let p = face[if turned { face.len() - 1 - i } else { i }];
            let next = piece.points.len() as u32;
            let at = *number[piece.rank].entry(p).or_insert(next);
            if at == next {
                piece.points.push(soup.points[p as usize]);
            }
            piece.face_points.push(at);
        }
        piece.face_starts.push(piece.face_points.len() as u32);
        piece.owner.push(local[owner]);
    };
    // (face, owner, turned) by rank and place
    let mut rest: Vec<Vec<(Place, usize, usize, bool)>> = vec![Vec::new(); ranks];
    for f in 0..soup.owner.len() {
        let owner = soup.owner[f] as usize;
        let mine = rank[owner];
        match soup.across[f] {
            Across::Cell(other) if rank[other as usize] == mine => {
                put(&mut pieces[mine], owner, soup.face(f), false);
                pieces[mine].neighbour.push(local[other as usize]);
            }
            Across::Cell(other) => {
                let theirs = rank[other as usize];
                rest[mine].push((Place::Processor(theirs), f, owner, false));
                rest[theirs].push((Place::Processor(mine), f, other as usize, true));
            }
            Across::Wall(w) => rest[mine].push((Place::Wall(w), f, owner, false)),
            Across::Cyclic(other, offset) if rank[other as usize] == mine => {
                rest[mine].push((Place::Cyclic(offset), f, owner, false));
            }
            Across::Cyclic(other, offset) => {
                rest[mine].push((Place::ProcessorCyclic(rank[other as usize], offset), f, owner, false));
            }
        }
    }
    for (piece, list) in pieces.iter_mut().zip(&mut rest) {
        // halves of a cyclic pair were put in the same order, so the stable sort keeps them facing each other
        list.sort_by_key(|e| e.0);
        let mut places: Vec<Place> = (0..6).map(Place::Wall).collect();
        places.extend(offsets.iter().map(|o| Place::Cyclic(*o)));
        places.extend(list.iter().map(|e| e.0).filter(|p| *p >= Place::Processor(0)));
        places.sort();
        places.dedup();
        let refer = |o: [i8; 3]| 6 + offsets.iter().position(|x| *x == o).unwrap_or(0);
        for place in places {
            let start = piece.owner.len();
            for (_, f, owner, turned) in list.iter().filter(|e| e.0 == place) {
                put(piece, *owner, soup.face(*f), *turned);
            }
            let size = piece.owner.len() - start;
            let shift =
                |o: [i8; 3]| [0, 1, 2].map(|a| if o[a] == 0 { 0.0 } else { -f64::from(o[a]) * soup.size[a] });
            let (kind, name, neighbour_rank, neighbour_patch, separation) = match place {
                Place::Wall(w) => (PatchKind::Boundary, WALLS[w as usize].to_string(), 0, 0, [0.0; 3]),
                Place::Cyclic(o) => (PatchKind::Cyclic, name(o), 0, refer(o.map(|x| -x)), shift(o)),
                Place::Processor(r) => (PatchKind::Processor, format!("to{r}"), r, 0, [0.0; 3]),
                Place::ProcessorCyclic(r, o) => {
                    (PatchKind::ProcessorCyclic, format!("to{r}through{}", name(o)), r, refer(o), shift(o))
                }
            };
            piece.patches.push(Patch {
                kind,
                name,
                start,
                size,
                neighbour_rank,
                neighbour_patch,
                separation,
            });
        }
    }
    pieces
}

fn name(o: [i8; 3]) -> String {
    format!("cyclic{:+}{:+}{:+}", o[0], o[1], o[2])
}

/// All offsets of cyclic faces, sorted.
fn offsets(soup: &Soup) -> Vec<[i8; 3]> {
    let mut list: Vec<[i8; 3]> = Vec::new();
    for a in &soup.across {
        if let Across::Cyclic(_, o) = a
            && !list.contains(o)
        {
            list.push(*o);
        }
    }
    list.sort_unstable();
    list
}
