// SPDX-License-Identifier: MIT OR Apache-2.0
//! Models of the step beyond drag and one bandwidth: size classes, mean in time, parcels by type, history, torque, added
//! mass by particle. Third law, bits, and the numbers they are to give.

mod common;

use common::{Hex, P, cloud, message, random};
use voidage::arrange::Places;
use voidage::forces::history::{History, Memory, coefficient};
use voidage::forces::{self, Extra, parcel::felderhof};
use voidage::interpolate::FluidVelocity;
use voidage::map::{Linear, Mapping, Options, ParticleCentroid};
use voidage::mesh::{Mesh, assemble};
use voidage::particles::{Asked, Particles};
use voidage::smooth::{Classes, Diffusion, TimeAverage, pair};
use voidage::step::{CouplingStep, Fluid, Setup, Sources};
use voidage::sums::sum;
use voidage_wire::{Block, Frame, field, frame, kind};

const SIZE: [f64; 3] = [0.06, 0.04, 0.05];
const PERIOD: f64 = 1e-3;
const LIST: [[f64; 2]; 2] = [[5e-4, 0.006], [8e-4, 0.012]];

fn meshes() -> Vec<Hex> {
    let hex = |jiggle, cyclic_x| Hex { n: [6, 5, 7], size: SIZE, jiggle, cyclic_x };
    vec![hex(0.0, false), hex(0.3, true)]
}

/// Three sizes.
fn mixed(n: usize) -> Vec<P> {
    let mut all = cloud(n, SIZE, 4e-4);
    all.iter_mut().for_each(|p| p.r = [2e-4, 4e-4, 5e-4][p.id as usize / 3 % 3]);
    all
}

fn setup(model_b: bool, extra: Extra) -> Setup {
    let like = common::step::setup("conservative", FluidVelocity::Linear, model_b);
    Setup { period: PERIOD, extra, ..like }
}

fn fluid(mesh: &Mesh) -> Fluid {
    let wave =
        |k: f64| mesh.centre.iter().map(|c| [0, 1, 2].map(|a| (k * c[a] * 90.0 + a as f64).sin())).collect();
    Fluid { velocity: wave(1.0), pressure_gradient: wave(2.0), stress_divergence: wave(3.0) }
}

/// What a run is made of.
struct Case<'a> {
    hex: &'a Hex,
    cut: bool,
    list: &'a [[f64; 2]],
    linear: bool,
}

impl Case<'_> {
    fn step(&self, setup: Setup) -> CouplingStep {
        let hex = self.hex;
        let pieces = if self.cut { hex.pieces(2, |c| usize::from(c[0] >= 3)) } else { hex.whole() };
        let mesh = assemble(&pieces).unwrap();
        let classes = Classes::new(&mesh, self.list, 0.02);
        let t = classes.links(&mesh, &Diffusion::default());
        let [g, positive] = pair("chebyshev", &classes.mesh(&mesh), &t, 1e-4).unwrap();
        let mut mapping: Box<dyn Mapping> =
            if self.linear { Box::<Linear>::default() } else { Box::new(ParticleCentroid) };
        mapping.prepare(&mesh, &Options::default());
        CouplingStep::new(mesh, setup, mapping, g, positive).with_classes(classes)
    }
}

/// The table of these messages; `asked` fills in what forces ask for.
fn table(messages: &[Vec<u64>], step: &CouplingStep, asked: &dyn Fn(&Particles) -> Asked) -> Particles {
    let frames: Vec<Frame> = messages.iter().map(|m| Frame::parse(m).unwrap()).collect();
    let mut p = Particles::receive(&frames, step.places()).unwrap();
    p.asked = asked(&p);
    p
}

/// Action–reaction error of the exchange, the fluid's side from the arrays it is given and its own fields.
fn error(step: &mut CouplingStep, f: &Fluid, model_a: bool) -> f64 {
    let (s, m) = (&step.sources, &step.mesh);
    step.books.reaction = [0, 1, 2].map(|a| {
        sum((0..m.len()).map(|j| {
            let pressure = if model_a { f.pressure_gradient[j][a] - f.stress_divergence[j][a] } else { 0.0 };
            -PERIOD
                * m.volume[j]
                * (s.su[j][a] - s.sp[j] * f.velocity[j][a] + (1.0 - s.voidage[j]) * pressure)
        }))
    });
    step.books.error(None)
}

