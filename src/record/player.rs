// SPDX-License-Identifier: MIT OR Apache-2.0
//! The partners' side of a replay: recorded messages come out of transports in the order the coupler asks for them, and
//! what it answers is kept beside what it answered then.
//!
//! Reads a recording as a stream; holds the messages of one exchange. Counts the CPU time (s) of reading, which a live
//! run does not have. Does not know what messages mean beyond their kind.

use super::compare::is_reply;
use super::moment::Messages;
use super::{Chunk, Head, Reader, RecordError};
use crate::threads;
use std::cell::RefCell;
use std::collections::{BTreeMap, VecDeque};
use std::io::{Read, Seek};
use std::rc::Rc;
use std::time::Duration;
use voidage_wire::memory::Words;
use voidage_wire::{Frame, Transport, TransportError, Welcome, field, hello, kind};

/// A message that begins an exchange, read ahead.
pub struct Begin {
    /// exchange
    pub k: i64,
    time: f64,
    /// voidage, velocity and velocity before, in one array
    pub state: Option<(usize, Vec<u64>)>,
    /// forces that `auto` had on
    pub on: Option<u32>,
}

/// Feeds recorded messages to the transports.
pub struct Player<R: Read + Seek> {
    /// the file
    pub reader: Reader<R>,
    queues: Vec<VecDeque<Vec<u64>>>,
    begin: Option<Begin>,
    /// the exchange at hand as recorded
    pub recorded: Messages,
    /// and as answered anew
    pub anew: Messages,
    /// what the recorded partners were told
    pub told: BTreeMap<String, f64>,
    /// nothing follows
    pub ended: bool,
    /// why reading failed: a transport can only tell that it did
    pub error: Option<RecordError>,
    /// CPU time of reading while the coupler waited for a message, s
    pub reading: f64,
}

impl<R: Read + Seek> Player<R> {
    /// Of a recording at its first chunk after the session.
    pub fn new(reader: Reader<R>) -> Self {
        let partners = reader.session.dem_ranks as usize + reader.session.cfd_ranks as usize;
        let empty = || Messages::new(i64::MIN, 0.0);
        Self {
            reader,
            queues: (0..partners).map(|_| VecDeque::new()).collect(),
            begin: None,
            recorded: empty(),
            anew: empty(),
            told: BTreeMap::new(),
            ended: false,
            error: None,
            reading: 0.0,
        }
    }

    /// Goes to the exchange that begins at this byte; what was read ahead is forgotten.
    pub fn seek(&mut self, offset: u64) -> Result<(), RecordError> {
        self.queues.iter_mut().for_each(VecDeque::clear);
        (self.begin, self.ended) = (None, false);
        self.reader.seek(offset)
    }

    /// Reads one chunk and puts it where it belongs; false: an exchange begins, or the file ends.
    pub fn read(&mut self) -> Result<bool, RecordError> {
        if self.begin.is_some() || self.ended {
            return Ok(false);
        }
        let Some(chunk) = self.reader.next()? else {
            self.ended = true;
            return Ok(false);
        };
        if let Head::Exchange { k, time } = chunk.head {
            let mut begin = Begin { k, time, state: None, on: None };
            // what is in force and what the step carries follow at once, if they are there
            while let Some(next) = self.reader.next()? {
                match next.head {
                    // of another exchange: damage that the replies show
                    Head::Choice { k: of, on } => begin.on = Some(on).filter(|_| of == k),
                    Head::State { cells, .. } => {
                        begin.state = Some((cells as usize, next.words));
                        break;
                    }
                    _ => {
                        self.take(next)?;
                        break;
                    }
                }
            }
            self.begin = Some(begin);
            return Ok(false);
        }
        self.take(chunk)?;
        Ok(true)
    }

    fn take(&mut self, Chunk { head, words, offset }: Chunk) -> Result<(), RecordError> {
        let Head::Message { partner, sent, kind, step } = head else { return Ok(()) };
        if partner as usize >= self.queues.len() {
            return Err(RecordError::Damaged { offset, what: format!("a message of partner {partner}") });
        }
        if step == self.recorded.k && (is_reply(kind) || kind == kind::PARTICLES) {
            self.recorded.add(partner, kind, words.clone());
        }
        if kind == kind::WELCOME {
            let text = Frame::parse(&words).and_then(|f| f.bytes(field::TEXT).map(<[u8]>::to_vec));
            let what = |what: String| RecordError::Damaged { offset, what };
            let text = text.map_err(|e| what(e.to_string()))?;
            self.told = hello::decode::<Welcome>(&text).map_err(what)?.settings;
        }
        if !sent {
            self.queues[partner as usize].push_back(words);
        }
        Ok(())
    }

    /// The next exchange of the file; messages of earlier ones are dropped.
    pub fn next_exchange(&mut self) -> Result<Option<Begin>, RecordError> {
        while self.read()? {}
        let begin = self.begin.take();
        if let Some(b) = &begin {
            (self.recorded, self.anew) = (Messages::new(b.k, b.time), Messages::new(b.k, b.time));
            for (i, q) in self.queues.iter_mut().enumerate() {
                q.retain(|w| w.get(2).is_some_and(|step| *step as i64 >= b.k));
                for w in q.iter().filter(|w| w[2] as i64 == b.k && w[1] == u64::from(kind::PARTICLES)) {
                    self.recorded.add(i as u32, kind::PARTICLES, w.clone());
                }
            }
        }
        Ok(begin)
    }

    fn receive(&mut self, i: usize) -> Result<Option<Vec<u64>>, RecordError> {
        while self.queues[i].is_empty() {
            // in the handshake, messages of the first exchange may be read ahead of its begin
            if !self.read()? {
                return Ok(None);
            }
        }
        let words = self.queues[i].pop_front();
        if let Some(w) = words.as_ref().filter(|w| w.get(1) == Some(&u64::from(kind::PARTICLES))) {
            self.anew.add(i as u32, kind::PARTICLES, w.clone());
        }
        Ok(words)
    }
}

/// The partner's end of a recorded channel.
pub struct Played<R: Read + Seek> {
    /// all channels read one file
    pub player: Rc<RefCell<Player<R>>>,
    /// DEM ranks, then CFD ranks
    pub partner: usize,
    /// for messages
    pub peer: String,
}

impl<R: Read + Seek> Transport for Played<R> {
    type Loan = Words;
    type Sample = Words;
    fn peer(&self) -> &str {
        &self.peer
    }
    fn loan(&mut self, words: usize) -> Result<Words, TransportError> {
        Ok(Words(vec![0; words]))
    }
    fn send(&mut self, loan: Words) -> Result<(), TransportError> {
        let kind = loan[1] as u32;
        if is_reply(kind) {
            self.player.borrow_mut().anew.add(self.partner as u32, kind, loan.0);
        }
        Ok(())
    }
    fn receive(&mut self, _: Duration) -> Result<Option<Words>, TransportError> {
        let mut player = self.player.borrow_mut();
        let fail = |why: &str| TransportError::System { what: "read the recording", why: why.into() };
        let begin = threads::cpu_seconds(None);
        let received = player.receive(self.partner);
        player.reading += threads::cpu_seconds(None) - begin;
        match received {
            Ok(Some(words)) => Ok(Some(Words(words))),
            Ok(None) if player.ended => Err(fail("it ends here")),
            Ok(None) => Err(fail("the next message is not in it")),
            Err(e) => {
                let text = e.to_string();
                player.error = Some(e);
                Err(fail(&text))
            }
        }
    }
}
