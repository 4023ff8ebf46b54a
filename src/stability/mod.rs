// SPDX-License-Identifier: MIT OR Apache-2.0
//! `voidage stability`: the largest fluid step each coupling scheme bears in a recorded scene.
//!
//! For every scheme and a range of fluid steps Δt (s) the growth of the worst disturbance per exchange is measured on the frozen
//! scene (`frozen`, `amplify`); above 1 the scheme is unstable. Particles free and particles held are told apart: contacts are
//! between the two. Reads one exchange of a recording; does not know the fluid solver's own limits (Courant number).

pub mod amplify;
pub mod frozen;

use crate::config::Config;
use crate::mesh::Mesh;
use crate::particles::Particles;
use crate::plot::{Axis, Chart, Curve};
use crate::scheme;
use frozen::Frozen;

/// Growth per exchange up to which a scheme counts as stable: neutral modes are found as 1 ± this.
pub const NEUTRAL: f64 = 1.003;
/// Fluid steps per decade of the map.
const PER_DECADE: usize = 4;

/// Growth of one scheme over the fluid step.
#[derive(Clone, Debug)]
pub struct Growth {
    /// name in case.toml
    pub scheme: &'static str,
    /// particles do not move
    pub held: bool,
    /// (Δt in s, growth per exchange), ascending in Δt
    pub points: Vec<(f64, f64)>,
    /// largest stable Δt, s; `None`: stable at all Δt looked at, 0: at none
    pub limit: Option<f64>,
    /// (exchange, largest stable Δt in s) where a scene bears less than those before it
    pub found: Vec<(i64, f64)>,
}

/// One exchange of a scene.
pub struct Scene<'a> {
    /// number of the exchange
    pub exchange: i64,
    /// settings; coupling period and scheme are varied
    pub config: &'a Config,
    /// the mesh
    pub mesh: &'a Mesh,
    /// particles of the exchange
    pub particles: &'a Particles,
    /// U of the cells, m/s
    pub fluid: &'a [[f64; 3]],
}

impl Scene<'_> {
    /// Growth with that scheme at a fluid step (s).
    pub fn growth(&self, scheme: &str, period: f64, held: bool) -> Result<f64, String> {
        let mut c = self.config.clone();
        let f = &mut c.file;
        f.coupling.scheme = scheme.into();
        f.coupling.feedback = crate::config::Feedback::TwoWay;
        (f.coupling.interval, f.dem.time_step) = (1, period);
        // what needs more of the past than one interval, or has no reaction
        (f.forces.history, f.forces.torque, f.smooth.time) = (false, false, 0.0);
        let (mut frozen, base) =
            Frozen::new(&c, self.mesh.clone(), self.particles.clone(), self.fluid, held)?;
        amplify::growth(&mut frozen, &base).map_err(|e| e.to_string())
    }

    /// The map of one scheme from `low` to `high` (s) and its limit within 2 %.
    pub fn map(&self, scheme: &'static str, held: bool, low: f64, high: f64) -> Result<Growth, String> {
        let steps = ((high / low).log10() * PER_DECADE as f64).round().max(1.0) as usize;
        let at = |i: usize| low * (high / low).powf(i as f64 / steps as f64);
        let mut points = Vec::new();
        for i in 0..=steps {
            points.push((at(i), self.growth(scheme, at(i), held)?));
        }
        let limit = match points.iter().position(|p| p.1 > NEUTRAL) {
            None => None,
            Some(0) => Some(0.0),
            Some(i) => Some(self.between(scheme, held, points[i - 1].0, points[i].0, &mut points)?),
        };
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        Ok(Growth {
            scheme,
            held,
            points,
            limit,
            found: limit.map(|l| (self.exchange, l)).into_iter().collect(),
        })
    }

    /// The limit between a stable and an unstable Δt (s), within 2 %.
    fn between(
        &self,
        scheme: &str,
        held: bool,
        mut stable: f64,
        mut bad: f64,
        points: &mut Vec<(f64, f64)>,
    ) -> Result<f64, String> {
        while bad / stable > 1.02 {
            let mid = (stable * bad).sqrt();
            let g = self.growth(scheme, mid, held)?;
            points.push((mid, g));
            if g > NEUTRAL { bad = mid } else { stable = mid }
        }
        Ok(stable)
    }

    /// Lowers the limit found in another exchange to what this one bears. `low`, `high`: range of Δt, s.
    pub fn lower(&self, g: &mut Growth, low: f64, high: f64) -> Result<(), String> {
        let decades: Vec<f64> =
            (0..).map(|i| low * 10f64.powi(i)).take_while(|t| *t < high).chain([high]).collect();
        let tried = g.limit.map_or(decades, |l| vec![l]);
        let mut bad = None;
        for t in tried {
            if t > 0.0 && self.growth(g.scheme, t, g.held)? > NEUTRAL {
                bad = Some(t);
                break;
            }
        }
        let Some(mut bad) = bad else { return Ok(()) };
        let limit = loop {
            let half = 0.5 * bad;
            if half < low {
                break 0.0;
            }
            if self.growth(g.scheme, half, g.held)? <= NEUTRAL {
                break self.between(g.scheme, g.held, half, bad, &mut Vec::new())?;
            }
            bad = half;
        };
        g.limit = Some(limit);
        g.found.push((self.exchange, limit));
        Ok(())
    }

    /// All schemes or `only` that one, free and held; `told` hears of each.
    pub fn all(
        &self,
        only: Option<&str>,
        low: f64,
        high: f64,
        told: &mut dyn FnMut(&'static str, bool),
    ) -> Result<Vec<Growth>, String> {
        let mut list = Vec::new();
        for held in [false, true] {
            for s in scheme::all().iter().filter(|s| only.is_none_or(|n| n == s.name())) {
                told(s.name(), held);
                list.push(self.map(s.name(), held, low, high)?);
            }
        }
        Ok(list)
    }
}

/// The map as a picture; `marks`: named time scales, s.
pub fn picture(list: &[Growth], marks: &[(&str, f64)], held: bool) -> String {
    let curves = list.iter().filter(|g| g.held == held).map(|g| Curve {
        name: g.scheme.into(),
        points: g.points.iter().map(|p| (p.0, p.1.clamp(1e-2, 1e2))).collect(),
    });
    Chart {
        title: format!(
            "Growth of the worst disturbance per exchange, particles {}",
            if held { "held" } else { "free" }
        ),
        x: Axis { label: "fluid step, s".into(), logarithmic: true },
        y: Axis { label: "growth (above 1: unstable; cut at 0.01 and 100)".into(), logarithmic: true },
        curves: curves.collect(),
        lines: vec![("1".into(), 1.0)],
        marks: marks.iter().map(|m| (m.0.into(), m.1)).collect(),
    }
    .svg()
}

#[cfg(test)]
mod tests;
