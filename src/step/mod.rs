// SPDX-License-Identifier: MIT OR Apache-2.0
//! One coupling step, stage by stage (design §2); the same lines run live and in replay.
//!
//! `before_fluid`: particles of exchange k in, voidage and sources of fluid step k out (stages 2 to 7).
//! `after_fluid`: the fluid's answer in, what drives the particles out (stage 9).
//! Units SI. Does not know processes or files; times the stages; owns scratch memory and nothing that changes
//! results, except what `carried` tells and the forces in force, which are part of the exchange.

mod drag;
mod reply;
mod solids;
mod types;

pub use types::{Drive, Facts, Fluid, Seconds, Setup, Sources, StepError};

use crate::arrange::{Order, Places};
use crate::auto::{Change, Watch};
use crate::balance::Books;
use crate::forces::Extra;
use crate::inspect::measure::View;
use crate::linearise::Predictions;
use crate::locate::{Locator, Lost};
use crate::map::{Mapping, Weights};
use crate::mesh::{Mesh, NONE};
use crate::particles::{Particles, Spare};
use crate::smooth::{Active, Classes, Direction, Field, Pinned, Scratch, Smoother};
use crate::threads;
use std::time::Instant;

/// Fields of a cell: eight lanes, smoothed together.
pub type Lanes = [f64; 8];

/// The coupling step of one run.
pub struct CouplingStep {
    /// The coupler's own copy of the mesh.
    pub mesh: Mesh,
    setup: Setup,
    locator: Locator,
    mapping: Box<dyn Mapping>,
    /// that of the run, and the one that cannot turn a result negative
    smoothers: [Box<dyn Smoother>; 2],
    /// which of them this step uses
    smoother: usize,
    scratch: Scratch,
    weights: Weights,
    active: Active,
    /// classes of particle sizes: `work`, `gathered`, `active` and `order` go by their rows
    classes: Classes,
    /// rows of all classes as a mesh; none: there is one class and its rows are the cells
    wide: Option<Mesh>,
    rows: Vec<u32>,
    /// cells whose sources are written, and `work` summed over the classes, where they are not the active rows and `work`
    cells: Vec<u32>,
    total: Vec<Lanes>,
    /// row, ε_s and lane 7 that particles are to read there
    read: Vec<(u32, f64, f64)>,
    /// cells whose voidage was capped, and which share of their solids the fluid knows of
    capped: Vec<(u32, f64)>,
    /// host cell of each particle
    hosts: Vec<u32>,
    order: Order,
    spare: Spare,
    /// places of the last exchange
    places: Places,
    /// while locating: hosts of the last exchange, in its order
    last_hosts: Vec<u32>,
    /// ids of the last exchange, in its order
    last_ids: Vec<i64>,
    /// the fluid of the last step as it came, m/s
    fluid_velocity: Vec<[f64; 3]>,
    /// lanes 0–2 G of the new fluid's velocity, 3–5 of its ∇p − ∇·τ
    gathered: Field,
    /// scratch: zero outside the rows in `dirty`
    work: Field,
    dirty: Vec<u32>,
    /// rows where `sources` are not those of an empty cell
    filled: Vec<u32>,
    predicted: Predictions,
    /// explicit forces with a reaction (N), empty if there are none
    extra: Vec<[f64; 3]>,
    /// fluid velocity one step before the last, for the added mass
    fluid_before: Vec<[f64; 3]>,
    /// ε_s and ε_s U_s as mapped and as smoothed, for schemes that want them
    mapped: Vec<Lanes>,
    smoothed: Vec<Lanes>,
    /// continues the solids velocity into void cells, for schemes that want it so
    pinned: Option<Pinned>,
    /// measures the terms and switches forces
    watch: Option<Watch>,
    /// Voidage and sources of this step.
    pub sources: Sources,
    /// Reply to the DEM.
    pub drive: Drive,
    /// Counts and errors.
    pub facts: Facts,
    /// Action–reaction books.
    pub books: Books,
    /// What the stages took.
    pub seconds: Seconds,
}

/// Lanes of the first pass: ε_s, ε_s U_s (1–3) and, from here, the last fluid velocity.
const FLUID: usize = 4;

