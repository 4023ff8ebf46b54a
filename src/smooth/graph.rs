// SPDX-License-Identifier: MIT OR Apache-2.0
//! The operator A = −V⁻¹ L_T as rows: (A φ)_i = Σ_j a_ij (φ_i − φ_j), a_ij = T_ij |S|/(d V_i), dimensionless.
//!
//! Rows may be renumbered so that neighbours lie close in memory (reverse Cuthill–McKee); within a row the entries
//! stay in the order of the neighbours' slots, so that sums and results do not depend on it, to the bit.

use super::sweep::Real;
use crate::mesh::Mesh;

/// Rows of A in the precision of the sweeps.
#[derive(Clone, Debug)]
pub struct Rows<T> {
    /// first entry of each row; one more at the end
    pub(super) start: Vec<u32>,
    /// row of the neighbour
    pub(super) to: Vec<u32>,
    /// a_ij
    pub(super) a: Vec<T>,
}

/// The operator of one mesh and one T; shared by all smoothers of a run.
#[derive(Clone, Debug)]
pub struct Graph {
    pub(super) rows: Rows<f64>,
    /// row → slot, and slot → row; none: rows are slots
    pub(super) order: Option<[Vec<u32>; 2]>,
    /// max over links of (A_ii + A_jj), an upper bound of the spectrum
    pub spectrum: f64,
    /// max A_ii
    pub diagonal: f64,
}

/// Renumber when neighbours are this much further apart in memory than they need be.
const WORTH_IT: f64 = 2.0;

impl Graph {
    /// T per link (m2), aligned with `mesh.links`. Links with T = 0 are left out.
    pub fn new(mesh: &Mesh, diffusion: &[f64]) -> Self {
        let plain = Self::in_order(mesh, diffusion, None);
        let order = cuthill_mckee(&plain.rows);
        let row_of = inverse(&order);
        let far = |row: &dyn Fn(u32) -> u32| {
            let gap = |(i, l): (u32, u32)| f64::from(row(i).abs_diff(row(l)));
            plain.links().map(gap).sum::<f64>()
        };
        if far(&|i| i) <= WORTH_IT * far(&|i| row_of[i as usize]) {
            return plain;
        }
        Self::in_order(mesh, diffusion, Some([order, row_of]))
    }

    /// With rows in the given order (row → slot, slot → row).
    pub(super) fn in_order(mesh: &Mesh, diffusion: &[f64], order: Option<[Vec<u32>; 2]>) -> Self {
        let (slot_of, row_of) = match &order {
            Some([s, r]) => (Some(s), Some(r)),
            None => (None, None),
        };
        let (mut start, mut to, mut a) = (vec![0], Vec::new(), Vec::new());
        for row in 0..mesh.len() {
            let i = slot_of.map_or(row, |s| s[row] as usize);
            let first = mesh.link_start[i] as usize;
            for (l, t) in mesh.links(i).iter().zip(&diffusion[first..]) {
                if *t > 0.0 {
                    to.push(row_of.map_or(l.to, |r| r[l.to as usize]));
                    a.push(t * l.weight / mesh.volume[i]);
                }
            }
            start.push(to.len() as u32);
        }
        let rows = Rows { start, to, a };
        let d = rows.diagonal();
        let mut graph = Self { rows, order, spectrum: 0.0, diagonal: 0.0 };
        graph.spectrum = graph.links().map(|(i, j)| d[i as usize] + d[j as usize]).fold(0.0, f64::max);
        graph.diagonal = d.iter().copied().fold(0.0, f64::max);
        graph
    }

    /// Number of cells.
    pub fn len(&self) -> usize {
        self.rows.len()
    }
    /// No cell at all.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
    /// Rows do not follow the cells' numbers.
    pub fn renumbered(&self) -> bool {
        self.order.is_some()
    }
    pub(super) fn row(&self, slot: u32) -> u32 {
        self.order.as_ref().map_or(slot, |o| o[1][slot as usize])
    }
    pub(super) fn slot(&self, row: u32) -> u32 {
        self.order.as_ref().map_or(row, |o| o[0][row as usize])
    }
    /// (row, neighbouring row) of every entry.
    fn links(&self) -> impl Iterator<Item = (u32, u32)> + '_ {
        (0..self.len()).flat_map(|i| self.rows.entries(i).0.iter().map(move |j| (i as u32, *j)))
    }
}

impl<T: Real> Rows<T> {
    pub(super) fn len(&self) -> usize {
        self.start.len() - 1
    }
    pub(super) fn entries(&self, i: usize) -> (&[u32], &[T]) {
        let range = self.start[i] as usize..self.start[i + 1] as usize;
        (&self.to[range.clone()], &self.a[range])
    }
    /// A_ii.
    pub(super) fn diagonal(&self) -> Vec<f64> {
        (0..self.len()).map(|i| self.entries(i).1.iter().map(|a| a.to_f64()).sum()).collect()
    }
    /// The same rows in another precision.
    pub(super) fn cast<U: Real>(&self) -> Rows<U> {
        let a = self.a.iter().map(|a| U::from_f64(a.to_f64())).collect();
        Rows { start: self.start.clone(), to: self.to.clone(), a }
    }
}

fn inverse(order: &[u32]) -> Vec<u32> {
    let mut row_of = vec![0; order.len()];
    order.iter().enumerate().for_each(|(row, slot)| row_of[*slot as usize] = row as u32);
    row_of
}

/// Breadth-first levels from a peripheral cell, reversed (Cuthill & McKee 1969; George 1971): row → slot.
fn cuthill_mckee(rows: &Rows<f64>) -> Vec<u32> {
    let n = rows.len();
    let degree = |i: u32| rows.start[i as usize + 1] - rows.start[i as usize];
    let mut order: Vec<u32> = Vec::with_capacity(n);
    let mut seen = vec![false; n];
    let mut level = Vec::new();
    for seed in 0..n as u32 {
        if seen[seed as usize] {
            continue;
        }
        // twice: the last cell reached from the seed is at the rim of its part of the mesh
        let begin = order.len();
        let mut root = seed;
        for round in 0..2 {
            for i in order.drain(begin..) {
                seen[i as usize] = false;
            }
            order.push(root);
            seen[root as usize] = true;
            let mut at = begin;
            while at < order.len() {
                level.clear();
                level.extend(rows.entries(order[at] as usize).0.iter().filter(|j| !seen[**j as usize]));
                level.sort_by_key(|j| (degree(*j), *j));
                level.dedup();
                for j in &level {
                    seen[*j as usize] = true;
                    order.push(*j);
                }
                at += 1;
            }
            if round == 0 {
                root = order[order.len() - 1];
            }
        }
    }
    order.reverse();
    order
}
