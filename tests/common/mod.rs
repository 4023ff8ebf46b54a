// SPDX-License-Identifier: MIT OR Apache-2.0
//! Meshes and messages made for tests: a box of hexahedra in one piece or cut in two, walls or cyclic in x.
#![allow(dead_code)]

pub mod folder;
pub mod partners;
pub mod step;

use voidage::mesh::{MeshPiece, Patch, PatchKind};
use voidage_wire::{Block, field, frame, kind};

/// A box of n cells and the size in m; points pushed about by `jiggle` of a cell (walls stay plane).
pub struct Hex {
    pub n: [usize; 3],
    pub size: [f64; 3],
    pub jiggle: f64,
    pub cyclic_x: bool,
}

type Corner = [usize; 3];

impl Hex {
    fn point(&self, c: Corner) -> [f64; 3] {
        let mut p = [0, 1, 2].map(|a| self.size[a] * c[a] as f64 / self.n[a] as f64);
        for a in 0..3 {
            let inner = (0..3).all(|b| c[b] > 0 && c[b] < self.n[b]);
            if inner {
                let hash = ((c[0] * 73 + c[1] * 179 + c[2] * 283 + a * 37) % 101) as f64 / 100.0 - 0.5;
                p[a] += self.jiggle * hash * self.size[a] / self.n[a] as f64;
            }
        }
        p
    }
    fn id(&self, c: Corner) -> usize {
        (c[2] * self.n[1] + c[1]) * self.n[0] + c[0]
    }
    /// Corners of the face of cell c towards +axis (high) or −axis, seen from outside.
    fn face(&self, c: Corner, axis: usize, high: bool) -> Vec<Corner> {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        let mut loop_ = Vec::new();
        for (du, dv) in [(0, 0), (1, 0), (1, 1), (0, 1)] {
            let mut p = c;
            p[axis] += usize::from(high);
            p[u] += du;
            p[v] += dv;
            loop_.push(p);
        }
        if !high {
            loop_.reverse();
        }
        loop_
    }

    /// The mesh in pieces; `rank_of` gives each cell's rank.
    pub fn pieces(&self, ranks: usize, rank_of: impl Fn(Corner) -> usize) -> Vec<MeshPiece> {
        let all = || {
            (0..self.n[2])
                .flat_map(move |k| (0..self.n[1]).flat_map(move |j| (0..self.n[0]).map(move |i| [i, j, k])))
        };
        let mut pieces = Vec::new();
        for rank in 0..ranks {
            let own: Vec<Corner> = all().filter(|c| rank_of(*c) == rank).collect();
            let local = |c: Corner| own.iter().position(|o| *o == c).unwrap() as u32;
            let mut piece = MeshPiece { rank, face_starts: vec![0], ..MeshPiece::default() };
            piece.cell_ids = own.iter().map(|c| self.id(*c) as i64).collect();
            let mut number = std::collections::HashMap::new();
            let mut put = |piece: &mut MeshPiece, corners: Vec<Corner>, owner: u32| {
                for c in corners {
                    let next = number.len() as u32;
                    let i = *number.entry(c).or_insert(next);
                    if i == next {
                        piece.points.push(self.point(c));
                    }
                    piece.face_points.push(i);
                }
                piece.face_starts.push(piece.face_points.len() as u32);
                piece.owner.push(owner);
            };
            let ahead = |c: Corner, axis: usize| {
                let mut d = c;
                d[axis] += 1;
                (d[axis] < self.n[axis]).then_some(d)
            };
            for c in &own {
                for axis in 0..3 {
                    if let Some(d) = ahead(*c, axis).filter(|d| rank_of(*d) == rank) {
                        put(&mut piece, self.face(*c, axis, true), local(*c));
                        piece.neighbour.push(local(d));
                    }
                }
            }
            let mut patch = |piece: &mut MeshPiece,
                             name: &str,
                             kind,
                             a: usize,
                             b: usize,
                             s: f64,
                             list: Vec<(Corner, usize, bool)>| {
                let start = piece.owner.len();
                for (c, axis, high) in &list {
                    put(piece, self.face(*c, *axis, *high), local(*c));
                }
                let (name, size) = (name.to_string(), list.len());
                let separation = [s, 0.0, 0.0];
                piece.patches.push(Patch {
                    kind,
                    name,
                    start,
                    size,
                    neighbour_rank: a,
                    neighbour_patch: b,
                    separation,
                });
            };
            let wall = |axis: usize, high: bool| -> Vec<(Corner, usize, bool)> {
                let at = if high { self.n[axis] - 1 } else { 0 };
                own.iter().filter(|c| c[axis] == at).map(|c| (*c, axis, high)).collect()
            };
            let other_end = |c: Corner| [self.n[0] - 1 - c[0], c[1], c[2]];
            let length = self.size[0];
            if self.cyclic_x {
                for (high, b, s) in [(false, 1, length), (true, 0, -length)] {
                    let list =
                        wall(0, high).into_iter().filter(|f| rank_of(other_end(f.0)) == rank).collect();
                    patch(&mut piece, ["left", "right"][usize::from(high)], PatchKind::Cyclic, 0, b, s, list);
                }
            } else {
                patch(&mut piece, "left", PatchKind::Boundary, 0, 0, 0.0, wall(0, false));
                patch(&mut piece, "right", PatchKind::Boundary, 0, 0, 0.0, wall(0, true));
            }
            for (axis, name) in [(1, "y"), (2, "z")] {
                let list = [wall(axis, false), wall(axis, true)].concat();
                patch(&mut piece, name, PatchKind::Boundary, 0, 0, 0.0, list);
            }
            for other in (0..ranks).filter(|r| *r != rank) {
                // both ranks list the faces between them in the order of the lower cell's id
                let mut list = Vec::new();
                for c in all() {
                    for axis in 0..3 {
                        if let Some(d) = ahead(c, axis) {
                            match (rank_of(c), rank_of(d)) {
                                (a, b) if a == rank && b == other => list.push((c, axis, true)),
                                (a, b) if a == other && b == rank => list.push((d, axis, false)),
                                _ => {}
                            }
                        }
                    }
                }
                patch(&mut piece, &format!("to{other}"), PatchKind::Processor, other, 0, 0.0, list);
                if self.cyclic_x {
                    for (high, refer, s) in [(false, 0, length), (true, 1, -length)] {
                        let crosses = |f: &(Corner, usize, bool)| rank_of(other_end(f.0)) == other;
                        let list: Vec<_> = wall(0, high).into_iter().filter(crosses).collect();
                        if !list.is_empty() {
                            patch(&mut piece, "through", PatchKind::ProcessorCyclic, other, refer, s, list);
                        }
                    }
                }
            }
            pieces.push(piece);
        }
        pieces
    }
    /// In one piece.
    pub fn whole(&self) -> Vec<MeshPiece> {
        self.pieces(1, |_| 0)
    }
}

