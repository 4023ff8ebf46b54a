// SPDX-License-Identifier: MIT OR Apache-2.0
//! `[auto]`: the models chosen for a stated accuracy (design §2.4, docs/auto.md). A term is on where its magnitude, relative
//! to weight or drag, exceeds the accuracy asked.
//!
//! `start` chooses before a run, from estimates of `inspect::expected`; `watch` measures again during the run, by
//! `inspect::measure`, and switches what can be switched. Here: which keys there are. Does not know exchanges.

pub mod start;
pub mod watch;

pub use start::{Plan, resolve};
pub use watch::{Change, Watch};

use crate::config::{AddedMass, CaseFile, Forces};

/// Split of the pressure-gradient force; before the run only, the fluid solver is told once.
pub const MODEL: &str = "coupling.model";
/// Does the fluid feel the particles? Before the run only.
pub const FEEDBACK: &str = "coupling.feedback";
/// Is anything smoothed? Before the run only: bandwidth and cells stay as they are.
pub const SMOOTHING: &str = "smooth.method";
/// Lift law.
pub const LIFT: &str = "forces.lift";
/// Added mass.
pub const ADDED_MASS: &str = "forces.added_mass";
/// History force.
pub const HISTORY: &str = "forces.history";

/// All keys that are chosen; what the user has set, or named in `auto.keep`, stays.
pub const KEYS: [&str; 6] = [MODEL, FEEDBACK, SMOOTHING, LIFT, ADDED_MASS, HISTORY];

/// A force that can be switched during a run.
#[derive(Debug)]
pub struct Switch {
    /// its key
    pub key: &'static str,
    /// name of its term in `inspect`
    pub term: &'static str,
    /// kept ready from the start if its estimate is within this factor below the accuracy: later it cannot be had
    pub reach: f64,
}

/// Their order is that of the bits in recordings and restart sets.
pub const SWITCHES: [Switch; 3] = [
    // needs nothing of the partners: always ready
    Switch { key: LIFT, term: "lift", reach: f64::INFINITY },
    // one number per particle; collisions accelerate more than drag and weight, which the estimate knows
    Switch { key: ADDED_MASS, term: "added mass", reach: 100.0 },
    // 34 numbers per particle, both ways
    Switch { key: HISTORY, term: "history (Basset)", reach: 10.0 },
];

/// May the key change during the run?
pub fn live(f: &CaseFile, key: &str) -> bool {
    f.auto.as_ref().is_some_and(|a| a.live.iter().any(|k| k == key))
}

/// Is the force of this key on?
pub fn on(f: &Forces, key: &str) -> bool {
    match key {
        LIFT => f.lift != "none",
        ADDED_MASS => f.added_mass.on(),
        _ => f.history,
    }
}

/// Switches the force of this key.
pub fn set(f: &mut Forces, key: &str, on: bool) {
    match key {
        LIFT => f.lift = if on { "loth" } else { "none" }.into(),
        ADDED_MASS => f.added_mass = AddedMass::Coefficient(if on { 0.5 } else { 0.0 }),
        _ => f.history = on,
    }
}

/// Puts in force what `bits` say (in the order of `SWITCHES`), for what may change.
pub fn put(f: &mut CaseFile, bits: u32) {
    for (n, s) in SWITCHES.iter().enumerate() {
        if live(f, s.key) {
            set(&mut f.forces, s.key, bits >> n & 1 == 1);
        }
    }
}

/// What to type for it.
pub fn setting(key: &str, on: bool) -> String {
    let value = match (key, on) {
        (LIFT, true) => "\"loth\"",
        (LIFT, false) => "\"none\"",
        (ADDED_MASS, true) => "0.5",
        (ADDED_MASS, false) => "0",
        (_, true) => "true",
        (_, false) => "false",
    };
    format!("{key} = {value}")
}
