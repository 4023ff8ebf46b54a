// SPDX-License-Identifier: MIT OR Apache-2.0
//! A transport that records what passes through it. Knows the number of its partner, nothing of the content.

use super::Recorder;
use std::time::Duration;
use voidage_wire::{Transport, TransportError};

/// Any transport, recorded or not.
pub struct Recorded<T: Transport> {
    inner: T,
    partner: u32,
    to: Option<Recorder>,
}

impl<T: Transport> Recorded<T> {
    /// `partner`: DEM ranks, then CFD ranks; without a recorder it costs nothing.
    pub fn new(inner: T, partner: u32, to: Option<Recorder>) -> Self {
        Self { inner, partner, to }
    }

    fn keep(&self, sent: bool, words: &[u64]) -> Result<(), TransportError> {
        let Some(r) = &self.to else { return Ok(()) };
        r.message(self.partner, sent, words)
            .map_err(|e| TransportError::System { what: "record the message", why: e.to_string() })
    }
}

impl<T: Transport> Transport for Recorded<T> {
    type Loan = T::Loan;
    type Sample = T::Sample;
    fn peer(&self) -> &str {
        self.inner.peer()
    }
    fn loan(&mut self, words: usize) -> Result<T::Loan, TransportError> {
        self.inner.loan(words)
    }
    fn send(&mut self, loan: T::Loan) -> Result<(), TransportError> {
        self.keep(true, &loan)?;
        self.inner.send(loan)
    }
    fn receive(&mut self, limit: Duration) -> Result<Option<T::Sample>, TransportError> {
        let sample = self.inner.receive(limit)?;
        if let Some(s) = &sample {
            self.keep(false, s)?;
        }
        Ok(sample)
    }
}
