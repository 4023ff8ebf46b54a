// SPDX-License-Identifier: MIT OR Apache-2.0
//! A fluid and a particle program made for tests, on threads, and a recorded run of the coupler with them in memory.
#![allow(dead_code)]

use super::{Hex, P, cloud, message_with};
use std::path::Path;
use std::time::Duration;
use voidage::config::{self, Compression, Config, foam::Control};
use voidage::couple::{Exchange, Summary, receive_mesh};
use voidage::mesh::{MeshPiece, PatchKind};
use voidage::partners::Partners;
use voidage::record::{Recorded, Recorder, Selection, SessionHead};
use voidage::setup;
use voidage_wire::memory::{self, Memory};
use voidage_wire::transport::send_copy;
use voidage_wire::{
    Block, Frame, Hello, PROTOCOL, Process, Role, Transport, Welcome, field, frame, hello, kind,
};

pub const SIZE: [f64; 3] = [0.02, 0.02, 0.04];
const PERIOD: f64 = 2e-4;

/// A bed of loose particles in air; `extra` lines go to the sections named in them.
pub const CASE: &str = r#"
format = 1
[fluid]
density = 1.2
kinematic_viscosity = 1.5e-5
gravity = [0.0, 0.0, -9.81]
[dem]
script = "particles.in"
time_step = 1e-5
[coupling]
interval = 20
[smooth]
bandwidth = 4e-3
[forces]
drag = "di-felice"
[output]
restarts = 0
"#;

/// The case with overrides.
pub fn case(set: &[(&str, &str)], steps: i64) -> Config {
    let set: Vec<_> = set.iter().map(|(k, v)| ((*k).to_string(), (*v).to_string())).collect();
    let control = Control { start: 0.0, end: steps as f64 * PERIOD, step: PERIOD, adjustable: false };
    config::recorded(CASE, &set, control).unwrap()
}

/// What the coupler wants to be sent.
fn greet(t: &mut Memory, role: Role, rank: u32, size: u32) -> Welcome {
    let time_step = if role == Role::Dem { 1e-5 } else { PERIOD };
    let (token, program, process) = ("test".to_string(), "made".to_string(), Process::own());
    let h = Hello { token, role, rank, size, time_step, step: 0, time: 0.0, program, process };
    send_copy(t, &frame::text_frame(kind::HELLO, 0, &hello::encode(&h))).unwrap();
    let words = next(t);
    hello::decode(Frame::parse(&words).unwrap().bytes(field::TEXT).unwrap()).unwrap()
}

fn next(t: &mut Memory) -> Vec<u64> {
    t.receive(Duration::from_secs(60)).unwrap().expect("the coupler is silent").to_vec()
}

/// Particles driven by K (u − v) + f, explicitly; the ledger is kept as the fix does.
fn dem(mut t: Memory, rank: u32, size: u32, mut list: Vec<P>) {
    let told = greet(&mut t, Role::Dem, rank, size).settings;
    // what the coupler remembers of each particle
    let mut memory = vec![0.0; told["drive.memory"] as usize * list.len()];
    let mut totals = [0.0; 9];
    for k in 0.. {
        let mut words = message_with(&list, &memory);
        words[2] = k as u64;
        frame::f64s_mut(&mut words, field::TOTALS).unwrap().copy_from_slice(&totals);
        send_copy(&mut t, &words).unwrap();
        let words = next(&mut t);
        let f = Frame::parse(&words).unwrap();
        if f.kind() == kind::STOP {
            return;
        }
        let n = list.len();
        if !memory.is_empty() {
            memory = f.f64s_of(field::MEMORY, memory.len()).unwrap().to_vec();
        }
        assert_eq!(f.raw(field::ADDED_MASS).is_some(), told["drive.added_mass"] != 0.0);
        let (c, u) =
            (f.f64s(field::DRAG_COEFFICIENT).unwrap(), f.vectors_of(field::DRIVE_VELOCITY, n).unwrap());
        let (g, q) = (f.vectors_of(field::FORCE, n).unwrap(), f.vectors_of(field::CHARGED, n).unwrap());
        totals = [0.0; 9];
        for (i, p) in list.iter_mut().enumerate() {
            let mass = 1000.0 * 4.0 / 3.0 * std::f64::consts::PI * p.r.powi(3);
            let x = c[i] * PERIOD / mass;
            for a in 0..3 {
                let taken = mass * (u[i][a] - p.v[a]) * (1.0 - (-x).exp()) + PERIOD * g[i][a];
                p.ledger[a] += taken - q[i][a];
                totals[a] += taken;
                totals[3 + a] += q[i][a];
                p.v[a] += taken / mass;
                p.x[a] = (p.x[a] + 0.1 * p.v[a] * PERIOD).clamp(1e-4, SIZE[a] - 1e-4);
            }
        }
    }
}

