// SPDX-License-Identifier: MIT OR Apache-2.0
//! The page of a report: HTML with its pictures inside, no script, nothing fetched.
//!
//! Reads `Content`; writes text. Every number is shown as it was measured.

use super::{Content, slice};
use crate::config::Feedback;
use crate::inspect::decide;
use crate::monitor::Row;
use crate::plot::escape;
use serde_json::Value;
use std::fmt::Write;

const STYLE: &str = "body{font:15px/1.5 system-ui,sans-serif;max-width:1240px;margin:2em auto;padding:0 1em;color:#222}
h1{font-size:1.5em}h2{font-size:1.15em;border-bottom:1px solid #ccc;margin-top:2em}
table{border-collapse:collapse;margin:.6em 0}td,th{padding:.2em .7em;text-align:left;border-bottom:1px solid #e4e4e4;vertical-align:top}
td.n,th.n{text-align:right;font-variant-numeric:tabular-nums}figure{margin:.5em .5em .5em 0;display:inline-block;vertical-align:top;max-width:49%}
figcaption{font-size:.85em;color:#555}.bad{color:#b00020;font-weight:600}.ok{color:#00703c}
.bar{display:flex;width:100%;max-width:700px;height:1.5em;color:#fff;font-size:.85em}.bar div{overflow:hidden;padding-left:.4em}
pre{background:#f6f6f6;padding:.8em;overflow:auto;font-size:.85em}svg{max-width:100%;height:auto}
img{image-rendering:pixelated;border:1px solid #ccc;max-width:100%}details{margin:.5em 0}";

/// Bytes as text for `src`.
fn base64(bytes: &[u8]) -> String {
    const SIGNS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut out = String::with_capacity(bytes.len() * 4 / 3 + 4);
    for c in bytes.chunks(3) {
        let n = c.iter().fold(0u32, |n, b| n << 8 | u32::from(*b)) << (8 * (3 - c.len()));
        let sign = |k: usize| if k > c.len() { '=' } else { SIGNS[(n >> (18 - 6 * k) & 63) as usize].into() };
        (0..4).for_each(|k| out.push(sign(k)));
    }
    out
}

fn row(s: &mut String, name: &str, value: &str) {
    let _ = writeln!(s, "<tr><th>{}</th><td>{value}</td></tr>", escape(name));
}

/// A number and whether it is within its limit.
fn judged(value: f64, limit: f64) -> String {
    let class = if value <= limit { "ok" } else { "bad" };
    format!("<span class=\"{class}\">{value:.1e}</span> (limit {limit:.0e})")
}

/// The page, with the pictures of `charts::all`.
pub fn page(c: &Content, pictures: &[(&'static str, String)]) -> std::io::Result<String> {
    let figure = |s: &mut String, names: &[&str]| {
        for (_, svg) in pictures.iter().filter(|p| names.contains(&p.0)) {
            let _ = writeln!(s, "<figure>{svg}</figure>");
        }
    };
    let title = escape(&c.title);
    let mut s = format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n<meta name=\"viewport\" content=\"width=device-width\">\n\
         <link rel=\"icon\" href=\"data:,\">\n<title>{title}</title>\n<style>{STYLE}</style>\n</head>\n<body>\n<h1>{title}</h1>\n"
    );
    summary(&mut s, c);
    s += "<h2>Conservation</h2>\n";
    figure(&mut s, &["conservation", "ledger"]);
    s += "<h2>Voidage</h2>\n";
    voidage(&mut s, c)?;
    figure(&mut s, &["solid-fraction"]);
    s += "<h2>Time</h2>\n";
    shares(&mut s, &c.rows);
    figure(&mut s, &["time"]);
    s += "<h2>What is modelled</h2>\n";
    terms(&mut s, c);
    s += "<h2>Speed and accuracy</h2>\n";
    tune(&mut s, c);
    figure(&mut s, &["tuning"]);
    s += "<h2>Stability</h2>\n";
    stability(&mut s, c);
    figure(&mut s, &["stability-free", "stability-held"]);
    let _ = writeln!(
        s,
        "<h2>Settings</h2>\n<details><summary>case.toml as it ran</summary><pre>{}</pre></details>\n</body>\n</html>",
        escape(&c.settings)
    );
    Ok(s)
}

fn summary(s: &mut String, c: &Content) {
    let f = &c.config.file;
    *s += "<h2>Run</h2>\n<table>\n";
    if let (Some(first), Some(last)) = (c.rows.first(), c.rows.last()) {
        row(
            s,
            "exchanges",
            &format!("{} (fluid time {:.6} s to {:.6} s)", c.rows.len(), first.time, last.time),
        );
        row(s, "particles", &format!("{}", last.particles));
        let worst = |f: fn(&Row) -> f64| c.rows.iter().map(f).fold(0.0, f64::max);
        if c.rows.iter().any(|r| r.action_reaction_error.is_some()) {
            let e = worst(|r| r.action_reaction_error.unwrap_or(0.0));
            row(s, "action − reaction, worst step", &judged(e, 1e-12));
        }
        row(s, "solid volume error, worst step", &judged(worst(|r| r.solid_volume_error), 1e-12));
        row(s, "largest solid fraction of a cell", &format!("{:.3}", worst(|r| r.solid_fraction_max)));
        if last.excluded > 0 || last.positive_redone > 0 || worst(|r| r.capped_volume) > 0.0 {
            let text = format!(
                "{} particles left out, {} steps redone with the positive smoother, at most {:.1e} m3 capped",
                last.excluded,
                last.positive_redone,
                worst(|r| r.capped_volume)
            );
            row(s, "exceptions", &text);
        }
    }
    row(
        s,
        "fluid step",
        &format!(
            "{:.3e} s = {} DEM steps of {:.1e} s",
            c.config.period(),
            f.coupling.interval,
            f.dem.time_step
        ),
    );
    row(s, "ranks", &format!("{} DEM, {} CFD", f.run.dem_ranks, f.run.cfd_ranks));
    row(s, "drag, scheme", &escape(&format!("{}, {}", f.forces.drag, f.coupling.scheme)));
    let smooth = format!(
        "{}, {}, tolerance {:.0e}, bandwidth {:.2e} m",
        f.map.method, f.smooth.method, f.smooth.tolerance, f.smooth.bandwidth
    );
    row(s, "mapping, smoothing", &escape(&smooth));
    *s += "</table>\n";
}

fn shares(s: &mut String, rows: &[Row]) {
    let total = |f: fn(&Row) -> f64| rows.iter().map(f).sum::<f64>();
    let parts = [
        ("DEM", total(|r| r.wait_dem), "#0072b2"),
        ("CFD", total(|r| r.wait_cfd), "#009e73"),
        ("coupler", total(|r| r.coupler), "#d55e00"),
    ];
    let all: f64 = parts.iter().map(|p| p.1).sum();
    if all <= 0.0 {
        return;
    }
    *s += "<div class=\"bar\">";
    for (name, t, colour) in parts {
        let share = 100.0 * t / all;
        let _ = write!(s, "<div style=\"width:{share:.2}%;background:{colour}\">{name}</div>");
    }
    *s += "</div>\n<table><tr><th></th><th class=\"n\">s</th><th class=\"n\">share</th></tr>\n";
    for (name, t, _) in parts {
        let _ = writeln!(
            s,
            "<tr><th>{name}</th><td class=\"n\">{t:.2}</td><td class=\"n\">{:.1} %</td></tr>",
            100.0 * t / all
        );
    }
    *s += "</table>\n";
}

fn voidage(s: &mut String, c: &Content) -> std::io::Result<()> {
    let Some((k, time, most, slices)) = &c.slices else {
        *s += match c.config.file.coupling.feedback {
            Feedback::TwoWay => {
                "<p>No exchange was recorded: run the case with <code>--set record.last=1</code> to see the voidage.</p>\n"
            }
            Feedback::OneWay => {
                "<p>The fluid does not feel the particles (one-way): it has no voidage.</p>\n"
            }
        };
        return Ok(());
    };
    let _ = writeln!(
        s,
        "<p>Solid fraction ε_s = 1 − ε in exchange {k} (t = {time:.6} s), on planes through the middle.</p>"
    );
    for p in slices {
        let [right, up] = p.axes;
        let across = ['x', 'y', 'z'].into_iter().find(|a| !p.axes.contains(a)).unwrap_or('z');
        let _ = writeln!(
            s,
            "<figure><img width=\"{}\" height=\"{}\" alt=\"solid fraction at {across} = {:.3e} m\" src=\"data:image/png;base64,{}\">\
             <figcaption>{right} to the right, {up} up; {across} = {:.3e} m</figcaption></figure>",
            p.pixels[0],
            p.pixels[1],
            p.at,
            base64(&p.png),
            p.at
        );
    }
    let _ = writeln!(
        s,
        "<p>0 <img width=\"200\" height=\"12\" alt=\"scale of colours\" src=\"data:image/png;base64,{}\"> {most:.3}</p>",
        base64(&slice::scale()?)
    );
    Ok(())
}

fn terms(s: &mut String, c: &Content) {
    let Some((scene, accuracy)) = &c.scene else {
        *s += "<p>Not known.</p>\n";
        return;
    };
    let _ = writeln!(
        s,
        "<p>Numbers from {}. A term matters where its magnitude exceeds the accuracy of {accuracy:.0e}.</p>",
        escape(&scene.from)
    );
    *s += "<table><tr><th>term</th><th class=\"n\">magnitude</th><th>relative to</th><th>now</th><th>needed</th><th>how it was found</th></tr>\n";
    for t in &scene.terms {
        let needed = decide::choose(t, *accuracy);
        let differs = (needed == decide::Choice::On) != t.now || needed == decide::Choice::Missing;
        let class = if differs { " class=\"bad\"" } else { "" };
        let _ = writeln!(
            s,
            "<tr><td>{}</td><td class=\"n\">{:.1e}</td><td>{}</td><td>{}</td><td{class}>{needed}</td><td>{}</td></tr>",
            escape(t.name),
            t.relative,
            escape(t.to),
            if t.now { "on" } else { "off" },
            escape(t.how)
        );
    }
    *s += "</table>\n";
    let advice = decide::advice(scene, *accuracy);
    if !advice.is_empty() {
        *s += "<ul>\n";
        advice.iter().for_each(|a| *s += &format!("<li>{}</li>\n", escape(a)));
        *s += "</ul>\n";
    }
    let _ = writeln!(
        s,
        "<details><summary>All numbers of the scene</summary><pre>{}</pre></details>",
        escape(&scene.to_string())
    );
}

fn tune(s: &mut String, c: &Content) {
    let Some(t) = &c.tune else {
        *s += "<p>Not measured: <code>voidage tune FILE --accuracy 1e-3 --json tune.json</code>, then <code>voidage report … --tune tune.json</code>.</p>\n";
        return;
    };
    let number = |v: &Value| v.as_f64().map_or_else(|| "–".into(), |x| format!("{x:.1e}"));
    let _ = writeln!(
        s,
        "<p>Settings measured on the recording that are cheapest for their error (asked for: {}); the exact Gaussians: {}.</p>",
        number(&t["accuracy"]),
        escape(t["gaussian"].as_str().unwrap_or("not known"))
    );
    *s += "<table><tr><th>mapping</th><th>fluid velocity</th><th>smoother</th><th class=\"n\">tolerance</th><th class=\"n\">CPU, ms per exchange</th>\
           <th class=\"n\">numerical error</th><th class=\"n\">model error</th><th></th></tr>\n";
    for p in t["points"].as_array().into_iter().flatten() {
        let is = |key: &str| p[key].as_bool().unwrap_or(false);
        let chosen = t["chosen"]["settings"] == p["settings"];
        if !(is("front") || is("recorded") || chosen) {
            continue;
        }
        let q = |key: &str| escape(p["settings"][key].as_str().unwrap_or_default());
        let note = [
            (chosen, "chosen"),
            (is("recorded"), "the case"),
            (!is("conservative"), "third law not to rounding"),
        ];
        let note: Vec<&str> = note.into_iter().filter(|n| n.0).map(|n| n.1).collect();
        let _ = writeln!(
            s,
            "<tr><td>{}</td><td>{}</td><td>{}</td><td class=\"n\">{}</td><td class=\"n\">{:.3}</td><td class=\"n\">{}</td><td class=\"n\">{}</td><td>{}</td></tr>",
            q("mapping"),
            q("interpolation"),
            q("smoother"),
            number(&p["settings"]["tolerance"]),
            p["ms"].as_f64().unwrap_or(f64::NAN),
            number(&p["error"]),
            number(&p["model"]["l2"]),
            note.join(", ")
        );
    }
    *s += "</table>\n";
    if let Some(section) = t["section"].as_str() {
        let _ = writeln!(
            s,
            "<p>The cheapest that are exact enough, for case.toml:</p>\n<pre>{}</pre>",
            escape(section)
        );
    }
}

fn stability(s: &mut String, c: &Content) {
    let Some((growths, marks)) = &c.stability else {
        *s += "<p>Not measured: <code>voidage stability FILE --json stability.json</code>, then <code>voidage report … --stability stability.json</code>.</p>\n";
        return;
    };
    *s += "<table><tr><th>scheme</th><th class=\"n\">largest stable fluid step, particles free, s</th><th class=\"n\">held, s</th></tr>\n";
    let text = |held: bool, name: &str| {
        let g = growths.iter().find(|g| g.held == held && g.scheme == name)?;
        let least = g.points.first().map_or(0.0, |p| p.0);
        Some(match g.limit {
            None => "no limit found".into(),
            Some(t) if t > 0.0 => format!("{t:.2e}"),
            Some(_) => format!("below {least:.1e}"),
        })
    };
    for g in growths.iter().filter(|g| !g.held) {
        let free = text(false, g.scheme).unwrap_or_default();
        let held = text(true, g.scheme).unwrap_or_default();
        let _ = writeln!(
            s,
            "<tr><td>{}</td><td class=\"n\">{free}</td><td class=\"n\">{held}</td></tr>",
            escape(g.scheme)
        );
    }
    *s += "</table>\n<table>\n";
    marks.iter().for_each(|(name, t)| row(s, name, &format!("{t:.2e} s")));
    *s += "</table>\n";
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_of_rfc_4648() {
        for (plain, coded) in [
            ("", ""),
            ("f", "Zg=="),
            ("fo", "Zm8="),
            ("foo", "Zm9v"),
            ("foob", "Zm9vYg=="),
            ("fooba", "Zm9vYmE="),
            ("foobar", "Zm9vYmFy"),
        ] {
            assert_eq!(base64(plain.as_bytes()), coded);
        }
    }
}
