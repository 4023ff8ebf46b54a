// SPDX-License-Identifier: MIT OR Apache-2.0
//! What must hold always (design §3.1), on random meshes with random particles, for every mapping, smoother and scheme
//! of the lists: a method that joins a list is tested without a line here.

mod common;

use proptest::prelude::*;
use std::f64::consts::PI;
use voidage::arrange::Order;
use voidage::interpolate::FluidVelocity;
use voidage::locate;
use voidage::map::{self, Weights};
use voidage::mesh::made::Made;
use voidage::mesh::{Mesh, NONE};
use voidage::particles::{Particles, Spare};
use voidage::scheme::{self, History};
use voidage::smooth::{self, Active, Diffusion, Direction, Scratch};
use voidage::step::{CouplingStep, Fluid, Setup};
use voidage::sums::{norm, sum, sum3};

type V = [f64; 3];
const SIZE: V = [0.06, 0.04, 0.05];
const BANDWIDTH: f64 = 0.02;
const PERIOD: f64 = 1e-3;

/// Random number in [0, 1).
fn random(seed: &mut u64) -> f64 {
    *seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    (*seed >> 11) as f64 / (1u64 << 53) as f64
}

fn vectors(n: usize, scale: f64, seed: &mut u64) -> Vec<V> {
    (0..n).map(|_| [0; 3].map(|_: i32| scale * (2.0 * random(seed) - 1.0))).collect()
}

/// Hexahedra plain, graded or jiggled, tetrahedra, polyhedra, cylinders of hexahedra or tetrahedra; walls or cyclic in any axis.
fn meshes() -> impl Strategy<Value = Mesh> {
    let n = prop::array::uniform3(3usize..6);
    (0..7usize, n, prop::array::uniform3(any::<bool>())).prop_map(|(kind, n, cyclic)| {
        let made = match kind {
            0 => Made::hex(n, SIZE),
            1 => Made::graded(n, SIZE),
            2 => Made::hex(n, SIZE).jiggled(0.3),
            3 => Made::tet(n.map(|c| c.min(3)), SIZE),
            4 => Made::poly(n.map(|c| c.min(4)), SIZE),
            5 => Made::hex(n, SIZE).round(),
            _ => Made::tet(n.map(|c| c.min(3)), SIZE).round(),
        };
        made.cyclic(if kind < 3 { cyclic } else { [false; 3] }).mesh()
    })
}

/// Up to 40 particles anywhere, all of which fit into the smallest cell; velocities and ledgers over eight decades.
fn particles(mesh: &Mesh, n: usize, seed: u64) -> Particles {
    let mut s = seed;
    let smallest = mesh.volume.iter().copied().fold(f64::INFINITY, f64::min);
    let most = (0.02 * smallest * 0.75 / PI).cbrt();
    let radius: Vec<f64> = (0..n).map(|_| most * (0.2 + 0.8 * random(&mut s))).collect();
    let spread = |s: &mut u64| 10f64.powf(-8.0 * random(s));
    let (fast, owed) = (spread(&mut s), 1e-9 * spread(&mut s));
    let (anywhere, locator) =
        (|s: &mut u64| [0, 1, 2].map(|a| SIZE[a] * (1e-3 + 0.998 * random(s))), locate::Locator::new(mesh));
    let holds = |x: V| locator.locate(mesh, &mut [x], &mut [NONE]).is_ok();
    let inside = |s: &mut u64| std::iter::repeat_with(|| anywhere(s)).find(|x| holds(*x)).expect("endless");
    Particles {
        id: (0..n as i64).map(|i| 3 * i + 1).collect(),
        origin: (0..n as u32).map(|i| (0, i)).collect(),
        position: (0..n).map(|_| inside(&mut s)).collect(),
        velocity: vectors(n, fast, &mut s),
        mass: radius.iter().map(|r| 2500.0 * 4.0 / 3.0 * PI * r.powi(3)).collect(),
        radius,
        ledger: vectors(n, owed, &mut s),
        history: History {
            impulse: vectors(n, owed, &mut s),
            drag_coefficient: (0..n).map(|_| 1e-6 * random(&mut s)).collect(),
            drive: vectors(n, 1.0, &mut s),
            force: vectors(n, owed, &mut s),
            velocity: vectors(n, fast, &mut s),
        },
        ..Particles::default()
    }
}

/// For the mappings that ask.
const OPTIONS: map::Options = map::Options { bandwidth: BANDWIDTH, grid: 0.01 };

fn setup(scheme: &'static dyn scheme::Scheme, how: FluidVelocity, model_b: bool) -> Setup {
    let like = common::step::setup(scheme.name(), how, model_b);
    Setup { mean_pressure_gradient: [0.0, 2.0, 0.0], period: PERIOD, ..like }
}

