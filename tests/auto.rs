// SPDX-License-Identifier: MIT OR Apache-2.0
//! `[auto]`: scenes differ in what is chosen; choices are kept where the user has one, switched with hysteresis during a
//! run, recorded, and cost no more accuracy than was asked.

mod common;

use common::folder::Scratch;
use common::folder::{copy, root};
use common::partners::{case, record};
use std::collections::BTreeMap;
use std::io::Cursor;
use std::path::Path;
use voidage::auto::{self, Plan, Watch};
use voidage::config::{self, Compression, Config, Feedback, Model};
use voidage::inspect::decide::{Choice, choose, hysteresis};
use voidage::inspect::measure::{Before, Sums, View};
use voidage::inspect::recorded::{scene, unmeasured};
use voidage::locate::Locator;
use voidage::mesh::NONE;
use voidage::record::Reader;
use voidage::record::moment::Moments;
use voidage::record::replay::{Options, Outcome, replay};

fn pairs(set: &[(&str, &str)]) -> Vec<(String, String)> {
    set.iter().map(|(k, v)| ((*k).to_string(), (*v).to_string())).collect()
}

/// What auto makes of a case folder.
fn chosen(folder: &Path, set: &[(&str, &str)]) -> (Config, Plan) {
    let mut c = config::load(folder, &pairs(set)).unwrap();
    let plan = auto::resolve(&mut c).unwrap().unwrap();
    (c, plan)
}

/// term → choice
fn choices(p: &Plan) -> BTreeMap<&str, &str> {
    p.rows.iter().map(|r| (r.term, r.choice)).collect()
}

const JET: &str = r#"
format = 1
[fluid]
density = 1.2
kinematic_viscosity = 1.5e-5
gravity = [0.0, -9.81, 0.0]
[dem]
script = "particles.in"
time_step = 1e-6
[coupling]
interval = 10
[smooth]
[forces]
drag = "schiller-naumann"
"#;

/// A jet of 20 m/s in a 40 mm box of 1.25 mm cells, with 2000 spheres of 50 microns: solid fraction 2e-6.
fn jet(folder: &Path) {
    copy(&root().join("cases/settling/fluid"), &folder.join("fluid"));
    let edit = |file: &str, old: &str, new: &str| {
        let file = folder.join("fluid").join(file);
        let text = std::fs::read_to_string(&file).unwrap();
        assert!(text.contains(old), "{}: {old}", file.display());
        std::fs::write(&file, text.replace(old, new)).unwrap();
    };
    let old = |file: &str, key: &str| {
        let text = std::fs::read_to_string(folder.join("fluid").join(file)).unwrap();
        text.lines().find(|l| l.trim_start().starts_with(key)).unwrap().to_string()
    };
    edit("0/U", &old("0/U", "internalField"), "internalField uniform (0 20 0);");
    let mesh = "convertToMeters 0.04;\nvertices ((0 0 0) (1 0 0) (1 1 0) (0 1 0) (0 0 1) (1 0 1) (1 1 1) (0 1 1));\n\
                blocks (hex (0 1 2 3 4 5 6 7) (32 32 32) simpleGrading (1 1 1));\n";
    std::fs::write(folder.join("fluid/system/blockMeshDict"), mesh).unwrap();
    std::fs::write(folder.join("case.toml"), JET).unwrap();
    let script = "units si\nfix seeds all particletemplate/sphere 1 atom_type 1 density constant 2500 radius constant 2.5e-5\n\
                  fix fill all insert/pack seed 1 distributiontemplate d insert_every once particles_in_region 2000 region box\n\
                  timestep 1e-6\nfix voidage all voidage\nrun 1000000\n";
    std::fs::write(folder.join("particles.in"), script).unwrap();
}

