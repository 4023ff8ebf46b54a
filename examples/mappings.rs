// SPDX-License-Identifier: MIT OR Apache-2.0
//! What the mappings cost and what they are worth: `cargo run --release --example mappings -- [cost|error|unstructured|bed]`.
//!
//! cost: µs per particle, cell-sorted, in a box of cells of 2.25 mm with particles of 1.2 mm. error: solid fraction against
//! the exact Gaussian of the particles, on many meshes, by exp(Δ_T) and by forward-euler. unstructured: the same along Voronoi links
//! and with the maximum-entropy deposit. bed: plane-averaged
//! solid fraction of the settled bed of cases/fluidised-bed on the meshes A to E of Sun & Xiao 2015, table 2.

use std::sync::Arc;
use std::time::Instant;
use voidage::bench::gauss::Lattice;
use voidage::locate::Locator;
use voidage::map::{self, Kernel, Linear, Mapping, MaxEntropy, Options, ParticleCentroid, Weights};
use voidage::mesh::made::Made;
use voidage::mesh::{Mesh, NONE};
use voidage::smooth::{self, Active, Diffusion, Direction, Field, Graph, Scratch};

fn random(seed: &mut u64) -> f64 {
    *seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    (*seed >> 11) as f64 / (1u64 << 53) as f64
}

/// The mesh with |S|/d replaced by S·d/d² on each link: the Laplacian's trace is then right on skew meshes.
fn cosines(mesh: &Mesh) -> Mesh {
    let mut m = mesh.clone();
    for i in 0..mesh.len() {
        for k in mesh.link_start[i] as usize..mesh.link_start[i + 1] as usize {
            let j = mesh.links[k].to;
            if let Some(s) = mesh.sides(i).iter().find(|s| s.across == j) {
                let d = [0, 1, 2].map(|a| mesh.centre[j as usize][a] - mesh.shift(s)[a] - mesh.centre[i][a]);
                let n: f64 = (0..3).map(|a| s.plane[a] * d[a]).sum();
                m.links[k].weight *= n / d.iter().map(|x| x * x).sum::<f64>().sqrt();
            }
        }
    }
    m
}

/// exp(Δ_T).
const EXACT: (&str, f64) = ("chebyshev", 1e-9);
/// As the library smooths unless told otherwise.
const DEFAULT: (&str, f64) = (smooth::DEFAULT, 1e-2);
/// Explicit Euler steps; the tolerance is not used.
const EULER: (&str, f64) = ("forward-euler", 1e-2);

/// One field smoothed by a method of the library with T = b²/4 − variance/2 ≥ 0 on each link.
fn smooth(mesh: &Mesh, b: f64, variance: Option<&[f64]>, method: (&str, f64), phi: &[f64]) -> Vec<f64> {
    let t = Diffusion { bandwidth: b, variance, ..Diffusion::default() }.links(mesh);
    let graph = Arc::new(Graph::new(mesh, &t));
    let Some(mut s) = smooth::on(method.0, mesh, &t, &graph, method.1) else { panic!("no {}", method.0) };
    let mut field = Field::zero(mesh.len());
    field.iter_mut().zip(phi).for_each(|(l, p)| l[0] = *p);
    s.apply(&mut field, &Active::whole(mesh.len()), Direction::Spread, &mut Scratch::default());
    field.iter().map(|l| l[0]).collect()
}

fn deposit(mesh: &Mesh, w: &Weights, volume: &[f64]) -> Vec<f64> {
    let mut phi = vec![0.0; mesh.len()];
    for (i, v) in volume.iter().enumerate() {
        for (cell, m) in w.of(i) {
            phi[cell] += m * v / mesh.volume[cell];
        }
    }
    phi
}

fn locate(mesh: &Mesh, position: &mut [[f64; 3]]) -> Vec<u32> {
    let mut host = vec![NONE; position.len()];
    Locator::new(mesh).locate(mesh, position, &mut host).unwrap_or_else(|l| panic!("lost {:?}", l[0]));
    host
}