/// All of the drive by id, as bits.
fn bits(step: &CouplingStep, p: &Particles) -> Vec<(i64, Vec<u64>)> {
    let d = &step.drive;
    let mut all: Vec<_> = (0..p.len())
        .map(|i| {
            let mut list = vec![d.drag_coefficient[i]];
            [&d.velocity, &d.force, &d.charged].iter().for_each(|v| list.extend(v[i]));
            list.extend(d.added_mass.get(i));
            list.extend(d.rotation_coefficient.get(i));
            list.extend(d.rotation_rate.get(i).into_iter().flatten());
            list.extend(d.memory.get(i).map(|m| m.0).into_iter().flatten());
            (p.id[i], list.iter().map(|x| x.to_bits()).collect())
        })
        .collect();
    all.sort_unstable_by_key(|d: &(i64, _)| d.0);
    all
}

type Reply = (Sources, Vec<(i64, Vec<u64>)>, f64);

/// Two exchanges.
fn exchange(case: &Case, messages: &[Vec<u64>], setup: Setup, asked: &dyn Fn(&Particles) -> Asked) -> Reply {
    let model_a = !setup.model_b;
    let mut step = case.step(setup);
    let f = fluid(&step.mesh);
    let mut p = table(messages, &step, asked);
    step.before_fluid(&mut p, true).unwrap();
    step.after_fluid(&p, &f, true).unwrap();
    step.before_fluid(&mut p, false).unwrap();
    step.after_fluid(&p, &f, false).unwrap();
    assert!(step.facts.solid_volume_error < 1e-13 && step.facts.solid_momentum_error < 1e-13);
    let e = error(&mut step, &f, model_a);
    (step.sources.clone(), bits(&step, &p), e)
}

fn nothing(_: &Particles) -> Asked {
    Asked::default()
}

#[test]
fn size_classes_conserve_and_keep_the_third_law() {
    let messages = [message(&mixed(3000))];
    for hex in &meshes() {
        for linear in [false, true] {
            let of = |list: &[[f64; 2]], model_b| {
                let case = Case { hex, cut: false, list, linear };
                exchange(&case, &messages, setup(model_b, Extra::default()), &nothing)
            };
            let one = of(&[], false);
            for model_b in [false, true] {
                let three = of(&LIST, model_b);
                assert!(three.2 < 1e-12, "{linear} {model_b}: {:e}", three.2);
                assert!(three.0.sp.iter().all(|x| *x >= 0.0));
                assert!(three.0.voidage.iter().all(|e| *e > 0.0 && *e <= 1.0));
            }
            let far = |a: &Sources, b: &Sources| {
                a.voidage.iter().zip(&b.voidage).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
            };
            let three = of(&LIST, false);
            assert!(far(&three.0, &one.0) > 1e-4, "the classes do something: {:e}", far(&three.0, &one.0));
            // classes of the same bandwidth are one
            let same = of(&[[5e-4, 0.02], [8e-4, 0.02]], false);
            assert!(far(&same.0, &one.0) < 1e-13, "{:e}", far(&same.0, &one.0));
        }
    }
}

#[test]
fn a_particle_reads_the_voidage_of_all_classes() {
    // a large one in a crowd of small ones: its drag is that of the crowd
    let hex = &meshes()[0];
    let mut all = cloud(4000, SIZE, 2e-4);
    all[17].r = 5e-4;
    let k = |list: &[[f64; 2]]| {
        let case = Case { hex, cut: false, list, linear: false };
        let mut step = case.step(setup(false, Extra::default()));
        let f = fluid(&step.mesh);
        let mut p = table(&[message(&all)], &step, &nothing);
        step.before_fluid(&mut p, true).unwrap();
        step.after_fluid(&p, &f, true).unwrap();
        let at = p.id.iter().position(|i| *i == all[17].id).unwrap();
        let host = (0..step.mesh.len()).min_by(|a, b| {
            let d =
                |j: usize| (0..3).map(|x| (step.mesh.centre[j][x] - p.position[at][x]).powi(2)).sum::<f64>();
            d(*a).total_cmp(&d(*b))
        });
        (step.drive.drag_coefficient[at], 1.0 - step.sources.voidage[host.unwrap()])
    };
    // the crowd is smoothed alike in both
    let (alone, together) = (k(&[[5e-4, 0.02]]), k(&[]));
    assert!((alone.0 / together.0 - 1.0).abs() < 1e-9 && alone.1 > 1e-3, "{alone:?} {together:?}");
}

