// SPDX-License-Identifier: MIT OR Apache-2.0
//! What `voidage tune` found, for people and as JSON: all candidates, the choice, the case section that sets it.
//!
//! Reads a finished search; writes text. Times in ms of CPU per exchange, errors relative. Does not measure.

use super::estimate::Estimates;
use super::search::Search;
use super::settings::Settings;
use super::{Ask, MARGIN, Point, choose};
use crate::config::Config;
use crate::record::effect::Error;
use crate::record::replay::ReplayError;
use serde::Serialize;
use std::fmt::{self, Write};
use std::io::{Read, Seek};

/// All that was measured.
#[derive(Clone, Debug, Serialize)]
pub struct Table {
    /// program version
    pub version: &'static str,
    /// largest numerical error asked for, relative in L2
    pub accuracy: f64,
    /// particles of the last exchange
    pub particles: usize,
    /// cells of the mesh
    pub cells: usize,
    /// smooth.bandwidth, m
    pub bandwidth: f64,
    /// run.threads
    pub threads: u32,
    /// how the exact Gaussians were found, or why there are none
    pub gaussian: String,
    /// by time, ascending
    pub points: Vec<Point>,
    /// settings that were not measured, and why
    pub skipped: Vec<(String, String)>,
    /// the cheapest that are exact enough
    pub chosen: Option<Point>,
    /// one-step defects, estimated
    pub estimates: Estimates,
    /// the case section of the chosen settings
    pub section: Option<String>,
    /// print all candidates, not only the front
    #[serde(skip)]
    pub all: bool,
}

impl Table {
    pub(super) fn new<R: Read + Seek>(
        ask: &Ask,
        s: Search<R>,
        estimates: Estimates,
    ) -> Result<Self, ReplayError> {
        let chosen = choose(&s.points, ask.accuracy).cloned();
        let section = chosen.as_ref().map(|p| section(p, ask.accuracy, &s.config)).transpose()?;
        Ok(Self {
            version: env!("CARGO_PKG_VERSION"),
            accuracy: ask.accuracy,
            particles: s.scene.particles.len(),
            cells: s.scene.mesh.len(),
            bandwidth: s.config.file.smooth.bandwidth,
            threads: s.config.file.run.threads,
            gaussian: s.exact.map_or_else(|why| why, |e| e.1.into()),
            points: s.points,
            skipped: s.skipped,
            chosen,
            estimates,
            section,
            all: false,
        })
    }
}

/// The chosen settings as sections of case.toml.
fn section(p: &Point, accuracy: f64, c: &Config) -> Result<String, ReplayError> {
    let text = p.settings.section(c).map_err(|e| ReplayError::Run(e.to_string()))?;
    Ok(format!(
        "# voidage tune --accuracy {accuracy:e}: numerical error {:.1e}, about {:.3} ms of CPU per exchange\n{text}",
        p.error, p.ms
    ))
}

fn row(f: &mut impl Write, mark: char, p: &Point) -> fmt::Result {
    let model = |e: Option<Error>| e.map_or_else(|| "-".into(), |e| format!("{:.2e}", e.l2));
    let n = &p.numerical;
    write!(
        f,
        "{mark} {} {:9.3}  {:8.1e} {:8.1e} {:8.1e} {:8.1e}  {:>8} {:>8}",
        p.settings.name(),
        p.ms,
        n.voidage.l2,
        n.force.l2,
        n.source.l2,
        n.max(),
        model(p.model_of_mapping),
        model(p.model),
    )?;
    let note = [
        (p.recorded, "the case".to_string()),
        (!p.conservative, "third law not to rounding".to_string()),
        (p.redone > 0, format!("{} redone", p.redone)),
    ];
    for (_, text) in note.iter().filter(|n| n.0) {
        write!(f, "  {text}")?;
    }
    writeln!(f)
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        writeln!(
            f,
            "{} particles, {} cells, b = {:e} m, {} thread{}; exact Gaussians: {}",
            self.particles,
            self.cells,
            self.bandwidth,
            self.threads,
            if self.threads == 1 { "" } else { "s" },
            self.gaussian
        )?;
        writeln!(
            f,
            "  {:53} {:>9}  {:35}  model error L2",
            "settings", "CPU ms", "numerical error (L2, largest)"
        )?;
        writeln!(
            f,
            "  {:18} {:10} {:16} {:>6} {:>9}  {:>8} {:>8} {:>8} {:>8}  {:>8} {:>8}",
            "mapping",
            "velocity",
            "smoother",
            "tol.",
            "/exchange",
            "voidage",
            "force",
            "source",
            "max",
            "mapping",
            "all"
        )?;
        let is = |p: &Point, s: &Option<Point>| s.as_ref().is_some_and(|c| c.settings == p.settings);
        for p in &self.points {
            let chosen = is(p, &self.chosen);
            if self.all || p.front || p.recorded || chosen {
                row(
                    f,
                    if chosen {
                        '>'
                    } else if p.front {
                        '*'
                    } else {
                        ' '
                    },
                    p,
                )?;
            }
        }
        let left = self.points.iter().filter(|p| !p.front && !p.recorded).count();
        writeln!(f, "> chosen, * on the front of time and both errors for its interpolation")?;
        if !self.all && left > 0 {
            writeln!(f, "{} candidates measured, those off the front are shown by --all", self.points.len())?;
        }
        for (what, why) in &self.skipped {
            let what: Vec<&str> = what.split_whitespace().collect();
            writeln!(f, "not measured: {}: {why}", what.join(" "))?;
        }
        self.estimates_to(f)?;
        match &self.chosen {
            Some(p) => {
                writeln!(
                    f,
                    "cheapest within {:e} (used to {MARGIN}): predicted {:.3} ms of CPU per exchange without output, \
                     numerical error {:.1e} in L2, {:.1e} at most",
                    self.accuracy,
                    p.ms,
                    p.error,
                    p.numerical.max()
                )?;
                write!(f, "\n{}", self.section.as_deref().unwrap_or_default())
            }
            None => writeln!(
                f,
                "no settings reach {:e} (used to {MARGIN}) without being worse than the case otherwise; the most exact: {}",
                self.accuracy,
                self.best().map_or_else(String::new, |s| s.name())
            ),
        }
    }
}

impl Table {
    fn best(&self) -> Option<&Settings> {
        self.points.iter().min_by(|a, b| a.error.total_cmp(&b.error)).map(|p| &p.settings)
    }

    fn estimates_to(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let e = &self.estimates;
        if e.schemes.is_empty() {
            return writeln!(f, "estimates: none, the exchanges recorded do not follow each other");
        }
        writeln!(f, "estimates, of one step with the recorded particles and fluid:")?;
        let schemes: Vec<String> = e
            .schemes
            .iter()
            .map(|s| {
                let defect = s.defect.map_or_else(|| "not recorded for it".into(), |d| format!("{d:.1e}"));
                format!("{} {defect}", s.scheme)
            })
            .collect();
        writeln!(f, "  impulse charged against impulse taken: {}", schemes.join(", "))?;
        for i in &e.intervals {
            writeln!(
                f,
                "  interval x {}: what is held changes by {:.1e} (voidage), {:.1e} (force), {:.1e} (source)",
                i.multiple, i.defect.voidage.l2, i.defect.force.l2, i.defect.source.l2
            )?;
        }
        Ok(())
    }
}
