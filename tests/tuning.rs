// SPDX-License-Identifier: MIT OR Apache-2.0
//! `voidage tune`: what it chooses is as exact as it says, by replays of its own; it chooses nothing dearer than needed.

mod common;

use common::folder::Scratch;
use common::partners::{case, record};
use std::io::Cursor;
use voidage::config::Compression;
use voidage::record::Reader;
use voidage::record::compare::Replies;
use voidage::record::moment::{Messages, Moments};
use voidage::record::replay::{self, Options, Start, each, replay};
use voidage::tune::{Ask, Table, choose, settings::Part, tune};
use voidage::{map, smooth};

type Bytes = Cursor<Vec<u8>>;

fn recorded(name: &str, set: &[(&str, &str)], steps: i64) -> Vec<u8> {
    let s = Scratch::new(&format!("tuning-{name}"));
    record(&s.0, &case(set, steps), steps, [2, 2], Compression::None);
    std::fs::read(&s.0).unwrap()
}

fn open(bytes: &[u8]) -> Reader<Bytes> {
    Reader::new(Cursor::new(bytes.to_vec()), "bytes").unwrap()
}

fn table(bytes: &[u8], accuracy: f64, only: Vec<Part>) -> Table {
    let ask = Ask { base: &[], accuracy, exchanges: 4, only };
    tune(&|| Ok(open(bytes)), &ask, &mut |_| {}).unwrap()
}

/// Overrides that a case section stands for.
fn overrides(section: &str) -> Vec<(String, String)> {
    let table: toml::Table = toml::from_str(section).unwrap();
    let keys = |(section, keys): (&String, &toml::Value)| {
        let keys = keys.as_table().unwrap().clone();
        let section = section.clone();
        keys.into_iter().map(move |(k, v)| (format!("{section}.{k}"), v.to_string()))
    };
    table.iter().flat_map(keys).collect()
}

/// The replay with these settings, recorded.
fn saved(name: &str, bytes: &[u8], set: &[(String, String)]) -> Vec<u8> {
    let s = Scratch::new(&format!("tuning-{name}"));
    let _ = std::fs::remove_file(&s.0);
    let options = Options { overrides: set, reference: None, save: Some((&s.0, Compression::None)) };
    replay(open(bytes), options, &mut |_| {}).unwrap();
    std::fs::read(&s.0).unwrap()
}

/// Voidage, forces and momentum sources of the last `n` exchanges, from the messages.
fn effects(bytes: &[u8], n: usize) -> [Vec<f64>; 3] {
    let mut m = Moments::new(open(bytes)).unwrap();
    let mut all = [Vec::new(), Vec::new(), Vec::new()];
    for i in m.exchanges.len() - n..m.exchanges.len() {
        let x: Messages = m.at(i).unwrap().unwrap();
        let (p, fluid, q) = (x.particles().unwrap(), x.fluid(&m.mesh).unwrap(), x.sources(&m.mesh).unwrap());
        let d = x.drive(&p).unwrap();
        all[0].extend(&q.voidage);
        for (i, k) in d.drag_coefficient.iter().enumerate() {
            all[1].extend((0..3).map(|a| k * (d.velocity[i][a] - p.velocity[i][a]) + d.force[i][a]));
        }
        for (j, u) in fluid.velocity.iter().enumerate() {
            all[2].extend((0..3).map(|a| q.su[j][a] - q.sp[j] * u[a]));
        }
    }
    all
}

fn distance(got: &[f64], due: &[f64]) -> f64 {
    assert_eq!(got.len(), due.len());
    let gap: f64 = got.iter().zip(due).map(|(a, b)| (a - b) * (a - b)).sum();
    (gap / due.iter().map(|b| b * b).sum::<f64>()).sqrt()
}

#[test]
fn what_is_chosen_is_as_exact_as_asked_and_a_looser_accuracy_is_never_dearer() {
    let bytes = recorded("choice", &[("record.every", "1")], 8);
    let t = table(&bytes, 1e-5, Vec::new());
    let mut before = f64::INFINITY;
    for accuracy in [1e-5, 1e-3, 1e-2] {
        let p = choose(&t.points, accuracy).unwrap();
        assert!(p.ms <= before && p.error <= accuracy, "{accuracy}: {p:?}");
        before = p.ms;
        // by replays and norms of our own, against another series for the same operator
        let set = p.settings.overrides(&[]);
        let mut exact = set.clone();
        exact.push(("smooth.method".into(), "uniformization".into()));
        exact.push(("smooth.tolerance".into(), "1e-12".into()));
        let (got, due) = (saved("got", &bytes, &set), saved("due", &bytes, &exact));
        let (got, due) = (effects(&got, 4), effects(&due, 4));
        let errors = [0, 1, 2].map(|i| distance(&got[i], &due[i]));
        let told = [p.numerical.voidage, p.numerical.force, p.numerical.source].map(|e| e.l2);
        for (e, t) in errors.iter().zip(told) {
            assert!((e - t).abs() <= 1e-3 * t + 1e-10, "{errors:?} {told:?}");
            assert!(*e <= accuracy);
        }
        assert!(errors.iter().any(|e| *e > 1e-13), "nothing was compared: {errors:?}");
    }
    // the section sets what was chosen
    let (chosen, section) = (t.chosen.unwrap(), t.section.unwrap());
    let c = replay::case(&open(&bytes), &overrides(&section)).unwrap();
    let f = &c.file;
    let s = &chosen.settings;
    assert_eq!((&f.map.method, &f.smooth.method), (&s.mapping, &s.smoother));
    assert_eq!((f.smooth.tolerance, f.smooth.bandwidth), (s.tolerance, 4e-3));
    assert_eq!(f.interpolate.fluid_velocity, s.interpolation);
    // every mapping and smoother was measured, or it is told why not
    let text = |name: &str| t.skipped.iter().any(|s| s.0.contains(name));
    for m in map::all() {
        assert!(t.points.iter().any(|p| p.settings.mapping == m.name()) || text(m.name()), "{}", m.name());
    }
    for name in smooth::NAMES {
        assert!(t.points.iter().any(|p| p.settings.smoother == *name) || text(name), "{name}");
    }
    // the deposit at the host cell is farther from the Gaussians than linear weights
    let model = |name: &str| {
        t.points.iter().find(|p| p.settings.mapping == name).and_then(|p| p.model_of_mapping).unwrap().l2
    };
    assert!(model("particle-centroid") > model("linear") && model("linear") > 0.0);
    assert!(t.gaussian.contains("quadrature"), "{}", t.gaussian);
    assert!(t.estimates.schemes.len() > 3 && t.estimates.intervals.len() == 2, "{:?}", t.estimates);
}

