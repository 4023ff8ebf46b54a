// SPDX-License-Identifier: MIT OR Apache-2.0
//! `voidage replay`: a recording in place of the partners. The messages go through `partners`, `couple` and `step`
//! exactly as in a live run; what the coupler answers is set against what it answered then.
//!
//! Memory is bounded by one exchange. Reads no clock but to time the coupler, writes nothing unless `save` is given.

use super::compare::{Comparison, Replies};
use super::moment::{Messages, Moments};
use super::player::{Begin, Played, Player};
use super::{Reader, RecordError, Recorded, Recorder};
use crate::config::{self, Config, Problem, Severity, foam};
use crate::couple::{Course, Exchange, Summary, receive_mesh};
use crate::mesh::Mesh;
use crate::output::restart::Sets;
use crate::partners::Partners;
use crate::step::{Fluid, Seconds};
use crate::{setup, threads};
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::io::{Read, Seek};
use std::rc::Rc;
use std::time::Duration;
use thiserror::Error;

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
    /// CPU time of the coupler without reading the file, s
    pub cpu: f64,
    /// time of the stages, sums over the exchanges, s
    pub seconds: Seconds,
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

/// Where a replay begins, if not at the first exchange.
#[derive(Clone, Debug, PartialEq)]
pub struct Start {
    /// exchange
    pub k: i64,
    /// byte at which it begins
    offset: u64,
    /// what the exchange before left; none where the recording has it
    left: Option<Left>,
}

/// What an exchange leaves to the next one (`CouplingStep::carried`), by cell slot.
#[derive(Clone, Debug, PartialEq)]
struct Left {
    voidage: Vec<f64>,
    /// fluid velocity, and that of one step earlier, m/s
    velocity: Vec<[f64; 3]>,
    earlier: Vec<[f64; 3]>,
}

impl Start {
    /// At the last `n` exchanges of a recording; none if it has no more. What is carried into the first of them comes
    /// from the replies and the fluid recorded before it.
    pub fn last<R: Read + Seek>(reader: Reader<R>, n: usize) -> Result<Option<Self>, RecordError> {
        let mut m = Moments::new(reader)?;
        let Some(first) = m.exchanges.len().checked_sub(n.max(1)).filter(|f| *f > 0) else { return Ok(None) };
        let (k, offset) = m.exchanges[first];
        let mut left = None;
        // without feedback the replies hold no voidage: a running mean of it begins anew
        if m.exchanges[first - 1].0 == k - 1
            && let Some(x) = m.at(first - 1)?
        {
            let voidage = x.sources(&m.mesh)?.voidage;
            let velocity = x.fluid(&m.mesh)?.velocity;
            let earlier = match m.exchange(k - 2)? {
                Some(x) => x.fluid(&m.mesh)?.velocity,
                None => velocity.clone(),
            };
            left = Some(Left { voidage, velocity, earlier });
        }
        Ok(Some(Self { k, offset, left }))
    }
}

/// One exchange replayed.
pub struct Exchanged<'a> {
    /// exchange
    pub k: i64,
    /// the messages with the replies recorded, and with those of the replay
    pub recorded: &'a Messages,
    /// see `recorded`
    pub anew: &'a Messages,
    /// of all CFD ranks
    pub mesh: &'a Mesh,
    /// at the end of its step, by cell slot
    pub fluid: &'a Fluid,
    /// CPU time of the coupler without reading the file, all its threads, s
    pub cpu: f64,
}

/// Replays a recording; `progress` is told each exchange.
pub fn replay<R: Read + Seek + 'static>(
    reader: Reader<R>,
    options: Options<R>,
    progress: &mut dyn FnMut(i64),
) -> Result<Outcome, ReplayError> {
    let (mut comparison, mut reference) = (Comparison::default(), options.reference);
    let mut compare = |x: &Exchanged| {
        let of = |m| Replies::of(m, &x.mesh.slots, x.mesh.len());
        let got = of(x.anew)?;
        match &mut reference {
            None => comparison.add(&got, &of(x.recorded)?)?,
            Some(r) => match r.exchange(x.k)? {
                Some(m) => comparison.add(&got, &Replies::of(&m, &r.mesh.slots, r.mesh.len())?)?,
                None => comparison.unmatched += 1,
            },
        }
        progress(x.k);
        Ok(true)
    };
    let out = each(reader, options.overrides, options.save, None, &mut compare)?;
    Ok(Outcome { comparison, ..out })
}

/// Told of an exchange; false: the replay ends with it.
pub type Visit<'a> = dyn FnMut(&Exchanged) -> Result<bool, ReplayError> + 'a;

/// Replays a recording from `start` on and shows every exchange to `visit`; the outcome has no comparison.
pub fn each<R: Read + Seek + 'static>(
    reader: Reader<R>,
    overrides: &[(String, String)],
    save: Option<(&std::path::Path, config::Compression)>,
    start: Option<&Start>,
    visit: &mut Visit,
) -> Result<Outcome, ReplayError> {
    let config = case(&reader, overrides)?;
    let session = reader.session.clone();
    let (dem, cfd) = (session.dem_ranks as usize, session.cfd_ranks as usize);
    let player = Rc::new(RefCell::new(Player::new(reader)));
    let recorder = match save {
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
    let cells = mesh.len();
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
    let mut before: Option<i64> = None;
    if let Some(s) = start {
        player.borrow_mut().seek(s.offset)?;
        if let Some(l) = &s.left {
            run.step.restore(&l.voidage, &l.velocity, &l.earlier);
            before = Some(s.k - 1);
        }
    }
    let mut checked = false;
    loop {
        let next = player.borrow_mut().next_exchange()?;
        let Some(Begin { k, state, on, .. }) = next else { break };
        if !checked {
            missing(&config, &player.borrow().told)?;
            checked = true;
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
        let clock = |run: &Exchange<_>| threads::cpu_seconds(run.pool.as_ref());
        player.borrow_mut().reading = 0.0;
        let begin = clock(&run);
        let result = run.exchange(k, &mut course);
        let cpu = clock(&run) - begin - player.borrow().reading;
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
        let (recorded, anew, mesh, fluid) = (&p.recorded, &p.anew, &run.step.mesh, course.fluid());
        let more = visit(&Exchanged { k, recorded, anew, mesh, fluid, cpu })?;
        out.cpu += cpu;
        out.exchanges += 1;
        out.range = Some((out.range.map_or(k, |r| r.0), k));
        before = Some(k);
        if !more {
            break;
        }
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
