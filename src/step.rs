// SPDX-License-Identifier: MIT OR Apache-2.0
//! One coupling step, stage by stage (design §2); the same lines run live and in replay.
//!
//! `before_fluid`: particles of exchange k in, voidage and sources of fluid step k out (stages 2 to 7).
//! `after_fluid`: the fluid's answer in, what drives the particles out (stage 9).
//! Units SI. Does not know processes or files; times the stages; owns scratch memory and nothing that changes
//! results, except the last fluid velocity, which is part of the exchange.

use crate::arrange::{Order, Places};
use crate::auto::{Change, Watch};
use crate::balance::{Books, ratio};
use crate::forces::extra::{Each, Flow};
use crate::forces::history::Memory;
use crate::forces::{Around, DragLaw, Extra, Slip};
use crate::inspect::measure::View;
use crate::interpolate::{self, FluidVelocity};
use crate::linearise::{Kept, LEVEL, Part, Predicted, Predictions, linearise};
use crate::locate::{Locator, Lost};
use crate::map::{Mapping, Weights};
use crate::mesh::{Mesh, NONE};
use crate::particles::{Particles, Spare};
use crate::scheme::{Before, Cells, Scheme};
use crate::smooth::{Active, Classes, Direction, Field, Pinned, Scratch, Smoother, TimeAverage};
use crate::sums::{self, Sums, norm};
use crate::threads;
use std::time::Instant;
use thiserror::Error;

/// Fields of a cell: eight lanes, smoothed together.
pub type Lanes = [f64; 8];

/// What is computed and how; fixed for a run.
pub struct Setup {
    /// type-A drag law
    pub drag: &'static dyn DragLaw,
    /// prediction of the impulse
    pub scheme: &'static dyn Scheme,
    /// interpolation of the fluid velocity that enters the drag
    pub fluid_velocity: FluidVelocity,
    /// model B: drag divided by the voidage, no pressure-gradient force
    pub model_b: bool,
    /// false: the fluid does not feel the particles
    pub two_way: bool,
    /// −V G(∇p − ∇·τ) acts on the particles
    pub pressure_force: bool,
    /// acceleration of the Archimedes force −ρ_f V g, m/s2 (zero: off)
    pub archimedes: [f64; 3],
    /// mean pressure gradient acting on particles (model A), Pa/m
    pub mean_pressure_gradient: [f64; 3],
    /// acceleration of the particles' weight, m/s2: a known part of what moves them
    pub gravity: [f64; 3],
    /// ε_s U_s is formed each step: the fluid's continuity asks for it
    pub solids_flux: bool,
    /// ρ_f, kg/m3
    pub density: f64,
    /// ν, m2/s
    pub kinematic_viscosity: f64,
    /// coupling period Δt, s
    pub period: f64,
    /// smallest voidage let through; 0: stop the run at ε ≤ 0
    pub voidage_min: f64,
    /// leave particles outside the mesh out instead of stopping
    pub exclude_outside: bool,
    /// forces beside these, and the coarse-graining ratio
    pub extra: Extra,
    /// running mean of ε_s
    pub average: Option<TimeAverage>,
}

