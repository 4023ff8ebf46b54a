// SPDX-License-Identifier: MIT OR Apache-2.0
//! Commands and hooks of recordings: start and end of one in a run, `voidage replay`.

use super::{BAD_INPUT, FAILED, OK, overrides, print};
use crate::config::{Config, Problem};
use crate::output::restart::State;
use crate::record::moment::Moments;
use crate::record::replay::{self, Options, Outcome, ReplayError};
use crate::record::{Reader, RecordError, Recorder, Selection, SessionHead, forecast as sizes, write};
use std::path::Path;
use std::time::{Duration, Instant};
use voidage_wire::{PROTOCOL, Session};

/// Prints the size of the recording a case asks for.
pub(super) fn forecast(c: &Config) {
    if !Selection::of(c).any() {
        return;
    }
    match sizes::forecast(c) {
        Ok(f) => println!(
            "recording: {} exchanges of {} each, at most {} (before compression) in {}",
            f.exchanges,
            sizes::bytes(f.exchange),
            sizes::bytes(f.total),
            c.file.record.file.display()
        ),
        Err(e) => println!("recording: its size cannot be told before the start: {e}"),
    }
}

/// Before a run starts: the file must be new and the disk large enough. `from`: time of a restart, s.
pub(super) fn before(c: &Config, from: Option<f64>) -> Result<(), Problem> {
    if !Selection::of(c).any() {
        return Ok(());
    }
    forecast(c);
    let file = write::file(c, from);
    if file.exists() {
        let fix = "remove it, or record.file = \"another.voidage\"";
        return Err(Problem::error("record.file", file.display(), "a recording is never overwritten", fix));
    }
    let folder = file.parent().unwrap_or(&c.folder);
    if !folder.is_dir() {
        let accepted = format!("the folder {} does not exist", folder.display());
        return Err(Problem::error("record.file", file.display(), &accepted, "make the folder first"));
    }
    let free = rustix::fs::statvfs(folder).map(|s| s.f_bavail.saturating_mul(s.f_frsize));
    if let (Ok(f), Ok(free)) = (sizes::forecast(c), free)
        && f.total > free
    {
        let accepted = format!("the disk has room for {}", sizes::bytes(free));
        let n = (f.total / free.max(1) + 1) * u64::from(c.file.record.every.max(1));
        let fix = format!("record.every = {n}, or record.first and record.last alone");
        return Err(Problem::error("record", sizes::bytes(f.total), &accepted, fix));
    }
    Ok(())
}

/// Begins the recording of a run, if its case asks for one.
pub(super) fn start(
    c: &Config,
    session: &Session,
    resume: Option<&State>,
) -> Result<Option<Recorder>, String> {
    let selection = Selection::of(c);
    if !selection.any() {
        return Ok(None);
    }
    let head = SessionHead {
        program: env!("CARGO_PKG_VERSION").into(),
        protocol: PROTOCOL,
        token: session.token.clone(),
        dem_ranks: session.dem_ranks,
        cfd_ranks: session.cfd_ranks,
        origin: c.control.start,
        end: c.control.end,
        period: c.period(),
        resumed: resume.map(|s| s.exchange),
        text: 0,
    };
    let text = toml::to_string(&c.file).map_err(|e| e.to_string())?;
    let file = write::file(c, resume.map(|s| s.time));
    let r = Recorder::create(&file, selection, c.file.record.compression, head, &text);
    r.map(Some).map_err(|e| e.to_string())
}

/// Ends it. A run that failed keeps its own reason.
pub(super) fn finish(recorder: Option<&Recorder>, result: &Result<(), String>) -> Result<(), String> {
    let Some(r) = recorder else { return Ok(()) };
    match r.finish() {
        Ok((bytes, spent)) => {
            println!(
                "recording: {}, {:.3} s of the coupler's time",
                sizes::bytes(bytes),
                spent.as_secs_f64()
            );
            Ok(())
        }
        Err(e) if result.is_ok() => Err(e.to_string()),
        Err(_) => Ok(()),
    }
}

