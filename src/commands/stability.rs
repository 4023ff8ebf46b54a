// SPDX-License-Identifier: MIT OR Apache-2.0
//! `voidage stability FILE|CASE`.

use super::record::{fail, of_file};
use super::{BAD_INPUT, FAILED, OK, overrides, print};
use crate::auto;
use crate::config::Problem;
use crate::inspect::recorded;
use crate::record::moment::Moments;
use crate::record::{Reader, RecordError, replay};
use crate::scheme;
use crate::stability::{Growth, NEUTRAL, Scene, picture};
use std::path::{Path, PathBuf};

/// Exchanges of a recording that are looked at.
const EXCHANGES: usize = 8;

/// What is asked of the command.
pub struct Options<'a> {
    /// section.key=value
    pub set: &'a [String],
    /// the exchange to look at; none: several
    pub exchange: Option<i64>,
    /// this scheme alone
    pub scheme: Option<&'a str>,
    /// FOLDER for stability-free.svg, stability-held.svg
    pub map: Option<&'a Path>,
    /// all numbers
    pub json: Option<&'a Path>,
}

/// The recording meant by a file or a case folder.
pub(super) fn recording(path: &Path) -> Result<PathBuf, u8> {
    if !path.is_dir() {
        return Ok(path.to_path_buf());
    }
    let file = path.join("recording.voidage");
    if file.is_file() {
        return Ok(file);
    }
    eprintln!(
        "error: {}: a folder without recording.voidage; record exchanges first (voidage run {} --set record.last=2)",
        path.display(),
        path.display()
    );
    Err(BAD_INPUT)
}

/// `voidage stability FILE|CASE`
pub fn stability(path: &Path, o: &Options) -> u8 {
    let path = match recording(path) {
        Ok(p) => p,
        Err(code) => return code,
    };
    let set = match overrides(o.set) {
        Ok(s) => s,
        Err(p) => {
            print(&p);
            return BAD_INPUT;
        }
    };
    if let Some(name) = o.scheme.filter(|n| scheme::by_name(n).is_none()) {
        let names: Vec<_> = scheme::all().iter().map(|s| s.name()).collect();
        print(&[Problem::error(
            "--scheme",
            name,
            &format!("one of {}", names.join(", ")),
            "--scheme explicit",
        )]);
        return BAD_INPUT;
    }
    let reader = match Reader::open(&path) {
        Ok(r) => r,
        Err(e) => return of_file(&path, e),
    };
    let config = match replay::case(&reader, &set) {
        Ok(c) => c,
        Err(e) => return fail(&e),
    };
    let mut m = match Moments::new(reader) {
        Ok(m) => m,
        Err(e) => return of_file(&path, e),
    };
    let scales = match recorded::scene(&mut m, &config) {
        Ok(s) => s,
        Err(e) => return of_file(&path, e),
    };
    let list = match chosen(&m, o.exchange) {
        Ok(l) => l,
        Err(code) => return code,
    };
    let tau_p = if scales.relaxation.is_empty() { scales.stokes_time() } else { scales.relaxation.mean };
    let tau_f = scales.fluid_relaxation.unwrap_or(tau_p);
    let (low, high) = (0.02 * tau_f.min(config.period()), 1e3 * tau_f.max(config.period()));
    let first = list[0];
    let mut growths: Vec<Growth> = Vec::new();
    for k in list.iter().copied() {
        let moment = m.exchange(k).and_then(|f| f.ok_or(RecordError::NoExchange));
        let read = moment.and_then(|f| Ok((f.particles()?, f.fluid(&m.mesh)?, f.on)));
        let (particles, fluid, on) = match read {
            Ok(x) => x,
            Err(e) => return of_file(&path, e),
        };
        let mut config = config.clone();
        if let Some(bits) = on {
            auto::put(&mut config.file, bits);
        }
        let (config, particles, fluid) = (&config, &particles, &fluid.velocity[..]);
        let scene = Scene { exchange: k, config, mesh: &m.mesh, particles, fluid };
        let done = if growths.is_empty() {
            println!(
                "{}: exchanges {list:?}, {} particles, {} cells; fluid step {:.3e} s = {} DEM steps",
                path.display(),
                particles.len(),
                m.mesh.len(),
                config.period(),
                config.file.coupling.interval
            );
            let all = scene.all(o.scheme, low, high, &mut |scheme, held| {
                eprintln!("  exchange {k}: {scheme}, particles {} …", if held { "held" } else { "free" });
            });
            all.map(|g| growths = g)
        } else {
            eprintln!("  exchange {k} …");
            growths.iter_mut().try_for_each(|g| scene.lower(g, low, high))
        };
        if let Err(e) = done {
            eprintln!("error: {e}");
            return FAILED;
        }
    }
    let list = growths;
    let marks = marks(&scales, config.period());
    show(&list, &marks, high, config.file.dem.time_step, first);
    if let Err(e) = write(&list, &marks, o) {
        eprintln!("error: {e}");
        return FAILED;
    }
    OK
}

