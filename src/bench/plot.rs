// SPDX-License-Identifier: MIT OR Apache-2.0
//! The speed–accuracy table as a picture (SVG): time of one application over its error, both logarithmic.
//!
//! Left: error against exp(Δ_T), what a smoother answers for. Right: against the particles' exact Gaussians, what the
//! user gets with the particle centroid; below the deposit's own error nothing is won.

use super::smoother::Cost;
use crate::plot::COLOURS;
use std::fmt::Write;

const SIZE: [f64; 2] = [430.0, 360.0];
const LEFT: f64 = 62.0;
const TOP: f64 = 46.0;
const GAP: f64 = 84.0;

/// Decades that hold all values.
fn decades(values: impl Iterator<Item = f64>) -> [i32; 2] {
    let (low, high) =
        values.filter(|v| *v > 0.0).fold((f64::INFINITY, 0.0f64), |r, v| (r.0.min(v), r.1.max(v)));
    if low > high {
        return [0, 1];
    }
    let low = low.log10().floor() as i32;
    [low, (high.log10().ceil() as i32).max(low + 1)]
}

/// The picture of all methods.
pub fn svg(methods: &[Cost], title: &str) -> String {
    let width = LEFT + 2.0 * SIZE[0] + GAP + 16.0;
    let height = TOP + SIZE[1] + 96.0;
    let mut s = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" font-family=\"sans-serif\" \
         font-size=\"11\">\n<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n\
         <text x=\"{LEFT}\" y=\"18\" font-size=\"14\">{title}</text>\n"
    );
    let mut names: Vec<&str> = Vec::new();
    for m in methods {
        if !names.contains(&m.name) {
            names.push(m.name);
        }
    }
    panel(
        &mut s,
        methods,
        &names,
        |m| m.error,
        "relative L2 error of the solid fraction against exp(Δ_T)",
        LEFT,
    );
    panel(
        &mut s,
        methods,
        &names,
        |m| m.error_gaussian,
        "… against the particles' exact Gaussians (particle centroid)",
        LEFT + SIZE[0] + GAP,
    );
    for (i, name) in names.iter().enumerate() {
        let (x, y) = (LEFT + 190.0 * (i % 5) as f64, TOP + SIZE[1] + 58.0 + 18.0 * (i / 5) as f64);
        let c = COLOURS[i % COLOURS.len()];
        let _ = writeln!(
            s,
            "<circle cx=\"{x}\" cy=\"{}\" r=\"4\" fill=\"{c}\"/><text x=\"{}\" y=\"{y}\">{name}{}</text>",
            y - 4.0,
            x + 8.0,
            if i == 0 { " (default)" } else { "" }
        );
    }
    s + "</svg>\n"
}

fn panel(s: &mut String, methods: &[Cost], names: &[&str], error: fn(&Cost) -> f64, label: &str, left: f64) {
    let xs = decades(methods.iter().map(error));
    let ys = decades(methods.iter().map(|m| m.seconds * 1e3));
    let at = |v: f64, d: [i32; 2], size: f64| (v.log10() - f64::from(d[0])) / f64::from(d[1] - d[0]) * size;
    let (x, y) = (|v: f64| left + at(v, xs, SIZE[0]), |v: f64| TOP + SIZE[1] - at(v, ys, SIZE[1]));
    for d in xs[0]..=xs[1] {
        let px = x(10f64.powi(d));
        let _ = writeln!(
            s,
            "<path d=\"M{px:.1} {TOP}V{}\" stroke=\"#ddd\"/><text x=\"{px:.1}\" y=\"{}\" text-anchor=\"middle\">1e{d}</text>",
            TOP + SIZE[1],
            TOP + SIZE[1] + 16.0
        );
    }
    for d in ys[0]..=ys[1] {
        let py = y(10f64.powi(d));
        let _ = writeln!(
            s,
            "<path d=\"M{left} {py:.1}H{}\" stroke=\"#ddd\"/><text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{} ms</text>",
            left + SIZE[0],
            left - 6.0,
            py + 4.0,
            10f64.powi(d)
        );
    }
    let _ = writeln!(s, "<text x=\"{left}\" y=\"{}\">{label}</text>", TOP + SIZE[1] + 34.0);
    for (i, name) in names.iter().enumerate() {
        let mut mine: Vec<&Cost> = methods.iter().filter(|m| m.name == *name && error(m) > 0.0).collect();
        mine.sort_by(|a, b| error(a).total_cmp(&error(b)));
        let c = COLOURS[i % COLOURS.len()];
        let points: Vec<String> =
            mine.iter().map(|m| format!("{:.1},{:.1}", x(error(m)), y(m.seconds * 1e3))).collect();
        let _ = writeln!(s, "<polyline points=\"{}\" fill=\"none\" stroke=\"{c}\"/>", points.join(" "));
        for m in mine {
            let _ = writeln!(
                s,
                "<circle cx=\"{:.1}\" cy=\"{:.1}\" r=\"4\" fill=\"{c}\"><title>{name}, tolerance {:e}: {:.3} ms, error \
                 {:.2e}</title></circle>",
                x(error(m)),
                y(m.seconds * 1e3),
                m.tolerance,
                m.seconds * 1e3,
                error(m)
            );
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_method_is_in_the_picture() {
        let cost = |name, seconds, error| Cost {
            name,
            tolerance: 1e-4,
            seconds,
            error,
            error_gaussian: 0.01,
            least: 0.0,
            conservation: 0.0,
            degree: 3,
        };
        let s = svg(&[cost("chebyshev", 0.01, 1e-5), cost("constdiff", 0.2, 0.04)], "title");
        assert!(s.contains("chebyshev (default)") && s.contains(">constdiff<"));
        assert_eq!(s.matches("<title>").count(), 4);
        assert!(!s.contains("NaN") && !s.contains("inf"));
    }
}
