// SPDX-License-Identifier: MIT OR Apache-2.0
//! `voidage tune`: what each setting costs and how exact it is, measured on the user's own recording, and the cheapest
//! settings that are exact enough.
//!
//! Reads a recording; writes errors (relative) and CPU times (ms per exchange). `settings` lists the candidates, `search`
//! goes through them, `measure` replays one, `model` has the particles' exact Gaussians, `estimate` what is only estimated,
//! `table` prints. Two errors, kept apart: *numerical*, against the exact operator on the same deposit, which smoother and
//! tolerance answer for, and *model*, of the solid fraction against the exact Gaussians, which mapping and mesh answer for.
//! docs/tune.md defines every number.

pub mod estimate;
pub mod measure;
pub mod model;
mod search;
pub mod settings;
pub mod table;

use crate::record::effect::{Error, Errors};
use crate::record::moment::Moments;
use crate::record::replay::{ReplayError, case};
use measure::{Bench, Open};
use model::Scene;
use search::Search;
use serde::Serialize;
use settings::{Part, Settings};
use std::io::{Read, Seek};
pub use table::Table;

/// What is asked.
#[derive(Clone, Debug)]
pub struct Ask<'a> {
    /// settings other than the recorded ones, of all candidates
    pub base: &'a [(String, String)],
    /// largest numerical error, relative in L2
    pub accuracy: f64,
    /// the last exchanges of the recording are replayed
    pub exchanges: usize,
    /// what is varied; empty: everything
    pub only: Vec<Part>,
}

/// A candidate as measured.
#[derive(Clone, Debug, Serialize)]
pub struct Point {
    /// what was set
    pub settings: Settings,
    /// against the exact operator on the same deposit
    pub numerical: Errors,
    /// the largest of its three L2 errors
    pub error: f64,
    /// of the solid fraction against the exact Gaussians, these settings; none where there are none
    pub model: Option<Error>,
    /// the same of the exact operator: what the mapping answers for
    pub model_of_mapping: Option<Error>,
    /// CPU time of the coupler per exchange, ms; median
    pub ms: f64,
    /// exchanges replayed
    pub exchanges: usize,
    /// exchanges of them redone with the positive smoother
    pub redone: u64,
    /// keeps volume and the third law to rounding
    pub conservative: bool,
    /// no other with the same interpolation is as cheap and as exact in both ways
    pub front: bool,
    /// those of the case
    pub recorded: bool,
    #[serde(skip)]
    seconds: Vec<f64>,
}

/// The part of the accuracy that is used: the exchanges to come are not those measured.
pub const MARGIN: f64 = 0.8;
/// A mapping may be this much worse than that of the case, in the model error.
const NO_WORSE: f64 = 1.02;
/// Times nearer than this are the same: what another run on this machine would tell otherwise.
const TIE: f64 = 1.03;

/// Measures all candidates on the last exchanges of a recording; `say` is told what is under way.
pub fn tune<R: Read + Seek + 'static>(
    open: Open<R>,
    ask: &Ask,
    say: &mut dyn FnMut(&str),
) -> Result<Table, ReplayError> {
    let config = case(&open()?, ask.base)?;
    let scene = Scene::last(Moments::new(open()?)?)?;
    say("the exact Gaussians of the particles");
    let mut search = Search {
        bench: Bench::new(open, ask.base, ask.exchanges)?,
        exact: scene.gaussian(&config),
        case: Settings::of(&config, &scene.mesh),
        config,
        scene,
        points: Vec::new(),
        skipped: Vec::new(),
        say,
    };
    search.run(ask)?;
    let estimates = search.estimates()?;
    Table::new(ask, search, estimates)
}

/// The cheapest settings whose numerical error is within the accuracy (with `MARGIN`), the most exact of those as cheap.
/// Among those that are no worse otherwise than the case: its interpolation, a mapping no farther from the Gaussians, the
/// third law if it has it.
pub fn choose(points: &[Point], accuracy: f64) -> Option<&Point> {
    let case = points.iter().find(|p| p.recorded)?;
    let as_good = |p: &&Point| {
        let mapping = match (p.model_of_mapping, case.model_of_mapping) {
            (Some(p), Some(c)) => p.l2 <= NO_WORSE * c.l2,
            _ => p.settings.mapping == case.settings.mapping,
        };
        mapping
            && p.settings.interpolation == case.settings.interpolation
            && (p.conservative || !case.conservative)
            && p.error <= MARGIN * accuracy
    };
    let cheapest = points.iter().filter(as_good).map(|p| p.ms).fold(f64::INFINITY, f64::min);
    // a looser accuracy adds candidates with larger errors only: it never chooses dearer ones
    let as_cheap = points.iter().filter(as_good).filter(|p| p.ms <= TIE * cheapest);
    as_cheap.min_by(|a, b| a.error.total_cmp(&b.error))
}