/// The MESH frame of a piece.
pub fn mesh_frame(p: &MeshPiece) -> Vec<u64> {
    let names: String = p.patches.iter().map(|q| format!("{}\n", q.name)).collect();
    let kinds = [
        PatchKind::Boundary,
        PatchKind::Cyclic,
        PatchKind::Processor,
        PatchKind::ProcessorCyclic,
        PatchKind::Empty,
    ];
    let row = |q: &voidage::mesh::Patch| {
        let kind = kinds.iter().position(|k| *k == q.kind).unwrap();
        [kind, q.start, q.size, q.neighbour_rank, q.neighbour_patch].map(|x| x as i64)
    };
    let table: Vec<i64> = p.patches.iter().flat_map(row).collect();
    let shift: Vec<f64> = p.patches.iter().flat_map(|q| q.separation).collect();
    let points: Vec<f64> = p.points.iter().flatten().copied().collect();
    let wide = |v: &[u32]| v.iter().map(|x| i64::from(*x)).collect::<Vec<_>>();
    let integers = [
        (field::FACE_STARTS, wide(&p.face_starts)),
        (field::FACE_POINTS, wide(&p.face_points)),
        (field::OWNER, wide(&p.owner)),
        (field::NEIGHBOUR, wide(&p.neighbour)),
        (field::CELL_IDS, p.cell_ids.clone()),
        (field::PATCHES, table),
    ];
    let floats = [(field::POINTS, points), (field::PATCH_SEPARATIONS, shift)];
    let mut blocks: Vec<Block> = integers.iter().map(|a| Block::i64s(a.0, a.1.len())).collect();
    blocks.extend(floats.iter().map(|a| Block::f64s(a.0, a.1.len())));
    blocks.push(Block::bytes(field::PATCH_NAMES, names.len()));
    let mut words = vec![0; frame::words(&blocks)];
    frame::start(&mut words, kind::MESH, 0, 0.0, &blocks);
    for (name, values) in &integers {
        let to = frame::array_mut(&mut words, *name).unwrap();
        to.iter_mut().zip(values).for_each(|(t, v)| *t = *v as u64);
    }
    for (name, values) in &floats {
        frame::f64s_mut(&mut words, *name).unwrap().copy_from_slice(values);
    }
    let to = bytemuck::cast_slice_mut::<u64, u8>(frame::array_mut(&mut words, field::PATCH_NAMES).unwrap());
    to[..names.len()].copy_from_slice(names.as_bytes());
    words
}

/// A "fluid" whose velocity relaxes by Sp and Su in each cell; gradients are made up from the cell's number.
fn cfd(mut t: Memory, rank: u32, size: u32, piece: MeshPiece, steps: i64) {
    greet(&mut t, Role::Cfd, rank, size);
    send_copy(&mut t, &mesh_frame(&piece)).unwrap();
    let ids = piece.cell_ids.clone();
    let n = ids.len();
    let mut u: Vec<[f64; 3]> =
        ids.iter().map(|i| [0.1 * (*i as f64).sin(), 0.02 * (*i as f64 * 0.7).cos(), 0.9]).collect();
    let fields = |t: &mut Memory, k: i64, u: &[[f64; 3]]| {
        let vectors = [field::FLUID_VELOCITY, field::PRESSURE_GRADIENT, field::STRESS_DIVERGENCE];
        let mut blocks: Vec<Block> = vectors.map(|f| Block::f64s(f, 3 * n)).to_vec();
        blocks.extend([Block::f64s(field::FLAGS, 2), Block::f64s(field::REACTION, 3)]);
        let mut words = vec![0; frame::words(&blocks)];
        frame::start(&mut words, kind::FIELDS, k, 0.0, &blocks);
        frame::f64s_mut(&mut words, vectors[0]).unwrap().copy_from_slice(bytemuck::cast_slice(u));
        for (name, scale) in [(vectors[1], 50.0), (vectors[2], 0.3)] {
            let to = frame::f64s_mut(&mut words, name).unwrap();
            to.chunks_exact_mut(3).zip(&ids).for_each(|(t, i)| t[2] = scale * (*i as f64 * 0.3).sin());
        }
        frame::f64s_mut(&mut words, field::FLAGS).unwrap()[0] = f64::from(u8::from(k == steps));
        send_copy(t, &words).unwrap();
    };
    fields(&mut t, 0, &u);
    for k in 0..=steps {
        let words = next(&mut t);
        let f = Frame::parse(&words).unwrap();
        assert_eq!(f.kind(), kind::SOURCES, "{}", f.text());
        let (sp, su) = (f.f64s_of(field::SP, n).unwrap(), f.vectors_of(field::SU, n).unwrap());
        if k > 0 {
            for (j, u) in u.iter_mut().enumerate() {
                let d = 1.2 / PERIOD + sp[j];
                (0..3).for_each(|a| u[a] = (1.2 / PERIOD * u[a] + su[j][a]) / d);
            }
            fields(&mut t, k, &u);
        }
    }
}