#[test]
fn four_scenes_are_modelled_differently() {
    let cases = root().join("cases");
    let ask = &[("auto.accuracy", "3e-2")];
    let folder = Scratch::new("auto-jet");
    jet(&folder.0);
    let (sphere, s) = chosen(&cases.join("settling"), ask);
    let (jet, j) = chosen(&folder.0, ask);
    let (packed, p) = chosen(&cases.join("ergun/random"), ask);
    let (bed, b) = chosen(&cases.join("fluidised-bed"), ask);
    // one sphere: it gives the fluid nothing, and no cell sees it
    assert_eq!((sphere.file.coupling.feedback, sphere.file.coupling.model), (Feedback::OneWay, Model::B));
    assert!(sphere.file.forces.history && !sphere.file.forces.pressure_gradient, "{s}");
    assert_eq!(sphere.file.smooth.method, "none", "the case says so");
    // a dilute jet: as little, but in cells that a particle would fill in part; a gas has no memory
    assert_eq!((jet.file.coupling.feedback, jet.file.coupling.model), (Feedback::OneWay, Model::B), "{j}");
    assert!(jet.file.smooth.method == "gaussian" && !jet.file.forces.history, "{j}");
    assert!((jet.file.smooth.bandwidth / 2e-4 - 1.0).abs() < 1e-9, "four diameters where none is given: {j}");
    // packed and bubbling: both ways, smoothed, with the pressure gradient
    for (c, plan) in [(&packed, &p), (&bed, &b)] {
        assert_eq!((c.file.coupling.feedback, c.file.coupling.model), (Feedback::TwoWay, Model::A), "{plan}");
        assert!(c.file.smooth.method == "gaussian" && c.file.forces.pressure_gradient, "{plan}");
    }
    // they differ in what a liquid-like density ratio (1/200) and a gas (1/830) ask for
    assert!(packed.file.forces.history && !bed.file.forces.history, "{p}{b}");
    let all = [choices(&s), choices(&j), choices(&p), choices(&b)];
    for (n, one) in all.iter().enumerate() {
        assert!(all[..n].iter().all(|other| other != one), "{n}: {one:?}");
    }
    // what is clearly off costs nothing: no memory is exchanged, no gradient sent
    let told = |c: &Config| voidage::setup::welcome(c, None).settings;
    assert_eq!(told(&sphere)["send.pressure_gradient"], 0.0);
    assert_eq!(told(&bed)["drive.memory"], 34.0, "ready: {b}");
    let (coarse, plan) = chosen(&cases.join("fluidised-bed"), &[("auto.accuracy", "0.4")]);
    assert_eq!(told(&coarse)["drive.memory"], 0.0, "{plan}");
    assert_eq!(told(&coarse)["drive.added_mass"], 0.0, "{plan}");
}

#[test]
fn what_the_user_has_set_stays() {
    let bed = root().join("cases/fluidised-bed");
    let set = [("auto.accuracy", "1e-3"), ("forces.history", "false"), ("coupling.feedback", "one-way")];
    let (c, plan) = chosen(&bed, &[&set[..], &[("auto.keep", "[\"forces.lift\"]")]].concat());
    assert!(!c.file.forces.history && c.file.forces.lift == "none", "{plan}");
    assert_eq!(c.file.coupling.feedback, Feedback::OneWay);
    let of = choices(&plan);
    for term in ["history (Basset)", "lift", "feedback on the fluid"] {
        assert_eq!(of[term], "given", "{plan}");
    }
    let auto = c.file.auto.as_ref().unwrap();
    assert_eq!(auto.live, ["forces.added_mass"], "{plan}");
    // the resolved case tells the coupler so, whichever way the user had said it
    assert!(
        ["forces.history", "forces.lift", "coupling.feedback"]
            .iter()
            .all(|k| auto.keep.iter().any(|x| x == k))
    );
    // without the section nothing is chosen
    let mut plain = config::load(&bed, &[]).unwrap();
    let before = toml::to_string(&plain.file).unwrap();
    assert!(auto::resolve(&mut plain).unwrap().is_none());
    assert_eq!(toml::to_string(&plain.file).unwrap(), before);
    assert!(Watch::new(&plain).is_none());
}

#[test]
fn a_force_that_would_be_unstable_or_impossible_is_missing() {
    let bed = root().join("cases/fluidised-bed");
    // in water the explicit history force runs away
    let water =
        [("auto.accuracy", "1e-2"), ("fluid.density", "1000.0"), ("fluid.kinematic_viscosity", "1e-6")];
    let (c, plan) =
        chosen(&bed, &[&water[..], &[("coupling.interval", "400"), ("dem.force", "constant")]].concat());
    assert!(!c.file.forces.history && !c.file.forces.added_mass.on(), "{plan}");
    let of = choices(&plan);
    assert_eq!((of["history (Basset)"], of["added mass"]), ("missing", "missing"), "{plan}");
    let text = plan.to_string();
    assert!(
        text.contains("would need a fluid step of at most") && text.contains("dem.force = \"implicit\""),
        "{text}"
    );
}

