// SPDX-License-Identifier: MIT OR Apache-2.0
//! `voidage bench`: what the coupling step costs and how exact it is, on scenes made here.

pub mod gauss;
pub mod grid;
pub mod memory;
pub mod plot;
pub mod report;
pub mod scaling;
pub mod scene;
pub mod smoother;
pub mod step;
pub mod triad;
