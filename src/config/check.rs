// SPDX-License-Identifier: MIT OR Apache-2.0
//! What cannot work, or will surprise: checked across case.toml, the OpenFOAM case and the DEM script.

use super::resolution::{courant, gather_bias, history, relaxation};
use super::{
    CoarseGraining, Config, Continuity, Feedback, Flow, GravityTreatment, InInterval, Model, Problem,
    bandwidth, foam, folders, script,
};

/// All problems of a case, errors first.
pub fn check(c: &Config) -> Vec<Problem> {
    let mut p = Vec::new();
    values(c, &mut p);
    models(c, &mut p);
    smoothing(c, &mut p);
    times(c, &mut p);
    let script = script::read(&c.script(), &c.file.dem.variables);
    match &script {
        Err(e) => p.push(Problem::error(
            "dem.script",
            c.file.dem.script.display(),
            e,
            format!("set dem.script to the {} script", c.program().title),
        )),
        Ok(s) => dem(c, s, &mut p),
    }
    let case = c.fluid_case();
    if let Some(nu) = foam::viscosity(&case)
        && (nu / c.file.fluid.kinematic_viscosity - 1.0).abs() > 1e-6
    {
        let accepted =
            format!("constant/transportProperties has nu {nu}; drag and flow need the same viscosity");
        let given = c.file.fluid.kinematic_viscosity;
        p.push(Problem::error(
            "fluid.kinematic_viscosity",
            given,
            &accepted,
            format!("fluid.kinematic_viscosity = {nu:e}"),
        ));
    }
    folders::fluid(c, &mut p);
    if let (Some(mesh), Ok(s)) = (foam::extent(&case), &script) {
        meshes(c, &mesh, s, &mut p);
    }
    p.sort_by_key(|x| x.severity);
    p
}

/// Problems of the settings alone, without the files of a case.
pub fn settings(c: &Config) -> Vec<Problem> {
    let mut p = Vec::new();
    values(c, &mut p);
    models(c, &mut p);
    p
}

