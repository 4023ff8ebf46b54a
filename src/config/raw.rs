// SPDX-License-Identifier: MIT OR Apache-2.0
//! case.toml as it is typed: sections, keys, defaults. `KEYS` is their reference (`voidage explain`).

use super::Problem;
use crate::interpolate::FluidVelocity;
use crate::{forces, map, scheme, smooth};
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

/// The whole file.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(missing_docs)]
pub struct CaseFile {
    pub format: u32,
    #[serde(default)]
    pub run: Run,
    pub fluid: Fluid,
    pub dem: Dem,
    pub coupling: Coupling,
    #[serde(default)]
    pub map: Map,
    pub smooth: Smooth,
    #[serde(default)]
    pub interpolate: Interpolate,
    pub forces: Forces,
    #[serde(default)]
    pub output: Output,
    #[serde(default)]
    pub limits: Limits,
    #[serde(default)]
    pub record: Record,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub auto: Option<Auto>,
}

/// Section `run`.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[allow(missing_docs)]
pub struct Run {
    pub dem_ranks: u32,
    pub cfd_ranks: u32,
    pub threads: u32,
}
impl Default for Run {
    fn default() -> Self {
        Self { dem_ranks: 1, cfd_ranks: 1, threads: 1 }
    }
}

/// Where the weight of the fluid goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[allow(missing_docs)]
pub enum GravityTreatment {
    Archimedes,
    InPressure,
    None,
}

/// Is the fluid solved?
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[allow(missing_docs)]
pub enum Flow {
    Solved,
    Frozen,
}

fn fluid_case() -> PathBuf {
    "fluid".into()
}
fn voidage_foam() -> String {
    "voidageFoam".into()
}
fn archimedes() -> GravityTreatment {
    GravityTreatment::Archimedes
}
fn solved() -> Flow {
    Flow::Solved
}

/// Section `fluid`.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(missing_docs)]
pub struct Fluid {
    #[serde(default = "fluid_case")]
    pub case: PathBuf,
    #[serde(default = "voidage_foam")]
    pub solver: String,
    pub density: f64,
    pub kinematic_viscosity: f64,
    pub gravity: [f64; 3],
    #[serde(default = "archimedes")]
    pub gravity_treatment: GravityTreatment,
    #[serde(default)]
    pub mean_pressure_gradient: [f64; 3],
    #[serde(default = "solved")]
    pub flow: Flow,
}
impl Fluid {
    /// A solver of OpenFOAM's own.
    pub fn stock(&self) -> bool {
        self.solver != voidage_foam()
    }
}

/// How the force acts within an interval.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[allow(missing_docs)]
pub enum InInterval {
    Implicit,
    Constant,
}
fn implicit() -> InInterval {
    InInterval::Implicit
}
fn liggghts() -> String {
    super::program::PROGRAMS[0].name.into()
}

/// Parcel diameter / primary diameter.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(
    untagged,
    expecting = "dem.coarse_graining: a number, or one for each particle type: { 1 = 4.0, 2 = 10.0 }"
)]
pub enum CoarseGraining {
    /// of all particles
    All(f64),
    /// by type
    ByType(BTreeMap<String, f64>),
}
impl Default for CoarseGraining {
    fn default() -> Self {
        Self::All(1.0)
    }
}
impl CoarseGraining {
    /// Of all particles; 1 if it differs by type.
    pub fn of_all(&self) -> f64 {
        if let Self::All(ratio) = self { *ratio } else { 1.0 }
    }
    /// Index: type; NaN: no ratio was given for it. Empty if all particles have the same.
    pub fn by_type(&self) -> Vec<f64> {
        let Self::ByType(table) = self else { return Vec::new() };
        let known: BTreeMap<usize, f64> =
            table.iter().filter_map(|(k, ratio)| Some((k.parse().ok()?, *ratio))).collect();
        let types = known.keys().max().map_or(0, |t| t + 1).min(1000);
        (0..types).map(|t| known.get(&t).copied().unwrap_or(f64::NAN)).collect()
    }
}

