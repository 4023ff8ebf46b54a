// SPDX-License-Identifier: MIT OR Apache-2.0
//! Bad input: every message of `voidage check` says where, what was given, what is accepted and what to type.

mod common;

use common::folder::copy;
use std::path::PathBuf;
use std::process::Command;

/// A change of a file: (file, old text, new text).
type Edit<'a> = (&'a str, &'a str, &'a str);

/// Case, edits, overrides, words of the message.
type Message<'a> = (&'a str, &'a [Edit<'a>], &'a [&'a str], &'a [&'a str]);

/// Checks a changed copy of a case; the exit code and what is printed.
fn check(name: &str, case: &str, edits: &[Edit], set: &[&str]) -> (i32, String) {
    let to = std::env::temp_dir().join(format!("voidage-messages-{name}-{}", std::process::id()));
    let _ = std::fs::remove_dir_all(&to);
    copy(&PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("cases").join(case), &to);
    for (file, old, new) in edits {
        let text = std::fs::read_to_string(to.join(file)).unwrap();
        assert!(text.contains(old), "{file}: {old}");
        std::fs::write(to.join(file), text.replace(old, new)).unwrap();
    }
    let mut c = Command::new(env!("CARGO_BIN_EXE_voidage"));
    c.arg("check").arg(&to);
    set.iter().for_each(|s| {
        c.args(["--set", s]);
    });
    let out = c.output().unwrap();
    std::fs::remove_dir_all(&to).unwrap();
    (out.status.code().unwrap(), String::from_utf8_lossy(&out.stderr).into_owned())
}

const LAMMPS: [&str; 2] = ["dem.program=lammps", "dem.script=lammps.in"];
const SETTLING: &str = "settling";
const BED: &str = "fluidised-bed";
const CONTROL: &str = "fluid/system/controlDict";

#[test]
fn the_cases_are_without_errors() {
    for case in [SETTLING, BED, "periodic-box"] {
        for set in [&[][..], &LAMMPS] {
            let (code, text) = check(&format!("good-{case}"), case, &[], set);
            assert!(code == 0 && !text.contains("error:"), "{case} {set:?}: {text}");
        }
    }
}