#[test]
fn only_what_is_asked_for_is_varied() {
    let bytes = recorded("only", &[("record.last", "3"), ("map.method", "linear")], 5);
    let t = table(&bytes, 1e-2, vec![Part::Smoother]);
    assert!(t.points.iter().all(|p| p.settings.mapping == "linear" && p.settings.interpolation == "gather"));
    assert!(t.points.len() > smooth::NAMES.len());
    let t = table(&bytes, 1e-2, vec![Part::Interpolation]);
    assert_eq!(t.points.len(), 3);
    assert!(t.points.iter().all(|p| p.settings.smoother == smooth::DEFAULT));
    assert!(
        t.to_string().contains("the case") && serde_json::to_string(&t).unwrap().contains("\"numerical\"")
    );
}

#[test]
fn a_replay_from_the_middle_has_the_bits_of_the_run() {
    let set = &[("record.every", "1"), ("forces.added_mass", "0.5")];
    let bytes = recorded("middle", set, 7);
    for n in [1, 3, 6] {
        let start = Start::last(open(&bytes), n).unwrap().unwrap();
        assert_eq!(start.k, 8 - n as i64);
        let mut seen = Vec::new();
        let o = each(open(&bytes), &[], None, Some(&start), &mut |x| {
            let of = |m| Replies::of(m, &x.mesh.slots, x.mesh.len()).unwrap();
            assert!(of(x.anew) == of(x.recorded), "exchange {}", x.k);
            seen.push(x.k);
            Ok(true)
        });
        assert_eq!(o.unwrap().exchanges, n as u64);
        assert_eq!(seen, (8 - n as i64..8).collect::<Vec<_>>());
    }
    assert_eq!(Start::last(open(&bytes), 8).unwrap(), None);
}

#[test]
fn the_command_writes_the_section_and_says_what_is_wrong() {
    let (file, section, json) = (
        Scratch::new("tuning-command"),
        Scratch::new("tuning-command.toml"),
        Scratch::new("tuning-command.json"),
    );
    record(&file.0, &case(&[("record.last", "3")], 4), 4, [1, 1], Compression::Lz4);
    let name = file.0.display().to_string();
    let run = |more: &[&str]| {
        let o = std::process::Command::new(env!("CARGO_BIN_EXE_voidage"))
            .args(["tune", &name])
            .args(more)
            .output()
            .unwrap();
        let text = format!("{}{}", String::from_utf8_lossy(&o.stdout), String::from_utf8_lossy(&o.stderr));
        (o.status.code().unwrap(), text)
    };
    for (arguments, words) in [
        (&["--accuracy", "0"][..], "--accuracy = 0: a relative error between 0 and 1; type --accuracy 1e-3"),
        (&["--accuracy", "2"], "--accuracy = 2:"),
        (&["--accuracy", "nan"], "--accuracy = NaN:"),
        (&["--accuracy", "1e-3", "--exchanges", "1"], "at least 2"),
        (&["--accuracy", "1e-3", "--only", "colour"], "accepted: mapping, smoother, interpolation"),
        (&["--accuracy", "1e-3", "--set", "dem.script=x"], "a replay cannot change it"),
    ] {
        let (code, text) = run(arguments);
        assert!(code == 2 && text.contains(words), "{arguments:?}: {code} {text}");
    }
    let (to, numbers) = (section.0.display().to_string(), json.0.display().to_string());
    let (code, text) = run(&["--accuracy", "1e-3", "--only", "smoother", "--write", &to, "--json", &numbers]);
    assert!(code == 0 && text.contains("cheapest within 1e-3"), "{code} {text}");
    let section = std::fs::read_to_string(&section.0).unwrap();
    assert!(text.contains(&section));
    let set: Vec<String> = overrides(&section).iter().map(|(k, v)| format!("--set={k}={v}")).collect();
    let o = std::process::Command::new(env!("CARGO_BIN_EXE_voidage"))
        .args(["replay", &name])
        .args(&set)
        .output()
        .unwrap();
    assert_eq!(o.status.code(), Some(0), "{}", String::from_utf8_lossy(&o.stderr));
    let numbers: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(&json.0).unwrap()).unwrap();
    let chosen = &numbers["chosen"];
    assert!(chosen["error"].as_f64().unwrap() <= 1e-3 && chosen["ms"].as_f64().unwrap() > 0.0);
    // nothing is that exact
    let (code, text) = run(&["--accuracy", "1e-16", "--only", "interpolation"]);
    assert!(code == 1 && text.contains("no settings reach 1e-16"), "{code} {text}");
}