/// Why a step cannot be done.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum StepError {
    /// A particle has no host cell.
    #[error(
        "particle {id} at {position:?} m is outside the mesh{near}: keep the DEM box inside the CFD mesh (`voidage \
         check`), or set limits.outside = \"exclude\" to leave such particles out"
    )]
    Outside {
        /// particle id
        id: i64,
        /// m
        position: [f64; 3],
        /// nearest patch, if known
        near: String,
    },
    /// No fluid left in a cell.
    #[error(
        "voidage {voidage:.4} in cell {cell} (centre {centre:?} m): raise smooth.bandwidth, use larger cells, or set \
         limits.voidage_min to cap it (counted)"
    )]
    NoFluid {
        /// global cell id
        cell: i64,
        /// its centre, m
        centre: [f64; 3],
        /// ε
        voidage: f64,
    },
    /// The scheme needs what the DEM did not send.
    #[error(
        "coupling.scheme = \"{0}\" needs what the particles did in their last interval, and the DEM did not send it: \
         build the fix anew (`./setup build`), or set coupling.scheme = \"conservative\""
    )]
    NoHistory(&'static str),
    /// A force needs what the DEM did not send.
    #[error("{key} needs {what}, and the DEM did not send it: build the fix anew (`./setup build`)")]
    NotSent {
        /// key of the case
        key: &'static str,
        /// array
        what: &'static str,
    },
    /// A parcel of a type without ratio.
    #[error(
        "particle {id} is of type {kind}, for which dem.coarse_graining gives no ratio; add `{kind} = 1.0` to it"
    )]
    NoRatio {
        /// particle id
        id: i64,
        /// its type
        kind: i64,
    },
    /// A number that is not one.
    #[error(
        "{what} is not a finite number in cell {cell} (centre {centre:?} m): the fluid solver has gone wrong"
    )]
    NotFinite {
        /// which field
        what: &'static str,
        /// global cell id
        cell: i64,
        /// its centre, m
        centre: [f64; 3],
    },
}

/// Voidage and sources of the coming fluid step, by cell slot.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Sources {
    /// ε at the end of the step
    pub voidage: Vec<f64>,
    /// ε at its start
    pub voidage_old: Vec<f64>,
    /// ε_s U_s, m/s
    pub solids_flux: Vec<[f64; 3]>,
    /// momentum exchange coefficient, kg/(m3 s)
    pub sp: Vec<f64>,
    /// N/m3
    pub su: Vec<[f64; 3]>,
}

/// What drives the particles for the next interval, in the order `before_fluid` brought `Particles` into.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Drive {
    /// K, kg/s
    pub drag_coefficient: Vec<f64>,
    /// u, m/s
    pub velocity: Vec<[f64; 3]>,
    /// f, N
    pub force: Vec<[f64; 3]>,
    /// impulse charged to the fluid, N s
    pub charged: Vec<[f64; 3]>,
    /// added mass of each particle, kg; empty if it is C_a ρ V of the run, as the next ones if they are off
    pub added_mass: Vec<f64>,
    /// K_ω, N m s
    pub rotation_coefficient: Vec<f64>,
    /// W = ½ ∇ × U, rad/s
    pub rotation_rate: Vec<[f64; 3]>,
    /// to be kept with the particle
    pub memory: Vec<Memory>,
}

/// The fluid at the end of its step, by cell slot.
#[derive(Clone, Debug, Default)]
pub struct Fluid {
    /// U, m/s
    pub velocity: Vec<[f64; 3]>,
    /// ∇p of the last velocity correction, Pa/m; empty if not asked for
    pub pressure_gradient: Vec<[f64; 3]>,
    /// ∇·τ as put into the matrix, N/m3; empty if not asked for
    pub stress_divergence: Vec<[f64; 3]>,
}

/// Counts and errors of the step at hand.
#[derive(Clone, Copy, Debug, Default)]
#[allow(missing_docs)]
pub struct Facts {
    pub solid_fraction_max: f64,
    pub solid_volume_error: f64,
    pub solid_momentum_error: f64,
    pub capped_volume: f64,
    pub excluded: u64,
    pub positive_redone: u64,
}

/// Wall time of the stages of the last step, s.
#[derive(Clone, Copy, Debug, Default)]
#[allow(missing_docs)]
pub struct Seconds {
    pub locate: f64,
    pub arrange: f64,
    pub map: f64,
    pub solids: f64,
    pub forces: f64,
    pub sources: f64,
    pub gather: f64,
    pub drive: f64,
}

/// Particles whose drag is computed together.
#[derive(Default)]
struct Batch {
    slips: Vec<Slip>,
    /// u − v, m/s
    vectors: Vec<[f64; 3]>,
    /// ũ, m/s
    gathered: Vec<[f64; 3]>,
    /// d, m/s
    defects: Vec<[f64; 3]>,
    /// K, kg/s
    drag: Vec<f64>,
}

