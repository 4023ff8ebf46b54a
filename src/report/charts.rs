// SPDX-License-Identifier: MIT OR Apache-2.0
//! The pictures of a report as SVG: histories of the books, of the solid fraction and of the time, stability, tuning.
//!
//! Reads `Content`; long histories are thinned to the largest value of each part, so no error is hidden.

use super::Content;
use crate::monitor::Row;
use crate::plot::{Axis, Chart, Curve};
use crate::stability::picture;
use serde_json::Value;

/// Points of a history at most.
const POINTS: usize = 400;

/// (time, largest of a part's values).
fn history(rows: &[Row], value: impl Fn(&Row) -> Option<f64>) -> Vec<(f64, f64)> {
    let part = rows.len().div_ceil(POINTS).max(1);
    let most = |part: &[Row]| {
        let value =
            part.iter().filter_map(&value).filter(|v| v.is_finite()).fold(f64::NEG_INFINITY, f64::max);
        (part[part.len() - 1].time, value)
    };
    rows.chunks(part).map(most).filter(|p| p.1.is_finite()).collect()
}

fn axis(label: &str, logarithmic: bool) -> Axis {
    Axis { label: label.into(), logarithmic }
}

fn chart(title: &str, y: Axis, curves: Vec<(&str, Vec<(f64, f64)>)>, lines: Vec<(String, f64)>) -> String {
    let curves = curves.into_iter().filter(|c| !c.1.is_empty());
    let curves = curves.map(|(name, points)| Curve { name: name.into(), points }).collect();
    Chart { title: title.into(), x: axis("time, s", false), y, curves, lines, marks: vec![] }.svg()
}

/// CPU time over numerical error, a curve for each mapping, interpolation and smoother.
fn tuning(points: &[Value]) -> String {
    let mut curves: Vec<Curve> = Vec::new();
    for p in points {
        let text = |key: &str| p["settings"][key].as_str().unwrap_or_default();
        let name = format!("{}, {}, {}", text("smoother"), text("mapping"), text("interpolation"));
        let point =
            (p["error"].as_f64().unwrap_or(f64::NAN).max(1e-16), p["ms"].as_f64().unwrap_or(f64::NAN));
        match curves.iter_mut().find(|c| c.name == name) {
            Some(c) => c.points.push(point),
            None => curves.push(Curve { name, points: vec![point] }),
        }
    }
    // one smoother at several tolerances is a curve; what was measured once is in the table
    curves.retain(|c| c.points.len() > 2);
    curves.sort_by_key(|c| std::cmp::Reverse(c.points.len()));
    curves.truncate(8);
    curves.iter_mut().for_each(|c| c.points.sort_by(|a, b| a.0.total_cmp(&b.0)));
    Chart {
        title: "CPU time of the coupler per exchange over numerical error".into(),
        x: axis("largest relative L2 error of voidage, force and momentum source", true),
        y: axis("ms", false),
        curves,
        lines: vec![("0".into(), 0.0)],
        marks: vec![],
    }
    .svg()
}

/// Name and SVG of each picture there is something for.
pub fn all(c: &Content) -> Vec<(&'static str, String)> {
    let mut list = Vec::new();
    // the first exchange is before the first fluid step
    let rows = c.rows.get(1..).unwrap_or_default();
    if rows.len() > 1 {
        // rounding to zero has no logarithm
        let error = |f: fn(&Row) -> Option<f64>| history(rows, move |r| f(r).map(|e| e.max(1e-18)));
        let errors = vec![
            ("action − reaction", error(|r| r.action_reaction_error)),
            ("solid volume", error(|r| Some(r.solid_volume_error))),
            ("solid momentum", error(|r| Some(r.solid_momentum_error))),
        ];
        let limit = vec![("limit".into(), 1e-12)];
        let y = axis("relative error per step (line: 1e-12)", true);
        list.push(("conservation", chart("Conservation", y, errors, limit)));
        let ledger = vec![("ledger of all particles", history(rows, |r| Some(r.ledger_momentum)))];
        let title = "Impulse taken by the particles and not yet given to the fluid";
        list.push(("ledger", chart(title, axis("N s", false), ledger, vec![])));
        let most = vec![("largest of a cell", history(rows, |r| Some(r.solid_fraction_max)))];
        list.push(("solid-fraction", chart("Solid fraction", axis("ε_s", false), most, vec![])));
        let time = vec![
            ("waiting for the DEM", history(rows, |r| Some(1e3 * r.wait_dem))),
            ("waiting for the CFD", history(rows, |r| Some(1e3 * r.wait_cfd))),
            ("coupler", history(rows, |r| Some(1e3 * r.coupler))),
        ];
        list.push((
            "time",
            chart("Wall time per step", axis("ms (largest of each part of the run)", true), time, vec![]),
        ));
    }
    if let Some(points) = c.tune.as_ref().and_then(|t| t.get("points")?.as_array()) {
        list.push(("tuning", tuning(points)));
    }
    if let Some((growths, marks)) = &c.stability {
        let marks: Vec<(&str, f64)> = marks.iter().map(|m| (m.0.as_str(), m.1)).collect();
        for (held, name) in [(false, "stability-free"), (true, "stability-held")] {
            if growths.iter().any(|g| g.held == held) {
                list.push((name, picture(growths, &marks, held)));
            }
        }
    }
    list
}
