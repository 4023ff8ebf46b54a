// SPDX-License-Identifier: MIT OR Apache-2.0
//! Pictures of the particles without ParaView: shaded discs coloured by speed, as PNG and animated PNG.
//!
//! Reads positions, radii (m), speeds (m/s) and the box; knows no coupling.

use crate::particles::Particles;
use crate::sums::norm;
use std::fs::File;
use std::io::{self, BufWriter};
use std::path::Path;

const LONGEST: f64 = 640.0; // pixels of the longer side of the box
const LEGEND: usize = 28; // pixels below the box
const BACKGROUND: [u8; 3] = [255, 255, 255];
const INK: [u8; 3] = [40, 40, 40];
/// Colours of speed from rest to the fastest (viridis).
const COLOURS: [[f64; 3]; 6] = [
    [68., 1., 84.],
    [65., 68., 135.],
    [42., 120., 142.],
    [34., 168., 132.],
    [122., 209., 81.],
    [253., 231., 37.],
];
/// 3 x 5 pixel glyphs, rows of three bits.
const GLYPHS: &[(char, [u8; 5])] = &[
    ('0', [7, 5, 5, 5, 7]),
    ('1', [2, 6, 2, 2, 7]),
    ('2', [7, 1, 7, 4, 7]),
    ('3', [7, 1, 7, 1, 7]),
    ('4', [5, 5, 7, 1, 1]),
    ('5', [7, 4, 7, 1, 7]),
    ('6', [7, 4, 7, 5, 7]),
    ('7', [7, 1, 1, 2, 2]),
    ('8', [7, 5, 7, 5, 7]),
    ('9', [7, 5, 7, 1, 7]),
    ('.', [0, 0, 0, 0, 2]),
    ('t', [2, 7, 2, 2, 3]),
    ('=', [0, 7, 0, 7, 0]),
    ('s', [3, 4, 2, 1, 6]),
    ('m', [0, 5, 7, 7, 5]),
    ('/', [1, 1, 2, 4, 4]),
];

struct Frame {
    width: usize,
    height: usize,
    pixels: Vec<u8>,
}

impl Frame {
    fn put(&mut self, x: i64, y: i64, colour: [u8; 3]) {
        if x >= 0 && y >= 0 && (x as usize) < self.width && (y as usize) < self.height {
            let at = 3 * (y as usize * self.width + x as usize);
            self.pixels[at..at + 3].copy_from_slice(&colour);
        }
    }
    fn text(&mut self, x: i64, y: i64, text: &str) {
        for (i, c) in text.chars().enumerate() {
            let Some((_, rows)) = GLYPHS.iter().find(|g| g.0 == c) else { continue };
            for (r, bits) in rows.iter().enumerate() {
                for b in (0..3).filter(|b| bits >> (2 - b) & 1 == 1) {
                    for (dx, dy) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
                        self.put(x + 8 * i as i64 + 2 * b + dx, y + 2 * r as i64 + dy, INK);
                    }
                }
            }
        }
    }
}

/// Takes and keeps frames.
pub struct Camera {
    axis: usize,
    frames: Vec<Frame>,
    fastest: f64,
}

fn colour(fraction: f64) -> [f64; 3] {
    let s = fraction.clamp(0.0, 1.0) * (COLOURS.len() - 1) as f64;
    let i = (s as usize).min(COLOURS.len() - 2);
    [0, 1, 2].map(|c| COLOURS[i][c] + (s - i as f64) * (COLOURS[i + 1][c] - COLOURS[i][c]))
}

impl Camera {
    /// Looks along axis 0, 1 or 2.
    pub fn new(axis: usize) -> Self {
        Self { axis, frames: Vec::new(), fastest: 0.0 }
    }

