// SPDX-License-Identifier: MIT OR Apache-2.0
//! The few facts of an OpenFOAM case that the checks need. Reads plain dictionaries (macros and includes of controlDict are
//! put in by OpenFOAM's foamDictionary); what it cannot read is `None`, never a guess.

use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// system/controlDict.
#[derive(Clone, Debug, PartialEq)]
#[allow(missing_docs)]
pub struct Control {
    pub start: f64,
    pub end: f64,
    pub step: f64,
    pub adjustable: bool,
}

/// Box and cells of the mesh.
#[derive(Clone, Debug, PartialEq)]
#[allow(missing_docs)]
pub struct Extent {
    pub lower: [f64; 3],
    pub upper: [f64; 3],
    /// number of cells, if known
    pub cells: Option<usize>,
}

/// Text without comments.
fn plain(text: &str) -> String {
    let (mut out, mut rest) = (String::new(), text);
    while let Some(i) = rest.find("//").into_iter().chain(rest.find("/*")).min() {
        out.push_str(&rest[..i]);
        let end = if rest[i..].starts_with("//") {
            rest[i..].find('\n')
        } else {
            rest[i..].find("*/").map(|e| e + 2)
        };
        rest = end.map_or("", |e| &rest[i + e..]);
        out.push(' ');
    }
    out + rest
}

/// First value of an entry `key value…;`.
pub fn entry(text: &str, key: &str) -> Option<String> {
    let text = plain(text);
    text.split([';', '{', '}']).find_map(|s| {
        let mut words = s.split_whitespace();
        (words.next() == Some(key)).then(|| words.collect::<Vec<_>>().join(" "))
    })
}

/// What stands in the braces of `name { … }`, up to the first brace in there; of a text without comments.
fn section<'a>(text: &'a str, name: &str) -> Option<&'a str> {
    text.split(name).nth(1)?.split(['{', '}']).nth(1)
}

/// Is a switch on?
fn on(value: &str) -> bool {
    ["yes", "on", "true"].contains(&value)
}

/// Time folders of a case, or of a processor's part of it.
fn times(place: &Path) -> impl Iterator<Item = (f64, PathBuf)> {
    let entries = std::fs::read_dir(place).ok().into_iter().flatten().flatten();
    entries.filter_map(|e| Some((e.file_name().to_str()?.parse().ok()?, e.path())))
}

fn number(text: &str, key: &str) -> Option<f64> {
    entry(text, key)?.split_whitespace().last()?.parse().ok()
}

impl Control {
    /// Reads a controlDict; the error says what is missing.
    pub fn read(path: &Path) -> Result<Self, String> {
        let mut text = std::fs::read_to_string(path).map_err(|e| format!("{}: {e}", path.display()))?;
        if plain(&text).contains(['$', '#']) {
            text = expanded(path).unwrap_or(text);
        }
        let none =
            |key: &str| format!("{} has no number {key} (#calc and the like are not read)", path.display());
        let need = |key: &str| number(&text, key).ok_or(none(key));
        let case = path.ancestors().nth(2).unwrap_or(path);
        let start = begin(&text, case).ok_or(none("startTime"))?;
        let adjustable = entry(&text, "adjustTimeStep").is_some_and(|v| on(&v));
        Ok(Self { start, end: need("endTime")?, step: need("deltaT")?, adjustable })
    }
}

/// A program of OpenFOAM, which wants to know where its own files are.
pub fn program(name: &str) -> Command {
    let mut command = Command::new(name);
    command.stdin(Stdio::null());
    if std::env::var_os("WM_PROJECT_DIR").is_none() {
        command.env("WM_PROJECT_DIR", "/usr/share/openfoam");
    }
    command
}

/// A dictionary with its macros and includes put in.
fn expanded(path: &Path) -> Option<String> {
    let out = program("foamDictionary").arg("-expand").arg(path).output().ok()?;
    out.status.success().then(|| String::from_utf8_lossy(&out.stdout).into_owned())
}

/// Head of a system/decomposeParDict that is not the user's.
pub const OURS: &str = "// written by voidage run";

/// numberOfSubdomains of the user's own system/decomposeParDict, if there is one.
pub fn parts(case: &Path) -> Option<Option<u32>> {
    let text = std::fs::read_to_string(case.join("system/decomposeParDict")).ok()?;
    (!text.contains(OURS)).then(|| entry(&text, "numberOfSubdomains").and_then(|n| n.parse().ok()))
}

/// Has the mesh patches of a kind?
pub fn has_patch(case: &Path, kind: &str) -> bool {
    let read = |f: &str| std::fs::read_to_string(case.join(f)).ok();
    let text = read("constant/polyMesh/boundary").or_else(|| read("system/blockMeshDict"));
    let words = |t: String| plain(&t).split_whitespace().collect::<String>();
    text.is_some_and(|t| words(t).contains(&format!("type{kind};")))
}

