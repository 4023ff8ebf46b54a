// SPDX-License-Identifier: MIT OR Apache-2.0
//! Recordings: what was recorded replays to the bit, damaged files are errors, settings can be changed.

mod common;

use common::folder::Scratch;
use common::partners::{case, record, record_in};
use std::io::Cursor;
use std::path::{Path, PathBuf};
use voidage::config::Compression;
use voidage::inspect::decide;
use voidage::inspect::recorded::scene as recorded_scene;
use voidage::output::export::{Format, export};
use voidage::record::exercise::exercise;
use voidage::record::moment::Moments;
use voidage::record::replay::{Options, Outcome, ReplayError, replay};
use voidage::record::{End, Reader, RecordError, forecast};

type Bytes = Cursor<Vec<u8>>;

fn recorded(name: &str, set: &[(&str, &str)], steps: i64, ranks: [usize; 2]) -> Vec<u8> {
    let s = Scratch::new(&format!("recording-{name}"));
    record(&s.0, &case(set, steps), steps, ranks, Compression::Lz4);
    s.bytes()
}

fn open(bytes: &[u8]) -> Result<Reader<Bytes>, RecordError> {
    Reader::new(Cursor::new(bytes.to_vec()), "bytes")
}

fn again(bytes: &[u8], set: &[(&str, &str)]) -> Result<Outcome, ReplayError> {
    let overrides: Vec<_> = set.iter().map(|(k, v)| ((*k).to_string(), (*v).to_string())).collect();
    let options = Options { overrides: &overrides, reference: None, save: None };
    replay(open(bytes)?, options, &mut |_| {})
}

const ALL: &[(&str, &str)] = &[("record.every", "1")];

#[test]
fn a_run_replays_to_the_bit_on_any_number_of_threads() {
    let bytes = recorded("threads", ALL, 8, [2, 2]);
    for threads in ["1", "4"] {
        let o = again(&bytes, &[("run.threads", threads)]).unwrap();
        assert_eq!((o.exchanges, o.range, o.cut), (9, Some((0, 8)), None));
        assert!(o.comparison.identical(), "{}", o.comparison);
        assert!(o.comparison.arrays.len() == 8, "{}", o.comparison);
        assert!(o.comparison.arrays.values().all(|d| d.values > 1000));
    }
}

#[test]
fn exchanges_without_their_predecessor_replay_to_the_bit() {
    let set =
        &[("record.every", "3"), ("record.last", "2"), ("forces.added_mass", "0.5"), ("forces.lift", "loth")];
    let bytes = recorded("every", set, 11, [2, 1]);
    let mut r = open(&bytes).unwrap();
    let (list, end) = r.exchanges().unwrap();
    assert_eq!(list.iter().map(|e| e.0).collect::<Vec<_>>(), [0, 3, 6, 9, 10, 11]);
    assert_eq!(end, End::Whole);
    let o = again(&bytes, &[]).unwrap();
    assert!(o.exchanges == 6 && o.comparison.identical(), "{}", o.comparison);
    // the state matters: another scheme of the same recording differs
    let o = again(&bytes, &[("forces.added_mass", "0.4")]).unwrap();
    assert!(o.exchanges == 6 && !o.comparison.identical());
}

#[test]
fn other_settings_are_replayed_and_their_difference_is_told() {
    let bytes = recorded("override", ALL, 4, [1, 1]);
    let o = again(&bytes, &[("smooth.method", "direct"), ("smooth.tolerance", "1e-12")]).unwrap();
    let e = o.comparison.arrays[&voidage_wire::field::VOIDAGE].relative();
    assert!(e > 1e-9 && e < 1e-2, "{}", o.comparison);
    // the replay, saved, is a recording whose replies are those of the other settings
    let s = Scratch::new("recording-saved");
    let overrides = vec![("smooth.method".to_string(), "direct".to_string())];
    let save = Some((s.0.as_path(), Compression::None));
    let options = Options { overrides: &overrides, reference: None, save };
    let first = replay(open(&bytes).unwrap(), options, &mut |_| {}).unwrap();
    assert!(!first.comparison.identical());
    let o = again(&s.bytes(), &[]).unwrap();
    assert!(o.exchanges == 5 && o.comparison.identical(), "{}", o.comparison);
    let reference = Some(Moments::new(open(&bytes).unwrap()).unwrap());
    let options = Options { overrides: &[], reference, save: None };
    let o = replay(open(&s.bytes()).unwrap(), options, &mut |_| {}).unwrap();
    let (a, b) = (&o.comparison.arrays, &first.comparison.arrays);
    assert!(a.iter().zip(b).all(|(a, b)| a.1.differing == b.1.differing && a.1.largest == b.1.largest));
}

