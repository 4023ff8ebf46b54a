// SPDX-License-Identifier: MIT OR Apache-2.0
//! One coupling step, stage by stage (design §2); the same lines run live and in replay.
//!
//! `before_fluid`: particles of exchange k in, voidage and sources of fluid step k out (stages 2 to 7).
//! `after_fluid`: the fluid's answer in, what drives the particles out (stage 9).
//! Units SI. Does not know processes, files or clocks; owns scratch memory and nothing that changes results,
//! except the fluid gathered last, which is part of the exchange.

use crate::balance::{Books, ratio};
use crate::forces::{DragLaw, Slip};
use crate::interpolate::{self, FluidVelocity};
use crate::linearise::{Predicted, linearise};
use crate::locate::{Locator, Lost};
use crate::map::{Mapping, Weights};
use crate::mesh::Mesh;
use crate::particles::Particles;
use crate::scheme::{Before, Cells, Scheme};
use crate::smooth::{Active, Smoother};
use crate::sums::{norm, sum, sum3};
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

/// The coupling step of one run.
pub struct CouplingStep {
    /// The coupler's own copy of the mesh.
    pub mesh: Mesh,
    setup: Setup,
    locator: Locator,
    mapping: Box<dyn Mapping>,
    smoother: Box<dyn Smoother>,
    positive: Box<dyn Smoother>,
    weights: Weights,
    active: Active,
    hosts: Vec<u32>,
    host_ids: Vec<i64>,
    coupled: Vec<bool>,
    /// raw fluid velocity (lanes 0–2) for host-cell and linear interpolation
    fluid: Vec<Lanes>,
    /// G of fluid velocity (0–2) and of ∇p − ∇·τ (3–5)
    gathered: Vec<Lanes>,
    predicted: Vec<Predicted>,
    lanes: Vec<Lanes>,
    lanes_b: Vec<Lanes>,
    /// ε_s and ε_s U_s as mapped, for schemes that want them
    mapped: Vec<Lanes>,
    use_positive: bool,
    /// Voidage and sources of this step.
    pub sources: Sources,
    /// Reply to the DEM.
    pub drive: Drive,
    /// Counts and errors.
    pub facts: Facts,
    /// Action–reaction books.
    pub books: Books,
}

impl CouplingStep {
    /// Takes the mesh and the methods; `positive` is the smoother used when a result would turn negative.
    pub fn new(
        mesh: Mesh,
        setup: Setup,
        mapping: Box<dyn Mapping>,
        smoother: Box<dyn Smoother>,
        positive: Box<dyn Smoother>,
    ) -> Self {
        let (n, locator) = (mesh.ids.len(), Locator::new(&mesh));
        let zero = vec![[0.0; 8]; n];
        Self {
            locator,
            setup,
            mapping,
            smoother,
            positive,
            weights: Weights::default(),
            active: Active::default(),
            hosts: Vec::new(),
            host_ids: Vec::new(),
            coupled: Vec::new(),
            fluid: zero.clone(),
            gathered: zero.clone(),
            predicted: Vec::new(),
            lanes: zero.clone(),
            lanes_b: zero,
            mapped: Vec::new(),
            use_positive: false,
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
            mesh,
        }
    }

    /// Puts the voidage at the start of the coming step (restart).
    pub fn restore_voidage(&mut self, voidage: &[f64]) {
        self.sources.voidage.copy_from_slice(voidage);
    }

