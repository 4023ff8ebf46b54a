// SPDX-License-Identifier: MIT OR Apache-2.0
//! Links of the Voronoi diagram of the cell centres: sign, symmetry, first and second moments, walls, pieces; what
//! smoothing along them gives.

mod common;

use common::random;
use voidage::map;
use voidage::mesh::made::{Made, Shape};
use voidage::mesh::{Mesh, assemble};
use voidage::setup;
use voidage::smooth::{self, Active, Diffusion, Direction, Scratch};
use voidage::sums::sum;

type V = [f64; 3];
const SIZE: V = [0.06, 0.04, 0.05];
const ALL: [bool; 3] = [true; 3];

/// From centre to centre, the shortest way through cyclics.
fn way(made: &Made, mesh: &Mesh, i: usize, j: u32) -> V {
    [0, 1, 2].map(|a| {
        let d = mesh.centre[j as usize][a] - mesh.centre[i][a];
        if made.cyclic[a] { d - made.size[a] * (d / made.size[a]).round() } else { d }
    })
}

fn shapes() -> Vec<Made> {
    vec![
        Made::hex([6, 5, 5], SIZE),
        Made::graded([6, 5, 5], SIZE),
        Made::hex([6, 5, 5], SIZE).jiggled(0.3),
        Made::tet([4; 3], SIZE),
        Made::tet([4; 3], SIZE).jiggled(0.0),
        Made::tet([4; 3], SIZE).mirrored(),
        Made::tet([4; 3], SIZE).mirrored().jiggled(0.0),
        Made::poly([4; 3], SIZE),
    ]
}

/// Walls that are curved.
fn round() -> [Made; 2] {
    [
        Made::hex([6, 6, 5], SIZE).round(),
        Made::tet([4; 3], SIZE).mirrored().round().cyclic([false, false, true]),
    ]
}

#[test]
fn links_are_positive_and_the_same_bits_in_both_rows_and_connect_all() {
    let walls = shapes().into_iter();
    let some = shapes().into_iter().map(|m| m.cyclic([true, false, false]));
    for made in walls.chain(some).chain(shapes().into_iter().map(|m| m.cyclic(ALL))).chain(round()) {
        let mesh = made.mesh();
        let linked = mesh.with_voronoi_links();
        assert_eq!(linked.link_start.len(), mesh.len() + 1);
        let mut seen = vec![false; mesh.len()];
        let mut list = vec![0];
        while let Some(i) = list.pop() {
            if !std::mem::replace(&mut seen[i], true) {
                list.extend(linked.links(i).iter().map(|l| l.to as usize));
            }
        }
        assert!(seen.iter().all(|s| *s), "{made:?}: not connected");
        for i in 0..mesh.len() {
            let row = linked.links(i);
            assert!(row.windows(2).all(|w| w[0].to < w[1].to), "{made:?} row {i}: order");
            for l in row {
                let back = linked.links(l.to as usize).iter().find(|b| b.to as usize == i);
                assert_eq!(
                    back.map(|b| b.weight.to_bits()),
                    Some(l.weight.to_bits()),
                    "{made:?} {i} {}",
                    l.to
                );
                assert!(l.weight > 0.0 && l.to as usize != i);
            }
        }
    }
}

