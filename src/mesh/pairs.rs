// SPDX-License-Identifier: MIT OR Apache-2.0
//! Laplacian rows of all cells from what each cell sees of its links (m): the same bits in both rows, nothing that
//! comes from rounding, and connected where the faces of the mesh connect. Does not know where links come from.

use super::{Link, Mesh, NONE};

/// Smaller links than this, relative to the largest of a cell, come from rounding: centres on a sphere, as on lattices.
const NOTHING: f64 = 1e-9;

/// First link of each cell, and the links: the mean of what the two cells of each see (first entry of each cell; neighbour and
/// weight, by neighbour), and what keeps the mesh connected.
pub fn both(mesh: &Mesh, start: &[usize], seen: &[(u32, f64)]) -> (Vec<u32>, Vec<Link>) {
    let n = mesh.len();
    let row = |i: usize| &seen[start[i]..start[i + 1]];
    let largest = |i: usize| row(i).iter().map(|l| l.1).fold(0.0, f64::max);
    // each pair once: (lower, higher, a)
    let mut pairs: Vec<(u32, u32, f64)> = Vec::with_capacity(seen.len() / 2);
    for i in 0..n {
        for (j, a) in row(i) {
            let back = row(*j as usize).binary_search_by_key(&(i as u32), |l| l.0);
            let other = back.map_or(0.0, |k| row(*j as usize)[k].1);
            let (low, high) = (*j.min(&(i as u32)), *j.max(&(i as u32)));
            let mean = 0.5 * (a + other);
            let first = i as u32 == low || back.is_err();
            if first && mean > NOTHING * largest(low as usize).min(largest(high as usize)) {
                pairs.push((low, high, mean));
            }
        }
    }
    let mut parts = Parts((0..n as u32).collect());
    pairs.iter().for_each(|p| {
        parts.unite(p.0, p.1);
    });
    for i in 0..n as u32 {
        let mut row = mesh.links(i as usize).iter().filter(|l| l.to > i).peekable();
        while let Some(l) = row.next() {
            // several faces between the same cells
            let mut weight = l.weight;
            while let Some(more) = row.next_if(|m| m.to == l.to) {
                weight += more.weight;
            }
            if parts.unite(i, l.to) {
                pairs.push((i, l.to, weight));
            }
        }
    }
    let mut link_start = vec![0u32; n + 1];
    for p in &pairs {
        link_start[p.0 as usize + 1] += 1;
        link_start[p.1 as usize + 1] += 1;
    }
    (0..n).for_each(|i| link_start[i + 1] += link_start[i]);
    let mut at = link_start.clone();
    let mut links = vec![Link { to: NONE, weight: 0.0 }; 2 * pairs.len()];
    for (i, j, weight) in pairs {
        for (from, to) in [(i, j), (j, i)] {
            links[at[from as usize] as usize] = Link { to, weight };
            at[from as usize] += 1;
        }
    }
    (0..n).for_each(|i| links[link_start[i] as usize..link_start[i + 1] as usize].sort_by_key(|l| l.to));
    (link_start, links)
}

/// Cells in parts that are connected: each points to one before it, the first of a part to itself.
struct Parts(Vec<u32>);

impl Parts {
    fn first(&mut self, mut i: u32) -> u32 {
        while self.0[i as usize] != i {
            self.0[i as usize] = self.0[self.0[i as usize] as usize];
            i = self.0[i as usize];
        }
        i
    }
    /// Were they apart?
    fn unite(&mut self, i: u32, j: u32) -> bool {
        let (i, j) = (self.first(i), self.first(j));
        self.0[i.max(j) as usize] = i.min(j);
        i != j
    }
}
