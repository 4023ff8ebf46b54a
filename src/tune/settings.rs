// SPDX-License-Identifier: MIT OR Apache-2.0
//! The settings that are tried: every mapping, interpolation, smoother and tolerance the case file knows.
//!
//! Reads the lists of implementations (`map::all`, `smooth::NAMES`, `FluidVelocity::NAMES`) and asks them what they keep;
//! writes overrides of a case and the section that sets them. Precision is no setting: spreading and gathering are in f64
//! always, or action would not be reaction. Does not measure.

use crate::config::{Config, Interpolate, Map, Smooth};
use crate::interpolate::FluidVelocity;
use crate::map;
use crate::mesh::Mesh;
use crate::mesh::made::Made;
use crate::smooth::{self, Diffusion, Smoother};
use serde::Serialize;

/// One candidate.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Settings {
    /// map.method
    pub mapping: String,
    /// map.grid, m; 0 where the mapping has none
    pub grid: f64,
    /// interpolate.fluid_velocity
    pub interpolation: String,
    /// smooth.method
    pub smoother: String,
    /// smooth.tolerance
    pub tolerance: f64,
}

/// The exact operator, as far as f64 goes.
const EXACT: (&str, f64) = ("chebyshev", 1e-13);
/// The tightest tolerance tried.
const TIGHTEST: f64 = 1e-12;

impl Settings {
    /// Of a case on its mesh.
    pub fn of(c: &Config, mesh: &Mesh) -> Self {
        let f = &c.file;
        Self {
            mapping: map::resolve(&f.map.method, mesh).into(),
            grid: f.map.grid,
            interpolation: f.interpolate.fluid_velocity.clone(),
            smoother: f.smooth.method.clone(),
            tolerance: f.smooth.tolerance,
        }
    }
    /// With the exact operator on the same deposit; what is not smoothed is exact.
    pub fn exact(&self, bandwidth: f64) -> Self {
        let smoothed = self.smoothed() && bandwidth > 0.0;
        let (name, tolerance) = if smoothed { EXACT } else { ("none", self.tolerance) };
        Self { smoother: name.into(), tolerance, ..self.clone() }
    }
    /// Is anything to be smoothed after the deposit?
    fn smoothed(&self) -> bool {
        map::all().iter().find(|m| m.name() == self.mapping).is_none_or(|m| !m.smooths())
    }
    /// As overrides of a case, behind those given.
    pub fn overrides(&self, base: &[(String, String)]) -> Vec<(String, String)> {
        let mut all = base.to_vec();
        let own = [
            ("map.method", self.mapping.clone()),
            ("map.grid", self.grid.to_string()),
            ("interpolate.fluid_velocity", self.interpolation.clone()),
            ("smooth.method", self.smoother.clone()),
            ("smooth.tolerance", format!("{:e}", self.tolerance)),
        ];
        all.extend(own.map(|(k, v)| (k.to_string(), v)));
        all
    }
    /// The sections of case.toml that say so, with what else the case has in them; zeros and empty lists, which are
    /// defaults, are left out.
    pub fn section(&self, c: &Config) -> Result<String, toml::ser::Error> {
        let f = &c.file;
        let (method, tolerance) = (self.smoother.clone(), self.tolerance);
        let map = Map { method: self.mapping.clone(), grid: self.grid };
        let smooth = Smooth { method, tolerance, ..f.smooth.clone() };
        let interpolate = Interpolate { fluid_velocity: self.interpolation.clone() };
        let mut all = toml::Table::new();
        for (name, mut table) in [
            ("map", toml::Table::try_from(map)?),
            ("smooth", toml::Table::try_from(smooth)?),
            ("interpolate", toml::Table::try_from(interpolate)?),
        ] {
            let empty =
                |v: &toml::Value| v.as_float() == Some(0.0) || v.as_array().is_some_and(Vec::is_empty);
            table.retain(|_, v| !empty(v));
            all.insert(name.into(), toml::Value::Table(table));
        }
        toml::to_string(&all)
    }
    /// For tables.
    pub fn name(&self) -> String {
        let tolerance =
            if takes_tolerance(&self.smoother) { format!("{:.0e}", self.tolerance) } else { "-".into() };
        format!("{:18} {:10} {:16} {tolerance:>6}", self.mapping, self.interpolation, self.smoother)
    }
}

/// What may be tried.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// map.method
    Mapping,
    /// smooth.method and smooth.tolerance
    Smoother,
    /// interpolate.fluid_velocity
    Interpolation,
}

impl Part {
    /// Names on the command line.
    pub const NAMES: &[&str] = &["mapping", "smoother", "interpolation"];
    /// By name.
    pub fn by_name(name: &str) -> Option<Self> {
        let all = [Self::Mapping, Self::Smoother, Self::Interpolation];
        Self::NAMES.iter().position(|n| *n == name).map(|i| all[i])
    }
}