    /// Stages 2 to 7. `first`: exchange 0, where there is no fluid step to come and nothing is charged.
    pub fn before_fluid(&mut self, p: &mut Particles, first: bool) -> Result<(), StepError> {
        self.facts = Facts { positive_redone: 0, excluded: 0, ..Facts::default() };
        if self.setup.scheme.wants_history() && p.history.drag_coefficient.len() != p.len() {
            return Err(StepError::NoHistory(self.setup.scheme.name()));
        }
        self.locate(p)?;
        self.mapping.weights(&self.mesh, &p.position, &p.radius, &self.hosts, &mut self.weights);
        std::mem::swap(&mut self.sources.voidage, &mut self.sources.voidage_old);
        self.use_positive = false;
        loop {
            let degree = self.smoother().degree();
            self.active.update(&self.mesh, &self.weights.cell, degree);
            self.smooth_solids(p);
            let fits = self.lanes.iter().all(|l| l[0] >= 0.0) && (first || self.sources_of(p));
            if fits || self.use_positive {
                break;
            }
            // same G for every pass of the step: redo all of it with the positive polynomial
            self.use_positive = true;
            self.facts.positive_redone = 1;
        }
        self.voidage(first)
    }

    /// Stage 2: host cells; last hosts are only a guess where to look first.
    fn locate(&mut self, p: &mut Particles) -> Result<(), StepError> {
        if self.host_ids != p.id {
            let mut known = self.host_ids.iter().zip(&self.hosts).peekable();
            let guess = p.id.iter().map(|id| {
                while known.peek().is_some_and(|k| k.0 < id) {
                    known.next();
                }
                known.peek().filter(|k| k.0 == id).map_or(u32::MAX, |k| *k.1)
            });
            self.hosts = guess.collect();
            self.host_ids.clone_from(&p.id);
        }
        self.coupled.clear();
        self.coupled.resize(p.len(), true);
        let lost =
            self.locator.locate(&self.mesh, &mut p.position, &mut self.hosts).err().unwrap_or_default();
        for Lost { index, position, near } in lost {
            if !self.setup.exclude_outside {
                let near = near.map(|n| format!(" (nearest patch {n})")).unwrap_or_default();
                return Err(StepError::Outside { id: p.id[index], position, near });
            }
            self.coupled[index] = false;
            self.hosts[index] = u32::MAX;
            self.facts.excluded += 1;
        }
        Ok(())
    }

    fn smoother(&mut self) -> &mut dyn Smoother {
        if self.use_positive { &mut *self.positive } else { &mut *self.smoother }
    }

    fn smooth(&mut self, lanes: &mut [Lanes]) {
        let smoother = if self.use_positive { &mut self.positive } else { &mut self.smoother };
        smoother.apply(lanes, &self.active);
    }

    /// Stage 4 (pass a): ε_s in lane 0, ε_s U_s in lanes 1–3.
    fn smooth_solids(&mut self, p: &Particles) {
        let scheme = self.setup.scheme;
        let flux = self.setup.solids_flux || scheme.wants_solids();
        let mut lanes = std::mem::take(&mut self.lanes);
        lanes.fill([0.0; 8]);
        self.weights.deposit(&self.mesh, &mut lanes, |i| {
            let (v, u) = (p.volume(i), if flux { p.velocity[i] } else { [0.0; 3] });
            [v, v * u[0], v * u[1], v * u[2], 0.0, 0.0, 0.0, 0.0]
        });
        if scheme.wants_solids() {
            self.mapped.clone_from(&lanes);
        }
        self.smooth(&mut lanes);
        self.lanes = lanes;
        let total = sum((0..p.len()).filter(|i| self.coupled[*i]).map(|i| p.volume(i)));
        let found = sum(self.lanes.iter().zip(&self.mesh.volume).map(|(l, v)| l[0] * v));
        self.facts.solid_volume_error = ratio((found - total).abs(), total);
        if !flux {
            return;
        }
        let part = |i: usize| p.velocity[i].map(|u| p.volume(i) * u);
        let total = sum3((0..p.len()).filter(|i| self.coupled[*i]).map(part));
        let found =
            sum3(self.lanes.iter().zip(&self.mesh.volume).map(|(l, v)| [l[1] * v, l[2] * v, l[3] * v]));
        let scale = sum((0..p.len()).filter(|i| self.coupled[*i]).map(|i| norm(part(i))));
        let gap = [0, 1, 2].map(|a| found[a] - total[a]);
        self.facts.solid_momentum_error = ratio(norm(gap), scale);
    }

