// SPDX-License-Identifier: MIT OR Apache-2.0
//! One run of the bench: exchanges as in `couple`, with the fluid and the particles in this process.
//!
//! Writes per exchange: mean fluid velocity (÷ U0), largest velocity, third-law error, steady-drag error. The reaction
//! is formed from the arrays the fluid put into its own equation, not by the coupler.

use super::dem::Dem;
use super::{
    BANDWIDTH, DENSITY, DIAMETER, INTERVAL, LENGTH, Mode, PARTICLES, PERIOD, Point, SOLID_FRACTION, column,
};
use crate::bench::scene::random;
use crate::forces::{self, Extra};
use crate::interpolate::FluidVelocity;
use crate::map::ParticleCentroid;
use crate::mesh::Mesh;
use crate::particles::Particles;
use crate::smooth::{self, Diffusion};
use crate::step::{CouplingStep, Drive, Fluid, Setup};
use crate::sums::{norm, sum, sum3};
use std::f64::consts::PI;

/// What one exchange came to.
#[derive(Clone, Copy, Debug, Default)]
pub struct Step {
    /// volume mean of U ÷ U0
    pub mean: f64,
    /// largest |U|, |v| ÷ U0
    pub largest: f64,
    /// |action − reaction|, N s
    pub gap: f64,
    /// Σ|action|, N s
    pub action: f64,
    /// Σ_j V_j Δt (|Su| + |Sp U|), N s: what the fluid's equation adds up, whose rounding bounds `gap`
    pub terms: f64,
    /// impulse of the fluid ÷ Σ K (ũ + d − v) Δt − 1
    pub steady: f64,
}

/// A run under way.
pub struct Bench {
    point: Point,
    step: CouplingStep,
    dem: Dem,
    fluid: Fluid,
    drag_coefficient: f64,
    speed: f64,
    exchange: u64,
    started: [f64; 3],
    external: [f64; 3],
}

/// The column for this cell size: ε_s has the same mean on all.
pub(super) fn mesh_of(point: &Point) -> Mesh {
    let h = point.cell * DIAMETER;
    let length = LENGTH as f64 * h;
    let solids = PARTICLES as f64 * PI / 6.0 * DIAMETER.powi(3);
    column(LENGTH, h, (solids / (SOLID_FRACTION * length)).sqrt())
}

/// Body force on the fluid ÷ Σ w K U0. With free particles it accelerates the mixture: by at most U0 per step.
pub(super) fn drive(point: &Point) -> f64 {
    match point.mode {
        Mode::Free => 0.0,
        Mode::Settling | Mode::Held => 1.0,
        Mode::RandomlyHeld => 1.0 / (point.ratio * point.loading / (1.0 + point.loading)).max(1.0),
    }
}

/// Which particles are held in the interval after exchange k.
pub(super) fn held(mode: Mode, k: u64) -> Vec<bool> {
    let mut seed = 77 + 13 * k;
    random(&mut seed);
    let draw = |_| match mode {
        Mode::Held => true,
        Mode::RandomlyHeld => random(&mut seed) < 0.5,
        Mode::Free | Mode::Settling => false,
    };
    (0..PARTICLES).map(draw).collect()
}

