// SPDX-License-Identifier: MIT OR Apache-2.0
//! Which rows a sweep must visit: cells within m faces of an occupied cell. A polynomial of degree m reaches no
//! further, so empty regions cost nothing, exactly.

use crate::mesh::Mesh;

/// Rows to visit, ascending.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Active {
    /// cell slots
    pub rows: Vec<u32>,
    reached: Vec<bool>,
    ring: Vec<u32>,
    next: Vec<u32>,
}

impl Active {
    /// Every cell.
    pub fn whole(mesh: &Mesh) -> Self {
        Self { rows: (0..mesh.len() as u32).collect(), ..Self::default() }
    }
    /// Cells within `degree` faces of the occupied ones.
    pub fn update(&mut self, mesh: &Mesh, occupied: &[u32], degree: usize) {
        self.reached.clear();
        self.reached.resize(mesh.len(), false);
        self.ring.clear();
        for c in occupied {
            if !std::mem::replace(&mut self.reached[*c as usize], true) {
                self.ring.push(*c);
            }
        }
        for _ in 0..degree {
            self.next.clear();
            for c in &self.ring {
                for l in mesh.links(*c as usize) {
                    if !std::mem::replace(&mut self.reached[l.to as usize], true) {
                        self.next.push(l.to);
                    }
                }
            }
            std::mem::swap(&mut self.ring, &mut self.next);
        }
        self.rows.clear();
        self.rows.extend(self.reached.iter().enumerate().filter(|r| *r.1).map(|r| r.0 as u32));
    }
}
