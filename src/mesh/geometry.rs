// SPDX-License-Identifier: MIT OR Apache-2.0
//! Geometry of faces and cells as OpenFOAM computes it: fans of triangles, pyramids. Units m.
//!
//! A face is first brought to a canonical loop (smallest point first, then towards the smaller of its two
//! neighbours), so both ranks that share it compute the same bits.

pub type V = [f64; 3];

pub fn add(a: V, b: V) -> V {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}
pub fn sub(a: V, b: V) -> V {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}
pub fn scale(a: V, s: f64) -> V {
    [a[0] * s, a[1] * s, a[2] * s]
}
pub fn dot(a: V, b: V) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
pub fn cross(a: V, b: V) -> V {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}
pub fn length(a: V) -> f64 {
    dot(a, a).sqrt()
}
/// x of m x = b by Cramer's rule; `m` by rows, not singular.
#[inline(always)]
pub fn solve(m: &[V; 3], b: V) -> V {
    let inverse = [cross(m[1], m[2]), cross(m[2], m[0]), cross(m[0], m[1])];
    let det = dot(m[0], inverse[0]);
    [0, 1, 2].map(|i| (0..3).map(|k| inverse[k][i] * b[k]).sum::<f64>() / det)
}

fn less(a: &V, b: &V) -> bool {
    a.partial_cmp(b) == Some(std::cmp::Ordering::Less)
}

/// A face: centre and area vector of its canonical loop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Face {
    pub centre: V,
    pub area: V,
    /// the loop given runs against the canonical one
    pub reversed: bool,
}

/// Canonical loop of a face, and whether it was turned round.
pub fn canonical(points: &[V]) -> (Vec<V>, bool) {
    let n = points.len();
    let first = (1..n).fold(0, |m, i| if less(&points[i], &points[m]) { i } else { m });
    let reversed = less(&points[(first + n - 1) % n], &points[(first + 1) % n]);
    let at = |i: usize| points[if reversed { (first + n - i) % n } else { (first + i) % n }];
    ((0..n).map(at).collect(), reversed)
}

/// Centre and area vector (of the canonical loop).
pub fn face(points: &[V]) -> Face {
    let (p, reversed) = canonical(points);
    let n = p.len();
    if n == 3 {
        let area = scale(cross(sub(p[1], p[0]), sub(p[2], p[0])), 0.5);
        return Face { centre: scale(add(add(p[0], p[1]), p[2]), 1.0 / 3.0), area, reversed };
    }
    let middle = scale(p.iter().fold([0.0; 3], |s, x| add(s, *x)), 1.0 / n as f64);
    let (mut area, mut weight, mut moment) = ([0.0; 3], 0.0, [0.0; 3]);
    let mut triangles = Vec::with_capacity(n);
    for i in 0..n {
        let (a, b) = (p[i], p[(i + 1) % n]);
        let s = scale(cross(sub(b, a), sub(middle, a)), 0.5);
        triangles.push((s, scale(add(add(a, b), middle), 1.0 / 3.0)));
        area = add(area, s);
    }
    let size = length(area);
    let unit = if size > 0.0 { scale(area, 1.0 / size) } else { [0.0; 3] };
    for (s, c) in triangles {
        let w = dot(s, unit);
        weight += w;
        moment = add(moment, scale(c, w));
    }
    let centre = if weight > 0.0 { scale(moment, 1.0 / weight) } else { middle };
    Face { centre, area, reversed }
}

/// Volume and centre of a cell from (face centre, outward area vector) in canonical order.
pub fn cell(faces: &[(V, V)]) -> (f64, V) {
    let middle = scale(faces.iter().fold([0.0; 3], |s, f| add(s, f.0)), 1.0 / faces.len() as f64);
    let (mut volume, mut moment) = (0.0, [0.0; 3]);
    for (centre, area) in faces {
        let v = dot(*area, sub(*centre, middle)) / 3.0;
        volume += v;
        moment = add(moment, scale(add(scale(*centre, 0.75), scale(middle, 0.25)), v));
    }
    (volume, if volume == 0.0 { middle } else { scale(moment, 1.0 / volume) })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_face_gives_the_same_bits_from_both_sides() {
        let p: Vec<V> = vec![[0.1, 0.0, 0.0], [1.0, 0.03, 0.2], [1.1, 0.9, 0.1], [0.2, 1.0, -0.1]];
        let a = face(&p);
        for turn in 0..4 {
            let q: Vec<V> = (0..4).map(|i| p[(i + turn) % 4]).collect();
            assert_eq!(face(&q), a);
            let r: Vec<V> = q.iter().rev().copied().collect();
            assert_eq!(face(&r), Face { reversed: !a.reversed, ..a });
        }
    }
}
