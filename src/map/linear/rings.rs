// SPDX-License-Identifier: MIT OR Apache-2.0
//! The 27 cells around each cell of a block of hexahedra, by distance in the list of cells: nearly all cells of a mesh share a
//! handful of patterns. And what follows from a particle's place between eight centres: cells and weights.

use crate::mesh::NONE;

/// Place of the cell itself among the 27, by (1 + step) in base 3.
pub(super) const OWN: usize = 13;
/// Which of the 27 are the eight around a particle, by octant (bit a: above the centre along axis a) and corner (bit a: the next
/// cell along axis a).
pub(in crate::map) const PLACE: [[usize; 8]; 8] = {
    let mut place = [[0; 8]; 8];
    let mut k = 0;
    while k < 64 {
        let (octant, corner) = (k / 8, k % 8);
        let (mut a, mut unit) = (0, 1);
        while a < 3 {
            let step = if corner >> a & 1 == 0 { 1 } else { 2 * (octant >> a & 1) };
            place[octant][corner] += step * unit;
            (a, unit) = (a + 1, unit * 3);
        }
        k += 1;
    }
    place
};
/// Room for the 27, so that no index below it needs to be checked.
pub(in crate::map) const ROOM: usize = 32;
/// Pattern of a cell outside of all blocks.
const NOT: u32 = NONE;

/// The 27 cells around every cell of a mesh.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Rings {
    /// by cell
    pattern: Vec<u32>,
    /// by pattern: neighbour − cell of the 27; 0 behind a wall, where no weight goes
    ring: Vec<[i32; ROOM]>,
    /// the same by octant and corner
    offsets: Vec<[[i32; 8]; 8]>,
    /// by pattern: those of the 27 that are not around the cell before, if that has the same pattern
    fresh: Vec<u32>,
}

impl Rings {
    /// `ring(cell)`: the 27 cells (`NONE`: behind a wall); none: not in a block.
    pub(super) fn new(cells: usize, mut ring: impl FnMut(usize) -> Option<[u32; 27]>) -> Self {
        let mut known = std::collections::HashMap::new();
        let mut r = Self::default();
        for cell in 0..cells {
            let Some(ring) = ring(cell) else {
                r.pattern.push(NOT);
                continue;
            };
            let away = |to: u32| if to == NONE { 0 } else { (i64::from(to) - cell as i64) as i32 };
            let mut ring27 = [0; ROOM];
            ring27.iter_mut().zip(ring).for_each(|(o, to)| *o = away(to));
            let pattern = *known.entry(ring27).or_insert_with(|| {
                let fresh = |k: &usize| !ring27[..27].contains(&(ring27[*k] + 1));
                r.fresh.push((0..27).filter(fresh).map(|k| 1 << k).sum());
                r.ring.push(ring27);
                r.offsets.push(PLACE.map(|place| place.map(|k| ring27[k])));
                r.offsets.len() as u32 - 1
            });
            r.pattern.push(pattern);
        }
        r
    }
    /// Number of cells.
    #[allow(clippy::len_without_is_empty)]
    pub fn len(&self) -> usize {
        self.pattern.len()
    }
    pub(super) fn hold(&self, cell: usize) -> bool {
        self.pattern[cell] != NOT
    }
    /// The cell of a row, and the row of its first cell: rows are the cells, once per class of particles.
    #[inline(always)]
    fn cell(&self, row: u32) -> usize {
        let row = row as usize;
        if row < self.len() { row } else { row % self.len() }
    }
    /// The 27 around a cell, as distances from it in the list of cells; 0 behind a wall.
    #[inline(always)]
    pub(in crate::map) fn ring(&self, host: u32) -> &[i32; ROOM] {
        &self.ring[self.pattern[self.cell(host)] as usize]
    }
    /// Cells and weights of a particle in cell `host`. Weights behind a wall are 0.
    #[inline(always)]
    pub fn eight(&self, host: u32, fraction: Fraction) -> ([u32; 8], [f64; 8]) {
        let (octant, w) = shares(fraction);
        let offsets = &self.offsets[self.pattern[self.cell(host)] as usize][octant];
        let mut cells = [host; 8];
        for c in 0..8 {
            cells[c] = cells[c].wrapping_add_signed(offsets[c]);
        }
        (cells, w)
    }
    /// All cells around the occupied ones (ascending), with some repeated.
    pub fn around(&self, occupied: &[u32], out: &mut Vec<u32>) {
        out.clear();
        let mut before = (NONE, NONE);
        for host in occupied {
            let pattern = self.pattern[self.cell(*host)];
            let next = before == (host.wrapping_sub(1), pattern);
            let mut which = if next { self.fresh[pattern as usize] } else { (1 << 27) - 1 };
            while which != 0 {
                let k = which.trailing_zeros() as usize;
                out.push(host.wrapping_add_signed(self.ring[pattern as usize][k]));
                which &= which - 1;
            }
            before = (*host, pattern);
        }
    }
    /// Lowest and highest cell around these (ascending).
    pub fn span(&self, occupied: &[u32]) -> (u32, u32) {
        let (mut last, mut span) = (NONE, (NONE, 0));
        let mut own = (0, 0);
        for host in occupied {
            let pattern = self.pattern[self.cell(*host)];
            if pattern != last {
                let o = &self.ring[pattern as usize];
                own = o.iter().fold((0, 0), |(l, h), o| (l.min(*o), h.max(*o)));
                last = pattern;
            }
            span = (span.0.min(host.wrapping_add_signed(own.0)), span.1.max(host.wrapping_add_signed(own.1)));
        }
        span
    }
}

/// Distance of a particle from the centre of its cell along each axis, as a share of the distance to the next centre there (0 at a
/// wall); its sign says which.
pub type Fraction = [f64; 3];

/// Octant and weights of the eight centres around a particle. No closures: what is called in loops over particles is not always
/// put in place.
#[inline(always)]
pub(in crate::map) fn shares([x, y, z]: Fraction) -> (usize, [f64; 8]) {
    let octant = usize::from(x > 0.0) | usize::from(y > 0.0) << 1 | usize::from(z > 0.0) << 2;
    let (x, y, z) = (x.abs(), y.abs(), z.abs());
    let (x0, y0, z0) = (1.0 - x, 1.0 - y, 1.0 - z);
    let xy = [x0 * y0, x * y0, x0 * y, x * y];
    let w = [xy[0] * z0, xy[1] * z0, xy[2] * z0, xy[3] * z0, xy[0] * z, xy[1] * z, xy[2] * z, xy[3] * z];
    (octant, w)
}
