// SPDX-License-Identifier: MIT OR Apache-2.0
//! The cells that particles of one host may go to: found once per cell, kept short.
//!
//! 4 bytes per cell and 24 more per image; the rest is the mesh's. A cell is left out if no point of the host is near enough to
//! it for its own bell, to tell the local size, nor for the widest bell of the local sizes. Lengths m.

use super::images::Around;
use crate::locate::GAP;
use crate::mesh::geometry::{V, dot, length, sub};
use crate::mesh::{Mesh, NONE};

/// Set in a cell's number: it is an image, and has a place of its own.
const IMAGE: u32 = 1 << 31;

/// Cells around a host by number, images of one following each other.
#[derive(Debug, Default)]
pub(super) struct Ring {
    cell: Box<[u32]>,
    /// of the images, in their order, m
    place: Box<[V]>,
}

/// Sizes of the mesh's cells.
#[derive(Debug, Default)]
pub(super) struct Sizes {
    /// centre and cube root of the volume, m: all that is read of a cell, in half a line of the cache
    pub cell: Vec<[f64; 4]>,
    /// furthest corner from the centre, m
    pub extent: Vec<f64>,
    /// the mesh's walls are (`images::bent`)
    pub bent: bool,
}

/// f64::max without a thought for NaN.
#[inline]
fn more(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

impl Ring {
    /// Cells that a bell around a point of the host may reach; it ends at `end` local sizes.
    pub fn find(mesh: &Mesh, sizes: &Sizes, host: u32, end: f64, around: &mut Around) -> Self {
        assert!(mesh.len() <= IMAGE as usize);
        let (home, extent) = (host as usize, &sizes.extent);
        let size = |c: u32| sizes.cell[c as usize][3];
        let sides = mesh.sides(home);
        let across = sides.iter().filter(|f| f.across != NONE);
        let largest = across.map(|f| size(f.across)).fold(size(host), f64::max);
        around.find(mesh, extent, host, extent[home] + end * largest, sizes.bent);
        let (points, centre) = (&mesh.faces.points, mesh.centre[home]);
        let corners: Vec<V> = mesh.corners(home).iter().map(|p| sub(points[*p as usize], centre)).collect();
        let furthest = |n: V| corners.iter().map(|p| dot(n, *p)).fold(f64::NEG_INFINITY, more);
        // beyond which plane no point of the host lies, by its sides' normals: its corners, or the side's plane where it is warped
        let mut plane = true;
        let planes = sides.iter().map(|s| {
            let n = [s.plane[0], s.plane[1], s.plane[2]];
            let (side, corner) = (s.plane[3] - dot(n, centre), furthest(n));
            plane &= (side - corner).abs() < 1e-9 * extent[home];
            (n, more(side, corner))
        });
        let planes: Vec<(V, f64)> = planes.collect();
        // between warped faces a particle may lie outside of its host
        let slack = if plane { 1e-6 * extent[home] } else { GAP * size(host) };
        // distance of a place from the host, no more than it is
        let away = |x: V| {
            let d = sub(x, centre);
            let far = length(d);
            // beyond all corners, seen from there; the place itself, if it is the centre
            let ahead = if plane && far > 0.0 { far - furthest(d) / far } else { far - extent[home] };
            planes.iter().map(|(n, top)| dot(*n, d) - top).fold(ahead, more) - slack
        };
        let seen = around.seen().map(|(c, at)| (c, at, away(at.unwrap_or(mesh.centre[c as usize]))));
        let seen: Vec<(u32, Option<V>, f64)> = seen.collect();
        let own = seen.iter().filter(|(c, _, away)| *away <= end * size(*c));
        let widest = own.map(|(c, ..)| size(*c)).fold(size(host), f64::max) * (1.0 + 1e-9);
        let reached = || seen.iter().filter(|(c, _, away)| *away <= end * widest.max(size(*c)));
        Self {
            cell: reached().map(|(c, at, _)| if at.is_some() { c | IMAGE } else { *c }).collect(),
            place: reached().filter_map(|e| e.1).collect(),
        }
    }

    /// Cells as they are seen: number, centre and size.
    #[inline]
    pub fn seen<'a>(&'a self, sizes: &'a Sizes) -> impl ExactSizeIterator<Item = (u32, [f64; 4])> + 'a {
        let mut place = self.place.iter();
        self.cell.iter().map(move |c| {
            let own = c & !IMAGE;
            let [x, y, z, size] = sizes.cell[own as usize];
            let image = if *c == own { None } else { place.next() };
            (own, image.map_or([x, y, z, size], |p| [p[0], p[1], p[2], size]))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::locate::Locator;
    use crate::map::images::bent;
    use crate::mesh::made::Made;

    /// Every cell whose own bell holds the particle, or that its bell holds, is in the ring of its host.
    #[test]
    fn nothing_in_a_bell_is_left_out() {
        let (size, end) = ([0.06, 0.04, 0.05], 2.4);
        let mut shares = Vec::new();
        for made in [
            Made::tet([3, 2, 3], size),
            Made::tet([4, 2, 4], size).mirrored().cyclic([true, false, true]),
            Made::graded([6, 4, 5], size),
            Made::hex([6, 4, 5], size).jiggled(0.3),
            Made::poly([4, 3, 3], size),
        ] {
            let mesh = made.mesh();
            let cells = mesh.centre.iter().zip(&mesh.volume);
            let cell = cells.map(|([x, y, z], v)| [*x, *y, *z, v.cbrt()]).collect();
            let sizes = Sizes { cell, extent: mesh.extents(), bent: bent(&mesh) };
            let (mut around, mut seed) = (Around::default(), 4);
            let mut random = || crate::bench::scene::random(&mut seed);
            let (mut kept, mut all) = (0, 0);
            for _ in 0..300 {
                let (mut at, mut host) = ([size.map(|s| s * random())], [NONE]);
                Locator::new(&mesh).locate(&mesh, &mut at, &mut host).unwrap();
                let ring = Ring::find(&mesh, &sizes, host[0], end, &mut around);
                let ring: Vec<(u32, V)> = ring.seen(&sizes).map(|(c, [x, y, z, _])| (c, [x, y, z])).collect();
                let list = around.seen().map(|(c, at)| (c, at.unwrap_or(mesh.centre[c as usize])));
                let list: Vec<(u32, V)> = list.collect();
                let far = |e: &(u32, V)| length(sub(e.1, at[0]));
                let size = |e: &(u32, V)| sizes.cell[e.0 as usize][3];
                let own = list.iter().filter(|e| far(e) < end * size(e));
                // no mean of the sizes is larger
                let widest = own.map(size).fold(0.0, f64::max);
                for e in &list {
                    let inside = far(e) < end * widest.max(size(e));
                    assert!(!inside || ring.contains(e), "{made:?} {at:?}: {e:?}");
                }
                assert!(ring.is_sorted_by_key(|e| e.0));
                (kept, all) = (kept + ring.len(), all + list.len());
            }
            shares.push((kept / 300, all / 300));
        }
        println!("kept, of found: {shares:?}");
        assert!(
            shares.iter().all(|(kept, all)| kept <= all)
                && shares.iter().filter(|(kept, all)| kept < all).count() > 2
        );
    }
}
