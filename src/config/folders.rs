// SPDX-License-Identifier: MIT OR Apache-2.0
//! The folders a run begins in: what the OpenFOAM case asks for and would not get, what it lacks, paths that cannot work.
//!
//! Reads the facts `foam` finds there; writes problems for `check` and `run`.

use super::{Config, Problem, foam};
use std::path::Path;

/// What the OpenFOAM case asks for and would not get, and what it lacks.
pub fn fluid(c: &Config, p: &mut Vec<Problem>) {
    let (case, ranks) = (c.fluid_case(), c.file.run.cfd_ranks);
    let mesh = ["points", "points.gz"].iter().any(|f| case.join("constant/polyMesh").join(f).exists());
    if !mesh && !case.join("system/blockMeshDict").exists() {
        let accepted = "the case has neither constant/polyMesh nor system/blockMeshDict";
        p.push(Problem::error(
            "fluid.case",
            c.file.fluid.case.display(),
            accepted,
            "make the mesh first, e.g. blockMesh",
        ));
    }
    let place = |file: &str| case.join(file).display().to_string();
    if let Some(parts) = foam::parts(&case).filter(|n| ranks > 1 && *n != Some(ranks)) {
        let accepted = format!(
            "{} has numberOfSubdomains {}",
            place("system/decomposeParDict"),
            parts.map_or("missing".into(), |n| n.to_string())
        );
        p.push(Problem::error("run.cfd_ranks", ranks, &accepted, "make them equal or remove the file"));
    }
    if foam::steady(&case) {
        let fix = "fvSchemes: ddtSchemes { default Euler; }";
        p.push(Problem::error("ddtSchemes", "steadyState", "the coupled flow is transient", fix));
    }
    if foam::has_patch(&case, "wedge") {
        let accepted =
            "the particles move in three dimensions, and a wedge holds only those within its few degrees";
        p.push(Problem::error(
            "patch",
            "wedge",
            accepted,
            "mesh the whole vessel, or a plane slice with `empty` patches",
        ));
    }
    if !c.file.fluid.stock() && foam::rotating(&case) {
        let accepted = "voidageFoam has no rotating frames: they would be ignored";
        let fix = "remove the file, or (dilute scenes) fluid.solver = \"pimpleFoam\"";
        p.push(Problem::error(&place("constant/MRFProperties"), "an active zone", accepted, fix));
    }
    if let Some(kind) = foam::moving_mesh(&case) {
        let accepted = "the mesh must not move: the coupler has its own copy, made at the start";
        p.push(Problem::error("dynamicFvMesh", kind, accepted, "remove constant/dynamicMeshDict"));
    }
    pressure_gradient(c, p);
}

/// What a run that is no restart needs of the folders it begins in.
pub fn beginning(c: &Config) -> Vec<Problem> {
    let (case, mut p) = (c.fluid_case(), Vec::new());
    if let Some(what) = unfit(&c.folder) {
        p.push(Problem::error("case", c.folder.display(), what, "move or copy the case (--into DIR)"));
    }
    let begin = foam::time_folder(&case, c.control.start, 1e-2 * c.control.step);
    let has = |f: &Path, name: &str| f.join(name).exists() || f.join(format!("{name}.gz")).exists();
    // stock solvers have their own names for the pressure
    let needed: &[&str] = if c.file.fluid.stock() { &["U"] } else { &["U", "p"] };
    let missing: Vec<&str> =
        needed.iter().copied().filter(|name| !begin.as_deref().is_some_and(|f| has(f, name))).collect();
    if !missing.is_empty() {
        let given = format!("no {} of t = {}", missing.join(" and "), c.control.start);
        let accepted = "controlDict (startFrom, startTime) begins there; voidageFoam takes U and the kinematic p (m2/s2)";
        let fix = if case.join("0.orig").exists() { "cp -r 0.orig 0" } else { "give them, e.g. in 0/" };
        p.push(Problem::error(&case.display().to_string(), given, accepted, fix));
    }
    p
}

/// Why OpenFOAM and LD_PRELOAD cannot work with a path: OpenFOAM drops such characters and works elsewhere.
pub fn unfit(path: &Path) -> Option<&'static str> {
    let text = path.to_string_lossy();
    text.contains(|c: char| c.is_whitespace() || "\"':".contains(c))
        .then_some("OpenFOAM takes no path with a blank, quote or colon")
}

/// Gauss' gradient takes p at the middle between two centres for p at the middle of their face, which on tetrahedra lie a third of a cell apart: a linear
/// pressure gets a gradient that is wrong by half (`cases/ergun/tetrahedra`).
fn pressure_gradient(c: &Config, p: &mut Vec<Problem>) {
    let case = c.fluid_case();
    let tetrahedra = foam::faces_per_cell(&case).is_some_and(|f| f < 4.75);
    let given = foam::gradient(&case, "p").filter(|g| tetrahedra && g.starts_with("Gauss"));
    if let Some(given) = given {
        p.push(Problem::warning(
            "system/fvSchemes: grad(p)",
            given,
            "on tetrahedra a pressure drop comes out 14 to 15 % too low with it, while all books balance",
            "gradSchemes { default Gauss linear; grad(p) leastSquares; } and, in fvSolution, nNonOrthogonalCorrectors 2",
        ));
    }
}