/// The coupling step of one run.
pub struct CouplingStep {
    /// The coupler's own copy of the mesh.
    pub mesh: Mesh,
    setup: Setup,
    locator: Locator,
    mapping: Box<dyn Mapping>,
    smoother: Box<dyn Smoother>,
    positive: Box<dyn Smoother>,
    scratch: Scratch,
    use_positive: bool,
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
    /// host cell of each particle
    hosts: Vec<u32>,
    order: Order,
    spare: Spare,
    /// places of the last exchange
    places: Places,
    /// while locating: hosts of the last exchange, in its order
    last_hosts: Vec<u32>,
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
/// Particles whose drag is computed together: their numbers stay in the nearest cache.
const BATCH: usize = 256;

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
            smoother,
            positive,
            scratch: Scratch::new(n),
            use_positive: false,
            weights: Weights::default(),
            active: Active::default(),
            classes: Classes::one(&mesh),
            wide: None,
            rows: Vec::new(),
            cells: Vec::new(),
            total: Vec::new(),
            read: Vec::new(),
            hosts: Vec::new(),
            order: Order::default(),
            spare: Spare::default(),
            places: Places::default(),
            last_hosts: Vec::new(),
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
        &*self.smoother
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
        self.sources.voidage_old.clone_from(&self.sources.voidage);
        self.use_positive = false;
        self.seconds.map = begin.elapsed().as_secs_f64();
        loop {
            let smoother = if self.use_positive { &self.positive } else { &self.smoother };
            smoother.plan(self.weights.reached(&self.order.occupied), &mut self.active);
            self.plan_cells();
            let fits = self.solids(p, first) && (first || self.sources_of(p));
            if fits || self.use_positive {
                break;
            }
            // same G for every pass of the step: redo all of it with the positive polynomial
            self.use_positive = true;
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
        let guess = p.id.iter().map(|id| self.last_hosts.get(self.places.of(*id) as usize).copied());
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
        p.arrange(list, &mut self.spare);
        self.last_hosts.clear();
        self.last_hosts.extend(list.iter().map(|i| self.hosts[*i as usize]));
        std::mem::swap(&mut self.hosts, &mut self.last_hosts);
        self.places.update(&p.id);
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
        let smoother = if self.use_positive { &mut self.positive } else { &mut self.smoother };
        smoother.apply(&mut self.work, &self.active, direction, &mut self.scratch);
    }

