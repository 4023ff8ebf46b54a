// SPDX-License-Identifier: MIT OR Apache-2.0
//! The commands of the program: from arguments to an exit code. What is printed for people is printed here.
#![allow(clippy::print_stderr, clippy::print_stdout)]

pub mod export;
pub mod inspect;
pub mod record;
pub mod report;
pub mod stability;
pub mod tune;

use crate::auto;
use crate::config::{self, CaseFile, Config, Problem, Severity};
use crate::couple::{Exchange, receive_mesh};
use crate::launch::{self, Outcome};
use crate::monitor::{self, Monitor};
use crate::output::restart::{Sets, State};
use crate::partners::Partners;
use crate::record::{Recorded, Recorder};
use crate::{map, setup, threads};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};
use voidage_shm::Hub;
use voidage_wire::{PROTOCOL, Role, Session};

/// All fine.
pub const OK: u8 = 0;
/// The run failed.
pub const FAILED: u8 = 1;
/// Bad input.
pub const BAD_INPUT: u8 = 2;
/// Ctrl-C.
pub const INTERRUPTED: u8 = 130;

fn overrides(set: &[String]) -> Result<Vec<(String, String)>, Vec<Problem>> {
    let split = |s: &String| {
        let bad = || {
            vec![Problem::error("--set", s, "overrides are section.key=value", "--set smooth.bandwidth=3e-3")]
        };
        let (k, v) = s.split_once('=').ok_or_else(bad)?;
        Ok((k.trim().to_string(), v.trim().to_string()))
    };
    set.iter().map(split).collect()
}

fn print(problems: &[Problem]) {
    for p in problems {
        eprintln!("{p}");
    }
}

/// The case as it will run, and what `auto` has chosen.
fn read(case: &Path, set: &[String]) -> Result<(Config, Option<auto::Plan>), u8> {
    let config = overrides(set).and_then(|o| config::load(case, &o));
    let chosen = config.and_then(|mut c| auto::resolve(&mut c).map(|plan| (c, plan)));
    chosen.map_err(|p| {
        print(&p);
        BAD_INPUT
    })
}

/// `voidage check CASE`
pub fn check(case: &Path, set: &[String]) -> u8 {
    let (config, plan) = match read(case, set) {
        Ok(c) => c,
        Err(code) => return code,
    };
    let mut problems = config::check(&config);
    problems.splice(0..0, config::beginning(&config));
    print(&problems);
    plan.iter().for_each(|p| print!("{p}"));
    record::forecast(&config);
    let count = |s: Severity| problems.iter().filter(|p| p.severity == s).count();
    let errors = count(Severity::Error);
    println!("{}: {errors} errors, {} warnings", case.display(), count(Severity::Warning));
    if errors == 0 { OK } else { BAD_INPUT }
}

/// `voidage run CASE`
pub fn run(case: &Path, into: Option<&Path>, set: &[String], restart: Option<Option<f64>>) -> u8 {
    if into.is_some() && restart.is_some() {
        let fix = "leave --into out";
        print(&[Problem::error("--restart", "--into", "a restart goes on in the folder of the run", fix)]);
        return BAD_INPUT;
    }
    // problems of the original are told before anything is copied
    let (mut config, plan) = match read(case, set) {
        Ok(c) => c,
        Err(code) => return code,
    };
    let restart = match restart.map(|time| launch::restart::find(&config, time)).transpose() {
        Ok(r) => r,
        Err(p) => {
            print(&p);
            return BAD_INPUT;
        }
    };
    if let Some(r) = &restart {
        config.control.start = r.state.origin;
    }
    let mut problems = config::check(&config);
    if restart.is_none() {
        let begin = config::beginning(&config).into_iter();
        problems.splice(0..0, begin.filter(|p| into.is_none() || p.place != "case"));
    }
    // numbers to judge by are for `check`
    problems.retain(|p| p.severity != Severity::Note);
    print(&problems);
    if problems.iter().any(|p| p.severity == Severity::Error) {
        return BAD_INPUT;
    }
    let config = match into {
        None => config,
        Some(folder) => {
            if let Err(e) = launch::prepare::copy(case, folder) {
                eprintln!("error: {e}");
                return BAD_INPUT;
            }
            match read(folder, set) {
                Ok((c, _)) => c,
                Err(code) => return code,
            }
        }
    };
    plan.iter().for_each(|p| print!("{p}"));
    if let Err(p) = record::before(&config, restart.as_ref().map(|r| r.state.time)) {
        print(&[p]);
        return BAD_INPUT;
    }
    let stop = Arc::new(AtomicBool::new(false));
    for signal in [signal_hook::consts::SIGINT, signal_hook::consts::SIGTERM] {
        if let Err(e) = signal_hook::flag::register(signal, Arc::clone(&stop)) {
            eprintln!("error: signals cannot be caught: {e}");
            return FAILED;
        }
    }
    let begin = Instant::now();
    match launch::run(&config, restart.as_ref(), &stop) {
        Ok(Outcome::Complete) => {
            println!(
                "complete in {:.1} s; results in {}",
                begin.elapsed().as_secs_f64(),
                config.folder.display()
            );
            OK
        }
        Ok(Outcome::Interrupted) => {
            eprintln!("interrupted; all programs were stopped");
            INTERRUPTED
        }
        Ok(Outcome::Failed(why)) => {
            eprintln!("error: the run failed: {why}");
            FAILED
        }
        Err(e) => {
            eprintln!("error: {e}");
            FAILED
        }
    }
}