/// Prints an error; the exit code that fits.
pub(super) fn fail(e: &ReplayError) -> u8 {
    match e {
        ReplayError::Settings(p) => print(p),
        e => eprintln!("error: {e}"),
    }
    let own = matches!(e, ReplayError::Run(_) | ReplayError::Record(RecordError::Content { .. }));
    if own { FAILED } else { BAD_INPUT }
}

/// An error about a file.
pub(super) fn of_file(file: &Path, e: RecordError) -> u8 {
    let code = fail(&ReplayError::Run(format!("{}: {e}", file.display())));
    if matches!(e, RecordError::Content { .. }) { code } else { BAD_INPUT }
}

/// `voidage replay FILE`
pub fn replay(file: &Path, set: &[String], compare: Option<&Path>, save: Option<&Path>) -> u8 {
    let set = match overrides(set) {
        Ok(s) => s,
        Err(p) => {
            print(&p);
            return BAD_INPUT;
        }
    };
    let begin = Instant::now();
    match replayed(file, &set, compare, save) {
        Ok(o) => report(&o, file, compare, &set, begin.elapsed().as_secs_f64()),
        Err((e, of)) => {
            if let ReplayError::Record(e) = e {
                return of_file(&of, e);
            }
            fail(&e)
        }
    }
}

fn replayed(
    file: &Path,
    set: &[(String, String)],
    compare: Option<&Path>,
    save: Option<&Path>,
) -> Result<Outcome, (ReplayError, std::path::PathBuf)> {
    let whose = |path: &Path| {
        let path = path.to_path_buf();
        move |e: RecordError| (ReplayError::Record(e), path)
    };
    let reader = Reader::open(file).map_err(whose(file))?;
    let reference = match compare {
        None => None,
        Some(f) => Some(Reader::open(f).and_then(Moments::new).map_err(whose(f))?),
    };
    let mut said = Instant::now();
    let mut progress = |k: i64| {
        if said.elapsed() > Duration::from_secs(5) {
            said = Instant::now();
            eprintln!("exchange {k}");
        }
    };
    let how = crate::config::Compression::Lz4;
    let options = Options { overrides: set, reference, save: save.map(|p| (p, how)) };
    replay::replay(reader, options, &mut progress).map_err(|e| (e, file.to_path_buf()))
}

fn report(o: &Outcome, file: &Path, compare: Option<&Path>, set: &[(String, String)], wall: f64) -> u8 {
    let (first, last) = o.range.unwrap_or_default();
    println!("{}: {} exchanges, {first} to {last}", file.display(), o.exchanges);
    if let Some(at) = o.cut {
        println!(
            "the run was stopped while it was recorded: the file ends at byte {at}, after the exchanges above"
        );
    }
    let per = 1e3 * o.summary.coupler / o.exchanges as f64;
    let cpu = 1e3 * o.cpu / o.exchanges as f64;
    println!(
        "coupler {per:.3} ms per exchange with reading, {cpu:.3} ms of CPU without; replay {wall:.2} s in all"
    );
    let s = &o.seconds;
    let stages = [
        ("locate", s.locate),
        ("arrange", s.arrange),
        ("map", s.map),
        ("solids", s.solids),
        ("forces", s.forces),
        ("sources", s.sources),
        ("gather", s.gather),
        ("drive", s.drive),
    ];
    let text: Vec<String> =
        stages.iter().map(|(n, t)| format!("{n} {:.3}", 1e3 * t / o.exchanges as f64)).collect();
    println!("stages, ms per exchange: {}", text.join(", "));
    print!("{}", o.comparison);
    let with = compare.map_or_else(|| "the recorded ones".into(), |f| format!("those of {}", f.display()));
    if o.comparison.unmatched > 0 {
        println!("{} exchanges are not in {}", o.comparison.unmatched, compare.unwrap_or(file).display());
    }
    if o.comparison.identical() {
        println!("all replies are bit-identical with {with}");
        return OK;
    }
    println!("the replies differ from {with}");
    // other settings are asked for because they differ
    if set.is_empty() { FAILED } else { OK }
}
