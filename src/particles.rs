// SPDX-License-Identifier: MIT OR Apache-2.0
//! Stage 1, receive: particles of all DEM ranks in one table.
//!
//! Reads PARTICLES frames (SI units); writes one table in which every particle keeps its place of the last
//! exchange (by cell, `arrange`), new ones behind in the order of their ids; brings it into a new order. Does not know
//! the mesh.

use crate::arrange::Places;
use crate::forces::history::Memory;
use crate::mesh::NONE;
use crate::scheme::History;
use crate::{sums, threads};
use std::f64::consts::PI;
use thiserror::Error;
use voidage_wire::{Frame, WireError, field};

/// All particles of one exchange, in the order of the last one when received, in that of this one once located.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Particles {
    /// global id
    pub id: Vec<i64>,
    /// DEM rank and position in its message
    pub origin: Vec<(u32, u32)>,
    /// m
    pub position: Vec<[f64; 3]>,
    /// m/s
    pub velocity: Vec<[f64; 3]>,
    /// m
    pub radius: Vec<f64>,
    /// kg
    pub mass: Vec<f64>,
    /// N s, old ledger L: impulse taken but not yet charged to the fluid
    pub ledger: Vec<[f64; 3]>,
    /// last interval, if the scheme wants it
    pub history: History,
    /// what only some cases ask for
    pub asked: Asked,
    /// N s, sums over all particles, those that vanished since included
    pub totals: Totals,
}

/// What the DEM sends when a force asks for it; empty if not.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Asked {
    /// type
    pub kind: Vec<i64>,
    /// angular velocity, rad/s
    pub spin: Vec<[f64; 3]>,
    /// what a force left with the particle in the last exchange
    pub memory: Vec<Memory>,
}

/// Sums the DEM reports for the last interval, N s.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Totals {
    /// impulse taken from the fluid, J
    pub taken: [f64; 3],
    /// impulse charged to the fluid
    pub charged: [f64; 3],
}

/// Memory `Particles::arrange` copies through.
#[derive(Clone, Debug, Default)]
pub struct Spare {
    ids: Vec<i64>,
    origins: Vec<(u32, u32)>,
    numbers: Vec<f64>,
    vectors: Vec<[f64; 3]>,
}

/// A particle that cannot be coupled.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ParticleError {
    /// A number is wrong.
    #[error("particle {id} (DEM rank {rank}): {what}; the DEM has gone wrong, look at its log and time step")]
    Bad {
        /// particle id
        id: i64,
        /// DEM rank
        rank: usize,
        /// which number
        what: String,
    },
    /// Two particles with one id.
    #[error("particle id {id} came twice, from DEM ranks {first} and {second}: ids must be unique")]
    Duplicate {
        /// particle id
        id: i64,
        /// rank
        first: u32,
        /// rank
        second: u32,
    },
    /// A message is damaged.
    #[error(transparent)]
    Wire(#[from] WireError),
}

impl Particles {
    /// Number of particles.
    pub fn len(&self) -> usize {
        self.id.len()
    }
    /// None at all.
    pub fn is_empty(&self) -> bool {
        self.id.is_empty()
    }
    /// Volume of a particle, m3.
    pub fn volume(&self, i: usize) -> f64 {
        let r = self.radius[i];
        4.0 / 3.0 * PI * r * r * r
    }

