// SPDX-License-Identifier: MIT OR Apache-2.0
//! `voidage inspect FILE|CASE`.

use super::record::{fail, of_file};
use super::{BAD_INPUT, OK, overrides, print, read};
use crate::config::{self, Config};
use crate::inspect::{Scene, decide, expected, recorded};
use crate::record::moment::Moments;
use crate::record::replay;
use crate::record::{End, Reader};
use std::path::Path;

/// `voidage inspect FILE|CASE`
pub fn inspect(path: &Path, set: &[String], accuracy: f64) -> u8 {
    if !(accuracy > 0.0 && accuracy < 1.0) {
        eprintln!("error: --accuracy {accuracy}: between 0 and 1; type --accuracy 1e-2");
        return BAD_INPUT;
    }
    if path.is_dir() { of_case(path, set, accuracy) } else { of_recording(path, set, accuracy) }
}

fn of_case(path: &Path, set: &[String], accuracy: f64) -> u8 {
    let config = match read(path, set) {
        Ok((c, _)) => c,
        Err(code) => return code,
    };
    match expected::scene(&config) {
        Ok(s) => {
            println!("{}", path.display());
            show(&s, &config, accuracy);
        }
        Err(e) => {
            eprintln!("error: {}: {e}", path.display());
            return BAD_INPUT;
        }
    }
    print(&config::check(&config));
    OK
}

fn of_recording(path: &Path, set: &[String], accuracy: f64) -> u8 {
    let set = match overrides(set) {
        Ok(s) => s,
        Err(p) => {
            print(&p);
            return BAD_INPUT;
        }
    };
    let reader = match Reader::open(path) {
        Ok(r) => r,
        Err(e) => return of_file(path, e),
    };
    let config = match replay::case(&reader, &set) {
        Ok(c) => c,
        Err(e) => return fail(&e),
    };
    let scene = Moments::new(reader).and_then(|mut m| Ok((recorded::scene(&mut m, &config)?, m)));
    let (scene, m) = match scene {
        Ok(s) => s,
        Err(e) => return of_file(path, e),
    };
    let (s, list) = (&m.reader.session, &m.exchanges);
    let range = list.first().zip(list.last()).map(|(a, b)| format!("exchanges {} to {}", a.0, b.0));
    println!(
        "{}: voidage {}, {} DEM and {} CFD ranks, {} exchanges recorded ({}), fluid time from {} s, planned end {} s",
        path.display(),
        s.program,
        s.dem_ranks,
        s.cfd_ranks,
        list.len(),
        range.unwrap_or_default(),
        s.origin,
        s.end
    );
    if let End::Cut(at) = m.end {
        println!("  the run was stopped while it was recorded: the file ends at byte {at}, without an index");
    }
    show(&scene, &config, accuracy);
    OK
}

fn show(s: &Scene, c: &Config, accuracy: f64) {
    print!("{s}");
    println!("terms (auto: on where the magnitude exceeds the accuracy of {accuracy:.0e}):");
    println!("  {:28} {:>10}  {:18} {:4} {:8} how", "term", "magnitude", "relative to", "now", "auto");
    for t in &s.terms {
        let (now, auto) = (if t.now { "on" } else { "off" }, decide::choose(t, accuracy));
        println!("  {:28} {:10.2e}  {:18} {now:4} {auto:8} {}", t.name, t.relative, t.to, t.how);
    }
    let f = &c.file;
    println!(
        "settings: drag {}, scheme {}, map {}, smooth {} (tolerance {:.0e})",
        f.forces.drag, f.coupling.scheme, f.map.method, f.smooth.method, f.smooth.tolerance
    );
    for line in decide::advice(s, accuracy) {
        println!("advice: {line}");
    }
}
