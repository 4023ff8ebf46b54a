// SPDX-License-Identifier: MIT OR Apache-2.0
//! `cargo bench --bench smoother`: the smoothers' part of `voidage bench` alone.

fn main() -> Result<(), String> {
    let numbers = voidage::bench::report::smoothers(false)?;
    println!("{}", numbers.table());
    Ok(())
}
