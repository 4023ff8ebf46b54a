// SPDX-License-Identifier: MIT OR Apache-2.0
//! A coarse grid over the mesh, about one bin per cell: where to look for a place.
//!
//! Reads cells (m); does not know particles.

use crate::mesh::Mesh;

/// Bins over the box around the mesh; places outside belong to the nearest one.
#[derive(Clone, Debug)]
pub struct Bins {
    lower: [f64; 3],
    size: [f64; 3],
    count: [usize; 3],
}

impl Bins {
    /// About one per cell.
    pub fn new(mesh: &Mesh) -> Self {
        let [lower, upper] = mesh.bounds;
        let extent = [0, 1, 2].map(|a| (upper[a] - lower[a]).max(f64::MIN_POSITIVE));
        let size = (extent.iter().product::<f64>() / mesh.len() as f64).cbrt();
        let count = extent.map(|e| ((e / size).round() as usize).clamp(1, 1000));
        Self { lower, size: [0, 1, 2].map(|a| extent[a] / count[a] as f64), count }
    }
    /// Number of bins.
    pub fn len(&self) -> usize {
        self.count.iter().product()
    }
    /// The bin of a place.
    pub fn of(&self, x: [f64; 3]) -> usize {
        self.number(self.along(x))
    }
    fn along(&self, x: [f64; 3]) -> [usize; 3] {
        [0, 1, 2].map(|a| (((x[a] - self.lower[a]) / self.size[a]) as usize).min(self.count[a] - 1))
    }
    fn number(&self, i: [usize; 3]) -> usize {
        (i[2] * self.count[1] + i[1]) * self.count[0] + i[0]
    }
}

/// The cells of each bin, ascending: 8 to 30 entries of 4 bytes per cell.
#[derive(Clone, Debug)]
pub struct Lists {
    start: Vec<u32>,
    cells: Vec<u32>,
}

impl Lists {
    /// Cells whose box, grown by `margin` (in cube roots of their volume), meets the bin.
    pub fn new(mesh: &Mesh, bins: &Bins, margin: f64) -> Self {
        let ranges = |cell: usize| {
            let [low, high] = mesh.bounds_of(cell);
            let grow = margin * mesh.volume[cell].cbrt();
            [bins.along(low.map(|x| x - grow)), bins.along(high.map(|x| x + grow))]
        };
        let each = |cell: usize, f: &mut dyn FnMut(usize)| {
            let [low, high] = ranges(cell);
            for k in low[2]..=high[2] {
                for j in low[1]..=high[1] {
                    (low[0]..=high[0]).for_each(|i| f(bins.number([i, j, k])));
                }
            }
        };
        let mut start = vec![0u32; bins.len() + 1];
        (0..mesh.len()).for_each(|c| each(c, &mut |b| start[b + 1] += 1));
        (0..bins.len()).for_each(|b| start[b + 1] += start[b]);
        let (mut next, mut cells) = (start.clone(), vec![0; start[bins.len()] as usize]);
        for c in 0..mesh.len() {
            each(c, &mut |b| {
                cells[next[b] as usize] = c as u32;
                next[b] += 1;
            });
        }
        Self { start, cells }
    }
    /// Cells of a bin.
    pub fn of(&self, bin: usize) -> &[u32] {
        &self.cells[self.start[bin] as usize..self.start[bin + 1] as usize]
    }
}