fn values(c: &Config, p: &mut Vec<Problem>) {
    let f = &c.file;
    if f.format != 1 {
        p.push(Problem::error("format", f.format, "this version reads format 1", "format = 1"));
    }
    let mut range = |key: &str, value: f64, low: f64, high: f64, unit: &str| {
        if !(value >= low && value <= high) {
            let (accepted, fix) = if unit.is_empty() {
                (format!("between {low:e} and {high:e}"), format!("give {key} in that range"))
            } else {
                (
                    format!("between {low:e} and {high:e} {unit}: are the units right?"),
                    format!("give {key} in {unit}"),
                )
            };
            p.push(Problem::error(key, value, &accepted, fix));
        }
    };
    range("fluid.density", f.fluid.density, 1e-2, 3e4, "kg/m3");
    range("fluid.kinematic_viscosity", f.fluid.kinematic_viscosity, 1e-9, 1e2, "m2/s");
    range("dem.time_step", f.dem.time_step, 1e-12, 1.0, "s");
    match &f.dem.coarse_graining {
        CoarseGraining::All(ratio) => range("dem.coarse_graining", *ratio, 1.0, 1e3, ""),
        CoarseGraining::ByType(table) => {
            table
                .iter()
                .for_each(|(k, ratio)| range(&format!("dem.coarse_graining.{k}"), *ratio, 1.0, 1e3, ""));
        }
    }
    range("forces.sphericity", f.forces.sphericity, 0.1, 1.0, "");
    range("forces.switch_voidage", f.forces.switch_voidage, 0.4, 1.0, "");
    range("forces.added_mass", f.forces.added_mass.coefficient(), 0.0, 5.0, "");
    range("forces.particle_stress", f.forces.particle_stress, 0.0, 1e6, "Pa");
    range("forces.particle_stress_exponent", f.forces.particle_stress_exponent, 1.0, 10.0, "");
    range("forces.close_packing", f.forces.close_packing, 0.3, 1.0, "");
    if f.forces.drag == "beetstra-filtered" {
        range("forces.filter_diameter", f.forces.filter_diameter, 1e-7, 0.1, "m");
        range("forces.filter_density", f.forces.filter_density, 1.0, 3e4, "kg/m3");
    }
    range("limits.wait", f.limits.wait, 1.0, 1e6, "s");
    range("smooth.tolerance", f.smooth.tolerance, 1e-14, 0.1, "");
    if f.limits.voidage_min != 0.0 {
        range("limits.voidage_min", f.limits.voidage_min, 0.01, 0.99, "");
    }
    if f.map.method == "two-grid" {
        range("map.grid", f.map.grid, 1e-9, 1e3, "m");
    }
    if f.smooth.method != "none" || f.map.method == "kernel" {
        range("smooth.bandwidth", f.smooth.bandwidth, 1e-9, 1e3, "m");
    }
    for [d, b] in &f.smooth.by_diameter {
        range("smooth.by_diameter", *d, 1e-9, 1e2, "m (a diameter)");
        range("smooth.by_diameter", *b, 1e-9, 1e3, "m (a bandwidth)");
    }
    if f.smooth.largest_cell != 0.0 {
        range("smooth.largest_cell", f.smooth.largest_cell, 1e-9, 1e4, "m");
    }
    range("smooth.time", f.smooth.time, 0.0, 1e6, "s");
    if let Some(a) = &f.auto {
        range("auto.accuracy", a.accuracy, 1e-9, 0.5, "");
    }
    let counts = [
        ("run.dem_ranks", f.run.dem_ranks),
        ("run.cfd_ranks", f.run.cfd_ranks),
        ("run.threads", f.run.threads),
    ];
    for (key, n) in counts {
        if n == 0 || n > 100_000 {
            p.push(Problem::error(key, n, "at least 1", format!("{key} = 1")));
        }
    }
    if f.coupling.interval == 0 {
        p.push(Problem::error(
            "coupling.interval",
            0,
            "a number of DEM steps, at least 1",
            "coupling.interval = 20",
        ));
    }
    if let CoarseGraining::ByType(table) = &f.dem.coarse_graining {
        let bad = |k: &&String| !k.parse::<u32>().is_ok_and(|t| (1..1000).contains(&t));
        if let Some(k) = table.keys().find(bad) {
            let fix = "dem.coarse_graining = { 1 = 4.0, 2 = 10.0 }";
            p.push(Problem::error(
                "dem.coarse_graining",
                k,
                "the keys are particle types of the script, from 1",
                fix,
            ));
        }
        if table.is_empty() {
            p.push(Problem::error(
                "dem.coarse_graining",
                "{}",
                "no type at all",
                "dem.coarse_graining = 1.0",
            ));
        }
    }
}

/// Smoothing beyond one bandwidth for all and the particles of now.
fn smoothing(c: &Config, p: &mut Vec<Problem>) {
    let s = &c.file.smooth;
    let given = || format!("{:?}", s.by_diameter);
    if !s.by_diameter.is_empty() && s.method == "none" {
        let fix = "smooth.method = \"gaussian\"";
        p.push(Problem::error(
            "smooth.by_diameter",
            given(),
            "nothing is smoothed with method = \"none\"",
            fix,
        ));
    }
    if s.by_diameter.windows(2).any(|w| w[0][0] >= w[1][0]) {
        let accepted = "the diameters must ascend: a particle takes the first that is not below its own";
        let fix = "smooth.by_diameter = [[1e-3, 4e-3], [2e-3, 8e-3]]";
        p.push(Problem::error("smooth.by_diameter", given(), accepted, fix));
    }
    let x = &c.file.coupling;
    if x.void_velocity == "pinned" && (x.scheme != "implicit" || s.method == "none") {
        let (accepted, fix) = if x.scheme == "implicit" {
            (
                "nothing is smoothed with method = \"none\": no void cell has a source",
                "smooth.method = \"gaussian\"",
            )
        } else {
            (
                "only the scheme implicit looks at the solids velocity of void cells",
                "coupling.scheme = \"implicit\"",
            )
        };
        p.push(Problem::error("coupling.void_velocity", "pinned", accepted, fix));
    }
    if s.time > 0.0 && c.file.coupling.continuity == Continuity::SolidsFlux {
        let accepted =
            "the mean solid fraction and the solids flux of now do not fit each other in the continuity";
        let fix = "coupling.continuity = \"voidage-rate\"";
        p.push(Problem::error("smooth.time", s.time, accepted, fix));
    } else if s.time > 0.0 {
        let model_a = if c.file.coupling.model == Model::A && c.file.coupling.feedback == Feedback::TwoWay {
            "; in model A the pressure force then breaks the third law (action_reaction_error)"
        } else {
            ""
        };
        let accepted = format!(
            "the mean lags: fluid and drag see the solids where they were, and their volume is kept only while none comes or goes \
             (solid_volume_error of monitor.csv){model_a}"
        );
        let fix = "smooth.time = 0, or coupling.model = \"B\"";
        p.push(Problem::warning("smooth.time", s.time, &accepted, fix));
    }
}