    /// Merges the messages of all DEM ranks (in rank order); `last`: where the particles were.
    pub fn receive(frames: &[Frame], last: &Places) -> Result<Self, ParticleError> {
        let ids = frames.iter().map(|f| f.i64s(field::ID)).collect::<Result<Vec<_>, _>>()?;
        let order = in_order(&ids, last)?;
        let vectors = |name: u32| -> Result<Vec<[f64; 3]>, WireError> {
            let parts = frames.iter().zip(&ids).map(|(f, i)| f.vectors_of(name, i.len()));
            Ok(gathered(&parts.collect::<Result<Vec<_>, _>>()?, &order))
        };
        let scalars = |name: u32| -> Result<Vec<f64>, WireError> {
            let parts = frames.iter().zip(&ids).map(|(f, i)| f.f64s_of(name, i.len()));
            Ok(gathered(&parts.collect::<Result<Vec<_>, _>>()?, &order))
        };
        let mut totals = Totals::default();
        for f in frames {
            let t = f.f64s_of(field::TOTALS, 9)?;
            (0..3).for_each(|a| totals.taken[a] += t[a]);
            (0..3).for_each(|a| totals.charged[a] += t[3 + a]);
        }
        let mut history = History::default();
        if History::in_frames(frames) {
            history = History {
                impulse: vectors(field::IMPULSE)?,
                drag_coefficient: scalars(field::LAST_DRAG_COEFFICIENT)?,
                drive: vectors(field::LAST_DRIVE_VELOCITY)?,
                force: vectors(field::LAST_FORCE)?,
                velocity: vectors(field::LAST_VELOCITY)?,
            };
        }
        let mut asked = Asked::default();
        let sent = |name: u32| !frames.is_empty() && frames.iter().all(|f| f.raw(name).is_some());
        if sent(field::TYPE) {
            let parts = frames.iter().map(|f| f.i64s(field::TYPE)).collect::<Result<Vec<_>, _>>()?;
            let of = |o: &(i64, u32, u32)| parts[o.1 as usize].get(o.2 as usize).copied().unwrap_or_default();
            asked.kind = order.iter().map(of).collect();
        }
        if sent(field::ANGULAR_VELOCITY) {
            asked.spin = vectors(field::ANGULAR_VELOCITY)?;
        }
        if sent(field::LAST_MEMORY) {
            let part = |(f, i): (&Frame, &&[i64])| -> Result<Vec<Memory>, WireError> {
                let flat = f.f64s_of(field::LAST_MEMORY, Memory::WIDTH * i.len())?;
                Ok(flat.as_chunks().0.iter().map(|m| Memory(*m)).collect())
            };
            let parts = frames.iter().zip(&ids).map(part).collect::<Result<Vec<_>, _>>()?;
            asked.memory = order.iter().map(|o| parts[o.1 as usize][o.2 as usize]).collect();
        }
        let p = Self {
            history,
            asked,
            position: vectors(field::POSITION)?,
            velocity: vectors(field::VELOCITY)?,
            radius: scalars(field::RADIUS)?,
            mass: scalars(field::MASS)?,
            ledger: vectors(field::LEDGER)?,
            id: order.iter().map(|o| o.0).collect(),
            origin: order.iter().map(|o| (o.1, o.2)).collect(),
            totals,
        };
        p.check()?;
        Ok(p)
    }

    /// Brings the table into the order of `list`, places in it as it is; `told` gets the ids in it, meanwhile.
    pub fn arrange(&mut self, list: &[u32], spare: &mut Spare, told: impl FnOnce(&[i64]) + Send) {
        permute(&mut self.id, list, &mut spare.ids);
        let ids = std::mem::take(&mut self.id);
        threads::both(|| told(&ids), || self.arrange_rest(list, spare));
        self.id = ids;
    }

    fn arrange_rest(&mut self, list: &[u32], spare: &mut Spare) {
        let h = &mut self.history;
        permute(&mut self.origin, list, &mut spare.origins);
        permute(&mut self.asked.kind, list, &mut spare.ids);
        permute(&mut self.asked.spin, list, &mut spare.vectors);
        permute(&mut self.asked.memory, list, &mut Vec::new());
        for array in [&mut self.radius, &mut self.mass, &mut h.drag_coefficient] {
            permute(array, list, &mut spare.numbers);
        }
        for array in [
            &mut self.position,
            &mut self.velocity,
            &mut self.ledger,
            &mut h.impulse,
            &mut h.drive,
            &mut h.force,
            &mut h.velocity,
        ] {
            permute(array, list, &mut spare.vectors);
        }
    }