/// `voidage couple CASE`; its standard output is read by `voidage run`.
pub fn couple(case: &Path, resolved: bool, restart: Option<&Path>) -> u8 {
    match coupled(case, resolved, restart) {
        Ok(()) => OK,
        Err(e) => {
            println!("@error {}", e.replace('\n', "\t"));
            FAILED
        }
    }
}

fn coupled(case: &Path, resolved: bool, restart: Option<&Path>) -> Result<(), String> {
    let _world = crate::comm::World::join()?;
    let session = Session::from_environment()?;
    let mut config =
        config::load(case, &[]).map_err(|p| p.iter().map(|p| format!("{p}\n")).collect::<String>())?;
    if resolved {
        let text =
            std::fs::read_to_string(case.join("logs/case.resolved.toml")).map_err(|e| e.to_string())?;
        config.file = toml::from_str::<CaseFile>(&text).map_err(|e| e.to_string())?;
    } else {
        auto::resolve(&mut config).map_err(|p| p.iter().map(|p| format!("{p}\n")).collect::<String>())?;
    }
    let resume = restart.map(State::read).transpose()?;
    if let Some(s) = &resume {
        config.control.start = s.origin;
    }
    let hub = Hub::join(&session).map_err(|e| e.to_string())?;
    let serve = |role, ranks| (0..ranks).map(|r| hub.serve(role, r)).collect::<Result<Vec<_>, _>>();
    let dem = serve(Role::Dem, session.dem_ranks).map_err(|e| e.to_string())?;
    let cfd = serve(Role::Cfd, session.cfd_ranks).map_err(|e| e.to_string())?;
    session.announce().map_err(|e| e.to_string())?;
    let recorder = record::start(&config, &session, resume.as_ref())?;
    let mut number = 0..;
    let mut recorded = |list: Vec<voidage_shm::Channel>| {
        list.into_iter().zip(&mut number).map(|(c, i)| Recorded::new(c, i, recorder.clone())).collect()
    };
    let (dem, cfd) = (recorded(dem), recorded(cfd));
    let mut partners = Partners::new(dem, cfd, Duration::from_secs_f64(session.wait));
    let result = exchange(&config, &session, &mut partners, resume, recorder.clone());
    if let Err(e) = &result {
        partners.stop(e);
        // last words must be read before the segments go
        std::thread::sleep(Duration::from_millis(200));
    }
    record::finish(recorder.as_ref(), &result)?;
    result
}

/// What diagram and own variance take each of a cell at the start, s of CPU, about (docs/bench.md).
const PER_CELL: f64 = 5e-5;

/// Mean non-orthogonality (degrees) from which the kernel is more than a few per cent off.
const SKEW: f64 = 10.0;

