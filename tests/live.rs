// SPDX-License-Identifier: MIT OR Apache-2.0
//! The real programs: kills, bad input, endings. Needs `./setup build`.

mod common;

use common::folder::{PROGRAMS, copy_case, root};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

fn voidage() -> Command {
    assert!(root().join("build/bin/voidageFoam").exists(), "the C++ sides are not built: type ./setup build");
    let mut c = Command::new(env!("CARGO_BIN_EXE_voidage"));
    c.env("VOIDAGE_HOME", root().join("build")).stdin(Stdio::null());
    c
}

/// A scratch folder, removed at the end.
struct Scratch(PathBuf);

impl Scratch {
    fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("voidage-test-{name}-{}", std::process::id()));
        let _ = std::fs::remove_dir_all(&path);
        Self(path)
    }
    fn case(&self) -> PathBuf {
        self.0.join("case")
    }
}
impl Drop for Scratch {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// A copy of the settling case that would run for minutes.
fn long_case(name: &str, program: &str) -> Scratch {
    let s = Scratch::new(name);
    copy_case("settling", &s.case(), program);
    edit(&s.case().join("fluid/system/controlDict"), "endTime 0.24;", "endTime 40;");
    s
}

fn edit(file: &Path, old: &str, new: &str) {
    let text = std::fs::read_to_string(file).unwrap();
    assert!(text.contains(old), "{old}");
    std::fs::write(file, text.replace(old, new)).unwrap();
}

/// (pid, name) of all descendants.
fn family(pid: u32) -> Vec<(u32, String)> {
    let stat = |p: &Path| -> Option<(u32, String, u32)> {
        let text = std::fs::read_to_string(p.join("stat")).ok()?;
        let (open, close) = (text.find('(')?, text.rfind(')')?);
        let mut rest = text[close + 2..].split(' ');
        let state = rest.next()?;
        let parent = rest.next()?.parse().ok()?;
        let number = text[..open - 1].parse().ok()?;
        (state != "Z").then(|| (number, text[open + 1..close].to_string(), parent))
    };
    let all: Vec<_> = std::fs::read_dir("/proc").unwrap().flatten().filter_map(|e| stat(&e.path())).collect();
    let (mut found, mut parents) = (Vec::new(), vec![pid]);
    while let Some(p) = parents.pop() {
        for (number, name, _) in all.iter().filter(|a| a.2 == p) {
            parents.push(*number);
            found.push((*number, name.clone()));
        }
    }
    found
}

fn start(case: &Path, set: &[&str]) -> Child {
    let mut c = voidage();
    c.arg("run").arg(case);
    for s in set {
        c.args(["--set", s]);
    }
    c.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap()
}

/// Waits until exchanges are under way.
fn under_way(case: &Path, child: &mut Child) {
    let begin = Instant::now();
    let rows = || std::fs::read_to_string(case.join("monitor.csv")).map_or(0, |t| t.lines().count());
    while rows() < 20 {
        assert!(begin.elapsed() < Duration::from_secs(60), "the run did not start");
        assert!(child.try_wait().unwrap().is_none(), "the run ended early");
        std::thread::sleep(Duration::from_millis(20));
    }
}

fn finish(child: Child, limit: Duration) -> (Output, Duration) {
    let begin = Instant::now();
    let pid = child.id();
    let watchdog = std::thread::spawn(move || child.wait_with_output().unwrap());
    while !watchdog.is_finished() {
        assert!(begin.elapsed() < limit, "process {pid} did not end in {limit:?}");
        std::thread::sleep(Duration::from_millis(20));
    }
    (watchdog.join().unwrap(), begin.elapsed())
}

fn kill(pid: u32, signal: &str) {
    assert!(Command::new("kill").args([signal, &pid.to_string()]).status().unwrap().success());
}

fn dies(name: &str, program: &str, signal: &str, says: &str, code: i32) {
    let s = long_case(name, if program == "lmp" { "lammps" } else { "liggghts" });
    let mut child = start(&s.case(), &["run.dem_ranks=2", "run.cfd_ranks=2"]);
    under_way(&s.case(), &mut child);
    let pid = child.id();
    let all = family(pid);
    let victim = if program == "run" { pid } else { all.iter().rev().find(|p| p.1 == program).unwrap().0 };
    let token = std::fs::read_to_string(format!("/proc/{victim}/environ")).unwrap_or_default();
    let token = token.split('\0').find_map(|v| v.strip_prefix("VOIDAGE_SESSION=").map(str::to_owned));
    kill(victim, signal);
    let (out, took) = finish(child, Duration::from_secs(20));
    let text = String::from_utf8_lossy(&out.stderr).into_owned();
    assert!(took < Duration::from_secs(10), "took {took:?}");
    assert_eq!(out.status.code(), Some(code), "{text}");
    assert!(text.contains(says), "{text}");
    let left: Vec<_> = all
        .iter()
        .filter(|p| Path::new(&format!("/proc/{}/exe", p.0)).exists())
        .filter(|p| std::fs::read_link(format!("/proc/{}/exe", p.0)).is_ok())
        .collect();
    assert!(left.is_empty(), "left running: {left:?}");
    if let Some(file) = token {
        let root = Path::new(&file).parent().unwrap().to_path_buf();
        assert!(!root.exists());
        let prefix = format!("voidage_{}_", root.file_name().unwrap().to_string_lossy());
        let shm = std::fs::read_dir("/dev/shm").unwrap().flatten();
        assert_eq!(shm.filter(|e| e.file_name().to_string_lossy().starts_with(&prefix)).count(), 0);
    }
}

#[test]
fn a_killed_dem_rank_ends_the_run_and_is_named() {
    dies("dem", "liggghts", "-KILL", "DEM rank", 1);
    dies("dem-lammps", "lmp", "-KILL", "DEM rank", 1);
}

#[test]
fn a_killed_cfd_rank_ends_the_run_and_is_named() {
    dies("cfd", "voidageFoam", "-KILL", "CFD rank", 1);
}

#[test]
fn a_killed_coupler_ends_the_run_and_is_named() {
    dies("couple", "voidage", "-KILL", "couple was killed by signal 9", 1);
}

#[test]
fn ctrl_c_stops_everything() {
    dies("ctrlc", "run", "-INT", "interrupted", 130);
}

#[test]
fn a_stalled_partner_is_named_after_the_limit() {
    for program in PROGRAMS {
        let s = long_case("stall", program);
        let mut child = start(&s.case(), &["limits.wait=2"]);
        under_way(&s.case(), &mut child);
        let victim =
            family(child.id()).iter().rev().find(|p| ["liggghts", "lmp"].contains(&&*p.1)).unwrap().0;
        kill(victim, "-STOP");
        let (out, took) = finish(child, Duration::from_secs(25));
        let text = String::from_utf8_lossy(&out.stderr).into_owned();
        assert!(text.contains("DEM rank 0 sent no particles for 2 s"), "{text}");
        assert!(took < Duration::from_secs(15) && out.status.code() == Some(1));
    }
}

fn refuse(name: &str, file: &str, old: &str, new: &str, says: &[&str]) {
    let s = long_case(name, "liggghts");
    edit(&s.case().join(file), old, new);
    let out = voidage().arg("check").arg(s.case()).output().unwrap();
    let text = String::from_utf8_lossy(&out.stderr).into_owned();
    assert_eq!(out.status.code(), Some(2), "{text}");
    assert!(says.iter().all(|w| text.contains(w)), "{text}");
}

#[test]
fn bad_input_is_refused_with_where_what_accepted_and_what_to_type() {
    let toml = "case.toml";
    refuse(
        "m1",
        toml,
        "drag = \"schiller-naumann\"",
        "drag = \"schiller\"",
        &["forces.drag = \"schiller\"", "accepted: stokes", "schiller-naumann\"?"],
    );
    refuse(
        "m2",
        toml,
        "[smooth]",
        "[smoooth]",
        &["smoooth.method", "unknown", "did you mean smooth.method?"],
    );
    refuse(
        "m3",
        toml,
        "density = 10.0",
        "density = 1e9",
        &["fluid.density = 1000000000", "are the units right?"],
    );
    refuse(
        "m4",
        toml,
        "interval = 20",
        "interval = 21",
        &["coupling.interval = 21", "coupling.interval = 20"],
    );
    refuse(
        "m5",
        toml,
        "time_step = 1e-5",
        "time_step = 2e-5",
        &["dem.time_step", "the script has timestep 0.00001"],
    );
    refuse(
        "m6",
        toml,
        "kinematic_viscosity = 1e-5",
        "kinematic_viscosity = 2e-5",
        &["transportProperties has nu 0.00001"],
    );
    refuse(
        "m7",
        toml,
        "script = \"particles.in\"",
        "script = \"p.in\"",
        &["dem.script = p.in", "No such file"],
    );
    refuse(
        "m8",
        "particles.in",
        "fix             voidage all voidage",
        "",
        &["no `fix ... voidage`", "add: fix voidage all voidage"],
    );
}

#[test]
fn all_problems_are_told_at_once() {
    let s = long_case("many", "liggghts");
    let out = voidage()
        .arg("check")
        .arg(s.case())
        .args(["--set", "fluid.density=1e9", "--set", "run.dem_ranks=0", "--set", "coupling.interval=21"])
        .output()
        .unwrap();
    let text = String::from_utf8_lossy(&out.stderr).into_owned();
    for key in ["fluid.density", "run.dem_ranks", "coupling.interval"] {
        assert!(text.contains(key), "{key}: {text}");
    }
}

#[test]
fn errors_of_the_partners_reach_the_user() {
    for program in PROGRAMS {
        let s = long_case("partner", program);
        edit(&s.case().join("particles.in"), "boundary        f f f", "boundary        f f f\nnonsense");
        let (out, _) = finish(start(&s.case(), &[]), Duration::from_secs(40));
        let text = String::from_utf8_lossy(&out.stderr).into_owned();
        assert!(out.status.code() == Some(1) && text.contains("Unknown command: nonsense"), "{text}");
        let s = long_case("order", program);
        edit(
            &s.case().join("particles.in"),
            "fix             voidage all voidage",
            "fix             voidage all voidage\nfix late all gravity 1 vector 0 0 1",
        );
        let (out, _) = finish(start(&s.case(), &[]), Duration::from_secs(40));
        let text = String::from_utf8_lossy(&out.stderr).into_owned();
        assert!(text.contains("fix late (gravity) adds forces after it"), "{text}");
    }
}

#[test]
fn lines_after_run_are_executed_when_the_fluid_ends() {
    for program in PROGRAMS {
        let s = Scratch::new("end");
        copy_case("settling", &s.case(), program);
        edit(&s.case().join("fluid/system/controlDict"), "endTime 0.24;", "endTime 0.004;");
        let (out, _) = finish(start(&s.case(), &[]), Duration::from_secs(60));
        assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
        let log = std::fs::read_to_string(s.case().join("logs/dem.log")).unwrap();
        assert!(
            log.contains("the coupled run is complete at step 400") && log.contains("terminal velocity"),
            "{log}"
        );
    }
}

#[test]
fn added_mass_and_lift_keep_the_third_law() {
    for program in PROGRAMS {
        let s = Scratch::new("added-mass");
        copy_case("settling", &s.case(), program);
        edit(&s.case().join("fluid/system/controlDict"), "endTime 0.24;", "endTime 0.01;");
        let set = ["forces.added_mass=0.5", "forces.lift=loth", "coupling.feedback=two-way"];
        let (out, _) = finish(start(&s.case(), &set), Duration::from_secs(60));
        assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
        let rows = std::fs::read_to_string(s.case().join("monitor.csv")).unwrap();
        let mut lines = rows.lines();
        let column = lines.next().unwrap().split(',').position(|c| c.contains("action_reaction")).unwrap();
        let errors: Vec<f64> =
            lines.map(|l| l.split(',').nth(column).unwrap().parse().unwrap_or(0.0)).collect();
        assert!(errors.len() > 20 && errors.iter().any(|e| *e > 0.0), "{errors:?}");
        assert!(errors.iter().all(|e| *e <= 1e-12), "{errors:?}");
    }
}

#[test]
fn a_light_sphere_is_released_with_the_inertia_of_its_added_mass() {
    for program in PROGRAMS {
        let s = Scratch::new("light");
        copy_case("settling", &s.case(), program);
        edit(&s.case().join("fluid/system/controlDict"), "endTime 0.24;", "endTime 0.01;");
        edit(&s.case().join("particles.in"), "density 3000", "density 5");
        let set = ["forces.added_mass=0.5", "forces.drag=none", "coupling.feedback=one-way"];
        let (out, _) = finish(start(&s.case(), &set), Duration::from_secs(60));
        assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
        let log = std::fs::read_to_string(s.case().join("logs/dem.log")).unwrap();
        let line = log.lines().rfind(|l| l.starts_with("terminal velocity")).unwrap();
        let rise = -line.split(' ').next_back().unwrap().parse::<f64>().unwrap();
        // (m_f − m) g/(m + ½ m_f) for 0.01 s: 5·9.81/10
        assert!((rise / (4.905 * 0.01) - 1.0).abs() < 1e-5, "{line}");
    }
}

/// The number printed behind these words at the end of the script.
fn printed(case: &Path, what: &str) -> f64 {
    let log = std::fs::read_to_string(case.join("logs/dem.log")).unwrap();
    let line = log.lines().rfind(|l| l.starts_with(what)).unwrap_or_else(|| panic!("{what}: {log}"));
    line.split(' ').next_back().unwrap().parse().unwrap()
}

#[test]
fn a_spinning_sphere_in_still_fluid_slows_down_as_kirchhoff_says() {
    for program in PROGRAMS {
        let spin = if program == "lammps" { "omega 0 100 0" } else { "omegay 100" };
        // heavy: explicit in each DEM step; light: K_w dt/I = 1.2, exact relaxation
        for (density, end, relaxation) in
            [(3000.0, 0.01, 3000.0 * 1e-8 / (60.0 * 1e-4)), (5.0, 0.0002, 5.0 * 1e-8 / (60.0 * 1e-4))]
        {
            let s = Scratch::new(&format!("spin{density}"));
            copy_case("settling", &s.case(), program);
            edit(&s.case().join("fluid/system/controlDict"), "endTime 0.24;", &format!("endTime {end};"));
            let script = s.case().join("particles.in");
            edit(&script, "density 3000", &format!("density {density} {spin}"));
            edit(
                &script,
                "variable        speed",
                "compute w all property/atom omegay\nvariable spin equal c_w[1]\nvariable        speed",
            );
            edit(&script, "v_speed v_height", "v_spin v_speed v_height");
            edit(&script, "thermo          200", "thermo 4");
            edit(&script, "print  ", "print \"spin ${spin}\"\nprint  ");
            let set = ["forces.torque=true", "coupling.feedback=one-way", "forces.drag=none"];
            let (out, _) = finish(start(&s.case(), &set), Duration::from_secs(60));
            assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
            // I dw/dt = −8 π μ r³ w: relaxation time ρ_p d²/(60 μ)
            let (spin, exact) = (printed(&s.case(), "spin "), 100.0 * f64::exp(-end / relaxation));
            let error = (spin - exact).abs() / exact.max(1e-6);
            assert!(error < 2e-3, "{density}: {spin:e} {exact:e}");
        }
    }
}

#[test]
fn a_sphere_released_in_a_liquid_falls_as_bassets_equation_says() {
    for program in PROGRAMS {
        let s = Scratch::new("basset");
        copy_case("settling", &s.case(), program);
        let control = s.case().join("fluid/system/controlDict");
        edit(&control, "endTime 0.24;", "endTime 0.004;");
        edit(&control, "deltaT 2e-4;", "deltaT 2e-5;");
        edit(&s.case().join("fluid/constant/transportProperties"), "nu 1e-5;", "nu 1e-6;");
        edit(&s.case().join("particles.in"), "density 3000", "density 2650");
        let common = [
            "fluid.density=1000.0",
            "fluid.kinematic_viscosity=1e-6",
            "fluid.flow=frozen",
            "coupling.interval=2",
            "coupling.feedback=one-way",
            "forces.drag=stokes",
            "forces.added_mass=0.5",
        ];
        // (m + m_f/2) dv/dt + 3π μ d v + 3/2 d² √(π ρ μ) ∫ v'/√(t−τ) = (m − m_f) g, inverted numerically from
        // V(s) = A/(s (M s + B √s + C)), at 4 ms; without the history A/C (1 − e^{−C t/M})
        for (history, exact) in [(true, 4.936934e-3), (false, 8.077950e-3)] {
            let history = format!("forces.history={history}");
            let set: Vec<&str> = common.iter().copied().chain([history.as_str()]).collect();
            let (out, _) = finish(start(&s.case(), &set), Duration::from_secs(120));
            assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
            let fall = printed(&s.case(), "terminal velocity");
            assert!((fall / exact - 1.0).abs() < 0.02, "{history}: {fall:e} {exact:e}");
        }
    }
}

#[test]
fn all_models_at_once_on_two_ranks_keep_the_third_law() {
    for program in PROGRAMS {
        let s = Scratch::new("models");
        copy_case("periodic-box", &s.case(), program);
        edit(&s.case().join("fluid/system/controlDict"), "endTime 2.0826;", "endTime 0.00712;");
        let set = [
            "run.dem_ranks=2",
            "run.cfd_ranks=2",
            "forces.history=true",
            "forces.torque=true",
            "forces.added_mass=felderhof",
            "forces.lift=saffman-mei",
            "dem.coarse_graining={ 1 = 1.5 }",
            "smooth.by_diameter=[[2e-4, 4e-4]]",
            "smooth.largest_cell=1e-3",
        ];
        let (out, _) = finish(start(&s.case(), &set), Duration::from_secs(120));
        assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
        let rows = std::fs::read_to_string(s.case().join("monitor.csv")).unwrap();
        let mut lines = rows.lines();
        let names: Vec<&str> = lines.next().unwrap().split(',').collect();
        let column = |name: &str| names.iter().position(|c| *c == name).unwrap();
        let rows: Vec<Vec<f64>> =
            lines.map(|l| l.split(',').map(|x| x.parse().unwrap_or(f64::NAN)).collect()).collect();
        let worst = |name: &str| rows.iter().map(|r| r[column(name)]).fold(0.0, f64::max);
        assert!(rows.len() > 15, "{}", rows.len());
        assert!(
            worst("action_reaction_error") <= 1e-12 && worst("action_reaction_error") > 0.0,
            "{}",
            worst("action_reaction_error")
        );
        assert!(worst("solid_volume_error") <= 1e-12);
    }
}

/// What LAMMPS alone, without mpirun and coupler, says to an edited script before the first step.
fn lammps_says(edits: &[(&str, &str)]) -> String {
    let s = long_case("lmp", "lammps");
    edits.iter().for_each(|e| edit(&s.case().join("particles.in"), e.0, e.1));
    let mut c = Command::new("lmp");
    c.args(["-in", "particles.in", "-log", "none"]).current_dir(s.case()).stdin(Stdio::null());
    let out = c.env("LD_PRELOAD", root().join("build/lib/libvoidageLammps.so")).output().unwrap();
    assert!(!out.status.success());
    String::from_utf8_lossy(&out.stdout).into_owned()
}

#[test]
fn wrong_lammps_scripts_are_refused_with_what_to_type() {
    let fix = "fix             voidage all voidage";
    let table: [(&[(&str, &str)], &str); 6] = [
        (
            &[
                ("atom_style      sphere", "atom_style atomic"),
                ("\"set group all diameter 1e-4 density 3000\"", "\"mass 1 1\""),
                ("nve/sphere", "nve"),
            ],
            "has no radius, mass and angular velocity per particle; type: atom_style sphere",
        ),
        (
            &[("atom_modify     map array", "atom_modify id no"), ("vz[1]", "1"), ("z[1]", "1")],
            "the particles have no numbers; leave `atom_modify id no` out",
        ),
        (
            &[("timestep        1e-5", "timestep 1e-5\nrun_style respa 1")],
            "run_style respa does not call it in every step; type: run_style verlet",
        ),
        (&[(fix, "group some id 1\nfix voidage some voidage")], "type: fix ID all voidage"),
        (&[(fix, "fix voidage all voidage\nfix more all voidage")], "there are two of them; keep one"),
        (&[(fix, fix)], "start it by `voidage run CASE`"),
    ];
    for (edits, says) in table {
        let text = lammps_says(edits);
        assert!(text.contains(says), "{says}: {text}");
    }
    // what `voidage check` cannot see, for it reads no file of `include` and no computed variable
    for (old, new, says) in [
        (
            "timestep        1e-5",
            "variable dt equal 1e-5*2\ntimestep ${dt}",
            "LAMMPS 29 Sep 2021 runs with a time step of 2e-5 s, dem.time_step is 1e-5 s: make them equal",
        ),
        ("units           si", "include units.in", "units cgs; the coupling works in SI; type: units si"),
    ] {
        let s = long_case("l-run", "lammps");
        edit(&s.case().join("particles.in"), old, new);
        std::fs::write(s.case().join("units.in"), "units cgs\n").unwrap();
        let (out, _) = finish(start(&s.case(), &[]), Duration::from_secs(60));
        let text = String::from_utf8_lossy(&out.stderr).into_owned();
        assert!(out.status.code() == Some(1) && text.contains(says), "{text}");
    }
}

#[test]
fn a_particle_program_that_is_not_installed_is_named() {
    let s = long_case("absent", "lammps");
    let mut c = voidage();
    let out = c.arg("run").arg(s.case()).env("PATH", s.case()).output().unwrap();
    let text = String::from_utf8_lossy(&out.stderr).into_owned();
    let says = "dem.program = \"lammps\": LAMMPS is not set up (lmp is not on the PATH); type ./setup lammps";
    assert!(out.status.code() == Some(1) && text.contains(says), "{text}");
}

#[test]
fn lammps_and_liggghts_couple_alike_to_the_last_digit() {
    // one sphere without contacts: all that moves it is the fix and velocity Verlet, on any number of ranks
    let rows = |program: &str, ranks: &str| {
        let s = Scratch::new(&format!("alike-{program}-{ranks}"));
        copy_case("settling", &s.case(), program);
        edit(&s.case().join("fluid/system/controlDict"), "endTime 0.24;", "endTime 0.02;");
        let dem = format!("run.dem_ranks={ranks}");
        let (out, _) = finish(start(&s.case(), &[&dem]), Duration::from_secs(60));
        assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
        let text = std::fs::read_to_string(s.case().join("monitor.csv")).unwrap();
        let mut lines = text.lines().map(|l| l.split(',').map(str::to_owned).collect::<Vec<_>>());
        let names = lines.next().unwrap();
        let kept = |i: &usize| names[*i] == "time_s" || !names[*i].ends_with("_s");
        let of = |l: Vec<String>| (0..names.len()).filter(kept).map(|i| l[i].clone()).collect::<Vec<_>>();
        (lines.map(of).collect::<Vec<_>>(), printed(&s.case(), "terminal velocity"))
    };
    let (liggghts, lammps) = (rows("liggghts", "1"), rows("lammps", "1"));
    assert!(liggghts.0.len() == 101 && liggghts.1 > 0.05, "{} rows, {} m/s", liggghts.0.len(), liggghts.1);
    assert_eq!(liggghts, lammps);
    assert_eq!(lammps, rows("lammps", "2"));
}

/// Runs a case that must fail, or be refused, with these words.
fn fails(s: &Scratch, set: &[&str], code: i32, says: &[&str]) {
    let (out, _) = finish(start(&s.case(), set), Duration::from_secs(60));
    let text = String::from_utf8_lossy(&out.stderr).into_owned();
    assert_eq!(out.status.code(), Some(code), "{text}");
    assert!(says.iter().all(|w| text.contains(w)), "{says:?}: {text}");
}

/// The settling case to 4 ms.
fn short_case(name: &str, program: &str) -> Scratch {
    let s = long_case(name, program);
    edit(&s.case().join("fluid/system/controlDict"), "endTime 40;", "endTime 0.004;");
    s
}

#[test]
fn a_script_that_ends_before_the_fluid_is_told_so() {
    for program in ["liggghts", "lammps"] {
        let s = short_case("early", program);
        edit(&s.case().join("particles.in"), "run             1000000000", "run 50\nrun 130");
        fails(&s, &[], 1, &["ended or removed the fix at step 180", "type: run 1000000000", "dem.log"]);
    }
}

#[test]
fn runs_after_the_end_do_not_go_on_for_ever() {
    // the end falls in the third; two more and a loop of millions are left
    let runs =
        "run 100\nrun 50\nrun 1000000000\nrun 1000000000\nprint \"still here\"\nrun 1000000000 every 10 NULL";
    for program in ["liggghts", "lammps"] {
        let s = short_case("loop", program);
        edit(&s.case().join("particles.in"), "run             1000000000", runs);
        let (out, took) = finish(start(&s.case(), &["run.dem_ranks=2"]), Duration::from_secs(60));
        assert!(out.status.success() && took.as_secs() < 40, "{}", String::from_utf8_lossy(&out.stderr));
        let log = std::fs::read_to_string(s.case().join("logs/dem.log")).unwrap();
        assert!(log.contains("still here") && log.contains("the script ends here"), "{log}");
    }
}

#[test]
fn macros_and_includes_of_control_dict_are_read() {
    let s = short_case("macro", "liggghts");
    let control = s.case().join("fluid/system/controlDict");
    edit(&control, "endTime 0.004;", "#include \"times\"");
    edit(&control, "deltaT 2e-4;", "step 2e-4; deltaT $step;");
    std::fs::write(s.case().join("fluid/system/times"), "endTime 0.004;\n").unwrap();
    let (out, _) = finish(start(&s.case(), &[]), Duration::from_secs(60));
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
}

#[test]
fn a_fluid_step_that_changes_during_the_run_ends_it() {
    let s = long_case("step", "liggghts");
    let control = s.case().join("fluid/system/controlDict");
    // else OpenFOAM overlooks changes of the first ten seconds
    let now = "OptimisationSwitches { fileModificationSkew 0; }\nrunTimeModifiable yes;\napplication";
    edit(&control, "application", now);
    let mut child = start(&s.case(), &[]);
    under_way(&s.case(), &mut child);
    std::thread::sleep(Duration::from_millis(1200));
    edit(&control, "deltaT 2e-4;", "deltaT 1e-4;");
    let (out, _) = finish(child, Duration::from_secs(30));
    let text = String::from_utf8_lossy(&out.stderr).into_owned();
    assert!(out.status.code() == Some(1) && text.contains("deltaT became 0.0001 s during the run"), "{text}");
}

#[test]
fn what_a_fluid_case_asks_for_in_vain_is_refused() {
    let head = |object: &str| {
        format!("FoamFile {{ version 2.0; format ascii; class dictionary; object {object}; }}\n")
    };
    let s = short_case("vain", "liggghts");
    let file = |name: &str, text: &str| {
        std::fs::write(s.case().join("fluid").join(name), head("x") + text).unwrap();
    };
    file("constant/MRFProperties", "rotor { cellZone all; omega 10; }");
    file("constant/dynamicMeshDict", "dynamicFvMesh dynamicRefineFvMesh;");
    file("system/decomposeParDict", "numberOfSubdomains 3; method simple;");
    std::fs::rename(s.case().join("fluid/0"), s.case().join("fluid/0.orig")).unwrap();
    let says = [
        "MRFProperties",
        "no rotating frames",
        "dynamicRefineFvMesh",
        "numberOfSubdomains 3",
        "no U and p of t = 0",
        "cp -r 0.orig 0",
    ];
    fails(&s, &["run.cfd_ranks=2"], 2, &says);
    std::fs::rename(s.case().join("fluid/0.orig"), s.case().join("fluid/0")).unwrap();
    file("constant/MRFProperties", "rotor { cellZone all; active no; }");
    file("constant/dynamicMeshDict", "dynamicFvMesh staticFvMesh;");
    // a stub in Debian's package: OpenFOAM's words come through
    file("system/decomposeParDict", "numberOfSubdomains 2; method scotch;");
    fails(&s, &["run.cfd_ranks=2"], 1, &["decomposePar failed", "<scotch>", "method hierarchical"]);
    let s = Scratch::new("wed ge");
    copy_case("settling", &s.case(), "liggghts");
    edit(&s.case().join("fluid/system/blockMeshDict"), "type wall;", "type wedge;");
    fails(&s, &[], 2, &["no path with a blank", "patch = wedge"]);
}

#[test]
fn who_died_is_quoted_and_stack_traces_are_not() {
    let s = short_case("trace", "liggghts");
    edit(&s.case().join("fluid/system/fvSolution"), "(p|pFinal|pcorr)", "(p|pFinal)");
    fails(&s, &[], 1, &["CFD rank 0", "Entry 'pcorr' not found", "cfd.log"]);
}

#[test]
fn a_sphere_that_has_just_crossed_a_periodic_boundary_is_in_the_mesh() {
    let s = short_case("periodic", "liggghts");
    // LIGGGHTS brings it back when it has gone half the skin, 1 mm; the mesh has walls there
    edit(&s.case().join("particles.in"), "boundary        f f f", "boundary        p f f");
    edit(&s.case().join("particles.in"), "single 0.0512", "single 0.0999");
    edit(&s.case().join("particles.in"), "density 3000\"", "density 3000\" \"velocity all set 0.5 0.0 0.0\"");
    let (out, _) = finish(start(&s.case(), &[]), Duration::from_secs(60));
    let text = String::from_utf8_lossy(&out.stderr).into_owned();
    assert!(
        out.status.success() && text.contains("particles would pass where the fluid is bounded"),
        "{text}"
    );
}