    fn check(&self) -> Result<(), ParticleError> {
        let vectors = [&self.position, &self.velocity, &self.ledger];
        let positive = |v: &[f64]| v.iter().fold(true, |all, x| all & (*x > 0.0));
        let good = vectors.iter().all(|v| sums::finite(v.as_flattened()))
            && [&self.radius, &self.mass].iter().all(|v| sums::finite(v) && positive(v));
        let asked = !self.asked.spin.is_empty() || !self.asked.memory.is_empty();
        if good && self.history.drag_coefficient.is_empty() && !asked {
            return Ok(());
        }
        let finite = |v: &[f64; 3]| v.iter().all(|x| x.is_finite());
        for i in 0..self.len() {
            let what = match () {
                () if !finite(&self.position[i]) => format!("position {:?}", self.position[i]),
                () if !finite(&self.velocity[i]) => format!("velocity {:?}", self.velocity[i]),
                () if !finite(&self.ledger[i]) => format!("ledger {:?}", self.ledger[i]),
                () if self.asked.spin.get(i).is_some_and(|w| !finite(w)) => {
                    format!("angular velocity {:?}", self.asked.spin[i])
                }
                () if self.asked.memory.get(i).is_some_and(|m| !m.0.iter().all(|x| x.is_finite())) => {
                    "what it remembers of its past is not a finite number".into()
                }
                () if self.history.wrong(i) => "its last interval is not a finite number".into(),
                () if !(self.radius[i] > 0.0 && self.radius[i].is_finite()) => {
                    format!("radius {}", self.radius[i])
                }
                () if !(self.mass[i] > 0.0 && self.mass[i].is_finite()) => format!("mass {}", self.mass[i]),
                () => continue,
            };
            return Err(ParticleError::Bad { id: self.id[i], rank: self.origin[i].0 as usize, what });
        }
        Ok(())
    }
}

/// One array of all messages, in the order of the table.
fn gathered<T: Copy>(parts: &[&[T]], order: &[(i64, u32, u32)]) -> Vec<T> {
    match parts {
        [one] => order.iter().map(|o| one[o.2 as usize]).collect(),
        _ => order.iter().map(|o| parts[o.1 as usize][o.2 as usize]).collect(),
    }
}

/// `array` in the order of `list`; an empty one stays empty.
fn permute<T: Copy + Default + Send + Sync>(array: &mut Vec<T>, list: &[u32], spare: &mut Vec<T>) {
    const PIECE: usize = 8192;
    if array.is_empty() {
        return;
    }
    spare.resize(list.len(), T::default());
    let from = &*array;
    threads::map(list.chunks(PIECE).zip(spare.chunks_mut(PIECE)).collect(), |(list, to)| {
        to.iter_mut().zip(list).for_each(|(t, i)| *t = from[*i as usize]);
    });
    std::mem::swap(array, spare);
}

