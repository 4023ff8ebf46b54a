// SPDX-License-Identifier: MIT OR Apache-2.0
//! G by uniformization: exp(−T A) = Σ_k Poisson(qT; k) P^k, P = I − A/q, q = max A_ii. Every entry of P is
//! ≥ 0, so the result keeps the sign and the range of the field on any mesh, by proof.

use super::graph::Graph;
use super::{Active, Smoother};
use crate::mesh::Mesh;
use crate::step::Lanes;

/// q a little above max A_ii: keeps P_ii above the rounding of a row.
const MARGIN: f64 = 1.0 + 1e-7;

/// The positive smoother.
pub struct Uniformization {
    graph: Graph,
    coefficients: Vec<f64>,
    now: Vec<Lanes>,
    next: Vec<Lanes>,
}

impl Uniformization {
    /// Bandwidth b in m; tolerance: mass of the Poisson distribution cut off.
    pub fn new(mesh: &Mesh, bandwidth: f64, tolerance: f64) -> Self {
        let graph = Graph::new(mesh);
        let zero = vec![[0.0; 8]; mesh.len()];
        let coefficients = poisson(graph.diagonal * MARGIN * bandwidth * bandwidth / 4.0, tolerance);
        Self { graph, coefficients, now: zero.clone(), next: zero }
    }
}

/// Poisson weights of mean `mean`, upper tail ≤ tolerance cut off, scaled to 1. By logarithms: e^{−mean} may underflow.
fn poisson(mean: f64, tolerance: f64) -> Vec<f64> {
    if mean <= 0.0 {
        return vec![1.0];
    }
    let (mut p, mut log, mut sum, mut k) = (Vec::new(), -mean, 0.0, 0.0);
    while sum < 1.0 - tolerance || k < mean {
        p.push(f64::exp(log));
        sum += f64::exp(log);
        k += 1.0;
        log += (mean / k).ln();
        if k > mean + 40.0 * mean.sqrt() + 200.0 {
            break; // rounding keeps the sum below 1 − tolerance
        }
    }
    let kept: f64 = p.iter().sum();
    p.iter_mut().for_each(|x| *x /= kept);
    p
}

impl Smoother for Uniformization {
    fn name(&self) -> &'static str {
        "uniformization"
    }
    fn properties(&self) -> &'static str {
        "conservative, constant-preserving, self-adjoint (to rounding), positive by proof on any mesh; error <= tolerance"
    }
    fn degree(&self) -> usize {
        self.coefficients.len() - 1
    }
    fn apply(&mut self, lanes: &mut [Lanes], active: &Active) {
        let c = &self.coefficients;
        if c.len() == 1 {
            return;
        }
        let share = 1.0 / (self.graph.diagonal * MARGIN);
        self.now.copy_from_slice(lanes);
        self.next.fill([0.0; 8]);
        for i in active.rows.iter().map(|i| *i as usize) {
            lanes[i].iter_mut().for_each(|x| *x *= c[0]);
        }
        for ck in &c[1..] {
            for i in active.rows.iter().map(|i| *i as usize) {
                let flux = self.graph.row(i, &self.now);
                let (now, next, out) = (&self.now[i], &mut self.next[i], &mut lanes[i]);
                for l in 0..8 {
                    next[l] = now[l] - flux[l] * share;
                    out[l] += ck * next[l];
                }
            }
            std::mem::swap(&mut self.now, &mut self.next);
        }
    }
}
