// SPDX-License-Identifier: MIT OR Apache-2.0
//! Mesh, locate, smooth and the whole step: conservation, adjointness, positivity, bit-reproducibility.

mod common;

use common::step::setup;
use common::{Hex, P, cloud, message, random};
use voidage::arrange::Places;
use voidage::couple::receive_mesh;
use voidage::interpolate::FluidVelocity;
use voidage::linearise::LEVEL;
use voidage::locate::Locator;
use voidage::map::ParticleCentroid;
use voidage::mesh::made::Made;
use voidage::mesh::{Mesh, NONE, assemble};
use voidage::particles::Particles;
use voidage::smooth::{self, Active, Diffusion, Direction, Scratch, Smoother, Unsmoothed};
use voidage::step::{CouplingStep, Drive, Fluid, Setup, Sources};
use voidage::sums::sum;
use voidage::{forces, scheme};
use voidage_wire::Frame;

const SIZE: [f64; 3] = [0.06, 0.04, 0.05];

fn meshes() -> Vec<Hex> {
    let hex = |jiggle, cyclic_x| Hex { n: [6, 5, 7], size: SIZE, jiggle, cyclic_x };
    vec![hex(0.0, false), hex(0.0, true), hex(0.3, false), hex(0.3, true)]
}

fn check_same(a: &Mesh, b: &Mesh) {
    assert_eq!(a.ids, b.ids);
    let bits = |v: &[f64]| v.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
    assert_eq!(bits(&a.volume), bits(&b.volume));
    assert_eq!(a.centre, b.centre);
    assert_eq!(a.links, b.links);
    assert_eq!(a.sides.len(), b.sides.len());
    for (s, t) in a.sides.iter().zip(&b.sides) {
        assert_eq!(s, t);
    }
}

#[test]
fn a_mesh_is_the_same_to_the_bit_however_it_is_cut() {
    for hex in meshes() {
        let whole = assemble(&hex.whole()).unwrap();
        assert!((sum(whole.volume.iter().copied()) / SIZE.iter().product::<f64>() - 1.0).abs() < 1e-13);
        check_same(&whole, &assemble(&hex.pieces(2, |c| usize::from(c[0] >= 3))).unwrap());
        check_same(&whole, &assemble(&hex.pieces(2, |c| usize::from(c[2] >= 2))).unwrap());
        check_same(&whole, &assemble(&hex.pieces(3, |c| (c[0] / 2) % 3)).unwrap());
    }
}

#[test]
fn broken_meshes_are_named() {
    let hex = &meshes()[0];
    let mut pieces = hex.whole();
    pieces[0].cell_ids[3] = 4;
    assert!(assemble(&pieces).unwrap_err().to_string().contains("came twice"));
    let mut pieces = hex.whole();
    pieces[0].points[9][1] = f64::NAN;
    assert!(assemble(&pieces).unwrap_err().to_string().contains("NaN"));
    let mut pieces = hex.pieces(2, |c| usize::from(c[0] >= 3));
    pieces[1].patches.retain(|p| !p.name.starts_with("to"));
    assert!(assemble(&pieces).is_err());
}

#[test]
fn every_point_has_one_host_whatever_the_guess() {
    for hex in meshes() {
        let mesh = assemble(&hex.whole()).unwrap();
        let locator = Locator::new(&mesh);
        let mut seed = 3;
        let mut x: Vec<[f64; 3]> = (0..2000).map(|_| SIZE.map(|s| s * random(&mut seed))).collect();
        // on faces, edges and corners too
        x.extend((0..200).map(|i| {
            [SIZE[0] * (i % 7) as f64 / 6.0, SIZE[1] * (i % 6) as f64 / 5.0, SIZE[2] * (i % 8) as f64 / 7.0]
        }));
        let locate = |guess: &mut dyn FnMut() -> u32| {
            let mut host: Vec<u32> = x.iter().map(|_| guess()).collect();
            locator.locate(&mesh, &mut x.clone(), &mut host).unwrap();
            host
        };
        let cold = locate(&mut || NONE);
        let n = mesh.len() as f64;
        if hex.jiggle == 0.0 {
            assert!(cold == locate(&mut || (n * random(&mut seed)) as u32), "same hosts from random guesses");
        }
        assert!(cold == locate(&mut || 0), "same hosts from another guess");
        if hex.jiggle == 0.0 {
            for (p, h) in x.iter().zip(&cold) {
                let c = mesh.centre[*h as usize];
                // across the cyclic faces too
                let gap = |a: usize| (p[a] - c[a]).abs();
                let gap =
                    |a: usize| if a == 0 && hex.cyclic_x { gap(a).min(SIZE[0] - gap(a)) } else { gap(a) };
                let near = |a: usize| gap(a) <= 0.5001 * SIZE[a] / hex.n[a] as f64;
                assert!((0..3).all(near), "{p:?} in {c:?}");
            }
        }
        let mut out = vec![[SIZE[0] * 0.5, -1e-3, 0.01], [SIZE[0] + 1e-3, 0.01, 0.01]];
        let lost = locator.locate(&mesh, &mut out, &mut [NONE, 0]).unwrap_err();
        assert_eq!(lost[0].index, 0);
        assert_eq!(lost[0].near.as_deref(), Some("y"));
        assert_eq!(lost.len(), if hex.cyclic_x { 1 } else { 2 }, "cyclic faces let it through");
        if hex.cyclic_x {
            assert!((out[1][0] - 1e-3).abs() < 1e-12, "brought back");
        }
    }
}

