// SPDX-License-Identifier: MIT OR Apache-2.0
//! Weights of a mapping, and what is done with them: deposit and gather, adjoint to each other.
//!
//! Particle i goes to cell k by m_ik, Σ_k m_ik = 1. Reads and writes cell fields of eight lanes; does not know
//! what they mean nor where the weights come from.

use crate::arrange::Order;
use crate::mesh::{Mesh, NONE};
use crate::step::Lanes;
use crate::threads;

/// Weights of all particles: particle i goes to `cell[k]` by `weight[k]`, k from `start[i]` to `start[i+1]`; or,
/// with `start` and `weight` empty, each wholly to its host `cell[i]` (`NONE`: to none).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Weights {
    /// first entry of each particle; one more at the end
    pub start: Vec<u32>,
    /// cell slots
    pub cell: Vec<u32>,
    /// m_ik
    pub weight: Vec<f64>,
}

impl Weights {
    /// Every particle in one cell?
    #[inline(always)]
    fn whole(&self) -> bool {
        self.start.is_empty()
    }
    /// (cell, m) of particle i, for mappings to several cells.
    #[inline(always)]
    fn entries(&self, i: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
        let range = self.start[i] as usize..self.start[i + 1] as usize;
        self.cell[range.clone()].iter().zip(&self.weight[range]).map(|(c, m)| (*c as usize, *m))
    }
    /// (cell, m_ik) of particle i.
    pub fn of(&self, i: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
        let whole = self.whole();
        let range = if whole { i..i + 1 } else { self.start[i] as usize..self.start[i + 1] as usize };
        let entry = move |k: usize| (self.cell[k], if whole { 1.0 } else { self.weight[k] });
        range.map(entry).filter(|e| e.0 != NONE).map(|e| (e.0 as usize, e.1))
    }
    /// Cells that particles go to, with repetitions; `occupied` are their host cells.
    pub fn reached<'a>(&'a self, occupied: &'a [u32]) -> &'a [u32] {
        if self.whole() { occupied } else { &self.cell }
    }
    /// Adds Σ_i m_ik q_i / V_k to each cell, particle by particle in their order; the table must lie in it. `quantity`
    /// also gets what its piece of the particles adds up; returned by piece.
    pub fn deposit<A: Default + Send>(
        &self,
        mesh: &Mesh,
        order: &Order,
        lanes: &mut [Lanes],
        quantity: impl Fn(usize, &mut A) -> Lanes + Sync,
    ) -> Vec<A> {
        if !self.whole() {
            // neighbouring pieces share cells
            let piece = |particles: std::ops::Range<usize>| {
                let mut all = A::default();
                for i in particles {
                    let q = quantity(i, &mut all);
                    for (cell, m) in self.entries(i) {
                        let (to, share) = (&mut lanes[cell], m / mesh.volume[cell]);
                        (0..8).for_each(|a| to[a] += share * q[a]);
                    }
                }
                all
            };
            return order.pieces.iter().map(|p| p.particles.clone()).map(piece).collect();
        }
        let parts = threads::cut(lanes, order.pieces.iter().map(|p| p.slots.end));
        threads::map(order.pieces.iter().zip(parts).collect(), |(piece, part)| {
            let mut all = A::default();
            for k in piece.cells.clone() {
                let (cell, mut sum) = (order.occupied[k] as usize, [0.0; 8]);
                for i in order.start[k] as usize..order.start[k + 1] as usize {
                    let q = quantity(i, &mut all);
                    (0..8).for_each(|a| sum[a] += q[a]);
                }
                let (to, v) = (&mut part[cell - piece.slots.start], mesh.volume[cell]);
                (0..8).for_each(|a| to[a] += sum[a] / v);
            }
            all
        })
    }
    /// Σ_k m_ik φ_k of particle i.
    #[inline(always)]
    pub fn gather(&self, lanes: &[Lanes], i: usize) -> Lanes {
        if self.whole() {
            return lanes[self.cell[i] as usize];
        }
        let mut sum = [0.0; 8];
        for (cell, m) in self.entries(i) {
            (0..8).for_each(|a| sum[a] += m * lanes[cell][a]);
        }
        sum
    }
}