/// Exchanges to look at: the one asked for, or up to `EXCHANGES` spread over the recording, the last one first.
fn chosen<R: std::io::Read + std::io::Seek>(m: &Moments<R>, asked: Option<i64>) -> Result<Vec<i64>, u8> {
    let all: Vec<i64> = m.exchanges.iter().map(|e| e.0).filter(|k| *k > 0).collect();
    let n = EXCHANGES.min(all.len());
    let list: Vec<i64> = match asked {
        Some(k) => vec![k],
        None => (1..=n).rev().map(|i| all[i * all.len() / n - 1]).collect(),
    };
    if list.is_empty() || list.iter().any(|k| !all.contains(k)) {
        let given = asked.map_or("none".into(), |k| k.to_string());
        let accepted = format!("the recording has exchanges {all:?} with a fluid step before them");
        print(&[Problem::error("--exchange", given, &accepted, "--exchange K with one of them")]);
        return Err(BAD_INPUT);
    }
    Ok(list)
}

/// R's time scales and the step of the run, s.
fn marks(s: &crate::inspect::Scene, period: f64) -> Vec<(&'static str, f64)> {
    let mut list = vec![("fluid step of the run", period), ("tau_p, Stokes (R eq. 9)", s.stokes_time())];
    list.extend(s.fluid_relaxation.map(|t| ("tau_f (R eq. 10)", t)));
    list.extend(s.courant_time().map(|t| ("tau_Co, Courant 0.5 (R eq. 11)", t)));
    list
}

fn show(list: &[Growth], marks: &[(&str, f64)], high: f64, dem_step: f64, first: i64) {
    println!(
        "largest stable fluid step, s (coupling.interval at this DEM step), by growth per exchange ≤ {NEUTRAL}:"
    );
    println!("  {:24} {:>28} {:>28}", "scheme", "particles free", "particles held");
    let text = |g: &Growth| match g.limit {
        None => format!("none up to {high:.1e}"),
        Some(t) if t > 0.0 => {
            let most = g.found.iter().map(|f| f.1).fold(t, f64::max);
            let range = match g.found.first() {
                Some(f) if f.0 != first => " .. none".into(),
                _ if most > 1.02 * t => format!(" .. {most:.2e}"),
                _ => String::new(),
            };
            format!("{t:.3e}{range} ({})", (t / dem_step).floor())
        }
        Some(_) => format!("below {:.1e}", g.points[0].0),
    };
    for g in list.iter().filter(|g| !g.held) {
        let held = list.iter().find(|h| h.held && h.scheme == g.scheme).map(text).unwrap_or_default();
        println!("  {:24} {:>28} {held:>28}", g.scheme, text(g));
    }
    println!("time scales, s:");
    for (name, t) in marks {
        println!("  {name:32} {t:.3e}");
    }
    println!(
        "The fluid's own limits (Courant number) come on top. Held: contacts keep the particles where they are, as in a packed bed."
    );
}

fn write(list: &[Growth], marks: &[(&str, f64)], o: &Options) -> std::io::Result<()> {
    if let Some(folder) = o.map {
        std::fs::create_dir_all(folder)?;
        for (held, name) in [(false, "stability-free.svg"), (true, "stability-held.svg")] {
            std::fs::write(folder.join(name), picture(list, marks, held))?;
        }
        println!("maps: {}", folder.join("stability-free.svg").display());
    }
    let Some(file) = o.json else { return Ok(()) };
    let one = |g: &Growth| serde_json::json!({"scheme": g.scheme, "held": g.held, "limit_s": g.limit, "by_exchange": g.found, "points": g.points});
    let scales: serde_json::Map<_, _> = marks.iter().map(|m| (m.0.to_string(), m.1.into())).collect();
    let all =
        serde_json::json!({"growth": list.iter().map(one).collect::<Vec<_>>(), "time_scales_s": scales});
    std::fs::write(file, serde_json::to_string_pretty(&all).map_err(std::io::Error::other)?)
}