#[test]
fn moments_are_exact_on_periodic_meshes_and_away_from_walls() {
    for made in shapes().into_iter().flat_map(|m| [m.clone().cyclic(ALL), m]) {
        let mesh = made.mesh();
        let linked = mesh.with_voronoi_links();
        let periodic = made.cyclic[0];
        let (mut second, mut worst, mut inner) = ([[0.0; 3]; 3], 0.0f64, 0);
        for i in 0..mesh.len() {
            let (mut first, mut scale) = ([0.0; 3], 0.0);
            for l in linked.links(i) {
                let d = way(&made, &mesh, i, l.to);
                (0..3).for_each(|a| first[a] += l.weight * d[a]);
                (0..3).for_each(|a| (0..3).for_each(|b| second[a][b] += 0.5 * l.weight * d[a] * d[b]));
                scale += l.weight * d.iter().map(|x| x * x).sum::<f64>().sqrt();
            }
            // cells whose Voronoi cell may touch a wall
            let x = mesh.centre[i];
            let h = 1.6 * mesh.volume[i].cbrt();
            if periodic || (0..3).all(|a| x[a] > h && x[a] < made.size[a] - h) {
                worst = worst.max(first.iter().map(|x| x.abs()).fold(0.0, f64::max) / scale);
                inner += 1;
            }
        }
        println!(
            "{:?} jiggle {} periodic {periodic}: first moment {worst:.1e} in {inner}",
            made.shape, made.jiggle
        );
        assert!(worst < 1e-9, "{made:?}: first moment {worst}");
        assert!(inner > 0 || made.shape != Shape::Tet, "{made:?}");
        if periodic {
            let volume: f64 = mesh.volume.iter().sum();
            for (a, row) in second.iter().enumerate() {
                for (b, s) in row.iter().enumerate() {
                    let expected = if a == b { 1.0 } else { 0.0 };
                    assert!((s / volume - expected).abs() < 1e-6, "{made:?} {a} {b}: {}", s / volume);
                }
            }
        }
    }
}

/// On boxes the Voronoi cells are boxes between the middles of the centres: the same on uniform meshes, wider or narrower
/// than the cells on graded ones.
#[test]
fn on_hexahedra_links_are_those_of_boxes() {
    for made in [
        Made::hex([6, 5, 4], SIZE),
        Made::hex([6, 5, 4], SIZE).cyclic([true, false, true]),
        Made::hex([3, 4, 5], SIZE).cyclic(ALL),
        Made::hex([2, 4, 1], SIZE).cyclic([true, false, true]),
        Made::graded([6, 5, 4], SIZE),
        Made::graded([6, 5, 4], SIZE).cyclic([true, false, true]),
    ] {
        let mesh = made.mesh();
        let linked = mesh.with_voronoi_links();
        let n = made.n;
        let at = |a: usize, k: usize| {
            let slot = k * [1, n[0], n[0] * n[1]][a];
            mesh.centre[slot][a]
        };
        // width of the Voronoi cell along an axis
        let width = |a: usize, k: usize| {
            let (first, last) = (k == 0, k + 1 == n[a]);
            let around = || made.size[a] - at(a, n[a] - 1) + at(a, 0);
            let low = match (first, made.cyclic[a]) {
                (false, _) => 0.5 * (at(a, k) - at(a, k - 1)),
                (true, true) => 0.5 * around(),
                (true, false) => at(a, k),
            };
            let high = match (last, made.cyclic[a]) {
                (false, _) => 0.5 * (at(a, k + 1) - at(a, k)),
                (true, true) => 0.5 * around(),
                (true, false) => made.size[a] - at(a, k),
            };
            low + high
        };
        for i in 0..mesh.len() {
            let k = [i % n[0], i / n[0] % n[1], i / n[0] / n[1]];
            let mut to: Vec<u32> = mesh.links(i).iter().map(|l| l.to).collect();
            to.dedup();
            assert_eq!(linked.links(i).iter().map(|l| l.to).collect::<Vec<_>>(), to, "{made:?} {i}");
            for l in linked.links(i) {
                let faces: f64 = mesh.links(i).iter().filter(|f| f.to == l.to).map(|f| f.weight).sum();
                let axis = (0..3).find(|a| {
                    let j = l.to as usize;
                    [j % n[0], j / n[0] % n[1], j / n[0] / n[1]][*a] != k[*a]
                });
                let a = axis.unwrap();
                let (b, c) = ((a + 1) % 3, (a + 2) % 3);
                let voronoi = width(b, k[b]) * width(c, k[c]);
                let area = mesh.volume[i] / cell_width(&mesh, i, a);
                assert!((l.weight / (faces * voronoi / area) - 1.0).abs() < 1e-9, "{made:?} {i} {}", l.to);
            }
        }
    }
}

