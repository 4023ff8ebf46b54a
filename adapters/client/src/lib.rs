// SPDX-License-Identifier: MIT OR Apache-2.0
//! The C interface: `numbers` (constants), `interface` (the functions of `voidage.h`), `link` (their safe body).
//!
//! One shared library for all C++ sides of a process: two copies of iceoryx2 in one process do not work.
//! Unsafe code is confined to `interface`.

pub mod interface;
pub mod link;
pub mod numbers;