/// Coefficient of the added mass.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged, expecting = "forces.added_mass: a number, or \"felderhof\"")]
pub enum AddedMass {
    /// the same for all particles
    Coefficient(f64),
    /// a law
    Law(String),
}
impl Default for AddedMass {
    fn default() -> Self {
        Self::Coefficient(0.0)
    }
}
impl AddedMass {
    /// 0 where a law gives it.
    pub fn coefficient(&self) -> f64 {
        if let Self::Coefficient(c) = self { *c } else { 0.0 }
    }
    /// A law gives it.
    pub fn law(&self) -> bool {
        matches!(self, Self::Law(_))
    }
    /// Is there any?
    pub fn on(&self) -> bool {
        self.law() || self.coefficient() > 0.0
    }
}

/// Section `dem`.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(missing_docs)]
pub struct Dem {
    #[serde(default = "liggghts")]
    pub program: String,
    pub script: PathBuf,
    pub time_step: f64,
    #[serde(default = "implicit")]
    pub force: InInterval,
    #[serde(default)]
    pub coarse_graining: CoarseGraining,
    #[serde(default)]
    pub variables: BTreeMap<String, String>,
}

/// Split of the pressure-gradient force.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[allow(missing_docs)]
pub enum Model {
    A,
    B,
}
/// Does the fluid feel the particles?
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[allow(missing_docs)]
pub enum Feedback {
    TwoWay,
    OneWay,
}
/// Volume source of the fluid's continuity.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[allow(missing_docs)]
pub enum Continuity {
    VoidageRate,
    SolidsFlux,
}
fn conservative() -> String {
    "conservative".into()
}
fn model_a() -> Model {
    Model::A
}
fn two_way() -> Feedback {
    Feedback::TwoWay
}
fn kernel() -> String {
    "kernel".into()
}
fn voidage_rate() -> Continuity {
    Continuity::VoidageRate
}

/// Section `coupling`.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(missing_docs)]
pub struct Coupling {
    pub interval: u32,
    #[serde(default = "conservative")]
    pub scheme: String,
    #[serde(default = "model_a")]
    pub model: Model,
    #[serde(default = "two_way")]
    pub feedback: Feedback,
    #[serde(default = "voidage_rate")]
    pub continuity: Continuity,
    #[serde(default = "kernel")]
    pub void_velocity: String,
}

/// Section `map`.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[allow(missing_docs)]
pub struct Map {
    pub method: String,
    pub grid: f64,
}
impl Default for Map {
    fn default() -> Self {
        Self { method: map::DEFAULT.into(), grid: 0.0 }
    }
}

fn smoother() -> String {
    smooth::DEFAULT.into()
}
fn tolerance() -> f64 {
    1e-2
}
fn auto() -> String {
    "auto".into()
}

/// Section `smooth`.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(missing_docs)]
pub struct Smooth {
    #[serde(default = "smoother")]
    pub method: String,
    #[serde(default)]
    pub bandwidth: f64,
    #[serde(default = "tolerance")]
    pub tolerance: f64,
    #[serde(default = "auto")]
    pub links: String,
    #[serde(default)]
    pub by_diameter: Vec<[f64; 2]>,
    #[serde(default)]
    pub largest_cell: f64,
    #[serde(default)]
    pub time: f64,
}

/// Section `interpolate`.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[allow(missing_docs)]
pub struct Interpolate {
    pub fluid_velocity: String,
}
impl Default for Interpolate {
    fn default() -> Self {
        Self { fluid_velocity: "gather".into() }
    }
}

fn one() -> f64 {
    1.0
}
fn three() -> f64 {
    3.0
}
fn switch_voidage() -> f64 {
    0.8
}
fn close_packing() -> f64 {
    0.63
}
fn none() -> String {
    "none".into()
}
fn yes() -> bool {
    true
}

/// Section `forces`.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(missing_docs)]
pub struct Forces {
    pub drag: String,
    #[serde(default = "yes")]
    pub pressure_gradient: bool,
    #[serde(default = "yes")]
    pub viscous_stress: bool,
    #[serde(default = "one")]
    pub sphericity: f64,
    #[serde(default = "switch_voidage")]
    pub switch_voidage: f64,
    #[serde(default)]
    pub filter_diameter: f64,
    #[serde(default)]
    pub filter_density: f64,
    #[serde(default = "none")]
    pub lift: String,
    #[serde(default)]
    pub added_mass: AddedMass,
    #[serde(default)]
    pub history: bool,
    #[serde(default)]
    pub torque: bool,
    #[serde(default)]
    pub particle_stress: f64,
    #[serde(default = "three")]
    pub particle_stress_exponent: f64,
    #[serde(default = "close_packing")]
    pub close_packing: f64,
}

