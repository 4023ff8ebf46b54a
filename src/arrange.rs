// SPDX-License-Identifier: MIT OR Apache-2.0
//! Order of the particles: by host cell, within a cell by id; those without host behind, by id.
//!
//! Reads ids and host cells; writes the order into which the table is brought, and where each id lies in it. All
//! sums of the step run in this order, which depends neither on how the DEM is split nor on the order of arrival;
//! and neighbours in space are neighbours in memory. Does not know positions.

use crate::mesh::NONE;
use crate::threads;
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
    /// The new order, as places in the table that `id` and `host` belong to. Sorts by counting, a run of the table and of
    /// the cells on each thread: the table is nearly in order as a rule, and few of a run's particles are in another's cells.
    pub fn update(&mut self, cells: usize, id: &[i64], host: &[u32]) -> &[u32] {
        let (runs, n) = (threads::count(), host.len());
        let first = |k: usize| k * n / runs;
        // where each run's cells end
        let mut ends: Vec<usize> = Vec::with_capacity(runs);
        for k in 1..runs {
            let h = host.get(first(k)).filter(|h| **h != NONE).map_or(0, |h| *h as usize);
            ends.push(h.max(ends.last().copied().unwrap_or(0)));
        }
        ends.push(cells);
        let begin = |k: usize| if k == 0 { 0 } else { ends[k - 1] };
        let mine = |k: usize, h: u32| (begin(k)..ends[k]).contains(&(h as usize));
        self.count.resize(cells, 0);
        let parts = threads::cut(&mut self.count, ends.iter().copied());
        let strays = threads::map(parts.into_iter().enumerate().collect(), |(k, count)| {
            count.fill(0);
            let mut strays = Vec::new();
            for i in first(k)..first(k + 1) {
                match host[i] {
                    h if mine(k, h) => count[h as usize - begin(k)] += 1,
                    _ => strays.push(i as u32),
                }
            }
            strays
        });
        let mut guests = vec![Vec::new(); runs];
        let mut lost = Vec::new();
        for i in strays.concat() {
            match host[i as usize] {
                NONE => lost.push(i),
                h => {
                    self.count[h as usize] += 1;
                    guests[ends.partition_point(|e| *e <= h as usize)].push(i);
                }
            }
        }
        let parts = threads::cut(&mut self.count, ends.iter().copied());
        let starts = threads::map(parts.into_iter().enumerate().collect(), |(k, count)| {
            let (mut at, mut occupied, mut start) = (0, Vec::new(), Vec::new());
            for (cell, n) in (begin(k)..).zip(count).filter(|c| *c.1 > 0) {
                occupied.push(cell as u32);
                start.push(at);
                at += std::mem::replace(n, at);
            }
            (occupied, start, at)
        });
        self.occupied.clear();
        self.start.clear();
        let (mut at, mut places) = (0, Vec::with_capacity(runs));
        for (occupied, start, n) in &starts {
            self.occupied.extend(occupied);
            self.start.extend(start.iter().map(|s| s + at));
            at += n;
            places.push(at as usize);
        }
        self.start.push(at);
        self.inside = at as usize;
        self.list.resize(self.inside, 0);
        let counts = threads::cut(&mut self.count, ends.iter().copied());
        let lists = threads::cut(&mut self.list, places);
        let work = counts.into_iter().zip(lists).zip(&starts).zip(&guests).enumerate().collect();
        threads::map(work, |(k, (((next, list), (_, start, _)), guests))| {
            let own = (first(k)..first(k + 1)).filter(|i| mine(k, host[*i])).map(|i| i as u32);
            for i in own.chain(guests.iter().copied()) {
                let next = &mut next[host[i as usize] as usize - begin(k)];
                list[*next as usize] = i;
                *next += 1;
            }
            let last = list.len() as u32;
            for (from, to) in start.iter().zip(start.iter().skip(1).chain([&last])) {
                let list = &mut list[*from as usize..*to as usize];
                if !list.is_sorted_by_key(|i| id[*i as usize]) {
                    list.sort_unstable_by_key(|i| id[*i as usize]);
                }
            }
        });
        lost.sort_unstable_by_key(|i| id[*i as usize]);
        self.list.append(&mut lost);
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
    fn the_order_does_not_depend_on_threads_or_on_the_table() {
        let mut seed = 9;
        let mut random = |n: u32| (crate::bench::scene::random(&mut seed) * f64::from(n)) as u32;
        let n = 20_000;
        let id: Vec<i64> = (0..n).map(|i| i64::from(i * 7919 % n)).collect();
        // in order but for some; in no order; all in the last cell; all lost
        let near: Vec<u32> = (0..n).map(|i| if random(20) == 0 { random(3000) } else { i / 8 }).collect();
        let any: Vec<u32> = (0..n).map(|_| if random(50) == 0 { NONE } else { random(3000) }).collect();
        for host in [near, any, vec![2999; n as usize], vec![NONE; n as usize], Vec::new()] {
            let mut want: Vec<u32> = (0..host.len() as u32).collect();
            want.sort_by_key(|i| (host[*i as usize], id[*i as usize]));
            for threads in [1, 2, 3, 8] {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                let mut o = Order::default();
                pool.install(|| o.update(3000, &id[..host.len()], &host).to_vec());
                assert!(o.list == want, "{threads}");
                let occupied = o.start.windows(2).zip(&o.occupied);
                occupied.for_each(|(s, c)| {
                    let of = &o.list[s[0] as usize..s[1] as usize];
                    assert!(!of.is_empty() && of.iter().all(|i| host[*i as usize] == *c));
                });
                assert_eq!(*o.start.last().unwrap() as usize, o.inside);
            }
        }
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
