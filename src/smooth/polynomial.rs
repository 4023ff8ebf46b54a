// SPDX-License-Identifier: MIT OR Apache-2.0
//! G as a polynomial of the operator: Chebyshev of both kinds, and uniformization, which is positive by proof.
//!
//! Chebyshev: exp(−A) = Σ c_k T_k(X), X = 1 − 2 A/λ. The degree follows from the tolerance; it grows like
//! √(T λ ln(1/tolerance)). Uniformization: exp(−A) = Σ_k Poisson(q; k) P^k, P = 1 − A/q, q = max A_ii: every
//! entry of P is ≥ 0, so the result keeps the sign and the range of a field on any mesh.

use super::coefficients::{self, Kind};
use super::factors;
use super::graph::{Graph, Rows};
use super::product::Product;
use super::real::Real;
use super::recurrence::{self, Recurrence};
use super::{Active, Direction, Positivity, Properties, Scratch, Smoother};
use crate::step::Lanes;
use std::sync::Arc;

/// q a little above max A_ii: keeps P_ii above the rounding of a row.
const MARGIN: f64 = 1.0 + 1e-7;

/// How it is evaluated.
#[derive(Clone, Debug)]
enum Form {
    Product(Product),
    Recurrence(Recurrence),
}

impl Form {
    fn degree(&self) -> usize {
        match self {
            Self::Product(p) => p.degree(),
            Self::Recurrence(r) => r.alpha.len() - 1,
        }
    }
    fn apply<T: Real>(
        &self,
        rows: &Rows<T>,
        field: &mut [[T; 8]],
        active: &Active,
        direction: Direction,
        [a, b]: [&mut [[T; 8]]; 2],
    ) {
        match self {
            Self::Product(p) => p.apply(rows, field, active, direction, a),
            Self::Recurrence(r) => recurrence::apply(rows, r, field, active, direction, [a, b]),
        }
    }
}

/// A polynomial of the operator.
#[derive(Clone, Debug)]
pub struct Polynomial {
    name: &'static str,
    graph: Arc<Graph>,
    form: Form,
    certified: bool,
    properties: Properties,
}

impl Polynomial {
    /// Chebyshev polynomials of the first kind; the error is below the tolerance in the V norm. `matched`: keeps the
    /// kernel's variance exactly.
    pub fn chebyshev(graph: Arc<Graph>, tolerance: f64, matched: bool) -> Self {
        let properties = Properties {
            conservative: true,
            constants: true,
            self_adjoint: true,
            positive: Positivity::Measured,
            error: "below the tolerance in the V norm",
            cost: "sqrt(T λ ln(1/tolerance)) sweeps of some 190 bytes per active cell (hexahedra)",
        };
        Self::of_kind("chebyshev", Kind::First, graph, tolerance, matched, properties)
    }
    /// Chebyshev polynomials of the second kind, variance-matched.
    pub fn second_kind(graph: Arc<Graph>, tolerance: f64) -> Self {
        let properties = Properties {
            conservative: true,
            constants: true,
            self_adjoint: true,
            positive: Positivity::Measured,
            error: "of the tolerance's order (twice at 1e-2); no negative value in any test at 1e-2",
            cost: "as chebyshev",
        };
        Self::of_kind("chebyshev-u", Kind::Second, graph, tolerance, true, properties)
    }

    fn of_kind(
        name: &'static str,
        kind: Kind,
        graph: Arc<Graph>,
        tolerance: f64,
        matched: bool,
        properties: Properties,
    ) -> Self {
        // X has no negative entry if λ ≥ 2 max A_ii; then positive coefficients in powers of X prove positivity
        let (sharp, safe) = (graph.spectrum, 2.0 * graph.diagonal * MARGIN);
        let of = |lambda: f64| coefficients::chebyshev(kind, 0.5 * lambda, tolerance, matched);
        let (mut lambda, mut alpha, mut certified) = (sharp, of(sharp), false);
        let wide = of(safe);
        if wide.len() <= alpha.len() + 1 && coefficients::positive(kind, &wide) {
            (lambda, alpha, certified) = (safe, wide, true);
        }
        let last = if kind == Kind::First { 1.0 } else { 2.0 };
        let scale = if lambda > 0.0 { 2.0 / lambda } else { 0.0 };
        let form = match factors::factors(kind, &alpha, tolerance) {
            Some(factors) => Form::Product(Product { factors, scale }),
            None => Form::Recurrence(Recurrence { alpha, gamma: 2.0, last, three_terms: true, scale }),
        };
        let positive = if certified { Positivity::Proven } else { properties.positive };
        Self { name, graph, form, certified, properties: Properties { positive, ..properties } }
    }

