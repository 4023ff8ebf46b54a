// SPDX-License-Identifier: MIT OR Apache-2.0
//! `voidage tune`: what each setting costs and how exact it is, measured on the user's own recording, and the cheapest
//! settings that are exact enough.
//!
//! `settings` lists the candidates, `measure` replays one, `model` has the particles' exact Gaussians, `estimate` what is
//! only estimated, `table` prints. Two errors, kept apart: *numerical*, against the exact operator on the same deposit,
//! which smoother and tolerance answer for, and *model*, of the solid fraction against the exact Gaussians, which mapping
//! and mesh answer for. docs/tune.md defines every number.

pub mod estimate;
pub mod measure;
pub mod model;
pub mod settings;
pub mod table;

use crate::config::Config;
use crate::record::effect::{Effect, Error, Errors};
use crate::record::moment::Moments;
use crate::record::replay::{ReplayError, case};
use crate::setup;
use measure::{Bench, Open, Replayed};
use model::Scene;
use serde::Serialize;
use settings::{Part, Settings};
use std::io::{Read, Seek};
pub use table::Table;

/// What is asked.
#[derive(Clone, Debug)]
pub struct Ask<'a> {
    /// settings other than the recorded ones, of all candidates
    pub base: &'a [(String, String)],
    /// largest numerical error, relative in L2
    pub accuracy: f64,
    /// the last exchanges of the recording are replayed
    pub exchanges: usize,
    /// what is varied; empty: everything
    pub only: Vec<Part>,
}

/// A candidate as measured.
#[derive(Clone, Debug, Serialize)]
pub struct Point {
    /// what was set
    pub settings: Settings,
    /// against the exact operator on the same deposit
    pub numerical: Errors,
    /// the largest of its three L2 errors
    pub error: f64,
    /// of the solid fraction against the exact Gaussians, these settings; none where there are none
    pub model: Option<Error>,
    /// the same of the exact operator: what the mapping answers for
    pub model_of_mapping: Option<Error>,
    /// CPU time of the coupler per exchange, ms; median
    pub ms: f64,
    /// exchanges replayed
    pub exchanges: usize,
    /// exchanges of them redone with the positive smoother
    pub redone: u64,
    /// keeps volume and the third law to rounding
    pub conservative: bool,
    /// no other with the same interpolation is as cheap and as exact in both ways
    pub front: bool,
    /// those of the case
    pub recorded: bool,
    #[serde(skip)]
    seconds: Vec<f64>,
}

/// The part of the accuracy that is used: the exchanges to come are not those measured.
pub const MARGIN: f64 = 0.8;
/// A mapping may be this much worse than that of the case, in the model error.
const NO_WORSE: f64 = 1.02;
/// What takes longer than this many exchanges of the case is not measured to the end.
const SLOW: f64 = 10.0;
/// A mapping that takes longer than this many exchanges of the case is not replayed.
const HOPELESS: f64 = 100.0;
/// Rounds in which the candidates near the front are timed again.
const ROUNDS: usize = 3;
/// Largest mesh on which the factorising smoother is tried: memory and time grow faster than the mesh.
const FACTORISED: usize = 50_000;

/// Measures all candidates on the last exchanges of a recording; `say` is told what is under way.
pub fn tune<R: Read + Seek + 'static>(
    open: Open<R>,
    ask: &Ask,
    say: &mut dyn FnMut(&str),
) -> Result<Table, ReplayError> {
    let config = case(&open()?, ask.base)?;
    let scene = Scene::last(Moments::new(open()?)?)?;
    say("the exact Gaussians of the particles");
    let mut search = Search {
        bench: Bench::new(open, ask.base, ask.exchanges)?,
        exact: scene.gaussian(&config),
        case: Settings::of(&config),
        config,
        scene,
        points: Vec::new(),
        skipped: Vec::new(),
        say,
    };
    search.run(ask)?;
    let estimates = {
        (search.say)("estimates: schemes, coupling interval");
        estimate::estimate(&mut search.bench, &search.case)?
    };
    Table::new(ask, search, estimates)
}

/// A search under way.
pub(crate) struct Search<'a, R: Read + Seek> {
    pub(crate) bench: Bench<'a, R>,
    pub(crate) config: Config,
    pub(crate) scene: Scene,
    pub(crate) case: Settings,
    pub(crate) exact: Result<(Vec<f64>, &'static str), String>,
    pub(crate) points: Vec<Point>,
    pub(crate) skipped: Vec<(String, String)>,
    say: &'a mut dyn FnMut(&str),
}

/// Replies of the exact operator with one mapping and interpolation.
struct Reference {
    effects: Vec<Effect>,
    model: Option<Error>,
}

