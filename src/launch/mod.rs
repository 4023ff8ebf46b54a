// SPDX-License-Identifier: MIT OR Apache-2.0
//! `voidage run`: three groups of processes, one terminal. Prepares the case, starts the groups by mpirun,
//! shows progress, stops all when one fails. Never calls MPI itself; does not know what is exchanged.

pub mod groups;
pub mod prepare;
pub mod restart;
mod ui;

use crate::config::{Config, program::Program, unfit};
use groups::{Group, Groups};
use restart::Restart;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use voidage_wire::{Session, session};

/// Longest start-up of all programs, s.
const START: f64 = 60.0;
/// What the others get to end by themselves after one has failed.
const GRACE: Duration = Duration::from_secs(4);

/// How a run ended.
#[derive(Debug, PartialEq)]
pub enum Outcome {
    /// All programs ended well.
    Complete,
    /// Which and why.
    Failed(String),
    /// Ctrl-C.
    Interrupted,
}

/// Files of this installation.
pub struct Companions {
    /// this program
    pub voidage: PathBuf,
    /// the solver
    pub solver: PathBuf,
    /// where the fixes of the particle programs, and function object and fvOption for stock solvers are
    pub libraries: PathBuf,
}

impl Companions {
    /// The fix for a particle program.
    pub fn fix(&self, program: &Program) -> PathBuf {
        self.libraries.join(program.library)
    }
}

/// Finds them: $VOIDAGE_HOME, the prefix this program is in, or the build tree it was made in.
pub fn companions() -> Result<Companions, String> {
    let exe = std::env::current_exe().map_err(|e| e.to_string())?;
    let mut homes: Vec<PathBuf> = std::env::var_os("VOIDAGE_HOME").map(PathBuf::from).into_iter().collect();
    if homes.is_empty() {
        homes.extend(exe.ancestors().skip(2).take(1).map(Path::to_path_buf));
        homes.extend(exe.ancestors().skip(1).map(|a| a.join("build")));
    }
    let found = homes.iter().find(|h| h.join("lib/libvoidageLiggghts.so").exists());
    let home = found.ok_or(
        "libvoidageLiggghts.so was not found beside this program: type ./setup build, or set VOIDAGE_HOME to the prefix",
    )?;
    Ok(Companions { voidage: exe, solver: home.join("bin/voidageFoam"), libraries: home.join("lib") })
}

/// Refuses a particle program that is not there: mpirun's words for it are long and name no remedy.
fn installed(program: &Program, home: &Companions) -> Result<(), String> {
    let path = std::env::var_os("PATH").unwrap_or_default();
    let missing = if !std::env::split_paths(&path).any(|p| p.join(program.executable).exists()) {
        format!("{} is not on the PATH", program.executable)
    } else if !home.fix(program).exists() {
        format!("{} is missing", home.fix(program).display())
    } else {
        return Ok(());
    };
    let Program { name, title, setup, .. } = program;
    Err(format!("dem.program = \"{name}\": {title} is not set up ({missing}); type {setup}"))
}

fn mpirun(ranks: u32, shared: &Path, own: &Path, export: &[&str]) -> Vec<String> {
    let mut c = vec!["mpirun".to_string()];
    let root = std::os::unix::fs::MetadataExt::uid(
        &std::fs::metadata("/proc/self").ok().unwrap_or_else(|| unreachable!("/proc is there on Linux")),
    ) == 0;
    if root {
        c.push("--allow-run-as-root".into());
    }
    // two mpiruns on one machine would bind to the same cores; waiting ranks must yield to the others
    c.extend(["--oversubscribe", "--bind-to", "none", "--mca", "mpi_yield_when_idle", "1"].map(String::from));
    // Open MPI's own segments go where `janitor::clean` finds them, also after a kill
    c.extend(["--mca".into(), "btl_vader_backing_directory".into(), shared.display().to_string()]);
    // all mpiruns of a user share one folder in /tmp: one that ends removes what another that starts is about to use
    c.extend(["--mca".into(), "orte_tmpdir_base".into(), own.display().to_string()]);
    c.extend(export.iter().flat_map(|e| ["-x".to_string(), (*e).to_string()]));
    c.extend(["-np".to_string(), ranks.to_string()]);
    c
}

/// Runs a case to its end. `stop` is set by Ctrl-C.
pub fn run(config: &Config, from: Option<&Restart>, stop: &AtomicBool) -> Result<Outcome, String> {
    let home = companions()?;
    installed(config.program(), &home)?;
    for path in [&config.folder, &home.libraries] {
        if let Some(what) = unfit(path) {
            return Err(format!("{}: {what}; move or copy it (a case: --into DIR)", path.display()));
        }
    }
    let logs = config.folder.join("logs");
    if let Some(r) = from.filter(|_| logs.exists()) {
        // the logs of the part before stay
        let old = config.folder.join(format!("logs-until-{}", r.state.time));
        if !old.exists() {
            std::fs::rename(&logs, &old).map_err(|e| format!("{}: {e}", old.display()))?;
        }
    }
    std::fs::create_dir_all(&logs).map_err(|e| format!("{}: {e}", logs.display()))?;
    restart::forget(&config.folder, from).map_err(|e| format!("old restart sets: {e}"))?;
    let _ = std::fs::remove_file(own_log(config, &logs)); // an old one must not explain a new failure
    for token in voidage_shm::janitor::clean_dead().map_err(|e| e.to_string())? {
        tracing::info!("removed what the dead run {token} left behind");
    }
    if from.is_none() {
        prepare::fluid(config, &logs)?;
    }
    let f = &config.file;
    let resolved = toml::to_string(f).map_err(|e| e.to_string())?;
    std::fs::write(logs.join("case.resolved.toml"), resolved).map_err(|e| e.to_string())?;
    let s = Session::create(&config.folder, f.run.dem_ranks, f.run.cfd_ranks, f.limits.wait, START);
    let s = s.map_err(|e| format!("the private folder of the run: {e}"))?;
    let result = start(config, &home, &s, &logs, from, stop);
    voidage_shm::janitor::clean(&s).map_err(|e| format!("cleaning {}: {e}", s.root.display()))?;
    result
}