/// The case's mapping first, then all others; `diameter`: of the largest particle, m.
pub fn mappings(case: &Settings, diameter: f64) -> Vec<Settings> {
    let other = |m: &dyn map::Mapping| {
        // two to three particle diameters, as the case's reference says
        let grid = if case.grid > 0.0 { case.grid } else { 2.5 * diameter };
        // mappings without a grid do not look at it
        let grid = if m.name() == "two-grid" { grid } else { case.grid };
        let smoother = if m.smooths() { "none".into() } else { case.smoother.clone() };
        Settings { mapping: m.name().into(), grid, smoother, ..case.clone() }
    };
    let all = map::all();
    let others = all.iter().filter(|m| m.name() != case.mapping).map(|m| other(&**m));
    std::iter::once(case.clone()).chain(others).collect()
}

/// All interpolations but that of the case.
pub fn interpolations(case: &Settings) -> Vec<Settings> {
    let others = FluidVelocity::NAMES.iter().filter(|n| **n != case.interpolation);
    others.map(|n| Settings { interpolation: (*n).into(), ..case.clone() }).collect()
}

/// Smoothers for the mapping and interpolation of `of`, each with its tolerances from loose to tight; without a bandwidth
/// there is nothing to smooth.
pub fn smoothers(of: &Settings, bandwidth: f64) -> Vec<Vec<Settings>> {
    let with = |name: &str, tolerance| Settings { smoother: name.into(), tolerance, ..of.clone() };
    if !of.smoothed() || bandwidth <= 0.0 {
        return vec![vec![with("none", of.tolerance)]];
    }
    let tolerances = |name: &&str| {
        if !takes_tolerance(name) {
            return vec![with(name, of.tolerance)];
        }
        let steps = [1.0, 0.3].into_iter();
        (1..=12)
            .flat_map(|d| steps.clone().map(move |s| s * 10f64.powi(-d)))
            .filter(|t| *t >= TIGHTEST)
            // 3e-5, not 3.0000000000000004e-5
            .filter_map(|t| format!("{t:.0e}").parse().ok())
            .map(|t| with(name, t))
            .collect()
    };
    // the default is one of two others
    smooth::NAMES.iter().filter(|n| **n != smooth::DEFAULT).map(tolerances).collect()
}

/// A smoother of that name on a mesh made for the purpose, to be asked what it is.
fn example(name: &str, tolerance: f64) -> Option<Box<dyn Smoother>> {
    let mesh = Made::hex([4, 4, 4], [4.0; 3]).mesh();
    smooth::by_name(name, &mesh, &Diffusion::uniform(3.0).links(&mesh), tolerance)
}

/// Does the tolerance of the case act on it?
pub fn takes_tolerance(name: &str) -> bool {
    let degree = |tolerance| example(name, tolerance).map(|s| s.degree());
    degree(1e-1) != degree(1e-10)
}

/// Keeps volume, momentum and the third law to rounding?
pub fn conservative(s: &Settings) -> bool {
    let smoother = example(&s.smoother, 1e-2).map(|s| s.properties());
    let mapping = map::all().iter().find(|m| m.name() == s.mapping).is_some_and(|m| m.conservative());
    mapping && smoother.is_some_and(|p| p.conservative && p.self_adjoint)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn smoothers_say_whether_the_tolerance_acts_and_what_they_keep() {
        for (name, acts, keeps) in [
            ("chebyshev", true, true),
            ("uniformization", true, true),
            ("none", false, true),
            ("direct", false, false),
        ] {
            assert_eq!(takes_tolerance(name), acts, "{name}");
            let s = Settings {
                mapping: "linear".into(),
                grid: 0.0,
                interpolation: "gather".into(),
                smoother: name.into(),
                tolerance: 1e-2,
            };
            assert_eq!(conservative(&s), keeps, "{name}");
        }
    }

    #[test]
    fn every_implementation_is_tried() {
        let case = Settings {
            mapping: "linear".into(),
            grid: 0.0,
            interpolation: "gather".into(),
            smoother: "chebyshev".into(),
            tolerance: 1e-2,
        };
        assert_eq!(mappings(&case, 1e-3).len(), map::all().len());
        assert_eq!(interpolations(&case).len() + 1, FluidVelocity::NAMES.len());
        let all = smoothers(&case, 4e-3);
        assert_eq!(all.len() + 1, smooth::NAMES.len());
        let first = &all[0];
        assert!(first.windows(2).all(|w| w[1].tolerance < w[0].tolerance) && first.len() == 23, "{first:?}");
        assert_eq!((first[0].tolerance, first[3].tolerance), (0.1, 3e-3));
        assert_eq!(smoothers(&case, 0.0).len(), 1);
    }
}