#[test]
fn between_a_third_of_the_accuracy_and_the_accuracy_nothing_changes() {
    for (before, relative, after) in [
        (false, 0.9e-2, false),
        (true, 0.9e-2, true),
        (true, 0.34e-2, true),
        (true, 0.33e-2, false),
        (false, 1.1e-2, true),
        (true, f64::NAN, true),
        (false, f64::NAN, false),
    ] {
        assert_eq!(hysteresis(before, relative, 1e-2), after, "{before} {relative}");
    }
}

/// A recorded run of 9 exchanges, in which all three forces may be switched; `start`: those on from the start.
fn run(name: &str, set: &[(&str, &str)], start: &[&str], ranks: [usize; 2]) -> Vec<u8> {
    let s = Scratch::new(&format!("auto-{name}"));
    let mut c = case(set, 9);
    c.file.auto.as_mut().unwrap().live = auto::SWITCHES.iter().map(|s| s.key.into()).collect();
    start.iter().for_each(|key| auto::set(&mut c.file.forces, key, true));
    record(&s.0, &c, 9, ranks, Compression::Lz4);
    std::fs::read(&s.0).unwrap()
}

type Bytes = Cursor<Vec<u8>>;

fn open(bytes: &[u8]) -> Reader<Bytes> {
    Reader::new(Cursor::new(bytes.to_vec()), "bytes").unwrap()
}

fn moments(bytes: &[u8]) -> Moments<Bytes> {
    Moments::new(open(bytes)).unwrap()
}

/// Exchange and forces in force, as recorded.
fn in_force(bytes: &[u8]) -> Vec<(i64, Option<u32>)> {
    let mut m = moments(bytes);
    (0..m.exchanges.len()).map(|n| m.at(n).unwrap().unwrap()).map(|x| (x.k, x.on)).collect()
}

fn again(bytes: &[u8], set: &[(&str, &str)], save: Option<&Path>) -> Outcome {
    let overrides = pairs(set);
    let options =
        Options { overrides: &overrides, reference: None, save: save.map(|p| (p, Compression::None)) };
    replay(open(bytes), options, &mut |_| {}).unwrap()
}

/// Magnitude of lift, added mass and history in exchange 1 of a run, as the run measures them.
fn magnitudes(bytes: &[u8], c: &Config) -> [f64; 3] {
    let mut m = moments(bytes);
    let earlier = m.at(0).unwrap().unwrap();
    let x = m.at(1).unwrap().unwrap();
    let mesh = &m.mesh;
    let before = Before::of(&earlier.particles().unwrap(), &earlier.fluid(mesh).unwrap().velocity);
    let mut p = x.particles().unwrap();
    let (fluid, sources, drive) = (x.fluid(mesh).unwrap(), x.sources(mesh).unwrap(), x.drive(&p).unwrap());
    let mut hosts = vec![NONE; p.len()];
    Locator::new(mesh).locate(mesh, &mut p.position, &mut hosts).unwrap();
    let view = View {
        mesh,
        particles: &p,
        hosts: &hosts,
        fluid: &fluid,
        sources: &sources,
        drive: &drive,
        before: Some(&before),
    };
    let (mut s, mut sums) = (unmeasured(mesh, c), Sums::default());
    sums.add(&mut s, &view, c, voidage::forces::by_name(&c.file.forces.drag));
    sums.terms(&mut s, c);
    ["lift", "added mass", "history (Basset)"].map(|n| s.terms.iter().find(|t| t.name == n).unwrap().relative)
}