fn smoother(name: &str, mesh: &Mesh, bandwidth: f64, tolerance: f64) -> Box<dyn Smoother> {
    smooth::by_name(name, mesh, &Diffusion::uniform(bandwidth).links(mesh), tolerance).unwrap()
}

fn smoothers(mesh: &Mesh) -> Vec<Box<dyn Smoother>> {
    let of = |name: &&str| [1e-2, 1e-9].map(|t| smoother(name, mesh, 0.02, t));
    smooth::NAMES.iter().flat_map(of).filter(|s| s.properties().conservative).collect()
}

fn all_of(s: &mut dyn Smoother, lanes: &mut [[f64; 8]]) {
    s.apply(lanes, &Active::whole(lanes.len()), Direction::Spread, &mut Scratch::default());
}

#[test]
fn smoothing_conserves_keeps_constants_and_is_self_adjoint() {
    for hex in meshes() {
        let mesh = assemble(&hex.whole()).unwrap();
        for mut s in smoothers(&mesh) {
            let mut seed = 5;
            let field: Vec<[f64; 8]> =
                (0..mesh.len()).map(|_| [0.0; 8].map(|_: f64| random(&mut seed))).collect();
            let mut out = field.clone();
            all_of(&mut *s, &mut out);
            let product = |a: &[[f64; 8]], i: usize, b: &[[f64; 8]], j: usize| {
                sum((0..mesh.len()).map(|c| mesh.volume[c] * a[c][i] * b[c][j]))
            };
            let ones = vec![[1.0; 8]; mesh.len()];
            for l in 0..8 {
                let (before, after) = (product(&field, l, &ones, 0), product(&out, l, &ones, 0));
                assert!((after / before - 1.0).abs() < 1e-14, "{} {after} {before}", s.name());
            }
            let (a, b) = (product(&out, 0, &field, 1), product(&field, 0, &out, 1));
            assert!((a / b - 1.0).abs() < 1e-13, "{}: {a} {b}", s.name());
            let mut constant = vec![[3.7; 8]; mesh.len()];
            all_of(&mut *s, &mut constant);
            assert!(constant.iter().flatten().all(|x| (x / 3.7 - 1.0).abs() < 1e-14), "{}", s.name());
        }
    }
}

#[test]
fn smoothers_agree_with_each_other_and_with_the_gaussian() {
    // 1-D column of fine cells: a point source spreads to exp(−r²/b²), second moment b²/2
    let n = 201;
    let hex = Hex { n: [n, 1, 1], size: [0.201, 1e-3, 1e-3], jiggle: 0.0, cyclic_x: false };
    let mesh = assemble(&hex.whole()).unwrap();
    let b = 0.015;
    let spread = |s: &mut dyn Smoother| {
        let mut f = vec![[0.0; 8]; n];
        f[100] = [1.0; 8];
        all_of(s, &mut f);
        f.iter().map(|x| x[0]).collect::<Vec<_>>()
    };
    let cheb = spread(&mut *smoother("chebyshev", &mesh, b, 1e-12));
    let unif = spread(&mut *smoother("uniformization", &mesh, b, 1e-12));
    let second: f64 = cheb.iter().enumerate().map(|(i, w)| w * ((i as f64 - 100.0) * 1e-3).powi(2)).sum();
    assert!((second / (b * b / 2.0) - 1.0).abs() < 1e-9, "{second}");
    for (i, (c, u)) in cheb.iter().zip(&unif).enumerate() {
        let gauss =
            1e-3 / (b * std::f64::consts::PI.sqrt()) * (-((i as f64 - 100.0) * 1e-3 / b).powi(2)).exp();
        assert!((c - u).abs() < 1e-11 && (c - gauss).abs() < 2e-3 * cheb[100], "{i}: {c} {u} {gauss}");
        assert!(*u >= 0.0);
    }
}

