// SPDX-License-Identifier: MIT OR Apache-2.0
//! The stability and accuracy map of all coupling schemes: prints a table, writes `schemes.csv` and `schemes.svg` into
//! the folder given (default: here). `cargo run --release --example extremes -- FOLDER [coarse]`; the whole map takes
//! minutes, `coarse` seconds.

use std::path::PathBuf;
use std::process::ExitCode;
use voidage::scheme::testbench::{CELLS, LOADINGS, Mode, RATIOS, Row, csv, survey, svg};
use voidage::scheme::{Scheme, all};

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let folder = PathBuf::from(arguments.first().map_or(".", String::as_str));
    let coarse = arguments.get(1).is_some_and(|a| a == "coarse");
    let every = if coarse { 3 } else { 1 };
    let some = |v: &[f64]| v.iter().copied().step_by(every).collect::<Vec<_>>();
    let rows = survey(&some(&RATIOS), &some(&LOADINGS), &some(&CELLS), |_| {});
    println!(
        "{:22} {:14} {:>7} {:>9} {:>10} {:>10} {:>10} {:>10} {:>12} {:>10}",
        "scheme",
        "particles",
        "points",
        "unstable",
        "largest U",
        "third law",
        "of terms",
        "drift",
        "steady",
        "transient"
    );
    for scheme in all() {
        for mode in Mode::ALL {
            line(*scheme, mode, &rows);
        }
    }
    for (name, text) in [("schemes.csv", csv(&rows)), ("schemes.svg", svg(&rows))] {
        if let Err(e) = std::fs::write(folder.join(name), text) {
            println!("{}: {e}", folder.join(name).display());
            return ExitCode::FAILURE;
        }
    }
    ExitCode::SUCCESS
}

/// Worst of all points of a scheme and mode (errors: of the stable ones); transient: median.
fn line(scheme: &dyn Scheme, mode: Mode, rows: &[Row]) {
    let own: Vec<&Row> =
        rows.iter().filter(|r| r.point.scheme.name() == scheme.name() && r.point.mode == mode).collect();
    let stable: Vec<_> = own.iter().map(|r| r.outcome).filter(|o| o.stable).collect();
    let worst =
        |pick: fn(&voidage::scheme::testbench::Outcome) -> f64| stable.iter().map(pick).fold(0.0, f64::max);
    let mut errors: Vec<f64> = stable.iter().map(|o| o.transient).collect();
    errors.sort_by(f64::total_cmp);
    println!(
        "{:22} {:14} {:7} {:9} {:10.2e} {:10.2e} {:10.2e} {:10.2e} {:12.2e} {:10.2e}",
        scheme.name(),
        mode.name(),
        own.len(),
        own.len() - stable.len(),
        worst(|o| o.largest),
        worst(|o| o.third_law),
        worst(|o| o.third_law_terms),
        worst(|o| o.drift),
        worst(|o| o.steady),
        errors.get(errors.len() / 2).copied().unwrap_or(f64::NAN)
    );
}
