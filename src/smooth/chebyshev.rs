// SPDX-License-Identifier: MIT OR Apache-2.0
//! G by Chebyshev polynomials: exp(−a (1 − X)) = Σ c_k T_k(X), X = 1 − 2 A/λ, c_k = (2 − δ_k0) e^{−a} I_k(a),
//! a = T λ / 2. The degree follows from the tolerance (tail of the c_k); the truncated sum is scaled to
//! Σ c_k = 1, which keeps constants and Σ V φ to rounding.

use super::graph::Graph;
use super::{Active, Smoother};
use crate::mesh::Mesh;
use crate::step::Lanes;

/// exp(T Δ_h) to a relative tolerance; not positive by proof (see `Uniformization`).
pub struct Chebyshev {
    graph: Graph,
    coefficients: Vec<f64>,
    before: Vec<Lanes>,
    now: Vec<Lanes>,
}

impl Chebyshev {
    /// Bandwidth b in m; tolerance: bound of the operator's error in the V norm.
    pub fn new(mesh: &Mesh, bandwidth: f64, tolerance: f64) -> Self {
        let graph = Graph::new(mesh);
        let a = 0.5 * graph.spectrum * bandwidth * bandwidth / 4.0;
        let zero = vec![[0.0; 8]; mesh.len()];
        Self { graph, coefficients: coefficients(a, tolerance), before: zero.clone(), now: zero }
    }
}

/// c_0 … c_m with a tail Σ_{k>m} c_k ≤ tolerance, scaled to Σ c_k = 1.
pub(super) fn coefficients(a: f64, tolerance: f64) -> Vec<f64> {
    // Miller's backward recurrence I_{k-1} = I_{k+1} + (2k/a) I_k, normalised by I_0 + 2 Σ I_k = e^a
    let top = (a + 12.0 * a.sqrt() + 60.0) as usize;
    let mut i = vec![0.0; top + 2];
    if a > 0.0 {
        i[top] = 1e-300;
        for k in (1..=top).rev() {
            i[k - 1] = i[k + 1] + 2.0 * k as f64 / a * i[k];
            if i[k - 1] > 1e250 {
                i.iter_mut().for_each(|x| *x *= 1e-250);
            }
        }
    } else {
        i[0] = 1.0;
    }
    i.iter_mut().skip(1).for_each(|x| *x *= 2.0);
    let all: f64 = i.iter().sum();
    i.iter_mut().for_each(|x| *x /= all);
    let (mut tail, mut m) = (0.0, top);
    while m > 0 && tail + i[m] <= tolerance {
        tail += i[m];
        m -= 1;
    }
    i.truncate(m + 1);
    let kept: f64 = i.iter().sum();
    i.iter_mut().for_each(|x| *x /= kept);
    i
}

impl Smoother for Chebyshev {
    fn name(&self) -> &'static str {
        "chebyshev"
    }
    fn properties(&self) -> &'static str {
        "conservative, constant-preserving, self-adjoint (to rounding); error <= tolerance; positive in practice, \
         not by proof: a negative result is redone by uniformization"
    }
    fn degree(&self) -> usize {
        self.coefficients.len() - 1
    }
    fn apply(&mut self, lanes: &mut [Lanes], active: &Active) {
        let c = &self.coefficients;
        if c.len() == 1 {
            return;
        }
        self.before.copy_from_slice(lanes);
        self.now.fill([0.0; 8]);
        let (before, now) = (&mut self.before, &mut self.now);
        pulp::Arch::new().dispatch(Sweeps { graph: &self.graph, c, rows: &active.rows, before, now, lanes });
    }
}

/// All sweeps of one application, compiled for the vector unit at hand; lanes never mix, so bits do not differ.
struct Sweeps<'a> {
    graph: &'a Graph,
    c: &'a [f64],
    rows: &'a [u32],
    before: &'a mut Vec<Lanes>,
    now: &'a mut Vec<Lanes>,
    lanes: &'a mut [Lanes],
}

impl pulp::NullaryFnOnce for Sweeps<'_> {
    type Output = ();
    #[inline(always)]
    fn call(self) {
        let Self { graph, c, rows, before, now, lanes } = self;
        let scale = 2.0 / graph.spectrum;
        // T_0 = φ, T_1 = X φ
        for i in rows.iter().map(|i| *i as usize) {
            let flux = graph.row(i, before);
            let (own, now, out) = (&before[i], &mut now[i], &mut lanes[i]);
            for l in 0..8 {
                now[l] = own[l] - scale * flux[l];
                out[l] = c[0] * own[l] + c[1] * now[l];
            }
        }
        // T_{k+1} = 2 X T_k − T_{k−1}, written over T_{k−1}
        for ck in &c[2..] {
            for i in rows.iter().map(|i| *i as usize) {
                let flux = graph.row(i, now);
                let (now, next, out) = (&now[i], &mut before[i], &mut lanes[i]);
                for l in 0..8 {
                    next[l] = 2.0 * (now[l] - scale * flux[l]) - next[l];
                    out[l] += ck * next[l];
                }
            }
            std::mem::swap(before, now);
        }
    }
}
