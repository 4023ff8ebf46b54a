// SPDX-License-Identifier: MIT OR Apache-2.0
//! Are steps and bandwidth fine enough? Time steps against the time scales of Radl et al. (2014) eqs. 9 to 11, and
//! the bias of the gathered fluid velocity as a number. Called by `check`; reads what case and script say.

use super::{Config, InInterval, Problem, foam, script};
use crate::forces::history::explicit_ratio;

/// Fluid and DEM step against the relaxation times τ_p = ρ_p d²/(18 η) and τ_f = τ_p ρ_f (1 − φ)/(ρ_p φ) (Stokes).
/// `count`: particles in the mesh, if known; else φ is that of a packed bed.
pub fn relaxation(c: &Config, radius: f64, density: f64, count: Option<f64>, p: &mut Vec<Problem>) {
    let rho = c.file.fluid.density;
    let tau_p = density * (2.0 * radius).powi(2) / (18.0 * rho * c.file.fluid.kinematic_viscosity);
    let box_ =
        foam::extent(&c.fluid_case()).map(|e| (0..3).map(|a| e.upper[a] - e.lower[a]).product::<f64>());
    let sphere = 4.0 / 3.0 * std::f64::consts::PI * radius.powi(3);
    let phi = count.zip(box_).map_or(0.6, |(n, v)| (n * sphere / v).clamp(1e-12, 0.6));
    let tau_f = tau_p * rho * (1.0 - phi) / (density * phi);
    let (x, y) = (c.period() / tau_p, c.period() / tau_f);
    let scales = format!(
        "tau_p = {tau_p:.2e} s (R eq. 9), tau_f = {tau_f:.2e} s at solid fraction {phi:.2} (R eq. 10)"
    );
    let explicit = c.file.coupling.scheme == "explicit";
    if explicit && x > 1.0 {
        let accepted = format!("the fluid step is {x:.2} tau_p: explicit coupling is unstable; {scales}");
        p.push(Problem::error(
            "coupling.scheme",
            "explicit",
            &accepted,
            "coupling.scheme = \"conservative\"",
        ));
    } else if explicit && y > 1.0 {
        let accepted = format!("the fluid step is {y:.2} tau_f: explicit coupling may be unstable; {scales}");
        p.push(Problem::warning(
            "coupling.scheme",
            "explicit",
            &accepted,
            "coupling.scheme = \"conservative\"",
        ));
    } else if x > 10.0 {
        let accepted = format!("the fluid reacts about {x:.0} steps late (step / tau_p); {scales}");
        let fix = format!("a fluid step of at most {:.1e} s where transients matter", 10.0 * tau_p);
        p.push(Problem::warning("coupling.interval", c.file.coupling.interval, &accepted, fix));
    }
    if c.file.dem.time_step > tau_p {
        let accepted = format!("longer than the particle relaxation time; {scales}");
        let fix = format!("dem.time_step = {:.1e}", 0.2 * tau_p);
        p.push(Problem::warning("dem.time_step", c.file.dem.time_step, &accepted, fix));
    }
    if c.file.dem.force == InInterval::Constant && x > 0.01 {
        let accepted = format!("the constant force errs by {:.1} % of the drag (limit 0.5 %)", 50.0 * x);
        p.push(Problem::error("dem.force", "constant", &accepted, "dem.force = \"implicit\""));
    }
}

/// Courant number (R eq. 11) of the fastest velocity of 0/U in a cell of mean size (m).
pub fn courant(c: &Config, size: Option<f64>, p: &mut Vec<Problem>) {
    let (Some(h), Some((u, _))) = (size, foam::start(&c.fluid_case())) else { return };
    let co = u * c.control.step / h;
    if co > 0.5 {
        let accepted = format!(
            "Courant number {co:.2} at the {u} m/s of 0/U in cells of {h:.2e} m (R eq. 11: below 0.5)"
        );
        let fix = format!("controlDict: deltaT {:.1e}; and coupling.interval with it", 0.5 * h / u);
        p.push(Problem::warning("deltaT", c.control.step, &accepted, fix));
    }
}

/// The gathered velocity errs by (b²/4) ∇²U; in the middle of a laminar profile between walls L apart by 2 (b/L)².
pub fn gather_bias(c: &Config, mesh: &foam::Extent, s: &script::Script, p: &mut Vec<Problem>) {
    let f = &c.file;
    let sticks = foam::start(&c.fluid_case()).is_some_and(|s| s.1);
    if f.smooth.method == "none" || f.interpolate.fluid_velocity != "gather" || !sticks {
        return;
    }
    let wall = |a: &usize| !s.boundary.as_ref().is_some_and(|b| b[*a].starts_with('p'));
    let gap = (0..3).filter(wall).map(|a| mesh.upper[a] - mesh.lower[a]).fold(f64::INFINITY, f64::min);
    let (b, bias) = (f.smooth.bandwidth, 2.0 * (f.smooth.bandwidth / gap).powi(2));
    if bias > 0.05 {
        let bias = (100.0 * bias).min(100.0);
        let accepted = format!(
            "the fluid velocity gathered with it errs by (b2/4) laplacian U: about -{bias:.0} % in the middle of a laminar \
             profile between walls {gap:.3e} m apart"
        );
        let fix =
            format!("interpolate.fluid_velocity = \"linear\", or smooth.bandwidth = {:.1e}", 0.15 * gap);
        p.push(Problem::warning("smooth.bandwidth", b, &accepted, fix));
    }
}

/// Largest answer of the explicit history force to a change of slip that is wanted; it is stable below 1.
pub const STABLE: f64 = 0.5;

/// The largest answer of the explicit history force to a change of slip, over all coarse-graining ratios; `diameter` (m) and
/// `density` (kg/m3) of the particles.
pub fn history_answer(c: &Config, diameter: f64, density: f64) -> f64 {
    let f = &c.file.fluid;
    let of =
        |ratio: f64| explicit_ratio(diameter / ratio, f.density, density, f.kinematic_viscosity, c.period());
    let grain = &c.file.dem.coarse_graining;
    let ratios = grain.by_type().into_iter().chain([grain.of_all()]);
    ratios.filter(|r| *r >= 1.0).map(of).fold(0.0, f64::max)
}

/// The fluid step (s) at which an `answer` becomes `STABLE`: the newest part goes with the square root of the step.
pub fn history_step(c: &Config, answer: f64) -> f64 {
    c.period() * (STABLE / answer).powi(2)
}

/// The explicit history force against the particle's inertia.
pub fn history(c: &Config, radius: f64, density: f64, p: &mut Vec<Problem>) {
    if !c.file.forces.history {
        return;
    }
    let worst = history_answer(c, 2.0 * radius, density);
    let step = history_step(c, worst);
    let accepted = format!(
        "the explicit history force answers a change of slip by {worst:.2} of it a fluid step later; it is stable below 1"
    );
    let fix = format!("a fluid step of at most {step:.1e} s, or forces.history = false");
    if worst >= 1.0 {
        p.push(Problem::error("forces.history", true, &accepted, fix));
    } else if worst > STABLE {
        p.push(Problem::warning("forces.history", true, &accepted, fix));
    }
}
