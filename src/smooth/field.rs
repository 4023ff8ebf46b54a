// SPDX-License-Identifier: MIT OR Apache-2.0
//! Cell fields whose cells begin on cache lines: eight lanes of f64 are one line of 64 bytes. A plain `Vec`
//! starts 16 bytes into a line, so that every cell would touch two.

use crate::step::Lanes;
use std::ops::{Deref, DerefMut};

/// Lanes of all cells, aligned to 64 bytes; used like a slice.
#[derive(Debug, Default)]
pub struct Field {
    data: Vec<f64>,
    offset: usize,
    cells: usize,
}

impl Field {
    /// Zero in every cell.
    pub fn zero(cells: usize) -> Self {
        let data = vec![0.0; 8 * cells + 7];
        // usize::MAX is allowed by `align_offset`: then unaligned, slower, same numbers
        let offset = Some(data.as_ptr().align_offset(64)).filter(|o| *o < 8).unwrap_or(0);
        Self { data, offset, cells }
    }
    /// Resizes if needed; the content is then zero.
    pub fn fit(&mut self, cells: usize) {
        if self.cells != cells {
            *self = Self::zero(cells);
        }
    }
}

impl Clone for Field {
    fn clone(&self) -> Self {
        let mut new = Self::zero(self.cells);
        new.copy_from_slice(self);
        new
    }
}

impl Deref for Field {
    type Target = [Lanes];
    fn deref(&self) -> &[Lanes] {
        self.data[self.offset..self.offset + 8 * self.cells].as_chunks::<8>().0
    }
}

impl DerefMut for Field {
    fn deref_mut(&mut self) -> &mut [Lanes] {
        self.data[self.offset..self.offset + 8 * self.cells].as_chunks_mut::<8>().0
    }
}

/// Memory a smoother works in, lent by the caller: two fields, 128 bytes per cell.
#[derive(Clone, Debug, Default)]
pub struct Scratch {
    pub(super) a: Field,
    pub(super) b: Field,
}

impl Scratch {
    /// For a mesh of so many cells; grows when first used if it does not fit.
    pub fn new(cells: usize) -> Self {
        Self { a: Field::zero(cells), b: Field::zero(cells) }
    }
    /// Makes it fit.
    pub fn fit(&mut self, cells: usize) {
        self.a.fit(cells);
        self.b.fit(cells);
    }
}
