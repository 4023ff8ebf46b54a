// SPDX-License-Identifier: MIT OR Apache-2.0
//! The bandwidth against the particles' wake (`smooth::wake`; Sun & Xiao 2015, §4.1): what `check` says of a case, and
//! the number behind `smooth.bandwidth = "wake"`. Reads what case and script say.

use super::{Config, Problem, foam, script};
use crate::smooth::wake;

/// What the scene says of its particles' wakes.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Wake {
    /// d, m
    diameter: f64,
    /// slip, m/s
    slip: f64,
    /// Re
    reynolds: f64,
    /// b whose support is the wake, in diameters
    bandwidth: f64,
}

/// Velocity (m/s) at which the weight of a sphere alone is carried by the drag of Schiller & Naumann.
fn terminal(c: &Config, diameter: f64, density: f64) -> f64 {
    let f = &c.file.fluid;
    let gravity = f.gravity.iter().map(|g| g * g).sum::<f64>().sqrt();
    let (nu, push) = (f.kinematic_viscosity, (density / f.density - 1.0).abs() * gravity);
    // π/6 d³ push = C_d π/8 d² u²
    let excess = |u: f64| {
        let re = u * diameter / nu;
        let cd_u = (24.0 * (1.0 + 0.15 * re.powf(0.687))).max(0.44 * re) * nu / diameter;
        0.75 * cd_u * u / diameter - push
    };
    let (mut low, mut high) = (0.0, push * diameter * diameter / (18.0 * nu));
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if excess(middle) < 0.0 { low = middle } else { high = middle }
    }
    high
}

/// None without a diameter, or if nothing moves the particles against the fluid.
fn wake_of(c: &Config, s: &script::Script) -> Option<Wake> {
    let diameter = 2.0 * s.radius?;
    let flow = foam::start(&c.fluid_case()).map_or(0.0, |f| f.0);
    let fall = s.density.map_or(0.0, |rho| terminal(c, diameter, rho));
    // carried by the flow, a particle slips no faster than it falls
    let slip = match (flow > 0.0, fall > 0.0) {
        (true, true) => flow.min(fall),
        _ => flow.max(fall),
    };
    let reynolds = slip * diameter / c.file.fluid.kinematic_viscosity;
    (slip > 0.0).then(|| Wake { diameter, slip, reynolds, bandwidth: wake::bandwidth(reynolds) })
}

/// b (m) for `smooth.bandwidth = "wake"`: the wake's, but no less than Sun & Xiao's least.
pub(super) fn from_wake(c: &Config) -> Result<f64, Problem> {
    let refuse = |accepted: &str| {
        let fix = "smooth.bandwidth = 4e-3 (a number, m)";
        Problem::error("smooth.bandwidth", "\"wake\"", accepted, fix)
    };
    let s = script::read(&c.script(), &c.file.dem.variables).map_err(|e| refuse(&e))?;
    if s.radius.is_none() {
        return Err(refuse("the script has no particle diameter that can be read, so the wake is unknown"));
    }
    let accepted = "0/U is at rest and the particles have no weight in the fluid: there is no wake";
    let w = wake_of(c, &s).ok_or_else(|| refuse(accepted))?;
    Ok(w.diameter * w.bandwidth.max(wake::USED.0))
}

/// A note with the numbers; a warning where the case is off by more than a factor of two.
pub(super) fn advice(c: &Config, s: &script::Script, p: &mut Vec<Problem>) {
    let b = c.file.smooth.bandwidth;
    if c.file.smooth.method == "none" || b <= 0.0 {
        return;
    }
    let Some(w) = wake_of(c, s) else { return };
    let (least, most) = (wake::USED.0.min(w.bandwidth), wake::USED.1.max(w.bandwidth));
    let (own, best) = (b / w.diameter, w.bandwidth.max(wake::USED.0));
    let accepted = format!(
        "{own:.2} particle diameters; a particle slips by about {:.2e} m/s (Re {:.2}), its wake ends at {:.1} diameters, and a \
         kernel of that support has b = {:.1} diameters; Sun & Xiao (2015, section 4.1) use {} to {}",
        w.slip,
        w.reynolds,
        3.0 * w.bandwidth,
        w.bandwidth,
        wake::USED.0,
        wake::USED.1
    );
    let fix = format!("smooth.bandwidth = {:.2e}, or \"wake\"", best * w.diameter);
    let far = own < 0.5 * least || own > 2.0 * most;
    p.push(if far {
        Problem::warning("smooth.bandwidth", b, &accepted, fix)
    } else {
        Problem::note("smooth.bandwidth", b, &accepted, fix)
    });
}