    /// The positive polynomial; tolerance: mass of the Poisson distribution cut off.
    pub fn uniformization(graph: Arc<Graph>, tolerance: f64) -> Self {
        let q = graph.diagonal * MARGIN;
        let alpha = coefficients::poisson(q, tolerance);
        let scale = if q > 0.0 { 1.0 / q } else { 0.0 };
        let form = Form::Recurrence(Recurrence { alpha, gamma: 1.0, last: 1.0, three_terms: false, scale });
        let properties = Properties {
            conservative: true,
            constants: true,
            self_adjoint: true,
            positive: Positivity::Proven,
            error: "below the tolerance in the V norm and in the maximum norm",
            cost: "q + 3 sqrt(q) sweeps, q = T max A_ii: as chebyshev to b/h = 1.4, 3 times at 4, 4 times at 8",
        };
        Self { name: "uniformization", graph, form, certified: true, properties }
    }

    /// Explicit Euler steps: (1 − A/n)^n, n ≥ 2 max A_ii, so that every entry of a step is ≥ 0 and its spectrum lies in 0 … 1. Nearer to
    /// the Gaussian than exp(Δ_T) itself on hexahedra: a step's hops to the neighbours are rarer than those of the exact
    /// semigroup, whose kernel is too peaked and too wide at its foot (fourth cumulant along an axis: half).
    pub fn forward_euler(graph: Arc<Graph>) -> Self {
        let steps = Self::euler_steps(&graph);
        let factors = vec![factors::Factor::Real { root: 0.0 }; steps as usize];
        let properties = Properties {
            conservative: true,
            constants: true,
            self_adjoint: true,
            positive: Positivity::Proven,
            error: "first order in 1/n: 3 % at b/h = 1 to 4; against the particles' Gaussians smaller than exp(Δ_T)'s",
            cost: "2 max A_ii sweeps, 3 (b/h)² on hexahedra: as chebyshev at b/h = 1, 2 times at 2, 4 times at 4",
        };
        let form = Form::Product(Product { factors, scale: 1.0 / steps });
        Self { name: "forward-euler", graph, form, certified: true, properties }
    }

    /// Steps of `forward_euler`.
    pub fn euler_steps(graph: &Graph) -> f64 {
        (2.0 * graph.diagonal * MARGIN).ceil().max(1.0)
    }

    /// Positive by proof: uniformization always, Chebyshev when its coefficients in powers of X are.
    pub fn certified(&self) -> bool {
        self.certified
    }

    /// The same polynomial computed in f32, for fields outside the pair of spread and gather.
    pub fn single(&self) -> Single {
        Single { rows: self.graph.rows.cast(), polynomial: self.clone(), fields: Default::default() }
    }
}

impl Smoother for Polynomial {
    fn name(&self) -> &'static str {
        self.name
    }
    fn properties(&self) -> Properties {
        self.properties
    }
    fn degree(&self) -> usize {
        self.form.degree()
    }
    fn plan(&self, occupied: &[u32], active: &mut Active) {
        active.update(&self.graph, occupied, Some(self.degree()));
    }
    fn bytes(&self, active: &Active, direction: Direction) -> f64 {
        match &self.form {
            Form::Product(p) => p.bytes(&self.graph, active, direction),
            Form::Recurrence(r) => recurrence::bytes(&self.graph, r, active, direction),
        }
    }
    fn apply(&mut self, lanes: &mut [Lanes], active: &Active, direction: Direction, scratch: &mut Scratch) {
        scratch.fit(lanes.len());
        let Scratch { a, b } = scratch;
        let Some([slot_of, _]) = self.graph.order.as_ref() else {
            return self.form.apply(&self.graph.rows, lanes, active, direction, [a, b]);
        };
        // renumbered: the caller's field is copied in the order of rows and is then free to work in
        for (row, slot) in slot_of.iter().enumerate() {
            a[row] = lanes[*slot as usize];
        }
        self.form.apply(&self.graph.rows, a, active, direction, [b, lanes]);
        for (row, slot) in slot_of.iter().enumerate() {
            lanes[*slot as usize] = a[row];
        }
    }
}

/// A polynomial in f32: half the bytes. Σ V φ is restored in f64 by scaling each field's values with their error
/// (1e-7 relative), which keeps signs; not self-adjoint to more than that, so never for Sp, Su or the gather.
#[derive(Clone, Debug)]
pub struct Single {
    rows: Rows<f32>,
    polynomial: Polynomial,
    fields: [Vec<[f32; 8]>; 3],
}

