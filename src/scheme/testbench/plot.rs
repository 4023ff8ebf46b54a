// SPDX-License-Identifier: MIT OR Apache-2.0
//! The map as a picture: per mode and scheme a field of x × loading, coloured by the transient error, the worst of all
//! cell sizes; unstable points are dark with a cross.

use super::{Mode, Row};
use crate::scheme::all;
use std::fmt::Write;

const CELL: f64 = 15.0;
const GAP: f64 = 46.0;
const LEFT: f64 = 110.0;
const TOP: f64 = 60.0;

/// Colour of an error from 1e-4 (light) to 1 (strong).
fn colour(error: f64) -> String {
    let t = ((error.max(1e-4).log10() + 4.0) / 4.0).clamp(0.0, 1.0);
    let stops = [[247.0, 252.0, 240.0], [168.0, 221.0, 181.0], [250.0, 190.0, 90.0], [215.0, 48.0, 39.0]];
    let (at, last) = (t * 3.0, stops.len() - 2);
    let i = (at as usize).min(last);
    let c = [0, 1, 2].map(|a| stops[i][a] + (at - i as f64) * (stops[i + 1][a] - stops[i][a]));
    format!("rgb({:.0},{:.0},{:.0})", c[0], c[1], c[2])
}

/// The picture; rows of one survey.
pub fn svg(rows: &[Row]) -> String {
    let sorted = |pick: fn(&Row) -> f64| {
        let mut v: Vec<f64> = rows.iter().map(pick).collect();
        v.sort_by(f64::total_cmp);
        v.dedup();
        v
    };
    let (ratios, loadings) = (sorted(|r| r.point.ratio), sorted(|r| r.point.loading));
    let (w, h) = (CELL * ratios.len() as f64, CELL * loadings.len() as f64);
    let width = LEFT + all().len() as f64 * (w + GAP);
    let height = TOP + Mode::ALL.len() as f64 * (h + GAP) + 40.0;
    let mut s = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" font-family=\"sans-serif\" \
         font-size=\"11\">\n<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n<text x=\"{LEFT}\" y=\"18\" \
         font-size=\"14\">Transient error (rms over 60 steps, worst of all cell sizes) and stability of the coupling \
         schemes</text>\n"
    );
    for (m, mode) in Mode::ALL.iter().enumerate() {
        let y0 = TOP + m as f64 * (h + GAP);
        let _ =
            writeln!(s, "<text x=\"8\" y=\"{}\" font-weight=\"bold\">{}</text>", y0 + h / 2.0, mode.name());
        for (k, scheme) in all().iter().enumerate() {
            let x0 = LEFT + k as f64 * (w + GAP);
            let _ = writeln!(s, "<text x=\"{x0}\" y=\"{}\">{}</text>", y0 - 6.0, scheme.name());
            field(&mut s, rows, *mode, scheme.name(), (&ratios, &loadings), [x0, y0]);
            axes(&mut s, &ratios, &loadings, [x0, y0, w, h]);
        }
    }
    legend(&mut s, height);
    s + "</svg>\n"
}

fn field(s: &mut String, rows: &[Row], mode: Mode, scheme: &str, axes: (&[f64], &[f64]), at: [f64; 2]) {
    for (i, x) in axes.0.iter().enumerate() {
        for (j, z) in axes.1.iter().enumerate() {
            let here = rows.iter().filter(|r| {
                let p = &r.point;
                p.mode == mode && p.scheme.name() == scheme && p.ratio == *x && p.loading == *z
            });
            let (stable, error) =
                here.fold((true, 0.0f64), |a, r| (a.0 && r.outcome.stable, a.1.max(r.outcome.transient)));
            let (px, py) = (at[0] + CELL * i as f64, at[1] + CELL * (axes.1.len() - 1 - j) as f64);
            let fill = if stable { colour(error) } else { "rgb(60,60,70)".into() };
            let _ = writeln!(
                s,
                "<rect x=\"{px}\" y=\"{py}\" width=\"{CELL}\" height=\"{CELL}\" fill=\"{fill}\"/>"
            );
            if !stable {
                let (a, b) = (CELL * 0.3, CELL * 0.7);
                let _ = writeln!(
                    s,
                    "<path d=\"M{} {}L{} {}M{} {}L{} {}\" stroke=\"white\"/>",
                    px + a,
                    py + a,
                    px + b,
                    py + b,
                    px + b,
                    py + a,
                    px + a,
                    py + b
                );
            }
        }
    }
}

fn axes(s: &mut String, ratios: &[f64], loadings: &[f64], [x0, y0, w, h]: [f64; 4]) {
    let _ = writeln!(
        s,
        "<rect x=\"{x0}\" y=\"{y0}\" width=\"{w}\" height=\"{h}\" fill=\"none\" stroke=\"black\"/>"
    );
    for (i, x) in ratios.iter().enumerate().filter(|p| p.0 % 3 == 0) {
        let px = x0 + CELL * (i as f64 + 0.5);
        let _ = writeln!(s, "<text x=\"{px}\" y=\"{}\" text-anchor=\"middle\">{x:.0e}</text>", y0 + h + 13.0);
    }
    let _ = writeln!(
        s,
        "<text x=\"{}\" y=\"{}\" text-anchor=\"middle\">x = Δt/τp</text>",
        x0 + w / 2.0,
        y0 + h + 26.0
    );
    for (j, z) in loadings.iter().enumerate().filter(|p| p.0 % 4 == 0) {
        let py = y0 + h - CELL * (j as f64 + 0.2);
        let _ = writeln!(s, "<text x=\"{}\" y=\"{py}\" text-anchor=\"end\">{z:.0e}</text>", x0 - 3.0);
    }
}

fn legend(s: &mut String, height: f64) {
    let y = height - 28.0;
    let _ = writeln!(s, "<text x=\"8\" y=\"{}\">vertical: mass loading; error:</text>", y + 12.0);
    for i in 0..=16 {
        let (e, x) = (10f64.powf(-4.0 + 0.25 * f64::from(i)), 190.0 + 20.0 * f64::from(i));
        let _ = writeln!(s, "<rect x=\"{x}\" y=\"{y}\" width=\"20\" height=\"12\" fill=\"{}\"/>", colour(e));
        if i % 4 == 0 {
            let _ = writeln!(
                s,
                "<text x=\"{}\" y=\"{}\" text-anchor=\"middle\">{e:.0e}</text>",
                x + 10.0,
                y + 25.0
            );
        }
    }
    let _ = writeln!(s, "<rect x=\"560\" y=\"{y}\" width=\"20\" height=\"12\" fill=\"rgb(60,60,70)\"/>");
    let _ = writeln!(s, "<text x=\"586\" y=\"{}\">unstable</text>", y + 11.0);
}