    /// Stage 4 (pass a): ε_s, ε_s U_s and, beside them, G of the last fluid velocity. False if an ε_s is negative.
    fn solids(&mut self, p: &Particles, first: bool) -> bool {
        let begin = Instant::now();
        let wanted = self.setup.scheme.wants_solids();
        let with_flux = self.setup.solids_flux || wanted;
        let around = self.setup.drag.looks_around();
        self.clear_work(true);
        // V, V U_s, V |U_s|
        let (mesh, extra) = (self.wide.as_ref().unwrap_or(&self.mesh), &self.setup.extra);
        let sums = self.weights.deposit(mesh, &self.order, &mut self.work, |i, sums: &mut Sums<5>| {
            let (v, u) = (p.volume(i), if with_flux { p.velocity[i] } else { [0.0; 3] });
            // of the primary particles
            let surface = if around { 0.5 * v / p.radius[i] * extra.ratio(&p.asked.kind, i) } else { 0.0 };
            let flux = u.map(|u| v * u);
            sums.add([v, flux[0], flux[1], flux[2], v * norm(u)]);
            [v, flux[0], flux[1], flux[2], 0.0, 0.0, 0.0, surface]
        });
        let [volume, momentum @ .., scale] = Sums::total(sums);
        if wanted {
            self.sum_classes();
            self.mapped = self.summed().to_vec();
        }
        self.smooth_work(Direction::Both);
        self.sum_classes();
        if wanted {
            self.smoothed = self.summed().to_vec();
        }
        let average = self.setup.average.filter(|_| !first);
        let other = self.wide.is_some() || self.setup.average.is_some();
        let (q, rows) = (&mut self.sources, if other { &self.cells } else { &self.active.rows });
        if self.filled != *rows {
            for j in self.filled.iter().map(|j| *j as usize) {
                (q.voidage[j], q.solids_flux[j], q.sp[j], q.su[j]) = (1.0, [0.0; 3], 0.0, [0.0; 3]);
            }
            self.filled.clone_from(rows);
        }
        let pieces = threads::rows(rows, self.mesh.len());
        let ends = || pieces.iter().map(|p| p.1.end);
        let parts =
            threads::cut(&mut q.voidage, ends()).into_iter().zip(threads::cut(&mut q.solids_flux, ends()));
        let lanes = if self.wide.is_some() { &self.total[..] } else { &self.work };
        let (volumes, floor, old) = (&self.mesh.volume, self.setup.voidage_min, &q.voidage_old);
        let mean = |j: usize| average.map_or(lanes[j][0], |a| a.next(lanes[j][0], 1.0 - old[j]));
        // Σ V of ε_s, of ε_s U_s and of what is capped; largest ε_s; is one negative
        let found = threads::map(pieces.iter().zip(parts).collect(), |((rows, slots), (voidage, flux))| {
            let (mut sums, mut most, mut negative) = (Sums::<5>::default(), 0.0f64, false);
            for j in rows.iter().map(|j| *j as usize) {
                let (l, v, solid) = (&lanes[j], volumes[j], mean(j));
                let (mut e, mut capped) = (1.0 - solid, 0.0);
                if e < floor && floor > 0.0 {
                    (capped, e) = ((floor - e) * v, floor);
                }
                negative |= solid < 0.0;
                most = most.max(solid);
                sums.add([solid * v, l[1] * v, l[2] * v, l[3] * v, capped]);
                voidage[j - slots.start] = e;
                flux[j - slots.start] = [l[1], l[2], l[3]];
            }
            (sums, most, negative)
        });
        if other {
            // what particles read: all classes together; the mean, with the diameters of now
            for row in &self.active.rows {
                let j = self.classes.cell(*row);
                let (now, solid) = (lanes[j], mean(j));
                let surface = if now[0] > 0.0 { now[7] * solid / now[0] } else { now[7] };
                self.read.push((*row, solid, surface));
            }
            for (row, solid, surface) in self.read.drain(..) {
                (self.work[row as usize][0], self.work[row as usize][7]) = (solid, surface);
            }
        }
        let [sum, flux @ .., capped] = Sums::total(found.iter().map(|f| f.0));
        self.facts.solid_fraction_max = found.iter().fold(0.0, |m, f| m.max(f.1));
        self.facts.capped_volume = capped;
        self.facts.solid_volume_error = ratio((sum - volume).abs(), volume);
        let gap = [0, 1, 2].map(|a| flux[a] - momentum[a]);
        self.facts.solid_momentum_error = ratio(norm(gap), scale);
        self.seconds.solids = begin.elapsed().as_secs_f64();
        !found.iter().any(|f| f.2)
    }

    /// The run stops where no fluid is left, unless capping was chosen.
    fn check_voidage(&self) -> Result<(), StepError> {
        let bad = |j: &&u32| {
            self.sources.voidage[**j as usize].is_nan() || self.sources.voidage[**j as usize] <= 0.0
        };
        let other = self.wide.is_some() || self.setup.average.is_some();
        match if other { &self.cells } else { &self.active.rows }.iter().find(bad) {
            None => Ok(()),
            Some(j) => {
                let j = *j as usize;
                let (cell, centre) = (self.mesh.ids[j], self.mesh.centre[j]);
                Err(StepError::NoFluid { cell, centre, voidage: self.sources.voidage[j] })
            }
        }
    }

