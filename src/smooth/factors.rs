// SPDX-License-Identifier: MIT OR Apache-2.0
//! A polynomial of X in a Chebyshev basis as a product of factors of degree one and two: numbers only, no mesh.
//!
//! The roots are found all at once (Aberth 1973). The order of the factors decides how rounding grows (Leja points,
//! Reichel 1990); here the next factor is the one that keeps the largest value of the product on −1 … 1 smallest, and
//! of those the one with the largest values itself.
//! Most roots of a truncated exponential lie in −1 … 1, where it is near to zero: a factor of degree one each.

use super::coefficients::{self, Kind};

/// A factor, scaled to 1 at X = 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Factor {
    /// (X − r) / (1 − r)
    Real {
        /// r
        root: f64,
    },
    /// ((X − u)² + v²) / ((1 − u)² + v²)
    Pair {
        /// u
        real: f64,
        /// v
        imaginary: f64,
    },
}

impl Factor {
    /// 1 or 2.
    pub fn degree(&self) -> usize {
        match self {
            Self::Real { .. } => 1,
            Self::Pair { .. } => 2,
        }
    }
    /// Sum of the sizes of the terms that a row adds up, for values of size 1 (A_ii at most half the spectrum): they cancel
    /// where the field is smooth.
    fn terms(&self) -> f64 {
        match *self {
            Self::Real { root } => 1.0 + 2.0 / (1.0 - root).abs(),
            Self::Pair { real: u, imaginary: v } => {
                1.0 + 4.0 * (1.0 + (1.0 - u).abs()) / ((1.0 - u).powi(2) + v * v)
            }
        }
    }
    /// At X.
    pub fn value(&self, x: f64) -> f64 {
        match *self {
            Self::Real { root } => (x - root) / (1.0 - root),
            Self::Pair { real: u, imaginary: v } => ((x - u).powi(2) + v * v) / ((1.0 - u).powi(2) + v * v),
        }
    }
}

/// Degrees above are left to the recurrence: the search for the roots is quadratic.
const HIGHEST: usize = 100;
/// Rounding may grow by so much between factors: 1e-13 relative.
const GROWTH: f64 = 1e3;
/// The product may differ from the polynomial by so much of the tolerance.
const SHARE: f64 = 1e-3;
/// Points on −1 … 1 where products are compared.
const POINTS: usize = 400;
const STEPS: usize = 100;

/// The factors in the order they are to be applied, or none: the recurrence is then the better way.
pub fn factors(kind: Kind, c: &[f64], tolerance: f64) -> Option<Vec<Factor>> {
    let m = c.len() - 1;
    if m == 0 || m > HIGHEST {
        return None;
    }
    let mut left = Vec::new();
    for z in roots(kind, c) {
        if z.1.abs() <= 1e-9 {
            left.push(Factor::Real { root: z.0 });
        } else if z.1 > 0.0 {
            left.push(Factor::Pair { real: z.0, imaginary: z.1 });
        }
    }
    if left.iter().map(Factor::degree).sum::<usize>() != m {
        return None;
    }
    let points: Vec<f64> =
        (0..=POINTS).map(|i| (std::f64::consts::PI * i as f64 / POINTS as f64).cos()).collect();
    let largest = |p: &[f64]| p.iter().fold(0.0, |a: f64, x| a.max(x.abs()));
    let times =
        |p: &[f64], f: &Factor| -> Vec<f64> { p.iter().zip(&points).map(|(p, x)| p * f.value(*x)).collect() };
    let one = vec![1.0; points.len()];
    let mut product = one.clone();
    let (mut order, mut before) = (Vec::new(), Vec::new());
    while !left.is_empty() {
        // the largest value is 1, at X = 1, for many: then the factor that would do most harm later
        let size = |f: &Factor| (largest(&times(&product, f)).max(1.0 + 1e-6), -largest(&times(&one, f)));
        let better = |i: &usize, j: &usize| {
            let (a, b) = (size(&left[*i]), size(&left[*j]));
            a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1))
        };
        let at = (0..left.len()).min_by(better)?;
        before.push(largest(&product));
        order.push(left.swap_remove(at));
        product = times(&product, &order[order.len() - 1]);
    }
    let gap = points.iter().zip(&product).map(|(x, p)| (p - coefficients::value(kind, c, *x)).abs());
    // what is rounded in a factor is multiplied by all that follow
    let (mut after, mut growth) = (one.clone(), 0.0f64);
    for (f, before) in order.iter().zip(&before).rev() {
        growth = growth.max(before * f.terms() * largest(&after));
        after = times(&after, f);
    }
    (gap.fold(0.0, f64::max) <= SHARE * tolerance && growth <= GROWTH).then_some(order)
}

