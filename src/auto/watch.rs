// SPDX-License-Identifier: MIT OR Apache-2.0
//! The choice during a run: magnitudes measured on the exchange at hand, forces switched from the next one on.
//!
//! Reads particles, fluid, sources and drive of an exchange (SI units); writes which forces are on. On above the
//! accuracy, off below a third of it. Depends on the exchange and the one before alone, in an order that does not know
//! ranks and threads, so any split of a run decides alike. A replay follows what was recorded. Logs nothing itself.

use super::start::barred;
use super::{FEEDBACK, MODEL, SWITCHES, Switch, live, on, set, setting};
use crate::config::{AddedMass, CaseFile, Config, Feedback, Model};
use crate::forces::{self, Extra, lift};
use crate::inspect::decide::hysteresis;
use crate::inspect::measure::{Before, Sums, View};
use crate::inspect::recorded::unmeasured;
use crate::inspect::{Scene, Term};
use crate::particles::Particles;
use std::fmt;

/// What a measurement leads to.
#[derive(Clone, Debug, PartialEq)]
pub struct Change {
    /// the term
    pub term: &'static str,
    /// its magnitude
    pub relative: f64,
    /// relative to
    pub to: &'static str,
    /// accuracy asked
    pub accuracy: f64,
    /// key and value from the next exchange on, or what would be needed
    pub setting: String,
    /// false: it cannot be switched during the run
    pub done: bool,
}

impl fmt::Display for Change {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let size = format!("{} is {:.2e} of {}", self.term, self.relative, self.to);
        let asked = format!("(accuracy {:.0e})", self.accuracy);
        if self.done {
            write!(f, "{} from the next exchange on: {size} {asked}", self.setting)
        } else {
            write!(f, "missing: {size} {asked}; {}", self.setting)
        }
    }
}

/// Watches the terms of a run.
pub struct Watch {
    /// settings in force
    config: Config,
    accuracy: f64,
    every: i64,
    /// the exchange before one that is measured
    before: Option<(i64, Before)>,
    /// terms of which it was said that they are missing
    told: Vec<&'static str>,
    follows: bool,
}

impl Watch {
    /// For a case as resolved; `None` if nothing is to be measured.
    pub fn new(c: &Config) -> Option<Self> {
        let auto = c.file.auto.as_ref().filter(|a| a.every > 0)?;
        let (accuracy, every) = (auto.accuracy, i64::from(auto.every));
        Some(Self { config: c.clone(), accuracy, every, before: None, told: Vec::new(), follows: false })
    }

    /// Measures nothing: the choices come from a recording.
    pub fn follow(&mut self) {
        self.follows = true;
    }

    /// The forces that are on, of those that may change: bits in the order of `SWITCHES`.
    pub fn in_force(&self) -> u32 {
        let f = &self.config.file;
        let one = |(n, s): (usize, &Switch)| u32::from(live(f, s.key) && on(&f.forces, s.key)) << n;
        SWITCHES.iter().enumerate().map(one).sum()
    }

    /// Puts `bits` in force, for what may change.
    pub fn put(&mut self, bits: u32) {
        super::put(&mut self.config.file, bits);
    }

    /// Makes a step compute what is in force.
    pub fn apply(&self, extra: &mut Extra) {
        let f = &self.config.file.forces;
        extra.lift = lift::by_name(&f.lift);
        extra.history = f.history;
        if let AddedMass::Coefficient(c) = f.added_mass {
            extra.added_mass = c;
        }
    }

    /// Is exchange k measured? The first with one before it, then every n-th.
    pub fn due(&self, k: i64) -> bool {
        !self.follows && k > 0 && (k == 1 || k % self.every == 0)
    }

    /// Exchange k is over: what the next one needs of it, to be measured. `fluid`: U by cell slot, m/s.
    pub fn keep(&mut self, k: i64, p: &Particles, fluid: &[[f64; 3]]) {
        self.before = self.due(k + 1).then(|| (k, Before::of(p, fluid)));
    }

    /// Measures exchange k, and switches from the next one on; `view` without the exchange before.
    pub fn reconsider(&mut self, k: i64, view: &View) -> Vec<Change> {
        let mut scene = self.measure(k, view);
        scene.terms.push(solids(&scene, &self.config.file));
        let mut list = Vec::new();
        for t in &scene.terms {
            let switch = SWITCHES.iter().find(|s| s.term == t.name);
            match switch.filter(|s| live(&self.config.file, s.key)) {
                Some(s) => {
                    let wanted = hysteresis(t.now, t.relative, self.accuracy);
                    if wanted != t.now {
                        set(&mut self.config.file.forces, s.key, wanted);
                        list.push(self.change(t, setting(s.key, wanted), true));
                    }
                }
                None => list.extend(self.missing(t, switch, &scene)),
            }
        }
        list
    }

    fn measure(&self, k: i64, view: &View) -> Scene {
        let (c, mut sums) = (&self.config, Sums::default());
        let mut scene = unmeasured(view.mesh, c);
        let before = self.before.as_ref().filter(|b| b.0 == k - 1).map(|b| &b.1);
        sums.add(&mut scene, &View { before, ..*view }, c, forces::by_name(&c.file.forces.drag));
        sums.terms(&mut scene, c);
        scene
    }

    fn change(&self, t: &Term, setting: String, done: bool) -> Change {
        let (term, relative, to, accuracy) = (t.name, t.relative, t.to, self.accuracy);
        Change { term, relative, to, accuracy, setting, done }
    }

    /// A term that is off, would be on, and was not left out by the user: said once.
    fn missing(&mut self, t: &Term, switch: Option<&Switch>, scene: &Scene) -> Option<Change> {
        let (key, setting) = needed(&self.config.file, t.name, switch)?;
        let kept = self.config.file.auto.as_ref().is_some_and(|a| a.keep.iter().any(|k| k == key));
        let large = t.relative > self.accuracy;
        if t.now || kept || !large || self.told.contains(&t.name) {
            return None;
        }
        self.told.push(t.name);
        // what the case cannot have is not advised
        let why = barred(&self.config, key, scene);
        Some(self.change(t, why.unwrap_or_else(|| format!("it would need {setting} from the start")), false))
    }
}

/// In model B no pressure gradient is sent that could be measured: the share of it that the solids carry is their fraction.
const SOLIDS: &str = "solid fraction at the particles";

fn solids(s: &Scene, f: &CaseFile) -> Term {
    let (relative, now) = (s.solid_fraction_seen.mean, f.coupling.model == Model::A);
    Term { name: SOLIDS, relative, to: "1", how: "mean", now, on: None, off: None }
}

/// Key and setting that would bring a term which cannot be switched during a run.
fn needed(f: &CaseFile, term: &str, switch: Option<&Switch>) -> Option<(&'static str, String)> {
    match term {
        "pressure gradient" | "viscous stress" | SOLIDS if f.coupling.model == Model::B => {
            Some((MODEL, format!("{MODEL} = \"A\"")))
        }
        "feedback on the fluid" | "voidage rate in continuity" if f.coupling.feedback == Feedback::OneWay => {
            Some((FEEDBACK, format!("{FEEDBACK} = \"two-way\"")))
        }
        _ => switch.map(|s| (s.key, setting(s.key, true))),
    }
}
