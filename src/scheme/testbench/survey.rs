// SPDX-License-Identifier: MIT OR Apache-2.0
//! The map: every scheme at every x, loading, cell size and mode; verdicts and errors.

use super::{Bench, Mode, Point, Resolved, Step};
use crate::scheme::{Scheme, all};

/// x = Δt/τ_p.
pub const RATIOS: [f64; 10] = [1e-3, 1e-2, 0.1, 1.0, 10.0, 1e2, 1e3, 1e4, 1e5, 1e6];
/// Particle mass ÷ fluid mass.
pub const LOADINGS: [f64; 9] = [1e-3, 1e-2, 0.1, 1.0, 10.0, 1e2, 1e3, 1e4, 1e5];
/// Cell size ÷ particle diameter.
pub const CELLS: [f64; 4] = [0.25, 1.0, 4.0, 20.0];

/// Exchanges of a stability run.
const STEPS: usize = 400;
/// Steps compared with the resolved solution.
const COMPARED: usize = 60;

/// What a point of the map came to.
#[derive(Clone, Copy, Debug)]
pub struct Outcome {
    /// nothing grows
    pub stable: bool,
    /// largest |U|, |v| ÷ U0
    pub largest: f64,
    /// largest |action − reaction| ÷ Σ|action| of a step, steps whose action is below 1e-3 of the largest left out
    pub third_law: f64,
    /// largest |action − reaction| ÷ Σ of the terms of the fluid's equation
    pub third_law_terms: f64,
    /// change of momentum that nothing accounts for, relative
    pub drift: f64,
    /// impulse to the fluid against Σ K (ũ + d − v) Δt in the steady state
    pub steady: f64,
    /// rms error of the mean fluid velocity over 60 steps against the resolved solution, ÷ the larger of U0 and its maximum
    pub transient: f64,
}

/// A line of the table.
#[derive(Clone, Copy)]
pub struct Row {
    /// where
    pub point: Point,
    /// what
    pub outcome: Outcome,
}

fn run(point: Point, steps: usize) -> (Vec<Step>, f64) {
    let mut bench = Bench::new(point);
    let list: Vec<Step> = (0..steps).map_while(|_| bench.advance()).collect();
    (list, bench.momentum_drift())
}

/// All measurements at one point; `resolved`: the solution to compare with, for particles that keep their places.
pub fn measure(point: Point, resolved: &Resolved) -> Outcome {
    let (list, drift) = run(Point { steady: false, fixed: false, ..point }, STEPS);
    let largest_of = |s: &[Step]| s.iter().map(|s| s.largest).fold(0.0, f64::max);
    let largest = largest_of(&list);
    let third = STEPS / 3;
    // growth: the last third against the middle one; a bounded forcing settles in far fewer steps or not at all
    let stable = list.len() == STEPS
        && largest < 1e6
        && largest_of(&list[2 * third..]) < 3.0 * largest_of(&list[third..2 * third]).max(2.0);
    let most = list.iter().map(|s| s.action).fold(0.0, f64::max);
    let errors = list.iter().skip(1).filter(|s| s.action > 1e-3 * most).map(|s| s.gap / s.action);
    let third_law = errors.fold(0.0, f64::max);
    let terms = list.iter().skip(1).filter(|s| s.terms > 0.0).map(|s| s.gap / s.terms);
    let third_law_terms = terms.fold(0.0, f64::max);

    let steady = if matches!(point.mode, Mode::Settling | Mode::Held) {
        let (list, _) = run(Point { steady: true, fixed: false, ..point }, 40);
        if list.len() < 40 {
            f64::INFINITY
        } else {
            list.iter().skip(3).map(|s| s.steady).fold(0.0, f64::max)
        }
    } else {
        f64::NAN
    };

    let (list, _) = run(Point { steady: false, fixed: true, ..point }, COMPARED + 1);
    let transient = if list.len() <= COMPARED {
        f64::INFINITY
    } else {
        let scale = resolved.mean.iter().fold(1.0f64, |m, u| m.max(u.abs()));
        let square = list.iter().zip(&resolved.mean).map(|(s, r)| (s.mean - r).powi(2)).sum::<f64>();
        (square / COMPARED as f64).sqrt() / scale
    };
    Outcome { stable, largest, third_law, third_law_terms, drift, steady, transient }
}

/// The map over the given values for all schemes; `each` is told every row.
pub fn survey(ratios: &[f64], loadings: &[f64], cells: &[f64], mut each: impl FnMut(&Row)) -> Vec<Row> {
    let mut rows = Vec::new();
    for mode in Mode::ALL {
        for &cell in cells {
            for &ratio in ratios {
                for &loading in loadings {
                    let at = |scheme: &'static dyn Scheme| Point {
                        scheme,
                        mode,
                        ratio,
                        loading,
                        cell,
                        steady: false,
                        fixed: true,
                    };
                    let resolved = Resolved::new(&at(all()[0]), COMPARED);
                    for scheme in all() {
                        let point = at(*scheme);
                        let row = Row { point, outcome: measure(point, &resolved) };
                        each(&row);
                        rows.push(row);
                    }
                }
            }
        }
    }
    rows
}

/// The table as CSV.
pub fn csv(rows: &[Row]) -> String {
    let mut text =
        "scheme,mode,cell_per_diameter,x,loading,stable,largest,third_law,third_law_terms,momentum_drift,\
                    steady,transient\n"
            .to_string();
    for Row { point: p, outcome: o } in rows {
        text += &format!(
            "{},{},{},{:e},{:e},{},{:.3e},{:.3e},{:.3e},{:.3e},{:.3e},{:.3e}\n",
            p.scheme.name(),
            p.mode.name(),
            p.cell,
            p.ratio,
            p.loading,
            u8::from(o.stable),
            o.largest,
            o.third_law,
            o.third_law_terms,
            o.drift,
            o.steady,
            o.transient
        );
    }
    text
}