#[test]
fn active_cells_give_the_bits_of_the_whole_sweep() {
    let mesh =
        assemble(&Hex { n: [12, 10, 100], size: [0.06, 0.05, 0.5], jiggle: 0.0, cyclic_x: true }.whole())
            .unwrap();
    for mut s in smoothers(&mesh) {
        let occupied: Vec<u32> = (0..240).collect();
        let mut active = Active::default();
        s.plan(&occupied, &mut active);
        assert!(active.rows.len() < mesh.len() || s.name() == "none");
        let mut field = vec![[0.0; 8]; mesh.len()];
        let mut seed = 11;
        occupied.iter().for_each(|c| field[*c as usize] = [0.0; 8].map(|_: f64| random(&mut seed)));
        let (mut a, mut b) = (field.clone(), field);
        // what an earlier use left in the scratch must not matter
        let mut scratch = Scratch::default();
        s.apply(&mut vec![[7.0; 8]; mesh.len()], &Active::whole(mesh.len()), Direction::Gather, &mut scratch);
        all_of(&mut *s, &mut a);
        s.apply(&mut b, &active, Direction::Spread, &mut scratch);
        assert!(a == b, "{}: spread", s.name());
        // gather: only occupied cells are read
        let full: Vec<[f64; 8]> = (0..mesh.len()).map(|_| [0.0; 8].map(|_: f64| random(&mut seed))).collect();
        let (mut a, mut b) = (full.clone(), full);
        all_of(&mut *s, &mut a);
        s.apply(&mut b, &active, Direction::Gather, &mut scratch);
        assert!(occupied.iter().all(|c| a[*c as usize] == b[*c as usize]), "{}: gather", s.name());
    }
}

#[test]
fn threads_and_numbering_do_not_change_a_bit() {
    let mesh = Made::tet([9, 8, 7], SIZE).mesh();
    let t = Diffusion::uniform(0.012).links(&mesh);
    let mut seed = 3;
    let field: Vec<[f64; 8]> = (0..mesh.len()).map(|_| [0.0; 8].map(|_: f64| random(&mut seed))).collect();
    // the same cells numbered at random: rows are then renumbered
    let mut ids: Vec<usize> = (0..mesh.len()).collect();
    for i in (1..ids.len()).rev() {
        ids.swap(i, (random(&mut seed) * (i + 1) as f64) as usize);
    }
    let mut pieces = Made::tet([9, 8, 7], SIZE).pieces(1, |_| 0);
    pieces[0].cell_ids = ids.iter().map(|i| *i as i64).collect();
    let mixed = assemble(&pieces).unwrap();
    assert!(smooth::Graph::new(&mixed, &Diffusion::uniform(0.012).links(&mixed)).renumbered());
    for name in ["chebyshev", "uniformization"] {
        let run = |threads: usize| {
            let mut out = field.clone();
            let mut s = smooth::by_name(name, &mesh, &t, 1e-6).unwrap();
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| all_of(&mut *s, &mut out));
            out
        };
        let mut serial = field.clone();
        all_of(&mut *smooth::by_name(name, &mesh, &t, 1e-6).unwrap(), &mut serial);
        assert!([1, 2, 4].iter().all(|n| run(*n) == serial), "{name}: threads");
        // sums in a row run in the order of the slots, so other ids give other last bits
        let mut out = vec![[0.0; 8]; mesh.len()];
        (0..ids.len()).for_each(|i| out[ids[i]] = field[i]);
        all_of(&mut *smoother(name, &mixed, 0.012, 1e-6), &mut out);
        assert!((0..ids.len()).all(|i| (out[ids[i]][0] - serial[i][0]).abs() < 1e-13), "{name}: numbers");
    }
}

