// SPDX-License-Identifier: MIT OR Apache-2.0
//! The resolved solution of the bench: fluid and particles integrated together, drag implicit in both, with steps
//! that start far below every relaxation time and grow.
//!
//! Particles keep their places, so the weights w_ij of design §2.2 are one matrix. Backward Euler, extrapolated to
//! second order (2 of half, minus 1 of whole); particle velocities are eliminated, leaving one dense system of the
//! cells. Written from the equations alone: it shares mapping and smoothing with the step, nothing else.

use super::bench::{drive, held, mesh_of};
use super::{BANDWIDTH, DENSITY, DIAMETER, Mode, PARTICLES, PERIOD, Point};
use crate::bench::scene::random;
use crate::locate::Locator;
use crate::mesh::NONE;
use crate::smooth::{self, Active, Diffusion, Direction, Scratch};

/// Growth of the steps.
const GROWTH: f64 = 1.2;

/// Mean fluid velocity ÷ U0 at the end of each step.
pub struct Resolved {
    /// from exchange 0 on
    pub mean: Vec<f64>,
}

struct System {
    /// V_j w_ij
    weight: Vec<Vec<f64>>,
    volume: Vec<f64>,
    body: Vec<f64>,
    k: f64,
    mass: Vec<f64>,
    gravity: f64,
}

#[derive(Clone)]
struct State {
    u: Vec<f64>,
    v: Vec<f64>,
}

impl Resolved {
    /// The solution at `point` (its scheme is not looked at) for `steps` steps.
    pub fn new(point: &Point, steps: usize) -> Self {
        let (system, mut s) = System::new(point);
        let fluid = system.volume.iter().sum::<f64>() * DENSITY;
        let total: f64 = system.mass.iter().sum();
        // the fastest rate there is, 1/s
        let fastest = system.mass.iter().map(|m| system.k / m).fold(0.0, f64::max) * (1.0 + total / fluid)
            + 1.0 / PERIOD;
        let mean = |s: &State| {
            let sum: f64 = s.u.iter().zip(&system.volume).map(|(u, v)| u * v).sum();
            sum / system.volume.iter().sum::<f64>()
        };
        let mut list = vec![mean(&s)];
        let mut h = 1e-3 / fastest;
        for k in 0..steps as u64 {
            let held = held(point.mode, k);
            if point.mode == Mode::RandomlyHeld {
                h = 1e-3 / fastest;
                s.v.iter_mut().zip(&held).filter(|p| *p.1).for_each(|p| *p.0 = 0.0);
            }
            let mut left = PERIOD;
            while left > 0.0 {
                let now = if h >= left { left } else { h };
                s = system.step(&s, &held, now);
                left = if h >= left { 0.0 } else { left - now };
                h = (h * GROWTH).min(PERIOD / 10.0);
            }
            list.push(mean(&s));
        }
        Self { mean: list }
    }
}

impl System {
    /// In units of U0 = 1; the same random numbers as `Bench::new`.
    fn new(point: &Point) -> (Self, State) {
        let mesh = mesh_of(point);
        let volume: f64 = mesh.volume.iter().sum();
        let mean = point.loading * DENSITY * volume / PARTICLES as f64;
        let k = point.ratio * mean / PERIOD;
        let mut seed = 5;
        let side = mesh.bounds[1][1];
        let mut place = |i: usize| {
            let x = (i as f64 + random(&mut seed)) / PARTICLES as f64;
            [x * mesh.bounds[1][0], side * random(&mut seed), side * random(&mut seed)]
        };
        let mut position: Vec<_> = (0..PARTICLES).map(&mut place).collect();
        let settles = point.mode == Mode::Settling;
        let mut spread = || if settles { 1.0 } else { 0.5 + 1.5 * random(&mut seed) };
        let spread: Vec<f64> = (0..PARTICLES).map(|_| spread()).collect();
        let whole = spread.iter().sum::<f64>() / PARTICLES as f64;
        let mass = spread.iter().map(|s| mean * s / whole).collect();

        let mut host = vec![NONE; PARTICLES];
        Locator::new(&mesh).locate(&mesh, &mut position, &mut host).expect("all are inside");
        let t = Diffusion::uniform(BANDWIDTH * DIAMETER).links(&mesh);
        let mut g = smooth::by_name("chebyshev", &mesh, &t, 1e-4).expect("a smoother of the list");
        let (whole, mut scratch) = (Active::whole(mesh.len()), Scratch::default());
        let weight: Vec<Vec<f64>> = host
            .iter()
            .map(|host| {
                let mut lanes = vec![[0.0; 8]; mesh.len()];
                lanes[*host as usize] = [1.0 / mesh.volume[*host as usize]; 8];
                g.apply(&mut lanes, &whole, Direction::Spread, &mut scratch);
                lanes.iter().zip(&mesh.volume).map(|(l, v)| l[0] * v).collect()
            })
            .collect();
        let number = |j: usize| weight.iter().map(|w| w[j]).sum::<f64>();
        let body = |j| drive(point) * number(j) * k;
        let body = (0..mesh.len()).map(body).collect();
        let gravity = if settles { -k / mean } else { 0.0 };
        let u = if point.mode == Mode::Free { 1.0 } else { 0.0 };
        let state = State { u: vec![u; mesh.len()], v: vec![0.0; PARTICLES] };
        (Self { weight, volume: mesh.volume.clone(), body, k, mass, gravity }, state)
    }

