// SPDX-License-Identifier: MIT OR Apache-2.0
//! Restart with the real programs: a run in two parts is the run in one. Needs `./setup build`.

mod common;

use common::folder::{PROGRAMS, copy, copy_case, root};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use voidage::output::restart::{State, sets};

/// A copy of a case with other times, removed at the end.
struct Case(PathBuf);

impl Drop for Case {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

impl Case {
    fn new(name: &str, part: &str, end: f64) -> Self {
        Self::of("liggghts", name, part, end)
    }
    fn of(program: &str, name: &str, part: &str, end: f64) -> Self {
        let folder = format!("voidage-restart-{program}-{name}-{part}-{}", std::process::id());
        let c = Self(std::env::temp_dir().join(folder));
        let _ = std::fs::remove_dir_all(&c.0);
        copy_case(name, &c.0, program);
        let _ = std::fs::remove_dir_all(c.0.join("fluid/constant/polyMesh"));
        c.entry("endTime", &end.to_string());
        c.entry("writeFormat", "binary");
        c
    }
    /// Sets an entry of controlDict.
    fn entry(&self, key: &str, value: &str) {
        let file = self.0.join("fluid/system/controlDict");
        let text = std::fs::read_to_string(&file).unwrap();
        let line = |l: &str| {
            if l.starts_with(&format!("{key} ")) { format!("{key} {value};\n") } else { format!("{l}\n") }
        };
        std::fs::write(&file, text.lines().map(line).collect::<String>()).unwrap();
    }
    fn try_run(&self, more: &[&str]) -> Output {
        assert!(
            root().join("build/bin/voidageFoam").exists(),
            "the C++ sides are not built: type ./setup build"
        );
        let mut c = Command::new(env!("CARGO_BIN_EXE_voidage"));
        c.env("VOIDAGE_HOME", root().join("build")).stdin(Stdio::null());
        c.arg("run").arg(&self.0).args(more).output().unwrap()
    }
    fn run(&self, more: &[&str]) {
        let out = self.try_run(more);
        assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    }
    fn fails(&self, more: &[&str], code: i32, says: &[&str]) {
        let out = self.try_run(more);
        let text = String::from_utf8_lossy(&out.stderr).into_owned();
        assert_eq!(out.status.code(), Some(code), "{text}");
        assert!(says.iter().all(|s| text.contains(s)), "{text}");
    }
    fn refused(&self, more: &[&str], code: i32, says: &[&str]) {
        self.fails(&[&["--restart"], more].concat(), code, says);
    }
    /// monitor.csv, by exchange, without times.
    fn rows(&self) -> BTreeMap<i64, BTreeMap<String, f64>> {
        let text = std::fs::read_to_string(self.0.join("monitor.csv")).unwrap();
        let mut lines = text.lines().map(|l| l.split(',').collect::<Vec<_>>());
        let names = lines.next().unwrap();
        let row = |l: Vec<&str>| {
            let cells = names.iter().zip(&l).filter(|c| !c.0.ends_with("_s") || *c.0 == "time_s");
            (l[0].parse().unwrap(), cells.map(|c| (c.0.to_string(), c.1.parse().unwrap_or(0.0))).collect())
        };
        lines.map(row).collect()
    }
    fn newest(&self) -> (State, PathBuf) {
        let folder = sets(&self.0).pop().unwrap().1;
        (State::read(&folder).unwrap(), folder)
    }
}

/// Runs 0 → 2 T in one and in two parts; the two cases.
fn both(program: &str, name: &str, half: f64, options: &[&str]) -> (Case, Case) {
    both_changed(program, name, half, options, |_| {})
}

/// The same with a changed script.
fn both_changed(
    program: &str,
    name: &str,
    half: f64,
    options: &[&str],
    change: impl Fn(&mut String),
) -> (Case, Case) {
    let tag = format!("{}", options.len());
    let part = |part: &str, end: f64| Case::of(program, name, &format!("{part}{tag}"), end);
    let (one, two) = (part("one", 2.0 * half), part("two", half));
    for c in [&one, &two] {
        c.entry("writeInterval", &half.to_string());
        let script = c.0.join("particles.in");
        let mut text = std::fs::read_to_string(&script).unwrap();
        change(&mut text);
        std::fs::write(script, text).unwrap();
    }
    run_both(&one, &two, half, options);
    (one, two)
}

/// The first case in one part, the second, which ends at T, in two.
fn run_both(one: &Case, two: &Case, half: f64, options: &[&str]) {
    one.run(options);
    two.run(options);
    two.entry("endTime", &(2.0 * half).to_string());
    two.run(&[options, &["--restart"]].concat());
    let (a, b) = (one.rows(), two.rows());
    assert_eq!(a.keys().collect::<Vec<_>>(), b.keys().collect::<Vec<_>>(), "one row per exchange");
    assert!(b.values().all(|r| r["action_reaction_error"] <= 1e-12 && r["solid_volume_error"] <= 1e-12));
}

/// 216 spheres of 0.5 mm in a lattice settle, sheared, in the box of `settling`; the fluid is a stock solver's.
fn stock(solver: &str, part: &str, end: f64, interval: f64) -> Case {
    let c = Case::new("settling", &format!("{solver}-{part}"), end);
    let change = |file: &str, pairs: &[(&str, &str)]| {
        let text = std::fs::read_to_string(c.0.join(file)).unwrap();
        let text = pairs.iter().fold(text, |t, (old, new)| {
            assert!(t.contains(old), "{old}");
            t.replace(old, new)
        });
        std::fs::write(c.0.join(file), text).unwrap();
    };
    let solver = format!("[fluid]\nsolver = \"{solver}\"");
    let smooth = "method = \"gaussian\"\nbandwidth = 2e-2";
    change(
        "case.toml",
        &[
            ("[fluid]", &*solver),
            ("interval = 20", "model = \"B\"\ninterval = 20"),
            ("method = \"none\"", smooth),
            ("[forces]", "[forces]\nviscous_stress = false"),
        ],
    );
    change(
        "particles.in",
        &[
            (
                "neighbor ",
                "lattice sc 0.013\nregion inner block 0.01 0.09 0.01 0.09 0.01 0.09 units box\nneighbor ",
            ),
            ("create_atoms 1 single 0.0512 0.0523 0.0941 units box", "create_atoms 1 region inner"),
            ("density 3000\"", "density 3000\" \"velocity all ramp vx -0.1 0.1 z 0.01 0.09 units box\""),
            ("diameter 1e-4", "diameter 5e-4"),
            (
                "run             1000000000",
                "run 1000000000\nwrite_dump all custom final.txt id x y z vx vy vz modify sort id format \
                 \"%d %.17g %.17g %.17g %.17g %.17g %.17g\"",
            ),
        ],
    );
    change("fluid/system/fvSolution", &[("PIMPLE", "\"(PIMPLE|PISO)\"")]);
    change(
        "fluid/system/controlDict",
        &[("startTime 0;", "startTime 0;\nfunctions { voidage { type voidage; } }")],
    );
    std::fs::write(
        c.0.join("fluid/constant/fvOptions"),
        "FoamFile { version 2.0; format ascii; class dictionary; object fvOptions; }\n\
         voidage { type voidageSource; voidageSourceCoeffs { fields (U); } }\n",
    )
    .unwrap();
    c.entry("startFrom", "latestTime");
    c.entry("writeInterval", &interval.to_string());
    c
}

/// Fields, particles and books at the end are the same to the bit (books: as printed).
fn same_end(one: &Case, two: &Case, time: &str, ranks: u32) {
    let read = |c: &Case, file: &str| std::fs::read(c.0.join(file)).unwrap_or_else(|e| panic!("{file}: {e}"));
    for rank in 0..ranks {
        let part = if ranks == 1 { String::new() } else { format!("processor{rank}/") };
        for name in ["U", "p", "phi"] {
            let file = format!("fluid/{part}{time}/{name}");
            assert!(read(one, &file) == read(two, &file), "{file}");
        }
    }
    assert!(read(one, "final.txt") == read(two, "final.txt"), "particles");
    let (a, b) = (one.rows(), two.rows());
    assert_eq!(a.keys().collect::<Vec<_>>(), b.keys().collect::<Vec<_>>(), "one row per exchange");
    assert!(b.values().all(|r| r["action_reaction_error"] <= 1e-12 && r["solid_volume_error"] <= 1e-12));
    for (k, row) in &a {
        assert!(*k == 0 || row["given_z"] != 0.0, "the fluid feels the particles");
        // these two are rounding, in the order the DEM has its particles in
        for (name, x) in row.iter().filter(|c| !["action_reaction_error", "ledger_left"].contains(&&**c.0)) {
            assert!(*x == b[k][name], "{name} of exchange {k}: {x} and {}", b[k][name]);
        }
    }
}

/// A stock solver in one and in two parts, then from an earlier set.
fn stock_in_two_parts(solver: &str, ranks: u32) {
    let half = 0.01;
    let (one, two) = (stock(solver, "one", 2.0 * half, 0.005), stock(solver, "two", half, 0.005));
    let (dem, cfd) = (format!("run.dem_ranks={ranks}"), format!("run.cfd_ranks={ranks}"));
    let options = ["--set", &*dem, "--set", &*cfd];
    run_both(&one, &two, half, &options);
    same_end(&one, &two, "0.02", ranks);
    // an earlier set: the solver must be told
    two.fails(
        &[&options[..], &["--restart=0.015"]].concat(),
        2,
        &[
            "would begin at t = 0.02",
            "the restart set is of t = 0.015",
            "startFrom startTime; startTime 0.015;",
        ],
    );
    two.entry("startFrom", "startTime");
    two.entry("startTime", "0.015");
    two.run(&[&options[..], &["--restart=0.015"]].concat());
    same_end(&one, &two, "0.02", ranks);
}

#[test]
fn a_stock_solver_in_two_parts_is_the_same_to_the_bit() {
    stock_in_two_parts("pimpleFoam", 1);
}

#[test]
fn a_stock_solver_in_two_parts_is_the_same_to_the_bit_on_two_ranks_each() {
    stock_in_two_parts("pisoFoam", 2);
}

#[test]
fn a_stock_solver_that_begins_elsewhere_or_is_not_coupled_is_told_at_once() {
    let begin = std::time::Instant::now();
    let c = stock("pimpleFoam", "wrong", 0.002, 0.002);
    c.run(&[]);
    c.entry("endTime", "0.004");
    c.entry("startFrom", "startTime");
    c.refused(&[], 2, &["would begin at t = 0:", "startFrom startTime; startTime 0.002;"]);
    // what the check cannot read the coupler sees
    c.entry("application", "pimpleFoam; begin startTime");
    c.entry("startFrom", "$begin");
    c.refused(&[], 1, &["starts at t = 0 s, the restart set is of t = 0.002 s"]);
    c.entry("startFrom", "startTime");
    let options = c.0.join("fluid/constant/fvOptions");
    let text = std::fs::read_to_string(&options).unwrap();
    std::fs::remove_file(&options).unwrap();
    c.fails(&[], 1, &["CFD rank 0 gave up: the solver took no sources in this step"]);
    std::fs::write(&options, text).unwrap();
    c.entry("functions", "{} //");
    c.fails(&[], 1, &["CFD rank 0 gave up: the step before was not sent"]);
    assert!(begin.elapsed().as_secs() < 40, "no wait runs to its limit");
}

#[test]
fn large_eddies_with_a_wall_function_go_on_to_the_bit() {
    let half = 0.004;
    let made = |part: &str, end: f64| {
        let c = Case::new("settling", &format!("eddies-{part}"), end);
        c.entry("writeInterval", &half.to_string());
        let head =
            |class: &str| format!("FoamFile {{ version 2.0; format ascii; class {class}; object x; }}\n");
        let file = |name: &str, class: &str, text: &str| {
            std::fs::write(c.0.join("fluid").join(name), head(class) + text).unwrap();
        };
        let model = "simulationType LES; LES { LESModel Smagorinsky; turbulence on; delta cubeRootVol; cubeRootVolCoeffs {} }";
        file("constant/turbulenceProperties", "dictionary", model);
        let walls = "boundaryField { walls { type nutUSpaldingWallFunction; value uniform 0; } }";
        let nut = format!("dimensions [0 2 -1 0 0 0 0]; internalField uniform 0; {walls}");
        file("0/nut", "volScalarField", &nut);
        let flow = "dimensions [0 1 -1 0 0 0 0]; internalField uniform (0.3 0.2 0.1); boundaryField { walls { type noSlip; } }";
        file("0/U", "volVectorField", flow);
        c
    };
    let (one, two) = (made("one", 2.0 * half), made("two", half));
    // the flow begins with a jolt: the books, of one small sphere in it, close to rounding of what it jolts
    one.run(&[]);
    two.run(&[]);
    two.entry("endTime", &(2.0 * half).to_string());
    two.run(&["--restart"]);
    assert_eq!(one.rows().len(), two.rows().len());
    for name in ["U", "p", "nut"] {
        let read = |c: &Case| std::fs::read(c.0.join("fluid/0.008").join(name)).unwrap();
        assert!(read(&one) == read(&two), "{name}");
    }
}

#[test]
fn one_particle_in_two_parts_is_the_same_to_the_bit() {
    for program in PROGRAMS {
        let (one, two) = both(program, "settling", 0.02, &[]);
        assert_eq!(one.rows(), two.rows());
        let ((a, x), (b, y)) = (one.newest(), two.newest());
        assert_eq!((a.voidage, a.velocity, a.particles_sum), (b.voidage, b.velocity, b.particles_sum));
        // position included: the particle's row of the DEM's file
        assert_eq!(
            std::fs::read(x.join("particles")).unwrap().len(),
            std::fs::read(y.join("particles")).unwrap().len()
        );
    }
}

#[test]
fn a_bed_with_contacts_goes_on_without_a_jump_on_two_ranks_each() {
    for program in PROGRAMS {
        let half = 0.004;
        let (one, two) =
            both(program, "fluidised-bed", half, &["--set", "run.dem_ranks=2", "--set", "run.cfd_ranks=2"]);
        let (a, b) = (one.rows(), two.rows());
        let first = (half / 2e-4_f64).round() as i64;
        let size = |r: &BTreeMap<String, f64>| {
            ["given_x", "given_y", "given_z"].map(|c| r[c].abs()).iter().sum::<f64>()
        };
        // before: nothing differs; the first steps after: rounding (neighbour lists are in another order); later a
        // bed of grains amplifies it, so only the first twenty steps are compared
        for k in 1..=first + 20 {
            let (x, y) = (&a[&k], &b[&k]);
            let limit = if k <= first { 0.0 } else { 1e-9 };
            for c in ["given_x", "given_y", "given_z"] {
                assert!((x[c] - y[c]).abs() <= limit * size(x), "{c} of exchange {k}: {} and {}", x[c], y[c]);
            }
            assert!(
                (x["ledger_momentum"] - y["ledger_momentum"]).abs() <= 1e-6 * x["ledger_momentum"],
                "exchange {k}"
            );
        }
        let (a, b) = (one.newest().0, two.newest().0);
        let gap = a.voidage.iter().zip(&b.voidage).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max);
        assert!(gap < 1e-9, "voidage differs by {gap}");
    }
}