impl Single {
    /// Smooths all lanes; `volume` of each cell, m3.
    pub fn apply(&mut self, lanes: &mut [Lanes], volume: &[f64], active: &Active, direction: Direction) {
        let before = totals(lanes, volume);
        let [field, a, b] = &mut self.fields;
        [&mut *field, &mut *a, &mut *b].into_iter().for_each(|f| f.resize(lanes.len(), [0.0; 8]));
        let order = self.polynomial.graph.order.as_ref().map(|o| &o[0]);
        let slot = |row: usize| order.map_or(row, |o| o[row] as usize);
        for (row, to) in field.iter_mut().enumerate() {
            *to = lanes[slot(row)].map(|x| x as f32);
        }
        self.polynomial.form.apply(&self.rows, field, active, direction, [a, b]);
        for (row, from) in field.iter().enumerate() {
            lanes[slot(row)] = from.map(f64::from);
        }
        for _ in 0..2 {
            let after = totals(lanes, volume);
            let gap: Lanes =
                std::array::from_fn(|l| (before.0[l] - after.0[l]) / after.1[l].max(f64::MIN_POSITIVE));
            for lane in lanes.iter_mut() {
                (0..8).for_each(|l| lane[l] += gap[l] * lane[l].abs());
            }
        }
    }
}

/// Σ V φ and Σ V |φ| of each lane.
fn totals(lanes: &[Lanes], volume: &[f64]) -> (Lanes, Lanes) {
    let of = |f: &dyn Fn(f64) -> f64, l: usize| {
        crate::sums::sum(lanes.iter().zip(volume).map(|(x, v)| v * f(x[l])))
    };
    (std::array::from_fn(|l| of(&|x| x, l)), std::array::from_fn(|l| of(&f64::abs, l)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::made::Made;
    use crate::smooth::Diffusion;

    /// Lines of hexahedra go without indices; the same rows one by one, by their indices, give the same bits.
    #[test]
    fn lines_have_the_bits_of_single_rows() {
        for n in [[30, 5, 6], [12, 40, 1], [3, 4, 5]] {
            let mesh = Made::graded(n, [0.06, 0.04, 0.05]).mesh();
            let graph = Graph::new(&mesh, &Diffusion::uniform(0.012).links(&mesh));
            assert_eq!(graph.in_lines() > 0.5, n[0] >= 9, "{n:?}: {}", graph.in_lines());
            let mut single = graph.clone();
            single.rows.forget_lines();
            assert_eq!(single.in_lines(), 0.0);
            let mut seed = 3;
            let random = |_| std::array::from_fn(|_| crate::bench::scene::random(&mut seed));
            let field: Vec<Lanes> = (0..mesh.len()).map(random).collect();
            let of = |graph: &Graph, make: fn(Arc<Graph>) -> Polynomial| {
                let (mut out, mut s) = (field.clone(), make(Arc::new(graph.clone())));
                let active = Active::whole(mesh.len());
                s.apply(&mut out, &active, Direction::Spread, &mut Scratch::default());
                out
            };
            let makes: [fn(Arc<Graph>) -> Polynomial; 3] = [
                |g| Polynomial::chebyshev(g, 1e-4, false),
                |g| Polynomial::chebyshev(g, 1e-13, false),
                |g| Polynomial::uniformization(g, 1e-4),
            ];
            for make in makes {
                assert_eq!(of(&graph, make), of(&single, make), "{n:?}");
            }
        }
    }

    /// The product and the recurrence are one polynomial.
    #[test]
    fn both_forms_agree() {
        let mesh = Made::tet([7, 6, 5], [0.06, 0.04, 0.05]).mesh();
        let graph = Arc::new(Graph::new(&mesh, &Diffusion::uniform(0.012).links(&mesh)));
        let mut field = vec![[0.0; 8]; mesh.len()];
        field[mesh.len() / 2] = [1.0; 8];
        for tolerance in [1e-2, 1e-4, 1e-6] {
            let mut product = Polynomial::chebyshev(Arc::clone(&graph), tolerance, tolerance > 1e-3);
            let Form::Product(p) = &product.form else { panic!("{tolerance}: the recurrence was chosen") };
            let a = 0.5 * graph.spectrum;
            assert!((p.scale * graph.spectrum / 2.0 - 1.0).abs() < 1e-12, "not the certified one");
            let alpha = coefficients::chebyshev(Kind::First, a, tolerance, tolerance > 1e-3);
            let mut recurrence = product.clone();
            recurrence.form = Form::Recurrence(Recurrence {
                alpha,
                gamma: 2.0,
                last: 1.0,
                three_terms: true,
                scale: p.scale,
            });
            let whole = Active::whole(mesh.len());
            let of = |s: &mut Polynomial| {
                let mut out = field.clone();
                s.apply(&mut out, &whole, Direction::Spread, &mut Scratch::default());
                out
            };
            let (a, b) = (of(&mut product), of(&mut recurrence));
            assert!(a.iter().zip(&b).all(|(a, b)| (a[0] - b[0]).abs() < 1e-12), "{tolerance}");
        }
    }
}