impl<R: Read + Seek + 'static> Search<'_, R> {
    fn run(&mut self, ask: &Ask) -> Result<(), ReplayError> {
        let all = |part| ask.only.is_empty() || ask.only.contains(&part);
        let case = self.case.clone();
        let mut kept = Vec::new();
        for s in settings::mappings(&case, self.scene.diameter()) {
            if s == case || all(Part::Mapping) && self.affordable(&s) {
                kept.extend(self.first(&s)?.map(|r| (s, r)));
            }
        }
        self.drop_dominated(&mut kept);
        if all(Part::Interpolation) {
            for s in settings::interpolations(&case) {
                kept.extend(self.first(&s)?.map(|r| (s, r)));
            }
        }
        if all(Part::Smoother) {
            for (s, reference) in &kept {
                self.smoothers(s, reference, ask.accuracy)?;
            }
        }
        self.again()?;
        self.mark();
        Ok(())
    }

    /// Is the mapping worth a replay?
    fn affordable(&mut self, s: &Settings) -> bool {
        let mut config = self.config.clone();
        (config.file.map.method, config.file.map.grid) = (s.mapping.clone(), s.grid);
        let Ok(mapping) = setup::mapping(&config, &self.scene.mesh) else { return false };
        let (expected, case) = (self.scene.weights_seconds(&*mapping), self.points[0].ms * 1e-3);
        let fits = expected < HOPELESS * case;
        if !fits {
            let why = format!("its weights alone would take about {:.0} ms per exchange", 1e3 * expected);
            self.skipped.push((s.mapping.clone(), why));
        }
        fits
    }

    /// Mapping and interpolation with the smoother of the case; the reference they are measured against. None: the
    /// run would stop with them.
    fn first(&mut self, s: &Settings) -> Result<Option<Reference>, ReplayError> {
        let exact = s.exact(self.config.file.smooth.bandwidth);
        (self.say)(&exact.name());
        let (effects, replayed) = match self.bench.effects(&exact) {
            Ok(e) => e,
            Err(e) if *s != self.case => return self.skip(&exact, e),
            Err(e) => return Err(e),
        };
        let model = self.model(effects.last());
        let reference = Reference { effects, model };
        let same = exact.smoother == s.smoother && !settings::takes_tolerance(&s.smoother);
        if same {
            let (last, numerical) = (reference.effects.last().cloned(), Errors::default());
            self.add(s, numerical, last.as_ref(), model, replayed);
            return Ok(Some(reference));
        }
        let done = self.measure(s, &reference, f64::INFINITY)?;
        Ok(done.map(|_| reference))
    }

    fn skip<T>(&mut self, s: &Settings, e: ReplayError) -> Result<Option<T>, ReplayError> {
        match e {
            // the step itself stops with these settings, or they cannot be together
            ReplayError::Run(why) => self.skipped.push((s.name(), why)),
            ReplayError::Settings(p) => {
                self.skipped.push((s.name(), p.first().map_or_else(String::new, ToString::to_string)));
            }
            e => return Err(e),
        }
        Ok(None)
    }

    fn model(&self, replayed: Option<&Effect>) -> Option<Error> {
        let (exact, _) = self.exact.as_ref().ok()?;
        replayed.filter(|e| e.k == self.scene.k).map(|e| self.scene.error(exact, e))
    }

    /// Measures one candidate; its numerical error.
    fn measure(&mut self, s: &Settings, r: &Reference, bound: f64) -> Result<Option<f64>, ReplayError> {
        (self.say)(&s.name());
        match self.bench.errors(s, &r.effects, bound) {
            Ok((numerical, last, replayed)) => {
                self.add(s, numerical, Some(&last), r.model, replayed);
                Ok(Some(numerical.l2()))
            }
            Err(e) if *s != self.case => self.skip(s, e),
            Err(e) => Err(e),
        }
    }

    fn add(
        &mut self,
        s: &Settings,
        numerical: Errors,
        last: Option<&Effect>,
        of: Option<Error>,
        r: Replayed,
    ) {
        self.points.push(Point {
            settings: s.clone(),
            numerical,
            error: numerical.l2(),
            model: self.model(last),
            model_of_mapping: of,
            ms: 1e3 * r.median(),
            exchanges: r.cpu.len(),
            redone: r.redone,
            conservative: settings::conservative(s),
            front: false,
            recorded: *s == self.case,
            seconds: r.cpu.into_iter().skip(1).collect(),
        });
    }

