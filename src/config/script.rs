// SPDX-License-Identifier: MIT OR Apache-2.0
//! The few facts of a LIGGGHTS script that the checks need. Variables given as plain numbers are put in; what
//! cannot be read is `None`, never a guess.

use std::collections::BTreeMap;
use std::path::Path;

/// What the script says.
#[derive(Clone, Debug, Default, PartialEq)]
#[allow(missing_docs)]
pub struct Script {
    pub time_step: Option<f64>,
    pub units: Option<String>,
    /// box of `create_box` or of the data file, m
    pub domain: Option<([f64; 3], [f64; 3])>,
    /// "p" or others, per axis
    pub boundary: Option<[String; 3]>,
    /// particles of the data file
    pub count: Option<f64>,
    /// particles of `create_atoms … single` and of `insert/pack … insert_every once … particles_in_region`
    pub placed: Option<f64>,
    /// file of `read_data`
    pub data: Option<std::path::PathBuf>,
    pub has_fix: bool,
    pub has_run: bool,
    /// takes particles from a restart file
    pub has_restart: bool,
    pub radius: Option<f64>,
    pub density: Option<f64>,
}

/// Reads a script; `-var` values win over `variable` lines.
pub fn read(path: &Path, given: &BTreeMap<String, String>) -> Result<Script, String> {
    let text = std::fs::read_to_string(path).map_err(|e| format!("{}: {e}", path.display()))?;
    let mut variables = given.clone();
    let (mut s, mut regions, mut boxed) = (Script::default(), BTreeMap::new(), None::<String>);
    let text = text.replace("&\n", " ");
    for line in text.lines().flat_map(commands) {
        let line = substitute(line.split('#').next().unwrap_or(""), &variables);
        let w: Vec<&str> = line.split_whitespace().collect();
        let n = |i: usize| w.get(i).and_then(|x| x.parse::<f64>().ok());
        match w.first().copied() {
            Some("variable") if w.len() >= 4 => {
                variables.entry(w[1].into()).or_insert_with(|| w[3].into());
            }
            Some("timestep") => s.time_step = n(1),
            Some("units") => s.units = w.get(1).map(|u| (*u).into()),
            Some("boundary") if w.len() >= 4 => s.boundary = Some([w[1].into(), w[2].into(), w[3].into()]),
            Some("region") if w.get(2) == Some(&"block") => {
                let v: Vec<f64> = (3..9).filter_map(n).collect();
                if v.len() == 6 {
                    regions.insert(w[1].to_string(), ([v[0], v[2], v[4]], [v[1], v[3], v[5]]));
                }
            }
            Some("create_box") => boxed = w.get(2).map(|r| (*r).into()),
            Some("read_data") => {
                let file = w.get(1).map(|f| path.parent().unwrap_or(Path::new(".")).join(f));
                s.domain = file.as_ref().and_then(|f| data_box(f));
                s.count = file.as_ref().and_then(|f| data_count(f));
                if let Some((radius, density)) = file.as_ref().and_then(|f| data_spheres(f)) {
                    (s.radius, s.density) = (s.radius.or(Some(radius)), s.density.or(Some(density)));
                }
                s.data = file;
            }
            Some("read_restart") => s.has_restart = true,
            Some("create_atoms") if w.get(2) == Some(&"single") => {
                s.placed = Some(s.placed.unwrap_or(0.0) + 1.0);
            }
            Some("fix") if w.get(3) == Some(&"insert/pack") && line.contains("insert_every once") => {
                let at = w.iter().position(|x| *x == "particles_in_region");
                s.placed = at.and_then(|i| n(i + 1)).map(|more| more + s.placed.unwrap_or(0.0)).or(s.placed);
            }
            Some("fix") if w.get(3) == Some(&"voidage") => s.has_fix = true,
            Some("fix") if w.get(3) == Some(&"particletemplate/sphere") => {
                let constant = |key: &str| {
                    let at = w.windows(2).position(|p| p == [key, "constant"])?;
                    n(at + 2)
                };
                // of several, the largest
                s.radius = constant("radius").into_iter().chain(s.radius).max_by(f64::total_cmp);
                s.density = constant("density").or(s.density);
            }
            Some("run" | "rerun") => s.has_run = true,
            Some("set") if line.contains("density") || line.contains("diameter") => {
                let after = |key: &str| w.iter().position(|x| *x == key).and_then(|i| n(i + 1));
                s.density = after("density").or(s.density);
                s.radius = after("diameter").map(|d| 0.5 * d).or(s.radius);
            }
            _ => {}
        }
    }
    if let Some(b) = boxed.and_then(|r| regions.get(&r).copied()) {
        s.domain = Some(b);
    }
    Ok(s)
}

