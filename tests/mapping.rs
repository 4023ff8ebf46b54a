// SPDX-License-Identifier: MIT OR Apache-2.0
//! Every mapping on every kind of mesh: Σ m = 1, m ≥ 0, near walls, at cyclic faces and at rank borders; exact
//! overlap against quadrature; moments of the linear deposit.

mod common;

use common::random;
use voidage::arrange::Order;
use voidage::bench::gauss::Lattice;
use voidage::locate::Locator;
use voidage::map::{self, DividedVolume, Linear, Mapping, MaxEntropy, Options, SatellitePoints, Weights};
use voidage::mesh::made::{Made, Shape};
use voidage::mesh::{Mesh, NONE, assemble};
use voidage::smooth::{self, Active, Diffusion, Direction, Scratch};

const SIZE: [f64; 3] = [0.06, 0.04, 0.05];
const OPTIONS: Options = Options { bandwidth: 0.012, grid: 0.017 };

fn meshes() -> Vec<Made> {
    let x = [true, false, false];
    vec![
        Made::hex([6, 4, 5], SIZE),
        Made::hex([6, 4, 5], SIZE).cyclic([true; 3]),
        Made::hex([6, 4, 5], SIZE).jiggled(0.3).cyclic(x),
        Made::graded([6, 4, 5], SIZE).cyclic(x),
        Made::tet([3, 2, 3], SIZE),
        Made::tet([3, 2, 3], SIZE).cyclic([true, false, true]),
        Made::poly([4, 3, 3], SIZE),
        Made::poly([4, 3, 3], SIZE).cyclic(x),
    ]
}

struct Cloud {
    position: Vec<[f64; 3]>,
    radius: Vec<f64>,
    host: Vec<u32>,
}

/// Particles anywhere in the box, many near walls and cyclic faces; positions come back wrapped.
fn cloud(mesh: &Mesh, n: usize, radius: f64) -> Cloud {
    let mut seed = 11;
    let mut position: Vec<[f64; 3]> = (0..n)
        .map(|i| {
            SIZE.map(|s| {
                let t = random(&mut seed);
                match i % 4 {
                    0 => s * (1e-9 + 0.02 * t),
                    1 => s * (1.0 - 1e-9 - 0.02 * t),
                    _ => s * t,
                }
            })
        })
        .collect();
    let mut host = vec![NONE; n];
    Locator::new(mesh).locate(mesh, &mut position, &mut host).unwrap();
    let radius = (0..n).map(|i| radius * (1.0 + (i % 3) as f64)).collect();
    Cloud { position, radius, host }
}

fn weights(m: &dyn Mapping, mesh: &Mesh, c: &Cloud) -> Weights {
    let mut w = Weights::default();
    m.weights(mesh, &c.position, &c.radius, &c.host, &mut w);
    w
}

fn of(w: &Weights, i: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
    w.of(i)
}

#[test]
fn weights_are_positive_and_sum_to_one() {
    for made in meshes() {
        let mesh = made.mesh();
        for mut m in map::all() {
            m.prepare(&mesh, &OPTIONS);
            let n = if m.name() == "kernel" { 8 } else { 400 };
            let mut c = cloud(&mesh, n, 0.003);
            c.host[5] = NONE;
            let w = weights(m.as_ref(), &mesh, &c);
            assert_eq!(of(&w, 5).count(), 0, "{}: a particle without host", m.name());
            for i in (0..n).filter(|i| *i != 5) {
                let sum: f64 = of(&w, i).map(|e| e.1).sum();
                assert!((sum - 1.0).abs() < 1e-14, "{} {made:?}: {sum}", m.name());
                assert!(of(&w, i).all(|e| e.1 > 0.0 && e.0 < mesh.len()), "{} {made:?} {i}", m.name());
            }
        }
    }
}