#[test]
fn implicit_solves_agree_with_the_direct_one_and_the_exponential() {
    for made in [Made::hex([8, 7, 6], SIZE), Made::tet([5, 4, 4], SIZE), Made::poly([6, 5, 5], SIZE)] {
        let mesh = made.mesh();
        let mut field = vec![[0.0; 8]; mesh.len()];
        let mut seed = 9;
        field.iter_mut().for_each(|f| *f = [0.0; 8].map(|_: f64| random(&mut seed)));
        let of = |name: &str| {
            let mut out = field.clone();
            all_of(&mut *smoother(name, &mesh, 0.008, 1e-9), &mut out);
            out
        };
        let gap = |a: &[[f64; 8]], b: &[[f64; 8]]| {
            let all = a.iter().zip(b).flat_map(|(a, b)| (0..8).map(|l| (a[l] - b[l]).powi(2)));
            (sum(all) / (8 * mesh.len()) as f64).sqrt()
        };
        let (exact, one) = (of("chebyshev"), of("direct"));
        assert!(gap(&of("constdiff"), &one) < 1e-6);
        assert!(gap(&of("uniformization"), &exact) < 1e-8);
        let (four, cn) = (gap(&of("backward-euler"), &exact), gap(&of("crank-nicolson"), &exact));
        assert!(four < 0.5 * gap(&one, &exact) && four > 1e-4, "{four}");
        assert!(cn < 0.1, "{cn}");
    }
}

#[test]
fn f32_conserves_and_cells_that_are_too_large_keep_what_they_have() {
    let mesh = Made::graded([10, 6, 8], SIZE).mesh();
    let t = Diffusion::uniform(0.01).links(&mesh);
    let mut seed = 9;
    let field: Vec<[f64; 8]> =
        (0..mesh.len()).map(|_| [0.0; 8].map(|_: f64| random(&mut seed) - 0.3)).collect();
    let graph = std::sync::Arc::new(smooth::Graph::new(&mesh, &t));
    let polynomial = smooth::Polynomial::chebyshev(graph, 1e-4, false);
    let (mut double, mut single) = (field.clone(), field.clone());
    all_of(&mut polynomial.clone(), &mut double);
    polynomial.single().apply(&mut single, &mesh.volume, &Active::whole(mesh.len()), Direction::Spread);
    let total = |f: &[[f64; 8]], l: usize| sum(f.iter().zip(&mesh.volume).map(|(f, v)| f[l] * v));
    for l in 0..8 {
        let size = sum(field.iter().zip(&mesh.volume).map(|(f, v)| f[l].abs() * v));
        assert!((total(&single, l) - total(&field, l)).abs() < 1e-15 * size);
        assert!(double.iter().zip(&single).all(|(a, b)| (a[l] - b[l]).abs() < 1e-5));
    }
    let limit = 0.006;
    let t = Diffusion { bandwidth: 0.01, largest_cell: limit, ..Diffusion::default() }.links(&mesh);
    let mut out = field.clone();
    all_of(&mut *smooth::by_name("chebyshev", &mesh, &t, 1e-4).unwrap(), &mut out);
    let large = |c: &usize| mesh.volume[*c].cbrt() > limit;
    let (kept, moved): (Vec<usize>, Vec<usize>) = (0..mesh.len()).partition(large);
    assert!(!kept.is_empty() && kept.iter().all(|c| (out[*c][0] - field[*c][0]).abs() < 1e-14));
    assert!(moved.iter().any(|c| out[*c][0] != field[*c][0]));
    assert!((total(&out, 0) / total(&field, 0) - 1.0).abs() < 1e-13);
}

fn fluid(mesh: &Mesh) -> Fluid {
    let wave =
        |k: f64| mesh.centre.iter().map(|c| [0, 1, 2].map(|a| (k * c[a] * 90.0 + a as f64).sin())).collect();
    Fluid { velocity: wave(1.0), pressure_gradient: wave(2.0), stress_divergence: wave(3.0) }
}