/// A line, or the commands in quotes of an `if` line.
fn commands(line: &str) -> Vec<&str> {
    if line.split_whitespace().next() == Some("if") {
        // 1: the condition; then one in each odd part
        return line.split('"').skip(3).step_by(2).collect();
    }
    vec![line]
}

fn substitute(line: &str, variables: &BTreeMap<String, String>) -> String {
    variables.iter().fold(line.to_string(), |l, (k, v)| l.replace(&format!("${{{k}}}"), v))
}

/// "N atoms" at the head of a data file.
fn data_count(path: &Path) -> Option<f64> {
    let text = std::fs::read_to_string(path).ok()?;
    text.lines().take(40).find_map(|l| l.trim().strip_suffix("atoms")?.trim().parse().ok())
}

/// Mean diameter (m) and density (kg/m3) of a data file of `atom_style granular` (id type diameter density x y z).
pub fn spheres(path: &Path) -> Option<(f64, f64)> {
    let text = std::fs::read_to_string(path).ok()?;
    let rows = text.lines().skip_while(|l| !l.starts_with("Atoms")).skip(1).filter(|l| !l.trim().is_empty());
    let rows = rows.map_while(|l| {
        let v: Vec<f64> = l.split_whitespace().map_while(|w| w.parse().ok()).collect();
        (v.len() >= 7).then(|| (v[2], v[3]))
    });
    let (mut d, mut rho, mut n) = (0.0, 0.0, 0.0);
    rows.for_each(|r| (d, rho, n) = (d + r.0, rho + r.1, n + 1.0));
    (n > 0.0 && d > 0.0 && rho > 0.0).then(|| (d / n, rho / n))
}

/// "lo hi xlo xhi" lines at the head of a data file.
fn data_box(path: &Path) -> Option<([f64; 3], [f64; 3])> {
    let text = std::fs::read_to_string(path).ok()?;
    let axis = |a: &str| {
        let line = text.lines().take(40).find(|l| l.trim_end().ends_with(&format!("{a}lo {a}hi")))?;
        let v: Vec<f64> = line.split_whitespace().take(2).filter_map(|x| x.parse().ok()).collect();
        (v.len() == 2).then(|| (v[0], v[1]))
    };
    let (x, y, z) = (axis("x")?, axis("y")?, axis("z")?);
    Some(([x.0, y.0, z.0], [x.1, y.1, z.1]))
}

/// Sauter radius Σ r³/Σ r² (m) and mean density (kg/m3) of the atoms (style granular: id type diameter density x y z).
fn data_spheres(path: &Path) -> Option<(f64, f64)> {
    let text = std::fs::read_to_string(path).ok()?;
    let section = text.lines().skip_while(|l| l.split_whitespace().next() != Some("Atoms")).skip(1);
    let rows = section.map(|l| l.split_whitespace().map_while(|w| w.parse().ok()).collect::<Vec<f64>>());
    let (mut cubes, mut squares, mut mass) = (0.0, 0.0, 0.0);
    for row in rows.skip_while(Vec::is_empty).take_while(|r| r.len() >= 7) {
        let d = row[2];
        (cubes, squares, mass) = (cubes + d * d * d, squares + d * d, mass + d * d * d * row[3]);
    }
    (squares > 0.0 && cubes > 0.0).then(|| (0.5 * cubes / squares, mass / cubes))
}