#[test]
fn particles_on_their_way_out_of_a_periodic_box_come_back() {
    // between two rebuilds of the neighbour lists they stand outside; a restart file takes them to the other side
    for program in PROGRAMS {
        let (one, two) = both(program, "periodic-box", 0.01068, &["--set", "run.dem_ranks=2"]);
        let (a, b) = (one.rows(), two.rows());
        let last = *a.keys().last().unwrap();
        assert_eq!((last, a[&last]["particles"], b[&last]["particles"]), (60, 2000.0, 2000.0), "{program}");
        let size = a.values().map(|r| r["given_z"].abs()).fold(0.0, f64::max);
        for c in ["given_x", "given_y", "given_z"] {
            let gap = a.iter().map(|(k, r)| (r[c] - b[k][c]).abs()).fold(0.0, f64::max);
            assert!(gap <= 1e-9 * size, "{program}: {c} differs by {gap:e} of {size:e}");
        }
    }
}

#[test]
fn particles_outside_a_side_that_follows_them_come_back() {
    // rising at 1 m/s, rebuilds of the lists 1 ms apart: 0.7 mm above the last place of the shrink-wrapped upper side
    for program in PROGRAMS {
        let (one, two) =
            both_changed(program, "settling", 0.0046, &["--set", "output.picture=none"], |text| {
                for (old, new) in [
                    ("boundary        f f f", "boundary        f f fm"),
                    ("0 0.1 0 0.1 0 0.1", "0 0.1 0 0.1 0 0.06"),
                    ("0.0941 units", "0.0597 units"),
                    ("density 3000\"", "density 3000\" \"velocity all set 0.0 0.0 1.0\""),
                ] {
                    assert!(text.contains(old), "{old}");
                    *text = text.replace(old, new);
                }
            });
        assert_eq!(one.rows(), two.rows(), "{program}");
        assert_eq!(one.rows().len(), 47);
    }
}

