// SPDX-License-Identifier: MIT OR Apache-2.0
//! A scene expected from the files of a case, before any run: one kind of sphere, evenly spread.
//!
//! Reads what `config::foam` and `config::script` find. The slip is the fastest velocity of 0/U, or the terminal velocity at
//! the mean solid fraction where that is larger. Magnitudes are bounds or estimates and say so.

use super::{Range, Scene, Term};
use crate::config::{Config, Continuity, Feedback, GravityTreatment, Model, foam, script};
use crate::forces;
use crate::sums::norm;
use std::f64::consts::PI;

/// Estimates the scene; the error says which file does not tell what is needed.
pub fn scene(c: &Config) -> Result<Scene, String> {
    let f = &c.file;
    let s = script::read(&c.script(), &f.dem.variables)?;
    let count = s.count.or(s.placed);
    let need = |what: &str| {
        format!(
            "{} does not tell the {what} of the particles (set … diameter … density with plain numbers): record an exchange \
             (--set record.first=2) and inspect the recording",
            f.dem.script.display()
        )
    };
    let of_data = s.data.as_ref().and_then(|f| script::spheres(f));
    let d = s.radius.map(|r| 2.0 * r).or(of_data.map(|d| d.0)).ok_or_else(|| need("diameter"))?;
    let density = s.density.or(of_data.map(|d| d.1)).ok_or_else(|| need("density"))?;
    let (rho, nu, g) = (f.fluid.density, f.fluid.kinematic_viscosity, norm(f.fluid.gravity));
    let extent = foam::extent(&c.fluid_case());
    let side = |e: &foam::Extent| [0, 1, 2].map(|a| e.upper[a] - e.lower[a]);
    let volume = extent.as_ref().map(|e| side(e).iter().product::<f64>());
    let sphere = PI / 6.0 * d.powi(3);
    let cells = extent.as_ref().and_then(|e| e.cells);
    let phi = count.zip(volume).map(|(n, v)| (n * sphere / v).min(0.9));
    let law = forces::by_name(&f.forces.drag).ok_or("forces.drag")?;
    let mean = phi.unwrap_or(0.0);
    let ratio = f.dem.coarse_graining.of_all();
    let k = |speed: f64, voidage: f64| {
        let slip =
            forces::Slip { diameter: d / ratio, voidage, speed, kinematic_viscosity: nu, density: rho };
        ratio.powi(3) * law.drag_coefficient(&slip)
    };
    let weight = density * sphere * g;
    let net = (density - rho).abs() * sphere * g;
    let (mut low, mut high) = (0.0, 1e3);
    for _ in 0..200 {
        let u = 0.5 * (low + high);
        if k(u, 1.0 - mean) * u < net { low = u } else { high = u }
    }
    let fastest = foam::start(&c.fluid_case()).map_or(0.0, |s| s.0);
    let slip = fastest.max(low);
    let speed = fastest.max(low * f64::from(u8::from(fastest == 0.0)));
    let drag = k(slip, 1.0 - mean) * slip;
    let mut scene = Scene {
        from: "the files of the case (estimates)".into(),
        particles: count.map(Range::one).unwrap_or_default(),
        cells,
        bounds: extent.as_ref().map(|e| [e.lower, e.upper]),
        diameter: Range::one(d),
        density: Range::one(density),
        cell_size: volume.zip(cells).map(|(v, n)| Range::one((v / n as f64).cbrt())).unwrap_or_default(),
        fluid_density: rho,
        kinematic_viscosity: nu,
        gravity: g,
        solid_fraction: phi,
        slip: Range::one(slip),
        fluid_speed: Range::one(speed),
        bandwidth: f.smooth.bandwidth,
        smoothed: f.smooth.method != "none",
        relaxation: if k(slip, 1.0 - mean) > 0.0 {
            Range::one(density * sphere / k(slip, 1.0 - mean))
        } else {
            Range::default()
        },
        period: c.period(),
        dem_step: f.dem.time_step,
        explicit: f.coupling.scheme == "explicit",
        ..Scene::default()
    };
    scene.fluid_relaxation =
        phi.filter(|p| *p > 0.0 && drag > 0.0).map(|p| rho * (1.0 - p) * sphere / (p * k(slip, 1.0 - mean)));
    if let Some(p) = phi {
        scene.solid_fraction_seen.add(p);
    }
    terms(&mut scene, c, drag, weight, phi, k(slip, 1.0 - mean) / k(slip, 1.0).max(f64::MIN_POSITIVE));
    Ok(scene)
}

