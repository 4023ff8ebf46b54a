// SPDX-License-Identifier: MIT OR Apache-2.0
//! `voidage replay`: a recording in place of the partners. The messages go through `partners`, `couple` and `step`
//! exactly as in a live run; what the coupler answers is set against what it answered then.
//!
//! Memory is bounded by one exchange. Reads no clock but to time the coupler, writes nothing unless `save` is given.

use super::compare::{Comparison, Replies, is_reply};
use super::moment::{Messages, Moments};
use super::{Chunk, Head, Reader, RecordError, Recorded, Recorder};
use crate::config::{self, Config, Problem, Severity, foam};
use crate::couple::{Course, Exchange, Summary, receive_mesh};
use crate::output::restart::Sets;
use crate::partners::Partners;
use crate::setup;
use crate::step::Seconds;
use std::cell::RefCell;
use std::collections::{BTreeMap, VecDeque};
use std::io::{Read, Seek};
use std::rc::Rc;
use std::time::Duration;
use thiserror::Error;
use voidage_wire::memory::Words;
use voidage_wire::{Frame, Transport, TransportError, Welcome, field, hello, kind};

/// Why a recording was not replayed.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ReplayError {
    /// The file.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// The settings, or the run itself.
    #[error("{0}")]
    Run(String),
    /// Overrides that cannot be.
    #[error("{}", list(.0))]
    Settings(Vec<Problem>),
}

fn list(problems: &[Problem]) -> String {
    problems.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n")
}

/// What a replay came to.
#[derive(Clone, Debug, Default)]
pub struct Outcome {
    /// exchanges replayed
    pub exchanges: u64,
    /// the first and the last
    pub range: Option<(i64, i64)>,
    /// replies against those recorded
    pub comparison: Comparison,
    /// byte after which the file has no whole exchange (the run was killed)
    pub cut: Option<u64>,
    /// the run's own summary; `coupler` is the time of the step in the replay, s
    pub summary: Summary,
    /// time of the stages, sums over the exchanges, s
    pub seconds: Seconds,
}

/// A message that begins an exchange, read ahead.
struct Begin {
    k: i64,
    time: f64,
    /// voidage, velocity and velocity before, in one array
    state: Option<(usize, Vec<u64>)>,
    /// forces that `auto` had on
    on: Option<u32>,
}

/// Feeds recorded messages to the transports.
struct Player<R: Read + Seek> {
    reader: Reader<R>,
    queues: Vec<VecDeque<Vec<u64>>>,
    begin: Option<Begin>,
    /// the exchange at hand as recorded, and as answered anew
    recorded: Messages,
    anew: Messages,
    /// what the recorded partners were told
    told: BTreeMap<String, f64>,
    ended: bool,
    error: Option<RecordError>,
}