fn cell_width(mesh: &Mesh, i: usize, a: usize) -> f64 {
    let x = || mesh.loops(i).flatten().map(|p| mesh.faces.points[*p as usize][a]);
    x().fold(f64::NEG_INFINITY, f64::max) - x().fold(f64::INFINITY, f64::min)
}

#[test]
fn links_do_not_depend_on_pieces_nor_on_threads() {
    for made in [Made::tet([6; 3], SIZE), Made::poly([5; 3], SIZE).cyclic([true, false, false])] {
        let whole = made.mesh().with_voronoi_links();
        let cut = assemble(&made.pieces(3, |x| (3.0 * x[0] / SIZE[0]) as usize)).unwrap();
        assert_eq!(cut.with_voronoi_links().links, whole.links);
        let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build().unwrap();
        assert_eq!(pool.install(|| cut.with_voronoi_links()).links, whole.links);
    }
}

#[test]
fn the_case_chooses_links_and_mapping() {
    let mesh = Made::tet([6; 3], SIZE).mesh();
    let of = |set: &[(&str, &str)], mesh: &Mesh| {
        let c = common::partners::case(set, 1);
        let linked = setup::linked(&c, mesh);
        assert!(setup::step(&c, mesh.clone()).is_ok() && setup::smoothers(&c, &linked, None).is_ok());
        (linked.links.clone(), setup::mapping(&c, mesh).unwrap().name())
    };
    let diagram = mesh.with_voronoi_links().links;
    assert!(
        of(&[("smooth.links", "faces"), ("map.method", "linear")], &mesh) == (mesh.links.clone(), "linear")
    );
    assert!(
        of(&[("smooth.links", "voronoi"), ("map.method", "linear")], &mesh) == (diagram.clone(), "linear")
    );
    assert!(of(&[], &mesh) == (diagram, "max-entropy"));
    for made in [Made::hex([6; 3], SIZE), Made::poly([5; 3], SIZE)] {
        let mesh = made.mesh();
        assert!(of(&[], &mesh) == (mesh.links.clone(), "linear"), "{made:?}");
    }
}

/// T of the links that smoothing goes by is b²/4 less half of the deposit's variance, the same in both rows.
#[test]
fn what_the_deposit_spreads_is_taken_out_along_the_links_in_use() {
    let mesh = Made::tet([6; 3], SIZE).mesh();
    let case = |method| {
        let set = [("smooth.links", "voronoi"), ("map.method", method)];
        let c = common::partners::case(&set, 1);
        let linked = setup::linked(&c, &mesh).into_owned();
        let mapping = setup::mapping(&c, &mesh).unwrap();
        assert!(setup::step(&c, mesh.clone()).is_ok());
        (map::taken_out(&*mapping, &mesh, &linked), linked)
    };
    assert_eq!(case("linear").0, None);
    let (variance, linked) = case("max-entropy");
    let variance = variance.unwrap();
    let t = Diffusion { bandwidth: 0.01, variance: Some(&variance), ..Diffusion::default() }.links(&linked);
    let mut mean = 0.0;
    for i in 0..linked.len() {
        for (k, l) in linked.links(i).iter().enumerate() {
            let (at, j) = (linked.link_start[i] as usize + k, l.to as usize);
            let back = linked.links(j).iter().position(|b| b.to as usize == i).unwrap();
            assert_eq!(t[at], t[linked.link_start[j] as usize + back]);
            assert!(t[at] < 0.25 * 0.01 * 0.01 && t[at] >= 0.0);
            mean += variance[at] / (linked.volume[i].cbrt().powi(2) * t.len() as f64);
        }
    }
    println!("taken out: {mean:.3} h2 on average");
    assert!((0.1..0.4).contains(&mean), "{mean}");
}

fn smoothed(mesh: &Mesh, b: f64, lanes: &mut [[f64; 8]]) {
    let t = Diffusion::uniform(b).links(mesh);
    let mut s = smooth::by_name("chebyshev", mesh, &t, 1e-9).unwrap();
    s.apply(lanes, &Active::whole(mesh.len()), Direction::Spread, &mut Scratch::default());
}

