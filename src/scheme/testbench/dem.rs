// SPDX-License-Identifier: MIT OR Apache-2.0
//! The particle side of the bench: velocity Verlet with the fluid force, as `liggghts-fix/fix_voidage.cpp` does it.
//!
//! K (u − v) + f with the current v in each DEM step, explicit for K δt/m ≤ 0.2, else exact relaxation. The impulse
//! taken sums the half kicks, the ledger is taken − charged. Held particles do not move; what holds them is external.

use crate::particles::{Asked, Particles, Totals};
use crate::scheme::History;
use crate::step::Drive;

type V = [f64; 3];
const EXPLICIT_LIMIT: f64 = 0.2;

/// Particles and what drives them.
pub struct Dem {
    pub position: Vec<V>,
    pub velocity: Vec<V>,
    pub mass: Vec<f64>,
    pub radius: f64,
    /// weight, m/s2
    pub gravity: V,
    pub held: Vec<bool>,
    /// positions are integrated
    pub moves: bool,
    /// impulse of the last interval, N s
    pub taken: Vec<V>,
    drive: Drive,
    start: Vec<V>,
    force: Vec<V>,
}

impl Dem {
    pub fn new(
        position: Vec<V>,
        velocity: Vec<V>,
        mass: Vec<f64>,
        radius: f64,
        gravity: V,
        moves: bool,
    ) -> Self {
        let n = mass.len();
        let zero = vec![[0.0; 3]; n];
        let drive = Drive {
            drag_coefficient: vec![0.0; n],
            velocity: zero.clone(),
            force: zero.clone(),
            charged: zero.clone(),
            ..Drive::default()
        };
        let (held, taken) = (vec![false; n], zero.clone());
        Self {
            position,
            velocity,
            mass,
            radius,
            gravity,
            held,
            moves,
            taken,
            drive,
            start: zero.clone(),
            force: zero,
        }
    }

    fn ledger(&self, i: usize) -> V {
        [0, 1, 2].map(|a| self.taken[i][a] - self.drive.charged[i][a])
    }

    /// The message of this exchange.
    pub fn message(&mut self) -> Particles {
        let n = self.mass.len();
        let history = History {
            impulse: self.taken.clone(),
            drag_coefficient: self.drive.drag_coefficient.clone(),
            drive: self.drive.velocity.clone(),
            force: self.drive.force.clone(),
            velocity: std::mem::replace(&mut self.start, self.velocity.clone()),
        };
        Particles {
            id: (0..n as i64).collect(),
            origin: (0..n as u32).map(|i| (0, i)).collect(),
            position: self.position.clone(),
            velocity: self.velocity.clone(),
            radius: vec![self.radius; n],
            mass: self.mass.clone(),
            asked: Asked::default(),
            ledger: (0..n).map(|i| self.ledger(i)).collect(),
            history,
            totals: Totals::default(),
        }
    }

    /// Σ L, N s.
    pub fn ledgers(&self) -> V {
        crate::sums::sum3((0..self.mass.len()).map(|i| self.ledger(i)))
    }

    fn fluid_force(&self, i: usize, kick: f64, step: f64) -> V {
        let (m, k, v, d) = (self.mass[i], self.drive.drag_coefficient[i], self.velocity[i], &self.drive);
        let (u, f) = (d.velocity[i], d.force[i]);
        if k * step / m <= EXPLICIT_LIMIT || self.held[i] {
            return [0, 1, 2].map(|a| k * (u[a] - v[a]) + f[a]);
        }
        let rate = -m / kick * (-k * kick / m).exp_m1();
        let weight = self.gravity.map(|g| m * g);
        [0, 1, 2].map(|a| rate * (u[a] + (weight[a] + f[a]) / k - v[a]) - weight[a])
    }

    /// One interval of `n` steps of `step` s, driven by `drive`.
    pub fn interval(&mut self, drive: &Drive, n: usize, step: f64) {
        self.drive.clone_from(drive);
        self.taken.fill([0.0; 3]);
        let half = 0.5 * step;
        for i in 0..self.mass.len() {
            if self.held[i] {
                self.velocity[i] = [0.0; 3];
            }
            self.force[i] = self.fluid_force(i, half, step);
            for _ in 0..n {
                self.kick(i, half);
                if self.moves {
                    (0..3).for_each(|a| self.position[i][a] += step * self.velocity[i][a]);
                }
                let next = self.fluid_force(i, step, step);
                (0..3).for_each(|a| self.taken[i][a] += half * (self.force[i][a] + next[a]));
                self.force[i] = next;
                self.kick(i, half);
            }
        }
    }

    fn kick(&mut self, i: usize, half: f64) {
        if !self.held[i] {
            let (m, f) = (self.mass[i], self.force[i]);
            (0..3).for_each(|a| self.velocity[i][a] += half * (f[a] / m + self.gravity[a]));
        }
    }
}