impl<R: Read + Seek> Player<R> {
    /// Reads one chunk and puts it where it belongs; false: an exchange begins, or the file ends.
    fn read(&mut self) -> Result<bool, RecordError> {
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
    fn next_exchange(&mut self) -> Result<Option<Begin>, RecordError> {
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
struct Played<R: Read + Seek> {
    player: Rc<RefCell<Player<R>>>,
    partner: usize,
    peer: String,
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
        match player.receive(self.partner) {
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

/// Sections and keys that say how the recorded programs ran, not what the coupling step does with their messages.
const FIXED: &[&str] = &[
    "format",
    "run.dem_ranks",
    "run.cfd_ranks",
    "fluid.case",
    "fluid.solver",
    "fluid.flow",
    "dem.program",
    "dem.script",
    "dem.time_step",
    "dem.force",
    "dem.variables",
    "coupling.interval",
    "output.",
    "auto.",
    "record.",
    "limits.wait",
];

/// The case of a recording with overrides, checked.
pub fn case<R: Read + Seek>(
    reader: &Reader<R>,
    overrides: &[(String, String)],
) -> Result<Config, ReplayError> {
    let s = &reader.session;
    let fixed = |key: &str| FIXED.iter().any(|f| key == *f || f.ends_with('.') && key.starts_with(f));
    let wrong: Vec<Problem> = overrides
        .iter()
        .filter(|o| fixed(&o.0))
        .map(|(key, value)| {
            let accepted = "it says how the recorded programs ran; a replay cannot change it";
            Problem::error(key, value, accepted, "leave it out, or run and record the case anew with it")
        })
        .collect();
    if !wrong.is_empty() {
        return Err(ReplayError::Settings(wrong));
    }
    let control = foam::Control { start: s.origin, end: s.end, step: s.period, adjustable: false };
    let config = config::recorded(&reader.case, overrides, control).map_err(ReplayError::Settings)?;
    let problems: Vec<Problem> =
        config::settings(&config).into_iter().filter(|p| p.severity == Severity::Error).collect();
    if problems.is_empty() { Ok(config) } else { Err(ReplayError::Settings(problems)) }
}

/// What the step would need and the recorded partners were not asked to send.
fn missing(config: &Config, told: &BTreeMap<String, f64>) -> Result<(), ReplayError> {
    for (key, value) in setup::welcome(config, None).settings {
        let then = told.get(&key).copied().unwrap_or(0.0);
        // the memory of the history force goes to the DEM and comes back
        let asked = key.starts_with("send.") || key == "drive.memory";
        if asked && value > then {
            let what = key.split('.').next_back().unwrap_or_default().replace('_', " ");
            return Err(ReplayError::Run(format!(
                "these settings need the {what}, which the recorded programs did not send ({key} = 0): record the case with them"
            )));
        }
    }
    Ok(())
}

/// Where replies are compared with, and where the replay is recorded.
pub struct Options<'a, R: Read + Seek> {
    /// settings other than the recorded ones
    pub overrides: &'a [(String, String)],
    /// compare with the replies of this recording instead
    pub reference: Option<Moments<R>>,
    /// record the replay
    pub save: Option<(&'a std::path::Path, config::Compression)>,
}

/// Replays a recording; `progress` is told each exchange.
pub fn replay<R: Read + Seek + 'static>(
    reader: Reader<R>,
    options: Options<R>,
    progress: &mut dyn FnMut(i64),
) -> Result<Outcome, ReplayError> {
    let config = case(&reader, options.overrides)?;
    let session = reader.session.clone();
    let (dem, cfd) = (session.dem_ranks as usize, session.cfd_ranks as usize);
    let queues = (0..dem + cfd).map(|_| VecDeque::new()).collect();
    let empty = || Messages::new(i64::MIN, 0.0);
    let (recorded, anew) = (empty(), empty());
    let player = Player {
        reader,
        queues,
        begin: None,
        recorded,
        anew,
        told: BTreeMap::new(),
        ended: false,
        error: None,
    };
    let player = Rc::new(RefCell::new(player));
    let recorder = match options.save {
        None => None,
        Some((path, how)) => {
            let all = super::Selection { every: 1, first: 0, last: 0, steps: 0 };
            let text = toml::to_string(&config.file).map_err(|e| ReplayError::Run(e.to_string()))?;
            Some(Recorder::create(path, all, how, session.clone(), &text)?)
        }
    };
    let end = |partner: usize, name: &str, rank: usize| {
        let played = Played { player: Rc::clone(&player), partner, peer: format!("{name} rank {rank}") };
        Recorded::new(played, partner as u32, recorder.clone())
    };
    let dem_ends = (0..dem).map(|r| end(r, "DEM", r)).collect();
    let cfd_ends = (0..cfd).map(|r| end(dem + r, "CFD", r)).collect();
    let mut partners = Partners::new(dem_ends, cfd_ends, Duration::from_secs(1));
    partners.of_a_recording();
    let told = |e: &dyn std::fmt::Display| {
        let mut p = player.borrow_mut();
        match p.error.take() {
            Some(e) => ReplayError::Record(e),
            None if p.ended => ReplayError::Record(RecordError::NoExchange),
            None => ReplayError::Run(e.to_string()),
        }
    };
    partners.meet(&session.token, Duration::from_secs(3600)).map_err(|e| told(&e))?;
    let welcome = setup::welcome(&config, None);
    for i in partners.dem().chain(partners.cfd()) {
        partners.welcome(i, &welcome).map_err(|e| told(&e))?;
    }
    let mesh = receive_mesh(&mut partners).map_err(|e| told(&e))?;
    let (slots, cells) = (mesh.slots.clone(), mesh.len());
    let mut step = setup::step(&config, mesh).map_err(ReplayError::Run)?;
    if let Some(w) = step.watch() {
        w.follow();
    }
    let mut run = Exchange {
        partners,
        step,
        pool: setup::pool(&config).map_err(ReplayError::Run)?,
        two_way: config.file.coupling.feedback == config::Feedback::TwoWay,
        period: config.period(),
        start: session.origin,
        dem_step: 0,
        interval: i64::from(config.file.coupling.interval),
        resume: None,
        sets: Sets::named_only(&config),
        monitor: None,
        recorder: recorder.clone(),
        progress: &mut |_, _| {},
        write: &mut |_| Ok(()),
    };
    let (mut course, mut out) = (Course::default(), Outcome::default());
    let mut reference = options.reference;
    let mut before: Option<i64> = None;
    loop {
        let next = player.borrow_mut().next_exchange()?;
        let Some(Begin { k, state, on, .. }) = next else { break };
        if before.is_none() {
            missing(&config, &player.borrow().told)?;
        }
        let carry = |what: &str| RecordError::Content { k, what: what.into() };
        match state {
            Some((n, words)) => {
                let numbers: &[f64] = bytemuck::cast_slice(&words);
                if n != cells || ![4 * cells, 7 * cells].contains(&numbers.len()) {
                    return Err(carry("its state does not fit the mesh").into());
                }
                let vectors: &[[f64; 3]] = bytemuck::cast_slice(&numbers[cells..]);
                run.pause(&mut course).map_err(|e| told(&e))?;
                run.step.restore(&numbers[..cells], &vectors[..cells], &vectors[cells..]);
            }
            None if k == 0 || before == Some(k - 1) => {}
            None => return Err(carry("what the exchange before left is not in the recording").into()),
        }
        if let Some(bits) = on {
            run.step.put_in_force(bits);
        }
        let result = run.exchange(k, &mut course);
        if let Err(e) = result {
            let mut p = player.borrow_mut();
            if let Some(e) = p.error.take() {
                return Err(e.into());
            }
            if p.ended {
                break;
            }
            return Err(ReplayError::Run(e.to_string()));
        }
        add(&mut out.seconds, &run.step.seconds);
        // the replies to this exchange stand before the begin of the next
        let mut p = player.borrow_mut();
        while p.read()? {}
        let whole = p.recorded.has_all_of(&p.anew);
        if p.ended && !whole {
            break;
        }
        let got = Replies::of(&p.anew, &slots, cells)?;
        match &mut reference {
            None => out.comparison.add(&got, &Replies::of(&p.recorded, &slots, cells)?)?,
            Some(r) => match r.exchange(k)? {
                Some(m) => out.comparison.add(&got, &Replies::of(&m, &r.mesh.slots, r.mesh.len())?)?,
                None => out.comparison.unmatched += 1,
            },
        }
        out.exchanges += 1;
        out.range = Some((out.range.map_or(k, |r| r.0), k));
        before = Some(k);
        drop(p);
        progress(k);
    }
    if out.exchanges == 0 {
        return Err(RecordError::NoExchange.into());
    }
    run.pause(&mut course).map_err(|e| told(&e))?;
    out.summary = course.summary;
    if let Some(super::End::Cut(at)) = player.borrow().reader.end {
        out.cut = Some(at);
    }
    if let Some(r) = recorder {
        drop(run);
        r.finish()?;
    }
    Ok(out)
}

fn add(sum: &mut Seconds, s: &Seconds) {
    for (a, b) in [
        (&mut sum.locate, s.locate),
        (&mut sum.arrange, s.arrange),
        (&mut sum.map, s.map),
        (&mut sum.solids, s.solids),
        (&mut sum.forces, s.forces),
        (&mut sum.sources, s.sources),
        (&mut sum.gather, s.gather),
        (&mut sum.drive, s.drive),
    ] {
        *a += b;
    }
}
