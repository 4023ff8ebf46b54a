// SPDX-License-Identifier: MIT OR Apache-2.0
//! A polynomial by one backward recurrence:
//!
//!   b_k = α_k φ + γ X b_{k+1} − β b_{k+2},  X = 1 − σ A,  result α_0 φ + γ_0 X b_1 − β b_2
//!
//! (Clenshaw 1955 for Chebyshev polynomials of both kinds, Horner for powers of X). A sweep reads φ, b_{k+1} and
//! b_{k+2} and writes b_k over b_{k+2}: 256 bytes per cell in f64 and the row; two fields of scratch.

use super::graph::{Graph, Rows};
use super::real::Real;
use super::sweep::{ALONE, BOTH, OTHER, OUT, Sweep, cuts, reach};
use super::{Active, Direction};

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
    // The sweep for b_k: γ X b = γ b − γ σ A b. `fresh`: it writes its field for the first time, whose far rows
    // must read as zero in a spread (in a gather they are not read).
    let at = |k: usize, fresh: bool| {
        let gamma = if k == 0 { r.last } else { r.gamma };
        let zero = if direction != Direction::Gather && fresh { m as u16 + 1 } else { 0 };
        let reach = reach(direction, m, m - k) as u16;
        Sweep {
            rows,
            active,
            fetch: true,
            reach,
            zero,
            now: &[],
            base: 0,
            factors: [gamma, -gamma * r.scale, r.alpha[k], -1.0],
        }
    };
    // b_m = α_m φ is not stored: b_{m−1} = α_{m−1} φ + γ α_m X φ
    let mut s = at(m - 1, true);
    s.factors = [s.factors[2] + top * s.factors[0], top * s.factors[1], 0.0, 0.0];
    Sweep { now: field, ..s }.run::<ALONE>(cuts, &[], now);
    if m == 1 {
        return copy(now, field, active, reach(direction, 1, 1));
    }
    // and b_{m−2} = (α_{m−2} − β α_m) φ + γ X b_{m−1}
    let mut s = at(m - 2, m > 2);
    s.factors[2] -= if r.three_terms { top } else { 0.0 };
    if m == 2 {
        s.factors[3] = s.factors[2];
        return Sweep { now, ..s }.run::<OUT>(cuts, &[], field);
    }
    Sweep { now, ..s }.run::<OTHER>(cuts, field, old);
    std::mem::swap(&mut now, &mut old);
    for k in (1..m - 2).rev() {
        let s = Sweep { now, ..at(k, false) };
        if r.three_terms {
            s.run::<BOTH>(cuts, field, old);
        } else {
            s.run::<OTHER>(cuts, field, old);
        }
        std::mem::swap(&mut now, &mut old);
    }
    // φ is where the result goes
    let mut s = Sweep { now, ..at(0, false) };
    s.factors.swap(2, 3);
    if r.three_terms {
        s.run::<BOTH>(cuts, old, field);
    } else {
        s.run::<OUT>(cuts, &[], field);
    }
}

/// Copies the rows in blocks up to a ring.
pub(super) fn copy<T: Real>(from: &[[T; 8]], to: &mut [[T; 8]], active: &Active, reach: usize) {
    use super::active::BLOCK;
    let blocks = from.chunks(BLOCK).zip(to.chunks_mut(BLOCK)).zip(&active.blocks);
    blocks
        .filter(|(_, ring)| usize::from(**ring) <= reach)
        .for_each(|((from, to), _)| to.copy_from_slice(from));
}

/// Bytes that must move between memory and the core in one application in f64: fields once per sweep, rows once.
pub(super) fn bytes(graph: &Graph, r: &Recurrence, active: &Active, direction: Direction) -> f64 {
    let m = r.alpha.len() - 1;
    let of_sweep = |k: usize| {
        let fields = match (k, r.three_terms) {
            _ if k + 1 == m => 2, // reads φ, writes
            _ if k + 2 == m => 3, // reads φ and the last, writes
            (0, false) => 3,
            (_, true) => 4,
            (_, false) => 3,
        };
        graph.bytes(active, reach(direction, m, m - k), fields)
    };
    (0..m).map(of_sweep).sum()
}