    /// Draws the particles in a box; the nearest first, what they hide not at all.
    pub fn take(&mut self, time: f64, bounds: [[f64; 3]; 2], p: &Particles) {
        // right and up: x-y seen along z, y-z along x, x-z along y
        let (right, up, depth) = [(1, 2, 0), (0, 2, 1), (0, 1, 2)][self.axis];
        let extent = |a: usize| bounds[1][a] - bounds[0][a];
        let scale = LONGEST / extent(right).max(extent(up));
        let size = |a: usize| (extent(a) * scale).ceil().max(120.0) as usize;
        let (width, height) = (size(right), size(up) + LEGEND);
        let mut f = Frame { width, height, pixels: BACKGROUND.repeat(width * height) };
        let speeds: Vec<f64> = p.velocity.iter().map(|v| norm(*v)).collect();
        if self.frames.len() < 2 || self.fastest == 0.0 {
            // 98th percentile; the same scale for all later frames, rounded to be readable
            let mut sorted = speeds.clone();
            sorted.sort_by(f64::total_cmp);
            let high = sorted.get(sorted.len() * 98 / 100).copied().unwrap_or(0.0);
            self.fastest =
                [0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0].into_iter().find(|s| *s >= high).unwrap_or(high);
            self.fastest = self.fastest.max(0.5);
        }
        let mut order: Vec<usize> = (0..p.len()).collect();
        order.sort_by(|a, b| p.position[*b][depth].total_cmp(&p.position[*a][depth]));
        let mut seen = vec![false; width * height];
        for i in order {
            let x = (p.position[i][right] - bounds[0][right]) * scale;
            let y = (height - LEGEND) as f64 - (p.position[i][up] - bounds[0][up]) * scale;
            let r = (p.radius[i] * scale).max(1.0);
            let near = (p.position[i][depth] - bounds[0][depth]) / extent(depth).max(f64::MIN_POSITIVE);
            let base = colour(speeds[i] / self.fastest);
            for py in (y - r).floor() as i64..=(y + r).ceil() as i64 {
                for px in (x - r).floor() as i64..=(x + r).ceil() as i64 {
                    let inside =
                        px >= 0 && py >= 0 && (px as usize) < width && (py as usize) < height - LEGEND;
                    if !inside || seen[py as usize * width + px as usize] {
                        continue;
                    }
                    let (dx, dy) = ((px as f64 + 0.5 - x) / r, (py as f64 + 0.5 - y) / r);
                    let d2 = dx * dx + dy * dy;
                    if d2 <= 1.0 {
                        seen[py as usize * width + px as usize] = true;
                        let light = (0.55 + 0.45 * (1.0 - d2).sqrt()) * (0.6 + 0.4 * near.clamp(0.0, 1.0));
                        let glint = 60.0 * (1.0 - ((dx + 0.35).powi(2) + (dy + 0.35).powi(2)) * 4.0).max(0.0);
                        f.put(px, py, base.map(|c| (c * light + glint).min(255.0) as u8));
                    }
                }
            }
        }
        self.legend(&mut f, time);
        self.frames.push(f);
    }

    fn legend(&self, f: &mut Frame, time: f64) {
        let (top, width) = ((f.height - LEGEND) as i64, f.width as i64);
        (0..width).for_each(|x| f.put(x, top, INK));
        f.text(4, top + 10, &format!("t={time:.3}s"));
        let bar = width - 12 - 80;
        for x in 0..(bar - 84).max(20) {
            let c = colour(x as f64 / (bar - 84).max(20) as f64);
            (0..8).for_each(|y| f.put(84 + x, top + 11 + y, c.map(|c| c as u8)));
        }
        f.text(width - 76, top + 10, &format!("{:.1}m/s", self.fastest));
    }

    /// The frame taken last.
    pub fn save_last(&self, path: &Path) -> io::Result<()> {
        self.frames.last().map_or(Ok(()), |_| self.save(path, self.frames.len() - 1))
    }

    /// All frames, 12 per second.
    pub fn save_animation(&self, path: &Path) -> io::Result<()> {
        if self.frames.is_empty() { Ok(()) } else { self.save(path, 0) }
    }

    fn save(&self, path: &Path, first: usize) -> io::Result<()> {
        let frames = &self.frames[first..];
        let file = BufWriter::new(File::create(path)?);
        let mut e = png::Encoder::new(file, frames[0].width as u32, frames[0].height as u32);
        e.set_color(png::ColorType::Rgb);
        e.set_depth(png::BitDepth::Eight);
        e.set_compression(png::Compression::Fast);
        if frames.len() > 1 {
            e.set_animated(frames.len() as u32, 0).map_err(io::Error::other)?;
            e.set_frame_delay(1, 12).map_err(io::Error::other)?;
        }
        let mut w = e.write_header().map_err(io::Error::other)?;
        for f in frames {
            w.write_image_data(&f.pixels).map_err(io::Error::other)?;
        }
        w.finish().map_err(io::Error::other)
    }
}
