// SPDX-License-Identifier: MIT OR Apache-2.0
//! Weights of a mapping, and what is done with them: deposit and gather, adjoint to each other.
//!
//! Particle i goes to cell k by m_ik, Σ_k m_ik = 1. Reads and writes cell fields of eight lanes; does not know
//! what they mean nor where the weights come from. All particles of the mapping are stored in one of three ways, by what
//! is least to read: wholly in their host cells; between eight centres of a block; or cell by cell.

use super::linear::{Fraction, Rings};
use super::near::{Lines, Part};
use super::{lists, near};
use crate::arrange::{Order, Piece};
use crate::mesh::{Mesh, NONE};
use crate::smooth::Real;
use crate::step::Lanes;
use crate::threads;
use std::ops::Range;
use std::sync::Arc;

/// Particles whose numbers stay in the nearest cache.
pub const BATCH: usize = 256;

/// Weights of all particles: particle i goes to `cell[k]` by `weight[k]`, k from `start[i]` to `start[i+1]`; or,
/// with `start` and `weight` empty, all by their host `cell[i]` (`NONE`: to none): wholly, or with those around (`near`).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Weights {
    /// first entry of each particle; one more at the end
    pub start: Vec<u32>,
    /// cell slots
    pub cell: Vec<u32>,
    /// m_ik
    pub weight: Vec<f64>,
    /// the cells around the host, and where each particle lies between the centres (`Rings::eight`)
    pub(super) near: Option<(Arc<Rings>, Vec<Fraction>)>,
    /// cells around the occupied ones, where `near` is used
    pub(super) around: Vec<u32>,
    /// lowest and highest cell that each piece of the particles goes to, if it may be another's
    pub(super) span: Vec<(u32, u32)>,
}