impl CouplingStep {
    /// Takes the mesh and the methods; `positive` is the smoother used when a result would turn negative.
    pub fn new(
        mesh: Mesh,
        setup: Setup,
        mapping: Box<dyn Mapping>,
        smoother: Box<dyn Smoother>,
        positive: Box<dyn Smoother>,
    ) -> Self {
        let (n, locator) = (mesh.len(), Locator::new(&mesh));
        Self {
            locator,
            setup,
            mapping,
            smoothers: [smoother, positive],
            smoother: 0,
            scratch: Scratch::new(n),
            weights: Weights::default(),
            active: Active::default(),
            classes: Classes::one(&mesh),
            wide: None,
            rows: Vec::new(),
            cells: Vec::new(),
            total: Vec::new(),
            read: Vec::new(),
            capped: Vec::new(),
            hosts: Vec::new(),
            order: Order::default(),
            spare: Spare::default(),
            places: Places::default(),
            last_hosts: Vec::new(),
            last_ids: Vec::new(),
            fluid_velocity: vec![[0.0; 3]; n],
            gathered: Field::zero(n),
            work: Field::zero(n),
            dirty: Vec::new(),
            filled: Vec::new(),
            predicted: Predictions::default(),
            extra: Vec::new(),
            fluid_before: Vec::new(),
            mapped: Vec::new(),
            smoothed: Vec::new(),
            pinned: None,
            watch: None,
            sources: Sources {
                voidage: vec![1.0; n],
                voidage_old: vec![1.0; n],
                solids_flux: vec![[0.0; 3]; n],
                sp: vec![0.0; n],
                su: vec![[0.0; 3]; n],
            },
            drive: Drive::default(),
            facts: Facts::default(),
            books: Books::default(),
            seconds: Seconds::default(),
            mesh,
        }
    }

    /// Particles in classes by size; the smoothers given to `new` are then for the rows of all classes.
    pub fn with_classes(mut self, classes: Classes) -> Self {
        if classes.count() > 1 {
            self.wide = Some(classes.mesh(&self.mesh));
            self.total = vec![[0.0; 8]; self.mesh.len()];
        }
        for field in [&mut self.gathered, &mut self.work] {
            field.fit(classes.rows());
        }
        self.scratch = Scratch::new(classes.rows());
        self.classes = classes;
        self
    }

    /// The solids velocity of void cells is continued from the filled ones, which are held fixed.
    pub fn with_pinned(self, pinned: Option<Pinned>) -> Self {
        Self { pinned, ..self }
    }

    /// Forces are switched during the run (`auto`).
    pub fn with_watch(self, watch: Option<Watch>) -> Self {
        Self { watch, ..self }
    }

    /// The watch of this run.
    pub fn watch(&mut self) -> Option<&mut Watch> {
        self.watch.as_mut()
    }

    /// The forces in force, of those that may be switched (`Watch::in_force`); `None`: nothing is chosen.
    pub fn in_force(&self) -> Option<u32> {
        self.watch.as_ref().map(Watch::in_force)
    }

    /// Puts them in force for the coming exchange (restart, recording).
    pub fn put_in_force(&mut self, bits: u32) {
        if let Some(w) = &mut self.watch {
            w.put(bits);
            w.apply(&mut self.setup.extra);
        }
    }

    /// Exchange k is over (after `after_fluid`): measures it if that is due, and switches forces for the next one.
    pub fn reconsider(&mut self, k: i64, p: &Particles, fluid: &Fluid) -> Vec<Change> {
        let Some(w) = &mut self.watch else { return Vec::new() };
        let mut changes = Vec::new();
        if w.due(k) {
            let (mesh, hosts, sources, drive) = (&self.mesh, &self.hosts[..], &self.sources, &self.drive);
            let view = View { mesh, particles: p, hosts, fluid, sources, drive, before: None };
            changes = w.reconsider(k, &view);
            w.apply(&mut self.setup.extra);
        }
        w.keep(k, p, &fluid.velocity);
        changes
    }

    /// What the step carries from one exchange to the next: voidage, fluid velocity (m/s), and that of one step earlier
    /// (empty where nothing needs it).
    pub fn carried(&self) -> (&[f64], &[[f64; 3]], &[[f64; 3]]) {
        (&self.sources.voidage, &self.fluid_velocity, &self.fluid_before)
    }

    /// Puts what the step carries into the coming exchange (restart, recording): see `carried`.
    pub fn restore(&mut self, voidage: &[f64], fluid_velocity: &[[f64; 3]], before: &[[f64; 3]]) {
        self.sources.voidage.copy_from_slice(voidage);
        self.fluid_velocity.copy_from_slice(fluid_velocity);
        self.fluid_before = before.to_vec();
        self.filled = (0..self.mesh.len() as u32).collect();
    }

    /// The smoother of this run.
    pub fn smoother(&self) -> &dyn Smoother {
        &*self.smoothers[0]
    }

    /// Where the particles of this exchange lie; those of the next one are best stored alike.
    pub fn places(&self) -> &Places {
        &self.places
    }