/// Sums and reads by cell (many particles in one) and one by one, on any number of threads: what `Weights::of` says, and the same bits.
#[test]
fn deposit_and_gather_do_what_the_weights_say_on_any_number_of_threads() {
    for made in meshes() {
        let mesh = made.mesh();
        for n in [300, 6000] {
            let c = cloud(&mesh, n, 0.001);
            let (mut order, ids) = (Order::default(), (0..n as i64).collect::<Vec<_>>());
            let list: Vec<usize> =
                order.update(mesh.len(), &ids, &c.host).iter().map(|i| *i as usize).collect();
            let [position, radius] =
                [c.position.clone(), c.radius.iter().map(|r| [*r; 3]).collect::<Vec<_>>()]
                    .map(|v| list.iter().map(|i| v[*i]).collect::<Vec<_>>());
            let host: Vec<u32> = list.iter().map(|i| c.host[*i]).collect();
            let radius: Vec<f64> = radius.iter().map(|r| r[0]).collect();
            let q = |i: usize| [0, 1, 2, 3, 4, 5, 6, 7].map(|a| 1.0 + ((i * 8 + a) as f64).sin());
            let field: Vec<[f64; 8]> = (0..mesh.len()).map(q).collect();
            // the dear ones on few particles; the kernel alone takes minutes
            let cheap = |m: &str| ["particle-centroid", "linear"].contains(&m) || (n == 300 && m != "kernel");
            for mut m in map::all().into_iter().filter(|m| cheap(m.name())) {
                m.prepare(&mesh, &Options { bandwidth: 0.01, grid: 0.02 });
                let run = |threads: usize| {
                    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                    pool.install(|| {
                        let mut w = Weights::default();
                        m.weights(&mesh, &position, &radius, &host, &mut w);
                        w.survey(&order);
                        let (mut lanes, mut read) = (vec![[0.0; 8]; mesh.len()], vec![[0.0; 8]; n]);
                        let counts = w.deposit(&mesh, &order, &mut lanes, |i, count: &mut usize| {
                            *count += 1;
                            q(i)
                        });
                        assert_eq!(counts.iter().sum::<usize>(), n);
                        w.gather(&field, 0, &mut read);
                        (w, lanes, read)
                    })
                };
                let (w, lanes, read) = run(1);
                let (mut sums, mut reached) = (vec![[0.0; 8]; mesh.len()], vec![false; mesh.len()]);
                w.reached(&order.occupied).iter().for_each(|c| reached[*c as usize] = true);
                for i in 0..n {
                    let mut sum = [0.0; 8];
                    for (cell, share) in w.of(i) {
                        assert!(reached[cell], "{}", m.name());
                        (0..8).for_each(|a| sum[a] += share * field[cell][a]);
                        (0..8).for_each(|a| sums[cell][a] += share * q(i)[a] / mesh.volume[cell]);
                    }
                    assert!((0..8).all(|a| (sum[a] - read[i][a]).abs() < 1e-13), "{}", m.name());
                }
                let largest = sums.as_flattened().iter().fold(0.0f64, |m, x| m.max(x.abs()));
                let apart = sums.as_flattened().iter().zip(lanes.as_flattened()).map(|(a, b)| (a - b).abs());
                assert!(apart.fold(0.0, f64::max) < 1e-13 * largest, "{}", m.name());
                for threads in [2, 3, 8] {
                    let (_, l, r) = run(threads);
                    assert!(l == lanes && r == read, "{} on {threads}", m.name());
                }
            }
        }
    }
}

#[test]
fn rank_borders_do_not_show() {
    for made in meshes() {
        let mesh = made.mesh();
        let cut = assemble(&made.pieces(2, |c| usize::from(c[0] + 0.3 * c[1] > 0.036))).unwrap();
        for (mut a, mut b) in map::all().into_iter().zip(map::all()) {
            a.prepare(&mesh, &OPTIONS);
            b.prepare(&cut, &OPTIONS);
            let c = cloud(&mesh, if a.name() == "kernel" { 8 } else { 300 }, 0.003);
            let (w, v) = (weights(a.as_ref(), &mesh, &c), weights(b.as_ref(), &cut, &c));
            assert_eq!(w, v, "{} {made:?}", a.name());
            assert_eq!(a.link_variance(&mesh), b.link_variance(&cut), "{} {made:?}", a.name());
            assert_eq!(a.cell_variance(&mesh), b.cell_variance(&cut), "{} {made:?}", a.name());
        }
    }
}

