// SPDX-License-Identifier: MIT OR Apache-2.0
//! The operator A = −V⁻¹ L_T as rows: (A φ)_i = Σ_j a_ij (φ_i − φ_j), a_ij = T_ij |S|/(d V_i), dimensionless.
//!
//! Rows may be renumbered so that neighbours lie close in memory (reverse Cuthill–McKee); within a row the entries
//! stay in the order of the neighbours' slots, so that sums and results do not depend on it, to the bit.

use super::Active;
use super::active::BLOCK;
use super::real::Real;
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
    /// A_ii = Σ_j a_ij
    pub(super) d: Vec<T>,
    /// lines and the rest, without a gap
    pub(super) runs: Vec<Run>,
    /// run of the first row of each block
    pub(super) first_run: Vec<u32>,
    /// largest distance of a neighbour, rows
    pub(super) width: usize,
    /// where rows lie in layers of `width` rows, as in a block of hexahedra: largest distance of a neighbour in the same layer;
    /// else 0
    pub(super) within: usize,
    /// mean size of a row, bytes
    pub(super) bytes: usize,
}

/// Most neighbours of a row in a line.
pub(super) const LINE: usize = 6;
/// Shorter lines are not worth their own loop.
const SHORTEST: usize = 8;

/// Rows that follow each other: a line of hexahedra whose neighbours all stand at the same distances, or others.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Run {
    /// row after the last
    pub end: u32,
    /// entries per row; 0: not a line
    pub entries: u8,
    /// which entry is the row before; the next one is the row after
    pub west: u8,
    /// neighbour − row, per entry
    pub offsets: [i32; LINE],
}

impl Run {
    /// Bytes that so many of its rows with so many neighbours in all take, in numbers of so many bytes.
    fn bytes(&self, rows: usize, entries: usize, size: usize) -> usize {
        let index = if self.entries > 0 { 0 } else { 4 };
        (size + index) * (rows + entries)
    }
}

/// Kinds of lines for which there is a loop (entries, west): inside a block of hexahedra, on one of its sides, in a plane.
const LINES: [(u8, u8); 4] = [(6, 2), (5, 2), (5, 1), (4, 1)];

