// SPDX-License-Identifier: MIT OR Apache-2.0
//! Which rows a sweep must visit. A polynomial of degree m reaches no further than m faces from an occupied cell:
//! sweep k of a spread fills the first k rings around the occupied cells, sweep k of a gather needs the last
//! m − k; the rest costs nothing, exactly.
//!
//! Rows are visited in blocks. The rings start one face outside the occupied cells and are kept until a particle
//! leaves that margin; any larger set gives the same bits.

use super::graph::Graph;

/// Rows per block: long enough for straight loops, short enough to follow a curved bed.
pub(super) const BLOCK: usize = 32;
/// Beyond every ring.
pub(super) const FAR: u16 = u16::MAX;
/// Faces around the occupied cells within which particles may move before the rings are computed again.
const MARGIN: usize = 1;
/// Uses before the rings are computed again all the same, for a bed that shrinks.
const KEEP: u32 = 64;

/// Distance of each block of rows from the occupied cells.
#[derive(Clone, Debug, Default)]
pub struct Active {
    /// smallest ring of a block's rows
    pub(super) blocks: Vec<u16>,
    rings: Vec<u16>,
    front: Vec<u32>,
    next: Vec<u32>,
    reach: usize,
    uses: u32,
    /// slots of all rows that are visited, ascending; nothing else is written
    pub rows: Vec<u32>,
    /// how often the rings were computed
    pub computed: u64,
}

impl Active {
    /// Every cell.
    pub fn whole(cells: usize) -> Self {
        Self { blocks: vec![0; cells.div_ceil(BLOCK)], rows: (0..cells as u32).collect(), ..Self::default() }
    }

    /// The occupied cells alone: nothing is smoothed.
    pub fn only(&mut self, occupied: &[u32]) {
        self.rows.clear();
        self.rows.extend_from_slice(occupied);
        self.rows.sort_unstable();
        self.rows.dedup();
    }

    /// Rings around the occupied cells (slots, in any order, repeated or not) up to `reach`; none: every cell.
    pub fn update(&mut self, graph: &Graph, occupied: &[u32], reach: Option<usize>) {
        let n = graph.len();
        let Some(reach) = reach.filter(|r| *r < usize::from(FAR) - 1) else {
            if self.rows.len() != n || !self.rings.is_empty() {
                *self = Self { computed: self.computed, ..Self::whole(n) };
            }
            return;
        };
        let current = self.rings.len() == n && self.reach == reach && self.uses < KEEP;
        if current && occupied.iter().all(|c| self.rings[graph.row(*c) as usize] == 0) {
            self.uses += 1;
            return;
        }
        self.computed += 1;
        (self.reach, self.uses) = (reach, 0);
        self.rings.clear();
        self.rings.resize(n, FAR);
        self.front.clear();
        for c in occupied {
            let row = graph.row(*c);
            if std::mem::replace(&mut self.rings[row as usize], 0) == FAR {
                self.front.push(row);
            }
        }
        // one ring more than is reached: its zeros are read
        for ring in 1..=reach + 1 + MARGIN {
            let ring = ring.saturating_sub(MARGIN) as u16;
            self.next.clear();
            for i in &self.front {
                for j in graph.rows.entries(*i as usize).0 {
                    let at = &mut self.rings[*j as usize];
                    if *at == FAR {
                        *at = ring;
                        self.next.push(*j);
                    }
                }
            }
            std::mem::swap(&mut self.front, &mut self.next);
        }
        let nearest = |b: &[u16]| b.iter().copied().min().unwrap_or(FAR);
        self.blocks.clear();
        self.blocks.extend(self.rings.chunks(BLOCK).map(nearest));
        self.rows.clear();
        for b in 0..self.blocks.len() {
            if usize::from(self.blocks[b]) > reach {
                continue;
            }
            for i in b * BLOCK..n.min((b + 1) * BLOCK) {
                self.rows.push(graph.slot(i as u32));
                // also the far rows of a block read zeros around them
                for j in graph.rows.entries(i).0 {
                    let at = &mut self.blocks[*j as usize / BLOCK];
                    *at = (*at).min(reach as u16 + 1);
                }
            }
        }
        if graph.renumbered() {
            self.rows.sort_unstable();
        }
    }

    /// Rows in blocks not further than `ring`.
    pub fn rows_within(&self, ring: usize, cells: usize) -> usize {
        let rows = |(b, r): (usize, &u16)| {
            if usize::from(*r) <= ring { BLOCK.min(cells - b * BLOCK) } else { 0 }
        };
        self.blocks.iter().enumerate().map(rows).sum()
    }
}
