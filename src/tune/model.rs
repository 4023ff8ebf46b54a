// SPDX-License-Identifier: MIT OR Apache-2.0
//! The model error: the solid fraction of the cells against the exact Gaussians exp(−r²/b²) of the particles.
//!
//! Reads the particles of one exchange (m, m3) and the bandwidth; writes ε_s by cell slot. On a block of boxes the
//! integrals are products of error functions (`bench::gauss`); on other meshes the mapping `kernel` is the quadrature. What
//! has no Gaussian, or would take too long, is said.

use crate::bench::gauss::Lattice;
use crate::config::{Config, Feedback};
use crate::locate::Locator;
use crate::map::{self, Mapping, Weights};
use crate::mesh::{Mesh, NONE};
use crate::particles::Particles;
use crate::record::RecordError;
use crate::record::effect::{Effect, Error};
use crate::record::moment::Moments;
use crate::smooth::Classes;
use crate::threads;
use crate::{setup, sums};
use std::io::{Read, Seek};

/// Particles of one exchange where the mesh has them.
pub struct Scene {
    /// exchange
    pub k: i64,
    /// of the fluid
    pub mesh: Mesh,
    /// by id
    pub particles: Particles,
    /// cell of each, or `NONE`
    pub hosts: Vec<u32>,
}

/// CPU time that is spent on the exact field, s.
const PATIENCE: f64 = 120.0;
/// Particles whose weights are timed.
const SAMPLE: usize = 64;

impl Scene {
    /// Of the last whole exchange.
    pub fn last<R: Read + Seek>(mut m: Moments<R>) -> Result<Self, RecordError> {
        let x = m.last()?.ok_or(RecordError::NoExchange)?;
        let mut particles = x.particles()?;
        let mut hosts = vec![NONE; particles.len()];
        // those outside have no host: the step stops at them, or leaves them out
        let _ = Locator::new(&m.mesh).locate(&m.mesh, &mut particles.position, &mut hosts);
        Ok(Self { k: x.k, mesh: m.mesh, particles, hosts })
    }

    /// Diameter of the largest particle, m.
    pub fn diameter(&self) -> f64 {
        2.0 * self.particles.radius.iter().fold(0.0, |m: f64, r| m.max(*r))
    }

    /// CPU time of the mapping's weights for all particles, s; from some of them.
    pub fn weights_seconds(&self, mapping: &dyn Mapping) -> f64 {
        let n = self.particles.len();
        let step = n.div_ceil(SAMPLE).max(1);
        let pick = |i: &usize| i.is_multiple_of(step) && self.hosts[*i] != NONE;
        let some: Vec<usize> = (0..n).filter(pick).collect();
        let begin = threads::cpu_seconds(None);
        self.weights(mapping, &some);
        (threads::cpu_seconds(None) - begin) * n as f64 / some.len().max(1) as f64
    }

    fn weights(&self, mapping: &dyn Mapping, some: &[usize]) -> Weights {
        let (p, mut w) = (&self.particles, Weights::default());
        let x: Vec<[f64; 3]> = some.iter().map(|i| p.position[*i]).collect();
        let r: Vec<f64> = some.iter().map(|i| p.radius[*i]).collect();
        let h: Vec<u32> = some.iter().map(|i| self.hosts[*i]).collect();
        mapping.weights(&self.mesh, &x, &r, &h, &mut w);
        w
    }

    /// ε_s by cell slot and how it was found, or why there is none.
    pub fn gaussian(&self, c: &Config) -> Result<(Vec<f64>, &'static str), String> {
        let s = &c.file.smooth;
        if s.bandwidth <= 0.0 {
            return Err("the case has no bandwidth".into());
        }
        if s.time > 0.0 || s.largest_cell > 0.0 {
            return Err(
                "with smooth.time or smooth.largest_cell the particles have no Gaussians of their own".into(),
            );
        }
        if c.file.coupling.feedback == Feedback::OneWay {
            return Err("the fluid gets no voidage (coupling.feedback = \"one-way\")".into());
        }
        let (p, classes) = (&self.particles, setup::classes(c, &self.mesh));
        let inside: Vec<usize> = (0..p.len()).filter(|i| self.hosts[*i] != NONE).collect();
        if let Some(lattice) = Lattice::of_mesh(&self.mesh) {
            let x: Vec<[f64; 3]> = inside.iter().map(|i| p.position[*i]).collect();
            let b = |i: usize| classes.bandwidth(p.radius[inside[i]]);
            let field = lattice.solid_fraction(&x, |i| p.volume(inside[i]), b);
            return Ok((field, "error functions on the boxes of the mesh"));
        }
        self.quadrature(&classes, &inside).map(|f| (f, "quadrature (mapping kernel)"))
    }

    /// The mapping whose deposit is the Gaussian, class by class.
    fn quadrature(&self, classes: &Classes, inside: &[usize]) -> Result<Vec<f64>, String> {
        let p = &self.particles;
        let mut field = vec![0.0; self.mesh.len()];
        for class in 0..classes.count() {
            let own: Vec<usize> =
                inside.iter().copied().filter(|i| classes.of(p.radius[*i]) == class).collect();
            let Some(one) = own.first() else { continue };
            let mut kernel = map::Kernel::default();
            let bandwidth = classes.bandwidth(p.radius[*one]);
            kernel.prepare(&self.mesh, &map::Options { bandwidth, grid: 0.0 });
            let expected = self.weights_seconds(&kernel);
            if expected > PATIENCE {
                return Err(format!("on this mesh the exact field would take {expected:.0} s of CPU"));
            }
            for part in own.chunks(256) {
                let w = self.weights(&kernel, part);
                for (n, i) in part.iter().enumerate() {
                    w.of(n).for_each(|(cell, m)| field[cell] += m * p.volume(*i) / self.mesh.volume[cell]);
                }
            }
        }
        Ok(field)
    }

    /// Error of the solid fraction 1 − ε of a replay; L2 by volume.
    pub fn error(&self, exact: &[f64], replayed: &Effect) -> Error {
        let v = &self.mesh.volume;
        let gap = |j: usize| (1.0 - replayed.voidage[j]) - exact[j];
        let norm = |f: &dyn Fn(usize) -> f64| sums::sum((0..v.len()).map(|j| v[j] * f(j) * f(j))).sqrt();
        let most = |f: &dyn Fn(usize) -> f64| (0..v.len()).fold(0.0, |m: f64, j| m.max(f(j).abs()));
        let ratio = crate::balance::ratio;
        Error { l2: ratio(norm(&gap), norm(&|j| exact[j])), max: ratio(most(&gap), most(&|j| exact[j])) }
    }
}
