// SPDX-License-Identifier: MIT OR Apache-2.0
//! Replies side by side, array by array: bit for bit, and how far apart.
//!
//! Reads the replies of an exchange in one order (`moment`); sums differences over exchanges. Units: those of the arrays.

use super::RecordError;
use super::moment::{DRIVE, Messages, SOURCES};
use std::collections::BTreeMap;
use std::fmt;
use voidage_wire::{field, kind};

/// The coupler's replies of one exchange; cells by slot, particles by id.
#[derive(Clone, Debug, PartialEq)]
pub struct Replies {
    k: i64,
    ids: Vec<i64>,
    cells: usize,
    arrays: BTreeMap<u32, Vec<f64>>,
}

impl Replies {
    /// From the messages of an exchange; `slots`: cells of each CFD rank, `n` cells in all.
    pub fn of(m: &Messages, slots: &[Vec<u32>], n: usize) -> Result<Self, RecordError> {
        let p = m.particles()?;
        let mut arrays = m.cell_arrays(slots, n)?;
        arrays.append(&mut m.particle_arrays(&p)?);
        Ok(Self { k: m.k, ids: p.id, cells: n, arrays })
    }
}

/// How one array differs.
#[derive(Clone, Debug, Default)]
pub struct Difference {
    /// exchanges compared
    pub exchanges: u64,
    /// numbers compared
    pub values: u64,
    /// numbers whose bits differ
    pub differing: u64,
    /// largest difference
    pub largest: f64,
    /// where: exchange, cell slot or particle id
    pub place: Option<(i64, i64)>,
    squares: f64,
    scale: f64,
    greatest: f64,
}

impl Difference {
    /// √(Σ difference² / Σ reference²); 0/0 = 0.
    pub fn relative(&self) -> f64 {
        crate::balance::ratio(self.squares, self.scale).sqrt()
    }
    /// Largest difference / largest reference value; 0/0 = 0.
    pub fn relative_largest(&self) -> f64 {
        crate::balance::ratio(self.largest, self.greatest)
    }
    pub(super) fn add(&mut self, got: &[f64], due: &[f64], k: i64, place: impl Fn(usize) -> i64) {
        self.exchanges += 1;
        self.values += got.len() as u64;
        for (i, (a, b)) in got.iter().zip(due).enumerate() {
            self.scale += b * b;
            self.greatest = self.greatest.max(b.abs());
            if a.to_bits() == b.to_bits() {
                continue;
            }
            self.differing += 1;
            let gap = (a - b).abs();
            self.squares += gap * gap;
            if gap > self.largest || self.place.is_none() || gap.is_nan() {
                (self.largest, self.place) = (gap, Some((k, place(i))));
            }
        }
    }
}

/// Differences of all arrays over all exchanges.
#[derive(Clone, Debug, Default)]
pub struct Comparison {
    /// by array
    pub arrays: BTreeMap<u32, Difference>,
    /// arrays that only one of the two has
    pub alone: BTreeMap<u32, &'static str>,
    /// exchanges compared
    pub exchanges: u64,
    /// exchanges that only one of the two has
    pub unmatched: u64,
}

impl Comparison {
    /// Adds an exchange; `due` is the reference.
    pub fn add(&mut self, got: &Replies, due: &Replies) -> Result<(), RecordError> {
        let fail = |what: String| RecordError::Content { k: got.k, what };
        if got.cells != due.cells {
            return Err(fail(format!("{} cells, the other has {}: another mesh", got.cells, due.cells)));
        }
        if got.ids != due.ids {
            let what = "the particles are not those of the other (other ids): the runs have parted";
            return Err(fail(what.into()));
        }
        self.exchanges += 1;
        for (name, a) in &got.arrays {
            let Some(b) = due.arrays.get(name).filter(|b| b.len() == a.len()) else {
                self.alone.insert(*name, "only in the first");
                continue;
            };
            let of_particles = DRIVE.iter().any(|d| d.0 == *name);
            let width = SOURCES.iter().chain(&DRIVE).find(|s| s.0 == *name).map_or(1, |s| s.1);
            let place = |i: usize| if of_particles { got.ids[i / width] } else { (i / width) as i64 };
            self.arrays.entry(*name).or_default().add(a, b, got.k, place);
        }
        for name in due.arrays.keys().filter(|n| !got.arrays.contains_key(n)) {
            self.alone.insert(*name, "only in the second");
        }
        Ok(())
    }
    /// Every number has the same bits, and neither has more than the other.
    pub fn identical(&self) -> bool {
        self.alone.is_empty() && self.unmatched == 0 && self.arrays.values().all(|d| d.differing == 0)
    }
}

/// Name and unit of an array.
pub fn name(array: u32) -> (&'static str, &'static str, &'static str) {
    match array {
        field::VOIDAGE => ("SOURCES", "voidage", ""),
        field::VOIDAGE_OLD => ("SOURCES", "voidage_old", ""),
        field::SP => ("SOURCES", "momentum_exchange_coefficient", "kg/(m3 s)"),
        field::SU => ("SOURCES", "momentum_source", "N/m3"),
        field::SOLIDS_FLUX => ("SOURCES", "solids_flux", "m/s"),
        field::DRAG_COEFFICIENT => ("DRIVE", "drag_coefficient", "kg/s"),
        field::DRIVE_VELOCITY => ("DRIVE", "fluid_velocity", "m/s"),
        field::FORCE => ("DRIVE", "force", "N"),
        field::CHARGED => ("DRIVE", "charged_impulse", "N s"),
        field::ADDED_MASS => ("DRIVE", "added_mass", "kg"),
        field::ROTATION_COEFFICIENT => ("DRIVE", "rotation_coefficient", "N m s"),
        field::ROTATION_RATE => ("DRIVE", "rotation_rate", "1/s"),
        field::MEMORY => ("DRIVE", "history_memory", ""),
        _ => ("", "?", ""),
    }
}

impl fmt::Display for Comparison {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        writeln!(
            f,
            "{:8} {:30} {:>12} {:>12} {:>12} {:>12}  largest at",
            "message", "array", "differing of", "values", "rel. L2", "rel. max"
        )?;
        for (array, d) in &self.arrays {
            let (message, name, _) = name(*array);
            let place = d.place.map(|(k, i)| {
                let what = if message == "DRIVE" { "particle" } else { "cell" };
                format!("exchange {k}, {what} {i}")
            });
            writeln!(
                f,
                "{message:8} {name:30} {:12} {:12} {:12.3e} {:12.3e}  {}",
                d.differing,
                d.values,
                d.relative(),
                d.relative_largest(),
                place.unwrap_or_else(|| "identical".into())
            )?;
        }
        for (array, whose) in &self.alone {
            let (message, name, _) = name(*array);
            writeln!(f, "{message:8} {name:30} {whose}")?;
        }
        Ok(())
    }
}

/// Is this a reply of the coupler that is compared?
pub fn is_reply(kind: u32) -> bool {
    [kind::SOURCES, kind::DRIVE].contains(&kind)
}