    fn step(&self, s: &State, held: &[bool], h: f64) -> State {
        let whole = self.euler(s, held, h);
        let half = self.euler(&self.euler(s, held, 0.5 * h), held, 0.5 * h);
        let mix = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| 2.0 * a - b).collect();
        State { u: mix(&half.u, &whole.u), v: mix(&half.v, &whole.v) }
    }

    /// Backward Euler: ρV (U' − U) = h [f V − Σ_i V w_i C_i (ũ'_i − v_i − g h)], C = K/(1 + K h/m), or K if held.
    fn euler(&self, s: &State, held: &[bool], h: f64) -> State {
        let n = self.volume.len();
        let mut a = vec![vec![0.0; n + 1]; n];
        for j in 0..n {
            a[j][j] = DENSITY * self.volume[j];
            a[j][n] = DENSITY * self.volume[j] * s.u[j] + h * self.body[j];
        }
        for (i, w) in self.weight.iter().enumerate() {
            let c = if held[i] { self.k } else { self.k / (1.0 + self.k * h / self.mass[i]) };
            let from = if held[i] { 0.0 } else { s.v[i] + self.gravity * h };
            for j in 0..n {
                let share = h * c * w[j];
                (0..n).for_each(|l| a[j][l] += share * w[l]);
                a[j][n] += share * from;
            }
        }
        let u = solve(a);
        let v = self.weight.iter().enumerate().map(|(i, w)| {
            let x = self.k * h / self.mass[i];
            let gathered: f64 = w.iter().zip(&u).map(|(w, u)| w * u).sum();
            if held[i] { 0.0 } else { (s.v[i] + x * gathered + self.gravity * h) / (1.0 + x) }
        });
        let v = v.collect();
        State { u, v }
    }
}

/// Gaussian elimination; symmetric positive definite, so without pivots. Last column: right-hand side.
fn solve(mut a: Vec<Vec<f64>>) -> Vec<f64> {
    let n = a.len();
    for p in 0..n {
        let (above, below) = a.split_at_mut(p + 1);
        let pivot = &above[p];
        for row in below {
            let f = row[p] / pivot[p];
            (p..=n).for_each(|c| row[c] -= f * pivot[c]);
        }
    }
    for p in (0..n).rev() {
        let done: f64 = (p + 1..n).map(|c| a[p][c] * a[c][n]).sum();
        a[p][n] = (a[p][n] - done) / a[p][p];
    }
    a.iter().map(|row| row[n]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_reaches_the_common_velocity_and_keeps_its_time() {
        let scheme = crate::scheme::by_name("conservative").unwrap();
        let point = |ratio| Point {
            scheme,
            mode: Mode::Free,
            ratio,
            loading: 3.0,
            cell: 1.0,
            steady: false,
            fixed: true,
        };
        let fast = Resolved::new(&point(1e5), 3).mean;
        assert!((fast[1] - 0.25).abs() < 1e-3, "{fast:?}");
        // held, x Z = 0.3: U = 1 − e^{−0.3 n} wherever drag and force are spread alike
        let held = Point { mode: Mode::Held, loading: 1.0, ..point(0.3) };
        let u = Resolved::new(&held, 10).mean;
        assert!((u[10] - (1.0 - f64::exp(-3.0))).abs() < 0.03, "{u:?}");
    }
}
