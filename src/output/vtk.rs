// SPDX-License-Identifier: MIT OR Apache-2.0
//! VTK XML files with appended raw data: .vtu (cells as polyhedra), .vtp (points), .pvd (time series).

use crate::mesh::Mesh;
use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// Values to write.
pub enum Data<'a> {
    /// one per cell or point
    Scalar(&'a [f64]),
    /// three per cell or point
    Vector(&'a [[f64; 3]]),
}

/// A .pvd file and its parts.
pub struct Series {
    folder: PathBuf,
    name: String,
    parts: Vec<(f64, String)>,
}

impl Series {
    /// FOLDER/NAME.pvd with parts FOLDER/NAME_0000.EXT.
    /// `from`: go on with the series of an earlier run up to this time.
    pub fn new(folder: &Path, name: &str, from: Option<f64>) -> Self {
        let text = from.and_then(|_| fs::read_to_string(folder.join(format!("{name}.pvd"))).ok());
        let value = |line: &str, key: &str| Some(line.split_once(key)?.1.split('"').next()?.to_string());
        let part = |l: &str| Some((value(l, "timestep=\"")?.parse().ok()?, value(l, "file=\"")?));
        let parts: Vec<(f64, String)> = text.unwrap_or_default().lines().filter_map(part).collect();
        let end = from.unwrap_or(0.0) * (1.0 + 1e-12);
        let parts = parts.into_iter().filter(|p| p.0 <= end).collect();
        Self { folder: folder.into(), name: name.into(), parts }
    }
    /// Writes the next part and the list of all so far.
    pub fn write(
        &mut self,
        time: f64,
        ext: &str,
        fill: impl FnOnce(&mut dyn Write) -> io::Result<()>,
    ) -> io::Result<()> {
        let part = format!("{}_{:04}.{ext}", self.name, self.parts.len());
        let mut file = io::BufWriter::new(fs::File::create(self.folder.join(&part))?);
        fill(&mut file)?;
        file.flush()?;
        self.parts.push((time, part));
        let mut text = String::from(
            "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"0.1\">\n<Collection>\n",
        );
        for (t, p) in &self.parts {
            text += &format!("<DataSet timestep=\"{t}\" file=\"{p}\"/>\n");
        }
        text += "</Collection>\n</VTKFile>\n";
        // all or nothing for a reader that looks while we write
        let file = self.folder.join(format!("{}.pvd", self.name));
        fs::write(file.with_extension("part"), text)?;
        fs::rename(file.with_extension("part"), file)
    }
}

/// Appended blocks: header text with offsets, then the bytes.
#[derive(Default)]
struct Appended {
    /// length of what another block list wrote before
    before: usize,
    bytes: Vec<u8>,
}

impl Appended {
    fn array<const B: usize>(
        &mut self,
        name: &str,
        kind: &str,
        components: usize,
        data: impl Iterator<Item = [u8; B]>,
    ) -> String {
        let begin = self.bytes.len();
        let offset = self.before + begin;
        self.bytes.extend([0; 8]);
        data.for_each(|x| self.bytes.extend_from_slice(&x));
        let length = (self.bytes.len() - begin - 8) as u64;
        self.bytes[begin..begin + 8].copy_from_slice(&length.to_le_bytes());
        format!(
            "<DataArray type=\"{kind}\" Name=\"{name}\" NumberOfComponents=\"{components}\" format=\"appended\" offset=\"{offset}\"/>\n"
        )
    }
    fn integers(&mut self, name: &str, data: impl Iterator<Item = i64>) -> String {
        self.array(name, "Int64", 1, data.map(i64::to_le_bytes))
    }
    fn floats(&mut self, name: &str, data: &Data) -> String {
        let (components, numbers) = match data {
            Data::Scalar(v) => (1, *v),
            Data::Vector(v) => (3, v.as_flattened()),
        };
        self.bytes.reserve(4 * numbers.len() + 8);
        self.array(name, "Float32", components, numbers.iter().map(|x| (*x as f32).to_le_bytes()))
    }
    /// `first`: the bytes before.
    fn finish(self, file: &mut dyn Write, kind: &str, body: &str, first: &[u8]) -> io::Result<()> {
        write!(
            file,
            "<?xml version=\"1.0\"?>\n<VTKFile type=\"{kind}\" version=\"1.0\" byte_order=\"LittleEndian\" \
             header_type=\"UInt64\">\n<{kind}>\n{body}</{kind}>\n<AppendedData encoding=\"raw\">\n_"
        )?;
        file.write_all(first)?;
        file.write_all(&self.bytes)?;
        write!(file, "\n</AppendedData>\n</VTKFile>\n")
    }
}

/// The part of a .vtu file that stays the same: points and cells.
pub struct Grid {
    body: String,
    bytes: Vec<u8>,
}

impl Grid {
    /// Cells as polyhedra.
    pub fn new(mesh: &Mesh) -> Self {
        let mut a = Appended::default();
        let n = mesh.len();
        let offsets = |lengths: Vec<usize>| {
            lengths.into_iter().scan(0i64, |sum, l| {
                *sum += l as i64;
                Some(*sum)
            })
        };
        let stream = |slot| 1 + mesh.loops(slot).map(|f| 1 + f.len()).sum::<usize>();
        let points = &mesh.faces.points;
        let mut body =
            format!("<Piece NumberOfPoints=\"{}\" NumberOfCells=\"{n}\">\n<Points>\n", points.len());
        body += &a.floats("Points", &Data::Vector(points));
        body += "</Points>\n<Cells>\n";
        body += &a.integers("connectivity", (0..n).flat_map(|slot| mesh.corners(slot)).map(i64::from));
        body += &a.integers("offsets", offsets((0..n).map(|c| mesh.corners(c).len()).collect()));
        body += &a.array("types", "UInt8", 1, std::iter::repeat_n([42], n));
        let faces = (0..n).flat_map(|slot| {
            let list = |f: &[u32]| {
                std::iter::once(f.len() as i64).chain(f.iter().map(|p| i64::from(*p))).collect::<Vec<_>>()
            };
            std::iter::once(mesh.loops(slot).count() as i64)
                .chain(mesh.loops(slot).flat_map(list).collect::<Vec<_>>())
        });
        body += &a.integers("faces", faces);
        body += &a.integers("faceoffsets", offsets((0..n).map(stream).collect()));
        body += "</Cells>\n<CellData>\n";
        Self { body, bytes: a.bytes }
    }

    /// A file: cells with fields.
    pub fn write(&self, file: &mut dyn Write, fields: &[(&str, Data)]) -> io::Result<()> {
        let mut a = Appended { before: self.bytes.len(), bytes: Vec::new() };
        let mut body = self.body.clone();
        for (name, data) in fields {
            body += &a.floats(name, data);
        }
        body += "</CellData>\n</Piece>\n";
        a.finish(file, "UnstructuredGrid", &body, &self.bytes)
    }
}

/// Points with fields.
pub fn points(file: &mut dyn Write, position: &[[f64; 3]], fields: &[(&str, Data)]) -> io::Result<()> {
    let mut a = Appended::default();
    let n = position.len();
    let mut body = format!("<Piece NumberOfPoints=\"{n}\" NumberOfVerts=\"{n}\">\n<Points>\n");
    body += &a.floats("Points", &Data::Vector(position));
    body += "</Points>\n<Verts>\n";
    body += &a.integers("connectivity", 0..n as i64);
    body += &a.integers("offsets", 1..=n as i64);
    body += "</Verts>\n<PointData>\n";
    for (name, data) in fields {
        body += &a.floats(name, data);
    }
    body += "</PointData>\n</Piece>\n";
    a.finish(file, "PolyData", &body, &[])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn offsets_point_at_arrays_of_the_length_told() {
        let mut out = Vec::new();
        let speed = [1.0, 2.0];
        points(&mut out, &[[0.0; 3], [1.0, 2.0, 3.0]], &[("speed", Data::Scalar(&speed))]).unwrap();
        let start = out.windows(20).position(|w| w == b"encoding=\"raw\">\n_\x18\x00\x00").unwrap() + 17;
        let text = String::from_utf8_lossy(&out[..start]).into_owned();
        let at = |name: &str| {
            let line = text.lines().find(|l| l.contains(&format!("Name=\"{name}\""))).unwrap();
            let offset = line.split("offset=\"").nth(1).unwrap().split('"').next().unwrap();
            start + offset.parse::<usize>().unwrap()
        };
        let length = |i: usize| u64::from_le_bytes(out[i..i + 8].try_into().unwrap());
        assert_eq!((length(at("Points")), length(at("offsets")), length(at("speed"))), (24, 16, 8));
        let second = f32::from_le_bytes(out[at("speed") + 12..at("speed") + 16].try_into().unwrap());
        assert_eq!(second, 2.0);
    }
}
