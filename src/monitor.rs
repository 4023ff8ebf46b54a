// SPDX-License-Identifier: MIT OR Apache-2.0
//! `monitor.csv`: one row per exchange, every column defined in `COLUMNS`. Does not know how rows arise.

use serde::{Deserialize, Serialize};
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

/// Columns: name, unit, meaning. `voidage explain monitor` prints them.
pub const COLUMNS: &[(&str, &str, &str)] = &[
    ("step", "1", "exchange number k: the fluid step from k-1 to k"),
    ("time_s", "s", "physical time of the fluid at the end of the step"),
    ("particles", "1", "particles coupled"),
    ("solid_fraction_max", "1", "largest solid volume fraction of a cell"),
    (
        "solid_volume_error",
        "1",
        "|sum of eps_s V over the cells - sum of particle volumes| / sum of particle volumes",
    ),
    ("solid_momentum_error", "1", "same for the particles' momentum, relative to sum of m |v|"),
    (
        "action_reaction_error",
        "1",
        "|impulse the fix reports applied + change of its ledger - external impulse - impulse the fluid reports given| \
         / sum of |impulses|; empty when the coupling is one-way",
    ),
    ("ledger_momentum", "N s", "|sum of L|: impulse taken by the particles and not yet charged to the fluid"),
    ("ledger_left", "N s", "|impulse in the ledgers of particles that vanished, so far|"),
    ("positive_redone", "1", "steps so far that were redone with the positive smoother"),
    ("excluded", "1", "particles left out of the coupling so far (limits.outside = \"exclude\")"),
    ("capped_volume", "m3", "solid volume removed by capping in this step (limits.voidage_min)"),
    ("coupler_s", "s", "wall time of the coupler's own work in this step"),
    ("wait_dem_s", "s", "time spent waiting for the DEM"),
    ("wait_cfd_s", "s", "time spent waiting for the CFD"),
    ("given_x", "N s", "x of the impulse charged to the fluid in this step, external forces taken out"),
    ("given_y", "N s", "y of it"),
    ("given_z", "N s", "z of it"),
];

/// One row; order of `COLUMNS`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[allow(missing_docs)]
pub struct Row {
    pub step: i64,
    pub time: f64,
    pub particles: usize,
    pub solid_fraction_max: f64,
    pub solid_volume_error: f64,
    pub solid_momentum_error: f64,
    pub action_reaction_error: Option<f64>,
    pub ledger_momentum: f64,
    pub ledger_left: f64,
    pub positive_redone: u64,
    pub excluded: u64,
    pub capped_volume: f64,
    pub coupler: f64,
    pub wait_dem: f64,
    pub wait_cfd: f64,
    pub given: [f64; 3],
}

impl Row {
    /// In the order of `COLUMNS`; NaN for what is not there.
    pub fn values(&self) -> [f64; COLUMNS.len()] {
        [
            self.step as f64,
            self.time,
            self.particles as f64,
            self.solid_fraction_max,
            self.solid_volume_error,
            self.solid_momentum_error,
            self.action_reaction_error.unwrap_or(f64::NAN),
            self.ledger_momentum,
            self.ledger_left,
            self.positive_redone as f64,
            self.excluded as f64,
            self.capped_volume,
            self.coupler,
            self.wait_dem,
            self.wait_cfd,
            self.given[0],
            self.given[1],
            self.given[2],
        ]
    }
}

/// The open file.
pub struct Monitor {
    file: BufWriter<File>,
}