impl Bench {
    /// A run at rest before exchange 0.
    pub fn new(point: Point) -> Self {
        let mesh = mesh_of(&point);
        let h = point.cell * DIAMETER;
        // velocities are so that a particle crosses a fifth of a cell per step: all is linear, only ratios matter
        let speed = 0.2 * h / PERIOD;
        let volume: f64 = mesh.volume.iter().sum();
        let mass = point.loading * DENSITY * volume / PARTICLES as f64;
        let k = point.ratio * mass / PERIOD;
        let mut seed = 5;
        let side = mesh.bounds[1][1];
        let mut place = |i: usize| {
            let x = (i as f64 + random(&mut seed)) / PARTICLES as f64;
            [x * mesh.bounds[1][0], side * random(&mut seed), side * random(&mut seed)]
        };
        let position: Vec<_> = (0..PARTICLES).map(&mut place).collect();
        // τ_p spread by a factor of 4, except where the weight of each must be borne exactly
        let even = point.mode == Mode::Settling;
        let spread: Vec<f64> =
            (0..PARTICLES).map(|_| if even { 1.0 } else { 0.5 + 1.5 * random(&mut seed) }).collect();
        let whole = sum(spread.iter().copied()) / PARTICLES as f64;
        let masses: Vec<f64> = spread.iter().map(|s| mass * s / whole).collect();
        let settles = point.mode == Mode::Settling;
        let gravity = if settles { [-speed * k / mass, 0.0, 0.0] } else { [0.0; 3] };
        let v = if settles && point.steady { [-speed, 0.0, 0.0] } else { [0.0; 3] };
        let u = match point.mode {
            Mode::Free => speed,
            Mode::Settling => 0.0,
            Mode::Held | Mode::RandomlyHeld => {
                if point.steady {
                    speed
                } else {
                    0.0
                }
            }
        };
        let setup = Setup {
            drag: forces::by_name("stokes").expect("a law of the list"),
            scheme: point.scheme,
            fluid_velocity: FluidVelocity::Gather,
            model_b: false,
            two_way: true,
            pressure_force: false,
            archimedes: [0.0; 3],
            mean_pressure_gradient: [0.0; 3],
            gravity,
            solids_flux: false,
            density: DENSITY,
            kinematic_viscosity: k / (3.0 * PI * DIAMETER * DENSITY),
            period: PERIOD,
            voidage_min: 0.0,
            exclude_outside: false,
            average: None,
            extra: Extra::default(),
        };
        let t = Diffusion::uniform(BANDWIDTH * DIAMETER).links(&mesh);
        let [g, positive] = smooth::pair("chebyshev", &mesh, &t, 1e-4).expect("a smoother of the list");
        let n = mesh.len();
        let dem = Dem::new(position, vec![v; PARTICLES], masses, 0.5 * DIAMETER, gravity, !point.fixed);
        let mut bench = Self {
            point,
            step: CouplingStep::new(mesh, setup, Box::new(ParticleCentroid), g, positive),
            dem,
            fluid: Fluid { velocity: vec![[u, 0.0, 0.0]; n], ..Fluid::default() },
            drag_coefficient: k,
            speed,
            exchange: 0,
            started: [0.0; 3],
            external: [0.0; 3],
        };
        bench.started = bench.momentum();
        bench
    }

    /// Momentum of fluid and particles − Σ L, N s.
    fn momentum(&self) -> [f64; 3] {
        let m = &self.step.mesh;
        let fluid = sum3((0..m.len()).map(|j| self.fluid.velocity[j].map(|u| DENSITY * m.volume[j] * u)));
        let d = &self.dem;
        let particles = sum3((0..d.mass.len()).map(|i| d.velocity[i].map(|v| d.mass[i] * v)));
        let ledger = d.ledgers();
        [0, 1, 2].map(|a| fluid[a] + particles[a] - ledger[a])
    }

    /// Momentum of fluid and particles − Σ L − external impulse, changed since the start, ÷ the momentum of the fluid
    /// at U0 and the particles at U0.
    pub fn momentum_drift(&self) -> f64 {
        let now = self.momentum();
        let gap = [0, 1, 2].map(|a| now[a] - self.started[a] - self.external[a]);
        let volume: f64 = self.step.mesh.volume.iter().sum();
        norm(gap) / (self.speed * DENSITY * volume * (1.0 + self.point.loading))
    }

    /// Body force on the fluid in cell j, N/m3: balances weight or drag in the steady state.
    fn body_force(&self, j: usize) -> f64 {
        let solids = 1.0 - self.step.sources.voidage[j];
        let number = solids / (PI / 6.0 * DIAMETER.powi(3));
        // the DEM leads by one period: it has been under weight once more than the fluid has borne it
        let lead = if self.point.mode == Mode::Settling && self.exchange == 1 { 2.0 } else { 1.0 };
        lead * drive(&self.point) * number * self.drag_coefficient * self.speed
    }

