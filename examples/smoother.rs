// SPDX-License-Identifier: MIT OR Apache-2.0
//! Prints the smoother's numbers: `cargo run --release --example smoother`.
use voidage::bench::smoother::{Case, run};

fn main() {
    let case = Case { cells: 170_000, width: 4.0, tolerance: 1e-4, filled: 0.25, repetitions: 30 };
    match run(&case, &["uniformization", "crank-nicolson", "backward-euler", "constdiff"]) {
        Ok(n) => println!("{n:#?}"),
        Err(e) => println!("{e}"),
    }
}
