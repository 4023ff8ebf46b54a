// SPDX-License-Identifier: MIT OR Apache-2.0
//! Sweeps over the rows of the operator: all polynomials of A are evaluated here, by one backward recurrence
//!
//!   b_k = α_k φ + γ X b_{k+1} − β b_{k+2},  X = 1 − σ A,  result α_0 φ + γ_0 X b_1 − β b_2
//!
//! (Clenshaw 1955 for Chebyshev polynomials of both kinds, Horner for powers of X). A sweep reads φ, b_{k+1} and
//! b_{k+2} and writes b_k over b_{k+2}: 256 bytes per cell in f64 and the row; two fields of scratch. Each row is
//! computed by itself, in the order of its entries: threads and numbering do not change a bit.
//!
//! Uses the rayon pool it is called in (one range of rows per thread, one barrier per sweep); outside of a pool
//! it runs on the calling thread.

use super::active::BLOCK;
use super::graph::{Graph, Rows};
use super::{Active, Direction};
use pulp::{Simd, WithSimd};

/// A number of the sweeps, and its vectors (at most eight lanes each) on the machine at hand.
#[allow(missing_docs)]
pub trait Real: Copy + Send + Sync {
    const ZERO: Self;
    /// rounded
    fn from_f64(x: f64) -> Self;
    /// exact
    fn to_f64(self) -> f64;
    type Of<S: Simd>: Copy;
    fn dispatch<W: WithSimd>(work: W) -> W::Output;
    fn vectors<S: Simd>(x: &[Self; 8]) -> &[Self::Of<S>];
    fn vectors_mut<S: Simd>(x: &mut [Self; 8]) -> &mut [Self::Of<S>];
    fn splat<S: Simd>(s: S, x: Self) -> Self::Of<S>;
    fn add<S: Simd>(s: S, a: Self::Of<S>, b: Self::Of<S>) -> Self::Of<S>;
    fn sub<S: Simd>(s: S, a: Self::Of<S>, b: Self::Of<S>) -> Self::Of<S>;
    fn mul<S: Simd>(s: S, a: Self::Of<S>, b: Self::Of<S>) -> Self::Of<S>;
}
impl Real for f64 {
    const ZERO: Self = 0.0;
    fn from_f64(x: f64) -> Self {
        x
    }
    fn to_f64(self) -> f64 {
        self
    }
    type Of<S: Simd> = S::f64s;
    fn dispatch<W: WithSimd>(work: W) -> W::Output {
        pulp::Arch::new().dispatch(work)
    }
    #[inline(always)]
    fn vectors<S: Simd>(x: &[Self; 8]) -> &[S::f64s] {
        S::as_simd_f64s(x).0
    }
    #[inline(always)]
    fn vectors_mut<S: Simd>(x: &mut [Self; 8]) -> &mut [S::f64s] {
        S::as_mut_simd_f64s(x).0
    }
    #[inline(always)]
    fn splat<S: Simd>(s: S, x: Self) -> S::f64s {
        s.splat_f64s(x)
    }
    #[inline(always)]
    fn add<S: Simd>(s: S, a: S::f64s, b: S::f64s) -> S::f64s {
        s.add_f64s(a, b)
    }
    #[inline(always)]
    fn sub<S: Simd>(s: S, a: S::f64s, b: S::f64s) -> S::f64s {
        s.sub_f64s(a, b)
    }
    #[inline(always)]
    fn mul<S: Simd>(s: S, a: S::f64s, b: S::f64s) -> S::f64s {
        s.mul_f64s(a, b)
    }
}
impl Real for f32 {
    const ZERO: Self = 0.0;
    fn from_f64(x: f64) -> Self {
        x as f32
    }
    fn to_f64(self) -> f64 {
        f64::from(self)
    }
    type Of<S: Simd> = S::f32s;
    /// Not by the widest vectors: a cell has eight lanes, AVX-512 would want sixteen.
    fn dispatch<W: WithSimd>(work: W) -> W::Output {
        #[cfg(target_arch = "x86_64")]
        if let Some(v) = pulp::x86::V3::try_new() {
            return Simd::vectorize(v, work);
        }
        Simd::vectorize(pulp::Scalar::new(), work)
    }
    #[inline(always)]
    fn vectors<S: Simd>(x: &[Self; 8]) -> &[S::f32s] {
        S::as_simd_f32s(x).0
    }
    #[inline(always)]
    fn vectors_mut<S: Simd>(x: &mut [Self; 8]) -> &mut [S::f32s] {
        S::as_mut_simd_f32s(x).0
    }
    #[inline(always)]
    fn splat<S: Simd>(s: S, x: Self) -> S::f32s {
        s.splat_f32s(x)
    }
    #[inline(always)]
    fn add<S: Simd>(s: S, a: S::f32s, b: S::f32s) -> S::f32s {
        s.add_f32s(a, b)
    }
    #[inline(always)]
    fn sub<S: Simd>(s: S, a: S::f32s, b: S::f32s) -> S::f32s {
        s.sub_f32s(a, b)
    }
    #[inline(always)]
    fn mul<S: Simd>(s: S, a: S::f32s, b: S::f32s) -> S::f32s {
        s.mul_f32s(a, b)
    }
}