impl Weights {
    /// Every particle in one cell?
    #[inline(always)]
    fn whole(&self) -> bool {
        self.start.is_empty() && self.near.is_none()
    }
    /// (cell, m) of particle i, for those stored cell by cell.
    #[inline(always)]
    pub(super) fn entries(&self, i: usize) -> impl Iterator<Item = (u32, f64)> + '_ {
        let range = self.start[i] as usize..self.start[i + 1] as usize;
        self.cell[range.clone()].iter().copied().zip(self.weight[range].iter().copied())
    }
    /// (cell, m_ik) of particle i.
    pub fn of(&self, i: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
        let mut list = Vec::with_capacity(8);
        match &self.near {
            _ if !self.start.is_empty() => list.extend(self.entries(i)),
            _ if self.cell[i] == NONE => (),
            Some((rings, fraction)) => {
                let (cell, m) = rings.eight(self.cell[i], fraction[i]);
                list.extend(cell.into_iter().zip(m).filter(|e| e.1 > 0.0));
            }
            None => list.push((self.cell[i], 1.0)),
        }
        list.into_iter().map(|(cell, m)| (cell as usize, m))
    }
    /// Once the weights are complete: what deposits and smoothers want to know of them beforehand.
    pub fn survey(&mut self, order: &Order) {
        self.span.clear();
        let whole = self.whole();
        let Self { start, cell, near, around, span, .. } = self;
        if let Some((rings, _)) = near {
            rings.around(&order.occupied, around);
        }
        if whole || threads::count() == 1 {
            return;
        }
        let (start, cell, near) = (&*start, &*cell, &*near);
        *span = threads::map(order.pieces.iter().collect(), |p| match near {
            Some((rings, _)) => rings.span(&order.occupied[p.cells.clone()]),
            None => {
                let entries = start[p.particles.start] as usize..start[p.particles.end] as usize;
                cell[entries].iter().fold((NONE, 0), |(l, h), c| (l.min(*c), h.max(*c)))
            }
        });
    }
    /// Cells that particles go to, with repetitions; `occupied` are their host cells. After `survey`.
    pub fn reached<'a>(&'a self, occupied: &'a [u32]) -> &'a [u32] {
        match &self.near {
            Some(_) => &self.around,
            None if self.whole() => occupied,
            None => &self.cell,
        }
    }
    /// Adds Σ_i m_ik q_i / V_k to each cell, particle by particle in their order; the table must lie in it. `quantity`
    /// also gets what its piece of the particles adds up; returned by piece.
    ///
    /// Every thread writes cells of its own. Where particles go to several cells, those around a thread's cells are looked at
    /// by both threads, so that every cell gets its sum in the order of the particles.
    pub fn deposit<A: Default + Send>(
        &self,
        mesh: &Mesh,
        order: &Order,
        lanes: &mut [Lanes],
        quantity: impl Fn(usize, &mut A) -> Lanes + Sync,
    ) -> Vec<A> {
        let pieces = &order.pieces;
        // runs of pieces, one per thread; pieces of others that reach into the cells of a run are looked at too
        let runs: Vec<Range<usize>> = if self.whole() {
            (0..pieces.len()).map(|k| k..k + 1).collect()
        } else {
            let cut = |n: usize| {
                let first = |k: usize| pieces.partition_point(|p| p.particles.start < k * order.inside / n);
                (0..n).map(|k| first(k)..first(k + 1)).filter(|r| !r.is_empty()).collect::<Vec<_>>()
            };
            let many = cut(if self.span.is_empty() { 1 } else { threads::count() });
            let work: usize = many.iter().map(|r| self.meeting(pieces, r).count()).sum();
            // where cells that touch are far apart in the list, threads would do each other's work
            if work * 2 > 3 * pieces.len() { cut(1) } else { many }
        };
        let parts = threads::cut(lanes, runs.iter().map(|r| pieces[r.end - 1].slots.end));
        let sums = threads::map(runs.into_iter().zip(parts).collect(), |(run, part)| {
            let slots = pieces[run.start].slots.start..pieces[run.end - 1].slots.end;
            let (mut sums, mut batch) = (Vec::with_capacity(run.len()), Lines([[0.0; 8]; BATCH]));
            for k in self.meeting(pieces, &run) {
                let (piece, mut all) = (&pieces[k], A::default());
                for at in piece.particles.clone().step_by(BATCH) {
                    let batch = &mut batch.0[..BATCH.min(piece.particles.end - at)];
                    batch.iter_mut().enumerate().for_each(|(k, q)| *q = quantity(at + k, &mut all));
                    self.add(at, batch, Part { volume: &mesh.volume, from: slots.start, cells: part });
                }
                if run.contains(&k) {
                    sums.push(all);
                }
            }
            sums
        });
        sums.into_iter().flatten().collect()
    }
    /// The pieces of a run, and those of others that go to its cells.
    fn meeting<'a>(&'a self, pieces: &'a [Piece], run: &'a Range<usize>) -> impl Iterator<Item = usize> + 'a {
        let slots = pieces[run.start].slots.start..pieces[run.end - 1].slots.end;
        let meets = move |k: &usize| {
            let (low, high) = self.span[*k];
            run.contains(k) || ((low as usize) < slots.end && high as usize >= slots.start)
        };
        let (alone, all) = if self.span.is_empty() { (run.clone(), 0..0) } else { (0..0, 0..pieces.len()) };
        alone.chain(all.filter(meets))
    }
    /// `deposit` of the particles from `first` on.
    fn add(&self, first: usize, q: &[Lanes], part: Part) {
        let range = first..first + q.len();
        match &self.near {
            Some((rings, fraction)) => {
                let (host, fraction) = (&self.cell[range.clone()], &fraction[range]);
                f64::dispatch(near::Add { rings, host, fraction, q, part });
            }
            None if self.whole() => {
                f64::dispatch(lists::AddWhole { host: &self.cell[range], q, part });
            }
            None => f64::dispatch(lists::Add { weights: self, first, q, part }),
        }
    }
    /// Σ_k m_ik φ_k of the particles from `first` on, all with a host.
    pub fn gather(&self, lanes: &[Lanes], first: usize, out: &mut [Lanes]) {
        let range = first..first + out.len();
        match &self.near {
            Some((rings, fraction)) => {
                let (host, fraction) = (&self.cell[range.clone()], &fraction[range]);
                f64::dispatch(near::Gather { rings, host, fraction, lanes, out });
            }
            None if self.whole() => {
                out.iter_mut().zip(&self.cell[range]).for_each(|(to, c)| *to = lanes[*c as usize]);
            }
            None => f64::dispatch(lists::Gather { weights: self, first, lanes, out }),
        }
    }
    /// Σ_k m_ik φ_k of particle i.
    pub fn gather_one(&self, lanes: &[Lanes], i: usize) -> Lanes {
        let mut out = [[0.0; 8]];
        self.gather(lanes, i, &mut out);
        out[0]
    }
}