    /// Stages 2 to 7; brings the particles into the order of this exchange. `first`: exchange 0, where there is no
    /// fluid step to come and nothing is charged.
    pub fn before_fluid(&mut self, p: &mut Particles, first: bool) -> Result<(), StepError> {
        self.facts = Facts::default();
        if self.setup.scheme.wants_history() && p.history.drag_coefficient.len() != p.len() {
            return Err(StepError::NoHistory(self.setup.scheme.name()));
        }
        self.asked(p)?;
        self.locate(p)?;
        let begin = Instant::now();
        self.mapping.weights(&self.mesh, &p.position, &p.radius, &self.hosts, &mut self.weights);
        self.classes.shift(&mut self.weights, &p.radius);
        self.weights.survey(&self.order);
        self.sources.voidage_old.clone_from(&self.sources.voidage);
        self.smoother = 0;
        self.seconds.map = begin.elapsed().as_secs_f64();
        loop {
            self.smoothers[self.smoother].plan(self.weights.reached(&self.order.occupied), &mut self.active);
            self.plan_cells();
            let fits = self.solids(p, first) && (first || self.sources_of(p));
            if fits || self.smoother == 1 {
                break;
            }
            // same G for every pass of the step: redo all of it with the positive polynomial
            self.smoother = 1;
            self.facts.positive_redone = 1;
        }
        self.check_voidage()?;
        if first {
            self.sources.voidage_old.clone_from(&self.sources.voidage);
        }
        Ok(())
    }

    /// What the forces switched on ask of the DEM is there.
    fn asked(&self, p: &Particles) -> Result<(), StepError> {
        let (x, a, n) = (&self.setup.extra, &p.asked, p.len());
        for (on, sent, key, what) in [
            (!x.ratio_by_type.is_empty(), a.kind.len(), "dem.coarse_graining", "the particles' types"),
            (x.torque, a.spin.len(), "forces.torque", "angular velocities"),
            (x.history, a.memory.len(), "forces.history", "what it was given to keep"),
        ] {
            if on && sent != n {
                return Err(StepError::NotSent { key, what });
            }
        }
        let without = (0..n).find(|i| x.ratio(&a.kind, *i).is_nan());
        without.map_or(Ok(()), |i| Err(StepError::NoRatio { id: p.id[i], kind: a.kind[i] }))
    }

    /// `cells` where they are not the active rows.
    fn plan_cells(&mut self) {
        let wide = self.wide.is_some();
        if wide {
            self.cells.iter().for_each(|j| self.total[*j as usize] = [0.0; 8]);
        }
        if self.setup.average.is_some() {
            // the mean is there where particles were
            self.cells.clear();
            self.cells.extend(0..self.mesh.len() as u32);
        } else if wide {
            self.classes.cells_of(&self.active.rows, &mut self.cells);
        }
    }
    /// The sources are those of `cells`, not of the active rows.
    fn elsewhere(&self) -> bool {
        self.wide.is_some() || self.setup.average.is_some()
    }
    /// Sums `work` over the classes.
    fn sum_classes(&mut self) {
        if self.wide.is_some() {
            self.classes.sum(&self.work, &self.active.rows, &self.cells, &mut self.total);
        }
    }
    /// `work` of all classes together.
    fn summed(&self) -> &[Lanes] {
        if self.wide.is_some() { &self.total } else { &self.work }
    }

    /// Stage 2: host cells, and the table in their order; last hosts are only a guess where to look first.
    fn locate(&mut self, p: &mut Particles) -> Result<(), StepError> {
        let begin = Instant::now();
        std::mem::swap(&mut self.hosts, &mut self.last_hosts);
        self.hosts.clear();
        // as a rule a particle comes where it was; only others are looked up
        let place = |(k, id): (usize, &i64)| match self.last_ids.get(k) {
            Some(last) if last == id => k,
            _ => self.places.of(*id) as usize,
        };
        let guess = p.id.iter().enumerate().map(|p| self.last_hosts.get(place(p)).copied());
        self.hosts.extend(guess.map(|g| g.unwrap_or(NONE)));
        let lost =
            self.locator.locate(&self.mesh, &mut p.position, &mut self.hosts).err().unwrap_or_default();
        for Lost { index, position, near } in lost {
            if !self.setup.exclude_outside {
                let near = near.map(|n| format!(" (nearest patch {n})")).unwrap_or_default();
                return Err(StepError::Outside { id: p.id[index], position, near });
            }
            self.hosts[index] = NONE;
            self.facts.excluded += 1;
        }
        let located = Instant::now();
        let rows = if self.wide.is_some() {
            self.rows.clear();
            self.rows.extend(self.hosts.iter().zip(&p.radius).map(|(h, r)| self.classes.row(*h, *r)));
            &self.rows
        } else {
            &self.hosts
        };
        let list = self.order.update(self.classes.rows(), &p.id, rows);
        let (spare, places) = (&mut self.spare, &mut self.places);
        p.arrange(list, spare, |ids| places.update(ids));
        self.last_ids.clone_from(&p.id);
        self.last_hosts.clear();
        self.last_hosts.extend(list.iter().map(|i| self.hosts[*i as usize]));
        std::mem::swap(&mut self.hosts, &mut self.last_hosts);
        self.seconds.locate = (located - begin).as_secs_f64();
        self.seconds.arrange = located.elapsed().as_secs_f64();
        Ok(())
    }

