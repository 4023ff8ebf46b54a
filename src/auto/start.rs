// SPDX-License-Identifier: MIT OR Apache-2.0
//! The choice before a run: from estimates of `inspect::expected` to keys of the case, which is what the coupler gets
//! and records (logs/case.resolved.toml).
//!
//! What a fluid or particle program is told once must be right from the start: the model and the feedback are given up
//! only where their estimates lie `MARGIN` below the accuracy. A force that may be needed later is kept ready: its
//! arrays are exchanged, and it can be switched on.

use super::{FEEDBACK, HISTORY, LIFT, MODEL, SMOOTHING, SWITCHES, Switch, on, set, setting};
use crate::config::{Auto, Config, Feedback, Flow, InInterval, Model, Problem, resolution};
use crate::inspect::{Scene, decide, expected};
use crate::smooth;
use std::fmt;

/// What is estimated may be so much larger.
const MARGIN: f64 = 10.0;

/// A term and what is made of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// name of the term
    pub term: &'static str,
    /// magnitude; NaN: not known
    pub relative: f64,
    /// what it is relative to
    pub to: &'static str,
    /// on, off, ready (off, may be switched on), missing, given (by the user)
    pub choice: &'static str,
    /// key and value
    pub setting: String,
    /// reason
    pub why: String,
}

/// What is chosen before a run.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// asked
    pub accuracy: f64,
    /// exchanges between measurements
    pub every: u32,
    /// one per term
    pub rows: Vec<Row>,
}

impl fmt::Display for Plan {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let again = match self.every {
            0 => "never again".to_string(),
            n => format!("measured in exchange 1 and every {n} exchanges"),
        };
        writeln!(f, "auto: accuracy {:.0e}, estimated from the files of the case, {again}:", self.accuracy)?;
        let head = ["term", "magnitude", "relative to", "choice"];
        writeln!(f, "  {:28} {:>9}  {:16} {:8} setting", head[0], head[1], head[2], head[3])?;
        for r in &self.rows {
            let size = if r.relative.is_nan() { "not known".into() } else { format!("{:.2e}", r.relative) };
            let why = if r.why.is_empty() { String::new() } else { format!(" ({})", r.why) };
            writeln!(f, "  {:28} {size:>9}  {:16} {:8} {}{why}", r.term, r.to, r.choice, r.setting)?;
        }
        Ok(())
    }
}

/// Chooses, and writes the choice into the case; `None` without section `auto`.
pub fn resolve(c: &mut Config) -> Result<Option<Plan>, Vec<Problem>> {
    let Some(mut auto) = c.file.auto.clone() else { return Ok(None) };
    if c.given.contains("auto.live") {
        let accepted = "voidage run writes it into the resolved case; what may change follows from the scene";
        let given = format!("{:?}", auto.live);
        return Err(vec![Problem::error("auto.live", given, accepted, "leave it out; see auto.keep")]);
    }
    let scene = expected::scene(c).map_err(|e| {
        let fix = "give these numbers in the script, or remove [auto] and set the forces yourself";
        vec![Problem::error("auto.accuracy", auto.accuracy, &format!("nothing can be estimated: {e}"), fix)]
    })?;
    // what the user has set is kept, and stands so in the resolved case
    for key in super::KEYS {
        let also: &[&str] =
            if key == MODEL { &["forces.pressure_gradient", "forces.viscous_stress"] } else { &[] };
        if also.iter().chain([&key]).any(|k| c.given.contains(*k)) && !auto.keep.iter().any(|k| k == key) {
            auto.keep.push(key.into());
        }
    }
    let mut choice = Choosing { c, scene: &scene, auto: &auto, rows: Vec::new(), live: Vec::new() };
    choice.smoothing();
    choice.model();
    choice.feedback();
    SWITCHES.iter().for_each(|s| choice.force(s));
    choice.free();
    let (rows, live) = (choice.rows, choice.live);
    let plan = Plan { accuracy: auto.accuracy, every: auto.every, rows };
    auto.live = live;
    c.file.auto = Some(auto);
    Ok(Some(plan))
}

struct Choosing<'a> {
    c: &'a mut Config,
    scene: &'a Scene,
    auto: &'a Auto,
    rows: Vec<Row>,
    live: Vec<String>,
}