/// The runs of all rows.
fn runs(start: &[u32], to: &[u32]) -> Vec<Run> {
    let rows = start.len() - 1;
    let line_of = |i: usize| -> Option<Run> {
        let to = &to[start[i] as usize..start[i + 1] as usize];
        let mut run = Run { end: i as u32 + 1, entries: to.len() as u8, ..Run::default() };
        if to.len() > LINE {
            return None;
        }
        run.offsets.iter_mut().zip(to).for_each(|(o, to)| *o = (i64::from(*to) - i as i64) as i32);
        run.west = run.offsets[..to.len()].windows(2).position(|w| w == [-1, 1])? as u8;
        LINES.contains(&(run.entries, run.west)).then_some(run)
    };
    let mut runs: Vec<Run> = Vec::new();
    let other = |end: usize, runs: &mut Vec<Run>| match runs.last_mut().filter(|r| r.entries == 0) {
        Some(last) => last.end = end as u32,
        None => runs.push(Run { end: end as u32, ..Run::default() }),
    };
    let mut i = 0;
    while i < rows {
        let mut end = i + 1;
        if let Some(line) = line_of(i) {
            let same = |j: usize| line_of(j).is_some_and(|l| Run { end: line.end, ..l } == line);
            while end < rows && same(end) {
                end += 1;
            }
            if end - i >= SHORTEST {
                runs.push(Run { end: end as u32, ..line });
                i = end;
                continue;
            }
        }
        other(end, &mut runs);
        i = end;
    }
    runs
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

/// Renumber when neighbours are this much further apart in memory than they need be, and not in lines.
const WORTH_IT: f64 = 2.0;

impl Graph {
    /// T per link (m2), aligned with `mesh.links`. Links with T = 0 are left out.
    pub fn new(mesh: &Mesh, diffusion: &[f64]) -> Self {
        let plain = Self::in_order(mesh, diffusion, None);
        if plain.in_lines() > 0.5 {
            return plain;
        }
        let order = cuthill_mckee(&plain.rows);
        let row_of = inverse(&order);
        let far = |row: &dyn Fn(u32) -> u32| {
            let gap = |(i, l): (u32, u32)| f64::from(row(i).abs_diff(row(l)));
            links(&plain.rows.start, &plain.rows.to).map(gap).sum::<f64>()
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
        let rows = Rows::new(start, to, a);
        let d = &rows.d;
        let both = |(i, j): (u32, u32)| d[i as usize] + d[j as usize];
        let spectrum = links(&rows.start, &rows.to).map(both).fold(0.0, f64::max);
        let diagonal = d.iter().copied().fold(0.0, f64::max);
        Self { rows, order, spectrum, diagonal }
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
    /// Bytes of one sweep over the blocks up to a ring: so many fields of eight f64, and the rows (a line needs no
    /// index).
    pub fn bytes(&self, active: &Active, ring: usize, fields: usize) -> f64 {
        let (mut sum, mut run) = (0, 0);
        for (b, r) in active.blocks.iter().enumerate() {
            if usize::from(*r) > ring {
                continue;
            }
            for i in b * BLOCK..self.len().min((b + 1) * BLOCK) {
                while self.rows.runs[run].end as usize <= i {
                    run += 1;
                }
                let entries = (self.rows.start[i + 1] - self.rows.start[i]) as usize;
                sum += 64 * fields + self.rows.runs[run].bytes(1, entries, 8);
            }
        }
        sum as f64
    }
    /// Share of the rows that are in lines.
    pub fn in_lines(&self) -> f64 {
        let (mut begin, mut rows) = (0, 0);
        for r in &self.rows.runs {
            rows += if r.entries > 0 { r.end - begin } else { 0 };
            begin = r.end;
        }
        f64::from(rows) / self.len() as f64
    }
}

/// (row, neighbouring row) of every entry.
fn links<'a>(start: &'a [u32], to: &'a [u32]) -> impl Iterator<Item = (u32, u32)> + 'a {
    let row = |i: usize| to[start[i] as usize..start[i + 1] as usize].iter().map(move |j| (i as u32, *j));
    (0..start.len() - 1).flat_map(row)
}

impl<T: Real> Rows<T> {
    fn new(start: Vec<u32>, to: Vec<u32>, a: Vec<T>) -> Self {
        let runs = runs(&start, &to);
        let mut at = 0;
        let first_run = (0..start.len() - 1).step_by(BLOCK).map(|row| {
            while runs[at].end as usize <= row {
                at += 1;
            }
            at as u32
        });
        let first_run = first_run.collect();
        let own = |w: &[u32]| T::from_f64(a[w[0] as usize..w[1] as usize].iter().map(|a| a.to_f64()).sum());
        let d = start.windows(2).map(own).collect();
        let far = |(i, j): (u32, u32)| i.abs_diff(j) as usize;
        let width = links(&start, &to).map(far).max().unwrap_or(0);
        let near = || links(&start, &to).filter(|l| far(*l) < width);
        let layered = near().all(|(i, j)| i as usize / width == j as usize / width);
        let within = near().map(far).max().filter(|_| layered).unwrap_or(0);
        let (mut begin, mut bytes) = (0, 0);
        for run in &runs {
            let (end, entries) = (run.end as usize, (start[run.end as usize] - start[begin]) as usize);
            bytes += run.bytes(end - begin, entries, size_of::<T>());
            begin = end;
        }
        bytes /= begin.max(1);
        Self { start, to, a, d, runs, first_run, width, within, bytes }
    }
    /// Every row by its indices.
    #[cfg(test)]
    pub(super) fn forget_lines(&mut self) {
        self.runs = vec![Run { end: self.len() as u32, ..Run::default() }];
        self.first_run.fill(0);
    }
    pub(super) fn len(&self) -> usize {
        self.start.len() - 1
    }
    pub(super) fn entries(&self, i: usize) -> (&[u32], &[T]) {
        let range = self.start[i] as usize..self.start[i + 1] as usize;
        (&self.to[range.clone()], &self.a[range])
    }
    /// The same rows in another precision.
    pub(super) fn cast<U: Real>(&self) -> Rows<U> {
        let a = self.a.iter().map(|a| U::from_f64(a.to_f64())).collect();
        Rows::new(self.start.clone(), self.to.clone(), a)
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