/// Second moments of a point's field relative to b²/2, along the diagonal of the tetrahedra and across it; across the mesh's own
/// faces 1.6 and 0.73.
#[test]
fn a_point_spreads_evenly_on_tetrahedra_of_one_direction() {
    let (size, b) = ([0.06; 3], 0.008);
    for made in
        [Made::tet([16; 3], size), Made::tet([16; 3], size).jiggled(0.0), Made::tet([16; 3], size).mirrored()]
    {
        let mesh = made.mesh();
        let linked = mesh.with_voronoi_links();
        let near = |c: &V| c.iter().map(|x| (x - 0.03).powi(2)).sum::<f64>();
        let at =
            (0..mesh.len()).min_by(|i, j| near(&mesh.centre[*i]).total_cmp(&near(&mesh.centre[*j]))).unwrap();
        let moments = |m: &Mesh| {
            let mut f = vec![[0.0; 8]; m.len()];
            f[at] = [1.0 / m.volume[at]; 8];
            smoothed(m, b, &mut f);
            let moment = |g: &dyn Fn(usize) -> f64| sum((0..m.len()).map(|c| m.volume[c] * f[c][0] * g(c)));
            assert!((moment(&|_| 1.0) - 1.0).abs() < 1e-12);
            let mean = [0, 1, 2].map(|a| moment(&|c| m.centre[c][a]));
            let d = |c: usize| [0, 1, 2].map(|a| m.centre[c][a] - mean[a]);
            let line =
                |n: V| moment(&|c| (0..3).map(|a| n[a] * d(c)[a]).sum::<f64>().powi(2)) / (0.5 * b * b);
            let (p, q, r) = (3f64.sqrt().recip(), 2f64.sqrt().recip(), 6f64.sqrt().recip());
            let shift = (0..3).map(|a| (mean[a] - m.centre[at][a]).powi(2)).sum::<f64>().sqrt();
            ([line([p; 3]), line([q, -q, 0.0]), line([r, r, -2.0 * r])], shift / m.volume[at].cbrt())
        };
        let (faces, voronoi) = (moments(&mesh), moments(&linked));
        println!("along, across, across, shift/h: faces {faces:.3?}, voronoi {voronoi:.3?}");
        let jiggled = if made.jiggle > 0.0 { 0.03 } else { 0.02 };
        assert!(voronoi.0.iter().all(|m| (m - 1.0).abs() < jiggled), "{voronoi:?}");
        assert!(voronoi.1 < 0.03, "{voronoi:?}");
        assert!(made.mirrored || (faces.0[0] > 1.5 && faces.0[1] < 0.8), "{faces:?}");
    }
}

#[test]
fn smoothing_conserves_keeps_constants_and_is_self_adjoint() {
    for made in shapes().into_iter().chain(round()) {
        let mesh = made.mesh().with_voronoi_links();
        let mut seed = 3;
        let before: Vec<[f64; 8]> = (0..mesh.len())
            .map(|_| [random(&mut seed), random(&mut seed) - 0.5, 2.5, 0.0, 0.0, 0.0, 0.0, 0.0])
            .collect();
        let mut after = before.clone();
        smoothed(&mesh, 0.02, &mut after);
        let product = |a: &[[f64; 8]], l: usize, b: &[[f64; 8]], m: usize| {
            sum((0..mesh.len()).map(|c| mesh.volume[c] * a[c][l] * b[c][m]))
        };
        let (mass, kept) = (product(&before, 0, &before, 2), product(&after, 0, &before, 2));
        assert!((kept / mass - 1.0).abs() < 1e-12, "{made:?}: {mass} {kept}");
        assert!(after.iter().all(|l| (l[2] / 2.5 - 1.0).abs() < 1e-12 && l[0] >= 0.0), "{made:?}");
        let (left, right) = (product(&after, 0, &before, 1), product(&before, 0, &after, 1));
        assert!((left - right).abs() < 1e-12 * mass, "{made:?}: {left} {right}");
    }
}

