// SPDX-License-Identifier: MIT OR Apache-2.0
//! One sweep over the rows of the operator: out = p x + q A x [+ r other] [+ s out], on eight lanes of every row within
//! reach, as (p + q A_ii) x − q Σ a far: where both factors are positive no rounding makes a value negative. Each row is computed by itself, in the order of its entries: threads, numbering and the way the
//! neighbours are found do not change a bit.
//!
//! Along a line of a hexahedral mesh (`graph::Run`) the neighbours stand at constant distances: no index is read and
//! two of the values stay in registers. All other rows go by their indices.
//!
//! Uses the rayon pool it is called in (one range of rows per thread, one barrier per sweep); outside of a pool
//! it runs on the calling thread.

use super::active::BLOCK;
use super::graph::{LINE, Rows};
use super::real::Real;
use super::{Active, Direction};
use prefetch_index::prefetch_index;
use pulp::{Simd, WithSimd};

/// What one sweep does, and to which rows.
#[derive(Clone, Copy)]
pub(super) struct Sweep<'a, T> {
    pub rows: &'a Rows<T>,
    pub active: &'a Active,
    /// blocks up to this ring are computed
    pub reach: u16,
    /// blocks beyond and up to this ring are set to zero
    pub zero: u16,
    /// x, from row `base` on
    pub now: &'a [[T; 8]],
    /// see `now`
    pub base: usize,
    /// p, q, r, s
    pub factors: [f64; 4],
    /// the rows come from far: asks for them ahead of time
    pub fetch: bool,
}

/// Rows of a line that are asked for ahead: their way from memory takes as long as so many rows.
const AHEAD: usize = 24;

/// out = p x + q A x.
pub(super) const ALONE: u8 = 0;
/// … + r other.
pub(super) const OTHER: u8 = 1;
/// … + s out.
pub(super) const OUT: u8 = 2;
/// … + r other + s out.
pub(super) const BOTH: u8 = 3;

/// A sweep over the rows of one thread.
struct Part<'a, T, const KIND: u8> {
    sweep: &'a Sweep<'a, T>,
    /// row of out[0]
    first: usize,
    other: &'a [[T; 8]],
    out: &'a mut [[T; 8]],
}

impl<T: Real, const KIND: u8> WithSimd for Part<'_, T, KIND> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, v: S) {
        let Self { sweep: s, first, other, out } = self;
        let size = out.len();
        let (mut b, last) = (first / BLOCK, (first + size).div_ceil(BLOCK));
        while b < last {
            // blocks of a kind that follow each other
            let live = s.active.blocks[b] <= s.reach;
            let same = s.active.blocks[b..last].iter().take_while(|r| (**r <= s.reach) == live).count();
            let rows =
                |b: usize, n: usize| (b * BLOCK).saturating_sub(first)..size.min((b + n) * BLOCK - first);
            if live {
                let rows = rows(b, same);
                let (mut begin, end) = (first + rows.start, first + rows.end);
                let mut out = &mut out[rows];
                for run in &s.rows.runs[s.rows.first_run[b] as usize..] {
                    if begin >= end {
                        break;
                    }
                    let n = end.min(run.end as usize).saturating_sub(begin);
                    if n == 0 {
                        continue;
                    }
                    let (mine, rest) = out.split_at_mut(n);
                    out = rest;
                    let other = if KIND & OTHER > 0 { &other[begin..][..n] } else { &[] };
                    let work = Rest::<T, S, KIND> { v, sweep: s, begin, other };
                    match (run.entries, run.west) {
                        (6, 2) => work.line::<6, 2>(mine, &run.offsets),
                        (5, 2) => work.line::<5, 2>(mine, &run.offsets),
                        (5, 1) => work.line::<5, 1>(mine, &run.offsets),
                        (4, 1) => work.line::<4, 1>(mine, &run.offsets),
                        _ => work.any(mine),
                    }
                    begin += n;
                }
            } else {
                for b in (b..b + same).filter(|b| s.active.blocks[*b] <= s.zero) {
                    let rows = rows(b, 1);
                    out[rows].fill([T::ZERO; 8]);
                }
            }
            b += same;
        }
    }
}

/// Rows from `begin` on.
struct Rest<'a, T: Real, S: Simd, const KIND: u8> {
    v: S,
    sweep: &'a Sweep<'a, T>,
    begin: usize,
    other: &'a [[T; 8]],
}