    /// Stages 5 to 7 (pass b): drag, prediction, Sp and Su. False if an Sp is negative.
    fn sources_of(&mut self, p: &Particles) -> bool {
        let begin = Instant::now();
        self.predict(p, false);
        let predicted = Instant::now();
        self.seconds.forces = (predicted - begin).as_secs_f64();
        self.clear_work(false);
        let (q, period, scheme) = (&self.predicted, self.setup.period, self.setup.scheme);
        let ledger = |i: usize| if scheme.conservative() { p.ledger[i] } else { [0.0; 3] };
        let mesh = self.wide.as_ref().unwrap_or(&self.mesh);
        self.weights.deposit(mesh, &self.order, &mut self.work, |i, _: &mut ()| {
            linearise(&q.of(i), ledger(i), period)
        });
        self.smooth_work(Direction::Spread);
        self.sum_classes();
        let other = self.wide.is_some() || self.setup.average.is_some();
        let rows = if other { &self.cells } else { &self.active.rows };
        let pieces = threads::rows(rows, self.mesh.len());
        let ends = || pieces.iter().map(|p| p.1.end);
        let lanes = if self.wide.is_some() { &self.total[..] } else { &self.work };
        let (s, fluid) = (&mut self.sources, &self.fluid_velocity);
        let parts = threads::cut(&mut s.sp, ends()).into_iter().zip(threads::cut(&mut s.su, ends()));
        let positive = threads::map(pieces.iter().zip(parts).collect(), |((rows, slots), (sp, su))| {
            let mut positive = true;
            for j in rows.iter().map(|j| *j as usize) {
                let l = &lanes[j];
                positive &= l[0] >= 0.0 && l[4] >= 0.0;
                sp[j - slots.start] = l[0];
                su[j - slots.start] = [0, 1, 2].map(|a| l[1 + a] + LEVEL * l[0] * fluid[j][a]);
            }
            positive
        });
        let positive = positive.iter().all(|p| *p);
        if !scheme.conservative() {
            let pinned = self.pinned.as_mut().filter(|_| scheme.wants_solids());
            let cells = Cells {
                pinned: pinned.map(|p| p.solve(&self.mapped)),
                smoothed: lanes,
                solids: &self.smoothed,
                mapped: &self.mapped,
                fluid: &self.fluid_velocity,
            };
            scheme.sources(&cells, &mut self.sources.sp, &mut self.sources.su);
        }
        self.seconds.sources = predicted.elapsed().as_secs_f64();
        positive
    }

    /// Stages 5 and 6: K from the voidage at the particle and the fluid of the last step; C, B, d. In exchange 0
    /// the fluid stands in `gathered`, else it was smoothed in pass a.
    fn predict(&mut self, p: &Particles, first: bool) {
        let s = &self.setup;
        let plain = s.scheme.wholly_implicit();
        let kept = Kept {
            implicit: !plain,
            explicit: !plain || s.extra.forces(),
            defect: s.fluid_velocity != FluidVelocity::Gather,
        };
        let pieces = &self.order.pieces;
        let mut out = std::mem::take(&mut self.predicted);
        out.fit(p.len(), self.order.inside, kept);
        let parts = out.parts(pieces.iter().map(|p| p.particles.end));
        threads::map(pieces.iter().zip(parts).collect(), |(piece, mut out)| {
            let mut batch = Batch::default();
            for at in (0..out.len()).step_by(BATCH) {
                self.predict_batch(p, piece.particles.start, at, first, &mut batch, &mut out);
            }
        });
        self.predicted = out;
        let x = &self.setup.extra;
        if x.forces() || x.sends_added_mass() || x.sends_memory() {
            self.extra_forces(p);
        } else {
            self.extra.clear();
        }
    }