fn exchange(
    config: &Config,
    session: &Session,
    partners: &mut Partners<Recorded<voidage_shm::Channel>>,
    resume: Option<State>,
    recorder: Option<Recorder>,
) -> Result<(), String> {
    let start_limit = Duration::from_secs_f64(session.start);
    partners.belongs_to(session.launcher);
    partners.meet(&session.token, start_limit).map_err(|e| e.to_string())?;
    setup::agree(config, partners, resume.as_ref())?;
    let welcome = setup::welcome(config, resume.as_ref());
    for i in partners.dem().chain(partners.cfd()) {
        partners.welcome(i, &welcome).map_err(|e| e.to_string())?;
    }
    let mesh = receive_mesh(partners).map_err(|e| e.to_string())?;
    println!("mesh: {} cells of {} ranks", mesh.len(), session.cfd_ranks);
    let (mapping, links) = (map::resolve(&config.file.map.method, &mesh), setup::links(config, &mesh));
    println!("mapping: {} ({mapping})", config.file.map.method);
    let made = usize::from(mapping == "max-entropy") + usize::from(links == "voronoi");
    let expected = PER_CELL * (made * mesh.len() / threads::cores()) as f64;
    if expected > 0.5 * session.wait {
        println!(
            "@warning preparing takes about {expected:.0} s on these cores, during which the partners wait: limits.wait = {:.0}",
            4.0 * expected
        );
    }
    let begin = Instant::now();
    let step = setup::step(config, mesh)?;
    let (asked, s) = (&config.file.smooth.method, step.smoother());
    let along = if links == "voronoi" { " along the Voronoi diagram of the centres" } else { "" };
    println!(
        "smoothing: {asked} ({}), {} sweeps{along}; prepared in {:.1} s",
        s.name(),
        s.degree(),
        begin.elapsed().as_secs_f64()
    );
    let along_faces = s.degree() > 0 && links == "faces";
    let angle = if along_faces { step.mesh.non_orthogonality() } else { 0.0 };
    if angle > SKEW {
        println!(
            "@warning the mesh's non-orthogonality is {angle:.0} degrees on average, which distorts the kernel; smooth.links = \"voronoi\" \
             does not (docs/bench.md)"
        );
    }
    let file = config.folder.join("monitor.csv");
    let monitor = match &resume {
        None => Monitor::create(&file, false),
        Some(s) => Monitor::resume(&file, s.exchange),
    };
    let monitor = monitor.map_err(|e| format!("{}: {e}", file.display()))?;
    let interval = i64::from(config.file.coupling.interval);
    let step_now = partners.hello(0).map_or(0, |h| h.step);
    let dem_step = step_now - resume.as_ref().map_or(0, |s| s.exchange * interval);
    let steps = config.steps();
    let mut said: Option<Instant> = None;
    let mut progress = |row: &monitor::Row, s: &crate::couple::Summary| {
        if said.is_none_or(|t| t.elapsed() > Duration::from_millis(250)) || row.step as u64 >= steps {
            said = Some(Instant::now());
            println!(
                "@progress step={} time={} dem={:.4} cfd={:.4} coupler={:.4} action={:e} solid={:e}",
                row.step,
                row.time,
                s.wait_dem,
                s.wait_cfd,
                s.coupler,
                s.worst_action_reaction,
                s.worst_solid_volume
            );
        }
    };
    let earlier = resume.as_ref().map_or(0, |s| s.exchange);
    let mut output = crate::output::Output::new(config, resume.as_ref().map(|s| s.time))
        .map_err(|e| format!("CASE/voidage: {e}"))?;
    // start and output are not what an exchange costs
    let mut written = 0.0;
    let mut write = |s: &crate::couple::Snapshot| {
        let begin = threads::cpu_seconds(None);
        let done = output.write(s);
        written += threads::cpu_seconds(None) - begin;
        done
    };
    let mut run = Exchange {
        partners: Partners::new(Vec::new(), Vec::new(), Duration::ZERO),
        step,
        pool: setup::pool(config)?,
        two_way: config.file.coupling.feedback == config::Feedback::TwoWay,
        period: config.period(),
        start: config.control.start,
        dem_step,
        interval,
        resume,
        sets: Sets::new(config),
        monitor: Some(monitor),
        recorder,
        progress: &mut progress,
        write: &mut write,
    };
    std::mem::swap(&mut run.partners, partners);
    let begin = threads::cpu_seconds(run.pool.as_ref());
    let result = run.run();
    let exchanges = threads::cpu_seconds(run.pool.as_ref()) - begin;
    std::mem::swap(&mut run.partners, partners);
    drop(run);
    let exchanges = exchanges - written;
    output.finish().map_err(|e| format!("the animation: {e}"))?;
    let s = result.map_err(|e| e.to_string())?;
    let cpu = setup::cpu_seconds();
    println!(
        "@summary {} exchanges to t = {} s: waiting for DEM {:.2} s, for CFD {:.2} s, coupler {:.2} s ({cpu:.2} s CPU)\t\
         largest errors: action-reaction {:.1e}, solid volume {:.1e}; excluded {}, redone with the positive smoother {}\t\
         coupler without start and output: {:.3} ms of CPU per exchange",
        s.steps,
        s.time,
        s.wait_dem,
        s.wait_cfd,
        s.coupler,
        s.worst_action_reaction,
        s.worst_solid_volume,
        s.excluded,
        s.redone,
        1e3 * exchanges / ((s.steps - earlier).max(1) as f64)
    );
    Ok(())
}