    /// ε from ε_s; the run stops where no fluid is left, unless capping was chosen.
    fn voidage(&mut self, first: bool) -> Result<(), StepError> {
        let floor = self.setup.voidage_min;
        for (j, lane) in self.lanes.iter().enumerate() {
            let mut e = 1.0 - lane[0];
            self.facts.solid_fraction_max = self.facts.solid_fraction_max.max(lane[0]);
            if e < floor && floor > 0.0 {
                self.facts.capped_volume += (floor - e) * self.mesh.volume[j];
                e = floor;
            }
            if e <= 0.0 || e.is_nan() {
                let (cell, centre) = (self.mesh.ids[j], self.mesh.centre[j]);
                return Err(StepError::NoFluid { cell, centre, voidage: e });
            }
            self.sources.voidage[j] = e;
            self.sources.solids_flux[j] = [lane[1], lane[2], lane[3]];
        }
        if first {
            self.sources.voidage_old.clone_from(&self.sources.voidage);
        }
        Ok(())
    }

    /// Stages 5 to 7 (pass b): drag, prediction, Sp and Su. False if an Sp is negative.
    fn sources_of(&mut self, p: &Particles) -> bool {
        self.predict(p);
        let mut lanes = std::mem::take(&mut self.lanes_b);
        lanes.fill([0.0; 8]);
        let (predicted, period, scheme) = (&self.predicted, self.setup.period, self.setup.scheme);
        let ledger = |i: usize| if scheme.conservative() { p.ledger[i] } else { [0.0; 3] };
        self.weights
            .deposit(&self.mesh, &mut lanes, |i| linearise(&predicted[i], p.velocity[i], ledger(i), period));
        self.smooth(&mut lanes);
        let positive = lanes.iter().all(|l| l[0] >= 0.0 && l[4] >= 0.0);
        let cells = Cells { smoothed: &lanes, solids: &self.lanes, mapped: &self.mapped, fluid: &self.fluid };
        scheme.sources(&cells, &mut self.sources.sp, &mut self.sources.su);
        self.lanes_b = lanes;
        positive
    }

    /// Stages 5 and 6: K from the voidage at the particle and the fluid of the last step; C, B, d.
    fn predict(&mut self, p: &Particles) {
        let s = &self.setup;
        self.predicted.clear();
        for i in 0..p.len() {
            if !self.coupled[i] {
                self.predicted.push(Predicted::default());
                continue;
            }
            let voidage =
                (1.0 - self.weights.gather(&self.lanes, i)[0]).max(s.voidage_min.max(f64::MIN_POSITIVE));
            let g = self.weights.gather(&self.gathered, i);
            let gathered = [g[0], g[1], g[2]];
            let host = self.hosts[i] as usize;
            let u = interpolate::fluid_velocity(
                s.fluid_velocity,
                &self.mesh,
                &self.fluid,
                host,
                p.position[i],
                gathered,
            );
            let slip = [0, 1, 2].map(|a| u[a] - p.velocity[i][a]);
            let mut k = s.drag.drag_coefficient(&Slip {
                diameter: 2.0 * p.radius[i],
                voidage,
                speed: norm(slip),
                kinematic_viscosity: s.kinematic_viscosity,
                density: s.density,
            });
            if s.model_b {
                k /= voidage;
            }
            let defect = [0, 1, 2].map(|a| u[a] - gathered[a]);
            let (v, inertia) = (p.velocity[i], p.mass[i]);
            let last = p.history.last(i, v, inertia, s.gravity, s.period);
            let before = Before { drag_coefficient: k, slip, inertia, period: s.period, last };
            self.predicted.push(Predicted::new(s.scheme, &before, defect));
        }
    }