/// (id, rank, position in its message) of all particles: known ones in their last order, then new ones by id.
fn in_order(ids: &[&[i64]], last: &Places) -> Result<Vec<(i64, u32, u32)>, ParticleError> {
    let twice = |a: &(i64, u32, u32), b: &(i64, u32, u32)| ParticleError::Duplicate {
        id: a.0,
        first: a.1.min(b.1),
        second: a.1.max(b.1),
    };
    let mut order = vec![(0, NONE, 0); last.len()];
    let mut new = Vec::new();
    for (rank, list) in ids.iter().enumerate() {
        for (k, id) in list.iter().enumerate() {
            let particle = (*id, rank as u32, k as u32);
            match order.get_mut(last.of(*id) as usize) {
                Some(place) if place.1 == NONE => *place = particle,
                Some(place) => return Err(twice(place, &particle)),
                None => new.push(particle),
            }
        }
    }
    order.retain(|p| p.1 != NONE);
    if !new.is_sorted() {
        new.sort_unstable();
    }
    if let Some(w) = new.windows(2).find(|w| w[0].0 == w[1].0) {
        return Err(twice(&w[0], &w[1]));
    }
    order.append(&mut new);
    Ok(order)
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use voidage_wire::{Block, frame, kind};

    /// A PARTICLES frame of spheres (id, position), at rest, diameter 1 mm, density 1000 kg/m3.
    pub(crate) fn message(list: &[(i64, [f64; 3])]) -> Vec<u64> {
        let n = list.len();
        let mut blocks = vec![Block::i64s(field::ID, n), Block::f64s(field::TOTALS, 9)];
        blocks.extend([field::POSITION, field::VELOCITY, field::LEDGER].map(|f| Block::f64s(f, 3 * n)));
        blocks.extend([field::RADIUS, field::MASS].map(|f| Block::f64s(f, n)));
        let mut words = vec![0; frame::words(&blocks)];
        frame::start(&mut words, kind::PARTICLES, 0, 0.0, &blocks);
        for (i, (id, x)) in list.iter().enumerate() {
            frame::array_mut(&mut words, field::ID).unwrap()[i] = *id as u64;
            frame::f64s_mut(&mut words, field::POSITION).unwrap()[3 * i..][..3].copy_from_slice(x);
            frame::f64s_mut(&mut words, field::RADIUS).unwrap()[i] = 5e-4;
            frame::f64s_mut(&mut words, field::MASS).unwrap()[i] = 1000.0 * PI / 6.0 * 1e-9;
        }
        words
    }

    #[test]
    fn the_table_does_not_depend_on_ranks_and_order() {
        let all: Vec<_> = (0..50).map(|i| (i * 7 % 50, [i as f64, 0.5, 0.25])).collect();
        let whole = message(&all);
        let first = Places::default();
        let one = Particles::receive(&[Frame::parse(&whole).unwrap()], &first).unwrap();
        let (a, b): (Vec<_>, Vec<_>) = all.iter().rev().partition(|p| p.0 % 3 == 0);
        let (a, b) = (message(&a), message(&b));
        let frames = [Frame::parse(&a).unwrap(), Frame::parse(&b).unwrap()];
        let two = Particles::receive(&frames, &first).unwrap();
        assert!(one.id.is_sorted());
        assert_eq!(Particles { origin: vec![], ..one }, Particles { origin: vec![], ..two });
        // later the places of the last exchange are kept: 2 has gone, 50 is new
        let mut last = Places::default();
        last.update(&[49, 2, 3, 1]);
        let later = message(&[1, 50, 3, 49, 0].map(|id| (id, [0.0; 3])));
        let p = Particles::receive(&[Frame::parse(&later).unwrap()], &last).unwrap();
        assert_eq!(p.id, [49, 3, 1, 0, 50]);
        assert_eq!(p.origin[0], (0, 3));
    }

    #[test]
    fn wrong_particles_are_named() {
        let mut m = message(&[(3, [0.0; 3]), (9, [f64::NAN, 0.0, 0.0])]);
        let e = Particles::receive(&[Frame::parse(&m).unwrap()], &Places::default()).unwrap_err().to_string();
        assert!(e.starts_with("particle 9 (DEM rank 0): position [NaN"), "{e}");
        frame::f64s_mut(&mut m, field::POSITION).unwrap()[3] = 0.0;
        frame::f64s_mut(&mut m, field::RADIUS).unwrap()[0] = -1.0;
        let e = Particles::receive(&[Frame::parse(&m).unwrap()], &Places::default()).unwrap_err().to_string();
        assert!(e.contains("particle 3") && e.contains("radius -1"), "{e}");
        let (a, b) = (message(&[(3, [0.0; 3])]), message(&[(3, [1.0; 3])]));
        let frames = [Frame::parse(&a).unwrap(), Frame::parse(&b).unwrap()];
        let mut last = Places::default();
        for ids in [&[][..], &[3][..]] {
            last.update(ids);
            let e = Particles::receive(&frames, &last).unwrap_err();
            assert!(e.to_string().contains("id 3 came twice, from DEM ranks 0 and 1"));
        }
    }
}
