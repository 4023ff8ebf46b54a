// SPDX-License-Identifier: MIT OR Apache-2.0
//! The extension point for what carries frames between one partner rank and the coupler.
//!
//! Implementations: shared memory (`voidage-shm`), in memory (`memory`); all are held to `contract`.

use std::ops::{Deref, DerefMut};
use std::time::{Duration, Instant};
use thiserror::Error;

/// Why nothing was carried.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum TransportError {
    /// The other side has left or its queue is full.
    #[error("{peer} does not take messages any more")]
    NotTaken {
        /// who
        peer: String,
    },
    /// The process of the other side is gone.
    #[error("{peer} (process {pid}) has died")]
    Died {
        /// who
        peer: String,
        /// process number
        pid: u32,
    },
    /// Nothing came in time; only partners wait this way, the coupler has words of its own.
    #[error(
        "{peer} sent nothing for {seconds:.0} s (partners wait longer than limits.wait: the coupler waits for others first)"
    )]
    Silent {
        /// who
        peer: String,
        /// waited, s
        seconds: f64,
    },
    /// Shared memory ran out.
    #[error("no room for a message of {bytes} bytes: {why}")]
    NoRoom {
        /// wanted
        bytes: usize,
        /// reason of the system
        why: String,
    },
    /// The layer below failed.
    #[error("{what}: {why}")]
    System {
        /// the operation
        what: &'static str,
        /// its reason
        why: String,
    },
}

/// One channel between two processes: frames of 64-bit words, in order, each way.
pub trait Transport {
    /// Room in the shared segment, zeroed, to be written in place.
    type Loan: DerefMut<Target = [u64]>;
    /// A message received, to be read in place; dropped to give it back.
    type Sample: Deref<Target = [u64]>;
    /// Name of the other side, for messages.
    fn peer(&self) -> &str;
    /// Room for a message of `words` words. At most one loan at a time.
    fn loan(&mut self, words: usize) -> Result<Self::Loan, TransportError>;
    /// Sends it. Never blocks: at most two messages may wait at the receiver.
    fn send(&mut self, loan: Self::Loan) -> Result<(), TransportError>;
    /// Waits up to `limit` without spinning; `None` if nothing came. At most one sample at a time.
    fn receive(&mut self, limit: Duration) -> Result<Option<Self::Sample>, TransportError>;
}

/// How often a waiting process looks whether the others still live.
pub const LOOK: Duration = Duration::from_millis(200);

/// Waits for a message up to `limit`, looking at the peer every `LOOK` by `check`.
pub fn wait<T: Transport>(
    transport: &mut T,
    limit: Duration,
    mut check: impl FnMut() -> Result<(), TransportError>,
) -> Result<T::Sample, TransportError> {
    let start = Instant::now();
    loop {
        let left = limit.saturating_sub(start.elapsed());
        if let Some(sample) = transport.receive(left.min(LOOK))? {
            return Ok(sample);
        }
        if let Err(e) = check() {
            // what was sent before the end still counts
            return transport.receive(Duration::ZERO)?.ok_or(e);
        }
        if start.elapsed() >= limit {
            return Err(TransportError::Silent {
                peer: transport.peer().into(),
                seconds: limit.as_secs_f64(),
            });
        }
    }
}

/// Copies a small frame into a loan and sends it.
pub fn send_copy<T: Transport>(transport: &mut T, frame: &[u64]) -> Result<(), TransportError> {
    let mut loan = transport.loan(frame.len())?;
    loan.copy_from_slice(frame);
    transport.send(loan)
}