/// `voidage explain`
pub fn explain(topic: &str) -> u8 {
    let row = |name: &str, unit: &str, text: &str| println!("{name:32} {unit:10} {text}");
    match topic {
        "case" => {
            for (key, unit, default, text) in config::KEYS {
                let default =
                    if *default == "-" { "must be given".into() } else { format!("default {default}") };
                row(key, unit, &format!("{text} ({default})"));
            }
        }
        "monitor" => monitor::COLUMNS.iter().for_each(|(name, unit, text)| row(name, unit, text)),
        _ => {
            eprintln!("error: explain {topic}: topics are case, monitor; type: voidage explain case");
            return BAD_INPUT;
        }
    }
    OK
}

/// All numbers as JSON; says why not.
fn json_text(numbers: &impl serde::Serialize) -> Option<String> {
    match serde_json::to_string_pretty(numbers) {
        Ok(t) => Some(t + "\n"),
        Err(e) => {
            eprintln!("error: --json: {e}");
            None
        }
    }
}

/// Writes the file that an option names; says why not.
fn write(option: &str, file: &Path, text: String) -> bool {
    let done = std::fs::write(file, text);
    done.map_err(|e| eprintln!("error: {option} {}: {e}", file.display())).is_ok()
}

/// `voidage bench`
pub fn bench(json: Option<&Path>, plot: Option<&Path>, quick: bool) -> u8 {
    let report = match crate::bench::report::run(quick, |what| eprintln!("{what}")) {
        Ok(r) => r,
        Err(e) => {
            eprintln!("error: {e}");
            return FAILED;
        }
    };
    println!("{}", report.table());
    let Some(text) = json_text(&report) else { return FAILED };
    let written = json.is_none_or(|file| write("--json", file, text))
        & plot.is_none_or(|file| write("--plot", file, report.plot()));
    if written { OK } else { FAILED }
}

/// `voidage version`
pub fn version() -> u8 {
    let recording = crate::record::FORMAT;
    println!("voidage {}, wire protocol {PROTOCOL}, recording format {recording}", env!("CARGO_PKG_VERSION"));
    for package in ["openfoam", "liggghts", "lammps"] {
        let out = std::process::Command::new("dpkg-query").args(["-W", "-f", "${Version}", package]).output();
        let found =
            out.ok().filter(|o| o.status.success()).map(|o| String::from_utf8_lossy(&o.stdout).into_owned());
        println!("{package}: {}", found.unwrap_or_else(|| "not installed as a package".into()));
    }
    match launch::companions() {
        Ok(c) => {
            println!("solver: {}", c.solver.display());
            for program in &config::program::PROGRAMS {
                let fix = c.fix(program);
                let found = if fix.exists() {
                    fix.display().to_string()
                } else {
                    format!("not built: type {}", program.setup)
                };
                println!("fix for {}: {found}", program.title);
            }
        }
        Err(e) => println!("{e}"),
    }
    OK
}
