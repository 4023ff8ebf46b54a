// SPDX-License-Identifier: MIT OR Apache-2.0
//! `voidage tune FILE`.

use super::record::{fail, of_file};
use super::{BAD_INPUT, FAILED, OK, json_text, overrides, print, write};
use crate::config::Problem;
use crate::record::Reader;
use crate::record::replay::ReplayError;
use crate::tune::settings::Part;
use crate::tune::{self, Ask};
use std::path::Path;
use std::time::{Duration, Instant};

/// What is asked on the command line.
#[derive(Clone, Debug)]
pub struct Options<'a> {
    /// overrides of all candidates
    pub set: &'a [String],
    /// largest numerical error
    pub accuracy: f64,
    /// exchanges replayed
    pub exchanges: usize,
    /// what is varied
    pub only: &'a [String],
    /// file for the case section
    pub write: Option<&'a Path>,
    /// file for all numbers
    pub json: Option<&'a Path>,
    /// print all candidates
    pub all: bool,
}

fn ask<'a>(o: &Options, base: &'a [(String, String)]) -> Result<Ask<'a>, Problem> {
    if !(o.accuracy > 0.0 && o.accuracy < 1.0) {
        let accepted = "a relative error between 0 and 1";
        return Err(Problem::error("--accuracy", o.accuracy, accepted, "type --accuracy 1e-3"));
    }
    if o.exchanges < 2 {
        let accepted = "at least 2: the first is not timed";
        return Err(Problem::error("--exchanges", o.exchanges, accepted, "type --exchanges 12"));
    }
    let part = |name: &String| {
        let accepted = format!("accepted: {}", Part::NAMES.join(", "));
        Part::by_name(name).ok_or_else(|| Problem::error("--only", name, &accepted, "type --only smoother"))
    };
    let only = o.only.iter().map(part).collect::<Result<_, _>>()?;
    Ok(Ask { base, accuracy: o.accuracy, exchanges: o.exchanges, only })
}

/// `voidage tune FILE`
pub fn tune(file: &Path, o: &Options) -> u8 {
    let base = match overrides(o.set) {
        Ok(s) => s,
        Err(p) => {
            print(&p);
            return BAD_INPUT;
        }
    };
    let ask = match ask(o, &base) {
        Ok(a) => a,
        Err(p) => {
            print(&[p]);
            return BAD_INPUT;
        }
    };
    let mut said = Instant::now();
    let mut say = |what: &str| {
        if said.elapsed() > Duration::from_secs(2) {
            said = Instant::now();
            let words: Vec<&str> = what.split_whitespace().collect();
            eprintln!("{}", words.join(" "));
        }
    };
    let mut table = match tune::tune(&|| Reader::open(file), &ask, &mut say) {
        Ok(t) => t,
        Err(ReplayError::Record(e)) => return of_file(file, e),
        Err(e) => return fail(&e),
    };
    table.all = o.all;
    print!("{}: {table}", file.display());
    let Some(text) = json_text(&table) else { return FAILED };
    let mut written = o.json.is_none_or(|to| write("--json", to, text));
    let Some(section) = &table.section else { return FAILED };
    written &= o.write.is_none_or(|to| write("--write", to, section.clone()));
    if written { OK } else { FAILED }
}