/// Area of the disc of radius r about the origin in a convex polygon.
fn disc(polygon: &[[f64; 2]], r: f64) -> f64 {
    let mut area = 0.0;
    for i in 0..polygon.len() {
        let (p, q) = (polygon[i], polygon[(i + 1) % polygon.len()]);
        let u = [q[0] - p[0], q[1] - p[1]];
        let size = u[0].hypot(u[1]);
        if size == 0.0 {
            continue;
        }
        let e = (p[0] * u[1] - p[1] * u[0]) / size;
        let angle = |l: f64| l.atan2(e.abs());
        let part = |l: f64| {
            let cut = (r * r - e * e).max(0.0).sqrt().min(l.abs());
            let a = e.abs() * cut + r * r * (angle(l.abs()) - angle(cut));
            0.5 * a * l.signum()
        };
        let along = |p: [f64; 2]| (p[0] * u[0] + p[1] * u[1]) / size;
        area += e.signum() * (part(along(q)) - part(along(p)));
    }
    area
}

/// Ball about x in the convex cell by slices across z: an independent way to the same number.
fn slices(mesh: &Mesh, cell: usize, x: [f64; 3], r: f64) -> f64 {
    let planes: Vec<([f64; 3], f64)> = mesh
        .sides(cell)
        .iter()
        .map(|s| {
            let n = [s.plane[0], s.plane[1], s.plane[2]];
            (n, s.plane[3] - (n[0] * x[0] + n[1] * x[1] + n[2] * x[2]))
        })
        .collect();
    let area = |z: f64| {
        let b = 10.0 * r;
        let mut polygon = vec![[-b, -b], [b, -b], [b, b], [-b, b]];
        for (n, d) in &planes {
            let s: Vec<f64> = polygon.iter().map(|p| n[0] * p[0] + n[1] * p[1] + n[2] * z - d).collect();
            let mut next = Vec::new();
            for i in 0..polygon.len() {
                let j = (i + 1) % polygon.len();
                if s[i] <= 0.0 {
                    next.push(polygon[i]);
                }
                if (s[i] <= 0.0) != (s[j] <= 0.0) {
                    let t = s[i] / (s[i] - s[j]);
                    next.push([0, 1].map(|a| polygon[i][a] + t * (polygon[j][a] - polygon[i][a])));
                }
            }
            polygon = next;
        }
        disc(&polygon, (r * r - z * z).max(0.0).sqrt())
    };
    // breaks where the slice changes shape: corners of the cell
    let corners = mesh.loops(cell).flatten().map(|p| mesh.faces.points[*p as usize][2] - x[2]);
    let mut at: Vec<f64> = corners.filter(|z| z.abs() < r).chain([-r, r]).collect();
    // enough pieces that no small cap is missed
    at.extend((1..64).map(|i| r * (i as f64 / 32.0 - 1.0)));
    at.sort_by(f64::total_cmp);
    fn gauss(f: &dyn Fn(f64) -> f64, a: f64, b: f64) -> f64 {
        const X: [f64; 5] = [
            0.148_874_338_981_631_2,
            0.433_395_394_129_247_2,
            0.679_409_568_299_024_4,
            0.865_063_366_688_984_5,
            0.973_906_528_517_171_7,
        ];
        const W: [f64; 5] = [
            0.295_524_224_714_752_9,
            0.269_266_719_309_996_4,
            0.219_086_362_515_982_04,
            0.149_451_349_150_580_6,
            0.066_671_344_308_688_14,
        ];
        let (m, h) = (0.5 * (a + b), 0.5 * (b - a));
        (0..5).map(|i| W[i] * h * (f(m - h * X[i]) + f(m + h * X[i]))).sum()
    }
    fn adapt(f: &dyn Fn(f64) -> f64, a: f64, b: f64, whole: f64, tolerance: f64, depth: usize) -> f64 {
        let m = 0.5 * (a + b);
        let (l, r) = (gauss(f, a, m), gauss(f, m, b));
        if depth == 0 || (l + r - whole).abs() < tolerance {
            return l + r;
        }
        adapt(f, a, m, l, tolerance, depth - 1) + adapt(f, m, b, r, tolerance, depth - 1)
    }
    at.windows(2)
        .filter(|w| w[1] > w[0])
        .map(|w| adapt(&area, w[0], w[1], gauss(&area, w[0], w[1]), 1e-14 * r * r * r, 30))
        .sum()
}

