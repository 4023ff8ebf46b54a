// SPDX-License-Identifier: MIT OR Apache-2.0
//! What a coupling step is told (`Setup`), what it hands out (`Sources`, `Drive`), and why it cannot be done.
//!
//! SI units; no behaviour.

use crate::forces::history::Memory;
use crate::forces::{DragLaw, Extra};
use crate::interpolate::FluidVelocity;
use crate::scheme::Scheme;
use crate::smooth::TimeAverage;
use thiserror::Error;

/// What is computed and how; fixed for a run, but for the forces that `auto` switches.
pub struct Setup {
    /// type-A drag law
    pub drag: &'static dyn DragLaw,
    /// prediction of the impulse
    pub scheme: &'static dyn Scheme,
    /// interpolation of the fluid velocity that enters the drag
    pub fluid_velocity: FluidVelocity,
    /// model B: drag divided by the voidage, no pressure-gradient force
    pub model_b: bool,
    /// false: the fluid does not feel the particles
    pub two_way: bool,
    /// −V G(∇p − ∇·τ) acts on the particles
    pub pressure_force: bool,
    /// acceleration of the Archimedes force −ρ_f V g, m/s2 (zero: off)
    pub archimedes: [f64; 3],
    /// mean pressure gradient acting on particles (model A), Pa/m
    pub mean_pressure_gradient: [f64; 3],
    /// acceleration of the particles' weight, m/s2: a known part of what moves them
    pub gravity: [f64; 3],
    /// ε_s U_s is formed each step: the fluid's continuity asks for it
    pub solids_flux: bool,
    /// ρ_f, kg/m3
    pub density: f64,
    /// ν, m2/s
    pub kinematic_viscosity: f64,
    /// coupling period Δt, s
    pub period: f64,
    /// smallest voidage let through; 0: stop the run at ε ≤ 0
    pub voidage_min: f64,
    /// leave particles outside the mesh out instead of stopping
    pub exclude_outside: bool,
    /// forces beside these, and the coarse-graining ratio
    pub extra: Extra,
    /// running mean of ε_s
    pub average: Option<TimeAverage>,
}

/// Why a step cannot be done.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum StepError {
    /// A particle has no host cell.
    #[error(
        "particle {id} at {position:?} m is outside the mesh{near}: where particles leave (an outlet: LIGGGHTS \
         removes them a little later) or touch a curved wall the mesh cuts short, set limits.outside = \"exclude\"; else keep the DEM box inside the CFD mesh (`voidage check`)"
    )]
    Outside {
        /// particle id
        id: i64,
        /// m
        position: [f64; 3],
        /// nearest patch, if known
        near: String,
    },
    /// No fluid left in a cell.
    #[error(
        "voidage {voidage:.4} in cell {cell} (centre {centre:?} m): raise smooth.bandwidth, use larger cells, or set \
         limits.voidage_min to cap it (counted)"
    )]
    NoFluid {
        /// global cell id
        cell: i64,
        /// its centre, m
        centre: [f64; 3],
        /// ε
        voidage: f64,
    },
    /// The scheme needs what the DEM did not send.
    #[error(
        "coupling.scheme = \"{0}\" needs what the particles did in their last interval, and the DEM did not send it: \
         build the fix anew (`./setup build`), or set coupling.scheme = \"conservative\""
    )]
    NoHistory(&'static str),
    /// A force needs what the DEM did not send.
    #[error("{key} needs {what}, and the DEM did not send it: build the fix anew (`./setup build`)")]
    NotSent {
        /// key of the case
        key: &'static str,
        /// array
        what: &'static str,
    },
    /// A parcel of a type without ratio.
    #[error(
        "particle {id} is of type {kind}, for which dem.coarse_graining gives no ratio; add `{kind} = 1.0` to it"
    )]
    NoRatio {
        /// particle id
        id: i64,
        /// its type
        kind: i64,
    },
    /// A number that is not one.
    #[error(
        "{what} is not a finite number in cell {cell} (centre {centre:?} m): the fluid solver has gone wrong"
    )]
    NotFinite {
        /// which field
        what: &'static str,
        /// global cell id
        cell: i64,
        /// its centre, m
        centre: [f64; 3],
    },
}

/// Voidage and sources of the coming fluid step, by cell slot.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Sources {
    /// ε at the end of the step
    pub voidage: Vec<f64>,
    /// ε at its start
    pub voidage_old: Vec<f64>,
    /// ε_s U_s, m/s
    pub solids_flux: Vec<[f64; 3]>,
    /// momentum exchange coefficient, kg/(m3 s)
    pub sp: Vec<f64>,
    /// N/m3
    pub su: Vec<[f64; 3]>,
}

/// What drives the particles for the next interval, in the order `before_fluid` brought `Particles` into.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Drive {
    /// K, kg/s
    pub drag_coefficient: Vec<f64>,
    /// u, m/s
    pub velocity: Vec<[f64; 3]>,
    /// f, N
    pub force: Vec<[f64; 3]>,
    /// impulse charged to the fluid, N s
    pub charged: Vec<[f64; 3]>,
    /// added mass of each particle, kg; empty if it is C_a ρ V of the run, as the next ones if they are off
    pub added_mass: Vec<f64>,
    /// K_ω, N m s
    pub rotation_coefficient: Vec<f64>,
    /// W = ½ ∇ × U, rad/s
    pub rotation_rate: Vec<[f64; 3]>,
    /// to be kept with the particle
    pub memory: Vec<Memory>,
}

/// The fluid at the end of its step, by cell slot.
#[derive(Clone, Debug, Default)]
pub struct Fluid {
    /// U, m/s
    pub velocity: Vec<[f64; 3]>,
    /// ∇p of the last velocity correction, Pa/m; empty if not asked for
    pub pressure_gradient: Vec<[f64; 3]>,
    /// ∇·τ as put into the matrix, N/m3; empty if not asked for
    pub stress_divergence: Vec<[f64; 3]>,
}

/// Counts and errors of the step at hand.
#[derive(Clone, Copy, Debug, Default)]
#[allow(missing_docs)]
pub struct Facts {
    pub solid_fraction_max: f64,
    pub solid_volume_error: f64,
    pub solid_momentum_error: f64,
    pub capped_volume: f64,
    pub excluded: u64,
    pub positive_redone: u64,
}

/// Wall time of the stages of the last step, s.
#[derive(Clone, Copy, Debug, Default)]
#[allow(missing_docs)]
pub struct Seconds {
    pub locate: f64,
    pub arrange: f64,
    pub map: f64,
    pub solids: f64,
    pub forces: f64,
    pub sources: f64,
    pub gather: f64,
    pub drive: f64,
}