    /// `predict` for up to `BATCH` particles of a piece that begins at `begin`, from its entry `at` on.
    fn predict_batch(
        &self,
        p: &Particles,
        begin: usize,
        at: usize,
        first: bool,
        b: &mut Batch,
        out: &mut Part,
    ) {
        let s = &self.setup;
        let (count, begin) = (BATCH.min(out.len() - at), begin + at);
        let fluid = if first { 0 } else { FLUID };
        let around = s.drag.looks_around();
        b.slips.clear();
        b.vectors.clear();
        b.gathered.clear();
        b.defects.clear();
        b.drag.resize(count, 0.0);
        for k in 0..count {
            let i = begin + k;
            let l = self.weights.gather(&self.work, i);
            let voidage = (1.0 - l[0]).max(s.voidage_min.max(f64::MIN_POSITIVE));
            let g = if first { self.weights.gather(&self.gathered, i) } else { l };
            let gathered = [g[fluid], g[fluid + 1], g[fluid + 2]];
            let host = self.hosts[i] as usize;
            let u = interpolate::fluid_velocity(
                s.fluid_velocity,
                &self.mesh,
                &self.fluid_velocity,
                host,
                p.position[i],
                gathered,
            );
            let vector = [0, 1, 2].map(|a| u[a] - p.velocity[i][a]);
            b.defects.push([0, 1, 2].map(|a| u[a] - gathered[a]));
            let slip = Slip {
                diameter: 2.0 * p.radius[i] / s.extra.ratio(&p.asked.kind, i),
                voidage,
                speed: norm(vector),
                kinematic_viscosity: s.kinematic_viscosity,
                density: s.density,
            };
            if around {
                let (sauter_diameter, cell_volume) = (l[0] / l[7], self.mesh.volume[host]);
                let around = Around { sauter_diameter, cell_volume };
                b.drag[k] = s.drag.drag_coefficient_in(&slip, &around);
            }
            b.slips.push(slip);
            b.vectors.push(vector);
            b.gathered.push(gathered);
        }
        if !around {
            s.drag.coefficients(&b.slips, &mut b.drag);
        }
        for k in 0..count {
            let i = begin + k;
            let ratio = s.extra.ratio(&p.asked.kind, i);
            let parcel = ratio * ratio * ratio;
            let share = if s.model_b { parcel / b.slips[k].voidage } else { parcel };
            let (v, inertia) = (p.velocity[i], p.mass[i]);
            let last = p.history.last(i, v, inertia, s.gravity, s.period);
            let drag_coefficient = b.drag[k] * share;
            let before = Before { drag_coefficient, slip: b.vectors[k], inertia, period: s.period, last };
            out.set(at + k, &Predicted::new(s.scheme, &before, b.defects[k], b.gathered[k]));
        }
    }