#[test]
fn overlaps_are_exact() {
    let mut worst = 0.0f64;
    for made in [
        Made::hex([6, 4, 5], SIZE),
        Made::graded([6, 4, 5], SIZE),
        Made::tet([3, 2, 3], SIZE),
        Made::poly([4, 3, 3], SIZE),
    ] {
        let mesh = made.mesh();
        let mut m = DividedVolume::default();
        m.prepare(&mesh, &OPTIONS);
        for radius in [0.001, 0.004] {
            let c = cloud(&mesh, 40, radius);
            let w = weights(&m, &mesh, &c);
            for i in 0..c.host.len() {
                let r = c.radius[i];
                // through cells the mapping found and their neighbours: none may be missed
                let mut list: Vec<usize> = of(&w, i).map(|e| e.0).collect();
                list.extend(list.clone().iter().flat_map(|c| mesh.links(*c).iter().map(|l| l.to as usize)));
                list.sort_unstable();
                list.dedup();
                let v: Vec<f64> = list.iter().map(|k| slices(&mesh, *k, c.position[i], r)).collect();
                let all: f64 = v.iter().sum();
                for (k, v) in list.iter().zip(&v) {
                    let given: f64 = of(&w, i).filter(|e| e.0 == *k).map(|e| e.1).sum();
                    worst = worst.max((given - v / all).abs());
                    assert!(
                        (given - v / all).abs() < 1e-10,
                        "{made:?} particle {i} r {r} cell {k}: {given} {}",
                        v / all
                    );
                }
            }
        }
    }
    println!("largest difference from quadrature: {worst:e}");
}

/// Free of walls the overlaps must fill the ball without being scaled, on warped cells too: a ball centred on
/// corners, edges and faces of the mesh is the hardest.
#[test]
fn balls_on_corners_are_shared_evenly() {
    let mesh = Made::hex([6, 4, 5], SIZE).cyclic([true; 3]).mesh();
    let mut m = DividedVolume::default();
    m.prepare(&mesh, &OPTIONS);
    let corner = [SIZE[0] / 6.0 * 2.0, SIZE[1] / 4.0, SIZE[2] / 5.0 * 3.0];
    let middle = [SIZE[0] / 6.0 * 2.5, SIZE[1] / 4.0, SIZE[2] / 5.0 * 3.0];
    let mut c =
        Cloud { position: vec![corner, middle, [0.0; 3]], radius: vec![0.002; 3], host: vec![NONE; 3] };
    Locator::new(&mesh).locate(&mesh, &mut c.position, &mut c.host).unwrap();
    let w = weights(&m, &mesh, &c);
    for (i, n) in [(0, 8), (1, 4), (2, 8)] {
        assert_eq!(of(&w, i).filter(|e| e.1 > 1e-5).count(), n, "{:?}", of(&w, i).collect::<Vec<_>>());
        of(&w, i).for_each(|e| assert!(e.1 < 1e-5 || (e.1 - 1.0 / n as f64).abs() < 1e-6));
    }
}

#[test]
fn satellites_near_walls_stay_inside_and_follow_the_points() {
    let mesh = Made::hex([6, 4, 5], SIZE).mesh();
    let mut m = SatellitePoints::default();
    m.prepare(&mesh, &OPTIONS);
    let edge = SIZE[0] / 6.0;
    let c = Cloud { position: vec![[edge + 1e-6, 0.005, 0.005]], radius: vec![0.002], host: vec![1] };
    let w = weights(&m, &mesh, &c);
    // left of the face: 8 points of the shells and the two on −x; the 9 with x = 0 lie 1e-6 right of it
    let left: f64 = of(&w, 0).filter(|e| e.0 == 0).map(|e| e.1).sum();
    assert!((left - 10.0 / 29.0).abs() < 1e-12, "{left}");
}

