// SPDX-License-Identifier: MIT OR Apache-2.0
//! Cells as mappings need them: every cell bounded by plane facets with their corners, compact. A warped face is
//! the fan of triangles about its centre, the same fan for both of its cells, so cells fill space without gap or
//! overlap. Lengths m. About 450 bytes per hexahedron. Does not know particles.

use crate::mesh::geometry::{V, add, canonical, cross, dot, face, length, scale, sub};
use crate::mesh::{Mesh, NONE};

/// A plane polygon of a cell's surface.
#[derive(Clone, Copy, Debug)]
pub struct Facet {
    /// outward unit normal and offset: n · x = offset on the facet
    pub plane: [f64; 4],
    /// cell across or `NONE`
    pub across: u32,
    /// index in `mesh.sides`
    pub side: u32,
    first: u32,
    count: u32,
}

/// All cells of a mesh.
#[derive(Clone, Debug, Default)]
pub struct Cells {
    start: Vec<u32>,
    facets: Vec<Facet>,
    loops: Vec<u32>,
    points: Vec<V>,
    /// some face is warped: the cell is not convex to rounding
    warped: Vec<bool>,
}

/// Largest distance of a corner from its face's plane that counts as rounding, relative to the cell size.
const PLANE: f64 = 1e-9;

impl Cells {
    /// From the mesh.
    pub fn new(mesh: &Mesh) -> Self {
        let mut c = Self { start: vec![0], points: mesh.faces.points.clone(), ..Self::default() };
        for slot in 0..mesh.len() {
            let tolerance = PLANE * mesh.volume[slot].cbrt();
            let mut warped = false;
            for (i, (side, corners)) in mesh.sides(slot).iter().zip(mesh.loops(slot)).enumerate() {
                let number = (mesh.side_start[slot] as usize + i) as u32;
                let plane = side.plane;
                let corners = c.outward(corners, [plane[0], plane[1], plane[2]], 1.0);
                let off = |p: &u32| side.beyond(&c.points[*p as usize]).abs();
                if corners.iter().map(off).fold(0.0, f64::max) <= tolerance {
                    c.put(plane, side.across, number, &corners);
                    continue;
                }
                warped = true;
                let points: Vec<V> = corners.iter().map(|p| c.points[*p as usize]).collect();
                let middle = c.points.len() as u32;
                c.points.push(face(&points).centre);
                for k in 0..corners.len() {
                    let triangle = [corners[k], corners[(k + 1) % corners.len()], middle];
                    let [p, q, r] = triangle.map(|t| c.points[t as usize]);
                    let n = cross(sub(q, p), sub(r, p));
                    let size = length(n);
                    if size > 0.0 {
                        let n = scale(n, 1.0 / size);
                        c.put([n[0], n[1], n[2], dot(n, r)], side.across, number, &triangle);
                    }
                }
            }
            c.start.push(c.facets.len() as u32);
            c.warped.push(warped);
        }
        c
    }
    fn put(&mut self, plane: [f64; 4], across: u32, side: u32, corners: &[u32]) {
        let first = self.loops.len() as u32;
        self.loops.extend(corners);
        self.facets.push(Facet { plane, across, side, first, count: corners.len() as u32 });
    }
    /// The loop from its smallest point on, counter-clockwise seen from outside: the same however the mesh is cut.
    fn outward(&self, corners: &[u32], normal: V, sign: f64) -> Vec<u32> {
        let p: Vec<V> = corners.iter().map(|c| self.points[*c as usize]).collect();
        let (canon, _) = canonical(&p);
        let n = corners.len();
        let area = (1..n - 1)
            .fold([0.0; 3], |s, i| add(s, cross(sub(canon[i], canon[0]), sub(canon[i + 1], canon[0]))));
        let mut list: Vec<u32> =
            canon.iter().map(|x| corners[p.iter().position(|y| y == x).unwrap_or(0)]).collect();
        if dot(area, normal) * sign < 0.0 {
            list[1..].reverse();
        }
        list
    }
    /// Facets of a cell.
    #[inline]
    pub fn facets(&self, cell: u32) -> &[Facet] {
        &self.facets[self.start[cell as usize] as usize..self.start[cell as usize + 1] as usize]
    }
    /// Point numbers of a facet, counter-clockwise seen from outside.
    #[inline]
    pub fn corners(&self, f: &Facet) -> &[u32] {
        &self.loops[f.first as usize..(f.first + f.count) as usize]
    }
    /// A point (m).
    #[inline]
    pub fn point(&self, p: u32) -> V {
        self.points[p as usize]
    }
    /// Number of cells.
    pub fn len(&self) -> usize {
        self.warped.len()
    }
    /// No cell at all.
    pub fn is_empty(&self) -> bool {
        self.warped.is_empty()
    }
    /// Number of points.
    pub fn points(&self) -> usize {
        self.points.len()
    }
    /// Not convex to rounding.
    pub fn warped(&self, cell: u32) -> bool {
        self.warped[cell as usize]
    }
    /// Distance from x to the nearest plane of a cell, < 0 beyond one (m).
    #[inline]
    pub fn depth(&self, cell: u32, x: V) -> f64 {
        let d = |f: &Facet| f.plane[3] - (f.plane[0] * x[0] + f.plane[1] * x[1] + f.plane[2] * x[2]);
        self.facets(cell).iter().map(d).fold(f64::INFINITY, f64::min)
    }
    /// Is x inside? By planes for convex cells, else by the solid angle of the surface.
    #[inline]
    pub fn inside(&self, cell: u32, x: V) -> bool {
        if !self.warped[cell as usize] {
            return self.depth(cell, x) >= 0.0;
        }
        let mut angle = 0.0;
        for f in self.facets(cell) {
            let c = self.corners(f);
            let p = sub(self.point(c[0]), x);
            for k in 1..c.len() - 1 {
                let (q, r) = (sub(self.point(c[k]), x), sub(self.point(c[k + 1]), x));
                let (a, b, d) = (length(p), length(q), length(r));
                let lower = a * b * d + dot(p, q) * d + dot(q, r) * a + dot(r, p) * b;
                // van Oosterom & Strackee 1983: tan(Ω/2) of a triangle
                angle += 2.0 * dot(p, cross(q, r)).atan2(lower);
            }
        }
        angle > 2.0 * std::f64::consts::PI
    }
    /// The tetrahedra (centre, face centre, two corners) of a cell.
    pub fn tetrahedra<'a>(&'a self, mesh: &'a Mesh, cell: u32) -> impl Iterator<Item = [V; 4]> + 'a {
        self.facets(cell).iter().flat_map(move |f| {
            let c = self.corners(f);
            let middle = scale(c.iter().fold([0.0; 3], |s, p| add(s, self.point(*p))), 1.0 / c.len() as f64);
            (0..c.len()).map(move |k| {
                [mesh.centre[cell as usize], middle, self.point(c[k]), self.point(c[(k + 1) % c.len()])]
            })
        })
    }
    /// Where the walk from `cell` towards x ends: the cell that holds it, or the last one before a wall; by mean
    /// planes of faces. x comes back shifted through the cyclic faces crossed. Between warped faces the walk may
    /// not settle: it then ends after some steps in one of the cells around the point.
    pub fn walk(&self, mesh: &Mesh, from: u32, x: &mut V) -> u32 {
        let mut cell = from;
        let (mut before, mut steps) = (NONE, 0);
        loop {
            let mut worst = (0.0, None);
            for s in mesh.sides(cell as usize) {
                let out = s.beyond(x);
                if s.across != NONE && out > worst.0 {
                    worst = (out, Some(s));
                }
            }
            let Some(s) = worst.1 else { break };
            // to and fro across one warped face: the lower cell
            if steps > 1000 || (s.across == before && !s.shifts() && self.warped(cell) && cell < before) {
                break;
            }
            (before, steps) = (cell, steps + 1);
            cell = s.across;
            *x = add(*x, mesh.shift(s));
        }
        cell
    }
}