/// Does system/fvSchemes leave out the rates of change?
pub fn steady(case: &Path) -> bool {
    let text = plain(&std::fs::read_to_string(case.join("system/fvSchemes")).unwrap_or_default());
    section(&text, "ddtSchemes").is_some_and(|s| s.contains("steadyState"))
}

/// Has constant/MRFProperties a zone that is active (the default)?
pub fn rotating(case: &Path) -> bool {
    let Ok(text) = std::fs::read_to_string(case.join("constant/MRFProperties")) else { return false };
    let text = plain(&text);
    let zones = text.split("cellZone").skip(1);
    zones.map(|z| entry(z.split('}').next().unwrap_or(z), "active")).any(|a| a.is_none_or(|a| on(&a)))
}

/// The kind of mesh of constant/dynamicMeshDict, if it moves.
pub fn moving_mesh(case: &Path) -> Option<String> {
    let text = std::fs::read_to_string(case.join("constant/dynamicMeshDict")).ok()?;
    entry(&text, "dynamicFvMesh").filter(|kind| kind != "staticFvMesh")
}

/// The folder of a time in an OpenFOAM case.
pub fn time_folder(case: &Path, time: f64, slack: f64) -> Option<PathBuf> {
    times(case).find(|(t, _)| (t - time).abs() <= slack).map(|found| found.1)
}

/// Time (s) a solver begins at by the text of its controlDict, with the time folders in `place`: the case or a processor's part of it.
pub fn begin(control: &str, place: &Path) -> Option<f64> {
    let from = entry(control, "startFrom");
    if from.as_deref() == Some("startTime") {
        return number(control, "startTime");
    }
    let times = times(place).map(|t| t.0);
    let first = from.as_deref() == Some("firstTime");
    let found = if first { times.min_by(f64::total_cmp) } else { times.max_by(f64::total_cmp) };
    Some(found.unwrap_or(0.0))
}

/// nu of constant/transportProperties, m2/s.
pub fn viscosity(case: &Path) -> Option<f64> {
    number(&std::fs::read_to_string(case.join("constant/transportProperties")).ok()?, "nu")
}

/// What 0/U says: the fastest uniform velocity (m/s), and whether there are walls the fluid sticks to.
pub fn start(case: &Path) -> Option<(f64, bool)> {
    let text = plain(&std::fs::read_to_string(case.join("0/U")).ok()?);
    let speed = |v: &[f64; 3]| v.iter().map(|x| x * x).sum::<f64>().sqrt();
    let fastest = vectors(&text).iter().map(speed).fold(0.0, f64::max);
    // with slip walls too, which of them stand opposite each other is not known here
    Some((fastest, text.contains("noSlip") && !text.contains("type slip")))
}

/// Box of the mesh: from the points of constant/polyMesh, which a run takes if it is there, where they are ascii; else from blockMeshDict. Its number of
/// cells from constant/polyMesh/owner, ascii or not, else from blockMeshDict.
pub fn extent(case: &Path) -> Option<Extent> {
    let folder = case.join("constant/polyMesh");
    let text = std::fs::read_to_string(folder.join("points")).ok();
    let found =
        text.and_then(|t| bounds(&vectors(&plain(&t)), 1.0, None)).or_else(|| from_block_mesh(case))?;
    Some(Extent { cells: noted(case, "nCells").or(found.cells), ..found })
}

/// Mean number of faces of a cell, of a mesh in constant/polyMesh: 4 for tetrahedra, 6 for hexahedra.
pub fn faces_per_cell(case: &Path) -> Option<f64> {
    let number = |what| noted(case, what).map(|n| n as f64);
    Some((number("nFaces")? + number("nInternalFaces")?) / number("nCells")?)
}

/// What OpenFOAM's tools note in the head of constant/polyMesh/owner: "nPoints:304  nCells:972  nFaces:2178  nInternalFaces:1710".
fn noted(case: &Path, what: &str) -> Option<usize> {
    let mut head = Vec::new();
    std::fs::File::open(case.join("constant/polyMesh/owner")).ok()?.take(4096).read_to_end(&mut head).ok()?;
    let (head, what) = (String::from_utf8_lossy(&head), format!("{what}:"));
    let word = |rest: &str| rest.trim_start().chars().take_while(char::is_ascii_digit).collect::<String>();
    word(head.split(&what).nth(1)?).parse().ok()
}

