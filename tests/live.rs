// SPDX-License-Identifier: MIT OR Apache-2.0
//! The real programs: kills, bad input, endings. Needs `./setup build`.

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

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

fn copy(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).unwrap();
    for e in std::fs::read_dir(from).unwrap().flatten() {
        let to = to.join(e.file_name());
        if e.path().is_dir() {
            copy(&e.path(), &to);
        } else {
            std::fs::copy(e.path(), to).unwrap();
        }
    }
}

/// A copy of the settling case that would run for minutes.
fn long_case(name: &str) -> Scratch {
    let s = Scratch::new(name);
    copy(&root().join("cases/settling"), &s.case());
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
    let s = long_case(name);
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
    let s = long_case("stall");
    let mut child = start(&s.case(), &["limits.wait=2"]);
    under_way(&s.case(), &mut child);
    let victim = family(child.id()).iter().rev().find(|p| p.1 == "liggghts").unwrap().0;
    kill(victim, "-STOP");
    let (out, took) = finish(child, Duration::from_secs(25));
    let text = String::from_utf8_lossy(&out.stderr).into_owned();
    assert!(text.contains("DEM rank 0 sent no particles for 2 s"), "{text}");
    assert!(took < Duration::from_secs(15) && out.status.code() == Some(1));
}

fn refuse(name: &str, file: &str, old: &str, new: &str, says: &[&str]) {
    let s = long_case(name);
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
    let s = long_case("many");
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
    let s = long_case("partner");
    edit(&s.case().join("particles.in"), "atom_style      granular", "atom_style      granular\nnonsense");
    let (out, _) = finish(start(&s.case(), &[]), Duration::from_secs(40));
    let text = String::from_utf8_lossy(&out.stderr).into_owned();
    assert!(out.status.code() == Some(1) && text.contains("Unknown command: nonsense"), "{text}");
    let s = long_case("order");
    edit(
        &s.case().join("particles.in"),
        "fix             voidage all voidage",
        "fix             voidage all voidage\nfix late all gravity 1 vector 0 0 1",
    );
    let (out, _) = finish(start(&s.case(), &[]), Duration::from_secs(40));
    let text = String::from_utf8_lossy(&out.stderr).into_owned();
    assert!(text.contains("fix late (gravity) adds forces after it"), "{text}");
}

#[test]
fn lines_after_run_are_executed_when_the_fluid_ends() {
    let s = Scratch::new("end");
    copy(&root().join("cases/settling"), &s.case());
    edit(&s.case().join("fluid/system/controlDict"), "endTime 0.24;", "endTime 0.004;");
    let (out, _) = finish(start(&s.case(), &[]), Duration::from_secs(60));
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    let log = std::fs::read_to_string(s.case().join("logs/dem.log")).unwrap();
    assert!(
        log.contains("the coupled run is complete at step 400") && log.contains("terminal velocity"),
        "{log}"
    );
}

#[test]
fn added_mass_and_lift_keep_the_third_law() {
    let s = Scratch::new("added-mass");
    copy(&root().join("cases/settling"), &s.case());
    edit(&s.case().join("fluid/system/controlDict"), "endTime 0.24;", "endTime 0.01;");
    let set = ["forces.added_mass=0.5", "forces.lift=loth", "coupling.feedback=two-way"];
    let (out, _) = finish(start(&s.case(), &set), Duration::from_secs(60));
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    let rows = std::fs::read_to_string(s.case().join("monitor.csv")).unwrap();
    let mut lines = rows.lines();
    let column = lines.next().unwrap().split(',').position(|c| c.contains("action_reaction")).unwrap();
    let errors: Vec<f64> = lines.map(|l| l.split(',').nth(column).unwrap().parse().unwrap_or(0.0)).collect();
    assert!(errors.len() > 20 && errors.iter().any(|e| *e > 0.0), "{errors:?}");
    assert!(errors.iter().all(|e| *e <= 1e-12), "{errors:?}");
}

#[test]
fn a_light_sphere_is_released_with_the_inertia_of_its_added_mass() {
    let s = Scratch::new("light");
    copy(&root().join("cases/settling"), &s.case());
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