#[test]
fn sets_that_do_not_match_are_refused() {
    let c = Case::new("settling", "refused", 0.004);
    c.entry("writeInterval", "0.002");
    c.refused(&[], 2, &["there is no restart set"]);
    c.run(&[]);
    c.refused(&[], 2, &["endTime", "there is nothing left to run"]);
    c.entry("endTime", "0.006");
    assert_eq!(sets(&c.0).iter().map(|s| s.0).collect::<Vec<_>>(), [0.002, 0.004]);
    let bad = c.try_run(&["--restart=0.003"]);
    assert!(String::from_utf8_lossy(&bad.stderr).contains("there are sets of t = 0.002, 0.004"));
    c.refused(
        &["--set", "forces.history=true"],
        2,
        &["forces = ", "0 numbers for the history force", "[auto]"],
    );
    c.refused(&["--set", "run.cfd_ranks=2"], 2, &["the fluid's fields of this set lie on 1 ranks"]);
    c.refused(&["--into", "/tmp/nowhere"], 2, &["leave --into out"]);
    let (_, set) = c.newest();
    // the DEM's file of another time
    let own = std::fs::read(set.join("particles")).unwrap();
    std::fs::copy(set.with_file_name("0.002").join("particles"), set.join("particles")).unwrap();
    c.refused(&[], 1, &["starts at step 200, the restart set is of step 400"]);
    std::fs::write(set.join("particles"), &own[..own.len() - 8]).unwrap();
    c.refused(&[], 2, &["the coupler's file of this set goes with one of"]);
    std::fs::write(set.join("particles"), &own).unwrap();
    // the fluid's fields of another time
    let (kept, now) = (c.0.join("kept"), c.0.join("fluid/0.004"));
    std::fs::rename(&now, &kept).unwrap();
    c.refused(&[], 2, &["the fluid has no fields of t = 0.004"]);
    copy(&c.0.join("fluid/0.002"), &now);
    c.refused(&[], 1, &["the fluid's fields are not those it was written with"]);
    std::fs::remove_dir_all(&now).unwrap();
    std::fs::rename(&kept, &now).unwrap();
    // the script changes or does not read
    let script = std::fs::read_to_string(c.0.join("particles.in")).unwrap();
    let change = |from: &str, to: &str| {
        assert!(script.contains(from));
        std::fs::write(c.0.join("particles.in"), script.replace(from, to)).unwrap();
    };
    change("fix             gravity", "velocity all set 0.0 0.0 0.1\nfix             gravity");
    c.refused(&[], 1, &["the DEM brought other particles back"]);
    change("read_restart", "nothing");
    c.refused(
        &[],
        2,
        &["the script must take the particles from the restart file", "read_restart ${voidage_restart_file}"],
    );
    std::fs::write(c.0.join("particles.in"), &script).unwrap();
    c.run(&["--restart=0.002"]);
    assert_eq!(c.rows().len(), 31);
}