fn models(c: &Config, p: &mut Vec<Problem>) {
    let f = &c.file;
    let stock = f.fluid.stock();
    let two_way = f.coupling.feedback == Feedback::TwoWay;
    if f.coupling.model == Model::A && two_way && !(f.forces.pressure_gradient && f.forces.viscous_stress) {
        let accepted = "model A gives the particles their share of grad p and div tau; without it action is not reaction";
        p.push(Problem::error(
            "forces",
            "pressure_gradient or viscous_stress = false",
            accepted,
            "set both to true, or coupling.model = \"B\"",
        ));
    }
    if stock && (f.coupling.model == Model::A || f.forces.viscous_stress) {
        let fix =
            "coupling.model = \"B\" and forces.viscous_stress = false, or fluid.solver = \"voidageFoam\"";
        p.push(Problem::error(
            "fluid.solver",
            &f.fluid.solver,
            "a stock solver knows no voidage: model B only",
            fix,
        ));
    }
    if stock && f.fluid.flow == Flow::Frozen {
        let accepted = "a stock solver always solves its flow";
        p.push(Problem::error("fluid.flow", "frozen", accepted, "fluid.solver = \"voidageFoam\""));
    }
    if stock && f.fluid.mean_pressure_gradient != [0.0; 3] {
        let given = format!("{:?}", f.fluid.mean_pressure_gradient);
        let accepted = "only voidageFoam applies it";
        let fix = "leave it out and drive the flow in constant/fvOptions (meanVelocityForce)";
        p.push(Problem::error("fluid.mean_pressure_gradient", given, accepted, fix));
    }
    let moving = f.fluid.gravity.iter().any(|g| *g != 0.0);
    if f.fluid.gravity_treatment == GravityTreatment::InPressure && !moving {
        let fix = "fluid.gravity = [0.0, -9.81, 0.0]";
        p.push(Problem::error("fluid.gravity_treatment", "in-pressure", "needs a gravity", fix));
    }
    if f.fluid.gravity_treatment == GravityTreatment::InPressure && stock {
        let accepted =
            "only voidageFoam has gravity in the pressure; with the Archimedes force it would act twice";
        p.push(Problem::error(
            "fluid.gravity_treatment",
            "in-pressure",
            accepted,
            "gravity_treatment = \"archimedes\"",
        ));
    }
    let weight = f.fluid.gravity.map(|g| f.fluid.density * g);
    let square = |v: [f64; 3]| v.iter().map(|x| x * x).sum::<f64>();
    let gap = [0, 1, 2].map(|a| f.fluid.mean_pressure_gradient[a] - weight[a]);
    if f.fluid.gravity_treatment == GravityTreatment::Archimedes
        && moving
        && square(gap) < 1e-4 * square(weight)
    {
        let accepted = "this is the hydrostatic gradient rho g: with the Archimedes force the fluid's weight would act twice";
        let fix = "gravity_treatment = \"none\", or a mean gradient without rho g";
        p.push(Problem::error(
            "fluid.mean_pressure_gradient",
            format!("{:?}", f.fluid.mean_pressure_gradient),
            accepted,
            fix,
        ));
    }
    if f.forces.added_mass.on() && f.dem.force == InInterval::Constant {
        let accepted =
            "the added mass is part of the particle's inertia: the force cannot be held over the interval";
        p.push(Problem::error(
            "forces.added_mass",
            format!("{:?}", f.forces.added_mass),
            accepted,
            "dem.force = \"implicit\"",
        ));
    }
    if f.forces.drag == "beetstra-filtered" && !f.dem.coarse_graining.by_type().is_empty() {
        let accepted = "the filtered law's parcel correction knows one ratio for all particles";
        let fix = "a number for dem.coarse_graining, or another drag law";
        p.push(Problem::error("dem.coarse_graining", "by type", accepted, fix));
    }
    let scheme = crate::scheme::by_name(&f.coupling.scheme);
    if two_way && scheme.is_some_and(|s| !s.conservative()) {
        p.push(Problem::warning(
            "coupling.scheme",
            &f.coupling.scheme,
            "it has no ledger and breaks the third law (monitor.csv: action_reaction_error; docs/schemes.md)",
            "coupling.scheme = \"conservative\"",
        ));
    }
    if f.dem.force == InInterval::Constant {
        let accepted = "a constant force over the interval errs by K Δt/(2 m)";
        p.push(Problem::warning(
            "dem.force",
            "constant",
            accepted,
            "dem.force = \"implicit\" is as fast and exact",
        ));
    }
}