fn cost() {
    println!("µs per particle, cell-sorted, cells of 2.25 mm, d = 1.2 mm (20k particles; kernel: 20)");
    let size = [0.054, 0.054, 0.054];
    let h = 0.00225f64;
    for (name, made) in [
        ("hex", Made::hex([24; 3], size)),
        ("graded", Made::graded([24; 3], size)),
        // cells of the volume of a 2.25 mm cube
        ("tet", Made::tet([13; 3], [13.0 * h * 6f64.cbrt(); 3])),
        ("poly", Made::poly([18; 3], [18.0 * h * 2f64.cbrt(); 3])),
        ("warped hex", Made::hex([24; 3], size).jiggled(0.2)),
    ] {
        let mesh = made.mesh();
        let start = Instant::now();
        let linked = mesh.with_voronoi_links();
        let (t, n) = (start.elapsed().as_secs_f64() * 1e6, mesh.len() as f64);
        println!(
            "{name:12} Voronoi links      {:10.4} µs per cell  {:6.1} links",
            t / n,
            linked.links.len() as f64 / n
        );
        let mut seed = 5;
        let mut position: Vec<[f64; 3]> =
            (0..20_000).map(|_| made.size.map(|s| s * (0.02 + 0.96 * random(&mut seed)))).collect();
        let host = locate(&mesh, &mut position);
        let mut order: Vec<usize> = (0..position.len()).collect();
        order.sort_by_key(|i| host[*i]);
        let position: Vec<_> = order.iter().map(|i| position[*i]).collect();
        let host: Vec<_> = order.iter().map(|i| host[*i]).collect();
        for mut m in map::all() {
            m.prepare(&mesh, &Options { bandwidth: 4.0 * 0.0012, grid: 2.0 * h });
            let n = if m.name() == "kernel" { 20 } else { position.len() };
            let radius = vec![0.0006; n];
            let mut w = Weights::default();
            let mut best = f64::INFINITY;
            for _ in 0..5 {
                let start = Instant::now();
                m.weights(&mesh, &position[..n], &radius, &host[..n], &mut w);
                best = best.min(start.elapsed().as_secs_f64());
            }
            println!(
                "{name:12} {:18} {:10.4} µs  {:6.1} cells",
                m.name(),
                best / n as f64 * 1e6,
                (0..n).map(|i| w.of(i).count()).sum::<usize>() as f64 / n as f64
            );
        }
    }
}

/// Spheres in the lower 0.6 of each axis: anywhere, or on a jiggled lattice, as even as a packed bed, two per mean cell.
fn spheres(made: &Made, packed: bool) -> Vec<[f64; 3]> {
    let mut seed = 77;
    let mut random = |_| random(&mut seed);
    let cells = made.size.iter().product::<f64>();
    if !packed {
        let any = |_| [0, 1, 2].map(&mut random);
        let list: Vec<[f64; 3]> = (0..(0.3 * cells) as usize).map(any).collect();
        return list.iter().map(|x| [0, 1, 2].map(|a| made.size[a] * (0.001 + 0.6 * x[a]))).collect();
    }
    let n = made.size.map(|s| (0.6 * s * 2f64.cbrt()).round() as usize);
    let one = |i: usize| {
        let at = [i % n[0], i / n[0] % n[1], i / n[0] / n[1]];
        [0, 1, 2].map(|a| 0.6 * made.size[a] * (at[a] as f64 + 0.5 + 0.6 * (random(a) - 0.5)) / n[a] as f64)
    };
    (0..n.iter().product()).map(one).collect()
}

/// Spheres of volume 1 deposited by a mapping, made ready for bandwidth b.
fn field(mesh: &Mesh, position: &[[f64; 3]], host: &[u32], b: f64, m: &mut dyn Mapping) -> Vec<f64> {
    m.prepare(mesh, &Options { bandwidth: b, grid: 1.0 });
    let mut w = Weights::default();
    m.weights(mesh, position, &vec![0.1; host.len()], host, &mut w);
    deposit(mesh, &w, &vec![1.0; host.len()])
}

/// L2 of the difference ÷ L2 of the exact field.
fn relative(mesh: &Mesh, a: &[f64], exact: &[f64]) -> f64 {
    let sum = |f: &dyn Fn(usize) -> f64| (0..mesh.len()).map(|i| mesh.volume[i] * f(i).powi(2)).sum::<f64>();
    (sum(&|i| a[i] - exact[i]) / sum(&|i| exact[i])).sqrt()
}

