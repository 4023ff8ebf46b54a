// SPDX-License-Identifier: MIT OR Apache-2.0
//! Frames through shared memory: one iceoryx2 channel per partner rank, private to the run.
//!
//! `channel` is the transport, `janitor` removes what runs leave in /dev/shm and looks at its free space.
//! Does not know what the frames mean.
#![forbid(unsafe_code)]

pub mod channel;
pub mod janitor;

pub use channel::{Channel, Hub};
