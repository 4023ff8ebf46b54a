// SPDX-License-Identifier: MIT OR Apache-2.0
//! `voidage report`: one page (HTML) about a run: what it was, whether its books closed, where the time went, what the voidage
//! looked like, which terms matter, and what tuning and stability found.
//!
//! Reads rows of the monitor, settings, a measured scene and pictures; writes text that needs no network and no script.
//! Computes nothing.

pub mod charts;
pub mod html;
pub mod slice;

use crate::config::Config;
use crate::inspect::Scene;
use crate::monitor::Row;
use crate::stability::Growth;
use slice::Slice;

/// Growth by scheme, and named time scales (s).
pub type Stability = (Vec<Growth>, Vec<(String, f64)>);

/// Everything the page tells.
pub struct Content<'a> {
    /// name of the run
    pub title: String,
    /// settings
    pub config: &'a Config,
    /// case.toml as it ran
    pub settings: String,
    /// monitor
    pub rows: Vec<Row>,
    /// numbers and terms of the scene, and the accuracy they are compared with
    pub scene: Option<(Scene, f64)>,
    /// exchange, time (s), largest solid fraction, pictures
    pub slices: Option<(i64, f64, f64, Vec<Slice>)>,
    /// what `voidage stability` found
    pub stability: Option<Stability>,
    /// what `voidage tune` wrote
    pub tune: Option<serde_json::Value>,
}