#[test]
fn replies_are_bit_identical_for_any_ranks_and_order_with_all_models() {
    let extra = || Extra {
        ratio_by_type: vec![f64::NAN, 1.0, 2.0],
        lift: Some(forces::lift::all()[1]),
        felderhof: true,
        history: true,
        torque: true,
        ..Extra::default()
    };
    let asked = |p: &Particles| Asked {
        kind: p.id.iter().map(|i| 1 + i % 2).collect(),
        spin: p.id.iter().map(|i| [*i as f64, 1.0, -3.0]).collect(),
        memory: p
            .id
            .iter()
            .map(|i| Memory(std::array::from_fn(|k| ((i + k as i64) % 7) as f64 * 1e-3)))
            .collect(),
    };
    for hex in &meshes() {
        let all = mixed(2000);
        let mut shuffled = all.clone();
        let mut seed = 17;
        for i in (1..shuffled.len()).rev() {
            shuffled.swap(i, (random(&mut seed) * (i + 1) as f64) as usize);
        }
        let (left, right): (Vec<P>, Vec<P>) = shuffled.iter().partition(|p| p.x[2] < 0.02);
        let of = |cut, messages: &[Vec<u64>]| {
            let case = Case { hex, cut, list: &LIST, linear: true };
            let average = TimeAverage::new(PERIOD, 0.01);
            exchange(&case, messages, Setup { average, ..setup(true, extra()) }, &asked)
        };
        let one = of(false, &[message(&all)]);
        let two = of(false, &[message(&left), message(&right)]);
        let cut = of(true, &[message(&right), message(&[]), message(&left)]);
        assert!(one.0 == two.0 && one.1 == two.1, "DEM ranks and order");
        assert!(one.0 == cut.0 && one.1 == cut.1, "CFD ranks");
        assert!(one.2 < 1e-12, "{:e}", one.2);
        let pool = rayon::ThreadPoolBuilder::new().num_threads(4).build().unwrap();
        let threads = pool.install(|| of(false, &[message(&all)]));
        assert!(one.0 == threads.0 && one.1 == threads.1, "threads");
    }
}

#[test]
fn the_mean_in_time_follows_its_recurrence_and_its_price_is_measured() {
    let hex = &meshes()[0];
    for model_b in [false, true] {
        let case = Case { hex, cut: false, list: &LIST, linear: false };
        let average = TimeAverage::new(PERIOD, 4e-3);
        let mut mean = case.step(Setup { average, ..setup(model_b, Extra::default()) });
        let f = fluid(&mean.mesh);
        let mut last: Option<Vec<f64>> = None;
        for (k, shift) in [0.0, 0.02, 0.04, 0.04].into_iter().enumerate() {
            // a cloud in the left third that moves away: cells it has left keep a part of it
            let mut all = mixed(1500);
            all.iter_mut().for_each(|p| p.x[0] = 0.3 * p.x[0] + shift);
            let messages = [message(&all)];
            let mut now = case.step(setup(model_b, Extra::default()));
            let mut p = table(&messages, &now, &nothing);
            now.before_fluid(&mut p, true).unwrap();
            let mut p = table(&messages, &mean, &nothing);
            mean.before_fluid(&mut p, k == 0).unwrap();
            mean.after_fluid(&p, &f, k == 0).unwrap();
            let solid = |s: &Sources| s.voidage.iter().map(|e| 1.0 - e).collect::<Vec<_>>();
            let (got, of_now) = (solid(&mean.sources), solid(&now.sources));
            if let Some(last) = last {
                // α = 1/(1 + ¼)
                let gap = (0..got.len()).map(|j| (got[j] - (0.2 * of_now[j] + 0.8 * last[j])).abs());
                assert!(gap.fold(0.0, f64::max) < 1e-14);
                assert!(got.iter().zip(&of_now).any(|(g, n)| *g > 2.0 * n && *g > 1e-4), "what it left");
                let e = error(&mut mean, &f, !model_b);
                assert_eq!(e < 1e-12, model_b, "third law, model B {model_b}: {e:e}");
            }
            last = Some(got);
        }
        // all of it is there, somewhere else than now
        assert!(mean.facts.solid_volume_error < 1e-12, "{:e}", mean.facts.solid_volume_error);
    }
}

