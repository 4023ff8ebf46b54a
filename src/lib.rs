// SPDX-License-Identifier: MIT OR Apache-2.0
//! voidage: the coupling step between a fluid and a particle program, each running on its own.
//!
//! One step, in the order of the modules: `particles` receives them, `locate` finds host cells in the
//! coupler's own `mesh`, `arrange` orders them by cell, `map` deposits, `smooth` diffuses, `interpolate` reads the fluid at the particles,
//! `forces` computes drag, `scheme` predicts and `linearise` turns it into sources; the fluid solves its
//! step; what it returns is smoothed by the same operator and drives the particles. `step` is this list.
#![forbid(unsafe_code)]

pub mod mesh;
pub mod particles;

pub mod locate;

pub mod arrange;

pub mod map;

pub mod smooth;

pub mod interpolate;

pub mod forces;

pub mod scheme;

pub mod linearise;

pub mod step;

pub mod auto;
pub mod balance;
pub mod bench;
pub mod commands;
pub mod config;
pub mod sums;
pub mod threads;

pub mod comm;
pub mod couple;
pub mod inspect;
pub mod launch;
pub mod monitor;
pub mod output;
pub mod partners;
pub mod plot;
pub mod record;
pub mod report;
pub mod setup;
pub mod stability;
pub mod tune;
