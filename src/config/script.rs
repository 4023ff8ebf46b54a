// SPDX-License-Identifier: MIT OR Apache-2.0
//! The few facts of a LIGGGHTS or LAMMPS script that the checks need. Variables given as plain numbers are put in; what
//! cannot be read is `None`, never a guess: lengths in units of a lattice, particles on a lattice, files of `include`.

use std::collections::{BTreeMap, BTreeSet};
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
    /// particles of `create_atoms … single` and `… random`, of `insert/pack … insert_every once … particles_in_region`, and
    /// all that `fix pour` and `fix deposit` will have inserted; `None` where others come that cannot be counted
    pub placed: Option<f64>,
    /// file of `read_data`
    pub data: Option<std::path::PathBuf>,
    /// commands that tell the two programs apart: the word, with the style for `fix`, `atom_style` and `pair_style`
    pub commands: BTreeSet<String>,
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
    let (mut on_lattice, mut uncounted, mut columns) = (false, false, true);
    let text = text.replace("&\n", " ");
    for line in text.lines().flat_map(commands) {
        let line = substitute(line.split('#').next().unwrap_or(""), &variables);
        let w: Vec<&str> = line.split_whitespace().collect();
        let n = |i: usize| w.get(i).and_then(|x| x.parse::<f64>().ok());
        let style = match w.first().copied() {
            Some("fix") => w.get(3),
            Some("atom_style" | "pair_style") => w.get(1),
            _ => None,
        };
        let name: Vec<&str> = w.first().into_iter().chain(style).copied().collect();
        s.commands.extend((!name.is_empty()).then(|| name.join(" ")));
        match w.first().copied() {
            // a file's columns are in another order
            Some("atom_style") => columns = w.get(1) != Some(&"hybrid"),
            Some("lattice") => on_lattice = w.get(1) != Some(&"none"),
            Some("replicate" | "delete_atoms") => uncounted = true,
            Some("variable") if w.len() >= 4 => {
                variables.entry(w[1].into()).or_insert_with(|| w[3].into());
            }
            Some("timestep") => s.time_step = n(1),
            Some("units") => s.units = w.get(1).map(|u| (*u).into()),
            Some("boundary") if w.len() >= 4 => s.boundary = Some([w[1].into(), w[2].into(), w[3].into()]),
            Some("region") if w.get(2) == Some(&"block") && (!on_lattice || line.contains("units box")) => {
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
                if let Some((radius, density)) =
                    file.as_ref().filter(|_| columns).and_then(|f| data_spheres(f))
                {
                    (s.radius, s.density) = (s.radius.or(Some(radius)), s.density.or(Some(density)));
                }
                s.data = file.filter(|_| columns);
            }
            Some("read_restart") => s.has_restart = true,
            Some("create_atoms") if w.get(2) == Some(&"single") => {
                s.placed = Some(s.placed.unwrap_or(0.0) + 1.0);
            }
            Some("create_atoms") if w.get(2) == Some(&"random") && n(3).is_some() => {
                s.placed = n(3).map(|more| more + s.placed.unwrap_or(0.0));
            }
            Some("create_atoms") => uncounted = true,
            Some("fix") if matches!(w.get(3), Some(&("pour" | "deposit"))) => {
                s.placed = n(4).map(|more| more + s.placed.unwrap_or(0.0)).or(s.placed);
                let at = |key: &str| w.iter().position(|x| *x == key);
                // diam one D | range LOW HIGH, dens LOW HIGH; of several diameters, the largest
                let d = at("diam").and_then(|i| match w.get(i + 1) {
                    Some(&"one") => n(i + 2),
                    Some(&"range") => n(i + 3),
                    _ => None,
                });
                s.radius = d.map(|d| 0.5 * d).into_iter().chain(s.radius).max_by(f64::total_cmp);
                let dens = at("dens").and_then(|i| n(i + 1).zip(n(i + 2)));
                s.density = dens.map(|(low, high)| 0.5 * (low + high)).or(s.density);
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
    if uncounted {
        (s.placed, s.count) = (None, None);
    }
    if s.commands.contains("replicate") || s.commands.contains("change_box") {
        s.domain = None;
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

#[cfg(test)]
mod tests {
    use super::*;

    fn of(text: &str) -> Script {
        let file = std::env::temp_dir().join(format!("voidage-script-{}-{:p}.in", std::process::id(), text));
        std::fs::write(&file, text).unwrap();
        let s = read(&file, &BTreeMap::new()).unwrap();
        std::fs::remove_file(&file).unwrap();
        s
    }

    #[test]
    fn a_lammps_script_that_pours() {
        let s = of("units si\natom_style sphere\nregion b block 0 1 0 2 0 3\ncreate_box 1 b\n\
            pair_style granular\ncreate_atoms 1 random 30 12345 NULL\nset group all diameter 1e-3 density 2000\n\
            fix in all pour 500 1 4711 region b diam range 1e-3 3e-3 dens 1500 2500\nfix voidage all voidage\nrun 10\n");
        assert_eq!(s.placed, Some(530.0));
        assert_eq!((s.radius, s.density), (Some(1.5e-3), Some(2000.0)));
        assert_eq!(s.domain, Some(([0.0; 3], [1.0, 2.0, 3.0])));
        assert!(s.has_fix && s.has_run && s.units.as_deref() == Some("si"));
        for c in ["atom_style sphere", "pair_style granular", "fix pour", "fix voidage", "create_box"] {
            assert!(s.commands.contains(c), "{c}: {:?}", s.commands);
        }
    }

    #[test]
    fn what_a_lattice_makes_is_not_guessed() {
        let s = of(
            "lattice sc 1e-3\nregion b block 0 10 0 10 0 10\ncreate_box 1 b\ncreate_atoms 1 single 1 1 1\n\
            create_atoms 1 box\n",
        );
        assert_eq!((s.placed, s.domain), (None, None));
        let s = of(
            "lattice sc 1e-3\nregion b block 0 1 0 1 0 1 units box\ncreate_box 1 b\ncreate_atoms 1 single 1 1 1\n",
        );
        assert_eq!((s.placed, s.domain), (Some(1.0), Some(([0.0; 3], [1.0; 3]))));
        let s =
            of("region b block 0 1 0 1 0 1\ncreate_box 1 b\ncreate_atoms 1 single 0 0 0\nreplicate 2 2 2\n");
        assert_eq!((s.placed, s.domain), (None, None));
    }

    #[test]
    fn columns_of_a_hybrid_style_are_not_read_as_diameters() {
        let data = std::env::temp_dir().join(format!("voidage-script-{}.data", std::process::id()));
        std::fs::write(&data, "\n\n1 atoms\n\nAtoms # sphere\n\n1 1 2e-3 1500 5 5 5\n").unwrap();
        let script = |style: &str| format!("atom_style {style}\nread_data {}\n", data.display());
        let s = of(&script("sphere"));
        assert!(
            (s.radius.unwrap() - 1e-3).abs() < 1e-15 && s.density == Some(1500.0) && s.count == Some(1.0)
        );
        let s = of(&script("hybrid sphere dipole"));
        assert_eq!((s.radius, s.density, s.data, s.count), (None, None, None, Some(1.0)));
        std::fs::remove_file(&data).unwrap();
    }
}
