// SPDX-License-Identifier: MIT OR Apache-2.0
//! `voidage couple`: the exchanges of a run, in their order.
//!
//! Reads MESH, FIELDS (CFD) and PARTICLES (DEM); writes SOURCES (CFD), DRIVE (DEM), a row of the monitor per
//! exchange. The DEM leads by one period: exchange 0 needs no fluid step. Does not know shared memory
//! (generic over `Transport`), nor how a stage works.

use crate::balance::Books;
use crate::forces::history::Memory;
use crate::mesh::{self, Mesh, MeshPiece};
use crate::monitor::{Monitor, Row};
use crate::output::restart::{self, Sets, State};
use crate::particles::{ParticleError, Particles};
use crate::partners::{PartnerError, Partners};
use crate::record::{RecordError, Recorder};
use crate::step::{CouplingStep, Fluid, StepError};
use crate::sums::norm;
use crate::threads;
use serde::{Deserialize, Serialize};
use std::path::Path;
use std::time::{Duration, Instant};
use thiserror::Error;
use voidage_wire::{Block, Frame, Transport, WireError, field, frame, kind};

/// Why a run ended before its time.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum CoupleError {
    /// A partner.
    #[error(transparent)]
    Partner(#[from] PartnerError),
    /// A particle.
    #[error("exchange {step}: {source}")]
    Particle {
        /// exchange number
        step: i64,
        /// what
        source: ParticleError,
    },
    /// A stage.
    #[error("exchange {step}: {source}")]
    Step {
        /// exchange number
        step: i64,
        /// what
        source: StepError,
    },
    /// A message.
    #[error("message: {0}")]
    Wire(#[from] WireError),
    /// The mesh.
    #[error("the mesh of the CFD: {0}")]
    Mesh(#[from] mesh::MeshError),
    /// Partners disagree.
    #[error("{0}")]
    OutOfStep(String),
    /// The recording.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// A file.
    #[error("{what}: {source}")]
    File {
        /// which
        what: &'static str,
        /// why
        source: std::io::Error,
    },
}

/// What a run came to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[allow(missing_docs)]
pub struct Summary {
    pub steps: i64,
    pub time: f64,
    pub coupler: f64,
    pub wait_dem: f64,
    pub wait_cfd: f64,
    pub worst_action_reaction: f64,
    pub worst_solid_volume: f64,
    pub redone: u64,
    pub excluded: u64,
    pub ledger_left: f64,
}

/// Receives the mesh of all CFD ranks.
pub fn receive_mesh<T: Transport>(partners: &mut Partners<T>) -> Result<Mesh, CoupleError> {
    let mut pieces = Vec::new();
    for (rank, i) in partners.cfd().enumerate() {
        let sample = partners.receive(i, kind::MESH, "mesh")?;
        pieces.push(MeshPiece::from_frame(rank, &Frame::parse(&sample)?)?);
    }
    Ok(mesh::assemble(&pieces)?)
}

/// Puts the fluid of one CFD rank, whose cells have these slots, among that of all `n` cells.
pub fn take_fluid(frame: &Frame, slots: &[u32], n: usize, fluid: &mut Fluid) -> Result<(), WireError> {
    for (name, to) in [
        (field::FLUID_VELOCITY, &mut fluid.velocity),
        (field::PRESSURE_GRADIENT, &mut fluid.pressure_gradient),
        (field::STRESS_DIVERGENCE, &mut fluid.stress_divergence),
    ] {
        if name != field::FLUID_VELOCITY && frame.raw(name).is_none() {
            continue;
        }
        to.resize(n, [0.0; 3]);
        let values = frame.vectors_of(name, slots.len())?;
        slots.iter().zip(values).for_each(|(slot, v)| to[*slot as usize] = *v);
    }
    Ok(())
}

/// What a write time hands to the output.
pub struct Snapshot<'a> {
    /// exchange number
    pub k: i64,
    /// fluid time, s
    pub time: f64,
    /// particles of this exchange
    pub particles: &'a Particles,
    /// the stages' fields
    pub step: &'a CouplingStep,
    /// the fluid at the end of the step
    pub fluid: &'a Fluid,
}

/// A run under way.
pub struct Exchange<'a, T: Transport> {
    /// The connected programs.
    pub partners: Partners<T>,
    /// The stages.
    pub step: CouplingStep,
    /// Threads the stages run on; `None`: on the calling one.
    pub pool: Option<rayon::ThreadPool>,
    /// False: the fluid does not feel the particles.
    pub two_way: bool,
    /// Δt, s.
    pub period: f64,
    /// Fluid time at exchange 0, s.
    pub start: f64,
    /// Step number of the DEM at exchange 0, and its steps between exchanges.
    pub dem_step: i64,
    /// see `dem_step`
    pub interval: i64,
    /// Continues after this exchange.
    pub resume: Option<State>,
    /// Writes restart sets at the fluid's write times.
    pub sets: Option<Sets>,
    /// monitor.csv; `None` in a replay
    pub monitor: Option<Monitor>,
    /// Keeps the exchanges; what it misses of them passes its transport.
    pub recorder: Option<Recorder>,
    /// Told after each exchange.
    pub progress: &'a mut dyn FnMut(&Row, &Summary),
    /// Told at the fluid's write times.
    pub write: &'a mut dyn FnMut(&Snapshot) -> std::io::Result<()>,
}

