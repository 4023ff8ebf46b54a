// SPDX-License-Identifier: MIT OR Apache-2.0
//! Boxes of hexahedra, and of the six tetrahedra each can be cut into (Kuhn: one per order of the axes, all along
//! the main diagonal, so neighbours and opposite sides of the box fit; every other one mirrored if asked for).

use super::super::geometry::{V, cross, dot, sub};
use super::{Across, Bend, Made, Soup, hash};
use std::collections::HashMap;

type Corner = [usize; 3];

fn id(n: [usize; 3], c: Corner) -> usize {
    (c[2] * n[1] + c[1]) * n[0] + c[0]
}

/// Corner points of the lattice, x fastest.
fn lattice(m: &Made) -> Vec<V> {
    let axis = |a: usize| -> Vec<f64> {
        let n = m.n[a];
        let ratio = if n > 1 { m.grading[a].powf(1.0 / (n - 1) as f64) } else { 1.0 };
        let sum = |i: usize| {
            if (ratio - 1.0).abs() < 1e-12 { i as f64 } else { (ratio.powi(i as i32) - 1.0) / (ratio - 1.0) }
        };
        (0..=n).map(|i| if i == n { m.size[a] } else { m.size[a] * sum(i) / sum(n) }).collect()
    };
    let x = [axis(0), axis(1), axis(2)];
    let mut points = Vec::with_capacity((m.n[0] + 1) * (m.n[1] + 1) * (m.n[2] + 1));
    for k in 0..=m.n[2] {
        for j in 0..=m.n[1] {
            for i in 0..=m.n[0] {
                let c = [i, j, k];
                let mut p = [x[0][i], x[1][j], x[2][k]];
                if m.jiggle != 0.0 && (0..3).all(|a| c[a] > 0 && c[a] < m.n[a]) {
                    for a in 0..3 {
                        let cell = (x[a][c[a] + 1] - x[a][c[a]]).min(x[a][c[a]] - x[a][c[a] - 1]);
                        p[a] += m.jiggle * hash(c, a) * cell;
                    }
                }
                points.push(bent(m, p));
            }
        }
    }
    points
}

/// A square bent into a disc, lines of the lattice become arcs of ellipses; or x into the radius and y into the angle of half a ring.
fn bent(m: &Made, p: V) -> V {
    match m.bend {
        Bend::None => p,
        Bend::Cylinder => {
            let [u, v] = [0, 1].map(|a| 2.0 * p[a] / m.size[a] - 1.0);
            let [x, y] = [u * (1.0 - 0.5 * v * v).sqrt(), v * (1.0 - 0.5 * u * u).sqrt()];
            [0.5 * m.size[0] * (x + 1.0), 0.5 * m.size[1] * (y + 1.0), p[2]]
        }
        Bend::HalfRing => {
            let (r, turn) = (m.size[0] + p[0], std::f64::consts::PI * p[1] / m.size[1]);
            [r * turn.sin(), 2.0 * m.size[0] - r * turn.cos(), p[2]]
        }
    }
}

fn corners(m: &Made) -> impl Iterator<Item = Corner> + use<> {
    let n = m.n;
    (0..n[2]).flat_map(move |k| (0..n[1]).flat_map(move |j| (0..n[0]).map(move |i| [i, j, k])))
}

/// What lies behind side (axis, high) of lattice cell c: the lattice cell and the image it is in, or nothing.
fn beyond(m: &Made, c: Corner, axis: usize, high: bool) -> Option<(Corner, [i8; 3])> {
    let (mut d, mut offset) = (c, [0; 3]);
    match (high, c[axis]) {
        (true, i) if i + 1 < m.n[axis] => d[axis] += 1,
        (false, i) if i > 0 => d[axis] -= 1,
        _ if !m.cyclic[axis] => return None,
        (true, _) => (d[axis], offset[axis]) = (0, 1),
        (false, _) => (d[axis], offset[axis]) = (m.n[axis] - 1, -1),
    }
    Some((d, offset))
}

