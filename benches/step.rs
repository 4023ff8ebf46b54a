// SPDX-License-Identifier: MIT OR Apache-2.0
//! `cargo bench --bench step`: the coupling step's part of `voidage bench` alone.

fn main() -> Result<(), String> {
    println!("{}", voidage::bench::report::steps(false, |_| ())?.table());
    Ok(())
}
