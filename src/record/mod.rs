// SPDX-License-Identifier: MIT OR Apache-2.0
//! Recordings: the exchanges of a run in one file, exactly as they came and went, and what can be done with them.
//!
//! `chunk` is the container (versioned, checksummed, append-only), `head` what stands at the head of a chunk, `pack` the
//! compression; `write` records a live run behind `transport`, `read` reads a file as a stream. `replay` feeds one to the
//! coupling step itself (`couple`), through `player`, `moment` decodes one exchange, `compare` sets two side by side, `forecast` tells the
//! size before. Layout: `docs/recording.md`. Knows no processes and no shared memory.

pub mod chunk;
pub mod compare;
pub mod effect;
pub mod exercise;
pub mod forecast;
pub mod head;
pub mod moment;
mod pack;
pub mod player;
pub mod read;
pub mod replay;
pub mod transport;
pub mod write;

pub use head::{Head, SessionHead};
pub use read::{Chunk, End, Reader};
pub use transport::Recorded;
pub use write::{Recorder, Selection};

use thiserror::Error;

/// Version of the file's layout; every later version reads it.
pub const FORMAT: u32 = 1;

/// A recording that cannot be read, or written.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum RecordError {
    /// The system.
    #[error("{what}: {source}")]
    File {
        /// path and operation
        what: String,
        /// why
        source: std::io::Error,
    },
    /// Something else.
    #[error(
        "not a recording of voidage ({0}); recordings are written by `voidage run CASE --set record.every=1`"
    )]
    NotARecording(String),
    /// Numbers in another byte order.
    #[error(
        "the recording comes from a machine of the other byte order (big-endian); replay it on a machine of its own kind"
    )]
    ByteOrder,
    /// A layout of the future.
    #[error(
        "recording format {theirs}, this program reads format {FORMAT}: use the version of voidage that wrote it"
    )]
    Version {
        /// of the file
        theirs: u32,
    },
    /// Messages of another protocol.
    #[error(
        "its messages have protocol version {theirs}, this program speaks {}: use the version of voidage that wrote it ({program})",
        voidage_wire::PROTOCOL
    )]
    Protocol {
        /// of the file
        theirs: u32,
        /// who wrote it
        program: String,
    },
    /// Checksum or lengths are wrong.
    #[error("damaged at byte {offset}: {what}; what stands before is intact (copy the file anew)")]
    Damaged {
        /// where the damaged chunk begins
        offset: u64,
        /// what is wrong
        what: String,
    },
    /// A message or its place is wrong.
    #[error("exchange {k}: {what}")]
    Content {
        /// exchange
        k: i64,
        /// what is wrong
        what: String,
    },
    /// Nothing in it.
    #[error("the recording ends before its first exchange is complete (the run was stopped at its start?)")]
    NoExchange,
}
