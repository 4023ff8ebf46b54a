// SPDX-License-Identifier: MIT OR Apache-2.0
//! One recorded exchange, decoded: its messages, and from them particles, fluid, sources and drive in one order whatever
//! the ranks were (cells by global id, particles by id).
//!
//! Reads chunks; holds the messages of one exchange at a time. SI units, as in the messages (`docs/wire.md`).

use super::{Chunk, End, Head, Reader, RecordError};
use crate::arrange::Places;
use crate::couple::take_fluid;
use crate::forces::history::Memory;
use crate::mesh::{Mesh, MeshPiece, assemble};
use crate::monitor::Row;
use crate::particles::Particles;
use crate::step::{Drive, Fluid, Sources};
use std::collections::BTreeMap;
use std::io::{Read, Seek};
use voidage_wire::{Frame, WireError, field, hello, kind};

/// Messages of one exchange, by partner and kind.
#[derive(Clone, Debug, Default)]
pub struct Messages {
    /// exchange
    pub k: i64,
    /// fluid time at its end, s
    pub time: f64,
    /// forces in force, where `auto` may switch them
    pub on: Option<u32>,
    list: BTreeMap<(u32, u32), Vec<u64>>,
}

impl Messages {
    /// Of exchange k, none yet.
    pub fn new(k: i64, time: f64) -> Self {
        Self { k, time, on: None, list: BTreeMap::new() }
    }
    /// Adds one.
    pub fn add(&mut self, partner: u32, kind: u32, words: Vec<u64>) {
        self.list.insert((partner, kind), words);
    }
    fn content(&self) -> impl Fn(WireError) -> RecordError {
        let k = self.k;
        move |e| RecordError::Content { k, what: e.to_string() }
    }
    /// Frames of one kind in the order of the partners.
    pub fn frames(&self, kind: u32) -> Result<Vec<Frame<'_>>, RecordError> {
        let of_kind = self.list.iter().filter(|m| m.0.1 == kind);
        of_kind.map(|m| Frame::parse(m.1).map_err(self.content())).collect()
    }
    /// All that belongs to an exchange is there. `drive`: also the reply to the DEM, which the last exchange has not.
    pub fn complete(&self, dem: usize, cfd: usize, drive: bool) -> bool {
        let count = |kind| self.list.keys().filter(|m| m.1 == kind).count();
        count(kind::PARTICLES) == dem
            && count(kind::FIELDS) == cfd
            && count(kind::SOURCES) == cfd
            && (!drive || count(kind::DRIVE) == dem)
    }
    /// Every message of the other is here too.
    pub fn has_all_of(&self, other: &Self) -> bool {
        other.list.keys().all(|m| self.list.contains_key(m))
    }
    /// Particles by id.
    pub fn particles(&self) -> Result<Particles, RecordError> {
        Particles::receive(&self.frames(kind::PARTICLES)?, &Places::default())
            .map_err(|e| RecordError::Content { k: self.k, what: e.to_string() })
    }
    /// The fluid by cell slot.
    pub fn fluid(&self, mesh: &Mesh) -> Result<Fluid, RecordError> {
        let mut fluid = Fluid::default();
        for (frame, slots) in self.frames(kind::FIELDS)?.iter().zip(&mesh.slots) {
            take_fluid(frame, slots, mesh.len(), &mut fluid).map_err(self.content())?;
        }
        Ok(fluid)
    }
    /// Arrays of a message to the CFD by number, cells by slot.
    pub fn cell_arrays(&self, slots: &[Vec<u32>], n: usize) -> Result<BTreeMap<u32, Vec<f64>>, RecordError> {
        let mut arrays = BTreeMap::new();
        for (frame, slots) in self.frames(kind::SOURCES)?.iter().zip(slots) {
            for (name, width) in SOURCES {
                if frame.raw(name).is_none() {
                    continue;
                }
                let from = frame.f64s_of(name, width * slots.len()).map_err(self.content())?;
                let to: &mut Vec<f64> = arrays.entry(name).or_insert_with(|| vec![0.0; width * n]);
                for (slot, v) in slots.iter().zip(from.chunks_exact(width)) {
                    to[width * *slot as usize..][..width].copy_from_slice(v);
                }
            }
        }
        Ok(arrays)
    }
    /// Arrays of the reply to the DEM by number, particles as in `p`; empty if there is none.
    pub fn particle_arrays(&self, p: &Particles) -> Result<BTreeMap<u32, Vec<f64>>, RecordError> {
        let frames = self.frames(kind::DRIVE)?;
        let mut arrays = BTreeMap::new();
        for (name, width) in DRIVE {
            let parts: Vec<&[f64]> = frames.iter().filter_map(|f| f.f64s(name).ok()).collect();
            if parts.is_empty() || parts.len() < frames.len() {
                continue;
            }
            let one = |o: &(u32, u32)| parts.get(o.0 as usize)?.get(width * o.1 as usize..)?.get(..width);
            let all: Option<Vec<&[f64]>> = p.origin.iter().map(one).collect();
            let what = || format!("array {name} of DRIVE is too short");
            let all = all.ok_or_else(|| RecordError::Content { k: self.k, what: what() })?;
            arrays.insert(name, all.concat());
        }
        Ok(arrays)
    }
    /// Voidage and sources by cell slot.
    pub fn sources(&self, mesh: &Mesh) -> Result<Sources, RecordError> {
        let mut a = self.cell_arrays(&mesh.slots, mesh.len())?;
        let mut scalar = |name| a.remove(&name).unwrap_or_else(|| vec![0.0; mesh.len()]);
        let (voidage, voidage_old, sp) =
            (scalar(field::VOIDAGE), scalar(field::VOIDAGE_OLD), scalar(field::SP));
        let mut vector = |name| vectors(a.remove(&name).unwrap_or_else(|| vec![0.0; 3 * mesh.len()]));
        let (su, solids_flux) = (vector(field::SU), vector(field::SOLIDS_FLUX));
        Ok(Sources { voidage, voidage_old, solids_flux, sp, su })
    }
    /// The reply to the DEM, particles as in `p`; empty arrays if there is none, or a part of it is missing.
    pub fn drive(&self, p: &Particles) -> Result<Drive, RecordError> {
        let mut a = self.particle_arrays(p)?;
        if DRIVE[..DRIVE_ALWAYS].iter().any(|d| !a.contains_key(&d.0)) {
            return Ok(Drive::default());
        }
        let drag_coefficient = a.remove(&field::DRAG_COEFFICIENT).unwrap_or_default();
        let mut vector = |name| vectors(a.remove(&name).unwrap_or_default());
        let (velocity, force, charged) =
            (vector(field::DRIVE_VELOCITY), vector(field::FORCE), vector(field::CHARGED));
        Ok(Drive { drag_coefficient, velocity, force, charged, ..Drive::default() })
    }
}

