// SPDX-License-Identifier: MIT OR Apache-2.0
//! `voidage export`: a recording as ParaView series (`vtk`) or tables, and its monitor.
//!
//! Writes what was recorded, without computing anything anew. Tables are CSV with a line of names, or Parquet, SI units: one
//! file of cells and one of particles per exchange, numbered like the series. Holds one exchange at a time.

use super::vtk::{self, Data, Grid, Series};
use super::{Fields, parquet};
use crate::monitor::Monitor;
use crate::record::RecordError;
use crate::record::moment::Moments;
use std::fs::File;
use std::io::{self, BufWriter, Read, Seek, Write};
use std::path::Path;

/// What is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// .pvd with .vtu and .vtp
    Vtk,
    /// .csv
    Csv,
    /// .parquet
    Parquet,
}

impl Format {
    /// Names on the command line.
    pub const NAMES: &[&str] = &["vtk", "csv", "parquet"];
    /// By name.
    pub fn by_name(name: &str) -> Option<Self> {
        let all = [Self::Vtk, Self::Csv, Self::Parquet];
        Self::NAMES.iter().position(|n| *n == name).map(|i| all[i])
    }
}

/// Exports every `every`-th recorded exchange to a folder that is made for it; (exchanges, rows of the monitor).
pub fn export<R: Read + Seek>(
    m: &mut Moments<R>,
    folder: &Path,
    format: Format,
    every: usize,
) -> Result<(usize, usize), RecordError> {
    let name = folder.display().to_string();
    let fail = |source| RecordError::File { what: name.clone(), source };
    std::fs::create_dir_all(folder).map_err(fail)?;
    let mut series = [Series::new(folder, "cells", None), Series::new(folder, "particles", None)];
    let (mut times, grid) = (Vec::new(), Grid::new(&m.mesh));
    let (mut seen, mut written) = (0, 0);
    while let Some(x) = m.next()? {
        seen += 1;
        if (seen - 1) % every != 0 {
            continue;
        }
        let p = x.particles()?;
        let (fluid, sources, drive) = (x.fluid(&m.mesh)?, x.sources(&m.mesh)?, x.drive(&p)?);
        let all = Fields { mesh: &m.mesh, sources: &sources, fluid: &fluid, particles: &p, drive: &drive };
        let id = all.ids();
        match format {
            Format::Vtk => {
                series[0].write(x.time, "vtu", |f| grid.write(f, &all.cells())).map_err(fail)?;
                series[1]
                    .write(x.time, "vtp", |f| vtk::points(f, &p.position, &all.points(&id)))
                    .map_err(fail)?;
            }
            Format::Csv | Format::Parquet => {
                let save = |what: &str, n: usize, columns: &[(&str, Data)]| {
                    let file = folder.join(format!("{what}_{written:04}"));
                    if format == Format::Csv {
                        let file = File::create(file.with_extension("csv")).map(BufWriter::new);
                        file.and_then(|f| table(f, n, columns))
                    } else {
                        File::create(file.with_extension("parquet")).and_then(|f| parquet::table(f, columns))
                    }
                };
                let ids: Vec<f64> = m.mesh.ids.iter().map(|i| *i as f64).collect();
                let mut cells = vec![
                    ("cell", Data::Scalar(&ids)),
                    ("centre", Data::Vector(&m.mesh.centre)),
                    ("volume", Data::Scalar(&m.mesh.volume)),
                ];
                cells.extend(all.cells());
                save("cells", m.mesh.len(), &cells).map_err(fail)?;
                let mut points = all.points(&id);
                points.insert(1, ("position", Data::Vector(&p.position)));
                points.push(("mass", Data::Scalar(&p.mass)));
                save("particles", p.len(), &points).map_err(fail)?;
            }
        }
        times.push((written, x.k, x.time));
        written += 1;
    }
    let mut file = BufWriter::new(File::create(folder.join("exchanges.csv")).map_err(fail)?);
    let list = |f: &mut dyn Write| {
        writeln!(f, "number,exchange,time_s")?;
        times.iter().try_for_each(|(n, k, t)| writeln!(f, "{n},{k},{t}"))?;
        f.flush()
    };
    list(&mut file).map_err(fail)?;
    if format == Format::Parquet {
        let file = File::create(folder.join("monitor.parquet"));
        file.and_then(|f| parquet::monitor(f, &m.rows)).map_err(fail)?;
    }
    let mut monitor = Monitor::create(&folder.join("monitor.csv"), false).map_err(fail)?;
    m.rows.iter().try_for_each(|r| monitor.write(r)).map_err(fail)?;
    Ok((written, m.rows.len()))
}

/// One line per cell or particle; numbers as short as they come back to the bit.
fn table(mut file: impl Write, n: usize, columns: &[(&str, Data)]) -> io::Result<()> {
    let names: Vec<String> = columns
        .iter()
        .flat_map(|(name, data)| match data {
            Data::Scalar(_) => vec![(*name).to_string()],
            Data::Vector(_) => ["x", "y", "z"].iter().map(|a| format!("{name}_{a}")).collect(),
        })
        .collect();
    writeln!(file, "{}", names.join(","))?;
    for i in 0..n {
        for (c, (_, data)) in columns.iter().enumerate() {
            if c > 0 {
                file.write_all(b",")?;
            }
            match data {
                Data::Scalar(v) => number(&mut file, v[i])?,
                Data::Vector(v) => {
                    number(&mut file, v[i][0])?;
                    for x in &v[i][1..] {
                        file.write_all(b",")?;
                        number(&mut file, *x)?;
                    }
                }
            }
        }
        file.write_all(b"\n")?;
    }
    file.flush()
}

fn number(file: &mut impl Write, x: f64) -> io::Result<()> {
    if x == 0.0 || (1e-4..1e15).contains(&x.abs()) { write!(file, "{x}") } else { write!(file, "{x:e}") }
}
