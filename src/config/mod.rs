// SPDX-License-Identifier: MIT OR Apache-2.0
//! The case file: `raw` reads case.toml (unknown keys refused), `check` finds what cannot work.
//!
//! `foam` and `script` read the few facts needed from OpenFOAM dictionaries and scripts of the particle
//! programs in `program`. All problems are reported at once, each with where, what was given, what is accepted and what to type.
//! `folders` looks at the OpenFOAM case; `bandwidth` and `resolution` put numbers to what is too coarse.

mod bandwidth;
mod check;
pub mod foam;
mod folders;
pub mod program;
mod raw;
pub(crate) mod resolution;
pub mod script;

pub use check::{check, settings};
pub use folders::{beginning, unfit};
pub use raw::*;
use raw::{Parsed, parse};

use std::collections::BTreeSet;
use std::fmt;
use std::path::{Path, PathBuf};

/// How bad a problem is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Severity {
    /// The run would fail or be wrong.
    Error,
    /// The run works; the result may surprise.
    Warning,
    /// A number to judge the case by.
    Note,
}

/// A problem of a case.
#[derive(Clone, Debug, PartialEq)]
pub struct Problem {
    /// error or warning
    pub severity: Severity,
    /// key or file
    pub place: String,
    /// what was found
    pub given: String,
    /// what is accepted, and why
    pub accepted: String,
    /// what to type
    pub fix: String,
}

impl Problem {
    pub(crate) fn error(
        place: &str,
        given: impl fmt::Display,
        accepted: &str,
        fix: impl fmt::Display,
    ) -> Self {
        let (place, given) = (place.into(), given.to_string());
        Self { severity: Severity::Error, place, given, accepted: accepted.into(), fix: fix.to_string() }
    }
    pub(crate) fn warning(
        place: &str,
        given: impl fmt::Display,
        accepted: &str,
        fix: impl fmt::Display,
    ) -> Self {
        Self { severity: Severity::Warning, ..Self::error(place, given, accepted, fix) }
    }
    pub(crate) fn note(
        place: &str,
        given: impl fmt::Display,
        accepted: &str,
        fix: impl fmt::Display,
    ) -> Self {
        Self { severity: Severity::Note, ..Self::error(place, given, accepted, fix) }
    }
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let kind = match self.severity {
            Severity::Error => "error",
            Severity::Warning => "warning",
            Severity::Note => "note",
        };
        write!(f, "{kind}: {} = {}: {}; {}", self.place, self.given, self.accepted, self.fix)
    }
}

/// A case, read and complete; paths absolute.
#[derive(Clone, Debug)]
pub struct Config {
    /// the case folder
    pub folder: PathBuf,
    /// what case.toml says
    pub file: CaseFile,
    /// what system/controlDict says
    pub control: foam::Control,
    /// keys the user has set: in case.toml and by overrides; of a recording, by overrides alone
    pub given: BTreeSet<String>,
}

impl Config {
    /// Fluid step = coupling period, s.
    pub fn period(&self) -> f64 {
        f64::from(self.file.coupling.interval) * self.file.dem.time_step
    }
    /// The OpenFOAM case.
    pub fn fluid_case(&self) -> PathBuf {
        self.folder.join(&self.file.fluid.case)
    }
    /// The DEM script.
    pub fn script(&self) -> PathBuf {
        self.folder.join(&self.file.dem.script)
    }
    /// Fluid steps of the run.
    pub fn steps(&self) -> u64 {
        ((self.control.end - self.control.start) / self.period()).round().max(0.0) as u64
    }
}

/// Reads CASE/case.toml with overrides (`section.key`, value).
pub fn load(folder: &Path, overrides: &[(String, String)]) -> Result<Config, Vec<Problem>> {
    let file = folder.join("case.toml");
    let name = file.display().to_string();
    let text = std::fs::read_to_string(&file).map_err(|e| {
        vec![Problem::error(&name, e, "a case is a folder with a case.toml", "voidage run FOLDER")]
    })?;
    let Parsed { file, wake, given } = parse(&text, overrides).map_err(|mut p| {
        p.iter_mut().filter(|p| p.place.is_empty()).for_each(|p| p.place.clone_from(&name));
        p
    })?;
    let folder = folder.canonicalize().unwrap_or_else(|_| folder.to_path_buf());
    let control = folder.join(&file.fluid.case).join("system/controlDict");
    let read = foam::Control::read(&control).map_err(|e| {
        let fix = if control.exists() {
            "controlDict: a number, e.g. deltaT 2e-4;"
        } else {
            "set fluid.case to the OpenFOAM case (folder with system/controlDict)"
        };
        vec![Problem::error("fluid.case", file.fluid.case.display(), &e, fix)]
    })?;
    let mut config = Config { folder, file, control: read, given };
    if wake {
        config.file.smooth.bandwidth = bandwidth::from_wake(&config).map_err(|p| vec![p])?;
    }
    Ok(config)
}

/// The case of a recording: its text, with overrides; `control` as it ran. Paths lead nowhere.
pub fn recorded(
    text: &str,
    overrides: &[(String, String)],
    control: foam::Control,
) -> Result<Config, Vec<Problem>> {
    let Parsed { mut file, wake, .. } = parse(text, overrides)?;
    let given: BTreeSet<String> = overrides.iter().map(|o| o.0.clone()).collect();
    if let Some(auto) = &mut file.auto {
        // what is set for the replay stays so
        auto.live.retain(|key| !given.contains(key));
    }
    if wake {
        let fix = "smooth.bandwidth = 0.0048";
        return Err(vec![Problem::error("smooth.bandwidth", "wake", "a number in m for a recording", fix)]);
    }
    Ok(Config { folder: PathBuf::new(), file, control, given })
}