impl<T: Real, S: Simd, const KIND: u8> Rest<'_, T, S, KIND> {
    /// own − q far [+ …].
    #[inline(always)]
    fn result(
        &self,
        k: [T::Of<S>; 4],
        own: T::Of<S>,
        far: T::Of<S>,
        i: usize,
        lane: usize,
        out: &mut T::Of<S>,
    ) {
        let v = self.v;
        let mut y = T::sub(v, own, T::mul(v, k[1], far));
        if KIND & OTHER > 0 {
            y = T::add(v, y, T::mul(v, k[2], T::vectors::<S>(&self.other[i])[lane]));
        }
        if KIND & OUT > 0 {
            y = T::add(v, y, T::mul(v, k[3], *out));
        }
        *out = y;
    }

    /// p, q, r, s.
    #[inline(always)]
    fn factors(&self) -> [T::Of<S>; 4] {
        self.sweep.factors.map(|x| T::splat(self.v, T::from_f64(x)))
    }

    /// (p + q A_ii) x.
    #[inline(always)]
    fn own(&self, k: [T::Of<S>; 4], d: T, x: T::Of<S>) -> T::Of<S> {
        let v = self.v;
        T::mul(v, T::add(v, k[0], T::mul(v, k[1], T::splat(v, d))), x)
    }

    /// Rows of any kind.
    #[inline(always)]
    fn any(self, out: &mut [[T; 8]]) {
        let (s, v, n) = (self.sweep, self.v, out.len());
        let k = self.factors();
        let starts = &s.rows.start[self.begin..=self.begin + n];
        let range = starts[0] as usize..starts[n] as usize;
        let (mut to, mut a) = (&s.rows.to[range.clone()], &s.rows.a[range]);
        let (now, d) = (&s.now[self.begin - s.base..][..n], &s.rows.d[self.begin..][..n]);
        for i in 0..n {
            let entries = (starts[i + 1] - starts[i]) as usize;
            let (to_row, to_rest) = to.split_at(entries);
            let (a_row, a_rest) = a.split_at(entries);
            (to, a) = (to_rest, a_rest);
            for (lane, out) in T::vectors_mut::<S>(&mut out[i]).iter_mut().enumerate() {
                let mut sum = T::splat(v, T::ZERO);
                for (a, to) in a_row.iter().zip(to_row) {
                    let far = T::vectors::<S>(&s.now[*to as usize - s.base])[lane];
                    sum = T::add(v, sum, T::mul(v, T::splat(v, *a), far));
                }
                let x = T::vectors::<S>(&now[i])[lane];
                self.result(k, self.own(k, d[i], x), sum, i, lane, out);
            }
        }
    }

    /// Rows of a line with N neighbours each, the Wth of which is the row before and the next the row after.
    #[inline(always)]
    fn line<const N: usize, const W: usize>(self, out: &mut [[T; 8]], offsets: &[i32; LINE]) {
        let (s, v, n) = (self.sweep, self.v, out.len());
        let k = self.factors();
        let first = s.rows.start[self.begin] as usize;
        let a = &s.rows.a[first..][..N * n].as_chunks::<N>().0[..n];
        let at = self.begin - s.base;
        let far: [&[[T; 8]]; N] =
            std::array::from_fn(|k| &s.now[at.wrapping_add_signed(offsets[k] as isize)..][..n]);
        let (now, d) = (&s.now[at..][..n], &s.rows.d[self.begin..][..n]);
        for lane in 0..T::vectors::<S>(&[T::ZERO; 8]).len() {
            let mut west = T::vectors::<S>(&far[W][0])[lane];
            let mut x = T::vectors::<S>(&now[0])[lane];
            for i in 0..n {
                let east = T::vectors::<S>(&far[W + 1][i])[lane];
                if s.fetch {
                    prefetch_index(far[N - 1], i + AHEAD);
                    prefetch_index(&*out, i + AHEAD);
                    prefetch_index(a, i + AHEAD);
                }
                let mut sum = T::splat(v, T::ZERO);
                for k in 0..N {
                    let far = match k {
                        _ if k == W => west,
                        _ if k == W + 1 => east,
                        _ => T::vectors::<S>(&far[k][i])[lane],
                    };
                    sum = T::add(v, sum, T::mul(v, T::splat(v, a[i][k]), far));
                }
                let own = self.own(k, d[i], x);
                self.result(k, own, sum, i, lane, &mut T::vectors_mut::<S>(&mut out[i])[lane]);
                (west, x) = (x, east);
            }
        }
    }
}

impl<T: Real> Sweep<'_, T> {
    /// Runs it on this thread, on the rows of `out`, which begins with row `first`.
    pub(super) fn part<const KIND: u8>(&self, first: usize, out: &mut [[T; 8]]) {
        T::dispatch(Part::<T, KIND> { sweep: self, first, other: &[], out });
    }

    /// Runs it on every thread of the pool; `cuts`: first block of each thread and the end.
    pub(super) fn run<const KIND: u8>(&self, cuts: &[usize], other: &[[T; 8]], mut out: &mut [[T; 8]]) {
        let part = |first, out| T::dispatch(Part::<T, KIND> { sweep: self, first, other, out });
        if cuts.len() == 2 {
            return part(0, out);
        }
        let part = &part;
        rayon::scope(|scope| {
            for w in cuts.windows(2) {
                let rows = ((w[1] - w[0]) * BLOCK).min(out.len());
                let (mine, rest) = std::mem::take(&mut out).split_at_mut(rows);
                out = rest;
                let first = w[0] * BLOCK;
                scope.spawn(move |_| part(first, mine));
            }
        });
    }
}

/// First block of each thread and the end: equal numbers of active blocks.
pub(super) fn cuts(active: &Active, reach: usize) -> Vec<usize> {
    let threads = crate::threads::count();
    let live = |r: &u16| usize::from(*r) <= reach;
    let all = active.blocks.iter().filter(|r| live(r)).count();
    let (mut cuts, mut seen) = (vec![0], 0);
    for (b, ring) in active.blocks.iter().enumerate() {
        if cuts.len() < threads && seen * threads >= all * cuts.len() && seen > 0 {
            cuts.push(b);
        }
        seen += usize::from(live(ring));
    }
    cuts.push(active.blocks.len());
    cuts
}

/// Furthest ring that the `done`th of m sweeps must visit: a spread has come so far, a gather has m − `done` to go.
pub(super) fn reach(direction: Direction, m: usize, done: usize) -> usize {
    match direction {
        Direction::Spread => done,
        Direction::Gather => m - done,
        Direction::Both => done.max(m - done),
    }
}