    /// The fluid's step; Σ reaction and Σ of the terms' magnitudes, N s.
    fn solve(&mut self) -> ([f64; 3], f64) {
        let (mut terms, mut external) = (0.0, [0.0; 3]);
        let mut reaction = Vec::with_capacity(self.fluid.velocity.len());
        for j in 0..self.fluid.velocity.len() {
            let (sp, su, v) = (self.step.sources.sp[j], self.step.sources.su[j], self.step.mesh.volume[j]);
            let force = [self.body_force(j), 0.0, 0.0];
            let rate = DENSITY / PERIOD;
            let u = &mut self.fluid.velocity[j];
            *u = [0, 1, 2].map(|a| (rate * u[a] + su[a] + force[a]) / (rate + sp));
            let u = *u;
            reaction.push([0, 1, 2].map(|a| -v * PERIOD * (su[a] - sp * u[a])));
            terms += v * PERIOD * (norm(su) + sp * norm(u));
            (0..3).for_each(|a| external[a] += v * PERIOD * force[a]);
        }
        (0..3).for_each(|a| self.external[a] += external[a]);
        (sum3(reaction), terms)
    }

    /// One exchange and the interval after it. `None` once numbers leave the range of anything physical.
    pub fn advance(&mut self) -> Option<Step> {
        let mut particles = self.dem.message();
        let first = self.exchange == 0;
        self.step.before_fluid(&mut particles, first).ok()?;
        for (id, x) in particles.id.iter().zip(&particles.position) {
            self.dem.position[*id as usize] = *x;
        }
        let (reaction, terms) = if first { ([0.0; 3], 0.0) } else { self.solve() };
        self.step.after_fluid(&particles, &self.fluid, first).ok()?;
        let mut result = self.judge(&particles, reaction, terms);
        // back into the order of the DEM, which is that of the ids
        let (d, mut drive) = (&self.step.drive, self.step.drive.clone());
        for (k, i) in particles.id.iter().map(|id| *id as usize).enumerate() {
            drive.drag_coefficient[i] = d.drag_coefficient[k];
            drive.velocity[i] = d.velocity[k];
            drive.force[i] = d.force[k];
            drive.charged[i] = d.charged[k];
        }
        self.interval(&drive);
        if !self.point.scheme.conservative() {
            // no ledger: the action is what the particles took
            let taken = sum3(self.dem.taken.iter().copied());
            result.gap = norm([0, 1, 2].map(|a| taken[a] - reaction[a]));
            result.action = sum(self.dem.taken.iter().map(|t| norm(*t)));
        }
        self.exchange += 1;
        (result.largest < 1e12).then_some(result)
    }

    fn interval(&mut self, drive: &Drive) {
        self.dem.held = held(self.point.mode, self.exchange);
        let before = sum3((0..PARTICLES).map(|i| self.dem.velocity[i].map(|v| self.dem.mass[i] * v)));
        self.dem.interval(drive, INTERVAL, PERIOD / INTERVAL as f64);
        // what is neither drag nor momentum is weight and whatever holds them
        let after = sum3((0..PARTICLES).map(|i| self.dem.velocity[i].map(|v| self.dem.mass[i] * v)));
        let taken = sum3(self.dem.taken.iter().copied());
        (0..3).for_each(|a| self.external[a] += after[a] - before[a] - taken[a]);
    }

    fn judge(&mut self, p: &Particles, reaction: [f64; 3], terms: f64) -> Step {
        let (m, d, u0) = (&self.step.mesh, &self.step.drive, self.speed);
        let volume: f64 = m.volume.iter().sum();
        let fluid = || self.fluid.velocity.iter().map(|u| norm(*u));
        let largest = fluid().chain(self.dem.velocity.iter().map(|v| norm(*v)));
        let largest = largest.fold(0.0, |a: f64, b| if b.is_nan() { f64::INFINITY } else { a.max(b) });
        let mean = sum((0..m.len()).map(|j| m.volume[j] * self.fluid.velocity[j][0])) / volume;
        let books = &self.step.books;
        let gap = norm([0, 1, 2].map(|a| books.charged[a] + books.old_ledger[a] - reaction[a]));
        let drag = sum3((0..p.len()).map(|i| {
            [0, 1, 2].map(|a| PERIOD * d.drag_coefficient[i] * (d.velocity[i][a] - p.velocity[i][a]))
        }));
        let steady = norm([0, 1, 2].map(|a| reaction[a] - drag[a])) / norm(drag);
        Step { mean: mean / u0, largest: largest / u0, gap, action: books.scale, terms, steady }
    }
}
