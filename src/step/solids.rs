// SPDX-License-Identifier: MIT OR Apache-2.0
//! Stage 4, pass a: voidage and solids flux of the cells, and the last fluid velocity smoothed beside them.
//!
//! Reads particles (volume m3, velocity m/s); writes ε, ε_s U_s and the sums that prove them. Does not know forces.

use super::{CouplingStep, StepError};
use crate::balance::ratio;
use crate::particles::Particles;
use crate::smooth::Direction;
use crate::sums::{Sums, norm};
use crate::threads;
use std::time::Instant;

impl CouplingStep {
    /// Stage 4 (pass a): ε_s, ε_s U_s and, beside them, G of the last fluid velocity. False if an ε_s is negative.
    pub(super) fn solids(&mut self, p: &Particles, first: bool) -> bool {
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
        let other = self.elsewhere();
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
            let mut cut = Vec::new();
            for j in rows.iter().map(|j| *j as usize) {
                let (l, v, solid) = (&lanes[j], volumes[j], mean(j));
                let (mut e, mut capped) = (1.0 - solid, 0.0);
                if e < floor && floor > 0.0 {
                    (capped, e) = ((floor - e) * v, floor);
                    cut.push((j as u32, (1.0 - floor) / solid));
                }
                negative |= solid < 0.0;
                most = most.max(solid);
                sums.add([solid * v, l[1] * v, l[2] * v, l[3] * v, capped]);
                voidage[j - slots.start] = e;
                flux[j - slots.start] = [l[1], l[2], l[3]];
            }
            (sums, most, negative, cut)
        });
        self.capped.clear();
        found.iter().for_each(|f| self.capped.extend(&f.3));
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
        let negative = found.iter().any(|f| f.2);
        if self.setup.drag.wants_mean_diameter() && !negative {
            self.mean_diameters(p);
        }
        self.seconds.solids = begin.elapsed().as_secs_f64();
        !negative
    }

    /// Σ V d of the primary particles, smoothed, for the particles to read in lane 1: the flux there has been taken by now.
    fn mean_diameters(&mut self, p: &Particles) {
        let extra = self.setup.extra.clone();
        let lanes = self.spread_beside(|i| {
            let (v, d) = (p.volume(i), 2.0 * p.radius[i] / extra.ratio(&p.asked.kind, i));
            [v, v * d, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
        });
        let mut cells = vec![[0.0; 2]; self.mesh.len()];
        for row in &self.active.rows {
            let (to, l) = (&mut cells[self.classes.cell(*row)], &lanes[*row as usize]);
            (to[0], to[1]) = (to[0] + l[0], to[1] + l[1]);
        }
        for row in &self.active.rows {
            let ([now, sum], work) = (cells[self.classes.cell(*row)], &mut self.work[*row as usize]);
            // lane 0 may be the mean in time
            work[1] = if now > 0.0 { sum * work[0] / now } else { sum };
        }
    }

    /// The run stops where no fluid is left, unless capping was chosen.
    pub(super) fn check_voidage(&self) -> Result<(), StepError> {
        let bad = |j: &&u32| {
            self.sources.voidage[**j as usize].is_nan() || self.sources.voidage[**j as usize] <= 0.0
        };
        let other = self.elsewhere();
        match if other { &self.cells } else { &self.active.rows }.iter().find(bad) {
            None => Ok(()),
            Some(j) => {
                let j = *j as usize;
                let (cell, centre) = (self.mesh.ids[j], self.mesh.centre[j]);
                Err(StepError::NoFluid { cell, centre, voidage: self.sources.voidage[j] })
            }
        }
    }
}
