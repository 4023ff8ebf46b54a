// SPDX-License-Identifier: MIT OR Apache-2.0
//! Laplacian entries from the Voronoi diagram of the cell centres: a_ij = |common Voronoi face| / |x_j − x_i| (m), while
//! the masses stay the volumes of the cells.
//!
//! Across the faces of a mesh the two-point flux |S|/d is consistent only where the line between two centres is normal
//! to their face; tetrahedra are far from that. Voronoi faces are normal to it by construction, so that away from walls
//! Σ_j a_ij (x_j − x_i) = 0 and ½ Σ_ij a_ij d dᵀ = |Ω| I, exactly, on any mesh, with a_ij = a_ji > 0 (Eymard, Gallouët &
//! Herbin 2000, §9.1: admissible meshes). On hexahedra of one size both are the same; on graded ones Voronoi cells are not
//! as wide as the cells, and the links of the faces are to be preferred.
//!
//! Every cell's Voronoi cell is a box cut by bisectors with the centres around, nearest first, until none is near enough
//! to cut. Centres are found by a walk through faces, through cyclics with their shift. At walls the Voronoi cell is cut
//! by the planes of boundary faces, which is what the mirrored centre would do.
//!
//! Limits. A wall counts by the planes of its faces (warped: mean planes), those of the cell itself and those near it that
//! leave the cell and its neighbours nearly whole; what lies beyond them is not seen, but for face neighbours. In domains
//! that are not convex (steps, baffles, outside of tubes) the two cells of a link may see different parts of their common
//! face: the mean is taken, which keeps symmetry and sign, and consistency is lost in those cells only. Round the edge of a
//! baffle cells may be linked. What the mesh connects stays connected: a face between parts that would come apart keeps |S|/d.
//! Cost: 15 to 50 µs per cell, once. Does not depend on how the mesh is cut in pieces nor on threads.

use super::clip::Convex;
use super::geometry::{V, add, dot, length, sub};
use super::pairs::both;
use super::{Link, Mesh, NONE, Side};
use crate::threads;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Distance of a corner from a plane that counts as none, relative to the cell.
const TOUCHES: f64 = 1e-10;
/// What of a cell may lie beyond a wall near it, relative to the cell: curved walls.
const ROUND: f64 = 0.25;
/// Cells that one thread takes at a time, at least, and pieces at most: each has numbers for all cells.
const PIECE: usize = 4096;
const PIECES: usize = 64;

impl Mesh {
    /// Ids, centres, volumes and Voronoi links: all that smoothers look at; sides, faces and pieces are left out.
    pub fn with_voronoi_links(&self) -> Self {
        let (link_start, links) = links(self);
        Self {
            ids: self.ids.clone(),
            centre: self.centre.clone(),
            volume: self.volume.clone(),
            slots: Vec::new(),
            side_start: vec![0; self.len() + 1],
            sides: Vec::new(),
            shifts: self.shifts.clone(),
            link_start,
            links,
            patch_names: self.patch_names.clone(),
            bounds: self.bounds,
            faces: super::Faces { start: vec![0], ..super::Faces::default() },
        }
    }
}

/// A centre seen from the cell whose Voronoi cell is made.
struct Image {
    cell: u32,
    /// what is added to positions of that cell, as seen from here, m
    offset: V,
    /// from centre to centre
    way: V,
    distance: f64,
    /// the image before of the same cell
    before: u32,
    /// reached through a face of the cell itself
    adjacent: bool,
}

/// An image to be looked at: the distance of the nearest point its cell may have, and the image.
#[derive(PartialEq)]
struct Next(f64, u32);
impl Eq for Next {}
impl PartialOrd for Next {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}
impl Ord for Next {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.0.total_cmp(&other.0).then(self.1.cmp(&other.1))
    }
}

struct Walk<'a> {
    mesh: &'a Mesh,
    /// furthest corner of each cell from its centre, m
    extent: &'a [f64],
    convex: Convex,
    images: Vec<Image>,
    next: BinaryHeap<Reverse<Next>>,
    /// by cell: its last image; `NONE`: not seen
    last: Vec<u32>,
    /// walls that count, seen from the centre
    walls: Vec<[f64; 4]>,
}