/// Section `output`.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[allow(missing_docs)]
pub struct Output {
    pub fields: bool,
    pub particles: bool,
    pub picture: String,
    pub restarts: u32,
}
impl Default for Output {
    fn default() -> Self {
        Self { fields: true, particles: true, picture: "none".into(), restarts: 2 }
    }
}

/// Section `limits`.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[allow(missing_docs)]
pub struct Limits {
    pub wait: f64,
    pub outside: String,
    pub voidage_min: f64,
}
impl Default for Limits {
    fn default() -> Self {
        Self { wait: 60.0, outside: "error".into(), voidage_min: 0.0 }
    }
}

/// How recorded messages are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[allow(missing_docs)]
pub enum Compression {
    None,
    Lz4,
}

/// Section `record`.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[allow(missing_docs)]
pub struct Record {
    pub every: u32,
    pub first: u32,
    pub last: u32,
    pub file: PathBuf,
    pub compression: Compression,
}
impl Default for Record {
    fn default() -> Self {
        Self { every: 0, first: 0, last: 0, file: "recording.voidage".into(), compression: Compression::Lz4 }
    }
}

/// Section `auto`: without it nothing is chosen.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[allow(missing_docs)]
pub struct Auto {
    pub accuracy: f64,
    pub every: u32,
    pub keep: Vec<String>,
    /// written by `voidage run` into the resolved case: the keys that may change during the run
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub live: Vec<String>,
}
impl Default for Auto {
    fn default() -> Self {
        Self { accuracy: 1e-2, every: 500, keep: Vec::new(), live: Vec::new() }
    }
}