/// Two exchanges; what goes to both sides.
fn exchange(
    hex: &Hex,
    cut: bool,
    messages: &[Vec<u64>],
    setup: Setup,
) -> (Sources, Vec<(i64, [u64; 10])>, f64) {
    let pieces = if cut { hex.pieces(2, |c| usize::from(c[0] >= 3)) } else { hex.whole() };
    let mesh = assemble(&pieces).unwrap();
    let f = fluid(&mesh);
    let [g, positive] = ["chebyshev", "uniformization"].map(|name| smoother(name, &mesh, 0.015, 1e-4));
    let model_a = !setup.model_b;
    let mut step = CouplingStep::new(mesh, setup, Box::new(ParticleCentroid), g, positive);
    let frames: Vec<Frame> = messages.iter().map(|m| Frame::parse(m).unwrap()).collect();
    let mut p = Particles::receive(&frames, &Places::default()).unwrap();
    step.before_fluid(&mut p, true).unwrap();
    step.after_fluid(&p, &f, true).unwrap();
    step.before_fluid(&mut p, false).unwrap();
    step.after_fluid(&p, &f, false).unwrap();
    assert!(step.facts.solid_volume_error < 1e-13 && step.facts.solid_momentum_error < 1e-13);
    // the fluid's side, from the arrays it is given and its own fields
    let (s, m) = (&step.sources, &step.mesh);
    let reaction = [0, 1, 2].map(|a| {
        sum((0..m.len()).map(|j| {
            let pressure = if model_a { f.pressure_gradient[j][a] - f.stress_divergence[j][a] } else { 0.0 };
            -1e-3 * m.volume[j] * (s.su[j][a] - s.sp[j] * f.velocity[j][a] + (1.0 - s.voidage[j]) * pressure)
        }))
    });
    step.books.reaction = reaction;
    let error = step.books.error(None);
    let Drive { drag_coefficient, velocity, force, charged, .. } = &step.drive;
    let bits = |i: usize| {
        let all = [[drag_coefficient[i]].as_slice(), &velocity[i], &force[i], &charged[i]].concat();
        (p.id[i], std::array::from_fn(|k| all[k].to_bits()))
    };
    let mut drive: Vec<_> = (0..p.len()).map(bits).collect();
    drive.sort_unstable_by_key(|d: &(i64, _)| d.0);
    (step.sources.clone(), drive, error)
}

#[test]
fn action_is_reaction_for_every_scheme_interpolation_and_model() {
    for hex in meshes() {
        let list = [message(&cloud(3000, SIZE, 4e-4))];
        for s in scheme::all().iter().filter(|s| s.conservative()) {
            for how in [FluidVelocity::Gather, FluidVelocity::HostCell, FluidVelocity::Linear] {
                for model_b in [false, true] {
                    let (sources, _, error) = exchange(&hex, false, &list, setup(s.name(), how, model_b));
                    assert!(error < 1e-12, "{} {how:?} {model_b}: {error:e}", s.name());
                    assert!(sources.sp.iter().all(|x| *x >= 0.0));
                    assert!(sources.voidage.iter().all(|e| *e > 0.0 && *e <= 1.0));
                }
            }
        }
    }
}

#[test]
fn a_capped_voidage_keeps_the_third_law() {
    for hex in meshes() {
        let plain = || setup("conservative", FluidVelocity::Gather, false);
        let list = [message(&cloud(3000, SIZE, 4e-4))];
        let least = exchange(&hex, false, &list, plain()).0.voidage.into_iter().fold(1.0, f64::min);
        let floor = 0.5 * (1.0 + least);
        let (sources, _, error) = exchange(&hex, false, &list, Setup { voidage_min: floor, ..plain() });
        assert!(sources.voidage.contains(&floor), "the cap is met");
        assert!(error < 1e-12, "{error:e}");
    }
}

#[test]
fn action_is_reaction_with_lift_added_mass_parcels_and_their_stress() {
    for hex in meshes() {
        let list = [message(&cloud(3000, SIZE, 4e-4))];
        for drag in ["koch-hill", "beetstra-polydisperse", "cello"] {
            let with = |extra| {
                let drag = forces::by_name(drag).unwrap();
                let plain = setup("conservative", FluidVelocity::Gather, false);
                exchange(&hex, false, &list, Setup { drag, extra, ..plain })
            };
            let lift = Some(forces::lift::all()[1]);
            let stress = Some(forces::parcel::ParticleStress {
                pressure: 1.0,
                exponent: 3.0,
                close_packing: 0.63,
                floor: 1e-7,
            });
            let plain = with(forces::Extra::default());
            let all =
                with(forces::Extra { ratio: 2.0, lift, added_mass: 0.5, stress, ..forces::Extra::default() });
            assert!(plain.2 < 1e-12 && all.2 < 1e-12, "{:e} {:e}", plain.2, all.2);
            assert!(plain.1 != all.1 && plain.0.sp != all.0.sp && plain.0.voidage == all.0.voidage);
            let one = with(forces::Extra { stress, ..forces::Extra::default() });
            assert!(one.1 != plain.1 && one.0 == plain.0, "the stress acts on particles only");
        }
    }
}

#[test]
fn replies_are_bit_identical_for_any_ranks_and_order() {
    for hex in meshes() {
        let all = cloud(2000, SIZE, 4e-4);
        let mut shuffled = all.clone();
        let mut seed = 17;
        for i in (1..shuffled.len()).rev() {
            shuffled.swap(i, (random(&mut seed) * (i + 1) as f64) as usize);
        }
        let (left, right): (Vec<P>, Vec<P>) = shuffled.iter().partition(|p| p.x[2] < 0.02);
        let how = || setup("conservative", FluidVelocity::Linear, false);
        let one = exchange(&hex, false, &[message(&all)], how());
        let two = exchange(&hex, false, &[message(&left), message(&right)], how());
        let cut = exchange(&hex, true, &[message(&right), message(&[]), message(&left)], how());
        assert!(one.0 == two.0 && one.1 == two.1, "DEM ranks and order");
        assert!(one.0 == cut.0 && one.1 == cut.1, "CFD ranks");
    }
}