#[test]
fn recordings_of_other_ranks_are_compared_by_cell_and_particle() {
    let (one, two) = (recorded("one", ALL, 1, [1, 1]), recorded("two", ALL, 1, [3, 2]));
    let reference = Some(Moments::new(open(&two).unwrap()).unwrap());
    let options = Options { overrides: &[], reference, save: None };
    let o = replay(open(&one).unwrap(), options, &mut |_| {}).unwrap();
    assert!(o.exchanges == 2 && o.comparison.identical(), "{}", o.comparison);
}

#[test]
fn what_a_replay_cannot_change_is_refused() {
    let bytes = recorded(
        "refused",
        &[
            ("record.first", "2"),
            ("coupling.model", "B"),
            ("forces.pressure_gradient", "false"),
            ("forces.viscous_stress", "false"),
        ],
        3,
        [1, 1],
    );
    for (set, words) in [
        (("coupling.interval", "40"), "how the recorded programs ran"),
        (("output.picture", "x"), "how the recorded programs ran"),
        (("smooth.bandwith", "1e-3"), "did you mean smooth.bandwidth"),
        (("smooth.bandwidth", "0"), "smooth.bandwidth"),
        (("forces.drag", "wen"), "forces.drag = \"wen-yu\""),
        (
            ("coupling.scheme", "conservative-adaptive"),
            "need the history, which the recorded programs did not send",
        ),
    ] {
        let e = again(&bytes, &[set]).unwrap_err().to_string();
        assert!(e.contains(words), "{set:?}: {e}");
    }
    let a =
        [("coupling.model", "A"), ("forces.pressure_gradient", "true"), ("forces.viscous_stress", "true")];
    let e = again(&bytes, &a).unwrap_err().to_string();
    assert!(e.contains("need the pressure gradient"), "{e}");
    let e = again(&bytes, &[("forces.history", "true")]).unwrap_err().to_string();
    assert!(e.contains("need the memory"), "{e}");
    let o = again(&bytes, &[]).unwrap();
    assert!(o.exchanges == 2 && o.comparison.identical());
}

/// Reads all of a file in every way there is; what it comes to. Must not panic.
fn read_all(bytes: &[u8]) -> Result<(u64, Option<u64>), ReplayError> {
    let o = exercise(bytes)?;
    assert!(o.comparison.identical(), "damage went unnoticed: {}", o.comparison);
    Ok((o.exchanges, o.cut))
}

#[test]
fn a_file_cut_anywhere_is_read_to_its_last_whole_exchange() {
    let bytes = recorded("cut", ALL, 3, [1, 1]);
    let (list, _) = open(&bytes).unwrap().exchanges().unwrap();
    let mut seed = 3;
    let mut cuts: Vec<usize> =
        (0..60).map(|_| (common::random(&mut seed) * bytes.len() as f64) as usize).collect();
    cuts.extend([0, 1, 15, 16, 17, 63, 64, bytes.len() - 1, bytes.len() - 24, bytes.len() - 25]);
    for e in &list {
        cuts.extend([e.1 as usize - 1, e.1 as usize, e.1 as usize + 1]);
    }
    let mut seen = [0; 2];
    for cut in cuts {
        match read_all(&bytes[..cut]) {
            Ok((n, at)) => {
                // an exchange is whole once its replies are in the file
                let begun = list.iter().filter(|e| e.1 < cut as u64).count() as u64;
                assert!(n == begun || n + 1 == begun, "{cut}: {n} of {begun}");
                assert!(at.is_some_and(|a| a <= cut as u64), "{cut}: {at:?}");
                seen[0] += 1;
            }
            Err(e) => {
                let text = e.to_string();
                let early = text.contains("before its first exchange") || text.contains("not a recording");
                assert!(early && cut < list[1].1 as usize + 1, "{cut}: {text}");
                seen[1] += 1;
            }
        }
    }
    assert!(seen[0] > 20 && seen[1] > 5, "{seen:?}");
}

