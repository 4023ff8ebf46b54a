// SPDX-License-Identifier: MIT OR Apache-2.0
//! Polynomials of X that approximate exp(−a (1 − X)) on −1 … 1, a = λ/2: numbers only, no mesh.

/// First or second kind of Chebyshev polynomials.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// T_k
    First,
    /// U_k
    Second,
}

/// c_k of exp(−a(1−X)) = Σ c_k T_k, c_k = (2 − δ_k0) e^{−a} I_k(a), until far below rounding.
fn series(a: f64) -> Vec<f64> {
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
    i
}

/// The polynomial's value at X = 1 and its slope there, per basis function.
fn at_one(kind: Kind, k: usize) -> (f64, f64) {
    let k = k as f64;
    match kind {
        Kind::First => (1.0, k * k),
        Kind::Second => (k + 1.0, k * (k + 1.0) * (k + 2.0) / 3.0),
    }
}

/// Coefficients 0 … m in the basis, scaled to Σ p_k(1) = 1: constants and Σ V φ are kept to rounding.
fn truncated(kind: Kind, a: f64, m: usize) -> Vec<f64> {
    let c = series(a);
    let at = |k: usize| c.get(k).copied().unwrap_or(0.0);
    let mut d: Vec<f64> = match kind {
        Kind::First => (0..=m).map(at).collect(),
        // T_k = (U_k − U_{k−2}) / 2, T_0 = U_0
        Kind::Second => (0..=m).map(|k| if k == 0 { at(0) } else { 0.5 * at(k) } - 0.5 * at(k + 2)).collect(),
    };
    let kept: f64 = d.iter().enumerate().map(|(k, d)| d * at_one(kind, k).0).sum();
    d.iter_mut().for_each(|x| *x /= kept);
    d
}

/// The polynomial at X, by Clenshaw's recurrence.
pub fn value(kind: Kind, c: &[f64], x: f64) -> f64 {
    let (mut b1, mut b2) = (0.0, 0.0);
    for c in c[1..].iter().rev() {
        (b1, b2) = (c + 2.0 * x * b1 - b2, b1);
    }
    c[0] + if kind == Kind::First { x } else { 2.0 * x } * b1 - b2
}

/// The lowest degree whose neglected terms sum to no more than the tolerance.
pub fn degree(a: f64, tolerance: f64) -> usize {
    let c = series(a);
    let (mut tail, mut m) = (0.0, c.len() - 1);
    while m > 0 && tail + c[m] <= tolerance {
        tail += c[m];
        m -= 1;
    }
    m
}

/// Coefficients of exp(−a(1−X)) to the tolerance, which is shared by the neglected terms and the scaling to 1 at
/// X = 1. `matched`: the truncated polynomial keeps the variance of the Gaussian exactly (slope a at X = 1), by a
/// slightly different a (bisection); the neglected terms alone are then as small as the tolerance.
pub fn chebyshev(kind: Kind, a: f64, tolerance: f64, matched: bool) -> Vec<f64> {
    let m = degree(a, if matched { tolerance } else { 0.5 * tolerance });
    if !matched || m == 0 {
        return truncated(kind, a, m);
    }
    let slope = |a: f64| {
        let d = truncated(kind, a, m);
        d.iter().enumerate().map(|(k, d)| d * at_one(kind, k).1).sum::<f64>()
    };
    let (mut low, mut high) = (a, a);
    while slope(high) < a && high < 4.0 * a {
        high *= 1.1;
    }
    if slope(high) < a {
        return truncated(kind, a, m); // so few terms cannot be that wide
    }
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if slope(middle) < a { low = middle } else { high = middle }
    }
    truncated(kind, high, m)
}

/// Poisson weights of mean `mean`, upper tail ≤ tolerance cut off, scaled to 1. By logarithms: e^{−mean} may
/// underflow. They are the coefficients of exp(−mean (1 − P)) in powers of P.
pub fn poisson(mean: f64, tolerance: f64) -> Vec<f64> {
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

/// Certificate: all coefficients in powers of X are positive, so that a polynomial of an entrywise non-negative X
/// is non-negative, whatever the mesh. Rounding of the conversion is bounded; what cannot be told is refused.
pub fn positive(kind: Kind, coefficients: &[f64]) -> bool {
    let m = coefficients.len() - 1;
    // integer coefficients of T_k or U_k, exact in f64 up to degree 40 or so
    let (mut before, mut now) = (vec![0.0; m + 1], vec![0.0; m + 1]);
    let (mut sum, mut size) = (vec![0.0; m + 1], vec![0.0; m + 1]);
    now[0] = 1.0;
    for (k, c) in coefficients.iter().enumerate() {
        for i in 0..=m {
            sum[i] += c * now[i];
            size[i] += (c * now[i]).abs();
        }
        let twice = if k == 0 && kind == Kind::First { 1.0 } else { 2.0 };
        let mut next: Vec<f64> = before.iter().map(|x| -x).collect();
        (0..m).for_each(|i| next[i + 1] += twice * now[i]);
        before = std::mem::replace(&mut now, next);
    }
    let rounding = 4.0 * (m as f64 + 2.0) * f64::EPSILON;
    (0..=m).all(|i| sum[i] > rounding * size[i])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_polynomials_are_exponentials_to_the_tolerance() {
        for a in [0.01, 0.8, 6.0, 24.0, 96.0, 400.0] {
            for tolerance in [1e-1, 1e-2, 1e-4, 1e-8, 1e-12] {
                for kind in [Kind::First, Kind::Second] {
                    let c = chebyshev(kind, a, tolerance, false);
                    assert!((value(kind, &c, 1.0) - 1.0).abs() < 1e-13);
                    // the second kind loses its neglected terms times their index
                    let slack = if kind == Kind::First { 2.0 } else { 3.0 * c.len() as f64 };
                    for i in 0..=400 {
                        let x = -1.0 + i as f64 / 200.0;
                        let error = (value(kind, &c, x) - f64::exp(-a * (1.0 - x))).abs();
                        assert!(error < slack * tolerance + 1e-13, "{kind:?} {a} {tolerance} {x}: {error}");
                    }
                }
            }
        }
    }

    #[test]
    fn matched_polynomials_keep_the_variance() {
        for kind in [Kind::First, Kind::Second] {
            for a in [0.8, 6.0, 24.0, 96.0] {
                let slope =
                    |c: Vec<f64>| c.iter().enumerate().map(|(k, d)| d * at_one(kind, k).1).sum::<f64>();
                let (plain, matched) =
                    (slope(chebyshev(kind, a, 1e-2, false)), slope(chebyshev(kind, a, 1e-2, true)));
                assert!((matched / a - 1.0).abs() < 1e-12, "{kind:?} {a}: {matched}");
                assert!((plain / a - 1.0).abs() > 1e-4, "{kind:?} {a}: {plain}");
            }
        }
    }

    #[test]
    fn the_certificate_holds_to_b_over_h_1_4_and_not_at_4() {
        // hexahedra: a = 1.5 (b/h)²
        for tolerance in [1e-1, 1e-2, 1e-4, 1e-8] {
            assert!(positive(Kind::First, &chebyshev(Kind::First, 2.94, tolerance, false)), "{tolerance}");
            assert!(!positive(Kind::First, &chebyshev(Kind::First, 24.0, tolerance, false)), "{tolerance}");
        }
        assert!(positive(Kind::First, &chebyshev(Kind::First, 6.0, 1e-4, false)));
    }
}
