// SPDX-License-Identifier: MIT OR Apache-2.0
//! How much the most unstable disturbance of a frozen scene grows per exchange: power iteration on the difference of two
//! exchanges.
//!
//! Reads states of `frozen`; writes |λ|, the largest modulus among the eigenvalues of the exchange's linearisation. Does not
//! know schemes or time steps.

use super::frozen::{Frozen, State};
use crate::bench::scene;
use crate::scheme::History;
use crate::step::StepError;

/// Size of the disturbance ÷ size of the state: small against any curvature, large against rounding.
const SMALL: f64 = 1e-6;
/// Exchanges at most; the growth is the mean over the second half.
const EXCHANGES: usize = 240;
/// Exchanges over which the growth is compared.
const WINDOW: usize = 24;

/// `to` + `factor` × (`a` − `b`), field by field.
fn combine(to: &State, factor: f64, a: &State, b: &State) -> State {
    let v = |t: &[[f64; 3]], x: &[[f64; 3]], y: &[[f64; 3]]| {
        let one = |((t, x), y): ((&[f64; 3], &[f64; 3]), &[f64; 3])| {
            [0, 1, 2].map(|k| t[k] + factor * (x[k] - y[k]))
        };
        t.iter().zip(x).zip(y).map(one).collect::<Vec<_>>()
    };
    let s = |t: &[f64], x: &[f64], y: &[f64]| {
        t.iter().zip(x).zip(y).map(|((t, x), y)| t + factor * (x - y)).collect::<Vec<_>>()
    };
    let (h, x, y) = (&to.history, &a.history, &b.history);
    State {
        fluid: v(&to.fluid, &a.fluid, &b.fluid),
        before: v(&to.before, &a.before, &b.before),
        velocity: v(&to.velocity, &a.velocity, &b.velocity),
        ledger: v(&to.ledger, &a.ledger, &b.ledger),
        history: History {
            impulse: v(&h.impulse, &x.impulse, &y.impulse),
            drag_coefficient: s(&h.drag_coefficient, &x.drag_coefficient, &y.drag_coefficient),
            drive: v(&h.drive, &x.drive, &y.drive),
            force: v(&h.force, &x.force, &y.force),
            velocity: v(&h.velocity, &x.velocity, &y.velocity),
        },
    }
}

/// A state of zeros like `s`.
fn blank(s: &State) -> State {
    let v = |x: &Vec<[f64; 3]>| vec![[0.0; 3]; x.len()];
    let h = &s.history;
    State {
        fluid: v(&s.fluid),
        before: v(&s.before),
        velocity: v(&s.velocity),
        ledger: v(&s.ledger),
        history: History {
            impulse: v(&h.impulse),
            drag_coefficient: vec![0.0; h.drag_coefficient.len()],
            drive: v(&h.drive),
            force: v(&h.force),
            velocity: v(&h.velocity),
        },
    }
}

/// Largest |λ| of one exchange around `base`. Momentum the exchange keeps (λ = 1) is taken out of the disturbance.
pub fn growth(f: &mut Frozen, base: &State) -> Result<f64, StepError> {
    let image = f.exchange(base)?;
    let size = f.size(base).max(f.mass().sqrt() * 1e-3) * SMALL;
    let mut d = blank(base);
    // every cell another direction: all modes are in it
    let mut seed = 1u64;
    let mut random = || 2.0 * scene::random(&mut seed) - 1.0;
    d.fluid.iter_mut().for_each(|u| *u = [(); 3].map(|()| random()));
    if !f.held() {
        d.velocity.iter_mut().for_each(|u| *u = [(); 3].map(|()| random()));
        let shift = f.momentum(&d).map(|m| m / f.mass());
        for u in d.fluid.iter_mut().chain(&mut d.velocity) {
            (0..3).for_each(|a| u[a] -= shift[a]);
        }
    }
    let none = blank(base);
    let (mut sum, mut counted, mut last) = (0.0, 0, f64::NAN);
    let mut window = 0.0;
    let mut length = f.size(&d);
    for k in 0..EXCHANGES {
        let moved = combine(base, size / length, &d, &none);
        d = combine(&none, 1.0, &f.exchange(&moved)?, &image);
        let next = f.size(&d);
        if next <= 0.0 || !next.is_finite() {
            return Ok(if next == 0.0 { 0.0 } else { f64::INFINITY });
        }
        let rate = (next / size).ln();
        length = next;
        window += rate;
        if k >= EXCHANGES / 2 {
            sum += rate;
            counted += 1;
        }
        if (k + 1) % WINDOW == 0 {
            let mean = window / WINDOW as f64;
            if k > 3 * WINDOW && (mean - last).abs() < 1e-4 {
                return Ok(mean.exp());
            }
            (last, window) = (mean, 0.0);
        }
    }
    Ok((sum / f64::from(counted)).exp())
}