    /// Keeps the mapping of the case and those that are cheaper or nearer to the Gaussians than every other.
    fn drop_dominated(&self, kept: &mut Vec<(Settings, Reference)>) {
        let of = |s: &Settings| self.points.iter().find(|p| p.settings == *s);
        let worth = |s: &Settings| {
            let Some(p) = of(s) else { return false };
            let model = |p: &Point| p.model_of_mapping.map_or(f64::INFINITY, |m| m.l2);
            *s == self.case
                || !self
                    .points
                    .iter()
                    .any(|q| q.settings != *s && 1.1 * q.ms < p.ms && model(q) <= NO_WORSE * model(p))
        };
        let list: Vec<bool> = kept.iter().map(|k| worth(&k.0)).collect();
        let mut list = list.into_iter();
        kept.retain(|_| list.next().unwrap_or(false));
    }

    /// All smoothers and tolerances with one mapping and interpolation.
    fn smoothers(&mut self, of: &Settings, r: &Reference, accuracy: f64) -> Result<(), ReplayError> {
        let bandwidth = self.config.file.smooth.bandwidth;
        let case = self.points.iter().find(|p| p.settings == *of).map_or(f64::INFINITY, |p| 1e-3 * p.ms);
        for series in settings::smoothers(of, bandwidth) {
            for s in series {
                if s.smoother == "direct" && self.scene.mesh.len() > FACTORISED {
                    let why = format!("only tried on meshes of at most {FACTORISED} cells");
                    self.skipped.push((s.name(), why));
                    continue;
                }
                let known = self.points.iter().find(|p| p.settings == s).map(|p| p.error);
                let error = match known {
                    Some(e) => Some(e),
                    None => self.measure(&s, r, SLOW * case)?,
                };
                // beyond this it only gets dearer
                if error.is_some_and(|e| e <= 0.1 * accuracy) {
                    break;
                }
            }
        }
        Ok(())
    }

    /// Times the candidates near the front again, in rounds, so that what the machine does meanwhile falls on all alike.
    fn again(&mut self) -> Result<(), ReplayError> {
        let near = |p: &Point| {
            p.recorded
                || !self.points.iter().any(|q| {
                    let alike = q.settings.mapping == p.settings.mapping
                        && q.settings.interpolation == p.settings.interpolation;
                    alike && q.error <= p.error && q.ms < 0.7 * p.ms
                })
        };
        let list: Vec<usize> = (0..self.points.len()).filter(|i| near(&self.points[*i])).collect();
        for round in 2..=ROUNDS {
            for i in &list {
                let s = self.points[*i].settings.clone();
                (self.say)(&format!("round {round} of {ROUNDS}: {}", s.name()));
                let most = self.points[*i].exchanges;
                let r = self.bench.replay(&s, &mut |_, cpu| Ok(cpu.len() < most))?;
                let p = &mut self.points[*i];
                p.seconds.extend(r.cpu.into_iter().skip(1));
            }
        }
        for p in self.points.iter_mut().filter(|p| !p.seconds.is_empty()) {
            p.ms = 1e3 * crate::bench::smoother::median(p.seconds.clone());
        }
        Ok(())
    }

    fn mark(&mut self) {
        let model = |p: &Point| p.model_of_mapping.map_or(0.0, |m| m.l2);
        let beats = |q: &Point, p: &Point| {
            let better = q.ms < p.ms || q.error < p.error || model(q) < model(p);
            q.settings.interpolation == p.settings.interpolation
                && q.ms <= p.ms
                && q.error <= p.error
                && model(q) <= model(p)
                && better
        };
        let front: Vec<bool> = self.points.iter().map(|p| !self.points.iter().any(|q| beats(q, p))).collect();
        self.points.iter_mut().zip(front).for_each(|(p, f)| p.front = f);
        self.points.sort_by(|a, b| a.ms.total_cmp(&b.ms));
    }
}

/// The cheapest settings whose numerical error is within the accuracy (with `MARGIN`), among those that are no worse
/// otherwise than the case: its interpolation, a mapping no farther from the Gaussians, the third law if it has it.
pub fn choose(points: &[Point], accuracy: f64) -> Option<&Point> {
    let case = points.iter().find(|p| p.recorded)?;
    let as_good = |p: &&Point| {
        let mapping = match (p.model_of_mapping, case.model_of_mapping) {
            (Some(p), Some(c)) => p.l2 <= NO_WORSE * c.l2,
            _ => p.settings.mapping == case.settings.mapping,
        };
        mapping
            && p.settings.interpolation == case.settings.interpolation
            && (p.conservative || !case.conservative)
            && p.error <= MARGIN * accuracy
    };
    points.iter().filter(as_good).min_by(|a, b| a.ms.total_cmp(&b.ms))
}