impl Walk<'_> {
    fn see(&mut self, from: usize, cell: u32, offset: V, adjacent: bool) {
        let size = self.extent[cell as usize];
        let mut k = self.last[cell as usize];
        while k != NONE {
            let image = &self.images[k as usize];
            if length(sub(image.offset, offset)) < 1e-6 * size {
                return;
            }
            k = image.before;
        }
        let way = add(sub(self.mesh.centre[cell as usize], self.mesh.centre[from]), offset);
        let (number, distance) = (self.images.len() as u32, length(way));
        let before = std::mem::replace(&mut self.last[cell as usize], number);
        self.images.push(Image { cell, offset, way, distance, before, adjacent });
        self.next.push(Reverse(Next((distance - size).max(0.0), number)));
    }

    /// Does a boundary face of an image bound the Voronoi cell? Its plane from the centre.
    fn wall(&self, from: usize, image: &Image, side: usize, radius: f64) -> Option<[f64; 4]> {
        // the centre, in the frame of the image
        let (mesh, origin) = (self.mesh, sub(self.mesh.centre[from], image.offset));
        let p = mesh.sides[side].plane;
        let (n, own) = ([p[0], p[1], p[2]], image.distance == 0.0);
        let d = p[3] - dot(n, origin);
        if d <= 0.0 || d >= radius {
            return None;
        }
        if !own {
            // only the part of the plane that is there
            let corners = mesh.faces.corners(mesh.faces.of_side[side]);
            let x = |c: &u32| sub(mesh.faces.points[*c as usize], origin);
            let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
            for c in corners.iter().map(x) {
                (low, high) = ([0, 1, 2].map(|a| low[a].min(c[a])), [0, 1, 2].map(|a| high[a].max(c[a])));
            }
            if length([0, 1, 2].map(|a| low[a].max(-high[a]).max(0.0))) > radius {
                return None;
            }
            // a plane that cuts off much of the cell or of one next to it is round a corner of the domain
            let reaches = |cell: usize, shift: V| {
                let to = add(mesh.centre[from], shift);
                let beyond = |c: &u32| dot(n, sub(mesh.faces.points[*c as usize], to)) - d;
                mesh.loops(cell).flatten().any(|c| beyond(c) > ROUND * self.extent[from])
            };
            let next = |s: &Side| s.across != NONE && reaches(s.across as usize, mesh.shift(s));
            if reaches(from, [0.0; 3]) || mesh.sides(from).iter().any(next) {
                return None;
            }
        }
        Some([n[0], n[1], n[2], d])
    }

    /// (neighbour, a) of one cell by neighbour, images of the same one added up.
    fn row(&mut self, from: usize, row: &mut Vec<(u32, f64)>) {
        let mesh = self.mesh;
        let tolerance = TOUCHES * mesh.volume[from].cbrt();
        self.convex.start(length(sub(mesh.bounds[1], mesh.bounds[0])));
        let mut radius = self.convex.radius();
        self.walls.clear();
        self.see(from, from as u32, [0.0; 3], true);
        while let Some(Reverse(Next(nearest, number))) = self.next.pop() {
            if nearest > 2.0 * radius {
                break;
            }
            let image = &self.images[number as usize];
            let (cell, offset, own) = (image.cell as usize, image.offset, number == 0);
            let hidden = |w: &[f64; 4]| dot([w[0], w[1], w[2]], image.way) > w[3] + tolerance;
            if !image.adjacent && self.walls.iter().any(hidden) {
                continue;
            }
            let mut smaller = false;
            if image.distance < 2.0 * radius && image.distance > tolerance {
                let n = image.way.map(|x| x / image.distance);
                smaller = self.convex.cut(n, 0.5 * image.distance, tolerance, number);
            }
            for side in mesh.side_start[cell] as usize..mesh.side_start[cell + 1] as usize {
                let s = &mesh.sides[side];
                if s.across != NONE {
                    let offset = sub(offset, mesh.shift(s));
                    self.see(from, s.across, offset, own);
                } else if let Some(w) = self.wall(from, &self.images[number as usize], side, radius) {
                    smaller |= self.convex.cut([w[0], w[1], w[2]], w[3], tolerance, super::clip::BOX);
                    self.walls.push(w);
                }
            }
            if smaller {
                radius = self.convex.radius();
            }
        }
        row.clear();
        for (number, area) in self.convex.areas().filter(|a| a.0 != super::clip::BOX) {
            let image = &self.images[number as usize];
            if image.cell as usize != from {
                row.push((image.cell, area / image.distance));
            }
        }
        row.sort_by(|p, q| p.0.cmp(&q.0).then(p.1.total_cmp(&q.1)));
        row.dedup_by(|next, one| {
            let same = next.0 == one.0;
            one.1 += if same { next.1 } else { 0.0 };
            same
        });
        self.images.drain(..).for_each(|i| self.last[i.cell as usize] = NONE);
        self.next.clear();
    }
}

/// First link of each cell, and the links.
fn links(mesh: &Mesh) -> (Vec<u32>, Vec<Link>) {
    let n = mesh.len();
    let extent = mesh.extents();
    let piece = n.div_ceil(PIECES).max(PIECE);
    let order = mesh.along_curve();
    // rows as each cell sees them
    let parts = threads::map(threads::pieces(n, piece), |range| {
        let mut walk = Walk {
            mesh,
            extent: &extent,
            convex: Convex::default(),
            images: Vec::new(),
            next: BinaryHeap::new(),
            last: vec![NONE; n],
            walls: Vec::new(),
        };
        let (mut ends, mut all, mut row) = (Vec::new(), Vec::new(), Vec::new());
        for c in &order[range] {
            walk.row(*c as usize, &mut row);
            all.extend_from_slice(&row);
            ends.push(all.len());
        }
        (ends, all)
    });
    // by cell
    let mut found: Vec<&[(u32, f64)]> = vec![&[]; n];
    let rows = parts.iter().flat_map(|(ends, all)| {
        let begins = std::iter::once(&0).chain(ends);
        begins.zip(ends).map(|(b, e)| &all[*b..*e])
    });
    order.iter().zip(rows).for_each(|(c, row)| found[*c as usize] = row);
    let mut start = vec![0];
    start.extend(found.iter().scan(0, |end, row| {
        *end += row.len();
        Some(*end)
    }));
    both(mesh, &start, &found.concat())
}