/// A small deterministic random number in [0, 1).
pub fn random(seed: &mut u64) -> f64 {
    *seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    (*seed >> 11) as f64 / (1u64 << 53) as f64
}

/// A particle of a message.
#[derive(Clone, Copy)]
pub struct P {
    pub id: i64,
    pub x: [f64; 3],
    pub v: [f64; 3],
    pub r: f64,
    pub ledger: [f64; 3],
}

/// n particles in a box.
pub fn cloud(n: usize, size: [f64; 3], r: f64) -> Vec<P> {
    let mut s = 7;
    let mut three = |scale: [f64; 3], shift: f64| [0, 1, 2].map(|a| scale[a] * (random(&mut s) - shift));
    (0..n)
        .map(|i| {
            let x = three(size, 0.0);
            P { id: 3 * i as i64 + 5, x, v: three([1.0; 3], 0.5), r, ledger: three([1e-9; 3], 0.5) }
        })
        .collect()
}

/// A PARTICLES frame; density 1000 kg/m3.
pub fn message(list: &[P]) -> Vec<u64> {
    message_with(list, &[])
}

/// The same with what the coupler gave the particles to keep, if there is any.
pub fn message_with(list: &[P], memory: &[f64]) -> Vec<u64> {
    let n = list.len();
    let mut blocks = vec![Block::i64s(field::ID, n), Block::f64s(field::TOTALS, 9)];
    let vectors = [field::POSITION, field::VELOCITY, field::LEDGER, field::IMPULSE];
    blocks.extend(vectors.map(|f| Block::f64s(f, 3 * n)));
    let last = [field::LAST_DRIVE_VELOCITY, field::LAST_FORCE, field::LAST_VELOCITY];
    blocks.extend(last.map(|f| Block::f64s(f, 3 * n)));
    blocks.push(Block::f64s(field::LAST_DRAG_COEFFICIENT, n));
    blocks.extend([field::RADIUS, field::MASS].map(|f| Block::f64s(f, n)));
    if !memory.is_empty() {
        blocks.push(Block::f64s(field::LAST_MEMORY, memory.len()));
    }
    let mut words = vec![0; frame::words(&blocks)];
    frame::start(&mut words, kind::PARTICLES, 0, 0.0, &blocks);
    if let Some(to) = frame::f64s_mut(&mut words, field::LAST_MEMORY) {
        to.copy_from_slice(memory);
    }
    for (i, p) in list.iter().enumerate() {
        frame::array_mut(&mut words, field::ID).unwrap()[i] = p.id as u64;
        for (f, value) in [(field::POSITION, p.x), (field::VELOCITY, p.v), (field::LEDGER, p.ledger)] {
            frame::f64s_mut(&mut words, f).unwrap()[3 * i..][..3].copy_from_slice(&value);
        }
        // a last interval in which it was driven by the velocity it has now
        for (f, value) in [(field::LAST_DRIVE_VELOCITY, p.v), (field::IMPULSE, p.ledger)] {
            frame::f64s_mut(&mut words, f).unwrap()[3 * i..][..3].copy_from_slice(&value);
        }
        frame::f64s_mut(&mut words, field::LAST_DRAG_COEFFICIENT).unwrap()[i] = 1e-6;
        frame::f64s_mut(&mut words, field::RADIUS).unwrap()[i] = p.r;
        frame::f64s_mut(&mut words, field::MASS).unwrap()[i] =
            1000.0 * 4.0 / 3.0 * std::f64::consts::PI * p.r.powi(3);
    }
    words
}
