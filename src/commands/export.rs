// SPDX-License-Identifier: MIT OR Apache-2.0
//! `voidage export FILE`.

use super::record::of_file;
use super::{BAD_INPUT, OK};
use crate::output::export::{Format, export as write};
use crate::record::moment::Moments;
use crate::record::{End, Reader};
use std::path::{Path, PathBuf};

/// `voidage export FILE`
pub fn export(file: &Path, into: Option<&Path>, format: &str, every: usize) -> u8 {
    let Some(kind) = Format::by_name(format) else {
        eprintln!("error: --format {format}: accepted: {}; type --format vtk", Format::NAMES.join(", "));
        return BAD_INPUT;
    };
    if every == 0 {
        eprintln!("error: --every 0: a number of exchanges, at least 1; type --every 10");
        return BAD_INPUT;
    }
    let folder = into.map_or_else(
        || PathBuf::from(format!("{}-{format}", file.with_extension("").display())),
        Path::to_path_buf,
    );
    if folder.read_dir().is_ok_and(|mut d| d.next().is_some()) {
        eprintln!(
            "error: {}: the folder is not empty; remove it or name another: --into FOLDER",
            folder.display()
        );
        return BAD_INPUT;
    }
    let mut moments = match Reader::open(file).and_then(Moments::new) {
        Ok(m) => m,
        Err(e) => return of_file(file, e),
    };
    match write(&mut moments, &folder, kind, every) {
        Ok((n, rows)) => {
            println!("{}: {n} exchanges, {rows} rows of the monitor", folder.display());
            if let End::Cut(at) = moments.end {
                println!("the run was stopped while it was recorded: the file ends at byte {at}");
            }
            OK
        }
        Err(e) => of_file(file, e),
    }
}