/// The scheme of system/fvSchemes for the gradient of a field: its own, else the default.
pub fn gradient(case: &Path, field: &str) -> Option<String> {
    let text = plain(&std::fs::read_to_string(case.join("system/fvSchemes")).ok()?);
    let all = section(&text, "gradSchemes")?;
    entry(all, &format!("grad({field})")).or_else(|| entry(all, "default"))
}

/// "(x y z)" groups of numbers in a text.
fn vectors(text: &str) -> Vec<[f64; 3]> {
    let triple = |s: &str| {
        let n: Vec<f64> = s.split_whitespace().map_while(|w| w.parse().ok()).collect();
        (n.len() == 3 && s.split_whitespace().count() == 3).then(|| [n[0], n[1], n[2]])
    };
    text.split('(').filter_map(|s| triple(s.split(')').next()?)).collect()
}

fn bounds(points: &[[f64; 3]], scale: f64, cells: Option<usize>) -> Option<Extent> {
    let mut e = Extent { lower: [f64::INFINITY; 3], upper: [f64::NEG_INFINITY; 3], cells };
    for p in points {
        for a in 0..3 {
            e.lower[a] = e.lower[a].min(scale * p[a]);
            e.upper[a] = e.upper[a].max(scale * p[a]);
        }
    }
    (!points.is_empty()).then_some(e)
}

fn from_block_mesh(case: &Path) -> Option<Extent> {
    let text = plain(&std::fs::read_to_string(case.join("system/blockMeshDict")).ok()?);
    if text.contains('#') || text.contains('$') || text.contains("arc ") {
        return None; // computed entries or curved edges: not for us
    }
    let scale = number(&text, "convertToMeters").or_else(|| number(&text, "scale")).unwrap_or(1.0);
    let section = |name: &str| {
        let at = text.find(name)? + name.len();
        let end = text[at..].find(';')?;
        Some(&text[at..at + end])
    };
    // the first triple of each block; the next one is its grading
    let triples = section("blocks")?.split("hex").skip(1).filter_map(|b| vectors(b).first().copied());
    let cells = triples.filter(|v| v.iter().all(|x| *x >= 1.0 && x.fract() == 0.0));
    let cells: f64 = cells.map(|v| v.iter().product::<f64>()).sum();
    bounds(&vectors(section("vertices")?), scale, (cells > 0.0).then_some(cells as usize))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn entries_are_found_past_comments_and_a_mesh_before_its_dictionary() {
        let text =
            "/* deltaT 3; */ // deltaT 4;\nFoamFile { version 2; }\nstartTime 0; endTime\n0.4; deltaT 2e-4;";
        assert_eq!(number(text, "deltaT"), Some(2e-4));
        assert_eq!(number(text, "endTime"), Some(0.4));
        assert_eq!(number("nu [0 2 -1 0 0 0 0] 1e-5;", "nu"), Some(1e-5));
        let folder = std::env::temp_dir().join(format!("voidage-foam-{}", std::process::id()));
        let mesh = folder.join("constant/polyMesh");
        std::fs::create_dir_all(&mesh).unwrap();
        std::fs::create_dir_all(folder.join("system")).unwrap();
        let dict = "scale 1; vertices ((0 0 0) (9 9 9)); blocks (hex (0 1 2 3 4 5 6 7) (3 3 3) simpleGrading (1 1 1));";
        std::fs::write(folder.join("system/blockMeshDict"), dict).unwrap();
        assert_eq!(extent(&folder).and_then(|e| e.cells), Some(27));
        // a mesh that is there is what runs, whatever dictionary lies beside it
        std::fs::write(mesh.join("points"), "FoamFile { format ascii; }\n2\n(\n(0 0 0)\n(1 2.5 3)\n)")
            .unwrap();
        std::fs::write(
            mesh.join("owner"),
            "FoamFile { note \"nPoints:2  nCells:972  nFaces:2178  nInternalFaces:1710\"; }",
        )
        .unwrap();
        let found = extent(&folder).unwrap();
        assert_eq!((found.upper, found.cells), ([1.0, 2.5, 3.0], Some(972)));
        assert_eq!(faces_per_cell(&folder), Some((2178.0 + 1710.0) / 972.0));
        let schemes =
            "ddtSchemes { default Euler; } gradSchemes { default Gauss linear; grad(p) leastSquares; }";
        std::fs::write(folder.join("system/fvSchemes"), schemes).unwrap();
        assert_eq!(gradient(&folder, "p").as_deref(), Some("leastSquares"));
        assert_eq!(gradient(&folder, "U").as_deref(), Some("Gauss linear"));
        std::fs::remove_dir_all(&folder).unwrap();
        assert_eq!(vectors("((0 0 0) (1 2.5 3) (a b c)) (4 5)"), [[0.0; 3], [1.0, 2.5, 3.0]]);
    }
}