fn times(c: &Config, p: &mut Vec<Problem>) {
    let (period, step) = (c.period(), c.control.step);
    if c.control.adjustable {
        p.push(Problem::error(
            "adjustTimeStep",
            "yes",
            "the coupling needs a fixed fluid step",
            "controlDict: adjustTimeStep no;",
        ));
    }
    if (step / period - 1.0).abs() > 1e-9 {
        let n = (step / c.file.dem.time_step).round();
        let accepted = format!(
            "the fluid step (controlDict deltaT {step}) must be interval x dem.time_step = {period:e}"
        );
        let fix = if n >= 1.0 && (step / (n * c.file.dem.time_step) - 1.0).abs() < 1e-9 {
            format!("coupling.interval = {n}")
        } else {
            format!("controlDict: deltaT {period:e};")
        };
        p.push(Problem::error("coupling.interval", c.file.coupling.interval, &accepted, fix));
    }
    let steps = (c.control.end - c.control.start) / step;
    if steps < 0.5 {
        let given = format!("{} after start {}", c.control.end, c.control.start);
        p.push(Problem::error("endTime", given, "there is nothing to run", "raise endTime in controlDict"));
    } else if (steps - steps.round()).abs() > 1e-6 * steps.max(1.0) {
        let fix = format!("controlDict: endTime {};", c.control.start + steps.round() * step);
        p.push(Problem::error("endTime", c.control.end, "must be a whole number of steps", fix));
    }
}

fn dem(c: &Config, s: &script::Script, p: &mut Vec<Problem>) {
    let dt = c.file.dem.time_step;
    if let Some(t) = s.time_step.filter(|t| (t / dt - 1.0).abs() > 1e-9) {
        let accepted = format!("the script has timestep {t}");
        p.push(Problem::error("dem.time_step", dt, &accepted, format!("dem.time_step = {t:e}")));
    }
    if let Some(u) = s.units.as_deref().filter(|u| *u != "si") {
        p.push(Problem::error("units", u, "the coupling works in SI", "in the script: units si"));
    }
    let program = c.program();
    for (command, instead) in s.commands.iter().filter_map(|c| program.instead(c).map(|i| (c, i))) {
        let accepted = format!("a command of {}, dem.program is \"{}\"", program.other().title, program.name);
        p.push(Problem::error("dem.script", command, &accepted, format!("in the script: {instead}")));
    }
    for style in s.commands.iter().filter_map(|c| c.strip_prefix("atom_style ")) {
        if !program.atom_styles.contains(&style) {
            let accepted = format!(
                "in {} the coupling needs spheres with radius, mass and angular velocity: {}",
                program.title,
                program.atom_styles.join(", ")
            );
            p.push(Problem::error(
                "atom_style",
                style,
                &accepted,
                format!("in the script: atom_style {}", program.atom_styles[0]),
            ));
        }
    }
    if !s.has_fix {
        let accepted = "the script has no `fix ... voidage`: nothing would be coupled";
        p.push(Problem::error(
            "dem.script",
            c.file.dem.script.display(),
            accepted,
            "add: fix voidage all voidage",
        ));
    }
    if !s.has_run {
        let accepted = "the script has no `run`";
        p.push(Problem::error("dem.script", c.file.dem.script.display(), accepted, "add: run 1000000000"));
    }
    if let Some(r) = s.radius {
        if !(1e-8..=1.0).contains(&r) {
            p.push(Problem::error(
                "radius",
                r,
                "between 1e-8 and 1 m: are the units right?",
                "give lengths in m",
            ));
        }
        let b = c.file.smooth.bandwidth;
        if c.file.smooth.method != "none" && b < 2.0 * r {
            let fix = format!("smooth.bandwidth = {:e}", 8.0 * r);
            p.push(Problem::warning(
                "smooth.bandwidth",
                b,
                "below one particle diameter: the voidage follows single particles",
                fix,
            ));
        }
        bandwidth::advice(c, s, p);
        if let Some(rho) = s.density {
            relaxation(c, r, rho, s.count, p);
            history(c, r, rho, p);
        }
    }
}

