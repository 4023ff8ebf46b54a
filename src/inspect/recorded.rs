// SPDX-License-Identifier: MIT OR Apache-2.0
//! A scene measured on a recording: at most `SAMPLES` of its exchanges, spread over all.
//!
//! Reads particles, fluid, voidage and drive as recorded and gives them to `measure`, with the exchange before where that
//! is recorded too.

use super::Scene;
use super::measure::{Before, Sums, View};
use crate::auto;
use crate::config::Config;
use crate::forces;
use crate::locate::Locator;
use crate::mesh::{Mesh, NONE};
use crate::record::RecordError;
use crate::record::moment::{Messages, Moments};
use crate::sums::norm;
use std::io::{Read, Seek};

/// Exchanges looked at.
const SAMPLES: usize = 5;

/// A scene of which nothing but the settings is known.
pub fn unmeasured(mesh: &Mesh, c: &Config) -> Scene {
    let f = &c.file;
    let mut s = Scene {
        cells: Some(mesh.len()),
        bounds: Some(mesh.bounds),
        fluid_density: f.fluid.density,
        kinematic_viscosity: f.fluid.kinematic_viscosity,
        gravity: norm(f.fluid.gravity),
        bandwidth: f.smooth.bandwidth,
        smoothed: f.smooth.method != "none",
        period: c.period(),
        dem_step: f.dem.time_step,
        explicit: f.coupling.scheme == "explicit",
        ..Scene::default()
    };
    mesh.volume.iter().for_each(|v| s.cell_size.add(v.cbrt()));
    s
}

/// Measures the scene of a recording with the settings of `c`.
pub fn scene<R: Read + Seek>(m: &mut Moments<R>, c: &Config) -> Result<Scene, RecordError> {
    let law = forces::by_name(&c.file.forces.drag);
    let mut s = unmeasured(&m.mesh, c);
    let locator = Locator::new(&m.mesh);
    let mut in_force = None;
    let (mut x, mut samples) = (Sums::default(), 0);
    let n = m.exchanges.len();
    let mut chosen: Vec<usize> = (0..SAMPLES.min(n)).map(|i| (i + 1) * n / SAMPLES.min(n) - 1).collect();
    chosen.dedup();
    let mut list = Vec::new();
    for at in chosen {
        let k = m.exchanges[at].0;
        let earlier = match at.checked_sub(1).filter(|b| m.exchanges[*b].0 == k - 1) {
            None => None,
            Some(b) => match m.at(b)? {
                None => None,
                Some(e) => Some(Before::of(&e.particles()?, &e.fluid(&m.mesh)?.velocity)),
            },
        };
        let Some(now) = m.at(at)? else { continue };
        list.push(k);
        samples += 1;
        in_force = now.on;
        // what `auto` had on in this one
        let mut c = c.clone();
        if let Some(bits) = now.on {
            auto::put(&mut c.file, bits);
        }
        one(&mut s, &mut x, m, &now, earlier.as_ref(), &c, law, &locator)?;
    }
    if samples == 0 {
        return Err(RecordError::NoExchange);
    }
    s.from = format!("exchanges {list:?} of {n} recorded");
    s.solid_fraction = Some(x.solid_fraction(&m.mesh));
    s.fluid_relaxation = x.fluid_relaxation(c.file.fluid.density);
    // what `auto` had on in the last of them
    let mut c = c.clone();
    if let Some(bits) = in_force {
        auto::put(&mut c.file, bits);
    }
    x.terms(&mut s, &c);
    Ok(s)
}

#[allow(clippy::too_many_arguments)] // one turn of the loop above
fn one<R: Read + Seek>(
    s: &mut Scene,
    x: &mut Sums,
    m: &Moments<R>,
    now: &Messages,
    before: Option<&Before>,
    c: &Config,
    law: Option<&'static dyn forces::DragLaw>,
    locator: &Locator,
) -> Result<(), RecordError> {
    let mesh = &m.mesh;
    let mut p = now.particles()?;
    let (fluid, sources, drive) = (now.fluid(mesh)?, now.sources(mesh)?, now.drive(&p)?);
    let mut hosts = vec![NONE; p.len()];
    // those outside keep no host and are left out
    for lost in locator.locate(mesh, &mut p.position, &mut hosts).err().unwrap_or_default() {
        hosts[lost.index] = NONE;
    }
    let (particles, hosts) = (&p, &hosts[..]);
    let view = View { mesh, particles, hosts, fluid: &fluid, sources: &sources, drive: &drive, before };
    x.add(s, &view, c, law);
    Ok(())
}
