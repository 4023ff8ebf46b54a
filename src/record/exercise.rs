// SPDX-License-Identifier: MIT OR Apache-2.0
//! Reads a recording in every way there is: for tests of damaged files and for the fuzz program. Must end in a result
//! for any bytes, without panic, and without more memory than they justify.

use super::moment::Moments;
use super::replay::{Options, Outcome, ReplayError, case, replay};
use super::{Reader, RecordError};
use crate::inspect::{decide, recorded};
use std::io::Cursor;

/// Inspects, decodes and replays; what the replay came to.
pub fn exercise(bytes: &[u8]) -> Result<Outcome, ReplayError> {
    let open = || Reader::new(Cursor::new(bytes.to_vec()), "recording");
    let reader = open()?;
    let config = case(&reader, &[])?;
    let mut m = Moments::new(reader)?;
    for n in 0..m.exchanges.len() {
        let Some(x) = m.at(n)? else { continue };
        let p = x.particles()?;
        x.fluid(&m.mesh)?;
        x.sources(&m.mesh)?;
        x.drive(&p)?;
    }
    let scene = match recorded::scene(&mut m, &config) {
        Err(RecordError::NoExchange) => return Err(RecordError::NoExchange.into()),
        other => other?,
    };
    let _ = (scene.to_string(), decide::advice(&scene, 1e-2));
    let mut m = Moments::new(open()?)?;
    while m.next()?.is_some() {}
    replay(open()?, Options { overrides: &[], reference: None, save: None }, &mut |_| {})
}