#[test]
fn a_killed_run_goes_on_from_its_newest_set() {
    let (whole, broken) = (Case::new("settling", "whole", 0.05), Case::new("settling", "killed", 0.05));
    for c in [&whole, &broken] {
        c.entry("writeInterval", "0.005");
    }
    whole.run(&[]);
    let mut c = Command::new(env!("CARGO_BIN_EXE_voidage"));
    c.env("VOIDAGE_HOME", root().join("build")).arg("run").arg(&broken.0);
    let mut child = c.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    while sets(&broken.0).is_empty() {
        assert!(child.try_wait().unwrap().is_none(), "the run ended before its first set");
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    let kill = Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    assert!(kill.success());
    assert_eq!(child.wait().unwrap().code(), Some(130));
    assert!(sets(&broken.0).last().unwrap().0 < 0.049, "it was to be stopped on its way");
    broken.run(&["--restart"]);
    assert_eq!(whole.rows(), broken.rows(), "every exchange once, and the same");
    assert_eq!(sets(&broken.0).len(), 2, "output.restarts sets are kept");
}

#[test]
fn what_forces_keep_with_the_particles_comes_back() {
    for program in PROGRAMS {
        for (tag, force) in [("history", "forces.history=true"), ("torque", "forces.torque=true")] {
            // the name of the folder goes by the number of options
            let more: &[&str] = if tag == "history" { &[] } else { &["--set", "smooth.largest_cell=1.0"] };
            let (one, two) = both(program, "settling", 0.02, &[&["--set", force], more].concat());
            assert_eq!(one.rows(), two.rows(), "{tag}");
            let ((a, x), (b, y)) = (one.newest(), two.newest());
            assert_eq!(
                (a.voidage, a.velocity, a.particles_sum),
                (b.voidage, b.velocity, b.particles_sum),
                "{tag}"
            );
            // the table of the fix, bit by bit, but for the times in the head of the file
            let read = |f: &Path| std::fs::read(f.join("particles")).unwrap();
            let (x, y) = (read(&x), read(&y));
            assert_eq!(x.len(), y.len());
            assert!(x[x.len() - 280..] == y[y.len() - 280..], "{tag}");
            if tag == "history" {
                two.entry("endTime", "0.06");
                two.refused(
                    &["--set", "forces.history=false"],
                    2,
                    &["keep 34 numbers for the history force", "start anew"],
                );
            }
        }
    }
}
