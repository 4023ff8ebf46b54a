// SPDX-License-Identifier: MIT OR Apache-2.0
//! What is modelled: a term whose magnitude exceeds the accuracy asked (design §2.4), and what an engineer should change.
//!
//! Reads a scene; decides nothing but by its numbers, so that a case and its recording are judged alike.

use super::{Scene, Term};
use std::fmt;

/// What `auto` makes of a term.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Choice {
    /// needed
    On,
    /// below the accuracy
    Off,
    /// needed, and this version has no such term in live runs
    Missing,
}

impl fmt::Display for Choice {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.pad(match self {
            Self::On => "on",
            Self::Off => "off",
            Self::Missing => "missing",
        })
    }
}

/// On where the magnitude exceeds `accuracy`; what has no switch stays as it is.
pub fn choose(t: &Term, accuracy: f64) -> Choice {
    match (t.relative > accuracy || t.relative.is_nan(), t.on, t.now) {
        (true, _, true) | (true, Some(_), _) => Choice::On,
        (true, None, false) => Choice::Missing,
        (false, ..) if t.now && t.off.is_none() => Choice::On,
        (false, ..) => Choice::Off,
    }
}

/// Share of the accuracy below which a term that is on is switched off: between the two nothing changes, so that a magnitude
/// about the accuracy does not switch to and fro.
pub const OFF_BELOW: f64 = 1.0 / 3.0;

/// Is a term on, of this magnitude now and on or off before? What cannot be told stays.
pub fn hysteresis(on: bool, relative: f64, accuracy: f64) -> bool {
    let small = relative < OFF_BELOW * accuracy;
    if on { !small } else { relative > accuracy }
}

/// Share of a cell's solids that the smoothing moves out of it; `bandwidth` and `cell` (size) in m.
pub fn smoothed_share(bandwidth: f64, cell: f64) -> f64 {
    (1.5 * (bandwidth / cell).powi(2)).min(1.0)
}

/// Adds the smoothing itself: the share of a cell's solids that leaves it, 6 T/h² with T = b²/4.
pub fn smoothing(s: &mut Scene, now: bool) {
    if s.cell_size.is_empty() || s.bandwidth <= 0.0 {
        return;
    }
    let relative = smoothed_share(s.bandwidth, s.cell_size.mean);
    s.terms.push(Term {
        name: "smoothing",
        relative,
        to: "solids of a cell",
        how: "6 T/h2, T = b2/4",
        now,
        on: Some("smooth.method = \"gaussian\""),
        off: Some("smooth.method = \"none\""),
    });
}

/// What may go wrong or could be cheaper, each with what to type.
pub fn advice(s: &Scene, accuracy: f64) -> Vec<String> {
    let mut list = Vec::new();
    for t in &s.terms {
        let size = format!("{} is {:.1e} of {}", t.name, t.relative, t.to);
        match (choose(t, accuracy), t.now) {
            (Choice::On, false) => {
                list.push(format!("{size}, and is off: {}", t.on.unwrap_or("it has no key")));
            }
            (Choice::Missing, _) => {
                list.push(format!(
                    "{size}: this version has no such term in live runs; expect an error of that size"
                ));
            }
            (Choice::Off, true) => {
                if let Some(off) = t.off {
                    list.push(format!(
                        "{size}, below the accuracy of {accuracy:.0e}: it could be off ({off})"
                    ));
                }
            }
            _ => {}
        }
    }
    let tau = if s.relaxation.is_empty() { s.stokes_time() } else { s.relaxation.mean };
    if s.explicit && s.period > tau {
        list.push(format!(
            "the fluid step is {:.1} tau_p: explicit coupling is unstable; coupling.scheme = \"conservative\"",
            s.period / tau
        ));
    } else if s.period > 10.0 * tau {
        list.push(format!(
            "the fluid reacts about {:.0} steps late (step / tau_p): coupling.scheme = \"conservative-adaptive\" or a shorter step where transients matter",
            s.period / tau
        ));
    }
    if let Some(t) = s.fluid_relaxation.filter(|t| s.explicit && s.period > *t) {
        list.push(format!(
            "the fluid step is {:.1} tau_f: explicit coupling may be unstable; coupling.scheme = \"conservative\"",
            s.period / t
        ));
    }
    if let Some(t) = s.courant_time().filter(|t| s.period > *t) {
        list.push(format!(
            "Courant number {:.2} (R eq. 11: below 0.5): deltaT {t:.1e} and coupling.interval with it",
            0.5 * s.period / t
        ));
    }
    if s.dem_step > tau {
        list.push(format!(
            "the DEM step is longer than tau_p = {tau:.1e} s: dem.time_step = {:.0e}",
            0.2 * tau
        ));
    }
    let (h, d, b) = (s.cell_size, s.diameter.mean, s.bandwidth);
    if !h.is_empty() {
        let noise = s.solid_fraction_seen.mean * (h.mean / d).powi(3) * 6.0 / std::f64::consts::PI;
        if !s.smoothed && h.mean < 3.0 * d {
            list.push(format!(
                "cells of {:.1} diameters without smoothing: the voidage of a cell jumps with each particle ({noise:.1} in a cell); smooth.method = \"gaussian\", smooth.bandwidth = {:.1e}",
                h.mean / d,
                4.0 * d
            ));
        }
    }
    if s.smoothed && b < 2.0 * d {
        list.push(format!(
            "the bandwidth is {:.1} diameters: the voidage follows single particles; smooth.bandwidth = {:.1e}",
            b / d,
            4.0 * d
        ));
    }
    if s.solid_fraction_cells.max > 0.7 {
        list.push(format!(
            "a cell has a solid fraction of {:.2}, above close packing: larger cells or bandwidth",
            s.solid_fraction_cells.max
        ));
    }
    list
}