/// Arrays of SOURCES and their width.
pub const SOURCES: [(u32, usize); 5] =
    [(field::VOIDAGE, 1), (field::VOIDAGE_OLD, 1), (field::SP, 1), (field::SU, 3), (field::SOLIDS_FLUX, 3)];
/// Arrays of DRIVE and their width.
pub const DRIVE: [(u32, usize); 8] = [
    (field::DRAG_COEFFICIENT, 1),
    (field::DRIVE_VELOCITY, 3),
    (field::FORCE, 3),
    (field::CHARGED, 3),
    (field::ADDED_MASS, 1),
    (field::ROTATION_COEFFICIENT, 1),
    (field::ROTATION_RATE, 3),
    (field::MEMORY, Memory::WIDTH),
];
/// How many of them are always there.
const DRIVE_ALWAYS: usize = 4;

fn vectors(flat: Vec<f64>) -> Vec<[f64; 3]> {
    flat.chunks_exact(3).map(|v| [v[0], v[1], v[2]]).collect()
}

/// Reads a recording exchange by exchange.
pub struct Moments<R: Read + Seek> {
    /// the file
    pub reader: Reader<R>,
    /// the mesh of all CFD ranks
    pub mesh: Mesh,
    /// what the partners were told
    pub settings: BTreeMap<String, f64>,
    /// recorded exchanges and the bytes at which they begin
    pub exchanges: Vec<(i64, u64)>,
    /// how the file ends
    pub end: End,
    /// rows of the monitor met so far
    pub rows: Vec<Row>,
    open: Option<Messages>,
    early: Vec<(u32, u32, i64, Vec<u64>)>,
}