#[test]
fn a_cell_without_fluid_stops_the_step_with_advice() {
    let hex = &meshes()[0];
    let mesh = assemble(&hex.whole()).unwrap();
    let none = || -> Box<dyn Smoother> { Box::new(Unsmoothed) };
    let mut step = CouplingStep::new(
        mesh,
        setup("conservative", FluidVelocity::Gather, false),
        Box::new(ParticleCentroid),
        none(),
        none(),
    );
    let big = P { id: 1, x: [0.031, 0.02, 0.02], v: [0.0; 3], r: 0.006, ledger: [0.0; 3] };
    let words = message(&[big]);
    let mut p = Particles::receive(&[Frame::parse(&words).unwrap()], &Places::default()).unwrap();
    let e = step.before_fluid(&mut p, true).unwrap_err().to_string();
    assert!(e.contains("raise smooth.bandwidth") && e.contains("cell "), "{e}");
    p.position[0] = [1.0, 1.0, 1.0];
    let e = step.before_fluid(&mut p, true).unwrap_err().to_string();
    assert!(e.contains("particle 1 at") && e.contains("outside"), "{e}");
}

#[test]
fn the_mesh_comes_through_the_wire() {
    let mut none = voidage::partners::Partners::<voidage_wire::memory::Memory>::new(
        vec![],
        vec![],
        std::time::Duration::ZERO,
    );
    assert!(receive_mesh(&mut none).is_err(), "no CFD rank, no mesh");
}

#[test]
fn the_kernel_is_isotropic_but_on_tetrahedra_with_a_common_direction() {
    // second moments of a point's field, relative to b²/2: mean and difference along the axes, and mixed; bounds: measured,
    // rounded up. On tetrahedra that all lie along one diagonal it is drawn out along it: a property of two-point fluxes
    let size = [0.06; 3];
    let shapes = [
        (Made::hex([30; 3], size), 2e-5, 1e-9, 0.0..1e-9),
        (Made::poly([24; 3], size), 5e-3, 5e-3, 0.0..0.01),
        (Made::tet([16; 3], size).mirrored(), 0.02, 0.02, 0.0..0.03),
        (Made::tet([16; 3], size), 0.04, 0.01, 0.27..0.31),
    ];
    for (made, bias, spread, mixed) in shapes {
        let mesh = made.mesh();
        let b = 0.008;
        let near = |c: &[f64; 3]| c.iter().map(|x| (x - 0.03).powi(2)).sum::<f64>();
        let all = 0..mesh.len();
        let at = all.min_by(|i, j| near(&mesh.centre[*i]).total_cmp(&near(&mesh.centre[*j]))).unwrap();
        let mut f = vec![[0.0; 8]; mesh.len()];
        f[at] = [1.0 / mesh.volume[at]; 8];
        all_of(&mut *smoother("chebyshev", &mesh, b, 1e-8), &mut f);
        let moment = |g: &dyn Fn(usize) -> f64| sum((0..mesh.len()).map(|c| mesh.volume[c] * f[c][0] * g(c)));
        let mean = [0, 1, 2].map(|a| moment(&|c| mesh.centre[c][a]));
        let ratio = |a: usize, d: usize| {
            moment(&|c| (mesh.centre[c][a] - mean[a]) * (mesh.centre[c][d] - mean[d])) / (0.5 * b * b)
        };
        let along = [0, 1, 2].map(|a| ratio(a, a));
        let across = [ratio(0, 1), ratio(1, 2), ratio(2, 0)].map(f64::abs);
        println!("{:?}: {along:?} {across:?}", made.shape);
        let mean = along.iter().sum::<f64>() / 3.0;
        assert!((mean - 1.0).abs() < bias, "{:?} {along:?}", made.shape);
        assert!(along.iter().all(|r| (r - mean).abs() < spread), "{:?} {along:?}", made.shape);
        assert!(across.iter().all(|r| mixed.contains(r)), "{:?} {across:?}", made.shape);
    }
}