#[test]
fn linear_keeps_the_first_moment() {
    for made in [
        Made::hex([6, 6, 6], SIZE),
        Made::graded([6, 6, 6], SIZE),
        Made::hex([6, 6, 6], SIZE).jiggled(0.3),
        Made::tet([4, 4, 4], SIZE),
        Made::poly([5, 5, 5], SIZE),
    ] {
        let mesh = made.mesh();
        let mut m = Linear::default();
        m.prepare(&mesh, &OPTIONS);
        let c = cloud(&mesh, 2000, 0.001);
        let w = weights(&m, &mesh, &c);
        let (mut worst, mut mean, mut n, mut entries) = (0.0f64, 0.0, 0.0, 0);
        for i in 0..c.host.len() {
            // away from walls
            if (0..3).any(|a| c.position[i][a] < 0.3 * SIZE[a] || c.position[i][a] > 0.7 * SIZE[a]) {
                continue;
            }
            let h = mesh.volume[c.host[i] as usize].cbrt();
            let error: f64 = (0..3)
                .map(|a| of(&w, i).map(|(k, m)| m * mesh.centre[k][a]).sum::<f64>() - c.position[i][a])
                .map(|e| e * e / (h * h))
                .sum::<f64>()
                .sqrt();
            worst = worst.max(error);
            mean += error;
            n += 1.0;
            entries += of(&w, i).count();
        }
        println!(
            "{:?} jiggle {}: first moment off by {worst:.2e} h (mean {:.2e}), {:.1} cells",
            made.shape,
            made.jiggle,
            mean / n,
            entries as f64 / n
        );
        let allowed = if made.shape == Shape::Hex && made.jiggle == 0.0 { 1e-12 } else { 0.1 };
        assert!(worst < allowed, "{made:?}: {worst}");
    }
}

#[test]
fn linear_and_max_entropy_are_continuous_across_faces() {
    let shapes = [Made::hex([6, 4, 5], SIZE), Made::tet([3, 2, 3], SIZE), Made::poly([4, 3, 3], SIZE)];
    let graded = [Made::graded([6, 4, 5], SIZE), Made::tet([3, 4, 4], SIZE).cyclic([true, false, true])];
    for made in &shapes {
        continuous(made, &mut Linear::default(), 1e-9);
    }
    for made in shapes.iter().chain(&graded) {
        // each host has its own list of cells around: equal but for what is far
        continuous(made, &mut MaxEntropy::default(), 1e-5);
    }
}

/// A particle on a face has the same weights from both sides.
fn continuous(made: &Made, m: &mut dyn Mapping, tolerance: f64) {
    let mesh = made.mesh();
    m.prepare(&mesh, &OPTIONS);
    for cell in 0..mesh.len() {
        for (side, face) in mesh.sides(cell).iter().zip(mesh.loops(cell)).filter(|s| s.0.across != NONE) {
            let p: Vec<_> = face.iter().map(|p| mesh.faces.points[*p as usize]).collect();
            let x = [0, 1, 2].map(|a| 0.5 * p[0][a] + 0.3 * p[1][a] + 0.2 * p[2][a]);
            let c = Cloud {
                position: vec![x, [0, 1, 2].map(|a| x[a] + mesh.shift(side)[a])],
                radius: vec![0.001; 2],
                host: vec![cell as u32, side.across],
            };
            let w = weights(m, &mesh, &c);
            for k in 0..mesh.len() {
                let of = |i| of(&w, i).filter(|e| e.0 == k).map(|e| e.1).sum::<f64>();
                let gap = (of(0) - of(1)).abs();
                assert!(gap < tolerance, "{} {made:?} cell {cell} face {face:?}: {gap}", m.name());
            }
        }
    }
}