/// Solid fraction error (L2 of the difference ÷ L2 of the exact field) of a bed in the corner of the box.
fn error() {
    println!(
        "solid fraction against the exact Gaussian of the particles: relative L2 (÷ particle centroid: gain)"
    );
    println!(
        "T: b2/4; T-: less the deposit's variance; tet*: smoothed with S.d/d2 on the links instead of |S|/d"
    );
    println!(
        "{:16} {:7} {:>4} {:>9} {:>17} {:>17} {:>21} {:>17}",
        "mesh", "bed", "b/h", "centroid", "linear T", "linear T-", "forward-euler: centr.", "linear T"
    );
    // h = V^(1/3) of the mean cell = 1
    let (fine, side) = ([24.0, 24.0, 40.0], |n: usize, per: f64| [n as f64 * per.cbrt(); 3]);
    for (name, made, straight) in [
        ("hex 24x24x40", Made::hex([24, 24, 40], fine), false),
        ("graded 24x24x40", Made::graded([24, 24, 40], fine), false),
        ("graded 8x8x8", Made::graded([8; 3], side(8, 1.0)), false),
        ("poly", Made::poly([6; 3], side(6, 2.0)), false),
        ("tet", Made::tet([5; 3], side(5, 6.0)), false),
        ("tet*", Made::tet([5; 3], side(5, 6.0)), true),
        ("tet mirrored", Made::tet([6; 3], side(6, 6.0)).mirrored(), false),
    ] {
        let mesh = made.mesh();
        let lattice = Lattice::of_mesh(&mesh);
        let links = if straight { cosines(&mesh) } else { mesh.clone() };
        for packed in [false, true] {
            let mut position = spheres(&made, packed);
            let host = locate(&mesh, &mut position);
            for b in [0.7, 1.0, 2.0, 4.0] {
                let field = |m: &mut dyn Mapping| field(&mesh, &position, &host, b, m);
                let exact = match &lattice {
                    Some(lattice) => lattice.solid_fraction(&position, |_| 1.0, |_| b),
                    None => field(&mut Kernel::default()),
                };
                let mut linear = Linear::default();
                let (centroid, deposited) = (field(&mut ParticleCentroid), field(&mut linear));
                let variance = linear.link_variance(&mesh);
                let gap = |variance: Option<&[f64]>, method, phi: &[f64]| {
                    relative(&mesh, &smooth(&links, b, variance, method, phi), &exact)
                };
                let c = gap(None, EXACT, &centroid);
                let of = |e: f64| format!("{e:9.4} ({:5.2})", c / e);
                println!(
                    "{name:16} {:7} {b:4.1} {c:9.4} {:>17} {:>17} {:>21} {:>17}",
                    if packed { "packed" } else { "random" },
                    of(gap(None, EXACT, &deposited)),
                    of(gap(Some(&variance), EXACT, &deposited)),
                    of(gap(None, EULER, &centroid)),
                    of(gap(None, EULER, &deposited)),
                );
            }
        }
    }
}

/// The same on cells of any shape, along the links of the mesh's faces and of the Voronoi diagram of its centres.
fn unstructured() {
    println!(
        "solid fraction against the exact Gaussian: relative L2 (÷ particle centroid with the same links, ÷ with faces)"
    );
    println!("linear: T = b2/4; max-entropy: its variance taken out; Euler: max-entropy by forward-euler");
    println!(
        "{:13} {:7} {:>4} {:>9} {:>16} {:>9} {:>23} {:>23} {:>23} {:>16}",
        "mesh",
        "bed",
        "b/h",
        "centroid",
        "linear",
        "V. centr.",
        "V. linear",
        "V. max-entropy",
        "V. Euler",
        "max-entropy"
    );
    let side = |n: usize, per: f64| [n as f64 * per.cbrt(); 3];
    for (name, made) in [
        ("hex", Made::hex([9; 3], side(9, 1.0))),
        ("poly", Made::poly([6; 3], side(6, 2.0))),
        ("tet even", Made::tet([5; 3], side(5, 6.0)).jiggled(0.0)),
        ("tet", Made::tet([5; 3], side(5, 6.0))),
        ("mirrored even", Made::tet([6; 3], side(6, 6.0)).mirrored().jiggled(0.0)),
        ("mirrored", Made::tet([6; 3], side(6, 6.0)).mirrored()),
    ] {
        let mesh = made.mesh();
        let linked = mesh.with_voronoi_links();
        let mut entropy = MaxEntropy::default();
        entropy.prepare(&mesh, &Options::default());
        let taken = |m: &Mesh| map::taken_out(&entropy, &mesh, m).unwrap_or_default();
        let (faces, voronoi) = (taken(&mesh), taken(&linked));
        for packed in [false, true] {
            let mut position = spheres(&made, packed);
            let host = locate(&mesh, &mut position);
            for b in [0.7, 1.0, 2.0, 4.0] {
                let field = |m: &mut dyn Mapping| field(&mesh, &position, &host, b, m);
                let exact = field(&mut Kernel::default());
                let [centroid, linear, entropy] = [
                    field(&mut ParticleCentroid),
                    field(&mut Linear::default()),
                    field(&mut MaxEntropy::default()),
                ];
                let gap = |links: &Mesh, variance: Option<&[f64]>, method, phi: &[f64]| {
                    relative(&mesh, &smooth(links, b, variance, method, phi), &exact)
                };
                let (c, v) = (gap(&mesh, None, EXACT, &centroid), gap(&linked, None, EXACT, &centroid));
                let both = |e: f64| format!("{e:9.4} ({:5.2}, {:5.2})", v / e, c / e);
                let one = |e: f64| format!("{e:8.4} ({:5.2})", c / e);
                println!(
                    "{name:13} {:7} {b:4.1} {c:9.4} {:>16} {v:9.4} {:>23} {:>23} {:>23} {:>16}",
                    if packed { "packed" } else { "random" },
                    one(gap(&mesh, None, EXACT, &linear)),
                    both(gap(&linked, None, EXACT, &linear)),
                    both(gap(&linked, Some(&voronoi), EXACT, &entropy)),
                    both(gap(&linked, Some(&voronoi), EULER, &entropy)),
                    one(gap(&mesh, Some(&faces), EXACT, &entropy)),
                );
            }
        }
    }
}