impl Monitor {
    /// Goes on with the file after a restart: rows from exchange `step` on are dropped, the run writes them anew.
    pub fn resume(path: &Path, step: i64) -> std::io::Result<Self> {
        let text = std::fs::read_to_string(path).unwrap_or_default();
        let earlier =
            |l: &&str| l.split(',').next().and_then(|n| n.parse::<i64>().ok()).is_none_or(|n| n < step);
        let kept: Vec<&str> = text.lines().filter(earlier).collect();
        if kept.is_empty() {
            return Self::create(path, false);
        }
        let part = path.with_extension("part");
        std::fs::write(&part, kept.join("\n") + "\n")?;
        std::fs::rename(&part, path)?;
        Self::create(path, true)
    }
    /// Starts the file, or goes on with it after a restart (`append`).
    pub fn create(path: &Path, append: bool) -> std::io::Result<Self> {
        let exists = path.exists();
        let mut options = std::fs::OpenOptions::new();
        options.create(true).write(true).append(append).truncate(!append);
        let mut file = BufWriter::new(options.open(path)?);
        if !(append && exists) {
            let names: Vec<_> = COLUMNS.iter().map(|c| c.0).collect();
            writeln!(file, "{}", names.join(","))?;
        }
        Ok(Self { file })
    }
    /// Adds a row.
    pub fn write(&mut self, r: &Row) -> std::io::Result<()> {
        let error = r.action_reaction_error.map(|e| format!("{e:.3e}")).unwrap_or_default();
        writeln!(
            self.file,
            "{},{:.9},{},{:.6},{:.3e},{:.3e},{error},{:.6e},{:.6e},{},{},{:.6e},{:.3e},{:.3e},{:.3e},{:.12e},{:.12e},{:.12e}",
            r.step,
            r.time,
            r.particles,
            r.solid_fraction_max,
            r.solid_volume_error,
            r.solid_momentum_error,
            r.ledger_momentum,
            r.ledger_left,
            r.positive_redone,
            r.excluded,
            r.capped_volume,
            r.coupler,
            r.wait_dem,
            r.wait_cfd,
            r.given[0],
            r.given[1],
            r.given[2]
        )?;
        self.file.flush()
    }
}

/// Rows of a file; the error says which line is none.
pub fn read(path: &Path) -> Result<Vec<Row>, String> {
    let text = std::fs::read_to_string(path).map_err(|e| e.to_string())?;
    let mut lines = text.lines().enumerate();
    let names: Vec<&str> = COLUMNS.iter().map(|c| c.0).collect();
    if lines.next().is_none_or(|l| l.1 != names.join(",")) {
        return Err("its first line is not that of a monitor of this version".into());
    }
    let row = |(i, line): (usize, &str)| {
        let w: Vec<&str> = line.split(',').collect();
        let number = |k: usize| w.get(k).and_then(|x| x.parse::<f64>().ok());
        let whole = |k: usize| w.get(k).and_then(|x| x.parse::<u64>().ok());
        let row = || {
            Some(Row {
                step: w[0].parse().ok()?,
                time: number(1)?,
                particles: whole(2)? as usize,
                solid_fraction_max: number(3)?,
                solid_volume_error: number(4)?,
                solid_momentum_error: number(5)?,
                action_reaction_error: number(6),
                ledger_momentum: number(7)?,
                ledger_left: number(8)?,
                positive_redone: whole(9)?,
                excluded: whole(10)?,
                capped_volume: number(11)?,
                coupler: number(12)?,
                wait_dem: number(13)?,
                wait_cfd: number(14)?,
                given: [number(15)?, number(16)?, number(17)?],
            })
        };
        row().ok_or_else(|| format!("line {} is not a row", i + 1))
    };
    lines.map(row).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_row_has_every_column() {
        let path = std::env::temp_dir().join(format!("voidage-monitor-{}.csv", std::process::id()));
        let mut m = Monitor::create(&path, false).unwrap();
        m.write(&Row { action_reaction_error: Some(1e-14), ..Row::default() }).unwrap();
        drop(m);
        Monitor::create(&path, true).unwrap().write(&Row::default()).unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        let rows = read(&path).unwrap();
        assert_eq!(rows, [Row { action_reaction_error: Some(1e-14), ..Row::default() }, Row::default()]);
        std::fs::write(&path, text.clone() + "1,2,three\n").unwrap();
        assert_eq!(read(&path).unwrap_err(), "line 4 is not a row");
        std::fs::remove_file(&path).unwrap();
        let lines: Vec<_> = text.lines().collect();
        assert_eq!(lines.len(), 3, "a restart appends");
        assert!(lines.iter().all(|l| l.split(',').count() == COLUMNS.len()), "{text}");
        assert!(lines[0].starts_with("step,time_s,particles,solid_fraction_max,solid_volume_error"));
    }
}