#[test]
fn parcels_by_type_are_those_of_one_ratio_and_a_missing_type_is_named() {
    let hex = &meshes()[0];
    let messages = [message(&mixed(2000))];
    let case = Case { hex, cut: false, list: &[], linear: false };
    let kinds = |f: fn(i64) -> i64| {
        move |p: &Particles| Asked { kind: p.id.iter().map(|i| f(*i)).collect(), ..Asked::default() }
    };
    for drag in ["koch-hill", "beetstra-polydisperse", "cello"] {
        let with = |extra| Setup { drag: forces::by_name(drag).unwrap(), ..setup(false, extra) };
        let by = |list: &[f64]| Extra { ratio_by_type: list.to_vec(), ..Extra::default() };
        let all = exchange(&case, &messages, with(Extra { ratio: 2.0, ..Extra::default() }), &nothing);
        let typed = exchange(&case, &messages, with(by(&[f64::NAN, 2.0])), &kinds(|_| 1));
        assert!(all.0 == typed.0 && all.1 == typed.1, "{drag}");
        let two = exchange(&case, &messages, with(by(&[f64::NAN, 2.0, 1.0])), &kinds(|i| 1 + i % 2));
        let plain = exchange(&case, &messages, with(Extra::default()), &nothing);
        assert!(two.2 < 1e-12, "{:e}", two.2);
        if drag == "koch-hill" {
            for ((a, b), c) in two.1.iter().zip(&all.1).zip(&plain.1) {
                // K by its own type's ratio
                let k = |x: &(i64, Vec<u64>)| f64::from_bits(x.1[0]);
                let expected = if a.0 % 2 == 0 { k(b) } else { k(c) };
                assert!((k(a) / expected - 1.0).abs() < 1e-12);
            }
        }
    }
    let mut step = case.step(setup(false, Extra { ratio_by_type: vec![f64::NAN, 2.0], ..Extra::default() }));
    let mut p = table(&messages, &step, &kinds(|i| if i == 32 { 7 } else { 1 }));
    let e = step.before_fluid(&mut p, true).unwrap_err().to_string();
    assert!(e.contains("particle 32 is of type 7") && e.contains("`7 = 1.0`"), "{e}");
    let mut p = table(&messages, &step, &nothing);
    let e = step.before_fluid(&mut p, true).unwrap_err().to_string();
    assert!(e.contains("dem.coarse_graining needs the particles' types"), "{e}");
}

/// In a box of one cell what is around a particle is everything: Cello's law from sums over all particles, by two ways of adding.
#[test]
fn the_law_of_cello_sees_the_diameters_around() {
    let hex = Hex { n: [1; 3], size: SIZE, jiggle: 0.0, cyclic_x: false };
    let messages = [message(&mixed(2000))];
    let law = forces::by_name("cello").unwrap();
    for (ratio, list) in [(1.0, &[][..]), (2.0, &[]), (1.0, &LIST)] {
        let case = Case { hex: &hex, cut: false, list, linear: false };
        let extra = Extra { ratio, ..Extra::default() };
        let like = setup(false, extra);
        let fluid_constants = [like.kinematic_viscosity, like.density];
        let mut step = case.step(Setup { drag: law, fluid_velocity: FluidVelocity::HostCell, ..like });
        let f = fluid(&step.mesh);
        let mut p = table(&messages, &step, &nothing);
        step.before_fluid(&mut p, true).unwrap();
        step.after_fluid(&p, &f, true).unwrap();
        let diameter = |i: usize| 2.0 * p.radius[i] / ratio;
        let moment = |k: i32| sum((0..p.len()).map(|i| p.volume(i) * diameter(i).powi(k)));
        let voidage = 1.0 - moment(0) / step.mesh.volume[0];
        let around = forces::Around {
            sauter_diameter: moment(0) / moment(-1),
            mean_diameter: moment(1) / moment(0),
            cell_volume: step.mesh.volume[0],
        };
        assert!(around.mean_diameter > 1.03 * around.sauter_diameter);
        for i in 0..p.len() {
            let u = [0, 1, 2].map(|a| f.velocity[0][a] - p.velocity[i][a]);
            let speed = u.iter().map(|u| u * u).sum::<f64>().sqrt();
            let [kinematic_viscosity, density] = fluid_constants;
            let slip = forces::Slip { diameter: diameter(i), voidage, speed, kinematic_viscosity, density };
            let k = law.drag_coefficient_in(&slip, &around) * ratio.powi(3);
            assert!((step.drive.drag_coefficient[i] / k - 1.0).abs() < 1e-9, "{i}: {k}");
        }
    }
}

