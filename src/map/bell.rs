// SPDX-License-Identifier: MIT OR Apache-2.0
//! The bell of one particle and its weights of largest entropy, eight cells at a time in vectors of the machine at hand.
//!
//! `Table`: the cells around a host, one array per quantity, ready for its particles. `Bell`: those in the bell of one of
//! them, and their weights. Every operation rounds by itself and sums run by lane: the bits are the same on every machine. Lengths m,
//! in the bell local sizes.

use super::exp::exp;
use crate::mesh::geometry::{V, dot, length, scale, solve, sub};
use crate::smooth::Real;
use pulp::{Simd, WithSimd};

/// Where the bell ends, of its top.
const CUT: f64 = 1e-4;
/// (r / (c h))² there: −ln CUT.
pub(super) const END: f64 = 9.210_340_371_976_184;
/// Rest of the first moment, in h.
const EXACT: f64 = 1e-11;
/// Of λ: beyond it there is no solution.
const STEEPEST: f64 = 300.0;
/// Of λ · d up to which no exponent is taken out of the sum.
const FLAT: f64 = 300.0;
/// Of a step of λ below which Newton's method needs no help.
const SMALL: f64 = 1e-3;
/// Place of what only fills up a vector: outside of every bell.
const NOWHERE: f64 = 1e100;

/// Cells around a host; filled up to a multiple of eight.
#[derive(Debug, Default)]
pub(super) struct Table {
    /// whose; none at first
    pub host: Option<u32>,
    cell: Vec<u32>,
    at: [Vec<f64>; 3],
    size: Vec<f64>,
    /// 1 / (END (c size)²): of each cell's own bell
    narrow: Vec<f64>,
    volume: Vec<f64>,
}

impl Table {
    /// The cells seen from a host: number, centre and size; c = `width`.
    pub fn set(&mut self, width: f64, host: u32, seen: impl ExactSizeIterator<Item = (u32, [f64; 4])>) {
        let (used, n) = (seen.len(), seen.len().next_multiple_of(8));
        self.host = Some(host);
        self.cell.resize(n, 0);
        let Self { cell, at: [x, y, z], size, narrow, volume, .. } = self;
        [&mut *x, y, z, size, narrow, volume].into_iter().for_each(|l| l.resize(n, 0.0));
        let (cell, x, y, z) = (&mut cell[..n], &mut x[..n], &mut y[..n], &mut z[..n]);
        let (size, narrow, volume) = (&mut size[..n], &mut narrow[..n], &mut volume[..n]);
        for (i, (c, at)) in seen.enumerate().take(n) {
            (cell[i], [x[i], y[i], z[i], size[i]]) = (c, at);
        }
        for i in used..n {
            (cell[i], [x[i], y[i], z[i], size[i]]) = (0, [NOWHERE, NOWHERE, NOWHERE, 1.0]);
        }
        for i in 0..n {
            let square = size[i] * size[i];
            (narrow[i], volume[i]) = (1.0 / (END * width * width * square), square * size[i]);
        }
    }
}

/// Cells in the bell of one particle.
#[derive(Debug, Default)]
pub(super) struct Bell {
    /// by number, images of one following each other
    pub cell: Vec<u32>,
    /// ways to them in local sizes, filled up with zeros to a multiple of eight
    way: [Vec<f64>; 3],
    prior: Vec<f64>,
    /// times `share`: what goes to each of `cell`
    pub weight: Vec<f64>,
    pub share: f64,
    /// by cell of the table: distances squared, own bells
    far: Vec<f64>,
    own: Vec<f64>,
    /// numbers in the table
    chosen: Vec<u32>,
}

/// Σ of weights, and of the moments of the ways.
#[derive(Clone, Copy, Default)]
struct Moments {
    sum: f64,
    /// exponent taken out of the sum
    top: f64,
    first: V,
    /// xx, yy, zz, xy, yz, zx
    second: [f64; 6],
}

/// Sums by lane.
#[repr(align(64))]
struct Sums<const N: usize>([[f64; 8]; N]);
impl<const N: usize> Sums<N> {
    #[inline(always)]
    fn all(&self) -> [f64; N] {
        self.0.map(|l| ((l[0] + l[4]) + (l[2] + l[6])) + ((l[1] + l[5]) + (l[3] + l[7])))
    }
}

/// Eights of a list.
#[inline(always)]
fn eights(list: &[f64]) -> &[[f64; 8]] {
    list.as_chunks().0
}