#[test]
fn errors() {
    let table: &[Message] = &[
        (
            SETTLING,
            &[("case.toml", "format = 1", "format = 2")],
            &[],
            &["format = 2", "reads format 1", "format = 1"],
        ),
        (
            SETTLING,
            &[],
            &["fluid.density=1e9"],
            &["fluid.density = 1000000000", "are the units right?", "kg/m3"],
        ),
        (SETTLING, &[], &["fluid.kinematic_viscosity=1e5"], &["fluid.kinematic_viscosity = 100000", "units"]),
        (SETTLING, &[], &["dem.time_step=10.0"], &["dem.time_step = 10", "between 1e-12 and 1e0 s"]),
        (
            SETTLING,
            &[],
            &["auto.acuracy=1e-2"],
            &["auto.acuracy = ?", "unknown", "did you mean auto.accuracy"],
        ),
        (
            SETTLING,
            &[],
            &["auto.accuracy=2.0"],
            &["auto.accuracy = 2", "between 1e-9 and 5e-1", "give auto.acc"],
        ),
        (
            SETTLING,
            &[],
            &["auto.keep=[\"forces.lif\"]"],
            &["auto.keep = \"forces.lif\"", "accepted: coupling.model", "auto.keep = \"forces.lift\"?"],
        ),
        (
            SETTLING,
            &[],
            &["auto.live=[\"forces.lift\"]"],
            &["auto.live = [\"forces.lift\"]", "voidage run writes it", "leave it out"],
        ),
        (SETTLING, &[], &["limits.wait=0.1"], &["limits.wait = 0.1", "between 1e0"]),
        (SETTLING, &[], &["limits.voidage_min=2.0"], &["limits.voidage_min = 2", "between"]),
        (BED, &[], &["smooth.tolerance=0.5"], &["smooth.tolerance = 0.5", "between"]),
        (BED, &[], &["smooth.bandwidth=wide"], &["smooth.bandwidth = \"wide\"", "a number (m), or \"wake\""]),
        (
            BED,
            &[
                ("fluid/0/U", "0 0.9 0", "0 0 0"),
                ("case.toml", "gravity = [0.0, -9.81, 0.0]", "gravity = [0.0, 0.0, 0.0]"),
            ],
            &["smooth.bandwidth=wake"],
            &["smooth.bandwidth = \"wake\"", "there is no wake", "a number, m"],
        ),
        (BED, &[], &["smooth.bandwidth=0.0"], &["smooth.bandwidth = 0", "give smooth.bandwidth in m"]),
        (SETTLING, &[], &["run.dem_ranks=0"], &["run.dem_ranks = 0", "at least 1", "run.dem_ranks = 1"]),
        (SETTLING, &[], &["run.cfd_ranks=0"], &["run.cfd_ranks = 0", "run.cfd_ranks = 1"]),
        (SETTLING, &[], &["coupling.interval=0"], &["coupling.interval = 0", "coupling.interval = 20"]),
        (
            SETTLING,
            &[],
            &["forces.pressure_gradient=false"],
            &["forces = pressure_gradient", "action is not reaction", "coupling.model = \"B\""],
        ),
        (SETTLING, &[], &["fluid.solver=pimpleFoam"], &["fluid.solver = pimpleFoam", "model B only"]),
        (
            SETTLING,
            &[],
            &["fluid.gravity_treatment=in-pressure", "fluid.gravity=[0.0,0.0,0.0]"],
            &["fluid.gravity_treatment = in-pressure", "needs a gravity"],
        ),
        (
            SETTLING,
            &[],
            &["fluid.gravity_treatment=in-pressure", "fluid.solver=pimpleFoam"],
            &["would act twice", "gravity_treatment = \"archimedes\""],
        ),
        (
            SETTLING,
            &[],
            &["fluid.mean_pressure_gradient=[0.0,0.0,-98.1]"],
            &[
                "fluid.mean_pressure_gradient = [0.0, 0.0, -98.1]",
                "hydrostatic",
                "would act twice",
                "\"none\"",
            ],
        ),
        (
            SETTLING,
            &[(CONTROL, "deltaT 2e-4;", "deltaT 2e-4;\nadjustTimeStep yes;")],
            &[],
            &["adjustTimeStep = yes", "fixed fluid step", "adjustTimeStep no;"],
        ),
        (SETTLING, &[], &["coupling.interval=21"], &["coupling.interval = 21", "coupling.interval = 20"]),
        (SETTLING, &[(CONTROL, "deltaT 2e-4;", "deltaT 2.05e-4;")], &[], &["controlDict: deltaT 2e-4;"]),
        (SETTLING, &[(CONTROL, "endTime 0.24;", "endTime 0;")], &[], &["endTime", "nothing to run"]),
        (SETTLING, &[(CONTROL, "endTime 0.24;", "endTime 0.00031;")], &[], &["whole number of steps"]),
        (SETTLING, &[("particles.in", "units           si", "units lj")], &[], &["units = lj", "units si"]),
        (SETTLING, &[("particles.in", "run             1000000000", "")], &[], &["has no `run`", "add: run"]),
        (
            SETTLING,
            &[("particles.in", "diameter 1e-4", "diameter 100")],
            &[],
            &["radius = 50", "lengths in m"],
        ),
        (
            SETTLING,
            &[("particles.in", "0 0.1 0 0.1 0 0.1", "0 0.1 0 0.1 5 6")],
            &[],
            &["DEM box in z = [5, 6]", "do not overlap", "[0, 0.1]"],
        ),
        (
            "periodic-box",
            &[("particles.in", "block 0 0.002605", "block 0 0.003")],
            &[],
            &["DEM box in x", "equal in periodic directions"],
        ),
        (
            SETTLING,
            &[],
            &["coupling.scheme=explicit", "coupling.interval=2000"],
            &[
                "tau_p: explicit coupling is unstable",
                "R eq. 9",
                "R eq. 10",
                "coupling.scheme = \"conservative\"",
            ],
        ),
        (
            SETTLING,
            &[],
            &["dem.force=constant"],
            &["the constant force errs by 0.6 % of the drag", "dem.force = \"implicit\""],
        ),
        (
            BED,
            &[],
            &["smooth.by_diameter=[[2e-3, 8e-3], [1e-3, 4e-3]]"],
            &["smooth.by_diameter = [[0.002, 0.008], [0.001, 0.004]]", "must ascend"],
        ),
        (
            BED,
            &[],
            &["smooth.links=face"],
            &["smooth.links", "accepted: auto, faces, voronoi", "smooth.links = \"faces\"?"],
        ),
        (BED, &[], &["smooth.by_diameter=[[2e-3, -1.0]]"], &["smooth.by_diameter = -1", "a bandwidth"]),
        (SETTLING, &[], &["smooth.by_diameter=[[2e-3, 8e-3]]"], &["nothing is smoothed", "\"gaussian\""]),
        (
            BED,
            &[],
            &["coupling.void_velocity=pinned"],
            &["coupling.void_velocity = pinned", "coupling.scheme = \"implicit\""],
        ),
        (
            SETTLING,
            &[],
            &["coupling.void_velocity=pinned", "coupling.scheme=implicit"],
            &["coupling.void_velocity = pinned", "nothing is smoothed"],
        ),
        (BED, &[], &["coupling.void_velocity=pined"], &["accepted: kernel, pinned", "\"pinned\"?"]),
        (BED, &[], &["smooth.largest_cell=-1.0"], &["smooth.largest_cell = -1", "between"]),
        (BED, &[], &["smooth.time=-1.0"], &["smooth.time = -1", "between"]),
        (
            BED,
            &[],
            &["smooth.time=0.1", "coupling.continuity=solids-flux"],
            &["smooth.time = 0.1", "do not fit", "\"voidage-rate\""],
        ),
        (
            BED,
            &[],
            &["dem.coarse_graining={ steel = 2.0 }"],
            &["dem.coarse_graining = steel", "{ 1 = 4.0, 2 = 10.0 }"],
        ),
        (BED, &[], &["dem.coarse_graining={ 1 = 0.5 }"], &["dem.coarse_graining.1 = 0.5", "between"]),
        (
            BED,
            &[],
            &["dem.coarse_graining=big"],
            &["dem.coarse_graining: a number, or one for each particle type"],
        ),
        (
            BED,
            &[],
            &[
                "dem.coarse_graining={ 1 = 2.0 }",
                "forces.drag=beetstra-filtered",
                "forces.filter_diameter=1e-3",
                "forces.filter_density=1000.0",
            ],
            &["dem.coarse_graining = by type", "one ratio for all"],
        ),
        (
            BED,
            &[],
            &["forces.added_mass=felderhoff"],
            &["forces.added_mass = \"felderhoff\"", "forces.added_mass = \"felderhof\"?"],
        ),
        (
            BED,
            &[],
            &["forces.torque=much"],
            &["forces.torque = \"much\"", "invalid type", "expected a boolean"],
        ),
        // what newcomers type: each problem with its key, and what to type
        (
            BED,
            &[("case.toml", "density = 1.2", "density = \"1.2\""), ("case.toml", "interval = 20", "")],
            &["fluid.gravity=-9.81"],
            &[
                "fluid.density = \"1.2\"",
                "expected a number (kg/m3)",
                "fluid.gravity = -9.81",
                "e.g. fluid.gravity = [0.0, 0.0, -9.81]",
                "coupling.interval = nothing: it must be given (DEM steps)",
                "in [coupling]: interval = 20",
            ],
        ),
        (BED, &[("case.toml", "density = 1.2", "density = 1,2")], &[], &["line 9 (density = 1,2"]),
        (BED, &[], &["fluid.viscosity=1e-5"], &["did you mean fluid.kinematic_viscosity?"]),
        (
            BED,
            &[("case.toml", "format = 1", "format = 1\ndensity = 1")],
            &[],
            &["did you mean fluid.density?"],
        ),
        // 18/√π 1000/3000 √(1e-5 2e-4)/1e-4
        (
            SETTLING,
            &[],
            &["forces.history=true", "fluid.density=1000.0"],
            &["forces.history = true", "by 1.51 of it", "a fluid step of at most 2.2e-5 s"],
        ),
        (
            SETTLING,
            &[],
            &["dem.program=lamps"],
            &["dem.program = \"lamps\"", "accepted: liggghts, lammps", "dem.program = \"lammps\"?"],
        ),
        (
            SETTLING,
            &[],
            &["dem.program=lammps"],
            &[
                "atom_style = granular: in LAMMPS",
                "atom_style sphere",
                "communicate: a command of LIGGGHTS, dem.program is \"lammps\"; in the script: comm_modify vel yes",
                "pair_style gran:",
                "fix property/global:",
            ],
        ),
        (
            SETTLING,
            &[],
            &["dem.script=lammps.in"],
            &["comm_modify: a command of LAMMPS, dem.program is \"liggghts\"", "communicate single vel yes"],
        ),
        (SETTLING, &[], &["dem.program=lammps", "dem.script=no.in"], &["no.in", "to the LAMMPS script"]),
        (
            SETTLING,
            &[
                ("lammps.in", "timestep        1e-5", "timestep 2e-5"),
                ("lammps.in", "units           si", "units lj"),
            ],
            &LAMMPS,
            &["dem.time_step = 0.00001: the script has timestep 0.00002", "units = lj", "units si"],
        ),
        (
            SETTLING,
            &[("lammps.in", "fix             voidage all voidage", "")],
            &LAMMPS,
            &["no `fix ... voidage`", "add: fix voidage all voidage"],
        ),
        (
            "periodic-box",
            &[("lammps.in", "block 0 0.002605", "block 0 0.003")],
            &LAMMPS,
            &["DEM box in x", "equal in periodic directions"],
        ),
        (SETTLING, &[], &["fluid.case=nowhere"], &["fluid.case = nowhere", "controlDict"]),
    ];
    for (i, (case, edits, set, says)) in table.iter().enumerate() {
        let (code, text) = check(&format!("e{i}"), case, edits, set);
        assert_eq!(code, 2, "{set:?} {edits:?}: {text}");
        for w in *says {
            assert!(text.contains(w), "{w:?} is missing ({set:?} {edits:?}): {text}");
        }
    }
}

