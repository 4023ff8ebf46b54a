// SPDX-License-Identifier: MIT OR Apache-2.0
//! What a recording can only estimate: the defect of one step of other schemes and of longer coupling intervals. The
//! particles and the fluid that follow are those recorded, so nothing here says where a run with them would go.
//!
//! Scheme: impulse charged to the fluid against the impulse the particles took in the interval that follows, L2 over the
//! particles; taken = ledger of the next exchange + charged (both recorded). Interval: how far voidage, force and source
//! move while they are held, between exchange k and k + m. Needs exchanges that follow each other.

use super::measure::Bench;
use super::settings::Settings;
use crate::balance::ratio;
use crate::record::effect::{Effect, Errors, Gap};
use crate::record::moment::Messages;
use crate::record::replay::{ReplayError, each};
use crate::scheme;
use crate::sums::sum;
use serde::Serialize;
use std::collections::BTreeMap;
use std::io::{Read, Seek};

/// A scheme.
#[derive(Clone, Debug, Serialize)]
pub struct OfScheme {
    /// coupling.scheme
    pub scheme: &'static str,
    /// |charged − taken| / |taken|; none: it needs what was not recorded
    pub defect: Option<f64>,
}

/// A coupling interval.
#[derive(Clone, Debug, Serialize)]
pub struct OfInterval {
    /// times the recorded one
    pub multiple: usize,
    /// change of what is held meanwhile
    pub defect: Errors,
}

/// One-step defects.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Estimates {
    /// every scheme; empty without exchanges that follow each other
    pub schemes: Vec<OfScheme>,
    /// multiples of the recorded interval, as far as the recording goes
    pub intervals: Vec<OfInterval>,
}

/// Multiples of the interval.
const MULTIPLES: [usize; 3] = [1, 2, 4];

/// Vectors of particles by id.
type ById = BTreeMap<i64, [f64; 3]>;

/// Charged impulse of the replies, N s.
fn charged(m: &Messages) -> Result<ById, ReplayError> {
    let p = m.particles()?;
    let d = m.drive(&p)?;
    Ok(p.id.iter().copied().zip(d.charged).collect())
}

/// Estimates on the exchanges of `bench`, around the settings of the case.
pub fn estimate<R: Read + Seek + 'static>(
    bench: &mut Bench<R>,
    case: &Settings,
) -> Result<Estimates, ReplayError> {
    // (k, impulse taken after it by id)
    let mut taken: Vec<(i64, ById)> = Vec::new();
    let mut before: Option<(i64, ById)> = None;
    let most = bench.exchanges;
    let overrides = case.overrides(bench.base);
    let mut n = 0;
    each((bench.open)()?, &overrides, None, bench.start.as_ref(), &mut |x| {
        let p = x.recorded.particles()?;
        if let Some((k, given)) = before.take()
            && k + 1 == x.k
        {
            let of =
                |(id, l): (&i64, &[f64; 3])| given.get(id).map(|c| (*id, [0, 1, 2].map(|a| l[a] + c[a])));
            taken.push((k, p.id.iter().zip(&p.ledger).filter_map(of).collect()));
        }
        before = Some((x.k, charged(x.recorded)?));
        n += 1;
        Ok(n < most)
    })?;
    let mut out = Estimates::default();
    if taken.is_empty() {
        return Ok(out);
    }
    for s in scheme::all() {
        let mut overrides = overrides.clone();
        overrides.push(("coupling.scheme".into(), s.name().into()));
        let (mut gap, mut size, mut n) = (0.0, 0.0, 0);
        let done = each((bench.open)()?, &overrides, None, bench.start.as_ref(), &mut |x| {
            if let Some((_, due)) = taken.iter().find(|t| t.0 == x.k) {
                let got = charged(x.anew)?;
                let both = || got.iter().filter_map(|(id, c)| due.get(id).map(|t| (c, t)));
                let square = |v: [f64; 3]| v.iter().map(|x| x * x).sum::<f64>();
                gap += sum(both().map(|(c, t)| square([0, 1, 2].map(|a| c[a] - t[a]))));
                size += sum(both().map(|(_, t)| square(*t)));
            }
            n += 1;
            Ok(n < most)
        });
        let defect = match done {
            Ok(_) => Some(ratio(gap, size).sqrt()),
            // the history it wants was not sent
            Err(ReplayError::Run(_) | ReplayError::Settings(_)) => None,
            Err(e) => return Err(e),
        };
        out.schemes.push(OfScheme { scheme: s.name(), defect });
    }
    let (effects, _) = bench.effects(case)?;
    for multiple in MULTIPLES {
        let (mut gap, mut pairs) = (Gap::default(), 0);
        for (i, due) in effects.iter().enumerate().skip(multiple) {
            // particles that came or went in between: not the same arrays
            let held = Effect { k: due.k, ..effects[i - multiple].clone() };
            let follows = effects[i - multiple].k + multiple as i64 == due.k;
            if follows && gap.add(&held, due).is_ok() {
                pairs += 1;
            }
        }
        if pairs > 0 {
            out.intervals.push(OfInterval { multiple, defect: gap.errors() });
        }
    }
    Ok(out)
}
