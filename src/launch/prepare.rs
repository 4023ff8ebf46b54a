// SPDX-License-Identifier: MIT OR Apache-2.0
//! Before the start: copy of the case (`--into`), mesh, decomposition, free ground for results.

use crate::config::{Config, foam};
use std::fs;
use std::path::Path;

/// Copies a case to a folder that must be new or empty; results and logs stay behind.
pub fn copy(from: &Path, to: &Path) -> Result<(), String> {
    let fail = |e: std::io::Error| format!("copy of the case to {}: {e}", to.display());
    if to.read_dir().is_ok_and(|mut d| d.next().is_some()) {
        return Err(format!("--into {}: the folder is not empty; remove it or name another", to.display()));
    }
    fs::create_dir_all(to).map_err(fail)?;
    for entry in fs::read_dir(from).map_err(fail)? {
        let entry = entry.map_err(fail)?;
        let name = entry.file_name().to_string_lossy().into_owned();
        let result =
            ["logs", "monitor.csv", "voidage", "post"].contains(&&*name) || name.starts_with("processor");
        if result || entry.path().canonicalize().ok() == to.canonicalize().ok() {
            continue;
        }
        if entry.path().is_dir() {
            copy_tree(&entry.path(), &to.join(name)).map_err(fail)?;
        } else {
            fs::copy(entry.path(), to.join(name)).map_err(fail)?;
        }
    }
    Ok(())
}

fn copy_tree(from: &Path, to: &Path) -> std::io::Result<()> {
    fs::create_dir_all(to)?;
    for entry in fs::read_dir(from)? {
        let entry = entry?;
        let name = entry.file_name();
        if name.to_string_lossy().starts_with("processor") {
            continue;
        }
        if entry.path().is_dir() {
            copy_tree(&entry.path(), &to.join(name))?;
        } else {
            fs::copy(entry.path(), to.join(name))?;
        }
    }
    Ok(())
}

/// Makes the mesh if it is missing, and one part per CFD rank.
pub fn fluid(config: &Config, logs: &Path) -> Result<(), String> {
    let case = config.fluid_case();
    if !case.join("constant/polyMesh/points").exists() && !case.join("constant/polyMesh/points.gz").exists() {
        tool("blockMesh", &case, logs, &[])?;
    }
    let ranks = config.file.run.cfd_ranks;
    if ranks > 1 {
        decomposition(&case, ranks)?;
        tool("decomposePar", &case, logs, &["-force"])?;
    }
    Ok(())
}

/// system/decomposeParDict for `ranks` parts, if the user has none for that number.
fn decomposition(case: &Path, ranks: u32) -> Result<(), String> {
    let file = case.join("system/decomposeParDict");
    if foam::parts(case).is_some() {
        return Ok(()); // the check has compared the numbers
    }
    // cut across the longest side
    let extent = foam::extent(case).map_or([1.0, 0.0, 0.0], |e| [0, 1, 2].map(|a| e.upper[a] - e.lower[a]));
    let longest = (0..3).fold(0, |m, a| if extent[a] > extent[m] { a } else { m });
    let n = [0, 1, 2].map(|a| if a == longest { ranks.to_string() } else { "1".into() }).join(" ");
    let text = format!(
        "FoamFile {{ version 2.0; format ascii; class dictionary; object decomposeParDict; }}\n\
         {}: cut across the longest side\n\
         numberOfSubdomains {ranks};\nmethod simple;\nsimpleCoeffs {{ n ({n}); delta 0.001; }}\n",
        foam::OURS
    );
    fs::write(&file, text).map_err(|e| format!("{}: {e}", file.display()))
}

fn tool(name: &str, case: &Path, logs: &Path, args: &[&str]) -> Result<(), String> {
    let log = logs.join(format!("{name}.log"));
    let file = fs::File::create(&log).map_err(|e| format!("{}: {e}", log.display()))?;
    let twin = file.try_clone().map_err(|e| e.to_string())?;
    let mut command = foam::program(name);
    command.arg("-case").arg(case).args(args).stdout(file).stderr(twin);
    match command.status() {
        Ok(s) if s.success() => Ok(()),
        Ok(s) => Err(format!("{name} failed ({s}){}; see {}", complaint(&log), log.display())),
        Err(e) => Err(format!("{name} could not be started: {e}; install OpenFOAM: ./setup build")),
    }
}

/// What OpenFOAM says in a log behind FATAL.
fn complaint(log: &Path) -> String {
    let text = fs::read(log).unwrap_or_default();
    let text = String::from_utf8_lossy(&text);
    let Some((_, said)) = text.split_once("FOAM FATAL") else { return String::new() };
    let said: Vec<&str> = said.lines().skip(1).map(str::trim).take_while(|l| !l.is_empty()).collect();
    let fix = if said.join(" ").contains("stub library") {
        "; Debian's OpenFOAM comes without it, in system/decomposeParDict type: method hierarchical (or simple)"
    } else {
        ""
    };
    format!(": {}{fix}", said.join(" "))
}