#[test]
fn the_ledger_of_an_excluded_particle_waits() {
    let mesh = assemble(&meshes()[0].whole()).unwrap();
    let f = fluid(&mesh);
    let none = || -> Box<dyn Smoother> { Box::new(Unsmoothed) };
    let s = Setup { exclude_outside: true, ..setup("conservative", FluidVelocity::Gather, false) };
    let mut step = CouplingStep::new(mesh, s, Box::new(ParticleCentroid), none(), none());
    let ledger = [1e-6, -2e-6, 0.0];
    let out = P { id: 1, x: [1.0; 3], v: [0.0; 3], r: 1e-4, ledger };
    let words = message(&[out]);
    let mut p = Particles::receive(&[Frame::parse(&words).unwrap()], &Places::default()).unwrap();
    step.before_fluid(&mut p, false).unwrap();
    step.after_fluid(&p, &f, false).unwrap();
    // L = taken - charged, and nothing of it went to the fluid
    assert_eq!(step.drive.charged[0].map(|c| -c), ledger);
    assert!(step.sources.su.iter().flatten().all(|x| *x == 0.0));
    assert_eq!(step.books.error(None), 0.0);
}

#[test]
fn what_has_no_reaction_never_reaches_the_fluid_not_even_in_the_first_interval() {
    let mesh = assemble(&meshes()[0].whole()).unwrap();
    let none = || -> Box<dyn Smoother> { Box::new(Unsmoothed) };
    for name in ["conservative", "explicit"] {
        let s =
            Setup { mean_pressure_gradient: [0.0, 7.0, -20.0], ..setup(name, FluidVelocity::Gather, false) };
        let period = s.period;
        let mut step = CouplingStep::new(mesh.clone(), s, Box::new(ParticleCentroid), none(), none());
        let at_rest = |ledger| P { id: 1, x: [0.031, 0.022, 0.012], v: [0.0; 3], r: 1e-3, ledger };
        let still = Fluid { velocity: vec![[0.0; 3]; mesh.len()], ..Fluid::default() };
        let mut exchange = |p: P, first: bool| {
            let words = message(&[p]);
            let mut p = Particles::receive(&[Frame::parse(&words).unwrap()], &Places::default()).unwrap();
            step.before_fluid(&mut p, first).unwrap();
            step.after_fluid(&p, &still, first).unwrap();
            (step.drive.force[0], step.drive.charged[0], step.sources.su.clone(), step.books)
        };
        // a held particle in fluid at rest takes Archimedes' force and that of the mean pressure gradient, no more
        let (force, charged, _, books) = exchange(at_rest([0.0; 3]), true);
        let v = 4.0 / 3.0 * std::f64::consts::PI * 1e-9;
        assert!((force[2] / (v * (1.2 * 9.81 + 20.0)) - 1.0).abs() < 1e-12, "{force:?}");
        let taken = force.map(|f| f * period);
        assert_eq!(books.error(Some(charged)), 0.0);
        // the fix: L = taken - charged
        let ledger = [0, 1, 2].map(|a| taken[a] - charged[a]);
        let (_, _, su, _) = exchange(at_rest(ledger), false);
        assert!(su.iter().flatten().all(|x| *x == 0.0), "{name}: {ledger:?} was given to the fluid");
    }
}

#[test]
fn a_steady_cell_is_dragged_by_shares_of_its_own_and_of_the_gathered_velocity() {
    // Su - Sp U = -G[K (u~ - v)] + (1 - theta) (G[K u~] - Sp U); explicit gives -G[K (u~ - v)], and with U = 0 G[K v]
    let mesh = assemble(&meshes()[3].whole()).unwrap();
    let f = fluid(&mesh);
    let still = Fluid { velocity: vec![[0.0; 3]; mesh.len()], ..fluid(&mesh) };
    let words = message(&cloud(300, SIZE, 2e-4));
    let sources = |name: &str, f: &Fluid| {
        let g = || smoother("chebyshev", &mesh, 0.02, 1e-9);
        let s =
            Setup { drag: forces::by_name("stokes").unwrap(), ..setup(name, FluidVelocity::Gather, false) };
        let mut step = CouplingStep::new(mesh.clone(), s, Box::new(ParticleCentroid), g(), g());
        for first in [true, false] {
            let frame = Frame::parse(&words).unwrap();
            let mut p = Particles::receive(&[frame], &Places::default()).unwrap();
            step.before_fluid(&mut p, first).unwrap();
            if first {
                step.after_fluid(&p, f, first).unwrap();
            }
        }
        step.sources.clone()
    };
    let (c, e, e0) = (sources("conservative", &f), sources("explicit", &f), sources("explicit", &still));
    assert!(c.sp.iter().any(|x| *x > 0.0) && e.sp.iter().all(|x| *x == 0.0));
    let size = e.su.iter().flatten().fold(0.0, |a: f64, b| a.max(b.abs()));
    let mut differ = 0.0_f64;
    for (j, u) in f.velocity.iter().enumerate() {
        for a in 0..3 {
            let own = c.sp[j] * u[a];
            let gathered = e0.su[j][a] - e.su[j][a];
            let due = e.su[j][a] + (1.0 - LEVEL) * (gathered - own);
            assert!(
                (c.su[j][a] - own - due).abs() < 1e-12 * size,
                "cell {j}: {:e}, {due:e}",
                c.su[j][a] - own
            );
            differ = differ.max((gathered - own).abs() / size);
        }
    }
    assert!(differ > 0.1, "the two velocities differ here");
}

