// SPDX-License-Identifier: MIT OR Apache-2.0
//! Weights of a mapping, and what is done with them: deposit and gather, adjoint to each other.
//!
//! Particle i goes to cell k by m_ik, Σ_k m_ik = 1. Reads and writes cell fields of eight lanes; does not know
//! what they mean nor where the weights come from.

use crate::mesh::{Mesh, NONE};
use crate::step::Lanes;

/// Weights of all particles: particle i goes to `cell[k]` by `weight[k]`, k from `start[i]` to `start[i+1]`; or,
/// with `start` and `weight` empty, each wholly to `cell[i]` (`NONE`: to none).
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
    /// Adds Σ_i m_ik q_i / V_k to each cell, particle by particle in the order given (by host cell, then id).
    #[inline(always)]
    pub fn deposit(
        &self,
        mesh: &Mesh,
        order: &[u32],
        lanes: &mut [Lanes],
        mut quantity: impl FnMut(usize) -> Lanes,
    ) {
        if !self.whole() {
            for i in order.iter().map(|i| *i as usize) {
                let q = quantity(i);
                for (cell, m) in self.entries(i) {
                    let (to, share) = (&mut lanes[cell], m / mesh.volume[cell]);
                    (0..8).for_each(|a| to[a] += share * q[a]);
                }
            }
            return;
        }
        let (mut now, mut sum) = (NONE, [0.0; 8]);
        let mut close = |cell: u32, sum: &Lanes| {
            if cell != NONE {
                let (to, v) = (&mut lanes[cell as usize], mesh.volume[cell as usize]);
                (0..8).for_each(|a| to[a] += sum[a] / v);
            }
        };
        for i in order.iter().map(|i| *i as usize) {
            if self.cell[i] != now {
                close(now, &sum);
                (now, sum) = (self.cell[i], [0.0; 8]);
            }
            let q = quantity(i);
            (0..8).for_each(|a| sum[a] += q[a]);
        }
        close(now, &sum);
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