#[test]
fn a_flipped_bit_is_an_error_that_names_its_place() {
    let bytes = recorded("flip", &[("record.first", "2")], 3, [1, 1]);
    let mut seed = 5;
    for n in 0..300 {
        // file and chunk heads are hit often, payloads now and then
        let at = if n < 200 { n } else { (common::random(&mut seed) * bytes.len() as f64) as usize };
        let mut bad = bytes.clone();
        bad[at] ^= 1 << (n % 8);
        let e = read_all(&bad).err().unwrap_or_else(|| panic!("byte {at}: not noticed"));
        let text = e.to_string();
        assert!(
            ["damaged at byte", "not a recording", "format", "byte order"].iter().any(|w| text.contains(w)),
            "byte {at}: {text}"
        );
    }
}

#[test]
fn strangers_are_named() {
    let bytes = recorded("strange", &[("record.first", "1")], 1, [1, 1]);
    let error = |b: &[u8]| open(b).err().unwrap().to_string();
    assert!(error(&[]).contains("not a recording of voidage (it has 0 bytes)"));
    assert!(error(b"solver logs and other text").contains("it begins with \"solver l\""));
    let mut other = bytes.clone();
    other[8..12].reverse();
    assert!(error(&other).contains("other byte order"));
    let mut other = bytes.clone();
    other[12] = 9;
    assert!(error(&other).contains("recording format 9, this program reads format 1"));
    // a header with a right checksum that promises more than there is
    let mut huge = voidage::record::chunk::file_head().to_vec();
    let head = voidage::record::head::encode(&voidage::record::Head::Index);
    for raw in [u64::MAX, 1 << 62, 1 << 40] {
        let mut h = voidage::record::chunk::header(&head, &[], raw, 1);
        assert!(read_all(&[&huge[..], &h].concat()).is_err());
        h[8..16].copy_from_slice(&raw.to_le_bytes());
        assert!(read_all(&[&huge[..], &h].concat()).is_err());
    }
    huge.extend([0xff; 4096]);
    assert!(error(&huge).contains("damaged at byte 16"));
    assert!(open(&bytes).is_ok());
}

fn corpus() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/recordings")
}

#[test]
fn recordings_of_format_1_are_read_by_every_later_version() {
    for (name, k, solids) in
        [("whole.voidage", vec![0, 1, 2, 3], WHOLE), ("every-third.voidage", vec![0, 3, 6, 7], WHOLE)]
    {
        let bytes = std::fs::read(corpus().join(name)).unwrap();
        let mut m = Moments::new(open(&bytes).unwrap()).unwrap();
        assert_eq!(m.exchanges.iter().map(|e| e.0).collect::<Vec<_>>(), k, "{name}");
        // the solids of the last exchange, from the recorded voidage and from the recorded particles
        let x = m.at(k.len() - 1).unwrap().unwrap();
        let (p, q) = (x.particles().unwrap(), x.sources(&m.mesh).unwrap());
        let cells: f64 = q.voidage.iter().zip(&m.mesh.volume).map(|(e, v)| (1.0 - e) * v).sum();
        let spheres: f64 = (0..p.len()).map(|i| p.volume(i)).sum();
        assert!(
            (cells / solids - 1.0).abs() < 1e-9 && (spheres / solids - 1.0).abs() < 1e-9,
            "{name}: {cells:e}"
        );
        // it replays; models may have changed since, what the step does with the solids has not
        let o = again(&bytes, &[]).unwrap();
        assert_eq!((o.exchanges, o.cut), (k.len() as u64, None), "{name}");
        let voidage = &o.comparison.arrays[&voidage_wire::field::VOIDAGE];
        assert!(voidage.relative() < 1e-6, "{name}: {}", o.comparison);
    }
}