fn meshes(c: &Config, mesh: &foam::Extent, s: &script::Script, p: &mut Vec<Problem>) {
    let size = mesh
        .cells
        .map(|n| ((0..3).map(|a| mesh.upper[a] - mesh.lower[a]).product::<f64>() / n as f64).cbrt());
    let b = c.file.smooth.bandwidth;
    if let Some(h) = size.filter(|h| c.file.smooth.method != "none" && b < 0.5 * h) {
        let accepted = format!("less than half the mean cell size {h:.3e} m: smoothing does almost nothing");
        p.push(Problem::warning(
            "smooth.bandwidth",
            b,
            &accepted,
            "smooth.method = \"none\", or a larger bandwidth",
        ));
    }
    courant(c, size, p);
    gather_bias(c, mesh, s, p);
    if let (Some(h), Some(r)) = (size, s.radius.filter(|_| c.file.smooth.method == "none"))
        && h < 6.0 * r
    {
        let accepted = format!(
            "the cells ({h:.3e} m) are smaller than three particle diameters: the voidage of a cell jumps"
        );
        let fix = format!("smooth.method = \"gaussian\" and smooth.bandwidth = {:e}", 8.0 * r);
        p.push(Problem::warning("smooth.method", "none", &accepted, fix));
    }
    let Some((lower, upper)) = s.domain else { return };
    for a in 0..3 {
        let axis = ["x", "y", "z"][a];
        let length = mesh.upper[a] - mesh.lower[a];
        let slack = 1e-6 * length;
        let given = format!("[{}, {}]", lower[a], upper[a]);
        let accepted = format!("the CFD mesh has [{}, {}]", mesh.lower[a], mesh.upper[a]);
        let periodic = s.boundary.as_ref().is_some_and(|b| b[a].starts_with('p'));
        let equal = (lower[a] - mesh.lower[a]).abs() < slack && (upper[a] - mesh.upper[a]).abs() < slack;
        let fluid = c.fluid_case();
        if periodic && !["cyclic", "empty"].iter().any(|kind| foam::has_patch(&fluid, kind)) {
            let accepted = "the mesh has neither cyclic nor empty patches: particles would pass where the fluid is bounded";
            let fix = "make the patches cyclic, or boundary f in the script";
            p.push(Problem::warning(&format!("DEM boundary in {axis}"), "p", accepted, fix));
        }
        if periodic && !equal {
            let fix = "make both boxes equal in periodic directions";
            p.push(Problem::error(&format!("DEM box in {axis}"), given, &accepted, fix));
        } else if !periodic && (lower[a] > mesh.upper[a] || upper[a] < mesh.lower[a]) {
            p.push(Problem::error(
                &format!("DEM box in {axis}"),
                given,
                &accepted,
                "they do not overlap: are the units right?",
            ));
        } else if !periodic && (lower[a] < mesh.lower[a] - slack || upper[a] > mesh.upper[a] + slack) {
            let fix =
                "particles that leave the mesh stop the run; limits.outside = \"exclude\" leaves them out";
            p.push(Problem::warning(&format!("DEM box in {axis}"), given, &accepted, fix));
        }
    }
}