impl<R: Read + Seek> Moments<R> {
    /// Reads handshake and mesh.
    pub fn new(mut reader: Reader<R>) -> Result<Self, RecordError> {
        let (exchanges, end) = reader.exchanges()?;
        let (dem, cfd) = (reader.session.dem_ranks as usize, reader.session.cfd_ranks as usize);
        let start = |what: String| RecordError::Content { k: -1, what };
        let (mut pieces, mut settings, mut early) = (Vec::new(), BTreeMap::new(), Vec::new());
        while pieces.len() < cfd {
            let Some(Chunk { head, words, .. }) = reader.next()? else { return Err(RecordError::NoExchange) };
            let Head::Message { partner, kind, step, .. } = head else { continue };
            let frame = Frame::parse(&words).map_err(|e| start(e.to_string()))?;
            match kind {
                kind::MESH => {
                    let rank = (partner as usize).checked_sub(dem).filter(|r| *r == pieces.len());
                    let rank = rank.ok_or_else(|| start(format!("a mesh of partner {partner}")))?;
                    pieces.push(MeshPiece::from_frame(rank, &frame).map_err(|e| start(e.to_string()))?);
                }
                kind::WELCOME => {
                    let bytes = frame.bytes(field::TEXT).map_err(|e| start(e.to_string()))?;
                    settings = hello::decode::<voidage_wire::Welcome>(bytes).map_err(start)?.settings;
                }
                kind::PARTICLES | kind::FIELDS => early.push((partner, kind, step, words)),
                _ => {}
            }
        }
        let mesh = assemble(&pieces).map_err(|e| start(e.to_string()))?;
        Ok(Self { reader, mesh, settings, exchanges, end, rows: Vec::new(), open: None, early })
    }

    /// The next whole exchange.
    #[allow(clippy::should_implement_trait)] // fallible
    pub fn next(&mut self) -> Result<Option<Messages>, RecordError> {
        let (dem, cfd) = (self.reader.session.dem_ranks as usize, self.reader.session.cfd_ranks as usize);
        while let Some(Chunk { head, words, .. }) = self.reader.next()? {
            match head {
                Head::Exchange { k, time } => {
                    let mut next = Messages::new(k, time);
                    for (partner, kind, step, words) in self.early.drain(..) {
                        if step == k {
                            next.add(partner, kind, words);
                        }
                    }
                    let whole = self.open.replace(next).filter(|m| m.complete(dem, cfd, false));
                    if whole.is_some() {
                        return Ok(whole);
                    }
                }
                Head::Message { partner, kind, step, .. } => match &mut self.open {
                    Some(m) if m.k == step => m.add(partner, kind, words),
                    _ if [kind::PARTICLES, kind::FIELDS].contains(&kind) => {
                        self.early.push((partner, kind, step, words));
                    }
                    _ => {}
                },
                Head::Choice { on, .. } => {
                    if let Some(m) = &mut self.open {
                        m.on = Some(on);
                    }
                }
                Head::Row(row) => self.rows.push(row),
                Head::Session(_) | Head::State { .. } | Head::Index => {}
            }
        }
        Ok(self.open.take().filter(|m| m.complete(dem, cfd, false)))
    }

    /// Exchange k, if it is recorded whole.
    pub fn exchange(&mut self, k: i64) -> Result<Option<Messages>, RecordError> {
        match self.exchanges.binary_search_by_key(&k, |e| e.0) {
            Ok(n) => Ok(self.at(n)?.filter(|m| m.k == k)),
            Err(_) => Ok(None),
        }
    }

    /// Exchange number `n` of `exchanges`, read where it stands.
    pub fn at(&mut self, n: usize) -> Result<Option<Messages>, RecordError> {
        let Some((_, offset)) = self.exchanges.get(n).copied() else { return Ok(None) };
        self.reader.seek(offset)?;
        (self.open, self.early) = (None, Vec::new());
        self.next()
    }

    /// The last whole exchange: a file may be cut in the last one it has.
    pub fn last(&mut self) -> Result<Option<Messages>, RecordError> {
        for n in (0..self.exchanges.len()).rev() {
            if let Some(x) = self.at(n)? {
                return Ok(Some(x));
            }
        }
        Ok(None)
    }
}