/// The log the particle program writes itself.
fn own_log(config: &Config, logs: &Path) -> PathBuf {
    logs.join(format!("{}.log", config.program().name))
}

fn start(
    config: &Config,
    home: &Companions,
    s: &Session,
    logs: &Path,
    from: Option<&Restart>,
    stop: &AtomicBool,
) -> Result<Outcome, String> {
    let f = &config.file;
    let session = format!("{}={}", session::VARIABLE, s.file().display());
    let foam = std::env::var("WM_PROJECT_DIR").unwrap_or_else(|_| "/usr/share/openfoam".into());
    let foam = format!("WM_PROJECT_DIR={foam}");
    let program = config.program();
    let preload = format!("LD_PRELOAD={}", home.fix(program).display());
    let text = |p: &Path| p.display().to_string();

    let shared =
        Path::new(voidage_shm::janitor::SHARED_MEMORY).join(voidage_shm::janitor::prefix(&s.token) + "mpi");
    std::fs::create_dir(&shared).map_err(|e| format!("{}: {e}", shared.display()))?;
    let own = |group: &str| -> Result<PathBuf, String> {
        let folder = s.root.join(group);
        std::fs::create_dir(&folder).map_err(|e| format!("{}: {e}", folder.display()))?;
        Ok(folder)
    };
    let mut couple = mpirun(1, &shared, &own("mc")?, &[&session]);
    couple.extend([text(&home.voidage), "couple".into(), text(&config.folder), "--resolved".into()]);
    couple.extend(from.iter().flat_map(|r| ["--restart".to_string(), text(&r.folder)]));
    let mut dem = mpirun(f.run.dem_ranks, &shared, &own("md")?, &[&session, &preload]);
    dem.extend([
        program.executable.into(),
        "-in".into(),
        text(&f.dem.script),
        "-log".into(),
        text(&own_log(config, logs)),
    ]);
    dem.extend(f.dem.variables.iter().flat_map(|(k, v)| ["-var".to_string(), k.clone(), v.clone()]));
    let file = from.map_or_else(|| "none".into(), |r| text(&r.particles()));
    dem.extend(["-var", "voidage_restart", if from.is_some() { "1" } else { "0" }].map(String::from));
    dem.extend(["-var".into(), "voidage_restart_file".into(), file]);
    let stock = f.fluid.stock();
    // a stock solver selects its fvOptions before it loads the libraries of its function objects
    let library = format!("LD_PRELOAD={}", home.libraries.join("libvoidageFoam.so").display());
    let export: &[&str] = if stock { &[&session, &foam, &library] } else { &[&session, &foam] };
    let mut cfd = mpirun(f.run.cfd_ranks, &shared, &own("mf")?, export);
    let solver = if stock { f.fluid.solver.clone() } else { text(&home.solver) };
    cfd.extend([solver, "-case".into(), text(&config.fluid_case())]);
    if let Some(r) = from.filter(|_| !stock) {
        cfd.extend(["-restartTime".to_string(), r.state.time.to_string()]);
    }
    if f.run.cfd_ranks > 1 {
        cfd.push("-parallel".into());
    }
    let group = |name, command, log: &str| Group {
        name,
        command,
        cwd: config.folder.clone(),
        log: logs.join(log),
        own_log: (name == "dem").then(|| own_log(config, logs)),
    };
    let plan =
        [group("couple", couple, "couple.log"), group("dem", dem, "dem.log"), group("cfd", cfd, "cfd.log")];
    let mut groups = Groups::start(&plan)?;
    let outcome = watch(config, &mut groups, stop);
    groups.end();
    Ok(outcome)
}

/// Waits for the end, whichever comes.
fn watch(config: &Config, groups: &mut Groups, stop: &AtomicBool) -> Outcome {
    let mut ui = ui::Ui::new(config);
    loop {
        for line in groups.lines() {
            ui.line(&line);
        }
        if stop.load(Ordering::Relaxed) {
            ui.finish();
            return Outcome::Interrupted;
        }
        groups.look();
        if let Some(first) = groups.failed() {
            let begin = Instant::now();
            // the others learn of it from the coupler and end by themselves
            while groups.running() > 0 && begin.elapsed() < GRACE && !stop.load(Ordering::Relaxed) {
                std::thread::sleep(Duration::from_millis(50));
                groups.look();
            }
            for line in groups.lines() {
                ui.line(&line);
            }
            ui.finish();
            let first = groups.killed().unwrap_or(first);
            return Outcome::Failed(groups.reason(first, ui.error.as_deref()));
        }
        if groups.running() == 0 {
            for line in groups.lines() {
                ui.line(&line);
            }
            ui.finish();
            return Outcome::Complete;
        }
        std::thread::sleep(Duration::from_millis(50));
    }
}