/// Reference of all keys: key, unit, default ("-" = must be given), meaning.
pub const KEYS: &[(&str, &str, &str, &str)] = &[
    ("format", "", "-", "version of this file, 1"),
    ("run.dem_ranks", "", "1", "MPI ranks of the particle program"),
    ("run.cfd_ranks", "", "1", "MPI ranks of the fluid solver; the case is decomposed when needed"),
    (
        "run.threads",
        "",
        "1",
        "threads of the coupler; the results do not depend on them. The partners wait meanwhile, so their cores are free",
    ),
    ("fluid.case", "", "fluid", "OpenFOAM case, below the case folder"),
    ("fluid.solver", "", "voidageFoam", "voidageFoam, or a stock solver with fvOptions (dilute, model B)"),
    ("fluid.density", "kg/m3", "-", "density of the fluid"),
    ("fluid.kinematic_viscosity", "m2/s", "-", "must equal nu of transportProperties"),
    ("fluid.gravity", "m/s2", "-", "gravity as in the DEM script, for Archimedes or in-pressure"),
    (
        "fluid.gravity_treatment",
        "",
        "archimedes",
        "archimedes (force on particles) | in-pressure (eps rho g in the fluid) | none",
    ),
    ("fluid.mean_pressure_gradient", "Pa/m", "[0,0,0]", "prescribed mean gradient, for periodic boxes"),
    ("fluid.flow", "", "solved", "solved | frozen"),
    (
        "dem.program",
        "",
        "liggghts",
        "particle program: liggghts | lammps (./setup lammps; liggghts-fix/README.md)",
    ),
    ("dem.script", "", "-", "its input script"),
    ("dem.time_step", "s", "-", "must equal `timestep` of the script"),
    ("dem.force", "", "implicit", "implicit (K(u-v)+f in each DEM step) | constant"),
    (
        "dem.coarse_graining",
        "",
        "1",
        "parcel diameter / primary diameter: forces of the primary x ratio^3; or by particle type: { 1 = 4.0, 2 = 10.0 }",
    ),
    ("dem.variables", "", "{}", "passed as -var name value"),
    ("coupling.interval", "DEM steps", "-", "fluid step = interval x dem.time_step"),
    (
        "coupling.scheme",
        "",
        "conservative",
        "conservative | conservative-adaptive | explicit | implicit | split | implicit-filled (docs/schemes.md)",
    ),
    ("coupling.model", "", "A", "A | B: split of pressure gradient and stress"),
    ("coupling.feedback", "", "two-way", "two-way | one-way"),
    ("coupling.continuity", "", "voidage-rate", "voidage-rate (d eps/dt) | solids-flux (SX eq. 2a)"),
    (
        "coupling.void_velocity",
        "",
        "kernel",
        "implicit: solids velocity of cells void of particles: kernel (mean) | pinned (continued from filled cells held fixed, R)",
    ),
    (
        "map.method",
        "",
        map::DEFAULT,
        "auto (max-entropy where more than a quarter of the cells are tetrahedra, else linear) | linear | max-entropy (any cells) | particle-centroid (SX eq. 4; cheapest) | satellite-points (29) | divided-volume (exact overlap) | kernel (Gaussian of \
         smooth.bandwidth; with smooth.method = none) | two-grid",
    ),
    ("map.grid", "m", "0", "two-grid: cell size of the coarse grid; 2 to 3 particle diameters"),
    (
        "smooth.method",
        "",
        smooth::DEFAULT,
        "gaussian (forward-euler where it takes no more sweeps than chebyshev and the tolerance is 1e-2 or more, else chebyshev) | chebyshev | chebyshev-u | uniformization (positive by proof) | forward-euler (positive by proof; nearest to the Gaussian at b/h up to 2) | crank-nicolson | crank-nicolson-1 | backward-euler | constdiff | direct | none",
    ),
    (
        "smooth.bandwidth",
        "m",
        "-",
        "b of the Gaussian exp(-r2/b2); 4 to 6 particle diameters, or \"wake\": from the particles' wake, see `voidage check`",
    ),
    (
        "smooth.tolerance",
        "",
        "1e-2",
        "error of the smoothing operator; below 1e-2 the deposit's own error dominates",
    ),
    (
        "smooth.links",
        "",
        "auto",
        "what the smoother's Laplacian joins cells by: faces (of the mesh) | voronoi (of the diagram of the cell centres: exact moments \
         on tetrahedra) | auto (voronoi where more than a quarter of the cells are tetrahedra, else faces)",
    ),
    (
        "smooth.by_diameter",
        "m",
        "[]",
        "[[d1, b1], [d2, b2], ...]: particles up to diameter d1 are smoothed with b1 and so on, larger ones with bandwidth",
    ),
    (
        "smooth.largest_cell",
        "m",
        "0",
        "cells larger than this (cube root of the volume) are not smoothed; 0: all are",
    ),
    (
        "smooth.time",
        "s",
        "0",
        "running mean of eps_s over this time (SX eqs. 11 to 14); it lags, so solid volume is not conserved; 0: off",
    ),
    ("interpolate.fluid_velocity", "", "gather", "gather | host-cell | linear"),
    (
        "forces.drag",
        "",
        "-",
        "stokes schiller-naumann di-felice rong di-felice-tang di-felice-tang-cfdem gidaspow gidaspow-blended \
         ergun-wen-yu ergun wen-yu beetstra beetstra-cpl beetstra-polydisperse beetstra-filtered koch-hill tenneti \
         tenneti-nga2 tang cello syamlal-obrien no-correction none",
    ),
    ("forces.pressure_gradient", "", "true", "-V grad p on the particles (model A)"),
    ("forces.viscous_stress", "", "true", "V div tau on the particles (model A)"),
    ("forces.sphericity", "", "1", "of the particles, in Ergun's part of gidaspow and ergun-wen-yu"),
    ("forces.switch_voidage", "", "0.8", "gidaspow, ergun-wen-yu: Ergun up to it, Wen & Yu above"),
    ("forces.filter_diameter", "m", "0", "beetstra-filtered: primary diameter of its terminal velocity"),
    ("forces.filter_density", "kg/m3", "0", "beetstra-filtered: particle density of its terminal velocity"),
    ("forces.lift", "", "none", "none | saffman-mei | loth"),
    (
        "forces.added_mass",
        "",
        "0",
        "coefficient of the added mass, 0.5 for a sphere alone; 0: off; \"felderhof\": by solid fraction and density ratio",
    ),
    ("forces.history", "", "false", "Basset's history force with bounded memory, kept with the particle"),
    ("forces.torque", "", "false", "torque of the fluid's rotation on the particles, K_w (curl U / 2 - w)"),
    ("forces.particle_stress", "Pa", "0", "MP-PIC stress (Snider) for parcels without contacts; 0: off"),
    ("forces.particle_stress_exponent", "", "3", "its exponent, 2 to 5"),
    ("forces.close_packing", "", "0.63", "its solid fraction at close packing"),
    ("output.fields", "", "true", "cell fields for ParaView at the fluid's write times"),
    ("output.particles", "", "true", "particles for ParaView at the fluid's write times"),
    ("output.picture", "", "none", "none | x | y | z: animation of the particles seen along that axis"),
    (
        "output.restarts",
        "",
        "2",
        "restart sets kept, written at the fluid's write times (voidage run --restart); 0: none",
    ),
    (
        "record.every",
        "",
        "0",
        "record every n-th exchange; 1: all; 0: none (voidage replay, inspect, export)",
    ),
    ("record.first", "", "0", "record the first n exchanges as well"),
    ("record.last", "", "0", "record the last n exchanges before endTime as well"),
    ("record.file", "", "recording.voidage", "the file, below the case folder; never overwritten"),
    ("record.compression", "", "none", "none | lz4: a third smaller, for 4 ms of CPU per 2.6 MB"),
    (
        "auto.accuracy",
        "",
        "1e-2",
        "choose the models: a term is on where its magnitude, relative to weight or drag, exceeds this (docs/auto.md)",
    ),
    (
        "auto.every",
        "exchanges",
        "500",
        "measure the terms again after so many exchanges, and switch; 0: never",
    ),
    (
        "auto.keep",
        "",
        "[]",
        "keys not to touch beside those set in the case; auto chooses coupling.model, coupling.feedback, smooth.method, \
         forces.lift, forces.added_mass, forces.history",
    ),
    (
        "auto.live",
        "",
        "[]",
        "written by voidage run into logs/case.resolved.toml: keys it may change during the run",
    ),
    ("limits.wait", "s", "60", "longest wait for a peer"),
    ("limits.outside", "", "error", "error | exclude: particles outside the mesh"),
    ("limits.voidage_min", "", "0", "cap the voidage from below (counted); 0: stop the run instead"),
];