impl Choosing<'_> {
    fn kept(&self, key: &str) -> bool {
        self.auto.keep.iter().any(|k| k == key)
    }
    /// Magnitude and reference of a term; NaN if it is not known.
    fn magnitude(&self, term: &str) -> (f64, &'static str) {
        let found = self.scene.terms.iter().find(|t| t.name == term);
        found.map_or((f64::NAN, ""), |t| (t.relative, t.to))
    }
    /// So small that it can be given up for the whole run.
    fn negligible(&self, relative: f64) -> bool {
        MARGIN * relative <= self.auto.accuracy
    }
    fn row(&mut self, term: &'static str, choice: &'static str, setting: String, why: &str) {
        let (relative, to) = self.magnitude(term);
        self.rows.push(Row { term, relative, to, choice, setting, why: why.into() });
    }

    fn smoothing(&mut self) {
        let (s, h) = (&self.c.file.smooth, self.scene.cell_size);
        let wanted = !s.by_diameter.is_empty() || self.c.file.coupling.void_velocity == "pinned";
        if self.kept(SMOOTHING) || wanted {
            let setting = format!("{SMOOTHING} = \"{}\"", s.method);
            return self.row("smoothing", "given", setting, "");
        }
        // four diameters where no bandwidth is given
        let b = if s.bandwidth > 0.0 { s.bandwidth } else { 4.0 * self.scene.diameter.mean };
        let relative = if h.is_empty() { f64::NAN } else { decide::smoothed_share(b, h.mean) };
        let kernel = self.c.file.map.method == "kernel";
        let off = kernel || relative <= self.auto.accuracy;
        let s = &mut self.c.file.smooth;
        s.method = if off { "none" } else { smooth::DEFAULT }.into();
        let mut setting = format!("{SMOOTHING} = \"{}\"", s.method);
        if !off && s.bandwidth == 0.0 {
            s.bandwidth = b;
            setting += &format!(", smooth.bandwidth = {b:.2e}");
        }
        let why = if kernel { "map.method = \"kernel\" smooths" } else { "" }.into();
        let choice = if off { "off" } else { "on" };
        self.rows.push(Row { term: "smoothing", relative, to: "solids of a cell", choice, setting, why });
    }

    /// Model A gives the particles their share of ∇p and ∇·τ, model B hides both in the drag, divided by the voidage: where
    /// both and the solid fraction are negligible, B is the same with two fields less.
    fn model(&mut self) {
        let terms = ["pressure gradient", "viscous stress"];
        let stock = self.c.file.fluid.stock();
        let small = terms.iter().all(|t| self.negligible(self.magnitude(t).0))
            && self.scene.solid_fraction.is_some_and(|p| self.negligible(p));
        let (kept, f) = (self.kept(MODEL), &mut self.c.file);
        let (choice, why) = match (kept, stock, small) {
            (true, ..) => ("given", ""),
            (_, true, _) => ("missing", "a stock solver has no model A"),
            (_, _, true) => ("off", "and the solid fraction is as small"),
            _ => ("on", ""),
        };
        if !kept {
            let b = stock || small;
            f.coupling.model = if b { Model::B } else { Model::A };
            (f.forces.pressure_gradient, f.forces.viscous_stress) = (!b, !b);
        }
        let setting = format!("{MODEL} = \"{:?}\"", f.coupling.model);
        for term in terms {
            self.row(term, choice, setting.clone(), why);
        }
    }

    fn feedback(&mut self) {
        let terms = ["feedback on the fluid", "voidage rate in continuity"];
        let f = &self.c.file;
        let kept = self.kept(FEEDBACK) || f.fluid.flow == Flow::Frozen;
        let small = terms.iter().all(|t| self.negligible(self.magnitude(t).0));
        if !kept {
            let feedback = if small { Feedback::OneWay } else { Feedback::TwoWay };
            self.c.file.coupling.feedback = feedback;
        }
        let two_way = self.c.file.coupling.feedback == Feedback::TwoWay;
        let choice = match (kept, two_way) {
            (true, _) => "given",
            (_, true) => "on",
            _ => "off",
        };
        let setting = format!("{FEEDBACK} = \"{}\"", if two_way { "two-way" } else { "one-way" });
        for term in terms {
            self.row(term, choice, setting.clone(), "");
        }
    }

    fn force(&mut self, s: &Switch) {
        let (relative, _) = self.magnitude(s.term);
        let f = &self.c.file.forces;
        if self.kept(s.key) {
            let value = match s.key {
                LIFT => format!("\"{}\"", f.lift),
                HISTORY => f.history.to_string(),
                _ if f.added_mass.law() => "\"felderhof\"".into(),
                _ => f.added_mass.coefficient().to_string(),
            };
            return self.row(s.term, "given", format!("{} = {value}", s.key), "");
        }
        let wanted = decide::hysteresis(on(f, s.key), relative, self.auto.accuracy);
        if let Some(why) = barred(self.c, s.key, self.scene) {
            set(&mut self.c.file.forces, s.key, false);
            let choice = if wanted { "missing" } else { "off" };
            return self.row(s.term, choice, setting(s.key, false), if wanted { &why } else { "" });
        }
        set(&mut self.c.file.forces, s.key, wanted);
        // an estimate that is not known may turn out large
        let far = relative * s.reach <= self.auto.accuracy;
        let reach = !far && self.auto.every > 0;
        if reach {
            self.live.push(s.key.into());
        }
        let choice = match (wanted, reach) {
            (true, _) => "on",
            (false, true) => "ready",
            (false, false) => "off",
        };
        self.row(s.term, choice, setting(s.key, wanted), "");
    }

    /// What costs nothing is not chosen.
    fn free(&mut self) {
        let name = match self.c.file.fluid.gravity_treatment {
            crate::config::GravityTreatment::Archimedes => "archimedes",
            crate::config::GravityTreatment::InPressure => "in-pressure",
            crate::config::GravityTreatment::None => "none",
        };
        let setting = format!("fluid.gravity_treatment = \"{name}\"");
        self.row("Archimedes", "given", setting, "costs nothing, never chosen");
    }
}

/// Why a force cannot be had in this case.
pub(super) fn barred(c: &Config, key: &str, scene: &Scene) -> Option<String> {
    match key {
        super::ADDED_MASS if c.file.dem.force == InInterval::Constant => {
            Some("it would need dem.force = \"implicit\"".into())
        }
        HISTORY => {
            let worst = resolution::history_answer(c, scene.diameter.mean, scene.density.mean);
            (worst > resolution::STABLE).then(|| {
                let step = resolution::history_step(c, worst);
                format!("the explicit force would need a fluid step of at most {step:.1e} s")
            })
        }
        _ => None,
    }
}
