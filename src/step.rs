// SPDX-License-Identifier: MIT OR Apache-2.0
//! One coupling step, stage by stage (design §2); the same lines run live and in replay.
//!
//! `before_fluid`: particles of exchange k in, voidage and sources of fluid step k out (stages 2 to 7).
//! `after_fluid`: the fluid's answer in, what drives the particles out (stage 9).
//! Units SI. Does not know processes or files; times the stages; owns scratch memory and nothing that changes
//! results, except the last fluid velocity, which is part of the exchange.

use crate::arrange::{Order, Places};
use crate::balance::{Books, ratio};
use crate::forces::extra::Flow;
use crate::forces::{Around, DragLaw, Extra, Slip};
use crate::interpolate::{self, FluidVelocity};
use crate::linearise::{LEVEL, Predicted, linearise};
use crate::locate::{Locator, Lost};
use crate::map::{Mapping, Weights};
use crate::mesh::{Mesh, NONE};
use crate::particles::Particles;
use crate::scheme::{Before, Cells, Scheme};
use crate::smooth::{Active, Direction, Field, Scratch, Smoother};
use crate::sums::{Sum, norm};
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

/// What drives the particles for the next interval, in the order of `Particles`.
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
    /// host cell of each particle, in the order of the table
    hosts: Vec<u32>,
    order: Order,
    /// places and hosts of the last exchange, in its order
    places: Places,
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
    predicted: Vec<Predicted>,
    /// explicit forces with a reaction (N), empty if there are none
    extra: Vec<[f64; 3]>,
    /// fluid velocity one step before the last, for the added mass
    fluid_before: Vec<[f64; 3]>,
    /// ε_s and ε_s U_s as mapped and as smoothed, for schemes that want them
    mapped: Vec<Lanes>,
    smoothed: Vec<Lanes>,
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
            smoother,
            positive,
            scratch: Scratch::new(n),
            use_positive: false,
            weights: Weights::default(),
            active: Active::default(),
            hosts: Vec::new(),
            order: Order::default(),
            places: Places::default(),
            last_hosts: Vec::new(),
            fluid_velocity: vec![[0.0; 3]; n],
            gathered: Field::zero(n),
            work: Field::zero(n),
            dirty: Vec::new(),
            filled: Vec::new(),
            predicted: Vec::new(),
            extra: Vec::new(),
            fluid_before: Vec::new(),
            mapped: Vec::new(),
            smoothed: Vec::new(),
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

    /// Puts the voidage and the fluid velocity at the start of the coming step (restart).
    pub fn restore(&mut self, voidage: &[f64], fluid_velocity: &[[f64; 3]]) {
        self.sources.voidage.copy_from_slice(voidage);
        self.fluid_velocity.copy_from_slice(fluid_velocity);
        self.filled = (0..self.mesh.len() as u32).collect();
    }

    /// Where the particles of this exchange lie; those of the next one are best stored alike.
    pub fn places(&self) -> &Places {
        &self.places
    }

    /// Stages 2 to 7. `first`: exchange 0, where there is no fluid step to come and nothing is charged.
    pub fn before_fluid(&mut self, p: &mut Particles, first: bool) -> Result<(), StepError> {
        self.facts = Facts::default();
        if self.setup.scheme.wants_history() && p.history.drag_coefficient.len() != p.len() {
            return Err(StepError::NoHistory(self.setup.scheme.name()));
        }
        self.locate(p)?;
        let begin = Instant::now();
        self.mapping.weights(&self.mesh, &p.position, &p.radius, &self.hosts, &mut self.weights);
        self.sources.voidage_old.clone_from(&self.sources.voidage);
        self.use_positive = false;
        self.seconds.map = begin.elapsed().as_secs_f64();
        loop {
            let smoother = if self.use_positive { &self.positive } else { &self.smoother };
            smoother.plan(self.weights.reached(&self.order.occupied), &mut self.active);
            let fits = self.solids(p) && (first || self.sources_of(p));
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

    /// Stage 2: host cells; last hosts are only a guess where to look first.
    fn locate(&mut self, p: &mut Particles) -> Result<(), StepError> {
        let begin = Instant::now();
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
        self.order.update(self.mesh.len(), &p.id, &self.hosts);
        let ids: Vec<i64> = self.order.list.iter().map(|i| p.id[*i as usize]).collect();
        self.places.update(&ids);
        self.last_hosts.clear();
        self.last_hosts.extend(self.order.list.iter().map(|i| self.hosts[*i as usize]));
        self.seconds.locate = (located - begin).as_secs_f64();
        self.seconds.arrange = located.elapsed().as_secs_f64();
        Ok(())
    }

    /// `work` all zero, its active rows about to be written.
    fn clean_work(&mut self) {
        self.dirty.iter().for_each(|j| self.work[*j as usize] = [0.0; 8]);
        self.dirty.clone_from(&self.active.rows);
    }

    fn smooth_work(&mut self, direction: Direction) {
        let smoother = if self.use_positive { &mut self.positive } else { &mut self.smoother };
        smoother.apply(&mut self.work, &self.active, direction, &mut self.scratch);
    }

    /// Stage 4 (pass a): ε_s, ε_s U_s and, beside them, G of the last fluid velocity. False if an ε_s is negative.
    fn solids(&mut self, p: &Particles) -> bool {
        let begin = Instant::now();
        self.clean_work();
        let wanted = self.setup.scheme.wants_solids();
        let with_flux = self.setup.solids_flux || wanted;
        let (mut volume, mut scale, mut momentum) = (Sum::default(), Sum::default(), [Sum::default(); 3]);
        let around = self.setup.drag.looks_around();
        self.weights.deposit(&self.mesh, &self.order.list, &mut self.work, |i| {
            let (v, u) = (p.volume(i), if with_flux { p.velocity[i] } else { [0.0; 3] });
            volume.add(v);
            scale.add(v * norm(u));
            (0..3).for_each(|a| momentum[a].add(v * u[a]));
            let surface = if around { 0.5 * v / p.radius[i] } else { 0.0 };
            [v, v * u[0], v * u[1], v * u[2], 0.0, 0.0, 0.0, surface]
        });
        if wanted {
            self.mapped = self.work.to_vec();
        }
        for j in self.active.rows.iter().map(|j| *j as usize) {
            self.work[j][FLUID..FLUID + 3].copy_from_slice(&self.fluid_velocity[j]);
        }
        self.smooth_work(Direction::Both);
        if wanted {
            self.smoothed = self.work.to_vec();
        }
        let q = &mut self.sources;
        for j in self.filled.drain(..).map(|j| j as usize) {
            (q.voidage[j], q.solids_flux[j], q.sp[j], q.su[j]) = (1.0, [0.0; 3], 0.0, [0.0; 3]);
        }
        self.filled.clone_from(&self.active.rows);
        let (mut found, mut flux) = (Sum::default(), [Sum::default(); 3]);
        let (mut negative, floor) = (false, self.setup.voidage_min);
        self.facts.solid_fraction_max = 0.0;
        self.facts.capped_volume = 0.0;
        for j in self.active.rows.iter().map(|j| *j as usize) {
            let (l, v) = (&self.work[j], self.mesh.volume[j]);
            negative |= l[0] < 0.0;
            found.add(l[0] * v);
            (0..3).for_each(|a| flux[a].add(l[1 + a] * v));
            let fact = &mut self.facts;
            fact.solid_fraction_max = fact.solid_fraction_max.max(l[0]);
            let mut e = 1.0 - l[0];
            if e < floor && floor > 0.0 {
                fact.capped_volume += (floor - e) * v;
                e = floor;
            }
            q.voidage[j] = e;
            q.solids_flux[j] = [l[1], l[2], l[3]];
        }
        let (total, scale) = (volume.value(), scale.value());
        self.facts.solid_volume_error = ratio((found.value() - total).abs(), total);
        let gap = [0, 1, 2].map(|a| flux[a].value() - momentum[a].value());
        self.facts.solid_momentum_error = ratio(norm(gap), scale);
        self.seconds.solids = begin.elapsed().as_secs_f64();
        !negative
    }

    /// The run stops where no fluid is left, unless capping was chosen.
    fn check_voidage(&self) -> Result<(), StepError> {
        let bad = |j: &&u32| {
            self.sources.voidage[**j as usize].is_nan() || self.sources.voidage[**j as usize] <= 0.0
        };
        match self.active.rows.iter().find(bad) {
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
        self.clean_work();
        let (q, period, scheme) = (&self.predicted, self.setup.period, self.setup.scheme);
        let ledger = |i: usize| if scheme.conservative() { p.ledger[i] } else { [0.0; 3] };
        self.weights
            .deposit(&self.mesh, &self.order.list, &mut self.work, |i| linearise(&q[i], ledger(i), period));
        self.smooth_work(Direction::Spread);
        let mut positive = true;
        for j in self.active.rows.iter().map(|j| *j as usize) {
            let l = &self.work[j];
            positive &= l[0] >= 0.0 && l[4] >= 0.0;
            self.sources.sp[j] = l[0];
            self.sources.su[j] = [0, 1, 2].map(|a| l[1 + a] + LEVEL * l[0] * self.fluid_velocity[j][a]);
        }
        if !scheme.conservative() {
            let cells = Cells {
                smoothed: &self.work,
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
        let (around, ratio) = (s.drag.looks_around(), s.extra.ratio);
        let parcel = ratio * ratio * ratio;
        self.predicted.clear();
        self.predicted.resize(p.len(), Predicted::default());
        for i in self.order.list.iter().map(|i| *i as usize) {
            let l = self.weights.gather(&self.work, i);
            let voidage = (1.0 - l[0]).max(s.voidage_min.max(f64::MIN_POSITIVE));
            let g = if first { self.weights.gather(&self.gathered, i) } else { l };
            let at = if first { 0 } else { FLUID };
            let gathered = [g[at], g[at + 1], g[at + 2]];
            let host = self.hosts[i] as usize;
            let u = interpolate::fluid_velocity(
                s.fluid_velocity,
                &self.mesh,
                &self.fluid_velocity,
                host,
                p.position[i],
                gathered,
            );
            let slip = [0, 1, 2].map(|a| u[a] - p.velocity[i][a]);
            let at = Slip {
                diameter: 2.0 * p.radius[i] / ratio,
                voidage,
                speed: norm(slip),
                kinematic_viscosity: s.kinematic_viscosity,
                density: s.density,
            };
            let mut k = parcel
                * if around {
                    let (sauter_diameter, cell_volume) = (l[0] / (l[7] * ratio), self.mesh.volume[host]);
                    s.drag.drag_coefficient_in(&at, &Around { sauter_diameter, cell_volume })
                } else {
                    s.drag.drag_coefficient(&at)
                };
            if s.model_b {
                k /= voidage;
            }
            let defect = [0, 1, 2].map(|a| u[a] - gathered[a]);
            let (v, inertia) = (p.velocity[i], p.mass[i]);
            let last = p.history.last(i, v, inertia, s.gravity, s.period);
            let before = Before { drag_coefficient: k, slip, inertia, period: s.period, last };
            self.predicted[i] = Predicted::new(s.scheme, &before, defect, gathered);
        }
        if s.extra.forces() {
            self.extra_forces(p);
        }
    }

    /// Lift and added mass with the fluid of the last step: part of the predicted impulse and of what drives the
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
        let slip = |i: usize| [0, 1, 2].map(|a| u[self.hosts[i] as usize][a] - p.velocity[i][a]);
        s.extra.compute(&flow, &self.order.list, &self.hosts, &p.radius, slip, &mut self.extra);
        for i in self.order.list.iter().map(|i| *i as usize) {
            (0..3).for_each(|a| self.predicted[i].explicit[a] += self.extra[i][a]);
        }
    }

    /// Stage 9 (pass c): the new fluid smoothed by the same G, read at the particles; the impulse charged.
    pub fn after_fluid(&mut self, p: &Particles, fluid: &Fluid, first: bool) -> Result<(), StepError> {
        let begin = Instant::now();
        if self.setup.extra.added_mass > 0.0 && !first {
            self.fluid_before.clone_from(&self.fluid_velocity);
        }
        self.take_fluid(fluid)?;
        let gathered = Instant::now();
        self.seconds.gather = (gathered - begin).as_secs_f64();
        if first {
            // no fluid step lies behind: K is computed with the fluid as it stands, nothing is charged
            self.predict(p, true);
        }
        let s = &self.setup;
        let n = p.len();
        let d = &mut self.drive;
        d.drag_coefficient.clear();
        d.drag_coefficient.resize(n, 0.0);
        for list in [&mut d.velocity, &mut d.force, &mut d.charged] {
            list.clear();
            list.resize(n, [0.0; 3]);
        }
        let solid = |j: usize| 1.0 - self.sources.voidage[j];
        let stress = s
            .extra
            .stress
            .map(|t| (0..self.mesh.len()).map(|j| [t.stress(solid(j)), 0.0, 0.0]).collect::<Vec<_>>());
        let conservative = s.scheme.conservative();
        let ledger = |i: usize| if conservative { p.ledger[i] } else { [0.0; 3] };
        let (mut scale, mut sums) = (Sum::default(), [[Sum::default(); 3]; 3]);
        for i in self.order.list.iter().map(|i| *i as usize) {
            let (g, q, v) = (self.weights.gather(&self.gathered, i), &self.predicted[i], p.volume(i));
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
            let old = ledger(i);
            scale.add(norm([0, 1, 2].map(|a| charged[a] + old[a])));
            for a in 0..3 {
                sums[0][a].add(charged[a]);
                sums[1][a].add(old[a]);
                sums[2][a].add(external[a]);
            }
            d.drag_coefficient[i] = q.drag_coefficient;
            d.velocity[i] = u;
            let extra = self.extra.get(i).copied().unwrap_or_default();
            d.force[i] = [0, 1, 2].map(|a| force[a] + extra[a]);
            d.charged[i] = charged;
        }
        for i in (0..n).filter(|i| self.hosts[*i] == NONE) {
            // its ledger waits until it is back: L = taken − charged
            d.charged[i] = ledger(i).map(|l| -l);
            for a in 0..3 {
                sums[0][a].add(d.charged[i][a]);
                sums[1][a].add(ledger(i)[a]);
            }
        }
        let [charged, old_ledger, external] = sums.map(|s| s.map(Sum::value));
        self.books = Books { charged, old_ledger, external, scale: scale.value(), reaction: [0.0; 3] };
        self.seconds.drive = gathered.elapsed().as_secs_f64();
        Ok(())
    }

    /// Forms ε_s U_s for output where no stage needs it.
    pub fn form_solids_flux(&mut self, p: &Particles) {
        if self.setup.solids_flux {
            return;
        }
        let mut lanes = vec![[0.0; 8]; self.mesh.len()];
        self.weights.deposit(&self.mesh, &self.order.list, &mut lanes, |i| {
            let (v, u) = (p.volume(i), p.velocity[i]);
            [v * u[0], v * u[1], v * u[2], 0.0, 0.0, 0.0, 0.0, 0.0]
        });
        let smoother = if self.use_positive { &mut self.positive } else { &mut self.smoother };
        smoother.apply(&mut lanes, &self.active, Direction::Spread, &mut self.scratch);
        self.sources.solids_flux.iter_mut().zip(&lanes).for_each(|(s, l)| *s = [l[0], l[1], l[2]]);
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
        let grad = |field: &[[f64; 3]], j: usize| field.get(j).copied().unwrap_or_default();
        let mut whole = true;
        for (j, u) in fluid.velocity.iter().enumerate() {
            let (p, t) = (grad(&fluid.pressure_gradient, j), grad(&fluid.stress_divergence, j));
            // any NaN or infinity makes this NaN
            let test = u.iter().chain(&p).chain(&t).map(|x| x * 0.0).sum::<f64>();
            whole &= test == 0.0;
        }
        if !whole {
            return Err(self.not_finite(fluid));
        }
        self.fluid_velocity.clone_from(&fluid.velocity);
        for j in self.active.rows.iter().map(|j| *j as usize) {
            let u = fluid.velocity[j];
            let (p, t) = (grad(&fluid.pressure_gradient, j), grad(&fluid.stress_divergence, j));
            self.gathered[j] = [u[0], u[1], u[2], p[0] - t[0], p[1] - t[1], p[2] - t[2], 0.0, 0.0];
        }
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