/// Nearest of the known names.
pub(crate) fn nearest<'a>(name: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let distance = |a: &str, b: &str| {
        let b: Vec<char> = b.chars().collect();
        let mut row: Vec<usize> = (0..=b.len()).collect();
        for (i, x) in a.chars().enumerate() {
            let mut last = row[0];
            row[0] = i + 1;
            for (j, y) in b.iter().enumerate() {
                let next = (last + usize::from(x != *y)).min(row[j] + 1).min(row[j + 1] + 1);
                last = std::mem::replace(&mut row[j + 1], next);
            }
        }
        row[b.len()]
    };
    // a name cut short is nearer than any other
    let distance = |k: &str| if !name.is_empty() && k.starts_with(name) { 1 } else { distance(name, k) };
    let best = known.into_iter().map(|k| (distance(k), k)).min()?;
    (best.0 <= name.len() / 2 + 1).then_some(best.1)
}

/// A case file as read.
pub(super) struct Parsed {
    pub file: CaseFile,
    /// the bandwidth is to be taken from the wake
    pub wake: bool,
    /// keys in the text and the overrides
    pub given: BTreeSet<String>,
}

/// Parses and applies overrides. Problems without a place are about the file itself.
pub(super) fn parse(text: &str, overrides: &[(String, String)]) -> Result<Parsed, Vec<Problem>> {
    let syntax = |e: toml::de::Error| {
        let line = e.span().map(|s| text[..s.start.min(text.len())].lines().count().max(1));
        let words = |l: usize| text.lines().nth(l - 1).unwrap_or("").trim();
        let given = line.map(|l| format!("line {l} ({})", words(l))).unwrap_or_default();
        vec![Problem::error("", given, e.message(), "see `voidage explain`")]
    };
    let mut table: toml::Table = toml::from_str(text).map_err(syntax)?;
    for (key, value) in overrides {
        set(&mut table, key, value)?;
    }
    let unknown: Vec<Problem> = unknown_keys(&table);
    if !unknown.is_empty() {
        return Err(unknown);
    }
    let given = table.iter().flat_map(|(section, v)| keys(section, v)).collect();
    let wake = bandwidth_word(&mut table)?;
    let file = CaseFile::deserialize(table.clone()).map_err(|e| {
        let found = missing_or_of_another_type(&table);
        if !found.is_empty() {
            return found;
        }
        vec![Problem::error("", "its content", &e.message().replace('\n', " "), "see `voidage explain`")]
    })?;
    let problems = names(&file);
    if problems.is_empty() { Ok(Parsed { file, wake, given }) } else { Err(problems) }
}