#[test]
fn history_travels_with_the_particle_and_closes_the_third_law() {
    let hex = &meshes()[1];
    let case = Case { hex, cut: false, list: &[], linear: false };
    let extra = || Extra { history: true, ..Extra::default() };
    let (mut step, mut bare) = (case.step(setup(false, extra())), case.step(setup(false, Extra::default())));
    let f = fluid(&step.mesh);
    let mut kept: std::collections::BTreeMap<i64, Memory> = Default::default();
    let mut own: std::collections::BTreeMap<i64, History> = Default::default();
    let mut all = cloud(500, SIZE, 4e-4);
    for k in 0..4 {
        // particles come in and go out of the mesh's order, one is inserted later
        all.iter_mut().for_each(|p| p.v = p.v.map(|v| 0.7 * v + 0.1));
        if k == 2 {
            all.push(P { id: 4, ..all[3] });
        }
        let messages = [message(&all)];
        let memory = |p: &Particles| Asked {
            memory: p.id.iter().map(|i| kept.get(i).copied().unwrap_or_default()).collect(),
            ..Asked::default()
        };
        let mut p = table(&messages, &step, &memory);
        let mut q = table(&messages, &bare, &nothing);
        for (s, t) in [(&mut step, &mut p), (&mut bare, &mut q)] {
            s.before_fluid(t, k == 0).unwrap();
            s.after_fluid(t, &f, k == 0).unwrap();
        }
        let e = error(&mut step, &f, true);
        assert!(k == 0 || e < 1e-12, "{e:e}");
        assert_eq!(p.id, q.id);
        let mut changed = 0;
        for i in 0..p.len() {
            assert_eq!(step.drive.memory[i].0[0], 1.0, "seen");
            // slip as the force takes it: what the memory now holds
            let slip = [1, 2, 3].map(|a| step.drive.memory[i].0[a]);
            let integral = own.entry(p.id[i]).or_default().advance(slip, PERIOD);
            for a in 0..3 {
                let expected = coefficient(2.0 * p.radius[i], 1.2, 1.5e-5) * integral[a];
                let got = step.drive.force[i][a] - bare.drive.force[i][a];
                assert!((got - expected).abs() <= 1e-9 * expected.abs() + 1e-22, "{k} {got:e} {expected:e}");
                changed += usize::from(expected != 0.0);
            }
            kept.insert(p.id[i], step.drive.memory[i]);
        }
        assert_eq!(changed > 1000, k > 0);
    }
}

#[test]
fn added_mass_by_felderhof_goes_with_the_crowd() {
    let hex = &meshes()[0];
    let case = Case { hex, cut: false, list: &LIST, linear: false };
    let mut step = case.step(setup(false, Extra { felderhof: true, ..Extra::default() }));
    let f = fluid(&step.mesh);
    let messages = [message(&mixed(3000))];
    let mut p = table(&messages, &step, &nothing);
    step.before_fluid(&mut p, true).unwrap();
    step.after_fluid(&p, &f, true).unwrap();
    step.before_fluid(&mut p, false).unwrap();
    step.after_fluid(&p, &f, false).unwrap();
    assert!(error(&mut step, &f, true) < 1e-12);
    let solid: Vec<f64> = step.sources.voidage.iter().map(|e| 1.0 - e).collect();
    let (low, high) = solid.iter().fold((1.0f64, 0.0f64), |(a, b), s| (a.min(*s), b.max(*s)));
    let mut seen = (f64::MAX, 0.0f64);
    for i in 0..p.len() {
        let c = step.drive.added_mass[i] / (1.2 * p.volume(i));
        // ρ_p/ρ_f = 1000/1.2; the coefficient grows with φ here
        let of = |phi| felderhof(phi, 1000.0 / 1.2);
        assert!(c >= of(low) - 1e-12 && c <= of(high) + 1e-12, "{c}");
        seen = (seen.0.min(c), seen.1.max(c));
    }
    assert!(seen.1 - seen.0 > 1e-4, "{seen:?}");
}

