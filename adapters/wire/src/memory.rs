// SPDX-License-Identifier: MIT OR Apache-2.0
//! The transport's in-memory double: two ends in one process, for tests and examples.

use crate::{Transport, TransportError};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::time::Duration;

/// One end of an in-memory channel.
pub struct Memory {
    peer: String,
    tx: SyncSender<Vec<u64>>,
    rx: Receiver<Vec<u64>>,
}

/// Two connected ends; each names the other.
pub fn pair(first: &str, second: &str) -> (Memory, Memory) {
    let (a, b) = (sync_channel(2), sync_channel(2));
    (Memory { peer: second.into(), tx: a.0, rx: b.1 }, Memory { peer: first.into(), tx: b.0, rx: a.1 })
}

impl Transport for Memory {
    type Loan = Words;
    type Sample = Words;
    fn peer(&self) -> &str {
        &self.peer
    }
    fn loan(&mut self, words: usize) -> Result<Words, TransportError> {
        Ok(Words(vec![0; words]))
    }
    fn send(&mut self, loan: Words) -> Result<(), TransportError> {
        self.tx.try_send(loan.0).map_err(|_| TransportError::NotTaken { peer: self.peer.clone() })
    }
    fn receive(&mut self, limit: Duration) -> Result<Option<Words>, TransportError> {
        match self.rx.recv_timeout(limit) {
            Ok(v) => Ok(Some(Words(v))),
            Err(RecvTimeoutError::Timeout) => Ok(None),
            Err(RecvTimeoutError::Disconnected) => Err(TransportError::NotTaken { peer: self.peer.clone() }),
        }
    }
}

/// Owned words that deref to a slice.
pub struct Words(pub Vec<u64>);

impl std::ops::Deref for Words {
    type Target = [u64];
    fn deref(&self) -> &[u64] {
        &self.0
    }
}
impl std::ops::DerefMut for Words {
    fn deref_mut(&mut self) -> &mut [u64] {
        &mut self.0
    }
}

#[cfg(test)]
mod tests {
    #[test]
    fn keeps_the_contract() {
        crate::contract::all(|| super::pair("a", "b"));
    }
}