/// Keys that must be given, with an example; together the smallest case file.
const NEEDED: [(&str, &str); 9] = [
    ("format", "1"),
    ("fluid.density", "1.2"),
    ("fluid.kinematic_viscosity", "1.5e-5"),
    ("fluid.gravity", "[0.0, 0.0, -9.81]"),
    ("dem.script", "\"particles.in\""),
    ("dem.time_step", "1e-5"),
    ("coupling.interval", "20"),
    ("smooth.bandwidth", "4.8e-3"),
    ("forces.drag", "\"gidaspow\""),
];

fn parsed(value: &str) -> Option<toml::Value> {
    toml::from_str::<toml::Table>(&format!("x = {value}")).ok()?.remove("x")
}

/// None: the key leads through what is no table.
fn put(table: &mut toml::Table, key: &str, value: toml::Value) -> Option<()> {
    let (path, last) = key.rsplit_once('.').map_or((None, key), |(path, last)| (Some(path), last));
    let mut at = table;
    for part in path.into_iter().flat_map(|p| p.split('.')) {
        at = at.entry(part).or_insert_with(|| toml::Table::new().into()).as_table_mut()?;
    }
    at.insert(last.into(), value);
    Some(())
}

fn look_up<'a>(table: &'a toml::Table, key: &str) -> Option<&'a toml::Value> {
    match key.split_once('.') {
        Some((section, name)) => table.get(section)?.get(name),
        None => table.get(key),
    }
}

/// Why a table is no case file, key by key: each is tried alone in the smallest one.
fn missing_or_of_another_type(table: &toml::Table) -> Vec<Problem> {
    let mut smallest = toml::Table::new();
    for (key, value) in NEEDED {
        let _ = parsed(value).and_then(|v| put(&mut smallest, key, v));
    }
    let method = table.get("smooth").and_then(|s| s.get("method")?.as_str());
    let mut problems = Vec::new();
    for (key, unit, default, meaning) in KEYS {
        let example = NEEDED.iter().find(|n| n.0 == *key).map(|n| n.1.to_string());
        let unit = if unit.is_empty() { String::new() } else { format!(" ({unit})") };
        let Some(value) = look_up(table, key) else {
            if let Some(example) = example.filter(|_| *key != "smooth.bandwidth" || method != Some("none")) {
                let fix = match key.split_once('.') {
                    Some((section, name)) => format!("in [{section}]: {name} = {example}"),
                    None => format!("{key} = {example}"),
                };
                problems.push(Problem::error(
                    key,
                    "nothing",
                    &format!("it must be given{unit}: {meaning}"),
                    fix,
                ));
            }
            continue;
        };
        let mut alone = smallest.clone();
        let _ = put(&mut alone, key, value.clone());
        if let Err(e) = CaseFile::deserialize(alone) {
            let said = e
                .message()
                .replace('\n', " ")
                .replace(" f64", " a number")
                .replace(" u32", " a whole number");
            let default =
                parsed(default).map_or_else(|| format!("\"{default}\""), |_| (*default).to_string());
            let fix = format!("{key} = {}", example.unwrap_or(default));
            problems.push(Problem::error(
                key,
                value,
                &format!("{said}{unit}: {meaning}"),
                format!("e.g. {fix}"),
            ));
        }
    }
    problems
}

