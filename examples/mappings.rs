// SPDX-License-Identifier: MIT OR Apache-2.0
//! What the mappings cost and what they are worth: `cargo run --release --example mappings -- [cost|error|bed]`.
//!
//! cost: µs per particle, cell-sorted, in a box of cells of 2.25 mm with particles of 1.2 mm. error: voidage against
//! the exact Gaussian of the particles, with T reduced by the deposit's own variance per face. bed: plane-averaged
//! solid fraction of the settled bed of cases/fluidised-bed on the meshes A to E of Sun & Xiao 2015, table 2.

use std::time::Instant;
use voidage::locate::Locator;
use voidage::map::{self, Kernel, Linear, Mapping, Options, ParticleCentroid, Weights};
use voidage::mesh::made::Made;
use voidage::mesh::{Mesh, NONE};

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

/// exp(T L) of one field with T = b²/4 − variance/2 ≥ 0 on each link, by uniformization to 1e-10.
fn smooth(given: &Mesh, bandwidth: f64, variance: &[f64], straight: bool, phi: &mut [f64]) -> usize {
    let turned;
    let mesh = if straight {
        turned = cosines(given);
        &turned
    } else {
        given
    };
    let t = |k: usize| (bandwidth * bandwidth / 4.0 - variance.get(k).map_or(0.0, |v| 0.5 * v)).max(0.0);
    let mut q = 0.0f64;
    let mut clipped = 0;
    for i in 0..mesh.len() {
        let first = mesh.link_start[i] as usize;
        q = q.max(
            mesh.links(i).iter().enumerate().map(|(k, l)| t(first + k) * l.weight).sum::<f64>()
                / mesh.volume[i],
        );
        clipped += (0..mesh.links(i).len()).filter(|k| t(first + k) == 0.0).count();
    }
    let (mut now, mut log, mut sum, mut k) = (phi.to_vec(), -q, 0.0, 0.0);
    phi.iter_mut().for_each(|p| *p = 0.0);
    loop {
        let p = f64::exp(log);
        sum += p;
        phi.iter_mut().zip(&now).for_each(|(a, b)| *a += p * b);
        if sum > 1.0 - 1e-10 && k >= q || k > q + 40.0 * q.sqrt() + 100.0 {
            break;
        }
        k += 1.0;
        log += (q / k).ln();
        now = (0..mesh.len())
            .map(|i| {
                let first = mesh.link_start[i] as usize;
                let flux: f64 = mesh
                    .links(i)
                    .iter()
                    .enumerate()
                    .map(|(n, l)| t(first + n) * l.weight * (now[l.to as usize] - now[i]))
                    .sum();
                now[i] + flux / (mesh.volume[i] * q)
            })
            .collect();
    }
    clipped
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
                w.cell.len() as f64 / n as f64
            );
        }
    }
}

/// Solid fraction error (L2 of the difference ÷ L2 of the exact field) of a bed in the corner of the box.
fn error() {
    println!(
        "solid fraction against the exact Gaussian of the particles: relative L2; T: b2/4; T-: less the deposit's variance"
    );
    println!("(tet*, poly*: smoothed with S.d/d2 on the links instead of |S|/d)");
    println!(
        "{:8} {:7} {:>5} {:>9} {:>9} {:>9} {:>7} {:>7}",
        "mesh", "bed", "b/h", "centroid", "linear T", "linear T-", "ratio T", "ratio T-"
    );
    let n = 8usize;
    for kind in ["hex", "graded", "tet", "poly"] {
        let side = n as f64;
        let made = match kind {
            "hex" => Made::hex([n; 3], [side; 3]),
            "graded" => Made::graded([n; 3], [side; 3]),
            "tet" => Made::tet([4; 3], [4.0 * 6f64.cbrt(); 3]),
            _ => Made::poly([6; 3], [6.0 * 2f64.cbrt(); 3]),
        };
        // h = V^(1/3) of the mean cell = 1
        let mesh = made.mesh();
        for packed in [false, true] {
            let mut seed = 77;
            let mut position: Vec<[f64; 3]> = Vec::new();
            if packed {
                // two per cell, a jiggled lattice: as even as a packed bed
                let count = (0.6 * made.size[0] * 2f64.cbrt()).round() as usize;
                for i in 0..count.pow(3) {
                    let c = [i % count, i / count % count, i / count / count];
                    position.push([0, 1, 2].map(|a| {
                        0.6 * made.size[a] * (c[a] as f64 + 0.5 + 0.6 * (random(&mut seed) - 0.5))
                            / count as f64
                    }));
                }
            } else {
                position =
                    (0..150).map(|_| made.size.map(|s| s * (0.001 + 0.6 * random(&mut seed)))).collect();
            }
            let host = locate(&mesh, &mut position);
            let (radius, volume) = (vec![0.1; host.len()], vec![1.0; host.len()]);
            for b in [0.7, 1.0, 2.0, 4.0] {
                let field = |m: &mut dyn Mapping| {
                    m.prepare(&mesh, &Options { bandwidth: b, grid: 1.0 });
                    let mut w = Weights::default();
                    m.weights(&mesh, &position, &radius, &host, &mut w);
                    deposit(&mesh, &w, &volume)
                };
                let exact = field(&mut Kernel::default());
                let (centroid, mut linear) = (field(&mut ParticleCentroid), Linear::default());
                let deposited = field(&mut linear);
                let variance = linear.link_variance(&mesh);
                let norm = |mut a: Vec<f64>, variance: &[f64], straight| {
                    smooth(&mesh, b, variance, straight, &mut a);
                    let sum = |f: &dyn Fn(usize) -> f64| {
                        (0..mesh.len()).map(|i| mesh.volume[i] * f(i).powi(2)).sum::<f64>()
                    };
                    (sum(&|i| a[i] - exact[i]) / sum(&|i| exact[i])).sqrt()
                };
                for straight in [false, true] {
                    if straight && (kind == "hex" || kind == "graded") {
                        continue;
                    }
                    let (c, t, less) = (
                        norm(centroid.clone(), &[], straight),
                        norm(deposited.clone(), &[], straight),
                        norm(deposited.clone(), &variance, straight),
                    );
                    let name = format!("{kind}{}", if straight { "*" } else { "" });
                    let bed = if packed { "packed" } else { "random" };
                    println!(
                        "{name:8} {bed:7} {b:5.1} {c:9.4} {t:9.4} {less:9.4} {:7.2} {:7.2}",
                        c / t,
                        c / less
                    );
                }
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
    for (label, made_mapping, less) in
        [("particle-centroid", false, false), ("linear, T", true, false), ("linear, T-", true, true)]
    {
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
            let mut phi = deposit(&mesh, &w, &vec![v; position.len()]);
            let variance = if less { m.link_variance(&mesh) } else { Vec::new() };
            smooth(&mesh, 4.0 * d, &variance, false, &mut phi);
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
            print!("{label:18} profile along {}: L2 against E:", ["x", "y"][axis]);
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
    for (name, run) in [("cost", cost as fn()), ("error", error), ("bed", bed)] {
        if what.is_empty() || what == name {
            run();
        }
    }
}
