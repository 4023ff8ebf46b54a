// SPDX-License-Identifier: MIT OR Apache-2.0
//! One candidate measured: a replay with its settings, its replies against those of the exact operator, its CPU time.
//!
//! Reads recorded exchanges; writes errors (relative) and seconds per exchange. The time is that of the coupler's threads
//! from receiving to sending, without reading the file. Between the exchanges memory is swept, as the two programs do
//! that take turns with the coupler: an exchange finds its data out of the caches. Does not choose.

use super::settings::Settings;
use crate::bench::smoother::median;
use crate::record::effect::{Effect, Errors, Gap};
use crate::record::replay::{ReplayError, Start, each};
use crate::record::{Reader, RecordError};
use std::io::{Read, Seek};

/// Opens the recording; every replay reads it anew.
pub type Open<'a, R> = &'a dyn Fn() -> Result<Reader<R>, RecordError>;

/// Told of an exchange's replies and of the times so far (s); false: the replay ends with it.
pub type Watch<'a> = dyn FnMut(Effect, &[f64]) -> Result<bool, ReplayError> + 'a;

/// What is replayed.
pub struct Bench<'a, R: Read + Seek> {
    /// the recording
    pub open: Open<'a, R>,
    /// settings other than the recorded ones, of all candidates
    pub base: &'a [(String, String)],
    /// where the replays begin
    pub start: Option<Start>,
    /// exchanges of a replay
    pub exchanges: usize,
    memory: Vec<u64>,
}

/// Bytes swept between exchanges: more than the caches of a core.
const SWEPT: usize = 32 << 20;

/// A candidate's replay.
#[derive(Clone, Debug, Default)]
pub struct Replayed {
    /// CPU time of each exchange, s
    pub cpu: Vec<f64>,
    /// steps redone with the positive smoother
    pub redone: u64,
}

impl Replayed {
    /// The middle one; the first exchange of a replay allocates and is left out if there are others.
    pub fn median(&self) -> f64 {
        median(self.cpu[usize::from(self.cpu.len() > 1)..].to_vec())
    }
}

impl<'a, R: Read + Seek + 'static> Bench<'a, R> {
    /// The last `exchanges` of a recording.
    pub fn new(
        open: Open<'a, R>,
        base: &'a [(String, String)],
        exchanges: usize,
    ) -> Result<Self, RecordError> {
        let start = Start::last(open()?, exchanges)?;
        Ok(Self { open, base, start, exchanges, memory: vec![1; SWEPT / 8] })
    }

    fn sweep(&mut self) {
        self.memory.iter_mut().for_each(|w| *w = w.wrapping_mul(3));
    }

    /// Replays with these settings; `visit` sees every exchange and ends the replay with false.
    pub fn replay(&mut self, settings: &Settings, visit: &mut Watch) -> Result<Replayed, ReplayError> {
        let (mut cpu, reader, most) = (Vec::new(), (self.open)()?, self.exchanges);
        let (overrides, start) = (settings.overrides(self.base), self.start.clone());
        let outcome = each(reader, &overrides, None, start.as_ref(), &mut |x| {
            cpu.push(x.cpu);
            let more = visit(Effect::of(x)?, &cpu)?;
            self.sweep();
            Ok(more && cpu.len() < most)
        })?;
        Ok(Replayed { cpu, redone: outcome.summary.redone })
    }

    /// The replies with these settings.
    pub fn effects(&mut self, settings: &Settings) -> Result<(Vec<Effect>, Replayed), ReplayError> {
        let mut effects = Vec::new();
        let replayed = self.replay(settings, &mut |e, _| {
            effects.push(e);
            Ok(true)
        })?;
        Ok((effects, replayed))
    }

    /// Errors against `reference` and the last exchange's replies. `bound`: s per exchange; what takes longer is
    /// not replayed to the end.
    pub fn errors(
        &mut self,
        settings: &Settings,
        reference: &[Effect],
        bound: f64,
    ) -> Result<(Errors, Effect, Replayed), ReplayError> {
        let (mut gap, mut last, mut due) = (Gap::default(), None, reference.iter());
        let replayed = self.replay(settings, &mut |e, cpu| {
            let Some(due) = due.next() else { return Ok(false) };
            gap.add(&e, due)?;
            last = Some(e);
            Ok(cpu.len() < 2 || cpu[cpu.len() - 1] < bound)
        })?;
        Ok((gap.errors(), last.ok_or(RecordError::NoExchange)?, replayed))
    }
}