/// Solves for one particle at x: (local size in m, first moment missed in it).
pub(super) struct Solve<'a> {
    pub table: &'a Table,
    pub bell: &'a mut Bell,
    pub x: V,
    /// c
    pub width: f64,
    /// local size where no cell's own bell reaches, m
    pub size: f64,
}

impl WithSimd for Solve<'_> {
    type Output = (f64, f64);
    #[inline(always)]
    fn with_simd<S: Simd>(self, s: S) -> (f64, f64) {
        let Self { table, bell, x, width, size } = self;
        let h = bell.local_size(s, table, x).unwrap_or(size);
        bell.choose(table, x, h, width);
        let missed = if bell.cell.is_empty() { f64::INFINITY } else { bell.solve(s, width * END.sqrt()) };
        (h, missed)
    }
}

impl Bell {
    /// Mean of the cells' sizes, by a bell of each cell's own size, (1 − q/END)⁸ instead of exp(−q).
    #[inline(always)]
    fn local_size<S: Simd>(&mut self, s: S, table: &Table, x: V) -> Option<f64> {
        let n = table.cell.len();
        self.far.resize(n, 0.0);
        self.own.resize(n, 0.0);
        let [px, py, pz] = table.at.each_ref().map(|p| &p[..n]);
        let (far, own, narrow) = (&mut self.far[..n], &mut self.own[..n], &table.narrow[..n]);
        for i in 0..n {
            let d = [px[i] - x[0], py[i] - x[1], pz[i] - x[2]];
            far[i] = dot(d, d);
            let rest = 1.0 - far[i] * narrow[i];
            let rest = if rest > 0.0 { rest } else { 0.0 };
            let four = (rest * rest) * (rest * rest);
            own[i] = four * four;
        }
        let mut sums = Sums([[0.0; 8]; 2]);
        for (own, size) in eights(own).iter().zip(eights(&table.size[..n])) {
            let (own, size) = (f64::vectors::<S>(own), f64::vectors::<S>(size));
            for v in 0..own.len() {
                let [all, sum] = &mut sums.0;
                let (all, sum) = (&mut f64::vectors_mut::<S>(all)[v], &mut f64::vectors_mut::<S>(sum)[v]);
                *all = s.add_f64s(*all, own[v]);
                *sum = s.add_f64s(*sum, s.mul_f64s(own[v], size[v]));
            }
        }
        let [all, sum] = sums.all();
        (all > 0.0).then(|| sum / all)
    }

    /// The cells in the bell, with its values times their volumes.
    #[inline(always)]
    fn choose(&mut self, table: &Table, x: V, h: f64, width: f64) {
        let (m, narrow, per) = (table.cell.len(), -1.0 / (width * width * h * h), 1.0 / h);
        self.chosen.resize(m, 0);
        let (far, chosen) = (&self.far[..m], &mut self.chosen[..m]);
        let mut n = 0;
        for i in 0..m {
            // written in any case, kept if it is in
            chosen[n] = i as u32;
            n += usize::from(narrow * far[i] > -END);
        }
        let full = n.next_multiple_of(8);
        self.cell.resize(n, 0);
        let lists = [&mut self.prior, &mut self.weight];
        lists.into_iter().chain(&mut self.way).for_each(|l| l.resize(full, 0.0));
        let [dx, dy, dz] = self.way.each_mut().map(|d| &mut d[..full]);
        let (prior, weight, cell) = (&mut self.prior[..full], &mut self.weight[..full], &mut self.cell[..n]);
        let [px, py, pz] = table.at.each_ref().map(|p| &p[..m]);
        let (from, volume) = (&table.cell[..m], &table.volume[..m]);
        for k in 0..n {
            let i = (chosen[k] as usize).min(m - 1);
            (cell[k], prior[k], weight[k]) = (from[i], volume[i], narrow * far[i]);
            (dx[k], dy[k], dz[k]) = ((px[i] - x[0]) * per, (py[i] - x[1]) * per, (pz[i] - x[2]) * per);
        }
        for k in n..full {
            (prior[k], weight[k], dx[k], dy[k], dz[k]) = (0.0, 0.0, 0.0, 0.0, 0.0);
        }
        for k in 0..full {
            prior[k] *= exp(weight[k]) - CUT;
        }
    }