/// What goes from one exchange to the next beside the step's own.
#[derive(Default)]
pub struct Course {
    fluid: Fluid,
    open: Option<Open>,
    /// ledger of vanished particles, N s
    left: [f64; 3],
    /// so far
    pub summary: Summary,
}

impl Course {
    /// The fluid at the end of the last step.
    pub fn fluid(&self) -> &Fluid {
        &self.fluid
    }
}

/// A row that waits for the DEM's report on the interval it is about.
struct Open {
    row: Row,
    books: Books,
}

impl<T: Transport> Exchange<'_, T> {
    /// Runs until the fluid's last step; partners are told to stop in either case.
    pub fn run(&mut self) -> Result<Summary, CoupleError> {
        let result = self.exchanges();
        if let Err(e) = &result {
            self.partners.stop(&e.to_string());
        }
        result
    }

    fn exchanges(&mut self) -> Result<Summary, CoupleError> {
        let mut course = Course::default();
        let mut k = 0;
        if let Some(s) = self.resume.take() {
            k = s.exchange + 1;
            (course.left, course.summary) = (s.left, s.summary);
            course.open = Some(self.take_up(&s)?);
        }
        while !self.exchange(k, &mut course)? {
            k += 1;
        }
        Ok(course.summary)
    }

    /// Exchange k. True: it was the last.
    pub fn exchange(&mut self, k: i64, course: &mut Course) -> Result<bool, CoupleError> {
        let begin = Instant::now();
        let time = self.start + k as f64 * self.period;
        if let Some(r) = &self.recorder {
            r.begin(k, time, &self.step)?;
        }
        let (first, mut wait_cfd, mut last, mut write) = (k == 0, Duration::ZERO, false, true);
        let mut reaction = [0.0; 3];
        if first {
            (last, _, _) = self.receive_fluid(k, &mut course.fluid, &mut wait_cfd)?;
        }
        let waiting = Instant::now();
        let mut particles = self.receive_particles(k)?;
        let wait_dem = waiting.elapsed();
        if let Some(o) = course.open.take() {
            self.close(o, Some(&particles), course)?;
        }
        let stage = |source| CoupleError::Step { step: k, source };
        let step = &mut self.step;
        threads::within(self.pool.as_ref(), || step.before_fluid(&mut particles, first)).map_err(stage)?;
        self.send_sources(k, time)?;
        if !first {
            (last, write, reaction) = self.receive_fluid(k, &mut course.fluid, &mut wait_cfd)?;
        }
        let (step, fluid) = (&mut self.step, &course.fluid);
        threads::within(self.pool.as_ref(), || step.after_fluid(&particles, fluid, first)).map_err(stage)?;
        self.step.books.reaction = reaction;
        let file = |source| CoupleError::File { what: "restart set", source };
        let set = match &self.sets {
            Some(sets) if write && !first => Some(sets.begin(time).map_err(file)?),
            _ => None,
        };
        if last {
            self.partners.release_cfd();
        }
        if last && set.is_none() {
            self.partners.stop("");
        } else {
            self.send_drive(k, time, &particles, set.as_deref(), last)?;
        }
        if write {
            self.step.form_solids_flux(&particles);
            let fluid = &course.fluid;
            let snapshot = Snapshot { k, time, particles: &particles, step: &self.step, fluid };
            (self.write)(&snapshot).map_err(|source| CoupleError::File { what: "write fields", source })?;
        }
        for change in self.step.reconsider(k, &particles, &course.fluid) {
            tracing::info!("auto, exchange {k} (t = {time} s): {change}");
        }
        let mut o = self.open_row(k, time, &particles, &mut course.summary);
        o.row.wait_dem = wait_dem.as_secs_f64();
        o.row.wait_cfd = wait_cfd.as_secs_f64();
        o.row.coupler = begin.elapsed().as_secs_f64() - o.row.wait_dem - o.row.wait_cfd;
        let summary = &mut course.summary;
        summary.coupler += o.row.coupler;
        summary.wait_dem += o.row.wait_dem;
        summary.wait_cfd += o.row.wait_cfd;
        summary.steps = k;
        summary.time = time;
        if let Some(set) = set {
            for i in self.partners.dem() {
                self.partners.receive(i, kind::WRITTEN, "word that its restart file is written")?;
            }
            if last {
                self.partners.stop("");
            }
            let state = self.state(k, &particles, &course.fluid, &o, course.left, &course.summary);
            self.sets.iter().try_for_each(|s| s.finish(&set, state.clone())).map_err(file)?;
        }
        (self.progress)(&o.row, &course.summary);
        course.open = Some(o);
        if last {
            self.pause(course)?;
        }
        Ok(last)
    }

    /// No exchange follows that could complete the row at hand: the run is over, or the next one is not recorded.
    pub fn pause(&mut self, course: &mut Course) -> Result<(), CoupleError> {
        match course.open.take() {
            Some(o) => self.close(o, None, course),
            None => Ok(()),
        }
    }

    /// The set of exchange k, as far as the exchanges know it.
    fn state(
        &self,
        k: i64,
        p: &Particles,
        fluid: &Fluid,
        open: &Open,
        left: [f64; 3],
        summary: &Summary,
    ) -> State {
        let mesh = &self.step.mesh;
        State {
            exchange: k,
            time: self.start + k as f64 * self.period,
            origin: self.start,
            dem_step: self.dem_step + k * self.interval,
            particles: p.len(),
            particles_sum: restart::particles_sum(p),
            cells: mesh.ids.len(),
            mesh_sum: restart::mesh_sum(&mesh.ids, &mesh.volume),
            left,
            summary: *summary,
            row: open.row,
            books: open.books,
            voidage: self.step.sources.voidage.clone(),
            velocity: fluid.velocity.clone(),
            velocity_before: self.step.carried().2.to_vec(),
            in_force: self.step.in_force(),
            ..State::default()
        }
    }

    /// Takes up a run after exchange `s.exchange`: both programs stand where the set says, or the run ends here.
    fn take_up(&mut self, s: &State) -> Result<Open, CoupleError> {
        let (k, mut fluid, mut waited) = (s.exchange, Fluid::default(), Duration::ZERO);
        let refuse = |what: String| {
            CoupleError::OutOfStep(format!(
                "restart set of t = {}: {what}; name another set (--restart=TIME) or start anew",
                s.time
            ))
        };
        self.receive_fluid(k, &mut fluid, &mut waited)?;
        let mesh = &self.step.mesh;
        if s.cells != mesh.ids.len() || s.mesh_sum != restart::mesh_sum(&mesh.ids, &mesh.volume) {
            return Err(refuse(format!(
                "it belongs to another mesh ({} cells, now {})",
                s.cells,
                mesh.ids.len()
            )));
        }
        let size = s.velocity.iter().map(|v| norm(*v)).fold(0.0, f64::max);
        let gap = s.velocity.iter().zip(&fluid.velocity).map(|(a, b)| norm([0, 1, 2].map(|c| a[c] - b[c])));
        let gap = gap.fold(0.0, f64::max);
        // the fluid's files may be text: six digits are the least OpenFOAM writes by default
        if gap > 1e-4 * size {
            return Err(refuse(format!(
                "the fluid's fields are not those it was written with (U differs by {gap:e} m/s)"
            )));
        }
        let p = self.receive_particles(k)?;
        if p.len() != s.particles || restart::particles_sum(&p) != s.particles_sum {
            let (was, now) = (s.particles, p.len());
            return Err(refuse(format!(
                "the DEM brought other particles back ({was} were saved, {now} came, or their values changed after read_restart)"
            )));
        }
        self.step.restore(&s.voidage, &s.velocity, &s.velocity_before);
        if let Some(bits) = s.in_force {
            self.step.put_in_force(bits);
        }
        if let Some(w) = self.step.watch() {
            w.keep(k, &p, &s.velocity);
        }
        self.send_sources(k, s.time)?;
        Ok(Open { row: s.row, books: s.books })
    }

    fn in_step(got: i64, due: i64, who: &str) -> Result<(), CoupleError> {
        if got == due {
            return Ok(());
        }
        Err(CoupleError::OutOfStep(format!(
            "{who} is at exchange {got}, {due} is due: fluid and DEM are out of step"
        )))
    }

    fn receive_particles(&mut self, k: i64) -> Result<Particles, CoupleError> {
        let mut samples = Vec::new();
        for i in self.partners.dem() {
            samples.push(self.partners.receive(i, kind::PARTICLES, "particles")?);
        }
        let frames = samples.iter().map(|s| Frame::parse(s)).collect::<Result<Vec<_>, _>>()?;
        for (i, f) in frames.iter().enumerate() {
            Self::in_step(f.step(), k, &self.partners.who(i))?;
        }
        Particles::receive(&frames, self.step.places())
            .map_err(|source| CoupleError::Particle { step: k, source })
    }

    /// The fluid of all CFD ranks by cell slot; (last step, write time, Σ reaction in N s).
    fn receive_fluid(
        &mut self,
        k: i64,
        fluid: &mut Fluid,
        waited: &mut Duration,
    ) -> Result<(bool, bool, [f64; 3]), CoupleError> {
        let n = self.step.mesh.ids.len();
        let (mut flags, mut reaction) = ([0.0; 2], [0.0; 3]);
        for (piece, i) in self.partners.cfd().enumerate() {
            let begin = Instant::now();
            let sample = self.partners.receive(i, kind::FIELDS, "fields")?;
            *waited += begin.elapsed();
            let frame = Frame::parse(&sample)?;
            Self::in_step(frame.step(), k, &self.partners.who(i))?;
            take_fluid(&frame, &self.step.mesh.slots[piece], n, fluid)?;
            let (f, r) = (frame.f64s_of(field::FLAGS, 2)?, frame.f64s_of(field::REACTION, 3)?);
            flags = [f[0], f[1]];
            (0..3).for_each(|a| reaction[a] += r[a]);
        }
        Ok((flags[0] != 0.0, flags[1] != 0.0, reaction))
    }

    fn send_sources(&mut self, k: i64, time: f64) -> Result<(), CoupleError> {
        for (piece, i) in self.partners.cfd().enumerate() {
            let (slots, s) = (&self.step.mesh.slots[piece], &self.step.sources);
            let n = slots.len();
            let scalars =
                [(field::VOIDAGE, &s.voidage), (field::VOIDAGE_OLD, &s.voidage_old), (field::SP, &s.sp)];
            let mut vectors = vec![(field::SU, &s.su)];
            if self.step.wants_solids_flux() {
                vectors.push((field::SOLIDS_FLUX, &s.solids_flux));
            }
            let mut blocks: Vec<_> = scalars.iter().map(|f| Block::f64s(f.0, n)).collect();
            blocks.extend(vectors.iter().map(|f| Block::f64s(f.0, 3 * n)));
            let two_way = self.two_way;
            self.partners.send(i, kind::SOURCES, k, time, &blocks, |words| {
                for (name, from) in scalars {
                    let Some(to) = frame::f64s_mut(words, name) else { continue };
                    if two_way {
                        to.iter_mut().zip(slots).for_each(|(t, slot)| *t = from[*slot as usize]);
                    } else {
                        to.fill(if name == field::SP { 0.0 } else { 1.0 });
                    }
                }
                for (name, from) in vectors {
                    let Some(to) = frame::f64s_mut(words, name) else { continue };
                    if two_way {
                        let cells = to.chunks_exact_mut(3).zip(slots);
                        cells.for_each(|(t, slot)| t.copy_from_slice(&from[*slot as usize]));
                    }
                }
            })?;
        }
        Ok(())
    }

    /// `set`: folder of the restart set the DEM is to write its file to.
    fn send_drive(
        &mut self,
        k: i64,
        time: f64,
        particles: &Particles,
        set: Option<&Path>,
        last: bool,
    ) -> Result<(), CoupleError> {
        let file = set.map(|s| s.join(restart::PARTICLES).display().to_string());
        let mut counts = vec![0; self.partners.dem().len()];
        particles.origin.iter().for_each(|o| counts[o.0 as usize] += 1);
        let drive = &self.step.drive;
        let memory: Vec<f64> = drive.memory.iter().flat_map(|m| m.0).collect();
        for i in self.partners.dem() {
            let n = counts[i];
            let arrays = [
                (field::DRAG_COEFFICIENT, 1, &drive.drag_coefficient[..]),
                (field::DRIVE_VELOCITY, 3, drive.velocity.as_flattened()),
                (field::FORCE, 3, drive.force.as_flattened()),
                (field::CHARGED, 3, drive.charged.as_flattened()),
                (field::ADDED_MASS, 1, &drive.added_mass[..]),
                (field::ROTATION_COEFFICIENT, 1, &drive.rotation_coefficient[..]),
                (field::ROTATION_RATE, 3, drive.rotation_rate.as_flattened()),
                (field::MEMORY, Memory::WIDTH, &memory[..]),
            ];
            // those behind the first four only if they are asked for, from no particles too
            let asked = |name: u32| match name {
                field::ADDED_MASS => self.step.extra().sends_added_mass(),
                field::ROTATION_COEFFICIENT | field::ROTATION_RATE => self.step.extra().torque,
                field::MEMORY => self.step.extra().sends_memory(),
                _ => true,
            };
            let mut blocks: Vec<_> =
                arrays.iter().filter(|f| asked(f.0)).map(|f| Block::f64s(f.0, f.1 * n)).collect();
            if let Some(name) = &file {
                blocks.extend([Block::bytes(field::RESTART_FILE, name.len()), Block::f64s(field::FLAGS, 1)]);
            }
            let own = || particles.origin.iter().enumerate().filter(|(_, o)| o.0 as usize == i);
            self.partners.send(i, kind::DRIVE, k, time, &blocks, |words| {
                if let (Some(name), Some(to)) = (&file, frame::array_mut(words, field::RESTART_FILE)) {
                    for (word, bytes) in to.iter_mut().zip(name.as_bytes().chunks(8)) {
                        let mut all = [0; 8];
                        all[..bytes.len()].copy_from_slice(bytes);
                        *word = u64::from_ne_bytes(all);
                    }
                }
                if let Some(to) = frame::f64s_mut(words, field::FLAGS) {
                    to[0] = f64::from(u8::from(last));
                }
                for (name, width, from) in arrays {
                    let Some(to) = frame::f64s_mut(words, name) else { continue };
                    own().for_each(|(p, o)| {
                        to[width * o.1 as usize..][..width].copy_from_slice(&from[width * p..][..width]);
                    });
                }
            })?;
        }
        Ok(())
    }

    fn open_row(&self, k: i64, time: f64, particles: &Particles, summary: &mut Summary) -> Open {
        let (facts, books) = (&self.step.facts, self.step.books);
        summary.redone += facts.positive_redone;
        summary.excluded += facts.excluded;
        summary.worst_solid_volume = summary.worst_solid_volume.max(facts.solid_volume_error);
        let row = Row {
            step: k,
            time,
            particles: particles.len(),
            solid_fraction_max: facts.solid_fraction_max,
            solid_volume_error: facts.solid_volume_error,
            solid_momentum_error: facts.solid_momentum_error,
            action_reaction_error: (self.two_way && self.step.conservative()).then(|| books.error(None)),
            ledger_momentum: norm(books.old_ledger),
            positive_redone: summary.redone,
            excluded: summary.excluded,
            capped_volume: facts.capped_volume,
            given: [0, 1, 2].map(|a| books.charged[a] + books.old_ledger[a] - books.external[a]),
            ..Row::default()
        };
        Open { row, books }
    }

    /// Completes a row with what the DEM reports of the interval (`None`: the run is over).
    fn close(
        &mut self,
        mut o: Open,
        next: Option<&Particles>,
        course: &mut Course,
    ) -> Result<(), CoupleError> {
        let Course { left, summary, .. } = course;
        if let Some(p) = next {
            // action = impulse applied + change of the ledger; vanished particles' ledger goes to `left`
            let conservative = self.step.conservative();
            let alive = crate::sums::sum3(p.ledger.iter().copied().filter(|_| conservative));
            // without a ledger the action is all that was taken, and the difference is the scheme's error
            let kept = |a: usize| if conservative { p.totals.taken[a] - p.totals.charged[a] } else { 0.0 };
            let ledger = [0, 1, 2].map(kept);
            let charged = [0, 1, 2].map(|a| p.totals.taken[a] - ledger[a]);
            (0..3).for_each(|a| left[a] += ledger[a] - alive[a]);
            // exchange 0 has no fluid step that could react
            if self.two_way && (conservative || o.row.step > 0) {
                o.row.action_reaction_error = Some(o.books.error(Some(charged)));
            }
            o.row.ledger_momentum = norm(alive);
        }
        o.row.ledger_left = norm(*left);
        summary.ledger_left = o.row.ledger_left;
        summary.worst_action_reaction =
            summary.worst_action_reaction.max(o.row.action_reaction_error.unwrap_or_default());
        if let Some(r) = &self.recorder {
            r.row(&o.row)?;
        }
        self.monitor
            .iter_mut()
            .try_for_each(|m| m.write(&o.row))
            .map_err(|source| CoupleError::File { what: "monitor.csv", source })
    }
}