#[test]
fn forces_are_switched_during_a_run_alike_on_any_ranks_and_replayed_to_the_bit() {
    let plain = run("plain", &[("record.first", "2"), ("auto.every", "0")], &[], [1, 1]);
    let m = magnitudes(&plain, &case(&[], 9));
    assert!(m.iter().all(|x| *x > 1e-12), "{m:?}");
    // between the largest and the others
    let most = m.iter().copied().fold(0.0, f64::max);
    let accuracy = format!("{:e}", 0.2 * most);
    let set = [("auto.accuracy", &*accuracy), ("auto.every", "2")];
    let all = run("all", &[&set[..], &[("record.every", "1")]].concat(), &[auto::LIFT], [1, 1]);
    let on = in_force(&all);
    // lift was on at the start; exchange 1 is measured, its choice holds from 2 on
    assert_eq!(on[..2], [(0, Some(1)), (1, Some(1))], "{m:?}");
    assert!(on[2].1 != Some(1), "{m:?} {accuracy} {on:?}");
    // other ranks, with gaps in the recording: the same choices
    let gaps = run(
        "gaps",
        &[&set[..], &[("record.every", "3"), ("record.last", "1")]].concat(),
        &[auto::LIFT],
        [3, 2],
    );
    let other = in_force(&gaps);
    assert_eq!(other.iter().map(|x| x.0).collect::<Vec<_>>(), [0, 3, 6, 9]);
    assert!(other.iter().all(|x| on.contains(x)), "{on:?} {other:?}");
    for bytes in [&all, &gaps] {
        for threads in ["1", "4"] {
            let o = again(bytes, &[("run.threads", threads)], None);
            assert!(o.comparison.identical(), "{}", o.comparison);
        }
    }
    // it is the recorded choice that makes them so: with lift kept on they differ
    let o = again(&all, &[("forces.lift", "loth")], None);
    let force = &o.comparison.arrays[&voidage_wire::field::FORCE];
    assert!(o.comparison.alone.is_empty() && force.differing > 0, "{}", o.comparison);
    // a replay that is recorded holds the choices too
    let s = Scratch::new("auto-saved");
    again(&gaps, &[], Some(&s.0));
    assert_eq!(in_force(&std::fs::read(&s.0).unwrap()), other);
}

#[test]
fn what_cannot_be_switched_is_told_once() {
    let mut c =
        case(&[("auto.accuracy", "1e-4"), ("coupling.model", "B"), ("coupling.feedback", "one-way")], 9);
    (c.file.forces.pressure_gradient, c.file.forces.viscous_stress) = (false, false);
    let s = Scratch::new("auto-missing");
    record(&s.0, &case(&[("record.first", "2")], 9), 9, [1, 1], Compression::Lz4);
    let told = |c: &Config| {
        let mut m = moments(&std::fs::read(&s.0).unwrap());
        let x = m.at(1).unwrap().unwrap();
        let mut p = x.particles().unwrap();
        let mesh = &m.mesh;
        let (fluid, sources, drive) =
            (x.fluid(mesh).unwrap(), x.sources(mesh).unwrap(), x.drive(&p).unwrap());
        let mut hosts = vec![NONE; p.len()];
        Locator::new(mesh).locate(mesh, &mut p.position, &mut hosts).unwrap();
        let (particles, hosts) = (&p, &hosts[..]);
        let view =
            View { mesh, particles, hosts, fluid: &fluid, sources: &sources, drive: &drive, before: None };
        let mut watch = Watch::new(c).unwrap();
        let once: Vec<String> = watch.reconsider(1, &view).iter().map(ToString::to_string).collect();
        assert!(watch.reconsider(2, &view).is_empty(), "said once");
        once
    };
    let lines = told(&c);
    for (term, needed) in [
        ("solid fraction at the particles", "coupling.model = \"A\""),
        ("feedback on the fluid", "coupling.feedback = \"two-way\""),
        ("history (Basset)", "forces.history = true"),
    ] {
        let line = lines.iter().find(|l| l.contains(&format!("missing: {term} is "))).expect(term);
        assert!(line.contains(&format!("would need {needed} from the start")), "{line}");
    }
    // what the user has left out is not missed
    c.file.auto.as_mut().unwrap().keep = auto::KEYS.map(String::from).to_vec();
    assert_eq!(told(&c), Vec::<String>::new());
}

