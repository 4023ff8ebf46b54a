// SPDX-License-Identifier: MIT OR Apache-2.0
//! `voidage run --restart`: finds a set and refuses what does not fit together, before anything starts.

use crate::config::{Config, Problem, foam, foam::time_folder, script};
use crate::output::restart::{PARTICLES, State, folder, kept, sets};
use std::path::{Path, PathBuf};

/// A set to continue from.
#[derive(Clone, Debug)]
pub struct Restart {
    /// its folder
    pub folder: PathBuf,
    /// what the coupler wrote
    pub state: State,
}

impl Restart {
    /// The DEM's file.
    pub fn particles(&self) -> PathBuf {
        self.folder.join(PARTICLES)
    }
}

/// The newest set of a case, or that of `time` (s). All that does not match is an error.
pub fn find(c: &Config, time: Option<f64>) -> Result<Restart, Vec<Problem>> {
    let all = sets(&c.folder);
    let one = |place: &str, given: String, accepted: &str, fix: &str| {
        vec![Problem::error(place, given, accepted, fix)]
    };
    let place = folder(&c.folder).display().to_string();
    let Some(newest) = all.last() else {
        let accepted =
            "there is no restart set; they are written at the fluid's write times (output.restarts > 0)";
        return Err(one(
            &place,
            "nothing to restart from".into(),
            accepted,
            "run the case without --restart first",
        ));
    };
    let slack = 1e-2 * c.period();
    let chosen = match time {
        None => newest,
        Some(t) => all.iter().find(|s| (s.0 - t).abs() <= slack).ok_or_else(|| {
            let list: Vec<String> = all.iter().map(|s| s.0.to_string()).collect();
            let accepted = format!("there are sets of t = {}", list.join(", "));
            one("--restart", t.to_string(), &accepted, &format!("--restart={}", newest.0))
        })?,
    };
    let state = State::read(&chosen.1).map_err(|e| {
        one("restart set", chosen.0.to_string(), &e, "name another set: --restart=TIME, or start anew; sets of another version need that version of voidage")
    })?;
    let restart = Restart { folder: chosen.1.clone(), state };
    let problems = mismatches(c, &restart);
    if problems.is_empty() { Ok(restart) } else { Err(problems) }
}

fn mismatches(c: &Config, r: &Restart) -> Vec<Problem> {
    let (f, s, mut p) = (&c.file, &r.state, Vec::new());
    let slack = 1e-2 * c.period();
    let size = std::fs::metadata(r.particles()).map_or(0, |m| m.len());
    if size != s.particles_file {
        let accepted = format!("the coupler's file of this set goes with one of {} bytes", s.particles_file);
        let fix = "name another set: --restart=TIME";
        p.push(Problem::error(&r.particles().display().to_string(), format!("{size} bytes"), &accepted, fix));
    }
    if (s.dem_time_step / f.dem.time_step - 1.0).abs() > 1e-12 || s.interval != f.coupling.interval {
        let accepted = format!("the set was written with {} steps of {:e} s", s.interval, s.dem_time_step);
        let given = format!("{} steps of {:e} s", f.coupling.interval, f.dem.time_step);
        let fix = "continue with the same steps, or start anew from the particles";
        p.push(Problem::error("coupling.interval, dem.time_step", given, &accepted, fix));
    }
    let now = kept(c);
    if now != s.kept {
        let text =
            |k: [f64; 2]| format!("{} numbers for the history force, {} for the added mass", k[0], k[1]);
        let accepted = format!("the particles of this set keep {} each", text(s.kept));
        let fix = "continue with the same forces.history, forces.added_mass and [auto], or start anew";
        p.push(Problem::error("forces", text(now), &accepted, fix));
    }
    if s.cfd_ranks != f.run.cfd_ranks {
        let accepted = format!("the fluid's fields of this set lie on {} ranks", s.cfd_ranks);
        let fix = format!("run.cfd_ranks = {}", s.cfd_ranks);
        p.push(Problem::error("run.cfd_ranks", f.run.cfd_ranks, &accepted, fix));
    } else {
        let case = c.fluid_case();
        let places: Vec<PathBuf> = match f.run.cfd_ranks {
            1 => vec![case],
            n => (0..n).map(|i| case.join(format!("processor{i}"))).collect(),
        };
        // voidageFoam is told the time, a stock solver goes by its controlDict
        let control = std::fs::read_to_string(c.fluid_case().join("system/controlDict")).unwrap_or_default();
        let begin =
            foam::begin(&control, &places[0]).filter(|b| f.fluid.stock() && (b - s.time).abs() > slack);
        if let (Some(begin), Some(at)) = (begin, time_folder(&places[0], s.time, slack)) {
            let at = at.file_name().unwrap_or_default().display().to_string();
            let given = format!("the solver would begin at t = {begin}");
            let accepted =
                format!("a stock solver begins where controlDict says, the restart set is of t = {at}");
            let fix = format!("controlDict: startFrom startTime; startTime {at};");
            p.push(Problem::error("startFrom", given, &accepted, fix));
        }
        for place in places {
            if time_folder(&place, s.time, slack)
                .is_none_or(|t| !t.join("U").exists() && !t.join("U.gz").exists())
            {
                let accepted =
                    format!("the fluid has no fields of t = {}, the time of the restart set", s.time);
                let fix = "name another set: --restart=TIME (purgeWrite of controlDict may have removed the fields)";
                p.push(Problem::error("fluid", place.display(), &accepted, fix));
            }
        }
    }
    if c.control.end < s.time + 0.5 * c.period() {
        let accepted = format!("the restart set is of t = {}: there is nothing left to run", s.time);
        p.push(Problem::error("endTime", c.control.end, &accepted, "raise endTime in controlDict"));
    }
    if script::read(&c.script(), &f.dem.variables).is_ok_and(|s| !s.has_restart) {
        let accepted = "with --restart the script must take the particles from the restart file";
        let fix = "replace `read_data FILE` by: if \"${voidage_restart} == 0\" then \"read_data FILE\" else \
                   \"read_restart ${voidage_restart_file}\"";
        p.push(Problem::error("dem.script", f.dem.script.display(), accepted, fix));
    }
    p
}

/// Clears what a later restart could mistake for its own: all sets at a fresh start, later ones at a restart.
pub fn forget(case: &Path, from: Option<&Restart>) -> std::io::Result<()> {
    match from {
        None if folder(case).exists() => std::fs::remove_dir_all(folder(case)),
        None => Ok(()),
        // the name of the set itself may be rounded up
        Some(r) => sets(case)
            .into_iter()
            .filter(|s| s.0 > r.state.time && s.1 != r.folder)
            .try_for_each(|s| std::fs::remove_dir_all(s.1)),
    }
}