/// On any cells, away from walls and through cyclics; near walls with the mirrored cells, which cannot be told apart here.
#[test]
fn max_entropy_keeps_the_first_moment_exactly_and_spreads_evenly() {
    let size = [0.06; 3];
    for made in [
        Made::hex([10; 3], size),
        Made::graded([12; 3], size),
        Made::hex([10; 3], size).jiggled(0.3),
        Made::tet([7; 3], size),
        Made::tet([7; 3], size).jiggled(0.0),
        Made::poly([8; 3], size),
        Made::tet([7; 3], size).cyclic([true; 3]),
        Made::poly([8; 3], size).cyclic([true; 3]),
    ] {
        let mesh = made.mesh();
        let mut m = MaxEntropy::default();
        m.prepare(&mesh, &OPTIONS);
        let mut seed = 5;
        let low = if made.cyclic[0] { 0.0 } else { 0.4 };
        let mut x: Vec<[f64; 3]> =
            (0..400).map(|_| size.map(|s| s * (low + (1.0 - 2.0 * low) * random(&mut seed)))).collect();
        let mut host = vec![NONE; x.len()];
        Locator::new(&mesh).locate(&mesh, &mut x, &mut host).unwrap();
        let c = Cloud { radius: vec![0.001; x.len()], position: x, host };
        let w = weights(&m, &mesh, &c);
        let (mut worst, mut spread, mut cells) = (0.0f64, [0.0; 6], 0);
        for i in 0..c.host.len() {
            let h = mesh.volume[c.host[i] as usize].cbrt();
            let mut first = [0.0; 3];
            for (k, m) in of(&w, i) {
                let d = [0, 1, 2].map(|a| {
                    let d = mesh.centre[k][a] - c.position[i][a];
                    (if made.cyclic[a] { d - size[a] * (d / size[a]).round() } else { d }) / h
                });
                (0..3).for_each(|a| first[a] += m * d[a]);
                (0..3).for_each(|a| spread[a] += m * d[a] * d[a] / c.host.len() as f64);
                (0..3).for_each(|a| spread[3 + a] += m * d[a] * d[(a + 1) % 3] / c.host.len() as f64);
                cells += 1;
            }
            worst = first.iter().fold(worst, |w, f| w.max(f.abs()));
        }
        println!(
            "{:?} {}: first moment off by {worst:.1e} h, variance {spread:.3?} h2, {} cells",
            made.shape,
            made.jiggle,
            cells / 400
        );
        assert!(worst < 1e-9, "{made:?}: {worst}");
        let mean = (spread[0] + spread[1] + spread[2]) / 3.0;
        if made.grading == [1.0; 3] {
            assert!(
                (0..3).all(|a| (spread[a] / mean - 1.0).abs() < 0.1 && spread[3 + a].abs() < 0.1 * mean),
                "{spread:?}"
            );
        }
    }
}

#[test]
fn link_variance_is_that_of_cloud_in_cell() {
    let made = Made::hex([6, 4, 5], SIZE).cyclic([true, false, false]);
    let mesh = made.mesh();
    let mut m = Linear::default();
    m.prepare(&mesh, &OPTIONS);
    let variance = m.link_variance(&mesh);
    assert_eq!(variance.len(), mesh.links.len());
    for i in 0..mesh.len() {
        for (k, l) in mesh.links(i).iter().enumerate() {
            let j = l.to as usize;
            let axis = if i.abs_diff(j) >= 24 {
                2
            } else if i.abs_diff(j) == 6 {
                1
            } else {
                0
            };
            let h = SIZE[axis] / [6.0, 4.0, 5.0][axis];
            let v = variance[mesh.link_start[i] as usize + k];
            assert!((v - h * h / 12.0).abs() < 1e-12 * h * h, "{i} {j}: {v} {}", h * h / 12.0);
        }
    }
    for made in meshes() {
        let mesh = made.mesh();
        let mut m = Linear::default();
        m.prepare(&mesh, &OPTIONS);
        let v = m.link_variance(&mesh);
        for i in 0..mesh.len() {
            for (k, l) in mesh.links(i).iter().enumerate() {
                let at = mesh.link_start[i] as usize + k;
                let j = l.to as usize;
                let back = mesh.links(j).iter().enumerate().filter(|b| b.1.to as usize == i);
                let same = back.map(|b| v[mesh.link_start[j] as usize + b.0]).any(|b| b == v[at]);
                assert!(same, "{made:?} {i} {j}");
            }
        }
    }
}

