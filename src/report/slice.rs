// SPDX-License-Identifier: MIT OR Apache-2.0
//! A cell field on a plane through the middle of the mesh, as a PNG.
//!
//! Reads the mesh (m) and one number per cell; writes pixels. Points outside the mesh stay white. Knows no coupling.

use crate::locate::Locator;
use crate::mesh::{Mesh, NONE};
use std::io;

/// Pixels of the longer side.
const LONGEST: f64 = 420.0;

/// A picture and what it shows.
pub struct Slice {
    /// axes to the right and upwards
    pub axes: [char; 2],
    /// where it cuts the third axis, m
    pub at: f64,
    /// width and height
    pub pixels: [u32; 2],
    /// the file
    pub png: Vec<u8>,
}

/// White to dark blue over 0 … 1.
fn colour(x: f64) -> [u8; 3] {
    let stops = [
        [255.0, 255.0, 204.0],
        [161.0, 218.0, 180.0],
        [65.0, 182.0, 196.0],
        [44.0, 127.0, 184.0],
        [37.0, 52.0, 148.0],
    ];
    let s = x.clamp(0.0, 1.0) * (stops.len() - 1) as f64;
    let i = (s as usize).min(stops.len() - 2);
    let f = s - i as f64;
    [0, 1, 2].map(|c| (stops[i][c] + f * (stops[i + 1][c] - stops[i][c])) as u8)
}

/// The colours of `Slice` over their range, as a narrow PNG.
pub fn scale() -> io::Result<Vec<u8>> {
    let pixels: Vec<u8> = (0..12).flat_map(|_| (0..200).flat_map(|x| colour(f64::from(x) / 199.0))).collect();
    png(200, 12, &pixels)
}

fn png(width: u32, height: u32, pixels: &[u8]) -> io::Result<Vec<u8>> {
    let mut out = Vec::new();
    let mut e = ::png::Encoder::new(&mut out, width, height);
    e.set_color(::png::ColorType::Rgb);
    e.set_depth(::png::BitDepth::Eight);
    let mut w = e.write_header().map_err(io::Error::other)?;
    w.write_image_data(pixels).map_err(io::Error::other)?;
    w.finish().map_err(io::Error::other)?;
    Ok(out)
}

/// `field` / `most` on the plane across `axis` (0, 1, 2).
pub fn slice(mesh: &Mesh, locator: &Locator, field: &[f64], most: f64, axis: usize) -> io::Result<Slice> {
    let (right, up) = [(1, 2), (0, 2), (0, 1)][axis];
    let [low, high] = mesh.bounds;
    let extent = |a: usize| high[a] - low[a];
    let scale = LONGEST / extent(right).max(extent(up));
    let size = |a: usize| (extent(a) * scale).round().max(8.0) as usize;
    let (width, height) = (size(right), size(up));
    // off the middle by a hair: there may be faces
    let at = low[axis] + extent(axis) * 0.500_37;
    let mut points = Vec::with_capacity(width * height);
    for y in (0..height).rev() {
        for x in 0..width {
            let mut p = [at; 3];
            p[right] = low[right] + (x as f64 + 0.503) / width as f64 * extent(right);
            p[up] = low[up] + (y as f64 + 0.503) / height as f64 * extent(up);
            points.push(p);
        }
    }
    let mut hosts = vec![NONE; points.len()];
    // what has no host stays NONE
    for lost in locator.locate(mesh, &mut points, &mut hosts).err().unwrap_or_default() {
        hosts[lost.index] = NONE;
    }
    let pixel = |h: &u32| match field.get(*h as usize) {
        Some(v) if most > 0.0 => colour(v / most),
        Some(_) => colour(0.0),
        None => [255; 3],
    };
    let pixels: Vec<u8> = hosts.iter().flat_map(pixel).collect();
    let name = |a: usize| ['x', 'y', 'z'][a];
    let png = png(width as u32, height as u32, &pixels)?;
    Ok(Slice { axes: [name(right), name(up)], at, pixels: [width as u32, height as u32], png })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scheme::testbench::column;

    #[test]
    fn each_cell_has_its_colour() {
        let mesh = column(4, 1.0, 1.0);
        let field = [0.0, 0.25, 0.5, 1.0];
        let s = slice(&mesh, &Locator::new(&mesh), &field, 1.0, 2).unwrap();
        assert_eq!((s.axes, s.pixels), (['x', 'y'], [420, 105]));
        let mut r = ::png::Decoder::new(io::Cursor::new(&s.png)).read_info().unwrap();
        let mut pixels = vec![0; r.output_buffer_size().unwrap()];
        r.next_frame(&mut pixels).unwrap();
        for (cell, v) in field.iter().enumerate() {
            let at = 3 * (50 * 420 + 105 * cell + 52);
            assert_eq!(pixels[at..at + 3], colour(*v));
        }
    }
}