fn terms(s: &mut Scene, c: &Config, drag: f64, weight: f64, phi: Option<f64>, hindrance: f64) {
    let f = &c.file;
    let (d, rho, nu) = (s.diameter.mean, s.fluid_density, s.kinematic_viscosity);
    let sphere = PI / 6.0 * d.powi(3);
    let scale = drag.max(weight).max(f64::MIN_POSITIVE);
    let to = if drag >= weight { "drag" } else { "weight" };
    let (length, slip, speed) = (s.length(), s.slip.mean, s.fluid_speed.max);
    let mass = s.density.mean * sphere;
    let cell = (!s.cell_size.is_empty()).then_some(s.cell_size.mean);
    let tau = if s.relaxation.is_empty() { s.stokes_time() } else { s.relaxation.mean };
    // nothing accelerates a particle against the fluid faster than the larger of drag and weight
    let fastest = scale / mass;
    let mut put = |name, relative: f64, to, how, now, on, off| {
        s.terms.push(Term { name, relative, to, how, now, on, off });
    };
    let model_a = f.coupling.model == Model::A;
    put("drag", drag / scale, to, "drag law at the slip above", f.forces.drag != "none", None, None);
    let shear = length.map_or(0.0, |l| 2.0 * speed / l);
    // how many particles there are may not be known: a bed packed to 0.6 is the most
    let carried = phi.unwrap_or(0.6) * drag / scale;
    let mean = norm(f.fluid.mean_pressure_gradient) * sphere / scale;
    let wave = carried.max(rho * speed * shear * sphere / scale).max(mean);
    put(
        "pressure gradient",
        wave,
        to,
        if phi.is_some() {
            "estimate: carries the drag of the solids, or rho U2/L"
        } else {
            "estimate: carries the drag of a bed packed to 0.6"
        },
        model_a && f.forces.pressure_gradient,
        Some("coupling.model = \"A\", forces.pressure_gradient = true"),
        Some("coupling.model = \"B\", forces.pressure_gradient = false"),
    );
    let viscous = length.map_or(0.0, |l| 8.0 * rho * nu * speed / (l * l) * sphere / scale);
    put(
        "viscous stress",
        viscous,
        to,
        "estimate: laminar profile across the mesh",
        model_a && f.forces.viscous_stress,
        Some("coupling.model = \"A\", forces.viscous_stress = true"),
        Some("forces.viscous_stress = false (model B)"),
    );
    put(
        "Archimedes",
        rho * sphere * s.gravity / scale,
        to,
        "rho_f V g",
        f.fluid.gravity_treatment != GravityTreatment::None,
        Some("fluid.gravity_treatment = \"archimedes\""),
        Some("fluid.gravity_treatment = \"none\""),
    );
    put(
        "added mass",
        0.5 * rho * sphere * fastest / scale,
        to,
        "bound: rho_f/(2 rho_p)",
        f.forces.added_mass.on(),
        Some("forces.added_mass = 0.5"),
        Some("forces.added_mass = 0"),
    );
    let basset = forces::history::coefficient(d, rho, nu) * 2.0 * tau.sqrt() * fastest / scale;
    put(
        "history (Basset)",
        basset,
        to,
        "bound: acceleration lasting m/K",
        f.forces.history,
        Some("forces.history = true"),
        Some("forces.history = false"),
    );
    let flow = forces::lift::Shear {
        diameter: d,
        slip: [slip, 0.0, 0.0],
        vorticity: [0.0, 0.0, shear],
        kinematic_viscosity: nu,
        density: rho,
    };
    let law = forces::lift::by_name("loth");
    put(
        "lift",
        law.map_or(0.0, |l| norm(l.force(&flow)) / scale),
        to,
        "estimate: Loth, shear 2 U/L",
        f.forces.lift != "none",
        Some("forces.lift = \"loth\""),
        Some("forces.lift = \"none\""),
    );
    let Some(p) = phi else {
        super::decide::smoothing(s, f.smooth.method != "none");
        return;
    };
    put("voidage in the drag", (hindrance - 1.0).abs(), "drag alone", "|K(eps)/K(1) - 1|", true, None, None);
    let two_way = f.coupling.feedback == Feedback::TwoWay;
    put(
        "voidage rate in continuity",
        p,
        "eps U/h",
        "bound: solids move as fast as the fluid",
        two_way && f.coupling.continuity != Continuity::SolidsFlux,
        Some("coupling.continuity = \"voidage-rate\""),
        Some("coupling.feedback = \"one-way\""),
    );
    let given = p * drag / sphere * length.unwrap_or(0.0) / (rho * (1.0 - p) * speed * speed);
    // what one particle gives to its own cell of size h while it passes: K u/(rho h2 u2), of its slip
    let own = cell.map_or(f64::INFINITY, |h| drag / (rho * h * h * slip * slip));
    let given = given.max(own);
    put(
        "feedback on the fluid",
        if given.is_finite() { given } else { 1.0 },
        "rho U2/L",
        "estimate: drag of the mean solids, of one in its cell",
        two_way,
        Some("coupling.feedback = \"two-way\""),
        Some("coupling.feedback = \"one-way\""),
    );
    super::decide::smoothing(s, f.smooth.method != "none");
}