/// Root of Σ V (a − b)².
fn distance(mesh: &Mesh, a: &[f64], b: &[f64]) -> f64 {
    (0..mesh.len()).map(|j| mesh.volume[j] * (a[j] - b[j]).powi(2)).sum::<f64>().sqrt()
}

/// Solid fraction of spheres of volume v, deposited and smoothed along links with a variance (m2) taken out.
fn solid_fraction(
    mesh: &Mesh,
    (linked, variance): (&Mesh, Option<&[f64]>),
    position: &[[f64; 3]],
    v: f64,
    b: f64,
    [mapping, smoother]: [&str; 2],
    tolerance: f64,
) -> Vec<f64> {
    let mut position = position.to_vec();
    let mut host = vec![NONE; position.len()];
    Locator::new(mesh).locate(mesh, &mut position, &mut host).unwrap();
    let mut m = map::by_name(mapping, mesh).unwrap();
    m.prepare(mesh, &Options { bandwidth: b, grid: 1.0 });
    let mut w = Weights::default();
    m.weights(mesh, &position, &vec![0.1; host.len()], &host, &mut w);
    let mut lanes = vec![[0.0; 8]; mesh.len()];
    for i in 0..host.len() {
        w.of(i).for_each(|(c, m)| lanes[c][0] += m * v / mesh.volume[c]);
    }
    let t = Diffusion { bandwidth: b, variance, ..Diffusion::default() }.links(linked);
    let mut s = smooth::by_name(smoother, linked, &t, tolerance).unwrap();
    s.apply(&mut lanes, &Active::whole(mesh.len()), Direction::Spread, &mut Scratch::default());
    lanes.iter().map(|l| l[0]).collect()
}

/// The reason for the linear deposit: at least twice closer to the particles' exact Gaussians, on uniform hexahedra and on such
/// graded 4:1 in two directions; and of `forward-euler`: nearer to them than exp(Δ_T).
#[test]
fn linear_halves_the_error_on_uniform_and_graded_hexahedra() {
    let (n, fine) = ([24, 24, 40], [24.0, 24.0, 40.0]);
    for made in [Made::hex([8; 3], [8.0; 3]), Made::hex(n, fine), Made::graded(n, fine)] {
        let (mesh, size) = (made.mesh(), made.size);
        let lattice = Lattice::of_mesh(&mesh).unwrap();
        let mut seed = 77;
        let x: Vec<[f64; 3]> =
            (0..3 * mesh.len() / 10).map(|_| size.map(|s| s * (0.001 + 0.6 * random(&mut seed)))).collect();
        for b in [0.7, 1.0, 2.0, 4.0] {
            let exact = lattice.solid_fraction(&x, |_| 1.0, |_| b);
            let error = |how| {
                let of = solid_fraction(&mesh, (&mesh, None), &x, 1.0, b, how, 1e-8);
                distance(&mesh, &of, &exact)
            };
            let [centroid, linear] = ["particle-centroid", "linear"].map(|m| error([m, "chebyshev"]));
            assert!(centroid > 2.0 * linear, "{:?} b/h = {b}: {centroid} {linear}", made.grading);
            let euler = error(["linear", "forward-euler"]);
            assert!(euler < linear * if b < 1.0 { 1.05 } else { 1.0 }, "b/h = {b}: {euler} {linear}");
        }
    }
}

