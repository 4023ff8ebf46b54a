// SPDX-License-Identifier: MIT OR Apache-2.0
//! `voidage inspect`: what a scene is made of, which terms matter in it, and what `auto` would switch on (design §2.4).
//!
//! `measure` sums the magnitudes of an exchange; `recorded` does so for the exchanges of a recording, `expected` estimates it from the files of a case; `decide`
//! compares the magnitudes with the accuracy asked. Reads SI units; changes nothing.

pub mod decide;
pub mod expected;
pub mod measure;
pub mod recorded;

use std::fmt;

/// Smallest, mean and largest of a quantity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    /// smallest
    pub min: f64,
    /// mean
    pub mean: f64,
    /// largest
    pub max: f64,
    count: f64,
}

impl Default for Range {
    fn default() -> Self {
        Self { min: f64::INFINITY, mean: 0.0, max: f64::NEG_INFINITY, count: 0.0 }
    }
}

impl Range {
    /// One value.
    pub fn one(x: f64) -> Self {
        let mut r = Self::default();
        r.add(x);
        r
    }
    /// Adds a value.
    pub fn add(&mut self, x: f64) {
        (self.min, self.max) = (self.min.min(x), self.max.max(x));
        self.count += 1.0;
        self.mean += (x - self.mean) / self.count;
    }
    /// Nothing was added.
    pub fn is_empty(&self) -> bool {
        self.count == 0.0
    }
}

impl fmt::Display for Range {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match () {
            () if self.is_empty() => write!(f, "not known"),
            () if self.max - self.min <= 1e-9 * self.max.abs() => write!(f, "{:.4e}", self.mean),
            () => write!(f, "{:.3e} (from {:.3e} to {:.3e})", self.mean, self.min, self.max),
        }
    }
}

/// A term of the model that can be on or off.
#[derive(Clone, Debug, PartialEq)]
pub struct Term {
    /// what it is
    pub name: &'static str,
    /// magnitude relative to `to`
    pub relative: f64,
    /// what it is compared with
    pub to: &'static str,
    /// how the number came about
    pub how: &'static str,
    /// on in these settings
    pub now: bool,
    /// what to type to have it; `None`: this version has no such term in live runs
    pub on: Option<&'static str>,
    /// what to type to be without it; `None`: always there
    pub off: Option<&'static str>,
}

/// Numbers of a scene, SI units; what is not known is empty or `None`.
#[derive(Clone, Debug, Default)]
#[allow(missing_docs)]
pub struct Scene {
    /// where the numbers come from
    pub from: String,
    pub particles: Range,
    pub cells: Option<usize>,
    pub bounds: Option<[[f64; 3]; 2]>,
    pub diameter: Range,
    pub density: Range,
    pub cell_size: Range,
    pub fluid_density: f64,
    pub kinematic_viscosity: f64,
    pub gravity: f64,
    /// of the whole mesh
    pub solid_fraction: Option<f64>,
    /// in the cells
    pub solid_fraction_cells: Range,
    /// 1 − voidage at the particles
    pub solid_fraction_seen: Range,
    pub slip: Range,
    pub fluid_speed: Range,
    pub bandwidth: f64,
    pub smoothed: bool,
    /// m/K, s; with the drag law of the case
    pub relaxation: Range,
    /// ρ_f ε V/ΣK, s
    pub fluid_relaxation: Option<f64>,
    pub period: f64,
    pub dem_step: f64,
    pub explicit: bool,
    pub terms: Vec<Term>,
}