/// 20 spheres of 0.8 mm, m3.
const WHOLE: f64 = 20.0 * 4.0 / 3.0 * std::f64::consts::PI * 6.4e-11;

#[test]
fn files_that_once_made_trouble_end_in_a_result() {
    let mut n = 0;
    for e in std::fs::read_dir(corpus()).unwrap().flatten() {
        let bytes = std::fs::read(e.path()).unwrap();
        let good = ["whole.voidage", "every-third.voidage"].iter().any(|f| e.path().ends_with(f));
        // the others end in a result, whichever
        assert!(exercise(&bytes).is_ok() || !good, "{}", e.path().display());
        n += 1;
    }
    assert!(n > 10, "the corpus is gone");
}

/// Not a test: makes the whole recordings of the corpus. Those in the repository stay as they are, they are the proof
/// that later versions read them. `cargo test --test recording makes_the_corpus -- --ignored`
#[test]
#[ignore = "makes files"]
fn makes_the_corpus() {
    std::fs::create_dir_all(corpus()).unwrap();
    let every_third: &[_] = &[("record.every", "3"), ("record.last", "2"), ("forces.added_mass", "0.5")];
    for (name, set, steps, ranks, how) in [
        ("whole.voidage", ALL, 3, [2, 2], Compression::Lz4),
        ("every-third.voidage", every_third, 7, [1, 1], Compression::None),
    ] {
        let file = corpus().join(name);
        if !file.exists() {
            record_in([2, 3, 4], 20, &file, &case(set, steps), steps, ranks, how);
        }
    }
}

#[test]
fn a_scene_is_measured_on_a_recording() {
    let bytes = recorded("scene", &[("record.first", "4")], 6, [1, 1]);
    let config = case(&[], 6);
    let mut m = Moments::new(open(&bytes).unwrap()).unwrap();
    let s = recorded_scene(&mut m, &config).unwrap();
    // 500 spheres of 0.8 mm and 1000 kg/m3 in 20 x 20 x 40 mm
    assert_eq!((s.particles.mean, s.cells), (500.0, Some(250)));
    assert!((s.diameter.mean / 8e-4 - 1.0).abs() < 1e-12 && (s.density.mean / 1000.0 - 1.0).abs() < 1e-12);
    let phi = 500.0 * std::f64::consts::PI / 6.0 * 5.12e-10 / 1.6e-5;
    assert!((s.solid_fraction.unwrap() / phi - 1.0).abs() < 1e-9);
    assert!((s.mass_loading().unwrap() / (phi * 1000.0 / ((1.0 - phi) * 1.2)) - 1.0).abs() < 1e-9);
    assert!((s.stokes_time() / (1000.0 * 6.4e-7 / (18.0 * 1.2 * 1.5e-5)) - 1.0).abs() < 1e-12, "R eq. 9");
    // the relaxation time of the law lies below Stokes', tau_f = tau_p rho_f (1 - phi)/(rho_p phi) in the mean
    assert!(s.relaxation.mean < s.stokes_time());
    let tau_f = s.relaxation.mean * 1.2 * (1.0 - phi) / (1000.0 * phi);
    assert!((s.fluid_relaxation.unwrap() / tau_f - 1.0).abs() < 0.3, "{:?} {tau_f}", s.fluid_relaxation);
    let term = |name: &str| s.terms.iter().find(|t| t.name == name).unwrap();
    let weight = 1000.0 * 9.81;
    assert!(term("Archimedes").relative <= 1.2e-3 * (1.0 + 1e-9));
    // the pressure gradient was made 50 sin(0.3 id) Pa/m: rms 35 against the larger of drag and weight
    let p = term("pressure gradient");
    assert!(p.relative > 0.2 * 35.0 / weight && p.relative < 1.01 * 50.0 / weight, "{p:?}");
    assert_eq!(decide::choose(term("Archimedes"), 1e-5), decide::Choice::On);
    assert_eq!(decide::choose(term("Archimedes"), 1e-1), decide::Choice::Off);
    assert_eq!(decide::choose(term("history (Basset)"), 1e-9), decide::Choice::On);
    assert!(decide::advice(&s, 1e-5).iter().any(|a| a.contains("forces.lift = \"loth\"")));
}

