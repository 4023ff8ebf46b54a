// SPDX-License-Identifier: MIT OR Apache-2.0
//! Stages 5 to 7, pass b: what each particle will take, and Sp and Su of the cells.
//!
//! Reads the smoothed lanes at the particles; writes predictions (K kg/s, forces N), Sp (kg/(m3 s)) and Su (N/m3). Does
//! not know how drag laws and schemes come to their numbers.

use super::{CouplingStep, FLUID};
use crate::forces::extra::{Each, Flow};
use crate::forces::history::Memory;
use crate::forces::{Around, Slip};
use crate::interpolate::{self, FluidVelocity};
use crate::linearise::{Kept, LEVEL, Part, Predicted, linearise};
use crate::map::BATCH;
use crate::particles::Particles;
use crate::scheme::{Before, Cells};
use crate::smooth::{Direction, Field};
use crate::sums::norm;
use crate::threads;
use std::time::Instant;

/// Particles whose drag is computed together.
#[derive(Default)]
struct Batch {
    /// what they read of the smoothed lanes
    lanes: Field,
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

impl CouplingStep {
    /// Stages 5 and 6: K from the voidage at the particle and the fluid of the last step; C, B, d. In exchange 0
    /// the fluid stands in `gathered`, else it was smoothed in pass a.
    pub(super) fn predict(&mut self, p: &Particles, first: bool) {
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
        b.slips.clear();
        b.vectors.clear();
        b.gathered.clear();
        b.defects.clear();
        b.drag.resize(count, 0.0);
        b.lanes.fit(BATCH);
        self.weights.gather(&self.work, begin, &mut b.lanes[..count]);
        for k in 0..count {
            let i = begin + k;
            let l = b.lanes[k];
            let voidage = (1.0 - l[0]).max(s.voidage_min.max(f64::MIN_POSITIVE));
            let g = if first { self.weights.gather_one(&self.gathered, i) } else { l };
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
            b.slips.push(Slip {
                diameter: 2.0 * p.radius[i] / s.extra.ratio(&p.asked.kind, i),
                voidage,
                speed: norm(vector),
                kinematic_viscosity: s.kinematic_viscosity,
                density: s.density,
            });
            b.vectors.push(vector);
            b.gathered.push(gathered);
        }
        if s.drag.looks_around() {
            for k in 0..count {
                let (l, host) = (&b.lanes[k], self.hosts[begin + k] as usize);
                let mean_diameter = if s.drag.wants_mean_diameter() { l[1] / l[0] } else { 0.0 };
                let cell_volume = self.mesh.volume[host];
                let around = Around { sauter_diameter: l[0] / l[7], mean_diameter, cell_volume };
                b.drag[k] = s.drag.drag_coefficient_in(&b.slips[k], &around);
            }
        } else {
            s.drag.coefficients(&b.slips, &mut b.drag);
        }
        for k in 0..count {
            let i = begin + k;
            let ratio = s.extra.ratio(&p.asked.kind, i);
            let parcel = ratio * ratio * ratio;
            let share = if s.model_b { parcel / b.slips[k].voidage } else { parcel };
            let v = p.velocity[i];
            let mass = p.mass[i];
            let inertia = mass + self.added_mass(p, i, 1.0 - b.slips[k].voidage);
            let last = p.history.last(i, v, mass, s.gravity, s.period);
            let drag_coefficient = b.drag[k] * share;
            let before =
                Before { drag_coefficient, slip: b.vectors[k], mass, inertia, period: s.period, last };
            out.set(at + k, &Predicted::new(s.scheme, &before, b.defects[k], b.gathered[k]));
        }
    }

    /// Added mass of particle i (kg) where `solid` is the solid fraction: it takes part in what the particle's drag accelerates.
    fn added_mass(&self, p: &Particles, i: usize, solid: f64) -> f64 {
        let s = &self.setup;
        if !s.extra.added() {
            return 0.0;
        }
        let displaced = s.density * p.volume(i);
        s.extra.coefficient(solid, p.mass[i] / displaced) * displaced
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
        let solid =
            |i: usize| if s.extra.felderhof { self.weights.gather_one(&self.work, i)[0] } else { 0.0 };
        let coefficient = |i: usize| s.extra.coefficient(solid(i), p.mass[i] / (p.volume(i) * s.density));
        let coefficients: Vec<f64> =
            (0..if s.extra.sends_added_mass() { inside } else { 0 }).map(coefficient).collect();
        for (i, m) in coefficients.iter().enumerate() {
            d.added_mass[i] = m * s.density * p.volume(i);
        }
        let each = |i: usize| Each {
            radius: p.radius[i],
            ratio: s.extra.ratio(&p.asked.kind, i),
            slip: [0, 1, 2].map(|a| u[self.hosts[i] as usize][a] - p.velocity[i][a]),
            added_mass: coefficients.get(i).copied().unwrap_or(s.extra.added_mass),
        };
        let hosts = &self.hosts[..inside];
        s.extra.compute(&flow, hosts, each, &p.asked.memory, &mut self.extra, &mut d.memory);
        for i in 0..inside {
            self.predicted.add(i, self.extra[i]);
        }
    }

    /// Stages 5 to 7 (pass b): drag, prediction, Sp and Su. False if an Sp is negative.
    pub(super) fn sources_of(&mut self, p: &Particles) -> bool {
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
        let other = self.elsewhere();
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
}