type Complex = (f64, f64);

fn times(a: Complex, b: Complex) -> Complex {
    (a.0 * b.0 - a.1 * b.1, a.0 * b.1 + a.1 * b.0)
}
fn over(a: Complex, b: Complex) -> Complex {
    let n = b.0 * b.0 + b.1 * b.1;
    ((a.0 * b.0 + a.1 * b.1) / n, (a.1 * b.0 - a.0 * b.1) / n)
}
fn minus(a: Complex, b: Complex) -> Complex {
    (a.0 - b.0, a.1 - b.1)
}

/// The polynomial and its slope at z, by Clenshaw's recurrence and its derivative.
fn at(kind: Kind, c: &[f64], z: Complex) -> [Complex; 2] {
    let twice = (2.0 * z.0, 2.0 * z.1);
    let zero = (0.0, 0.0);
    let (mut b1, mut b2, mut d1, mut d2) = (zero, zero, zero, zero);
    for c in c[1..].iter().rev() {
        let d = minus(times(twice, d1), d2);
        (d1, d2) = ((d.0 + 2.0 * b1.0, d.1 + 2.0 * b1.1), d1);
        let b = minus(times(twice, b1), b2);
        (b1, b2) = ((b.0 + c, b.1), b1);
    }
    // T_1 = X, U_1 = 2 X
    let k = if kind == Kind::First { 1.0 } else { 2.0 };
    let first = (k * z.0, k * z.1);
    let (p, d) = (minus(times(first, b1), b2), minus(times(first, d1), d2));
    [(p.0 + c[0], p.1), (d.0 + k * b1.0, d.1 + k * b1.1)]
}

fn roots(kind: Kind, c: &[f64]) -> Vec<Complex> {
    let m = c.len() - 1;
    // around −1 … 1, on no axis of symmetry
    let turn = |k: usize| std::f64::consts::TAU * (k as f64 + 0.3) / m as f64;
    let mut z: Vec<Complex> = (0..m).map(|k| (1.3 * turn(k).cos() - 0.2, 1.3 * turn(k).sin())).collect();
    for _ in 0..STEPS {
        let move_of = |i: usize| {
            let [p, slope] = at(kind, c, z[i]);
            let newton = over(p, slope);
            let mut others = (0.0, 0.0);
            for j in (0..m).filter(|j| *j != i) {
                let d = over((1.0, 0.0), minus(z[i], z[j]));
                others = (others.0 + d.0, others.1 + d.1);
            }
            over(newton, minus((1.0, 0.0), times(newton, others)))
        };
        let moves: Vec<Complex> = (0..m).map(move_of).collect();
        z.iter_mut().zip(&moves).for_each(|(z, w)| *z = minus(*z, *w));
        if moves.iter().all(|w| w.0.abs() + w.1.abs() < 1e-15) {
            break;
        }
    }
    z
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn products_are_the_polynomials() {
        let mut found = 0;
        for kind in [Kind::First, Kind::Second] {
            for a in [0.4, 1.5, 6.0, 24.0, 54.0] {
                for (tolerance, matched) in [(1e-1, true), (1e-2, true), (1e-4, false), (1e-8, false)] {
                    let c = coefficients::chebyshev(kind, a, tolerance, matched);
                    let Some(f) = factors(kind, &c, tolerance) else { continue };
                    found += 1;
                    assert_eq!(f.iter().map(Factor::degree).sum::<usize>(), c.len() - 1);
                    for i in 0..=999 {
                        let x = -1.0 + i as f64 / 499.5;
                        let p: f64 = f.iter().map(|f| f.value(x)).product();
                        let gap = (p - coefficients::value(kind, &c, x)).abs();
                        assert!(gap < 1e-3 * tolerance + 1e-15, "{kind:?} {a} {tolerance}: {gap:e}");
                    }
                }
            }
        }
        assert!(found >= 36, "{found} of 40");
    }

    #[test]
    fn polynomials_that_would_lose_digits_are_left_to_the_recurrence() {
        let c = coefficients::chebyshev(Kind::First, 400.0, 1e-4, false);
        assert!(factors(Kind::First, &c, 1e-4).is_none());
        let c = coefficients::chebyshev(Kind::First, 24.0, 1e-13, false);
        assert!(factors(Kind::First, &c, 1e-13).is_none());
        assert!(factors(Kind::First, &[1.0], 1e-4).is_none());
    }
}