#[test]
fn torque_turns_particles_with_the_fluid() {
    let w = [3.0, -20.0, 7.0];
    let cross = |a: [f64; 3], b: [f64; 3]| {
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    };
    let hex = &meshes()[0];
    let case = Case { hex, cut: false, list: &[], linear: false };
    let asked = |p: &Particles| Asked {
        spin: p.id.iter().map(|i| if i % 2 == 0 { w } else { [0.0, 1e4, 0.0] }).collect(),
        kind: vec![2; p.len()],
        ..Asked::default()
    };
    for (ratio, factor) in [(1.0, 1.0), (2.0, 1.0 / 8.0 * 32.0)] {
        let extra =
            Extra { torque: true, ratio_by_type: vec![f64::NAN, f64::NAN, ratio], ..Extra::default() };
        let mut step = case.step(setup(false, extra));
        let velocity: Vec<[f64; 3]> = step.mesh.centre.iter().map(|x| cross(w, *x)).collect();
        let f = Fluid { velocity, ..fluid(&step.mesh) };
        let mut p = table(&[message(&cloud(300, SIZE, 4e-4))], &step, &asked);
        step.before_fluid(&mut p, true).unwrap();
        step.after_fluid(&p, &f, true).unwrap();
        let d = &step.drive;
        // 8 π μ r³ at rest in the rotating fluid; more where the spin is fast
        let kirchhoff = 8.0 * std::f64::consts::PI * 1.2 * 1.5e-5 * 4e-4f64.powi(3) * factor;
        for i in 0..p.len() {
            let gap = (0..3).map(|a| (d.rotation_rate[i][a] - w[a]).abs()).fold(0.0, f64::max);
            assert!(gap < 1e-9, "{:?}", d.rotation_rate[i]);
            let k = d.rotation_coefficient[i] / kirchhoff;
            // d² Ω/ν = 427 of the parcel: the primary's is 1/ratio² of it
            let re = 427.0 / (ratio * ratio);
            let fast = (12.9 * f64::sqrt(re) + 128.4) / (64.0 * std::f64::consts::PI);
            let expected = if p.id[i] % 2 == 0 { 1.0 } else { fast };
            assert!((k / expected - 1.0).abs() < 2e-3, "{k} {expected}");
        }
    }
}

#[test]
fn what_forces_ask_for_comes_through_the_wire() {
    let plain = message(&cloud(3, SIZE, 4e-4));
    let frame_ = Frame::parse(&plain).unwrap();
    let n = 3;
    let mut blocks =
        vec![Block::i64s(field::ID, n), Block::f64s(field::TOTALS, 9), Block::i64s(field::TYPE, n)];
    let vectors = [field::POSITION, field::VELOCITY, field::LEDGER, field::ANGULAR_VELOCITY];
    blocks.extend(vectors.map(|f| Block::f64s(f, 3 * n)));
    blocks.extend([field::RADIUS, field::MASS].map(|f| Block::f64s(f, n)));
    blocks.push(Block::f64s(field::LAST_MEMORY, Memory::WIDTH * n));
    let mut words = vec![0; frame::words(&blocks)];
    frame::start(&mut words, kind::PARTICLES, 0, 0.0, &blocks);
    for name in [field::POSITION, field::VELOCITY, field::LEDGER, field::RADIUS, field::MASS] {
        frame::f64s_mut(&mut words, name).unwrap().copy_from_slice(frame_.f64s(name).unwrap());
    }
    frame::array_mut(&mut words, field::ID).unwrap().copy_from_slice(&[30, 10, 20]);
    frame::array_mut(&mut words, field::TYPE).unwrap().copy_from_slice(&[3, 1, 2]);
    frame::f64s_mut(&mut words, field::ANGULAR_VELOCITY).unwrap()[3] = 10.0;
    frame::f64s_mut(&mut words, field::LAST_MEMORY).unwrap()[2 * Memory::WIDTH + 5] = 20.0;
    let p = Particles::receive(&[Frame::parse(&words).unwrap()], &Places::default()).unwrap();
    assert_eq!((p.id.as_slice(), p.asked.kind.as_slice()), (&[10, 20, 30][..], &[1, 2, 3][..]));
    assert_eq!(p.asked.spin[0], [10.0, 0.0, 0.0]);
    assert!(p.asked.memory[1].0[5] == 20.0 && p.asked.memory[0] == Memory::default());
    frame::f64s_mut(&mut words, field::ANGULAR_VELOCITY).unwrap()[0] = f64::NAN;
    let e = Particles::receive(&[Frame::parse(&words).unwrap()], &Places::default()).unwrap_err().to_string();
    assert!(e.contains("particle 30") && e.contains("angular velocity [NaN"), "{e}");
}