    /// Stage 9 (pass c): the new fluid smoothed by the same G, read at the particles; the impulse charged.
    pub fn after_fluid(&mut self, p: &Particles, fluid: &Fluid, first: bool) -> Result<(), StepError> {
        self.take_fluid(fluid)?;
        if first {
            // no fluid step lies behind: K is computed with the fluid as it stands, nothing is charged
            self.predict(p);
        }
        let s = &self.setup;
        let n = p.len();
        let d = &mut self.drive;
        d.drag_coefficient.clear();
        d.velocity.clear();
        d.force.clear();
        d.charged.clear();
        let conservative = s.scheme.conservative();
        let ledger = |i: usize| if conservative { p.ledger[i] } else { [0.0; 3] };
        let mut external = Vec::with_capacity(n);
        for i in 0..n {
            if !self.coupled[i] {
                d.drag_coefficient.push(0.0);
                // its ledger waits until it is back: L = taken − charged
                d.charged.push(ledger(i).map(|l| -l));
                for list in [&mut d.velocity, &mut d.force] {
                    list.push([0.0; 3]);
                }
                external.push([0.0; 3]);
                continue;
            }
            let (g, q, v) = (self.weights.gather(&self.gathered, i), &self.predicted[i], p.volume(i));
            let u = [0, 1, 2].map(|a| g[a] + q.defect[a]);
            let outer = [0, 1, 2].map(|a| -v * (s.density * s.archimedes[a] + s.mean_pressure_gradient[a]));
            let inner = if s.pressure_force { [3, 4, 5].map(|a| -v * g[a]) } else { [0.0; 3] };
            let force = [0, 1, 2].map(|a| inner[a] + outer[a]);
            let charged = if first {
                [0.0; 3]
            } else {
                [0, 1, 2]
                    .map(|a| s.period * (q.implicit * (u[a] - p.velocity[i][a]) + q.explicit[a] + force[a]))
            };
            d.drag_coefficient.push(q.drag_coefficient);
            d.velocity.push(u);
            d.force.push(force);
            d.charged.push(charged);
            external.push(if first { [0.0; 3] } else { outer.map(|x| s.period * x) });
        }
        let given = |i: usize| [0, 1, 2].map(|a| d.charged[i][a] + ledger(i)[a]);
        self.books = Books {
            charged: sum3(d.charged.iter().copied()),
            old_ledger: sum3((0..n).map(ledger)),
            external: sum3(external),
            scale: sum((0..n).map(|i| norm(given(i)))),
            reaction: [0.0; 3],
        };
        Ok(())
    }

    /// Forms ε_s U_s for output where no stage needs it.
    pub fn form_solids_flux(&mut self, p: &Particles) {
        if self.setup.solids_flux {
            return;
        }
        let mut lanes = vec![[0.0; 8]; self.mesh.len()];
        self.weights.deposit(&self.mesh, &mut lanes, |i| {
            let (v, u) = (p.volume(i), p.velocity[i]);
            [v * u[0], v * u[1], v * u[2], 0.0, 0.0, 0.0, 0.0, 0.0]
        });
        self.smooth(&mut lanes);
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
        for j in 0..self.mesh.ids.len() {
            let u = fluid.velocity[j];
            let grad = |field: &[[f64; 3]], a: usize| field.get(j).map_or(0.0, |v| v[a]);
            let q = [0, 1, 2].map(|a| grad(&fluid.pressure_gradient, a) - grad(&fluid.stress_divergence, a));
            self.fluid[j] = [u[0], u[1], u[2], q[0], q[1], q[2], 0.0, 0.0];
            if let Some(a) = (0..6).find(|a| !self.fluid[j][*a].is_finite()) {
                let what =
                    if a < 3 { "the fluid velocity" } else { "the pressure gradient or stress divergence" };
                return Err(StepError::NotFinite {
                    what,
                    cell: self.mesh.ids[j],
                    centre: self.mesh.centre[j],
                });
            }
        }
        let mut gathered = std::mem::take(&mut self.gathered);
        gathered.clone_from(&self.fluid);
        self.smooth(&mut gathered);
        self.gathered = gathered;
        Ok(())
    }
}