/// A recorded run of `steps` exchanges with 500 particles; cells and particles on as many ranks as told.
pub fn record(file: &Path, c: &Config, steps: i64, ranks: [usize; 2], how: Compression) -> Summary {
    record_in([5, 5, 10], 500, file, c, steps, ranks, how)
}

/// The same with another number of cells and particles.
pub fn record_in(
    cells: [usize; 3],
    particles: usize,
    file: &Path,
    c: &Config,
    steps: i64,
    ranks: [usize; 2],
    how: Compression,
) -> Summary {
    let [dem_ranks, cfd_ranks] = ranks;
    let box_ = Hex { n: cells, size: SIZE, jiggle: 0.2, cyclic_x: true };
    let pieces = box_.pieces(cfd_ranks, |cell| cell[2] * cfd_ranks / cells[2]);
    let all = cloud(particles, SIZE, 4e-4);
    let (mut ends, mut threads) = (Vec::new(), Vec::new());
    for rank in 0..dem_ranks {
        let (partner, end) = memory::pair("DEM", "coupler");
        let own: Vec<P> = all.iter().skip(rank).step_by(dem_ranks).copied().collect();
        ends.push(end);
        threads.push(std::thread::spawn(move || dem(partner, rank as u32, dem_ranks as u32, own)));
    }
    for piece in pieces {
        let (partner, end) = memory::pair("CFD", "coupler");
        ends.push(end);
        threads.push(std::thread::spawn(move || {
            cfd(partner, piece.rank as u32, cfd_ranks as u32, piece, steps)
        }));
    }
    let selection = Selection { steps: steps as u64, ..Selection::of(c) };
    let session = SessionHead {
        program: "test".into(),
        protocol: PROTOCOL,
        token: "test".into(),
        dem_ranks: dem_ranks as u32,
        cfd_ranks: cfd_ranks as u32,
        end: c.control.end,
        period: PERIOD,
        ..SessionHead::default()
    };
    let text = toml::to_string(&c.file).unwrap();
    let recorder = Recorder::create(file, selection, how, session, &text).unwrap();
    let mut number = 0..;
    let mut recorded = |list: Vec<Memory>| {
        list.into_iter().zip(&mut number).map(|(m, i)| Recorded::new(m, i, Some(recorder.clone()))).collect()
    };
    let cfd_ends = ends.split_off(dem_ranks);
    let (dem_ends, cfd_ends) = (recorded(ends), recorded(cfd_ends));
    let mut partners = Partners::new(dem_ends, cfd_ends, Duration::from_secs(60));
    partners.meet("test", Duration::from_secs(60)).unwrap();
    let welcome = setup::welcome(c, None);
    for i in partners.dem().chain(partners.cfd()) {
        partners.welcome(i, &welcome).unwrap();
    }
    let mesh = receive_mesh(&mut partners).unwrap();
    let step = setup::step(c, mesh).unwrap();
    let mut run = Exchange {
        partners,
        step,
        pool: None,
        two_way: true,
        period: PERIOD,
        start: 0.0,
        dem_step: 0,
        interval: 20,
        resume: None,
        sets: None,
        monitor: None,
        recorder: Some(recorder.clone()),
        progress: &mut |_, _| {},
        write: &mut |_| Ok(()),
    };
    let summary = run.run().unwrap();
    threads.into_iter().for_each(|t| t.join().unwrap());
    recorder.finish().unwrap();
    summary
}