impl Scene {
    /// ρ_p d²/(18 η), s (R eq. 9).
    pub fn stokes_time(&self) -> f64 {
        self.density.mean * self.diameter.mean.powi(2)
            / (18.0 * self.fluid_density * self.kinematic_viscosity)
    }
    /// d |u − v|/ν at the mean slip and the largest.
    pub fn reynolds(&self) -> [f64; 2] {
        [self.slip.mean, self.slip.max].map(|u| self.diameter.mean * u / self.kinematic_viscosity)
    }
    /// Shortest side of the mesh, m.
    pub fn length(&self) -> Option<f64> {
        self.bounds.map(|b| (0..3).map(|a| b[1][a] - b[0][a]).fold(f64::INFINITY, f64::min))
    }
    /// τ_p U/L at the fastest fluid and the shortest side of the mesh.
    pub fn stokes(&self) -> Option<f64> {
        self.length().map(|l| self.stokes_time() * self.fluid_speed.max / l)
    }
    /// φ ρ_p/((1 − φ) ρ_f), kg of particles per kg of fluid.
    pub fn mass_loading(&self) -> Option<f64> {
        self.solid_fraction.map(|p| p * self.density.mean / ((1.0 - p) * self.fluid_density))
    }
    /// Co Δx/U with Co = 0.5, s (R eq. 11).
    pub fn courant_time(&self) -> Option<f64> {
        let h = (!self.cell_size.is_empty()).then_some(self.cell_size.min)?;
        (self.fluid_speed.max > 0.0).then(|| 0.5 * h / self.fluid_speed.max)
    }
}

impl fmt::Display for Scene {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let number = |x: Option<f64>| x.map_or("not known".to_string(), |x| format!("{x:.3e}"));
        let mut row = |what: &str, value: String| writeln!(f, "  {what:44} {value}");
        row("from", self.from.clone())?;
        row(
            "particles",
            if self.particles.is_empty() {
                "not known".into()
            } else {
                let (a, b) = (self.particles.min, self.particles.max);
                if a == b { format!("{a}") } else { format!("{a} to {b}") }
            },
        )?;
        row("cells", self.cells.map_or("not known".into(), |n| n.to_string()))?;
        if let Some([l, u]) = self.bounds {
            let short = |v: [f64; 3]| v.map(|x| (x * 1e9).round() / 1e9);
            row("mesh, m", format!("{:?} to {:?}", short(l), short(u)))?;
        }
        row("particle diameter, m", self.diameter.to_string())?;
        row("particle density, kg/m3", self.density.to_string())?;
        row("cell size V^(1/3), m", self.cell_size.to_string())?;
        if !self.cell_size.is_empty() {
            row("cell size / diameter", format!("{:.2}", self.cell_size.mean / self.diameter.mean))?;
        }
        if self.smoothed {
            let b = self.bandwidth;
            row("bandwidth b, m", format!("{b:.3e} ({:.1} diameters)", b / self.diameter.mean))?;
        }
        row("density ratio", number(Some(self.density.mean / self.fluid_density)))?;
        row("solid fraction of the mesh", number(self.solid_fraction))?;
        row("solid fraction in occupied cells", self.solid_fraction_cells.to_string())?;
        row("solid fraction at the particles", self.solid_fraction_seen.to_string())?;
        row("mass loading", number(self.mass_loading()))?;
        row("fluid speed, m/s", self.fluid_speed.to_string())?;
        row("slip |u - v|, m/s", self.slip.to_string())?;
        let [mean, max] = self.reynolds();
        row("Reynolds number d|u-v|/nu", format!("{mean:.3e} (largest {max:.3e})"))?;
        row("Stokes number tau_p U/L (L: shortest side)", number(self.stokes()))?;
        writeln!(f, "time scales, s (fluid step {:.3e}, DEM step {:.1e}):", self.period, self.dem_step)?;
        let mut row = |what: &str, value: String| writeln!(f, "  {what:44} {value}");
        row("tau_p, Stokes drag (R eq. 9)", number(Some(self.stokes_time())))?;
        row("tau_p = m/K, drag law of the case", self.relaxation.to_string())?;
        row("tau_f = rho_f eps V/sum K (R eq. 10)", number(self.fluid_relaxation))?;
        row("tau_Co = 0.5 dx/U (R eq. 11)", number(self.courant_time()))
    }
}
