// SPDX-License-Identifier: MIT OR Apache-2.0
//! The order in which candidates are measured, and which are spared.
//!
//! First every mapping with the smoother of the case; those that are dearer than another and no nearer to the Gaussians
//! are dropped. Then every interpolation, and with each pair that is left every smoother, from loose tolerances to tight
//! ones until the error is a tenth of the accuracy. At last those near the front are timed again. Reads and writes the list of points.

use super::estimate::Estimates;
use super::measure::{Bench, Replayed};
use super::model::Scene;
use super::settings::{self, Part, Settings};
use super::{Ask, NO_WORSE, Point, TIE, estimate};
use crate::bench::smoother::median;
use crate::config::Config;
use crate::record::effect::{Effect, Error, Errors};
use crate::record::replay::{ReplayError, case};
use crate::setup;
use std::io::{Read, Seek};

/// What takes longer than this many exchanges of the case is not measured to the end.
const SLOW: f64 = 10.0;
/// A mapping that takes longer than this many exchanges of the case is not replayed.
const HOPELESS: f64 = 100.0;
/// Rounds in which the candidates near the front are timed again.
const ROUNDS: usize = 3;
/// Largest mesh on which the factorising smoother is tried: memory and time grow faster than the mesh.
const FACTORISED: usize = 50_000;

/// A search under way.
pub(crate) struct Search<'a, R: Read + Seek> {
    pub(crate) bench: Bench<'a, R>,
    pub(crate) config: Config,
    pub(crate) scene: Scene,
    pub(crate) case: Settings,
    pub(crate) exact: Result<(Vec<f64>, &'static str), String>,
    pub(crate) points: Vec<Point>,
    pub(crate) skipped: Vec<(String, String)>,
    pub(crate) say: &'a mut dyn FnMut(&str),
}

/// Replies of the exact operator with one mapping and interpolation.
struct Reference {
    effects: Vec<Effect>,
    model: Option<Error>,
}

impl<R: Read + Seek + 'static> Search<'_, R> {
    pub(crate) fn run(&mut self, ask: &Ask) -> Result<(), ReplayError> {
        let all = |part| ask.only.is_empty() || ask.only.contains(&part);
        let case = self.case.clone();
        let mut kept = Vec::new();
        for s in settings::mappings(&case, self.scene.diameter()) {
            if s == case || all(Part::Mapping) && self.affordable(&s)? {
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

    /// One-step defects around the settings of the case.
    pub(crate) fn estimates(&mut self) -> Result<Estimates, ReplayError> {
        (self.say)("estimates: schemes, coupling interval");
        estimate::estimate(&mut self.bench, &self.case)
    }

    /// Is the mapping worth a replay?
    fn affordable(&mut self, s: &Settings) -> Result<bool, ReplayError> {
        let config = match case(&(self.bench.open)()?, &s.overrides(self.bench.base)) {
            Ok(c) => c,
            Err(e) => return self.skip::<()>(s, e).map(|_| false),
        };
        let mapping = setup::mapping(&config, &self.scene.mesh).map_err(ReplayError::Run)?;
        let (expected, case) = (self.scene.weights_seconds(&*mapping), self.points[0].ms * 1e-3);
        let fits = expected < HOPELESS * case;
        if !fits {
            let why = format!("its weights alone would take about {:.0} ms per exchange", 1e3 * expected);
            self.skipped.push((s.mapping.clone(), why));
        }
        Ok(fits)
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
            p.ms = 1e3 * median(p.seconds.clone());
        }
        Ok(())
    }

    fn mark(&mut self) {
        let model = |p: &Point| p.model_of_mapping.map_or(0.0, |m| m.l2);
        let beats = |q: &Point, p: &Point| {
            let better = q.ms < p.ms || q.error < p.error || model(q) < model(p);
            q.settings.interpolation == p.settings.interpolation
                && q.ms <= TIE * p.ms
                && q.error <= p.error
                && model(q) <= model(p)
                && better
        };
        let front: Vec<bool> = self.points.iter().map(|p| !self.points.iter().any(|q| beats(q, p))).collect();
        self.points.iter_mut().zip(front).for_each(|(p, f)| p.front = f);
        self.points.sort_by(|a, b| a.ms.total_cmp(&b.ms));
    }
}
