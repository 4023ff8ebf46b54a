// SPDX-License-Identifier: MIT OR Apache-2.0
//! `voidage report FILE|CASE`.

use super::record::{fail, of_file};
use super::{BAD_INPUT, FAILED, OK, print, read};
use crate::config::{Config, Feedback, Problem};
use crate::inspect::{Scene, expected, recorded};
use crate::locate::Locator;
use crate::monitor;
use crate::record::moment::Moments;
use crate::record::{Reader, RecordError, replay};
use crate::report::slice::{Slice, slice};
use crate::report::{Content, Stability, charts, html};
use crate::scheme;
use crate::stability::Growth;
use serde_json::Value;
use std::path::{Path, PathBuf};

/// What is asked of the command.
pub struct Options<'a> {
    /// folder for report.html and its pictures
    pub into: Option<&'a Path>,
    /// terms above it matter
    pub accuracy: f64,
    /// file of `voidage tune --json`
    pub tune: Option<&'a Path>,
    /// file of `voidage stability --json`
    pub stability: Option<&'a Path>,
}

/// `voidage report FILE|CASE`
pub fn report(path: &Path, o: &Options) -> u8 {
    if !(o.accuracy > 0.0 && o.accuracy < 1.0) {
        let fix = "--accuracy 1e-2";
        print(&[Problem::error("--accuracy", o.accuracy, "a number between 0 and 1", fix)]);
        return BAD_INPUT;
    }
    let (tune, stability) = match (json(o.tune), json(o.stability)) {
        (Ok(t), Ok(s)) => (t, s),
        (Err(p), _) | (_, Err(p)) => {
            print(&[p]);
            return BAD_INPUT;
        }
    };
    let stability = match stability.map(|v| growths(&v)) {
        None => None,
        Some(Some(g)) => Some(g),
        Some(None) => {
            let given = o.stability.map(|p| p.display().to_string()).unwrap_or_default();
            let accepted = "a file of `voidage stability --json`";
            print(&[Problem::error(
                "--stability",
                given,
                accepted,
                "voidage stability FILE --json stability.json",
            )]);
            return BAD_INPUT;
        }
    };
    if tune.as_ref().is_some_and(|t| !t["points"].is_array()) {
        let given = o.tune.map(|p| p.display().to_string()).unwrap_or_default();
        let fix = "voidage tune FILE --accuracy 1e-3 --json tune.json";
        print(&[Problem::error("--tune", given, "a file of `voidage tune --json`", fix)]);
        return BAD_INPUT;
    }
    let file = if path.is_dir() { path.join("recording.voidage") } else { path.to_path_buf() };
    let found = if file.is_file() { of_recording(&file) } else { of_case(path) };
    let found = match found {
        Ok(f) => f,
        Err(code) => return code,
    };
    let folder = o.into.map_or_else(|| beside(path), Path::to_path_buf);
    let content = Content {
        title: format!("voidage: {}", path.display()),
        settings: toml::to_string(&found.config.file).unwrap_or_default(),
        config: &found.config,
        rows: found.rows,
        scene: found.scene.map(|s| (s, o.accuracy)),
        slices: found.slices,
        stability,
        tune,
    };
    match write(&content, &folder) {
        Ok(()) => {
            println!("{}", folder.join("report.html").display());
            OK
        }
        Err(e) => {
            eprintln!("error: {}: {e}", folder.display());
            FAILED
        }
    }
}

/// CASE/report, or FILE-report beside a recording.
fn beside(path: &Path) -> PathBuf {
    if path.is_dir() { path.join("report") } else { path.with_extension("report") }
}

fn json(file: Option<&Path>) -> Result<Option<Value>, Problem> {
    let Some(file) = file else { return Ok(None) };
    let text = std::fs::read_to_string(file).map_err(|e| e.to_string());
    let value = text.and_then(|t| serde_json::from_str(&t).map_err(|e| e.to_string()));
    let accepted = "a JSON file that voidage wrote";
    value
        .map(Some)
        .map_err(|e| Problem::error(&file.display().to_string(), e, accepted, "make it with --json FILE"))
}

