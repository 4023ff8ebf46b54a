// SPDX-License-Identifier: MIT OR Apache-2.0
//! A column of hexahedra along x, cyclic in x, walls around: the smallest mesh on which smoothing, gathering and
//! particles that change cells are all at work.

use crate::mesh::{Mesh, MeshPiece, Patch, PatchKind, assemble};

/// `n` cells of thickness `h` (m) and square cross-section of side `side` (m).
pub fn column(n: usize, h: f64, side: f64) -> Mesh {
    let mut piece = MeshPiece { face_starts: vec![0], ..MeshPiece::default() };
    for i in 0..=n {
        let x = i as f64 * h;
        piece.points.extend([[x, 0.0, 0.0], [x, side, 0.0], [x, side, side], [x, 0.0, side]]);
    }
    piece.cell_ids = (0..n as i64).collect();
    let mut face = |corners: [usize; 4], owner: usize| {
        piece.face_points.extend(corners.map(|c| c as u32));
        piece.face_starts.push(piece.face_points.len() as u32);
        piece.owner.push(owner as u32);
    };
    let at = |i: usize, k: usize| 4 * i + k % 4;
    for i in 1..n {
        face([0, 1, 2, 3].map(|k| at(i, k)), i - 1);
    }
    face([3, 2, 1, 0].map(|k| at(0, k)), 0);
    face([0, 1, 2, 3].map(|k| at(n, k)), n - 1);
    for i in 0..n {
        for k in 0..4 {
            face([at(i, k), at(i, k + 1), at(i + 1, k + 1), at(i + 1, k)], i);
        }
    }
    piece.neighbour = (1..n as u32).collect();
    let patch = |name: &str, kind, start, size, neighbour_patch, shift| Patch {
        kind,
        name: name.into(),
        start,
        size,
        neighbour_rank: 0,
        neighbour_patch,
        separation: [shift, 0.0, 0.0],
    };
    let length = n as f64 * h;
    piece.patches = vec![
        patch("left", PatchKind::Cyclic, n - 1, 1, 1, length),
        patch("right", PatchKind::Cyclic, n, 1, 0, -length),
        patch("walls", PatchKind::Boundary, n + 1, 4 * n, 0, 0.0),
    ];
    assemble(&[piece]).expect("the column is a valid mesh")
}

#[cfg(test)]
mod tests {
    #[test]
    fn it_is_a_ring() {
        let m = super::column(5, 0.1, 0.3);
        assert!(m.volume.iter().all(|v| (v - 0.009).abs() < 1e-15));
        assert!((0..5).all(|c| m.links(c).len() == 2));
    }
}