/// The same on tetrahedra, by the deposit and the links made for them: twice nearer than the particle centroid on the same links and
/// on those of the faces.
#[test]
fn maximum_entropy_halves_the_error_on_tetrahedra() {
    let made = Made::tet([5; 3], [5.0 * 6f64.cbrt(); 3]);
    let mesh = made.mesh();
    let linked = mesh.with_voronoi_links();
    let mut seed = 77;
    // two per cell in a corner of the box
    let x: Vec<[f64; 3]> =
        (0..324).map(|_| made.size.map(|s| s * (0.001 + 0.6 * random(&mut seed)))).collect();
    let entropy = {
        let mut m = MaxEntropy::default();
        m.prepare(&mesh, &Options::default());
        map::taken_out(&m, &mesh, &linked).unwrap()
    };
    for b in [0.7, 1.0, 2.0, 4.0] {
        let field = |mapping, smoother, linked, variance| {
            solid_fraction(&mesh, (linked, variance), &x, 1.0, b, [mapping, smoother], 1e-8)
        };
        let exact = field("kernel", "none", &mesh, None);
        let error = |mapping, linked, variance| {
            distance(&mesh, &field(mapping, "chebyshev", linked, variance), &exact)
                / distance(&mesh, &vec![0.0; mesh.len()], &exact)
        };
        let ours = error("max-entropy", &linked, Some(&entropy[..]));
        let [faces, voronoi] = [&mesh, &linked].map(|links| error("particle-centroid", links, None));
        println!(
            "b/h = {b}: {ours:.4}; particle centroid by faces {faces:.4}, by Voronoi links {voronoi:.4}"
        );
        assert!(2.0 * ours < faces && 2.0 * ours < voronoi);
    }
}

/// Sun & Xiao 2015, table 2 and figure 4: profiles across the height of one bed on meshes B to E, whose cells shrink from 4 to
/// half a diameter; b = 4 d. Largest difference from E, L2.
#[test]
fn the_bed_is_the_same_on_meshes_b_to_e() {
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/cases/fluidised-bed/bed.data");
    let text = std::fs::read_to_string(file).unwrap();
    let numbers = |l: &str| l.split_whitespace().filter_map(|w| w.parse().ok()).collect::<Vec<f64>>();
    let rows: Vec<_> = text.lines().skip_while(|l| !l.starts_with("Atoms")).skip(1).map(numbers).collect();
    let x: Vec<[f64; 3]> =
        rows.iter().filter_map(|r| r.last_chunk().filter(|_| r.len() >= 7)).copied().collect();
    assert!(x.len() > 9000, "{}", x.len());
    let (d, size) = (0.0012, [0.044, 0.12, 0.01]);
    let v = std::f64::consts::PI / 6.0 * f64::powi(d, 3);
    let apart = |how: [&str; 2], tolerance: f64| {
        let profile = |n: [usize; 3]| {
            let mesh = Made::hex(n, size).mesh();
            let mut sum = vec![0.0; n[1]];
            for (j, f) in
                solid_fraction(&mesh, (&mesh, None), &x, v, 4.0 * d, how, tolerance).iter().enumerate()
            {
                sum[(mesh.centre[j][1] / size[1] * n[1] as f64) as usize] += f / (n[0] * n[2]) as f64;
            }
            sum
        };
        let fine = profile([72, 200, 16]);
        [[9, 25, 2], [18, 50, 4], [36, 100, 8]].map(|n| {
            let mean: Vec<f64> =
                fine.chunks(200 / n[1]).map(|c| c.iter().sum::<f64>() / c.len() as f64).collect();
            let gap: f64 = profile(n).iter().zip(&mean).map(|(a, b)| (a - b).powi(2)).sum();
            (gap / mean.iter().map(|b| b * b).sum::<f64>()).sqrt()
        })
    };
    // as a case without [map] and smooth.method has it
    let default = apart([map::DEFAULT, smooth::DEFAULT], 1e-2);
    let centroid = apart(["particle-centroid", "chebyshev"], 1e-8);
    println!("B, C, D: the defaults {default:.4?}; particle centroid, exp(Δ_T) {centroid:.4?}");
    assert!(default.iter().all(|e| *e < 0.01), "{default:?}");
    assert!(centroid.iter().all(|e| *e < 0.022), "{centroid:?}");
}