    /// Weights prior × exp(λ·d), left in `weight`, and their moments; `reach`: longest way.
    #[inline(always)]
    fn at<S: Simd>(&mut self, s: S, l: V, reach: f64) -> Moments {
        let n = self.prior.len();
        let [x, y, z] = self.way.each_ref().map(|d| &d[..n]);
        let (prior, weight) = (&self.prior[..n], &mut self.weight[..n]);
        let mut top = 0.0;
        if length(l) * reach > FLAT {
            // the largest exponent out: no overflow
            let e = |i: usize| l[0] * x[i] + l[1] * y[i] + l[2] * z[i];
            top = (0..self.cell.len()).map(e).fold(f64::NEG_INFINITY, f64::max);
        }
        for i in 0..n {
            weight[i] = prior[i] * exp((l[0] * x[i] + l[1] * y[i] + l[2] * z[i]) - top);
        }
        Moments { top, ..self.moments(s) }
    }

    #[inline(always)]
    fn moments<S: Simd>(&self, s: S) -> Moments {
        let mut sums = Sums([[0.0; 8]; 10]);
        let [x, y, z] = self.way.each_ref().map(|d| eights(d));
        for (((w, x), y), z) in eights(&self.weight).iter().zip(x).zip(y).zip(z) {
            let [w, x, y, z] = [w, x, y, z].map(|l| f64::vectors::<S>(l));
            for v in 0..w.len() {
                let (w, x, y, z) = (w[v], x[v], y[v], z[v]);
                let (wx, wy, wz) = (s.mul_f64s(w, x), s.mul_f64s(w, y), s.mul_f64s(w, z));
                let mut add = |k: usize, a: S::f64s| {
                    let to = &mut f64::vectors_mut::<S>(&mut sums.0[k])[v];
                    *to = s.add_f64s(*to, a);
                };
                add(0, w);
                add(1, wx);
                add(2, wy);
                add(3, wz);
                add(4, s.mul_f64s(wx, x));
                add(5, s.mul_f64s(wy, y));
                add(6, s.mul_f64s(wz, z));
                add(7, s.mul_f64s(wx, y));
                add(8, s.mul_f64s(wy, z));
                add(9, s.mul_f64s(wz, x));
            }
        }
        let all = sums.all();
        let share = 1.0 / all[0];
        let first = [1, 2, 3].map(|k| all[k] * share);
        Moments { sum: all[0], top: 0.0, first, second: [4, 5, 6, 7, 8, 9].map(|k| all[k] * share) }
    }

    /// Weights with Σ w d = 0, by Newton's method; what is left of it.
    #[inline(always)]
    fn solve<S: Simd>(&mut self, s: S, reach: f64) -> f64 {
        let mut lambda = [0.0; 3];
        self.weight.copy_from_slice(&self.prior);
        let mut now = self.moments(s);
        for _ in 0..60 {
            if length(now.first) < EXACT || length(lambda) > STEEPEST {
                break;
            }
            let step = now.step();
            let mut t = 1.0;
            loop {
                let next = sub(lambda, scale(step, t));
                let there = self.at(s, next, reach);
                // log Σ no larger: more than rounding may tell where the step is small
                let fallen = || there.sum * exp(there.top - now.top) <= now.sum * (1.0 + 1e-14);
                if length(step) < SMALL || t < 1e-6 || fallen() {
                    (lambda, now) = (next, there);
                    break;
                }
                t *= 0.5;
            }
        }
        self.share = 1.0 / now.sum;
        length(now.first)
    }

    /// Σ of weight × way², in local sizes squared.
    pub fn spread(&self) -> f64 {
        let [x, y, z] = &self.way;
        let of = |i: usize| self.weight[i] * dot([x[i], y[i], z[i]], [x[i], y[i], z[i]]);
        (0..self.cell.len()).map(of).sum::<f64>() * self.share
    }
}

impl Moments {
    /// Newton's step of λ to be taken back: variance⁻¹ × mean. The ridge keeps it solvable where all cells lie in a plane.
    #[inline(always)]
    fn step(&self) -> V {
        let (g, m) = (self.first, self.second);
        let s = [
            [m[0] - g[0] * g[0] + 1e-12, m[3] - g[0] * g[1], m[5] - g[0] * g[2]],
            [m[3] - g[0] * g[1], m[1] - g[1] * g[1] + 1e-12, m[4] - g[1] * g[2]],
            [m[5] - g[0] * g[2], m[4] - g[1] * g[2], m[2] - g[2] * g[2] + 1e-12],
        ];
        solve(&s, g)
    }
}
