// SPDX-License-Identifier: MIT OR Apache-2.0
//! The real programs, recorded: replays to the bit on any number of threads; a killed run leaves a readable file. Needs
//! `./setup build`.

mod common;

use common::folder::{copy, root};
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

fn voidage(arguments: &[&str]) -> Command {
    assert!(root().join("build/bin/voidageFoam").exists(), "the C++ sides are not built: type ./setup build");
    let mut c = Command::new(env!("CARGO_BIN_EXE_voidage"));
    c.env("VOIDAGE_HOME", root().join("build")).stdin(Stdio::null()).args(arguments);
    c
}

/// A copy of a case that ends at `end` (s), removed at the end.
struct Case(PathBuf);
impl Case {
    fn new(name: &str, case: &str, was: &str, end: &str) -> Self {
        let path = std::env::temp_dir().join(format!("voidage-live-{name}-{}", std::process::id()));
        let _ = std::fs::remove_dir_all(&path);
        copy(&root().join("cases").join(case), &path);
        let control = path.join("fluid/system/controlDict");
        let text = std::fs::read_to_string(&control).unwrap();
        assert!(text.contains(&format!("endTime {was};")));
        std::fs::write(&control, text.replace(&format!("endTime {was};"), &format!("endTime {end};")))
            .unwrap();
        Self(path)
    }
    fn path(&self, name: &str) -> String {
        self.0.join(name).display().to_string()
    }
}
impl Drop for Case {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

fn text(o: &Output) -> String {
    format!("{}{}", String::from_utf8_lossy(&o.stdout), String::from_utf8_lossy(&o.stderr))
}

fn done(arguments: &[&str]) -> String {
    let o = voidage(arguments).output().unwrap();
    assert!(o.status.success(), "{arguments:?}: {}", text(&o));
    text(&o)
}

#[test]
fn the_fluidised_bed_replays_to_the_bit_on_one_and_four_threads() {
    let c = Case::new("bed", "fluidised-bed", "0.5", "0.002");
    let case = c.path("");
    let ranks = ["--set", "run.dem_ranks=2", "--set", "run.cfd_ranks=2"];
    let told = done(&[&["run", &case, "--set", "record.every=1"], &ranks[..]].concat());
    assert!(told.contains("recording: 11 exchanges of"), "{told}");
    let file = c.path("recording.voidage");
    for threads in ["run.threads=1", "run.threads=4"] {
        let told = done(&["replay", &file, "--set", threads]);
        assert!(
            told.contains("11 exchanges, 0 to 10") && told.contains("all replies are bit-identical"),
            "{told}"
        );
    }
    let told = done(&["replay", &file, "--set", "smooth.tolerance=1e-6"]);
    assert!(told.contains("the replies differ"), "{told}");
    let told = done(&["inspect", &file]);
    assert!(told.contains("particles                                    9240"), "{told}");
    // a recording is not overwritten
    let o = voidage(&["run", &case, "--set", "record.every=1"]).output().unwrap();
    assert!(o.status.code() == Some(2) && text(&o).contains("never overwritten"), "{}", text(&o));
}

#[test]
fn a_restarted_run_is_recorded_and_replays_to_the_bit() {
    let c = Case::new("resumed", "fluidised-bed", "0.5", "0.002");
    let control = Path::new(&c.path("fluid/system/controlDict")).to_path_buf();
    let set = |old: &str, new: &str| {
        let text = std::fs::read_to_string(&control).unwrap();
        assert!(text.contains(old));
        std::fs::write(&control, text.replace(old, new)).unwrap();
    };
    set("writeInterval 0.01;", "writeInterval 0.001;");
    let case = c.path("");
    done(&["run", &case]);
    set("endTime 0.002;", "endTime 0.003;");
    done(&["run", &case, "--restart", "--set", "record.every=2"]);
    let told = done(&["replay", &c.path("recording-from-0.002.voidage")]);
    assert!(
        told.contains("2 exchanges, 12 to 14") && told.contains("all replies are bit-identical"),
        "{told}"
    );
}

#[test]
fn a_killed_run_leaves_a_recording_to_its_last_whole_exchange() {
    let c = Case::new("killed", "settling", "0.24", "40");
    let case = c.path("");
    let mut run = voidage(&["run", &case, "--set", "record.every=1"]);
    let mut run = run.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    let begin = Instant::now();
    let rows = || std::fs::read_to_string(c.path("monitor.csv")).map_or(0, |t| t.lines().count());
    while rows() < 50 {
        assert!(
            begin.elapsed() < Duration::from_secs(120) && run.try_wait().unwrap().is_none(),
            "the run did not start"
        );
        std::thread::sleep(Duration::from_millis(20));
    }
    // the coupler itself, without warning
    let coupler = std::fs::read_dir("/proc").unwrap().flatten().find_map(|e| {
        let pid: i32 = e.file_name().to_str()?.parse().ok()?;
        let line = std::fs::read(e.path().join("cmdline")).ok()?;
        let line = String::from_utf8_lossy(&line).replace('\0', " ");
        let mine = line.contains(" couple ") && line.contains(case.trim_end_matches('/'));
        (mine && !line.starts_with("mpirun")).then_some(pid)
    });
    let pid = rustix::process::Pid::from_raw(coupler.expect("no coupler")).unwrap();
    rustix::process::kill_process(pid, rustix::process::Signal::KILL).unwrap();
    assert!(!run.wait().unwrap().success());
    let file = c.path("recording.voidage");
    let told = done(&["replay", &file]);
    assert!(
        told.contains("the run was stopped while it was recorded") && told.contains("bit-identical"),
        "{told}"
    );
    let told = done(&["export", &file, "--into", &c.path("csv"), "--format", "csv", "--every", "20"]);
    assert!(told.contains("rows of the monitor"), "{told}");
}