/// Coefficients of the recurrence.
#[derive(Clone, Debug)]
pub(super) struct Recurrence {
    /// α_0 … α_m
    pub alpha: Vec<f64>,
    /// γ of all sweeps but the last
    pub gamma: f64,
    /// γ_0
    pub last: f64,
    /// β is 1 (three terms) or 0
    pub three_terms: bool,
    /// σ
    pub scale: f64,
}

/// What one sweep does, and to which rows.
struct Sweep<'a, T> {
    rows: &'a Rows<T>,
    blocks: &'a [u16],
    /// blocks up to this ring are computed
    reach: u16,
    /// blocks beyond and up to this ring are set to zero
    zero: u16,
    alpha: T,
    gamma: T,
    scale: T,
    /// b_{k+1}
    now: &'a [[T; 8]],
}

/// out = α now + γ X now.
const OF_ITSELF: u8 = 0;
/// out = α other + γ X now.
const TWO_TERMS: u8 = 1;
/// out = α other + γ X now − out.
const THREE_TERMS: u8 = 2;
/// out = α out + γ X now.
const LAST_TWO_TERMS: u8 = 3;
/// out = α out + γ X now − other.
const LAST_THREE_TERMS: u8 = 4;

/// A sweep over the rows of one thread.
struct Part<'a, T, const KIND: u8> {
    sweep: &'a Sweep<'a, T>,
    first_block: usize,
    other: &'a [[T; 8]],
    out: &'a mut [[T; 8]],
}

impl<T: Real, const KIND: u8> WithSimd for Part<'_, T, KIND> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, v: S) {
        let Self { sweep: s, first_block, other, out } = self;
        let first_row = first_block * BLOCK;
        let [alpha, gamma, scale] = [s.alpha, s.gamma, s.scale].map(|x| T::splat(v, x));
        for (b, out) in out.chunks_mut(BLOCK).enumerate() {
            let ring = s.blocks[first_block + b];
            if ring > s.reach {
                if ring <= s.zero {
                    out.fill([T::ZERO; 8]);
                }
                continue;
            }
            let begin = first_row + b * BLOCK;
            let end = begin + out.len();
            let range = s.rows.start[begin] as usize..s.rows.start[end] as usize;
            let (mut to, mut a) = (&s.rows.to[range.clone()], &s.rows.a[range]);
            let other = if KIND == OF_ITSELF || KIND == LAST_TWO_TERMS { &[] } else { &other[begin..end] };
            let (own, starts) = (&s.now[begin..end], &s.rows.start[begin..=end]);
            for i in 0..out.len().min(own.len()) {
                let n = (starts[i + 1] - starts[i]) as usize;
                let (to_row, to_rest) = to.split_at(n);
                let (a_row, a_rest) = a.split_at(n);
                (to, a) = (to_rest, a_rest);
                let out = T::vectors_mut::<S>(&mut out[i]);
                for (p, out) in out.iter_mut().enumerate() {
                    let x = T::vectors::<S>(&own[i])[p];
                    let mut flux = T::splat(v, T::ZERO);
                    for (a, to) in a_row.iter().zip(to_row) {
                        let far = T::vectors::<S>(&s.now[*to as usize])[p];
                        flux = T::add(v, flux, T::mul(v, T::splat(v, *a), T::sub(v, x, far)));
                    }
                    let now = T::mul(v, gamma, T::sub(v, x, T::mul(v, scale, flux)));
                    let of = |y| T::add(v, T::mul(v, alpha, y), now);
                    let other = |i: usize| T::vectors::<S>(&other[i])[p];
                    *out = match KIND {
                        OF_ITSELF => of(x),
                        TWO_TERMS => of(other(i)),
                        THREE_TERMS => T::sub(v, of(other(i)), *out),
                        LAST_TWO_TERMS => of(*out),
                        _ => T::sub(v, of(*out), other(i)),
                    };
                }
            }
        }
    }
}

impl<T: Real> Sweep<'_, T> {
    /// Runs it on every thread of the pool; `cuts`: first block of each thread and the end.
    fn run<const KIND: u8>(&self, cuts: &[usize], other: &[[T; 8]], mut out: &mut [[T; 8]]) {
        let part = |first_block, out| T::dispatch(Part::<T, KIND> { sweep: self, first_block, other, out });
        if cuts.len() == 2 {
            return part(0, out);
        }
        let part = &part;
        rayon::scope(|scope| {
            for w in cuts.windows(2) {
                let rows = ((w[1] - w[0]) * BLOCK).min(out.len());
                let (mine, rest) = std::mem::take(&mut out).split_at_mut(rows);
                out = rest;
                let first = w[0];
                scope.spawn(move |_| part(first, mine));
            }
        });
    }
}