    /// `work` all zero; in the active rows, which are about to be written, with the last fluid velocity if asked for.
    fn clear_work(&mut self, fluid: bool) {
        let rows = &self.active.rows;
        if self.dirty != *rows {
            self.dirty.iter().for_each(|j| self.work[*j as usize] = [0.0; 8]);
            self.dirty.clone_from(rows);
        }
        let pieces = threads::rows(rows, self.classes.rows());
        let parts = threads::cut(&mut self.work, pieces.iter().map(|p| p.1.end));
        let (velocity, classes) = (&self.fluid_velocity, &self.classes);
        threads::map(pieces.into_iter().zip(parts).collect(), |((rows, slots), work)| {
            for row in rows {
                let j = *row as usize;
                let u = if fluid { velocity[classes.cell(*row)] } else { [0.0; 3] };
                work[j - slots.start] = [0.0, 0.0, 0.0, 0.0, u[0], u[1], u[2], 0.0];
            }
        });
    }

    fn smooth_work(&mut self, direction: Direction) {
        self.smoothers[self.smoother].apply(&mut self.work, &self.active, direction, &mut self.scratch);
    }

    /// Stage 9 (pass c): the new fluid smoothed by the same G, read at the particles; the impulse charged.
    pub fn after_fluid(&mut self, p: &Particles, fluid: &Fluid, first: bool) -> Result<(), StepError> {
        let begin = Instant::now();
        let x = &self.setup.extra;
        if (x.added() || x.added_mass_sent) && !first {
            self.fluid_before.clone_from(&self.fluid_velocity);
        }
        self.take_fluid(fluid)?;
        let gathered = Instant::now();
        self.seconds.gather = (gathered - begin).as_secs_f64();
        if first {
            // no fluid step lies behind: K is computed with the fluid as it stands, nothing is charged
            self.predict(p, true);
        }
        self.drive_particles(p, first);
        if self.setup.extra.torque {
            self.torque(p);
        }
        self.seconds.drive = gathered.elapsed().as_secs_f64();
        Ok(())
    }

    /// What particle i brings, deposited and smoothed beside `work`, by row.
    fn spread_beside(&mut self, brings: impl Fn(usize) -> Lanes + Sync) -> Vec<Lanes> {
        let mut lanes = vec![[0.0; 8]; self.classes.rows()];
        let mesh = self.wide.as_ref().unwrap_or(&self.mesh);
        self.weights.deposit(mesh, &self.order, &mut lanes, |i, _: &mut ()| brings(i));
        self.smoothers[self.smoother].apply(&mut lanes, &self.active, Direction::Spread, &mut self.scratch);
        lanes
    }

    /// Forms ε_s U_s for output where no stage needs it.
    pub fn form_solids_flux(&mut self, p: &Particles) {
        if self.setup.solids_flux {
            return;
        }
        let lanes = self.spread_beside(|i| {
            let (v, u) = (p.volume(i), p.velocity[i]);
            [v * u[0], v * u[1], v * u[2], 0.0, 0.0, 0.0, 0.0, 0.0]
        });
        self.sources.solids_flux.fill([0.0; 3]);
        for (row, l) in lanes.iter().enumerate() {
            let flux = &mut self.sources.solids_flux[self.classes.cell(row as u32)];
            flux.iter_mut().zip(l).for_each(|(s, l)| *s += l);
        }
    }

    /// The forces beside drag.
    pub fn extra(&self) -> &Extra {
        &self.setup.extra
    }

    /// The fluid asks for ε_s U_s.
    pub fn wants_solids_flux(&self) -> bool {
        self.setup.solids_flux
    }

    /// The scheme of this run keeps the third law by its ledger.
    pub fn conservative(&self) -> bool {
        self.setup.scheme.conservative()
    }
}