/// Solid fraction averaged over planes across z (height) and x, on meshes A to E, b = 4 d.
fn bed() {
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/cases/fluidised-bed/bed.data");
    let text = std::fs::read_to_string(file).unwrap_or_else(|e| panic!("{file}: {e}"));
    let rows = text.lines().skip_while(|l| !l.starts_with("Atoms")).skip(1);
    let rows: Vec<Vec<f64>> = rows
        .map(|l| l.split_whitespace().filter_map(|w| w.parse().ok()).collect())
        .filter(|r: &Vec<f64>| r.len() >= 7)
        .collect();
    println!("first row {:?}, {} rows", rows[0], rows.len());
    let size = [0.044, 0.12, 0.01];
    let d = rows[0][2];
    let particles: Vec<[f64; 3]> =
        rows.iter().map(|r| [r[r.len() - 3], r[r.len() - 2], r[r.len() - 1]]).collect();
    let tall = (0..3).map(|a| particles.iter().map(|p| p[a]).fold(0.0, f64::max)).collect::<Vec<_>>();
    println!("d = {d}, upper corner of the bed {tall:?}");
    let v = std::f64::consts::PI / 6.0 * d.powi(3);
    let meshes =
        [("A", [6, 16, 1]), ("B", [9, 25, 2]), ("C", [18, 50, 4]), ("D", [36, 100, 8]), ("E", [72, 200, 16])];
    let cases = [
        ("particle-centroid", false, false, EXACT),
        ("linear, T", true, false, EXACT),
        ("linear, T-", true, true, EXACT),
        ("particle-centroid, euler", false, false, EULER),
        ("linear, T, euler", true, false, EULER),
        ("linear, default", true, false, DEFAULT),
    ];
    for (label, made_mapping, less, method) in cases {
        let mut profiles: Vec<[Vec<f64>; 2]> = Vec::new();
        for (_, n) in meshes {
            let mesh = Made::hex(n, size).mesh();
            let mut position = particles.clone();
            let host = locate(&mesh, &mut position);
            let mut w = Weights::default();
            let mut linear = Linear::default();
            linear.prepare(&mesh, &Options::default());
            let m: &dyn Mapping = if made_mapping { &linear } else { &ParticleCentroid };
            m.weights(&mesh, &position, &vec![0.5 * d; position.len()], &host, &mut w);
            let phi = deposit(&mesh, &w, &vec![v; position.len()]);
            let variance = less.then(|| m.link_variance(&mesh));
            let phi = smooth(&mesh, 4.0 * d, variance.as_deref(), method, &phi);
            // planes across x and y
            let profile = |axis: usize| -> Vec<f64> {
                let mut sum = vec![(0.0, 0.0); n[axis]];
                for i in 0..mesh.len() {
                    let at = (mesh.centre[i][axis] / size[axis] * n[axis] as f64) as usize;
                    sum[at].0 += phi[i] * mesh.volume[i];
                    sum[at].1 += mesh.volume[i];
                }
                sum.iter().map(|s| s.0 / s.1).collect()
            };
            profiles.push([profile(0), profile(1)]);
        }
        for axis in 0..2 {
            // cubic through cell means of the finest mesh: compare cell means with means of E over the same cells
            let fine = &profiles[4][axis];
            print!("{label:24} profile along {}: L2 against E:", ["x", "y"][axis]);
            for (m, (name, _)) in meshes.iter().enumerate().take(4) {
                let coarse = &profiles[m][axis];
                let mean = |i: usize| {
                    let (a, b) = (
                        i as f64 / coarse.len() as f64 * fine.len() as f64,
                        (i + 1) as f64 / coarse.len() as f64 * fine.len() as f64,
                    );
                    (0..fine.len())
                        .map(|k| fine[k] * ((k as f64 + 1.0).min(b) - (k as f64).max(a)).max(0.0))
                        .sum::<f64>()
                        / (b - a)
                };
                let up: f64 = (0..coarse.len()).map(|i| (coarse[i] - mean(i)).powi(2)).sum();
                let down: f64 = (0..coarse.len()).map(|i| mean(i).powi(2)).sum();
                print!("  {name} {:.3} %", 100.0 * (up / down).sqrt());
            }
            println!();
        }
    }
}

fn main() {
    let what = std::env::args().nth(1).unwrap_or_default();
    for (name, run) in
        [("cost", cost as fn()), ("error", error), ("unstructured", unstructured), ("bed", bed)]
    {
        if what.is_empty() || what == name {
            run();
        }
    }
}
