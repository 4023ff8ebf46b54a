// SPDX-License-Identifier: MIT OR Apache-2.0
//! Order of the particles: by host cell, within a cell by id; those without host behind, by id.
//!
//! Reads ids and host cells; writes the order into which the table is brought, and where each id lies in it. All
//! sums of the step run in this order, which depends neither on how the DEM is split nor on the order of arrival;
//! and neighbours in space are neighbours in memory. Does not know positions.

use crate::mesh::NONE;
use std::collections::HashMap;
use std::ops::Range;

/// Particles per piece, at least: what one thread takes at a time.
const PIECE: usize = 2048;

/// A run of whole cells and their particles.
#[derive(Clone, Debug, PartialEq)]
pub struct Piece {
    /// places in the table
    pub particles: Range<usize>,
    /// entries of `Order::occupied`
    pub cells: Range<usize>,
    /// slots of these cells and of empty ones around; all pieces together cover the mesh
    pub slots: Range<usize>,
}

/// Particles by host cell, then id.
#[derive(Clone, Debug, Default)]
pub struct Order {
    /// particles with a host cell: the first of the table
    pub inside: usize,
    /// cells with at least one particle, ascending
    pub occupied: Vec<u32>,
    /// place of the first particle of each occupied cell; one more at the end
    pub start: Vec<u32>,
    /// runs of cells, the same on any number of threads
    pub pieces: Vec<Piece>,
    list: Vec<u32>,
    count: Vec<u32>,
}

impl Order {
    /// The new order, as places in the table that `id` and `host` belong to. Sorts by counting; within a cell the
    /// table is nearly in order as a rule.
    pub fn update(&mut self, cells: usize, id: &[i64], host: &[u32]) -> &[u32] {
        self.count.clear();
        self.count.resize(cells, 0);
        self.inside = 0;
        for h in host.iter().filter(|h| **h != NONE) {
            self.count[*h as usize] += 1;
            self.inside += 1;
        }
        self.occupied.clear();
        self.start.clear();
        let mut begin = 0;
        for (cell, n) in self.count.iter_mut().enumerate().filter(|c| *c.1 > 0) {
            self.occupied.push(cell as u32);
            self.start.push(begin);
            begin += std::mem::replace(n, begin);
        }
        self.start.push(begin);
        self.list.resize(self.inside, 0);
        for (i, h) in host.iter().enumerate().filter(|h| *h.1 != NONE) {
            let next = &mut self.count[*h as usize];
            self.list[*next as usize] = i as u32;
            *next += 1;
        }
        for run in self.start.windows(2) {
            let list = &mut self.list[run[0] as usize..run[1] as usize];
            if !list.is_sorted_by_key(|i| id[*i as usize]) {
                list.sort_unstable_by_key(|i| id[*i as usize]);
            }
        }
        if self.inside < host.len() {
            self.list.extend((0..host.len() as u32).filter(|i| host[*i as usize] == NONE));
            self.list[self.inside..].sort_unstable_by_key(|i| id[*i as usize]);
        }
        self.cut(cells);
        &self.list
    }

    fn cut(&mut self, cells: usize) {
        self.pieces.clear();
        let (mut first, mut slot) = (0, 0);
        for k in 1..=self.occupied.len() {
            let particles = self.start[first] as usize..self.start[k] as usize;
            let last = k == self.occupied.len();
            if particles.len() >= PIECE || last {
                let end = if last { cells } else { self.occupied[k] as usize };
                self.pieces.push(Piece { particles, cells: first..k, slots: slot..end });
                (first, slot) = (k, end);
            }
        }
    }
}

/// Where each id lies: a table where ids are dense, a map where they are not.
#[derive(Clone, Debug, Default)]
pub struct Places {
    low: i64,
    dense: Vec<u32>,
    sparse: HashMap<i64, u32>,
    len: usize,
}

impl Places {
    /// From ids in their order; ids must be unique.
    pub fn update(&mut self, ids: &[i64]) {
        self.len = ids.len();
        self.sparse.clear();
        let (low, high) = ids.iter().fold((i64::MAX, i64::MIN), |(l, h), i| (l.min(*i), h.max(*i)));
        let span = i128::from(high) - i128::from(low) + 1;
        self.low = low;
        self.dense.clear();
        if span <= 4 * ids.len() as i128 + 1000 {
            self.dense.resize(span.max(0) as usize, NONE);
            ids.iter().enumerate().for_each(|(k, i)| self.dense[(i - low) as usize] = k as u32);
        } else {
            self.sparse.extend(ids.iter().enumerate().map(|(k, i)| (*i, k as u32)));
        }
    }
    /// Number of places.
    pub fn len(&self) -> usize {
        self.len
    }
    /// None at all.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }
    /// Place of an id, or `NONE`.
    #[inline]
    pub fn of(&self, id: i64) -> u32 {
        if !self.sparse.is_empty() {
            return self.sparse.get(&id).copied().unwrap_or(NONE);
        }
        let k = usize::try_from(id.wrapping_sub(self.low)).unwrap_or(usize::MAX);
        self.dense.get(k).copied().unwrap_or(NONE)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn by_cell_then_id_without_the_lost() {
        let mut o = Order::default();
        assert_eq!(o.update(6, &[9, 3, 7, 1, 5, 6], &[4, 2, NONE, 4, 4, NONE]), [1, 3, 4, 0, 5, 2]);
        assert_eq!((o.inside, &*o.occupied, &*o.start), (4, &[2, 4][..], &[0, 1, 4][..]));
        assert_eq!(o.pieces, [Piece { particles: 0..4, cells: 0..2, slots: 0..6 }]);
        assert_eq!(o.update(6, &[1], &[0]), [0]);
        assert_eq!((&*o.occupied, &*o.start), (&[0][..], &[0, 1][..]));
        assert_eq!(o.update(6, &[], &[]).len(), 0);
        assert_eq!((&*o.start, o.pieces.len()), (&[0][..], 0));
    }

    #[test]
    fn pieces_cover_particles_and_cells() {
        let mut o = Order::default();
        let host: Vec<u32> = (0..3 * PIECE as u32).map(|i| 2 + i / 5).collect();
        let id: Vec<i64> = (0..host.len() as i64).collect();
        o.update(10_000, &id, &host);
        assert_eq!(o.pieces.len(), 3);
        for w in o.pieces.windows(2) {
            assert!(w[0].particles.end == w[1].particles.start && w[0].slots.end == w[1].slots.start);
            assert_eq!(w[1].slots.start, o.occupied[w[1].cells.start] as usize);
        }
        assert_eq!((o.pieces[0].slots.start, o.pieces[2].slots.end), (0, 10_000));
        assert_eq!(o.pieces[2].particles.end, host.len());
    }

    #[test]
    fn places_of_dense_and_scattered_ids() {
        let mut p = Places::default();
        assert_eq!(p.of(0), NONE);
        for ids in [vec![7, 5, 6], vec![i64::MAX, i64::MIN, 0, 1 << 40]] {
            p.update(&ids);
            ids.iter().enumerate().for_each(|(k, i)| assert_eq!(p.of(*i), k as u32));
            assert_eq!((p.of(99), p.of(-99), p.len()), (NONE, NONE, ids.len()));
        }
    }
}
