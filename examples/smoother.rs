// SPDX-License-Identifier: MIT OR Apache-2.0
//! Prints the smoother's numbers: `cargo run --release --example smoother`.
use voidage::bench::smoother::{Case, run};

fn main() {
    for tolerance in [1e-2, 1e-4] {
        let case = Case { cells: 170_000, width: 4.0, tolerance, filled: 0.25, repetitions: 30 };
        let others: &[&str] = if tolerance < 1e-3 {
            &[
                "chebyshev-u",
                "uniformization",
                "crank-nicolson",
                "crank-nicolson-1",
                "backward-euler",
                "constdiff",
            ]
        } else {
            &["chebyshev-u", "uniformization"]
        };
        match run(&case, others) {
            Ok(n) => println!("{n:#?}"),
            Err(e) => println!("{e}"),
        }
    }
}