/// Growths and time scales of `voidage stability --json`.
fn growths(v: &Value) -> Option<Stability> {
    let point = |p: &Value| Some((p.get(0)?.as_f64()?, p.get(1)?.as_f64().unwrap_or(f64::INFINITY)));
    let one = |g: &Value| {
        Some(Growth {
            scheme: scheme::by_name(g.get("scheme")?.as_str()?)?.name(),
            held: g.get("held")?.as_bool()?,
            points: g.get("points")?.as_array()?.iter().map(point).collect::<Option<_>>()?,
            limit: g.get("limit_s")?.as_f64(),
            found: Vec::new(),
        })
    };
    let list = v.get("growth")?.as_array()?.iter().map(one).collect::<Option<_>>()?;
    let scales = v.get("time_scales_s")?.as_object()?;
    Some((list, scales.iter().filter_map(|(k, t)| Some((k.clone(), t.as_f64()?))).collect()))
}

/// What a recording or a case tells.
struct Found {
    config: Config,
    rows: Vec<monitor::Row>,
    scene: Option<Scene>,
    slices: Option<(i64, f64, f64, Vec<Slice>)>,
}

fn of_case(path: &Path) -> Result<Found, u8> {
    let (mut config, _) = read(path, &[])?;
    // as it ran, with overrides and what `auto` chose
    let resolved = path.join("logs/case.resolved.toml");
    if let Ok(text) = std::fs::read_to_string(&resolved) {
        config.file = toml::from_str(&text).map_err(|e| {
            let fix = format!("voidage run {}", path.display());
            print(&[Problem::error(
                &resolved.display().to_string(),
                e.message(),
                "the settings of a run",
                &fix,
            )]);
            BAD_INPUT
        })?;
    }
    let file = path.join("monitor.csv");
    let rows = monitor::read(&file).map_err(|e| {
        let fix = format!("voidage run {}", path.display());
        print(&[Problem::error(&file.display().to_string(), e, "the monitor of a run, or a recording", fix)]);
        BAD_INPUT
    })?;
    Ok(Found { scene: expected::scene(&config).ok(), rows, config, slices: None })
}

fn of_recording(path: &Path) -> Result<Found, u8> {
    let reader = Reader::open(path).map_err(|e| of_file(path, e))?;
    let config = replay::case(&reader, &[]).map_err(|e| fail(&e))?;
    let told = |e: RecordError| of_file(path, e);
    let mut m = Moments::new(reader).map_err(told)?;
    // rows stand between the exchanges
    while m.next().map_err(told)?.is_some() {}
    let rows = std::mem::take(&mut m.rows);
    let scene = recorded::scene(&mut m, &config).map_err(told)?;
    let last = m.last().map_err(told)?;
    // without feedback the fluid is told of no solids
    let two_way = config.file.coupling.feedback == Feedback::TwoWay;
    let mut slices = None;
    if let Some(x) = last.filter(|_| two_way) {
        let voidage = x.sources(&m.mesh).map_err(told)?.voidage;
        let solid: Vec<f64> = voidage.iter().map(|e| 1.0 - e).collect();
        let most = solid.iter().copied().fold(0.0, f64::max);
        let locator = Locator::new(&m.mesh);
        let all: Result<Vec<_>, _> = (0..3).map(|a| slice(&m.mesh, &locator, &solid, most, a)).collect();
        let all = all.map_err(|e| {
            eprintln!("error: {e}");
            FAILED
        })?;
        slices = Some((x.k, x.time, most, all));
    }
    Ok(Found { config, rows, scene: Some(scene), slices })
}

fn write(c: &Content, folder: &Path) -> std::io::Result<()> {
    std::fs::create_dir_all(folder)?;
    let pictures = charts::all(c);
    for (name, svg) in &pictures {
        std::fs::write(folder.join(name).with_extension("svg"), svg)?;
    }
    for s in c.slices.iter().flat_map(|s| &s.3) {
        std::fs::write(folder.join(format!("solid-fraction-{}{}.png", s.axes[0], s.axes[1])), &s.png)?;
    }
    let page = html::page(c, &pictures)?;
    std::fs::write(folder.join("report.html"), page)
}