/// The mesh without the cells that `gone` picks by their centres; faces towards them, and those between two centres that
/// `baffle` picks, become walls.
fn without(made: &Made, gone: impl Fn(V) -> bool, baffle: impl Fn(V, V) -> bool) -> Mesh {
    let mesh = made.mesh();
    let piece = made.whole().remove(0);
    let kept: Vec<bool> = mesh.centre.iter().map(|c| !gone(*c)).collect();
    // slots are local cells: the mesh is in one piece
    let number: Vec<u32> = (0..kept.len()).map(|i| kept[..i].iter().filter(|k| **k).count() as u32).collect();
    let is_kept = |c: u32| kept[mesh.slots[0][c as usize] as usize];
    let new = |c: u32| number[mesh.slots[0][c as usize] as usize];
    let mut inner = Vec::new();
    let mut walls: Vec<(u32, Vec<u32>)> = Vec::new();
    for (f, owner) in piece.owner.iter().enumerate() {
        let loops: Vec<u32> = piece.face(f).to_vec();
        let centre = |c: u32| mesh.centre[mesh.slots[0][c as usize] as usize];
        match piece.neighbour.get(f) {
            Some(n) if baffle(centre(*owner), centre(*n)) => {
                walls.push((new(*n), loops.iter().rev().copied().collect()));
                walls.push((new(*owner), loops));
            }
            Some(n) if is_kept(*owner) && is_kept(*n) => inner.push((new(*owner), new(*n), loops)),
            Some(n) if is_kept(*n) => walls.push((new(*n), loops.into_iter().rev().collect())),
            _ if is_kept(*owner) => walls.push((new(*owner), loops)),
            _ => (),
        }
    }
    let mut out = piece.clone();
    out.cell_ids = (0..kept.iter().filter(|k| **k).count() as i64).collect();
    out.owner = inner.iter().map(|f| f.0).chain(walls.iter().map(|f| f.0)).collect();
    out.neighbour = inner.iter().map(|f| f.1).collect();
    let loops: Vec<&Vec<u32>> = inner.iter().map(|f| &f.2).chain(walls.iter().map(|f| &f.1)).collect();
    out.face_points = loops.iter().flat_map(|l| l.iter().copied()).collect();
    out.face_starts = std::iter::once(0)
        .chain(loops.iter().scan(0, |at, l| {
            *at += l.len() as u32;
            Some(*at)
        }))
        .collect();
    out.patches =
        vec![voidage::mesh::Patch { start: inner.len(), size: walls.len(), ..piece.patches[0].clone() }];
    assemble(&[out]).unwrap()
}

/// A box without a quarter, and one with a wall of one cell that ends in the middle.
#[test]
fn domains_that_are_not_convex_keep_their_links() {
    let size = [0.06; 3];
    let step = |c: V| c[0] > 0.03 && c[1] > 0.03;
    let wall = |c: V| c[0] > 0.03 && c[0] < 0.04 && c[1] > 0.03;
    for (k, gone) in [&step as &dyn Fn(V) -> bool, &wall].into_iter().enumerate() {
        // on uniform hexahedra nothing changes
        let mesh = without(&Made::hex([6; 3], size), gone, |_, _| false);
        let linked = mesh.with_voronoi_links();
        for i in 0..mesh.len() {
            let (f, v) = (mesh.links(i), linked.links(i));
            assert_eq!(
                f.iter().map(|l| l.to).collect::<Vec<_>>(),
                v.iter().map(|l| l.to).collect::<Vec<_>>()
            );
            assert!(f.iter().zip(v).all(|(f, v)| (f.weight / v.weight - 1.0).abs() < 1e-9), "{f:?} {v:?}");
        }
        let made = Made::tet([6; 3], size);
        let mesh = without(&made, gone, |_, _| false);
        let linked = mesh.with_voronoi_links();
        let (mut through, mut all, mut wrong) = (0.0, 0.0, 0);
        for i in 0..mesh.len() {
            let (mut first, mut scale) = ([0.0; 3], 0.0);
            for l in linked.links(i) {
                let (x, d) = (mesh.centre[i], way(&made, &mesh, i, l.to));
                let size = l.weight * d.iter().map(|x| x * x).sum::<f64>().sqrt();
                scale += size;
                (0..3).for_each(|a| first[a] += l.weight * d[a]);
                // does the line between the centres pass what is gone?
                let inside = |t: f64| gone([0, 1, 2].map(|a| x[a] + t * d[a]));
                through += if (1..20).any(|k| inside(0.05 * f64::from(k))) { size } else { 0.0 };
            }
            all += scale;
            let x = mesh.centre[i];
            let far = (0..3).all(|a| x[a] > 0.01 && x[a] < 0.05) && (x[0] < 0.02 || x[1] < 0.02);
            wrong += usize::from(far && first.iter().any(|m| m.abs() > 1e-9 * scale));
        }
        println!("domain {k}: links past a corner {:.1e} of all", through / all);
        assert!(through < 0.01 * all && wrong == 0, "{through} of {all}, {wrong}");
    }
}

