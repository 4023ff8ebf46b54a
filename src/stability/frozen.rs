// SPDX-License-Identifier: MIT OR Apache-2.0
//! One exchange of a recorded scene with everything frozen but velocities: particles stay where they are, the voidage stays.
//!
//! Reads particles and fluid of one exchange (SI units); maps a state to the one an exchange later by the coupling step
//! itself, the fluid's momentum without pressure, viscosity and convection (ε ρ ∂U/∂t = Su − Sp U), and the exact relaxation
//! of each particle towards what drives it. Without pressure no mode of the drag is left out. Does not know eigenvalues.

use crate::config::Config;
use crate::mesh::Mesh;
use crate::particles::Particles;
use crate::scheme::History;
use crate::setup;
use crate::step::{CouplingStep, Fluid, StepError};
use crate::sums::{norm, sum3};

type V = [f64; 3];

/// What an exchange changes.
#[derive(Clone, Debug)]
pub struct State {
    /// U of the cells, m/s
    pub fluid: Vec<V>,
    /// U one step earlier, m/s; empty unless an added mass looks at it
    pub before: Vec<V>,
    /// v of the particles, m/s
    pub velocity: Vec<V>,
    /// L, N s
    pub ledger: Vec<V>,
    /// the last interval, for schemes that look at it
    pub history: History,
}

/// A scene whose velocities alone move.
pub struct Frozen {
    step: CouplingStep,
    particles: Particles,
    /// mass and added mass, kg
    inertia: Vec<f64>,
    /// ε
    voidage: Vec<f64>,
    /// ρ_f ε V, kg
    fluid_mass: Vec<f64>,
    period: f64,
    /// m/s2
    gravity: V,
    held: bool,
    history: bool,
    added: bool,
    /// the force stays over the interval (`dem.force`)
    constant: bool,
}

impl Frozen {
    /// The scene of `c` with particles `p` and fluid velocities `u` (m/s). `held`: the particles do not move at all.
    pub fn new(
        c: &Config,
        mesh: Mesh,
        mut p: Particles,
        u: &[V],
        held: bool,
    ) -> Result<(Self, State), String> {
        let told = |e: StepError| e.to_string();
        let mut step = setup::step(c, mesh)?;
        let wants = crate::scheme::by_name(&c.file.coupling.scheme).is_some_and(|s| s.wants_history());
        let n = p.len();
        p.ledger.fill([0.0; 3]);
        if wants && p.history.drag_coefficient.len() != n {
            // K = 0: no interval lies behind
            let zero = vec![[0.0; 3]; n];
            let (impulse, drive, force) = (zero.clone(), zero.clone(), zero.clone());
            p.history = History { impulse, drag_coefficient: vec![0.0; n], drive, force, velocity: zero };
        } else if !wants {
            p.history = History::default();
        }
        step.restore(&vec![1.0; u.len()], u, &[]);
        step.before_fluid(&mut p, false).map_err(told)?;
        let voidage = step.sources.voidage.clone();
        let density = c.file.fluid.density;
        let volume = &step.mesh.volume;
        let fluid_mass = volume.iter().zip(&voidage).map(|(v, e)| density * e * v).collect();
        let x = &c.file.forces.added_mass;
        let added = |i: usize| {
            step.drive.added_mass.get(i).copied().unwrap_or(x.coefficient() * density * p.volume(i))
        };
        let inertia = (0..n).map(|i| p.mass[i] + added(i)).collect();
        let (ledger, history) = (p.ledger.clone(), p.history.clone());
        let adds = step.extra().added();
        let before = if adds { u.to_vec() } else { Vec::new() };
        let state = State { fluid: u.to_vec(), before, velocity: p.velocity.clone(), ledger, history };
        let period = c.period();
        let (gravity, history) = (c.file.fluid.gravity, wants);
        let constant = c.file.dem.force == crate::config::InInterval::Constant;
        let mut all = Self {
            step,
            particles: p,
            inertia,
            voidage,
            fluid_mass,
            period,
            gravity,
            held,
            history,
            added: adds,
            constant,
        };
        // schemes that look back are disturbed around an interval that was
        let state = if wants { all.exchange(&state).map_err(told)? } else { state };
        Ok((all, state))
    }

