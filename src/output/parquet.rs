// SPDX-License-Identifier: MIT OR Apache-2.0
//! Tables as Parquet, to be read by pandas, Polars or DuckDB: a column of doubles for each name, components as name_x, name_y, name_z.
//!
//! Reads columns in SI units; writes one row group. Does not know what the columns mean.

use super::vtk::Data;
use crate::monitor::{COLUMNS, Row};
use parquet::data_type::DoubleType;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::parser::parse_message_type;
use std::fs::File;
use std::io;
use std::sync::Arc;

/// Columns by name; all of one length. NaN stands for what is not there.
pub fn columns(file: File, list: &[(String, Vec<f64>)]) -> io::Result<()> {
    let fields: Vec<String> = list.iter().map(|(name, _)| format!("REQUIRED DOUBLE {name};")).collect();
    let schema = parse_message_type(&format!("message voidage {{ {} }}", fields.join(" ")))
        .map_err(io::Error::other)?;
    let properties = Arc::new(WriterProperties::builder().build());
    let mut writer =
        SerializedFileWriter::new(file, Arc::new(schema), properties).map_err(io::Error::other)?;
    let mut group = writer.next_row_group().map_err(io::Error::other)?;
    for (_, values) in list {
        let Some(mut column) = group.next_column().map_err(io::Error::other)? else { break };
        column.typed::<DoubleType>().write_batch(values, None, None).map_err(io::Error::other)?;
        column.close().map_err(io::Error::other)?;
    }
    group.close().map_err(io::Error::other)?;
    writer.close().map_err(io::Error::other)?;
    Ok(())
}

/// Fields of cells or particles.
pub fn table(file: File, fields: &[(&str, Data)]) -> io::Result<()> {
    let column = |(name, data): &(&str, Data)| match data {
        Data::Scalar(v) => vec![((*name).to_string(), v.to_vec())],
        Data::Vector(v) => {
            let one = |(a, axis): (usize, &str)| (format!("{name}_{axis}"), v.iter().map(|x| x[a]).collect());
            ["x", "y", "z"].into_iter().enumerate().map(one).collect()
        }
    };
    columns(file, &fields.iter().flat_map(column).collect::<Vec<_>>())
}

/// Rows of the monitor, as in monitor.csv.
pub fn monitor(file: File, rows: &[Row]) -> io::Result<()> {
    let values: Vec<_> = rows.iter().map(Row::values).collect();
    let column =
        |(i, c): (usize, &(&str, &str, &str))| (c.0.to_string(), values.iter().map(|v| v[i]).collect());
    columns(file, &COLUMNS.iter().enumerate().map(column).collect::<Vec<_>>())
}