/// First block of each thread and the end: equal numbers of active blocks.
fn cuts(active: &Active, reach: usize) -> Vec<usize> {
    let threads = if rayon::current_thread_index().is_some() { rayon::current_num_threads() } else { 1 };
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

/// Furthest ring that the sweep for b_k must visit: a spread has come m − k rings far, a gather has k to go.
fn reach(direction: Direction, m: usize, k: usize) -> usize {
    match direction {
        Direction::Spread => m - k,
        Direction::Gather => k,
        Direction::Both => k.max(m - k),
    }
}

/// All sweeps of one application.
struct Sweeps<'a, T> {
    rows: &'a Rows<T>,
    r: &'a Recurrence,
    active: &'a Active,
    direction: Direction,
}

impl<'a, T: Real> Sweeps<'a, T> {
    /// The sweep that computes b_k, with another α if given. `fresh`: it writes its field for the first time, whose
    /// far rows must read as zero in a spread (in a gather they are not read).
    fn at(&self, k: usize, alpha: f64, now: &'a [[T; 8]], fresh: bool) -> Sweep<'a, T> {
        let m = self.r.alpha.len() - 1;
        let reach = reach(self.direction, m, k) as u16;
        let zero = if self.direction != Direction::Gather && fresh { m as u16 + 1 } else { 0 };
        let gamma = T::from_f64(if k == 0 { self.r.last } else { self.r.gamma });
        let (alpha, scale) = (T::from_f64(alpha), T::from_f64(self.r.scale));
        Sweep { rows: self.rows, blocks: &self.active.blocks, reach, zero, alpha, gamma, scale, now }
    }
}

/// Applies the polynomial to `field` (in the order of rows). The result is in `field`.
pub(super) fn apply<T: Real>(
    rows: &Rows<T>,
    r: &Recurrence,
    field: &mut [[T; 8]],
    active: &Active,
    direction: Direction,
    [mut now, mut old]: [&mut [[T; 8]]; 2],
) {
    let m = r.alpha.len() - 1;
    let top = r.alpha[m];
    let cuts = &cuts(active, m);
    if m == 0 {
        return; // α_0 = 1
    }
    if m == 1 {
        for (to, from) in now.iter_mut().zip(field.iter()) {
            *to = from.map(|x| T::from_f64(top * x.to_f64()));
        }
        let all = Sweeps { rows, r, active, direction };
        return all.at(0, r.alpha[0], now, false).run::<LAST_TWO_TERMS>(cuts, &[], field);
    }
    // b_m = α_m φ is not stored: b_{m−1} = α_{m−1} φ + γ α_m X φ
    let mut s = Sweeps { rows, r, active, direction }.at(m - 1, r.alpha[m - 1], field, true);
    s.gamma = T::from_f64(r.gamma * top);
    s.run::<OF_ITSELF>(cuts, &[], now);
    // and b_{m−2} = (α_{m−2} − β α_m) φ + γ X b_{m−1}
    let alpha = r.alpha[m - 2] - if r.three_terms { top } else { 0.0 };
    if m == 2 {
        let s = Sweeps { rows, r, active, direction }.at(0, alpha, now, false);
        return s.run::<LAST_TWO_TERMS>(cuts, &[], field);
    }
    Sweeps { rows, r, active, direction }.at(m - 2, alpha, now, true).run::<TWO_TERMS>(cuts, field, old);
    std::mem::swap(&mut now, &mut old);
    for k in (1..m - 2).rev() {
        let s = Sweeps { rows, r, active, direction }.at(k, r.alpha[k], now, false);
        if r.three_terms {
            s.run::<THREE_TERMS>(cuts, field, old);
        } else {
            s.run::<TWO_TERMS>(cuts, field, old);
        }
        std::mem::swap(&mut now, &mut old);
    }
    let s = Sweeps { rows, r, active, direction }.at(0, r.alpha[0], now, false);
    if r.three_terms {
        s.run::<LAST_THREE_TERMS>(cuts, old, field);
    } else {
        s.run::<LAST_TWO_TERMS>(cuts, &[], field);
    }
}

/// Bytes that must move between memory and the core in one application in f64: fields once per sweep, rows once.
pub(super) fn bytes(graph: &Graph, r: &Recurrence, active: &Active, direction: Direction) -> f64 {
    let m = r.alpha.len() - 1;
    let per_row = 4.0 + 12.0 * graph.rows.to.len() as f64 / graph.len() as f64;
    let of_sweep = |k: usize| {
        let reach = reach(direction, m, k);
        let fields = match (k, r.three_terms) {
            _ if k + 1 == m => 2, // reads φ, writes
            _ if k + 2 == m => 3, // reads φ and the last, writes
            (0, false) => 3,
            (_, true) => 4,
            (_, false) => 3,
        };
        active.rows_within(reach, graph.len()) as f64 * (64.0 * f64::from(fields) + per_row)
    };
    (0..m).map(of_sweep).sum()
}