/// A word in the place of the bandwidth: "wake", to be replaced by a number later.
fn bandwidth_word(table: &mut toml::Table) -> Result<bool, Vec<Problem>> {
    let smooth = table.get_mut("smooth").and_then(toml::Value::as_table_mut);
    let Some(value) = smooth.and_then(|t| t.get_mut("bandwidth")) else { return Ok(false) };
    match value.as_str() {
        None => Ok(false),
        Some("wake") => {
            *value = toml::Value::Float(0.0);
            Ok(true)
        }
        Some(other) => {
            let given = format!("\"{other}\"");
            let fix = "smooth.bandwidth = \"wake\"";
            Err(vec![Problem::error("smooth.bandwidth", given, "accepted: a number (m), or \"wake\"", fix)])
        }
    }
}

fn set(table: &mut toml::Table, key: &str, value: &str) -> Result<(), Vec<Problem>> {
    let value = parsed(value).unwrap_or_else(|| toml::Value::String(value.into()));
    let bad = Problem::error(key, &value, "overrides are section.key=value", "see `voidage explain`");
    let done = key.contains('.').then(|| put(table, key, value)).flatten();
    done.ok_or_else(|| vec![bad])
}

/// Keys of a section; a value outside sections is its own key.
fn keys(section: &str, value: &toml::Value) -> Vec<String> {
    match value {
        toml::Value::Table(t) => t.keys().map(|k| format!("{section}.{k}")).collect(),
        _ => vec![section.to_string()],
    }
}

fn unknown_keys(table: &toml::Table) -> Vec<Problem> {
    let mut problems = Vec::new();
    let known = || KEYS.iter().map(|k| k.0);
    for (section, value) in table {
        for key in keys(section, value).into_iter().filter(|k| !known().any(|n| n == k)) {
            // the end of a longer name, as viscosity, is nearer than any other
            let (section, name) = key.split_once('.').unwrap_or(("", &key));
            let end = |k: &&str| {
                k.split_once('.').is_some_and(|k| {
                    if section.is_empty() { k.1 == name } else { k.0 == section && k.1.ends_with(name) }
                })
            };
            let near = known().find(|k| name.len() > 3 && end(k)).or_else(|| nearest(&key, known()));
            let fix = match near {
                Some(n) => format!("did you mean {n}?"),
                None => "see `voidage explain`".into(),
            };
            problems.push(Problem::error(&key, "?", "this key is unknown", fix));
        }
    }
    problems
}

/// Names from lists, with the nearest match.
fn names(file: &CaseFile) -> Vec<Problem> {
    let mut problems = Vec::new();
    let mut check = |key: &str, given: &str, list: Vec<&str>| {
        if !list.contains(&given) {
            let near =
                nearest(given, list.iter().copied()).map(|n| format!("{key} = \"{n}\"?")).unwrap_or_default();
            let accepted = format!("accepted: {}", list.join(", "));
            let fix = if near.is_empty() { format!("{key} = \"{}\"", list[0]) } else { near };
            problems.push(Problem::error(key, format!("\"{given}\""), &accepted, fix));
        }
    };
    check("forces.drag", &file.forces.drag, forces::all().iter().map(|l| l.name()).collect());
    let lifts = ["none"].into_iter().chain(forces::lift::all().iter().map(|l| l.name()));
    check("forces.lift", &file.forces.lift, lifts.collect());
    check("coupling.scheme", &file.coupling.scheme, scheme::all().iter().map(|s| s.name()).collect());
    check("coupling.void_velocity", &file.coupling.void_velocity, vec!["kernel", "pinned"]);
    let methods = [map::DEFAULT].into_iter().chain(map::all().iter().map(|m| m.name())).collect();
    check("map.method", &file.map.method, methods);
    check("smooth.method", &file.smooth.method, smooth::NAMES.to_vec());
    check("smooth.links", &file.smooth.links, vec!["auto", "faces", "voronoi"]);
    check("interpolate.fluid_velocity", &file.interpolate.fluid_velocity, FluidVelocity::NAMES.to_vec());
    check("limits.outside", &file.limits.outside, vec!["error", "exclude"]);
    check("output.picture", &file.output.picture, vec!["none", "x", "y", "z"]);
    check("dem.program", &file.dem.program, super::program::PROGRAMS.iter().map(|p| p.name).collect());
    for key in file.auto.iter().flat_map(|a| &a.keep) {
        check("auto.keep", key, crate::auto::KEYS.to_vec());
    }
    if let AddedMass::Law(law) = &file.forces.added_mass {
        check("forces.added_mass", law, vec!["felderhof"]);
    }
    problems
}
