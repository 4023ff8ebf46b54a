// SPDX-License-Identifier: MIT OR Apache-2.0
//! A convex polyhedron cut by half-spaces: corners (m) and faces, each with a number of the caller's. Corners within a
//! tolerance of the plane (m) count as inside, so planes that only touch, and corners where many planes meet, do no
//! harm. Its memory is used again from one polyhedron to the next. Does not know cells.

use super::geometry::{V, add, cross, dot, length, scale, sub};

/// Number of the faces of the first box.
pub const BOX: u32 = u32::MAX;

/// The polyhedron.
#[derive(Default)]
pub struct Convex {
    /// a corner cut off is not a number
    corners: Vec<V>,
    /// corners that may be used again
    free: Vec<u32>,
    /// number, and its first and last entry in `loops`
    faces: Vec<(u32, u32, u32)>,
    loops: Vec<u32>,
    /// distance of each corner beyond the plane
    beyond: Vec<f64>,
    /// edges cut: inner corner, outer corner, where they are cut
    cuts: Vec<(u32, u32, u32)>,
    /// corners of the new face, by angle
    cap: Vec<(f64, u32)>,
    next_faces: Vec<(u32, u32, u32)>,
    next_loops: Vec<u32>,
}

impl Convex {
    /// A cube about the origin.
    pub fn start(&mut self, half: f64) {
        let bit = |v: u32, a: u32| if v >> a & 1 == 1 { half } else { -half };
        self.free.clear();
        self.corners.clear();
        self.corners.extend((0..8).map(|v| [bit(v, 0), bit(v, 1), bit(v, 2)]));
        self.faces.clear();
        self.loops.clear();
        for axis in 0..3u32 {
            for side in 0..2u32 {
                let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
                let at = |p: u32, q: u32| (side << axis) + (p << u) + (q << v);
                let first = self.loops.len() as u32;
                self.loops.extend([at(0, 0), at(1, 0), at(1, 1), at(0, 1)]);
                self.faces.push((BOX, first, first + 4));
            }
        }
    }
    /// Keeps the side n · x ≤ d, n of length 1; the new face has the number `by`. Was anything cut off?
    pub fn cut(&mut self, n: V, d: f64, tolerance: f64, by: u32) -> bool {
        self.beyond.clear();
        self.beyond.extend(self.corners.iter().map(|x| dot(n, *x) - d));
        if !self.beyond.iter().any(|s| *s > tolerance) {
            return false;
        }
        self.cuts.clear();
        self.next_faces.clear();
        self.next_loops.clear();
        for k in 0..self.faces.len() {
            let (number, from, to) = self.faces[k];
            let first = self.next_loops.len();
            let mut a = self.loops[to as usize - 1];
            for k in from..to {
                let b = self.loops[k as usize];
                let inside = |v: u32| self.beyond[v as usize] <= tolerance;
                match (inside(a), inside(b)) {
                    (true, false) => {
                        let cut = self.between(a, b, tolerance);
                        self.put(first, cut);
                    }
                    (false, true) => {
                        let cut = self.between(b, a, tolerance);
                        self.put(first, cut);
                        self.put(first, b);
                    }
                    (true, true) => self.put(first, b),
                    (false, false) => (),
                }
                a = b;
            }
            while self.next_loops.len() > first + 1
                && self.next_loops[first] == self.next_loops[self.next_loops.len() - 1]
            {
                self.next_loops.pop();
            }
            if self.next_loops.len() >= first + 3 {
                self.next_faces.push((number, first as u32, self.next_loops.len() as u32));
            } else {
                self.next_loops.truncate(first);
            }
        }
        self.close(n, by);
        for v in 0..self.beyond.len() {
            if self.beyond[v] > tolerance {
                self.corners[v] = [f64::NAN; 3];
                self.free.push(v as u32);
            }
        }
        std::mem::swap(&mut self.faces, &mut self.next_faces);
        std::mem::swap(&mut self.loops, &mut self.next_loops);
        true
    }
    /// Next corner of the face that begins at `first`.
    fn put(&mut self, first: usize, corner: u32) {
        if self.next_loops.len() == first || self.next_loops[self.next_loops.len() - 1] != corner {
            self.next_loops.push(corner);
        }
    }
    /// The corner where the edge from an inner to an outer one is cut.
    fn between(&mut self, inner: u32, outer: u32, tolerance: f64) -> u32 {
        if let Some(c) = self.cuts.iter().find(|c| (c.0, c.1) == (inner, outer)) {
            return c.2;
        }
        let (s, t) = (self.beyond[inner as usize], self.beyond[outer as usize]);
        let at = if s >= -tolerance {
            inner
        } else {
            let (p, q) = (self.corners[inner as usize], self.corners[outer as usize]);
            let x = add(p, scale(sub(q, p), s / (s - t)));
            match self.free.pop() {
                Some(v) => {
                    self.corners[v as usize] = x;
                    v
                }
                None => {
                    self.corners.push(x);
                    self.corners.len() as u32 - 1
                }
            }
        };
        self.cuts.push((inner, outer, at));
        at
    }
    /// The new face: the cuts in the order of their angle about their middle.
    fn close(&mut self, n: V, by: u32) {
        self.cap.clear();
        for c in &self.cuts {
            if !self.cap.iter().any(|v| v.1 == c.2) {
                self.cap.push((0.0, c.2));
            }
        }
        if self.cap.len() < 3 {
            return;
        }
        let at = |v: u32| self.corners[v as usize];
        let middle =
            scale(self.cap.iter().fold([0.0; 3], |s, v| add(s, at(v.1))), 1.0 / self.cap.len() as f64);
        let axis = if n[0].abs() < 0.6 { [1.0, 0.0, 0.0] } else { [0.0, 1.0, 0.0] };
        let u = cross(n, axis);
        let w = cross(n, u);
        for k in 0..self.cap.len() {
            let d = sub(self.corners[self.cap[k].1 as usize], middle);
            self.cap[k].0 = dot(d, w).atan2(dot(d, u));
        }
        self.cap.sort_by(|p, q| p.0.total_cmp(&q.0));
        let first = self.next_loops.len() as u32;
        self.next_loops.extend(self.cap.iter().map(|v| v.1));
        self.next_faces.push((by, first, self.next_loops.len() as u32));
    }
    /// Distance of the furthest corner from the origin.
    pub fn radius(&self) -> f64 {
        self.corners.iter().map(|x| dot(*x, *x)).fold(0.0, f64::max).sqrt()
    }
    /// Number and area (m2) of each face.
    pub fn areas(&self) -> impl Iterator<Item = (u32, f64)> + '_ {
        self.faces.iter().map(|(number, from, to)| {
            let x = |k: u32| self.corners[self.loops[k as usize] as usize];
            let first = x(*from);
            let fan = |s: V, k: u32| add(s, cross(sub(x(k), first), sub(x(k + 1), first)));
            (*number, 0.5 * length((from + 1..to - 1).fold([0.0; 3], fan)))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cube_without_its_corners() {
        let mut c = Convex::default();
        c.start(1.0);
        let d = 1.0 / 3f64.sqrt();
        for k in 0..8 {
            let n = [0, 1, 2].map(|a| if k >> a & 1 == 1 { d } else { -d });
            // through the corners of a cuboctahedron, which must not be cut twice
            assert!(c.cut(n, 2.0 * d, 1e-12, k));
            assert!(!c.cut(n, 2.0 * d, 1e-12, 99));
        }
        let areas: Vec<_> = c.areas().collect();
        assert_eq!(areas.len(), 14);
        for (number, area) in areas {
            let expected = if number == BOX { 2.0 } else { 0.5 * 3f64.sqrt() };
            assert!((area - expected).abs() < 1e-12, "{number} {area}");
        }
        assert!((c.radius() - 2f64.sqrt()).abs() < 1e-12);
        assert!(!c.cut([1.0, 0.0, 0.0], 1.0, 1e-12, 99));
        assert!(c.cut([1.0, 0.0, 0.0], 0.0, 1e-12, 99));
        let cut: f64 = c.areas().filter(|a| a.0 == 99).map(|a| a.1).sum();
        assert!((cut - 4.0).abs() < 1e-12, "{cut}");
    }
}
