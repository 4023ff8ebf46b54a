// SPDX-License-Identifier: MIT OR Apache-2.0
//! Stage 9, pass c: the new fluid smoothed by the same G and read at the particles: what drives them, and the books.
//!
//! Reads the fluid's answer (m/s, Pa/m); writes K, u, f and the charged impulse (N s) of each particle. Does not know how the
//! DEM uses them.

use super::{CouplingStep, Fluid, StepError};
use crate::balance::Books;
use crate::forces::Extra;
use crate::interpolate;
use crate::map::{BATCH, Lines};
use crate::mesh::NONE;
use crate::particles::Particles;
use crate::smooth::Direction;
use crate::sums::{self, Sums, norm};
use crate::threads;

impl CouplingStep {
    pub(super) fn take_fluid(&mut self, fluid: &Fluid) -> Result<(), StepError> {
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
        let (classes, capped) = (&self.classes, &self.capped);
        // the fluid's equation has ε ∇p with the capped ε: solids in excess of it get none, or the third law breaks
        let share = |j: usize| match capped.binary_search_by_key(&(j as u32), |c| c.0) {
            Ok(i) => capped[i].1,
            Err(_) => 1.0,
        };
        threads::map(pieces.into_iter().zip(parts).collect(), |((rows, slots), gathered)| {
            for row in rows {
                let j = classes.cell(*row);
                let u = fluid.velocity[j];
                let (p, t) = (grad(&fluid.pressure_gradient, j), grad(&fluid.stress_divergence, j));
                let r = [0, 1, 2].map(|a| share(j) * (p[a] - t[a]));
                gathered[*row as usize - slots.start] = [u[0], u[1], u[2], r[0], r[1], r[2], 0.0, 0.0];
            }
        });
        self.smoothers[self.smoother].apply(
            &mut self.gathered,
            &self.active,
            Direction::Gather,
            &mut self.scratch,
        );
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

    /// The replies, and the sums over them: old ledger, charged, external impulses, |charged + ledger|.
    pub(super) fn drive_particles(&mut self, p: &Particles, first: bool) {
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
                let (mut sums, mut lanes) = (Sums::<10>::default(), Lines([[0.0; 8]; BATCH]));
                for (at, i) in piece.particles.clone().enumerate() {
                    if at % BATCH == 0 {
                        let left = BATCH.min(piece.particles.len() - at);
                        self.weights.gather(&self.gathered, i, &mut lanes.0[..left]);
                    }
                    let (g, q, v) = (lanes.0[at % BATCH], self.predicted.of(i), p.volume(i));
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

    /// What turns the particles: the new fluid's rotation in their host cells.
    pub(super) fn torque(&mut self, p: &Particles) {
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
}