/// Names and values of a Parquet file of doubles.
fn parquet(file: &Path) -> (Vec<String>, Vec<Vec<f64>>) {
    use parquet::file::reader::{FileReader, SerializedFileReader};
    let reader = SerializedFileReader::new(std::fs::File::open(file).unwrap()).unwrap();
    let fields = reader.metadata().file_metadata().schema().get_fields().to_vec();
    let mut columns = vec![Vec::new(); fields.len()];
    for row in reader.get_row_iter(None).unwrap() {
        for (i, (_, field)) in row.unwrap().get_column_iter().enumerate() {
            let parquet::record::Field::Double(x) = field else { panic!("{field}") };
            columns[i].push(*x);
        }
    }
    (fields.iter().map(|f| f.name().to_string()).collect(), columns)
}

#[test]
fn a_recording_is_exported_as_series_and_tables() {
    let bytes = recorded("export", &[("record.every", "2")], 5, [2, 2]);
    let folder = std::env::temp_dir().join(format!("voidage-export-{}", std::process::id()));
    let _ = std::fs::remove_dir_all(&folder);
    let mut m = Moments::new(open(&bytes).unwrap()).unwrap();
    assert_eq!(export(&mut m, &folder.join("csv"), Format::Csv, 1).unwrap(), (3, 6));
    let read = |name: &str| std::fs::read_to_string(folder.join(name)).unwrap();
    let table = |text: &str| -> Vec<Vec<String>> {
        text.lines().map(|l| l.split(',').map(str::to_owned).collect()).collect()
    };
    let (cells, particles) = (table(&read("csv/cells_0001.csv")), table(&read("csv/particles_0001.csv")));
    assert_eq!((cells.len(), particles.len()), (251, 501));
    assert!(cells.iter().all(|r| r.len() == cells[0].len()));
    // the solids of the cells are those of the particles
    let column = |t: &[Vec<String>], name: &str| -> Vec<f64> {
        let c = t[0].iter().position(|n| n == name).unwrap();
        t[1..].iter().map(|r| r[c].parse().unwrap()).collect()
    };
    let solids: f64 =
        column(&cells, "voidage").iter().zip(column(&cells, "volume")).map(|(e, v)| (1.0 - e) * v).sum();
    let spheres: f64 =
        column(&particles, "radius").iter().map(|r| 4.0 / 3.0 * std::f64::consts::PI * r.powi(3)).sum();
    assert!((solids / spheres - 1.0).abs() < 1e-12);
    let x = m.exchange(2).unwrap().unwrap().particles().unwrap();
    assert_eq!(column(&particles, "velocity_z"), x.velocity.iter().map(|v| v[2]).collect::<Vec<_>>());
    assert_eq!(table(&read("csv/exchanges.csv"))[2], ["1", "2", "0.0004"]);
    assert_eq!(table(&read("csv/monitor.csv")).len(), 7, "rows of all exchanges");
    // the same numbers as Parquet, to the bit
    let mut m = Moments::new(open(&bytes).unwrap()).unwrap();
    assert_eq!(export(&mut m, &folder.join("parquet"), Format::Parquet, 1).unwrap(), (3, 6));
    for (name, csv) in [("particles_0001", &particles), ("cells_0001", &cells)] {
        let (names, columns) = parquet(&folder.join(format!("parquet/{name}.parquet")));
        assert_eq!(names, csv[0]);
        for (name, values) in names.iter().zip(&columns) {
            assert_eq!(*values, column(csv, name), "{name}");
        }
    }
    let (names, columns) = parquet(&folder.join("parquet/monitor.parquet"));
    assert!(names.len() == 18 && names[1] == "time_s" && columns.iter().all(|c| c.len() == 6));
    assert_eq!(columns[0], [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
    let mut m = Moments::new(open(&bytes).unwrap()).unwrap();
    assert_eq!(export(&mut m, &folder.join("vtk"), Format::Vtk, 2).unwrap(), (2, 6));
    assert_eq!(read("vtk/cells.pvd").matches("<DataSet").count(), 2);
    assert!(folder.join("vtk/particles_0001.vtp").exists());
    std::fs::remove_dir_all(&folder).unwrap();
}

#[test]
fn the_forecast_bounds_the_size() {
    for set in [ALL, &[("record.every", "4"), ("coupling.scheme", "conservative-adaptive")]] {
        let c = case(set, 9);
        let s = Scratch::new("recording-forecast");
        record(&s.0, &c, 9, [1, 1], Compression::None);
        let size = s.bytes().len() as f64;
        let mut f = forecast::of(&c, 500, 250);
        // the made DEM sends its last interval always
        if !set.iter().any(|s| s.1.contains("adaptive")) {
            f.total += f.exchanges * 500 * 8 * 10;
        }
        assert!(size <= f.total as f64 && size > 0.7 * f.total as f64, "{size} {f:?}");
    }
}

#[test]
fn commands_say_what_is_wrong_with_a_file() {
    let good = Scratch::new("recording-commands");
    record(&good.0, &case(&[("record.first", "2")], 3), 3, [1, 1], Compression::Lz4);
    let bad = Scratch::new("recording-commands-bad");
    let mut bytes = good.bytes();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    std::fs::write(&bad.0, bytes).unwrap();
    let file = good.0.display().to_string();
    let damaged = bad.0.display().to_string();
    let folder = std::env::temp_dir().display().to_string();
    let readme = concat!(env!("CARGO_MANIFEST_DIR"), "/README.md");
    let table: &[(&[&str], i32, &str)] = &[
        (&["replay", &file], 0, "all replies are bit-identical with the recorded ones"),
        (&["replay", &file, "--set", "forces.drag=wen-yu"], 0, "the replies differ from the recorded ones"),
        (&["replay", &file, "--compare", &file], 0, "all replies are bit-identical with those of"),
        (&["replay", &damaged], 2, "damaged at byte"),
        (&["inspect", &damaged], 2, "damaged at byte"),
        (&["replay", "/nowhere"], 2, "/nowhere: No such file"),
        (&["replay", &folder], 2, "is a folder"),
        (&["inspect", readme], 2, "not a recording of voidage (it begins with \"# voidag\")"),
        (&["replay", &file, "--set", "dem.script=x"], 2, "a replay cannot change it"),
        (&["replay", &file, "--set", "forces.drag"], 2, "overrides are section.key=value"),
        (&["replay", &file, "--save", &file], 2, "exists"),
        (&["inspect", &file, "--accuracy", "2"], 2, "between 0 and 1"),
        (&["export", &file, "--format", "hdf"], 2, "accepted: vtk, csv"),
        (&["export", &file, "--every", "0"], 2, "at least 1"),
        (
            &["export", &file, "--into", concat!(env!("CARGO_MANIFEST_DIR"), "/src")],
            2,
            "the folder is not empty",
        ),
    ];
    for (arguments, code, words) in table {
        let o = std::process::Command::new(env!("CARGO_BIN_EXE_voidage")).args(*arguments).output().unwrap();
        let text = format!("{}{}", String::from_utf8_lossy(&o.stdout), String::from_utf8_lossy(&o.stderr));
        assert!(
            o.status.code() == Some(*code) && text.contains(words),
            "{arguments:?}: {:?} {text}",
            o.status
        );
    }
}