#[test]
fn warnings() {
    let smooth = "smooth.method=chebyshev";
    let no_slip = ("fluid/0/U", "frontAndBack { type slip; }", "frontAndBack { type noSlip; }");
    let table: &[Message] = &[
        (
            SETTLING,
            &[],
            &[smooth, "smooth.bandwidth=5e-5"],
            &["below one particle diameter", "smooth.bandwidth = 4e-4"],
        ),
        (
            SETTLING,
            &[],
            &[smooth, "smooth.bandwidth=1e-3"],
            &["less than half the mean cell size 1.000e-2 m"],
        ),
        (SETTLING, &[], &["dem.force=constant"], &["errs by K Δt/(2 m)"]),
        (
            SETTLING,
            &[("particles.in", "0 0.1 0 0.1 0 0.1", "0 0.1 0 0.1 0 0.2")],
            &[],
            &["DEM box in z = [0, 0.2]", "limits.outside = \"exclude\""],
        ),
        // 2 (b/L)² = 2 (4.8/10)² = 46 %
        (
            BED,
            &[no_slip],
            &[],
            &["smooth.bandwidth = 0.0048", "about -46 %", "interpolate.fluid_velocity = \"linear\""],
        ),
        (
            BED,
            &[(CONTROL, "deltaT 2e-4;", "deltaT 2e-3;")],
            &["coupling.interval=200"],
            &["Courant number", "R eq. 11"],
        ),
        (
            SETTLING,
            &[("particles.in", "diameter 1e-4", "diameter 4e-3")],
            &[],
            &["smaller than three particle diameters", "smooth.method = \"gaussian\""],
        ),
        (
            SETTLING,
            &[("particles.in", "diameter 1e-4", "diameter 1e-6")],
            &[],
            &["reacts about 120 steps late", "tau_f", "longer than the particle relaxation time"],
        ),
        (
            SETTLING,
            &[("particles.in", "diameter 1e-4", "diameter 2e-5")],
            &["coupling.scheme=explicit"],
            &["tau_f: explicit coupling may be unstable", "R eq. 10"],
        ),
    ];
    let more: &[Message] = &[
        (
            BED,
            &[],
            &["smooth.time=0.1"],
            &["smooth.time = 0.1", "solid_volume_error", "breaks the third law"],
        ),
        (
            SETTLING,
            &[],
            &["forces.history=true", "fluid.density=400.0"],
            &["forces.history = true", "0.61 of it"],
        ),
    ];
    let table = [table, more].concat();
    for (i, (case, edits, set, says)) in table.iter().enumerate() {
        let (_, text) = check(&format!("w{i}"), case, edits, set);
        let lines: Vec<&str> = text.lines().filter(|l| l.starts_with("warning:")).collect();
        for w in *says {
            assert!(lines.iter().any(|l| l.contains(w)), "{w:?} is missing ({set:?} {edits:?}): {text}");
        }
    }
    // the bandwidth against the wake: Re = 0.9 m/s 1.2 mm / 1.5e-5 m2/s; and as a value
    let (_, text) = check("wake-note", BED, &[], &[]);
    let says = [
        "note: smooth.bandwidth = 0.0048: 4.00 particle diameters",
        "Re 72.00",
        "b = 5.0 diameters",
        "4 to 6",
    ];
    assert!(says.iter().all(|w| text.contains(w)), "{text}");
    let (code, text) = check("wake", BED, &[], &["smooth.bandwidth=wake"]);
    assert!(code == 0 && text.contains("note: smooth.bandwidth = 0.0059") && text.contains("4.9"), "{text}");
    let (_, text) = check("wake-far", BED, &[], &["smooth.bandwidth=0.03"]);
    assert!(text.contains("warning: smooth.bandwidth = 0.03: 25.00 particle diameters"), "{text}");
    // settled walls that let the fluid slip have no profile: nothing to warn of
    assert!(!check("slip", BED, &[], &[]).1.contains("laminar profile"));
}