    /// Lift, added mass and history with the fluid of the last step: part of the predicted impulse and of what drives the
    /// particle alike, so they leave nothing in the ledger.
    fn extra_forces(&mut self, p: &Particles) {
        let (s, u) = (&self.setup, &self.fluid_velocity);
        self.extra.clear();
        self.extra.resize(p.len(), [0.0; 3]);
        let flow = Flow {
            mesh: &self.mesh,
            velocity: u,
            before: &self.fluid_before,
            period: s.period,
            density: s.density,
            kinematic_viscosity: s.kinematic_viscosity,
        };
        let (inside, d) = (self.order.inside, &mut self.drive);
        let added = if s.extra.sends_added_mass() { p.len() } else { 0 };
        let memory = if s.extra.history { p.asked.memory.len() } else { p.len() };
        d.added_mass.clear();
        d.added_mass.resize(added, 0.0);
        d.memory.clear();
        d.memory.resize(if s.extra.sends_memory() { memory } else { 0 }, Memory::default());
        if !s.extra.forces() {
            // all zero: kept ready, and off
            return;
        }
        let coefficient = |i: usize| {
            let solid = if s.extra.felderhof { self.weights.gather(&self.work, i)[0] } else { 0.0 };
            s.extra.coefficient(solid, p.mass[i] / (p.volume(i) * s.density))
        };
        for (i, m) in d.added_mass.iter_mut().enumerate().take(inside) {
            *m = coefficient(i) * s.density * p.volume(i);
        }
        let each = |i: usize| Each {
            radius: p.radius[i],
            ratio: s.extra.ratio(&p.asked.kind, i),
            slip: [0, 1, 2].map(|a| u[self.hosts[i] as usize][a] - p.velocity[i][a]),
            added_mass: coefficient(i),
        };
        let hosts = &self.hosts[..inside];
        s.extra.compute(&flow, hosts, each, &p.asked.memory, &mut self.extra, &mut d.memory);
        for i in 0..inside {
            self.predicted.add(i, self.extra[i]);
        }
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

    /// What turns the particles: the new fluid's rotation in their host cells.
    fn torque(&mut self, p: &Particles) {
        let (s, d) = (&self.setup, &mut self.drive);
        d.rotation_coefficient.clear();
        d.rotation_coefficient.resize(p.len(), 0.0);
        d.rotation_rate.clear();
        d.rotation_rate.resize(p.len(), [0.0; 3]);
        let (mut last, mut g) = (NONE, [[0.0; 3]; 3]);
        for (i, host) in self.hosts[..self.order.inside].iter().enumerate() {
            if *host != last {
                (last, g) = (*host, interpolate::gradient(&self.mesh, &self.fluid_velocity, *host as usize));
            }
            let ratio = s.extra.ratio(&p.asked.kind, i);
            let fluid = (s.kinematic_viscosity, s.density);
            (d.rotation_coefficient[i], d.rotation_rate[i]) =
                Extra::torque(fluid, &g, p.radius[i], ratio, p.asked.spin[i]);
        }
    }

    /// The replies, and the sums over them: old ledger, charged, external impulses, |charged + ledger|.
    fn drive_particles(&mut self, p: &Particles, first: bool) {
        let (s, n, inside) = (&self.setup, p.len(), self.order.inside);
        let solid = |j: usize| 1.0 - self.sources.voidage[j];
        let stress = s
            .extra
            .stress
            .map(|t| (0..self.mesh.len()).map(|j| [t.stress(solid(j)), 0.0, 0.0]).collect::<Vec<_>>());
        let conservative = s.scheme.conservative();
        let ledger = |i: usize| if conservative { p.ledger[i] } else { [0.0; 3] };
        let d = &mut self.drive;
        d.drag_coefficient.resize(n, 0.0);
        for list in [&mut d.velocity, &mut d.force, &mut d.charged] {
            list.resize(n, [0.0; 3]);
        }
        let pieces = &self.order.pieces;
        let ends = || pieces.iter().map(|p| p.particles.end);
        let coefficient = threads::cut(&mut d.drag_coefficient, ends());
        let [velocity, force, charged] =
            [&mut d.velocity, &mut d.force, &mut d.charged].map(|v| threads::cut(v, ends()));
        let parts = coefficient.into_iter().zip(velocity).zip(force).zip(charged);
        let sums =
            threads::map(pieces.iter().zip(parts).collect(), |(piece, (((k_of, u_of), f_of), j_of))| {
                let mut sums = Sums::<10>::default();
                for (at, i) in piece.particles.clone().enumerate() {
                    let (g, q, v) =
                        (self.weights.gather(&self.gathered, i), self.predicted.of(i), p.volume(i));
                    let u = [0, 1, 2].map(|a| g[a] + q.defect[a]);
                    let mut outer =
                        [0, 1, 2].map(|a| -v * (s.density * s.archimedes[a] + s.mean_pressure_gradient[a]));
                    if let Some(tau) = &stress {
                        let host = self.hosts[i] as usize;
                        let f = Extra::stress_force(&self.mesh, tau, host, v, solid(host));
                        (0..3).for_each(|a| outer[a] += f[a]);
                    }
                    let inner = if s.pressure_force { [3, 4, 5].map(|a| -v * g[a]) } else { [0.0; 3] };
                    let force = [0, 1, 2].map(|a| inner[a] + outer[a]);
                    let slip = [0, 1, 2].map(|a| u[a] - p.velocity[i][a]);
                    let external = outer.map(|x| s.period * x);
                    // exchange 0: no fluid step bears the interval, the ledger does; but not what has no reaction
                    let charged = if first {
                        external
                    } else {
                        [0, 1, 2].map(|a| s.period * (q.implicit * slip[a] + q.explicit[a] + force[a]))
                    };
                    let (j, l, e) = (charged, ledger(i), external);
                    let size = norm([0, 1, 2].map(|a| j[a] + l[a]));
                    sums.add([j[0], j[1], j[2], l[0], l[1], l[2], e[0], e[1], e[2], size]);
                    let extra = self.extra.get(i).copied().unwrap_or_default();
                    k_of[at] = q.drag_coefficient;
                    u_of[at] = u;
                    f_of[at] = [0, 1, 2].map(|a| force[a] + extra[a]);
                    j_of[at] = charged;
                }
                sums
            });
        let mut outside = Sums::<10>::default();
        for i in inside..n {
            // its ledger waits until it is back: L = taken − charged
            let l = ledger(i);
            (d.drag_coefficient[i], d.velocity[i], d.force[i]) = (0.0, [0.0; 3], [0.0; 3]);
            d.charged[i] = l.map(|l| -l);
            outside.add([-l[0], -l[1], -l[2], l[0], l[1], l[2], 0.0, 0.0, 0.0, 0.0]);
        }
        let t = Sums::total(sums.into_iter().chain([outside]));
        let at = |k: usize| [t[k], t[k + 1], t[k + 2]];
        self.books =
            Books { charged: at(0), old_ledger: at(3), external: at(6), scale: t[9], reaction: [0.0; 3] };
    }

    /// Forms ε_s U_s for output where no stage needs it.
    pub fn form_solids_flux(&mut self, p: &Particles) {
        if self.setup.solids_flux {
            return;
        }
        let mut lanes = vec![[0.0; 8]; self.classes.rows()];
        let mesh = self.wide.as_ref().unwrap_or(&self.mesh);
        self.weights.deposit(mesh, &self.order, &mut lanes, |i, _: &mut ()| {
            let (v, u) = (p.volume(i), p.velocity[i]);
            [v * u[0], v * u[1], v * u[2], 0.0, 0.0, 0.0, 0.0, 0.0]
        });
        let smoother = if self.use_positive { &mut self.positive } else { &mut self.smoother };
        smoother.apply(&mut lanes, &self.active, Direction::Spread, &mut self.scratch);
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

    fn take_fluid(&mut self, fluid: &Fluid) -> Result<(), StepError> {
        let finite = |field: &Vec<[f64; 3]>| {
            let chunks = field.as_flattened().chunks(24 * 1024).collect();
            threads::map(chunks, sums::finite).iter().all(|f| *f)
        };
        if ![&fluid.velocity, &fluid.pressure_gradient, &fluid.stress_divergence].into_iter().all(finite) {
            return Err(self.not_finite(fluid));
        }
        self.fluid_velocity.clone_from(&fluid.velocity);
        let grad = |field: &[[f64; 3]], j: usize| field.get(j).copied().unwrap_or_default();
        let pieces = threads::rows(&self.active.rows, self.classes.rows());
        let parts = threads::cut(&mut self.gathered, pieces.iter().map(|p| p.1.end));
        let classes = &self.classes;
        threads::map(pieces.into_iter().zip(parts).collect(), |((rows, slots), gathered)| {
            for row in rows {
                let j = classes.cell(*row);
                let u = fluid.velocity[j];
                let (p, t) = (grad(&fluid.pressure_gradient, j), grad(&fluid.stress_divergence, j));
                gathered[*row as usize - slots.start] =
                    [u[0], u[1], u[2], p[0] - t[0], p[1] - t[1], p[2] - t[2], 0.0, 0.0];
            }
        });
        let smoother = if self.use_positive { &mut self.positive } else { &mut self.smoother };
        smoother.apply(&mut self.gathered, &self.active, Direction::Gather, &mut self.scratch);
        Ok(())
    }

    #[cold]
    fn not_finite(&self, fluid: &Fluid) -> StepError {
        let bad = |v: &[f64; 3]| !v.iter().all(|x| x.is_finite());
        let fields = [
            ("the fluid velocity", &fluid.velocity),
            ("the pressure gradient", &fluid.pressure_gradient),
            ("the stress divergence", &fluid.stress_divergence),
        ];
        let found = fields.iter().find_map(|(what, f)| f.iter().position(bad).map(|j| (*what, j)));
        let (what, j) = found.unwrap_or(("the fluid", 0));
        StepError::NotFinite { what, cell: self.mesh.ids[j], centre: self.mesh.centre[j] }
    }
}