    /// The state one exchange later.
    pub fn exchange(&mut self, s: &State) -> Result<State, StepError> {
        let (p, dt) = (&mut self.particles, self.period);
        p.velocity.clone_from(&s.velocity);
        p.ledger.clone_from(&s.ledger);
        if self.history {
            p.history.clone_from(&s.history);
        }
        self.step.restore(&self.voidage, &s.fluid, &s.before);
        self.step.before_fluid(p, false)?;
        let q = &self.step.sources;
        let cell = |j: usize| {
            let (rate, v) = (self.fluid_mass[j] / dt, self.step.mesh.volume[j]);
            [0, 1, 2].map(|a| (rate * s.fluid[j][a] + v * q.su[j][a]) / (rate + v * q.sp[j]))
        };
        let velocity: Vec<V> = (0..s.fluid.len()).map(cell).collect();
        let fluid = Fluid { velocity, ..Fluid::default() };
        self.step.after_fluid(p, &fluid, false)?;
        let (p, d, n) = (&self.particles, &self.step.drive, self.particles.len());
        let mut next = State {
            fluid: fluid.velocity,
            before: if self.added { s.fluid.clone() } else { Vec::new() },
            velocity: p.velocity.clone(),
            ledger: vec![[0.0; 3]; n],
            history: History::default(),
        };
        let mut taken = vec![[0.0; 3]; n];
        for i in 0..n {
            let (m, k, u, f, v) =
                (self.inertia[i], d.drag_coefficient[i], d.velocity[i], d.force[i], p.velocity[i]);
            let x = k * dt / m;
            // mean of exp(−t/τ) over the interval
            let mean = if x > 1e-8 { -(-x).exp_m1() / x } else { 1.0 - 0.5 * x };
            for a in 0..3 {
                let (drag, weight) = (k * (u[a] - v[a]) + f[a], p.mass[i] * self.gravity[a]);
                if self.held {
                    taken[i][a] = dt * drag;
                } else {
                    // (m + m_a) dv/dt = drag + weight; what the fluid gave is m Δv − weight, as the fix reports it
                    let mean = if self.constant { 1.0 } else { mean };
                    let change = dt * mean * (drag + weight) / m;
                    taken[i][a] = p.mass[i] * change - dt * weight;
                    next.velocity[i][a] += change;
                }
                next.ledger[i][a] = taken[i][a] - d.charged[i][a];
            }
        }
        if self.history {
            next.history = History {
                impulse: taken,
                drag_coefficient: d.drag_coefficient.clone(),
                drive: d.velocity.clone(),
                force: d.force.clone(),
                velocity: p.velocity.clone(),
            };
        }
        Ok(next)
    }

    /// Momentum that exchanges keep (conservative schemes, free particles): fluid + particles − Σ L, N s.
    pub fn momentum(&self, s: &State) -> V {
        let of = |m: &[f64], u: &[V]| sum3(m.iter().zip(u).map(|(m, u)| u.map(|u| m * u)));
        let (fluid, particles) = (of(&self.fluid_mass, &s.fluid), of(&self.particles.mass, &s.velocity));
        let ledger = sum3(s.ledger.iter().copied());
        [0, 1, 2].map(|a| fluid[a] + particles[a] - ledger[a])
    }
    /// Mass of fluid and particles, kg.
    pub fn mass(&self) -> f64 {
        crate::sums::sum(self.fluid_mass.iter().chain(&self.particles.mass).copied())
    }
    /// √(Σ m |u|² + Σ |L|²/m), √J: the size of a state.
    pub fn size(&self, s: &State) -> f64 {
        let of = |m: &[f64], u: &[V]| m.iter().zip(u).map(|(m, u)| m * norm(*u).powi(2)).sum::<f64>();
        let ledger: f64 = self.inertia.iter().zip(&s.ledger).map(|(m, l)| norm(*l).powi(2) / m).sum();
        (of(&self.fluid_mass, &s.fluid) + of(&self.inertia, &s.velocity) + ledger).sqrt()
    }
    /// Do particles move?
    pub fn held(&self) -> bool {
        self.held
    }
}