/// Impulse the fluid gives, from the arrays it gets and its own fields.
fn reaction(step: &CouplingStep, fluid: &Fluid, model_a: bool) -> V {
    let (s, m) = (&step.sources, &step.mesh);
    sum3((0..m.len()).map(|j| {
        [0, 1, 2].map(|a| {
            let stress = fluid.pressure_gradient[j][a] - fluid.stress_divergence[j][a];
            let share = if model_a { (1.0 - s.voidage[j]) * stress } else { 0.0 };
            -PERIOD * m.volume[j] * (s.su[j][a] - s.sp[j] * fluid.velocity[j][a] + share)
        })
    }))
}

/// Σ |terms| that `reaction` adds up, N s.
fn terms(step: &CouplingStep, fluid: &Fluid, model_a: bool) -> f64 {
    let (s, m) = (&step.sources, &step.mesh);
    sum((0..m.len()).map(|j| {
        let stress = norm(fluid.pressure_gradient[j]) + norm(fluid.stress_divergence[j]);
        let share = if model_a { (1.0 - s.voidage[j]) * stress } else { 0.0 };
        PERIOD * m.volume[j] * (norm(s.su[j]) + s.sp[j] * norm(fluid.velocity[j]) + share)
    }))
}

/// Two exchanges of every combination of the lists.
fn exchange(mesh: &Mesh, p: &Particles, seed: u64) -> Result<(), TestCaseError> {
    let mut s = seed ^ 0xabcd;
    let n = mesh.len();
    let fluid = Fluid {
        velocity: vectors(n, 3.0, &mut s),
        pressure_gradient: vectors(n, 100.0, &mut s),
        stress_divergence: vectors(n, 10.0, &mut s),
    };
    let (model_b, pick) = (random(&mut s) < 0.5, (3.0 * random(&mut s)) as usize);
    let how = [FluidVelocity::Gather, FluidVelocity::HostCell, FluidVelocity::Linear][pick];
    // a mapping and a smoother by chance, every scheme: a thousand cases meet all pairs
    let one_of = |n: usize, s: &mut u64| (n as f64 * random(s)) as usize;
    let mapping = map::all()[one_of(map::all().len(), &mut s)].name();
    let smoother = &smooth::NAMES[one_of(smooth::NAMES.len(), &mut s)];
    for scheme in scheme::all() {
        let mut mapping = map::by_name(mapping, mesh).unwrap();
        mapping.prepare(mesh, &OPTIONS);
        let t = Diffusion::uniform(BANDWIDTH).links(mesh);
        let make = |name| smooth::by_name(name, mesh, &t, 1e-3).unwrap();
        let exact = mapping.conservative() && make(smoother).properties().conservative;
        let name = format!("{} / {smoother} / {}", mapping.name(), scheme.name());
        let again = if *smoother == "none" { "none" } else { "uniformization" };
        let setup = setup(*scheme, how, model_b);
        let mut step = CouplingStep::new(mesh.clone(), setup, mapping, make(smoother), make(again));
        let mut p = p.clone();
        for first in [true, false] {
            step.before_fluid(&mut p, first).map_err(|e| TestCaseError::fail(format!("{name}: {e}")))?;
            step.after_fluid(&p, &fluid, first).map_err(|e| TestCaseError::fail(format!("{name}: {e}")))?;
        }
        let f = step.facts;
        if exact {
            prop_assert!(f.solid_volume_error < 1e-12, "{name}: volume {:e}", f.solid_volume_error);
            prop_assert!(f.solid_momentum_error < 1e-12, "{name}: momentum {:e}", f.solid_momentum_error);
        }
        step.books.reaction = reaction(&step, &fluid, !model_b);
        let error = step.books.error(None);
        if exact && scheme.conservative() {
            // the fluid's terms may cancel to little action; their own rounding is no error of the scheme
            let rounding = 4.0 * f64::EPSILON * terms(&step, &fluid, !model_b);
            let gap = error * step.books.scale;
            prop_assert!(
                gap <= 1e-12 * step.books.scale + rounding,
                "{name}: action - reaction {gap:e} N s, of action {error:e}, rounding {rounding:e}"
            );
        }
        prop_assert!(step.sources.sp.iter().all(|x| *x >= 0.0), "{name}: a negative Sp");
        prop_assert!(step.sources.voidage.iter().all(|e| *e > 0.0 && *e <= 1.0), "{name}: voidage");
        let finite = |v: &V| v.iter().all(|x| x.is_finite());
        prop_assert!(step.sources.su.iter().all(finite) && step.drive.velocity.iter().all(finite));
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 150, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn solids_momentum_and_third_law_close(mesh in meshes(), n in 0usize..40, seed in any::<u64>()) {
        let p = particles(&mesh, n, seed);
        exchange(&mesh, &p, seed)?;
    }

    #[test]
    fn smoothers_conserve_keep_constants_and_are_self_adjoint(
        mesh in meshes(), b in 1e-3..0.08f64, tolerance in 1e-10..1e-2f64, seed in any::<u64>()
    ) {
        let (n, whole, mut s) = (mesh.len(), Active::whole(mesh.len()), seed);
        let t = Diffusion::uniform(b).links(&mesh);
        for name in smooth::NAMES {
            let mut g = smooth::by_name(name, &mesh, &t, tolerance).unwrap();
            if !g.properties().conservative {
                continue;
            }
            // one sign and both, constants, a single cell
            let field: Vec<[f64; 8]> = (0..n)
                .map(|c| {
                    let r = [0; 4].map(|_: i32| random(&mut s));
                    let one = if c == n / 2 { 1.0 } else { 0.0 };
                    [r[0], r[1] - 0.5, 3.7, one, r[2], r[3] - 0.5, 0.0, 1.0]
                })
                .collect();
            let mut out = field.clone();
            g.apply(&mut out, &whole, Direction::Spread, &mut Scratch::default());
            let product = |a: &[[f64; 8]], i: usize, b: &[[f64; 8]], j: usize| {
                let terms = || (0..n).map(|c| mesh.volume[c] * a[c][i] * b[c][j]);
                (sum(terms()), sum(terms().map(f64::abs)))
            };
            for l in 0..8 {
                let ((before, scale), (after, _)) = (product(&field, l, &field, 7), product(&out, l, &field, 7));
                prop_assert!((after - before).abs() <= 1e-12 * scale, "{name}: lane {l} {before} {after}");
            }
            for (i, j) in [(0, 1), (1, 5), (3, 4)] {
                let ((a, scale), (b, _)) = (product(&out, i, &field, j), product(&field, i, &out, j));
                prop_assert!((a - b).abs() <= 1e-12 * scale.max(a.abs()), "{name}: <Gf,g> {a} <f,Gg> {b}");
            }
            prop_assert!(out.iter().all(|l| (l[2] / 3.7 - 1.0).abs() <= 1e-12), "{name}: constants");
            if ["uniformization", "forward-euler", "none"].contains(name) {
                prop_assert!(out.iter().all(|l| l[0] >= 0.0 && l[3] >= 0.0 && l[6] == 0.0), "{name}: positivity");
            }
        }
    }

    #[test]
    fn weights_add_up_and_a_uniform_fluid_is_gathered_as_it_is(
        mesh in meshes(), n in 1usize..40, seed in any::<u64>()
    ) {
        let mut p = particles(&mesh, n, seed);
        let mut host = vec![u32::MAX; n];
        locate::Locator::new(&mesh).locate(&mesh, &mut p.position, &mut host).unwrap();
        let mut order = Order::default();
        let list = order.update(mesh.len(), &p.id, &host);
        p.arrange(list, &mut Spare::default(), |_| {});
        host = list.iter().map(|i| host[*i as usize]).collect();
        for mapping in map::all().iter_mut().filter(|m| m.conservative()) {
            let mut w = Weights::default();
            mapping.prepare(&mesh, &OPTIONS);
            mapping.weights(&mesh, &p.position, &p.radius, &host, &mut w);
            let mut lanes = vec![[0.0; 8]; mesh.len()];
            w.deposit(&mesh, &order, &mut lanes, |i, _: &mut ()| [p.volume(i), 1.0, p.velocity[i][0], 0.0, 0.0, 0.0, 0.0, 0.0]);
            let total = |l: usize| sum(lanes.iter().zip(&mesh.volume).map(|(x, v)| x[l] * v));
            let volume = sum((0..n).map(|i| p.volume(i)));
            prop_assert!((total(0) / volume - 1.0).abs() < 1e-12 && (total(1) / n as f64 - 1.0).abs() < 1e-12);
            let scale = sum(p.velocity.iter().map(|v| norm(*v)));
            prop_assert!((total(2) - sum(p.velocity.iter().map(|v| v[0]))).abs() <= 1e-12 * scale);
            let uniform = vec![[2.5; 8]; mesh.len()];
            let mut read = vec![[0.0; 8]; n];
            w.gather(&uniform, 0, &mut read);
            let exact = read.iter().all(|l| (l[0] / 2.5 - 1.0).abs() < 1e-12);
            prop_assert!(exact, "{}: weights do not add up", mapping.name());
            // deposit and gather are adjoint
            let field: Vec<[f64; 8]> = (0..mesh.len()).map(|j| [1.0 + (j as f64).sin(); 8]).collect();
            w.gather(&field, 0, &mut read);
            let cells = sum((0..mesh.len()).map(|j| mesh.volume[j] * lanes[j][0] * field[j][0]));
            let particles = sum((0..n).map(|i| p.volume(i) * read[i][0]));
            prop_assert!((cells / particles - 1.0).abs() < 1e-12, "{}: {cells:e} {particles:e}", mapping.name());
        }
    }
}