#[test]
fn a_scheme_that_needs_the_last_interval_says_so() {
    let mesh = assemble(&meshes()[0].whole()).unwrap();
    let none = || -> Box<dyn Smoother> { Box::new(Unsmoothed) };
    let s = setup("conservative-adaptive", FluidVelocity::Gather, false);
    let mut step = CouplingStep::new(mesh, s, Box::new(ParticleCentroid), none(), none());
    let words = message(&cloud(3, SIZE, 4e-4));
    let mut p = Particles::receive(&[Frame::parse(&words).unwrap()], &Places::default()).unwrap();
    p.history = scheme::History::default();
    let e = step.before_fluid(&mut p, true).unwrap_err().to_string();
    assert!(e.contains("conservative-adaptive") && e.contains("./setup build"), "{e}");
}

/// Bits of the cells (ε, Sp, Su), of the replies by id, and of the sums.
type Bits = (Vec<[u64; 5]>, Vec<(i64, [u64; 10])>, [u64; 7]);

/// After two exchanges on so many threads.
fn bits_on(threads: usize, backwards: bool, mapping: &str) -> Bits {
    use voidage::bench::{scene, step::setup};
    let mesh = scene::mesh(scene::BOX, 12_000);
    let air = scene::air(&mesh);
    let mut map = voidage::map::by_name(mapping, &mesh).unwrap();
    map.prepare(&mesh, &voidage::map::Options::default());
    let [g, positive] = ["chebyshev", "uniformization"].map(|name| smoother(name, &mesh, 5e-3, 1e-3));
    let mut step = CouplingStep::new(mesh, setup("syamlal-obrien").unwrap(), map, g, positive);
    let mut p = scene::bed(scene::BOX, 20_000, scene::DIAMETER);
    if backwards {
        let list: Vec<u32> = (0..p.len() as u32).rev().collect();
        p.arrange(&list, &mut voidage::particles::Spare::default(), |_| {});
    }
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    for first in [true, false] {
        pool.install(|| {
            step.before_fluid(&mut p, first).unwrap();
            step.after_fluid(&p, &air, first).unwrap();
        });
        for (x, id) in p.position.iter_mut().zip(&p.id) {
            x[0] = (x[0] + 1e-4 * (id % 7) as f64).min(scene::BOX[0]);
        }
    }
    let (s, d) = (&step.sources, &step.drive);
    let cell = |j: usize| [s.voidage[j], s.sp[j], s.su[j][0], s.su[j][1], s.su[j][2]].map(f64::to_bits);
    let reply = |i: usize| {
        let all = [&[d.drag_coefficient[i]], &d.velocity[i][..], &d.force[i], &d.charged[i]].concat();
        (p.id[i], std::array::from_fn(|k| all[k].to_bits()))
    };
    let mut replies: Vec<_> = (0..p.len()).map(reply).collect();
    replies.sort_unstable_by_key(|r: &(i64, _)| r.0);
    let b = &step.books;
    let books = [b.charged[0], b.charged[1], b.charged[2], b.old_ledger[0], b.external[1], b.scale];
    let books = [books.as_slice(), &[step.facts.solid_volume_error]].concat();
    ((0..step.mesh.len()).map(cell).collect(), replies, std::array::from_fn(|k| books[k].to_bits()))
}

#[test]
fn the_whole_step_has_the_same_bits_on_any_number_of_threads_and_in_any_order() {
    for mapping in ["particle-centroid", "linear"] {
        let one = bits_on(1, false, mapping);
        for (threads, backwards) in [(2, false), (4, true)] {
            assert!(bits_on(threads, backwards, mapping) == one, "{mapping} on {threads} threads");
        }
    }
}