#[test]
fn within_the_band_a_run_keeps_what_it_has() {
    let plain = run("band", &[("record.first", "2"), ("auto.every", "0")], &[], [1, 1]);
    let [_, _, history] = magnitudes(&plain, &case(&[], 9));
    // the magnitude at exchange 1 lies in the middle of the band
    let accuracy = format!("{:e}", history * 1.7);
    let whole = [&[auto::HISTORY][..], &[]];
    for (start, bits) in [(whole[0], 4), (whole[1], 0)] {
        let set = [("auto.accuracy", &*accuracy), ("auto.every", "1000"), ("record.every", "1")];
        let bytes = run("keeps", &set, start, [1, 1]);
        let on = in_force(&bytes);
        assert!(on.iter().all(|x| x.1.unwrap() & 4 == bits), "{start:?}: {on:?}");
    }
    // well above and well below it they agree
    for (accuracy, bits) in [(history / 2.0, 4), (history * 10.0, 0)] {
        let accuracy = format!("{accuracy:e}");
        for start in whole {
            let set = [("auto.accuracy", &*accuracy), ("auto.every", "1000"), ("record.every", "1")];
            let bytes = run("parts", &set, start, [1, 1]);
            let on = in_force(&bytes);
            assert!(on[2..].iter().all(|x| x.1.unwrap() & 4 == bits), "{accuracy} {start:?}: {on:?}");
        }
    }
}

/// Force on each particle, K (u − v) + f in N, of all exchanges; and the rms of K (u − v) and of the weight.
fn forces(bytes: &[u8]) -> (Vec<[f64; 3]>, f64) {
    let mut m = moments(bytes);
    let (mut list, mut drag, mut weight) = (Vec::new(), 0.0, 0.0);
    // the last one has no reply to the particles
    for n in 0..m.exchanges.len() - 1 {
        let x = m.at(n).unwrap().unwrap();
        let p = x.particles().unwrap();
        let d = x.drive(&p).unwrap();
        for i in 0..p.len() {
            let k = [0, 1, 2].map(|a| d.drag_coefficient[i] * (d.velocity[i][a] - p.velocity[i][a]));
            drag += k.iter().map(|x| x * x).sum::<f64>();
            weight += (9.81 * p.mass[i]).powi(2);
            list.push([0, 1, 2].map(|a| k[a] + d.force[i][a]));
        }
    }
    let scale = (f64::max(drag, weight) / list.len() as f64).sqrt();
    (list, scale)
}

#[test]
fn replies_stay_within_the_accuracy_against_everything_on() {
    let everything = [("forces.lift", "loth"), ("forces.added_mass", "0.5"), ("forces.history", "true")];
    let s = Scratch::new("auto-everything");
    let c = case(&[&everything[..], &[("record.every", "1")]].concat(), 9);
    record(&s.0, &c, 9, [1, 1], Compression::Lz4);
    let full = std::fs::read(&s.0).unwrap();
    let measured = scene(&mut moments(&full), &c).unwrap();
    let (due, scale) = forces(&full);
    let mut kinds = Vec::new();
    for accuracy in [1e-6, 1e-4, 1e-3, 1e-2, 1e-1] {
        let off: Vec<_> = auto::SWITCHES
            .iter()
            .filter(|s| {
                let term = measured.terms.iter().find(|t| t.name == s.term).unwrap();
                choose(term, accuracy) == Choice::Off
            })
            .map(|s| {
                (
                    s.key,
                    auto::setting(s.key, false).split_once(" = ").unwrap().1.trim_matches('"').to_string(),
                )
            })
            .collect();
        let set: Vec<_> = off.iter().map(|(k, v)| (*k, &**v)).collect();
        let saved = Scratch::new("auto-choice");
        again(&full, &set, Some(&saved.0));
        let (got, _) = forces(&std::fs::read(&saved.0).unwrap());
        let square: f64 =
            got.iter().zip(&due).map(|(a, b)| (0..3).map(|x| (a[x] - b[x]).powi(2)).sum::<f64>()).sum();
        let error = (square / due.len() as f64).sqrt() / scale;
        assert!(error <= accuracy, "{accuracy:e}: {error:e} without {set:?}");
        assert_eq!(error > 0.0, !set.is_empty(), "what is off shows");
        kinds.push(set.len());
    }
    assert!(kinds.first() == Some(&0) && *kinds.last().unwrap() > 0, "{kinds:?}");
}