pub(super) fn hex(m: &Made) -> Soup {
    let np = m.n.map(|n| n + 1);
    let mut soup = Soup { points: lattice(m), size: m.size, ..Soup::default() };
    for c in corners(m) {
        let low = soup.points[id(np, c)];
        let high = soup.points[id(np, c.map(|i| i + 1))];
        soup.near_centre.push([0, 1, 2].map(|a| 0.5 * (low[a] + high[a])));
        for axis in 0..3 {
            for high in [false, true] {
                let across = match beyond(m, c, axis, high) {
                    None => Across::Wall((2 * axis + usize::from(high)) as u8),
                    Some((d, [0, 0, 0])) if high => Across::Cell(id(m.n, d) as u32),
                    Some((_, [0, 0, 0])) => continue,
                    Some((d, offset)) => Across::Cyclic(id(m.n, d) as u32, offset),
                };
                let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
                let mut face = [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(du, dv)| {
                    let mut p = c;
                    p[axis] += usize::from(high);
                    p[u] += du;
                    p[v] += dv;
                    id(np, p) as u32
                });
                if !high {
                    face.reverse();
                }
                soup.put(id(m.n, c), across, face);
            }
        }
    }
    soup
}

pub(super) fn tet(m: &Made) -> Soup {
    const ORDERS: [[usize; 3]; 6] = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];
    let np = m.n.map(|n| n + 1);
    let mut soup = Soup { points: lattice(m), size: m.size, ..Soup::default() };
    // a face by its sorted points, wrapped through cyclic sides; all its halves
    let mut halves: HashMap<[u32; 3], (usize, [u32; 3], [i8; 3])> = HashMap::new();
    for c in corners(m) {
        for (t, order) in ORDERS.iter().enumerate() {
            let cell = 6 * id(m.n, c) + t;
            // a mirrored box begins at its upper end
            let back = c.map(|i| m.mirrored && i % 2 == 1);
            let mut at = [0, 1, 2].map(|a| c[a] + usize::from(back[a]));
            let mut path = [at; 4];
            for (i, axis) in order.iter().enumerate() {
                at[*axis] = c[*axis] + usize::from(!back[*axis]);
                path[i + 1] = at;
            }
            let p = path.map(|q| soup.points[id(np, q)]);
            soup.near_centre.push([0, 1, 2].map(|a| 0.25 * (p[0][a] + p[1][a] + p[2][a] + p[3][a])));
            for apex in 0..4 {
                let mut f = [0, 1, 2].map(|i| if i < apex { i } else { i + 1 });
                let normal = cross(sub(p[f[1]], p[f[0]]), sub(p[f[2]], p[f[0]]));
                if dot(normal, sub(p[apex], p[f[0]])) > 0.0 {
                    f.swap(1, 2);
                }
                let face = f.map(|i| id(np, path[i]) as u32);
                let on = |axis: usize, at: usize| f.iter().all(|i| path[*i][axis] == at);
                let side = (0..3).find_map(|a| {
                    let high = on(a, m.n[a]).then_some((a, true));
                    on(a, 0).then_some((a, false)).or(high)
                });
                let mut offset = [0i8; 3];
                if let Some((axis, high)) = side {
                    if !m.cyclic[axis] {
                        soup.put(cell, Across::Wall((2 * axis + usize::from(high)) as u8), face);
                        continue;
                    }
                    offset[axis] = if high { 1 } else { -1 };
                }
                let mut key = f.map(|i| {
                    let mut q = path[i];
                    if let Some((axis, _)) = side {
                        q[axis] = 0;
                    }
                    id(np, q) as u32
                });
                key.sort_unstable();
                match halves.remove(&key) {
                    None => {
                        halves.insert(key, (cell, face, offset));
                    }
                    Some((other, points, back)) if side.is_some() => {
                        soup.put(other, Across::Cyclic(cell as u32, back), points);
                        soup.put(cell, Across::Cyclic(other as u32, offset), face);
                    }
                    Some((other, points, _)) => soup.put(other, Across::Cell(cell as u32), points),
                }
            }
        }
    }
    debug_assert!(halves.is_empty());
    soup
}
