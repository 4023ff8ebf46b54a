// SPDX-License-Identifier: MIT OR Apache-2.0
//! The drag laws, one file per family; `all` is their list. Written in C_d |u_r| so that nothing divides by the slip.
//!
//! Reads one `Slip` (SI units), some also `Around`; writes K (kg/s), type A. Where another code differs from the
//! publication, the law follows the publication and a variant named after that code follows the code.

mod cello;
mod factor;
mod filtered;
mod gidaspow;
mod power;
mod single;

pub use cello::Cello;
pub use factor::{Beetstra, BeetstraPoly, KochHill, Tang, Tenneti};
pub use filtered::BeetstraFiltered;
pub use gidaspow::{Blended, Ergun, Gidaspow, WenYu};
pub use power::{DiFelice, DiFeliceTang, Rong};
pub use single::{NoCorrection, NoDrag, SchillerNaumann, Stokes, SyamlalOBrien};

use super::{DragLaw, Slip};

/// Keeps logarithms and negative powers finite; far below any physical value.
const SMALL: f64 = 1e-15;

/// x^p for x ≥ 0, p > 0, in half the time of `powf`; 0^p = 0.
#[inline]
fn power(x: f64, p: f64) -> f64 {
    (p * x.ln()).exp()
}

/// K of many particles by `law(slip, of_voidage)`, `f` computed only where the voidage changes: particles come by
/// cell, and in a cell the voidage is the same unless the mapping interpolates it.
#[inline]
fn by_voidage<F: Copy>(slips: &[Slip], out: &mut [f64], f: impl Fn(f64) -> F, law: impl Fn(&Slip, F) -> f64) {
    let mut last: Option<(f64, F)> = None;
    for (s, k) in slips.iter().zip(out) {
        let known = last.filter(|l| l.0 == s.voidage).map_or_else(|| f(s.voidage), |l| l.1);
        last = Some((s.voidage, known));
        *k = law(s, known);
    }
}

/// What a law may be given in `[forces]`; the defaults are those of the publications.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DragOptions {
    /// Gidaspow: sphericity of the particles
    pub sphericity: f64,
    /// Gidaspow: voidage at which Ergun ends and Wen & Yu begins
    pub switch_voidage: f64,
    /// filtered law: primary diameter, m
    pub filter_diameter: f64,
    /// filtered law: particle density, kg/m3
    pub filter_density: f64,
    /// filtered law: ρ_f, kg/m3
    pub density: f64,
    /// filtered law: ν, m2/s
    pub kinematic_viscosity: f64,
    /// filtered law: k of the parcel correction exp(k (1 − ratio)); 0: off
    pub parcel_factor: f64,
    /// coarse-graining ratio
    pub ratio: f64,
}

impl Default for DragOptions {
    fn default() -> Self {
        Self {
            sphericity: 1.0,
            switch_voidage: 0.8,
            filter_diameter: 1e-4,
            filter_density: 2500.0,
            density: 1.2,
            kinematic_viscosity: 1.5e-5,
            parcel_factor: 0.0,
            ratio: 1.0,
        }
    }
}

/// All laws, with the options' defaults.
pub fn all() -> &'static [&'static dyn DragLaw] {
    &[
        &Stokes,
        &SchillerNaumann,
        &DiFelice,
        &Rong,
        &DiFeliceTang { cfdem: false },
        &DiFeliceTang { cfdem: true },
        &Gidaspow { sphericity: 1.0, switch_voidage: 0.8, newton: false },
        &Blended,
        &Gidaspow { sphericity: 1.0, switch_voidage: 0.8, newton: true },
        &Ergun,
        &WenYu,
        &Beetstra { cpl: false },
        &Beetstra { cpl: true },
        &BeetstraPoly,
        &BeetstraFiltered::PLAIN,
        &KochHill,
        &Tenneti { nga2: false },
        &Tenneti { nga2: true },
        &Tang,
        &Cello,
        &SyamlalOBrien,
        &NoCorrection,
        &NoDrag,
    ]
}

/// The law of that name with its options. A law lives as long as the program: one is made per run.
pub fn build(name: &str, o: &DragOptions) -> Option<&'static dyn DragLaw> {
    let (sphericity, switch_voidage) = (o.sphericity, o.switch_voidage);
    match name {
        "gidaspow" => Some(Box::leak(Box::new(Gidaspow { sphericity, switch_voidage, newton: false }))),
        "ergun-wen-yu" => Some(Box::leak(Box::new(Gidaspow { sphericity, switch_voidage, newton: true }))),
        "beetstra-filtered" => Some(Box::leak(Box::new(BeetstraFiltered::new(o)))),
        _ => all().iter().copied().find(|l| l.name() == name),
    }
}
