// SPDX-License-Identifier: MIT OR Apache-2.0
//! What a particle did in its last interval, as its message says: the coupler keeps nothing, so a recorded exchange
//! replays to the bit.
//!
//! Reads arrays of PARTICLES (SI); writes the drag impulse (N s), the slip at the interval's start (m/s) and the
//! mobility. Does not know cells or fluids.

use voidage_wire::{Frame, field};

type V = [f64; 3];

/// The last interval of all particles, in their order; empty arrays if the DEM was not asked for them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct History {
    /// impulse of the fluid, drag and other forces, N s
    pub impulse: Vec<V>,
    /// K that drove it, kg/s; 0: no interval behind it
    pub drag_coefficient: Vec<f64>,
    /// u that drove it, m/s
    pub drive: Vec<V>,
    /// f that drove it, N
    pub force: Vec<V>,
    /// velocity at its start, m/s
    pub velocity: Vec<V>,
}

/// The last interval of one particle.
#[derive(Clone, Copy, Debug)]
pub struct Last {
    /// K, kg/s
    pub drag_coefficient: f64,
    /// u − v at its start, m/s
    pub slip: V,
    /// impulse of the drag alone, N s
    pub drag_impulse: V,
    /// m Δv ÷ impulse of all forces but contacts: 1 free, 0 held
    pub mobility: f64,
}

impl History {
    /// Are the arrays of a history in these frames?
    pub fn in_frames(frames: &[Frame]) -> bool {
        !frames.is_empty() && frames.iter().all(|f| f.raw(field::LAST_DRAG_COEFFICIENT).is_some())
    }

    /// Is a number of particle i not finite?
    pub fn wrong(&self, i: usize) -> bool {
        let vectors = [&self.impulse, &self.drive, &self.force, &self.velocity];
        let finite = |l: &Vec<V>| l.get(i).is_none_or(|v| v.iter().all(|x| x.is_finite()));
        !(vectors.into_iter().all(finite) && self.drag_coefficient.get(i).is_none_or(|k| k.is_finite()))
    }

    /// The last interval of particle i with velocity v now (m/s); `gravity` (m/s2) acts besides the fluid.
    pub fn last(&self, i: usize, v: V, mass: f64, gravity: V, period: f64) -> Option<Last> {
        let drag_coefficient = *self.drag_coefficient.get(i)?;
        if drag_coefficient <= 0.0 {
            return None;
        }
        let (impulse, start) = (self.impulse[i], self.velocity[i]);
        let change = [0, 1, 2].map(|a| mass * (v[a] - start[a]));
        let push = [0, 1, 2].map(|a| impulse[a] + mass * gravity[a] * period);
        let dot = |p: V, q: V| p[0] * q[0] + p[1] * q[1] + p[2] * q[2];
        let square = dot(push, push);
        // nothing pushed it: whether it could have moved is unknown, and held is the safe answer
        let mobility = if square > 0.0 { (dot(change, push) / square).clamp(0.0, 1.0) } else { 0.0 };
        Some(Last {
            drag_coefficient,
            slip: [0, 1, 2].map(|a| self.drive[i][a] - start[a]),
            drag_impulse: [0, 1, 2].map(|a| impulse[a] - self.force[i][a] * period),
            mobility,
        })
    }
}