/// A wall of no thickness that ends in the middle of the box.
#[test]
fn nothing_passes_a_baffle() {
    let size = [0.06; 3];
    let between = |p: V, q: V| (p[0] < 0.03) != (q[0] < 0.03) && p[1] > 0.03 && q[1] > 0.03;
    for made in
        [Made::hex([6; 3], size), Made::tet([6; 3], size).jiggled(0.0), Made::tet([6; 3], size).mirrored()]
    {
        let mesh = without(&made, |_| false, between);
        let linked = mesh.with_voronoi_links();
        let (mut through, mut near) = (0.0, 0.0);
        for i in 0..mesh.len() {
            for l in linked.links(i) {
                let (p, q) = (mesh.centre[i], mesh.centre[l.to as usize]);
                let t = (0.03 - p[0]) / (q[0] - p[0]);
                if (0.0..1.0).contains(&t) {
                    let y = p[1] + t * (q[1] - p[1]);
                    // a lattice cell from its edge, and beyond
                    through += if y > 0.04 { l.weight } else { 0.0 };
                    near += l.weight;
                }
            }
        }
        println!("{:?}: through the baffle {:.1e} of those across its plane", made.shape, through / near);
        assert!(through < 1e-9 * near, "{through} {near}");
    }
}

/// Two boxes side by side that share no face are two meshes in one: the links of each are its own.
#[test]
fn what_shares_no_face_is_not_linked() {
    let made = Made::tet([3; 3], SIZE);
    let (a, mut b) = (made.whole(), made.whole());
    let n = a[0].cell_ids.len() as i64;
    for p in &mut b {
        p.cell_ids.iter_mut().for_each(|c| *c += n);
        p.points.iter_mut().for_each(|x| x[0] += SIZE[0]);
    }
    let alone = assemble(&a).unwrap().with_voronoi_links();
    let both = assemble(&[a, b].concat()).unwrap().with_voronoi_links();
    for i in 0..n as usize {
        let near = |a: f64, b: f64| (a / b - 1.0).abs() < 1e-9;
        let (p, q) = (alone.links(i), both.links(i));
        assert!(p.len() == q.len() && p.iter().zip(q).all(|(p, q)| p.to == q.to && near(p.weight, q.weight)));
    }
}

/// Boxes: none; a lattice of tetrahedra along one diagonal: by area.
#[test]
fn non_orthogonality_is_that_of_the_faces() {
    assert!(Made::hex([3, 4, 2], [3.0, 4.0, 2.0]).mesh().non_orthogonality() < 1e-5);
    let skew = Made::tet([3; 3], [3.0; 3]).jiggled(0.0).cyclic([true; 3]).mesh().non_orthogonality();
    // 14.60699 by a second program, from the corners
    assert!((skew - 14.60699).abs() < 1e-4, "{skew}");
    // Voronoi cells whose centres are not their seeds
    let poly = Made::poly([3; 3], [3.0; 3]).mesh().non_orthogonality();
    assert!(poly < 10.0, "{poly}");
}
