// SPDX-License-Identifier: MIT OR Apache-2.0
//! Lift on a sphere in a sheared flow. Reads slip u − v (m/s) and the fluid's vorticity ∇ × U (1/s); writes N.
//!
//! Always the vorticity of the fluid, never the spin of the particle. Does not know cells.

use crate::sums::norm;
use std::f64::consts::PI;

/// What a lift looks at; SI units.
#[derive(Clone, Copy, Debug)]
pub struct Shear {
    /// d, m
    pub diameter: f64,
    /// u − v, m/s
    pub slip: [f64; 3],
    /// ∇ × U, 1/s
    pub vorticity: [f64; 3],
    /// ν, m2/s
    pub kinematic_viscosity: f64,
    /// ρ_f, kg/m3
    pub density: f64,
}

/// A lift.
pub trait Lift: Sync {
    /// Name in case.toml.
    fn name(&self) -> &'static str;
    /// Paper.
    fn source(&self) -> &'static str;
    /// Force on the particle, N; zero without slip or vorticity.
    fn force(&self, s: &Shear) -> [f64; 3];
}

/// All lifts.
pub fn all() -> &'static [&'static dyn Lift] {
    &[&SaffmanMei, &Loth]
}

/// The law of that name.
pub fn by_name(name: &str) -> Option<&'static dyn Lift> {
    all().iter().copied().find(|l| l.name() == name)
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// Saffman 1965 with Mei's fit for finite Re (1992).
pub struct SaffmanMei;

impl Lift for SaffmanMei {
    fn name(&self) -> &'static str {
        "saffman-mei"
    }
    fn source(&self) -> &'static str {
        "Saffman 1965, J. Fluid Mech. 22, 385; Mei 1992, Int. J. Multiphase Flow 18, 145"
    }
    fn force(&self, s: &Shear) -> [f64; 3] {
        let (u, w) = (norm(s.slip), norm(s.vorticity));
        if u == 0.0 || w == 0.0 {
            return [0.0; 3];
        }
        let (re, beta) = (s.diameter * u / s.kinematic_viscosity, 0.5 * s.diameter * w / u);
        let root = 0.3314 * beta.sqrt();
        let fit =
            if re <= 40.0 { (1.0 - root) * (-0.1 * re).exp() + root } else { 0.0524 * (beta * re).sqrt() };
        let size = 1.615 * s.density * s.diameter * s.diameter * (s.kinematic_viscosity / w).sqrt() * fit;
        cross(s.slip, s.vorticity).map(|x| size * x)
    }
}

/// Loth 2008: shear by McLaughlin's J*, and the spin a particle free of torque takes in that shear.
pub struct Loth;

impl Lift for Loth {
    fn name(&self) -> &'static str {
        "loth"
    }
    fn source(&self) -> &'static str {
        "Loth 2008, AIAA J. 46, 801; the spin of a particle free of torque"
    }
    fn force(&self, s: &Shear) -> [f64; 3] {
        let (u, w) = (norm(s.slip), norm(s.vorticity));
        let direction = cross(s.slip, s.vorticity);
        let length = norm(direction);
        if length == 0.0 {
            return [0.0; 3];
        }
        let (re, rate) = (s.diameter * u / s.kinematic_viscosity, w * s.diameter / u);
        let e = (rate / re).sqrt();
        let j = 0.3 * (1.0 + (2.5 * (e.log10() + 0.191)).tanh()) * (2.0 / 3.0 + (6.0 * e - 1.92).tanh());
        let spin = 0.5 * rate * (1.0 - 0.0075 * re * rate) * (1.0 - 0.062 * re.sqrt() - 0.001 * re);
        let share = 1.0 - (0.675 + 0.15 * (1.0 + (0.28 * (spin - 2.0)).tanh())) * (0.18 * re.sqrt()).tanh();
        let c = 12.92 / PI * j * e + share * spin;
        let size = PI / 8.0 * s.density * c * u * u * s.diameter * s.diameter / length;
        direction.map(|x| size * x)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lagging_particle_is_pushed_to_the_faster_side_by_saffmans_force() {
        // u = γ y: vorticity −γ in z
        let s = |slip: f64| Shear {
            diameter: 1e-4,
            slip: [slip, 0.0, 0.0],
            vorticity: [0.0, 0.0, -100.0],
            kinematic_viscosity: 1e-5,
            density: 2.0,
        };
        // 1.615 μ d |u| √Re_G, Re_G = γ d²/ν, times Mei's factor at Re = 1e-5
        let expected = 1.615 * 2e-5 * 1e-4 * 1e-3 * (100.0 * 1e-8 / 1e-5f64).sqrt();
        let f = SaffmanMei.force(&s(1e-3));
        let (re, beta) = (1e-2f64, 0.5 * 1e-4 * 100.0 / 1e-3f64);
        let mei = (1.0 - 0.3314 * beta.sqrt()) * (-0.1 * re).exp() + 0.3314 * beta.sqrt();
        assert!((f[1] / (expected * mei) - 1.0).abs() < 1e-12 && f[0] == 0.0 && f[2] == 0.0, "{f:?}");
        for lift in all() {
            assert!(lift.force(&s(1e-3))[1] > 0.0 && lift.force(&s(-1e-3))[1] < 0.0, "{}", lift.name());
            assert_eq!(lift.force(&s(0.0)), [0.0; 3]);
            assert!(!lift.source().is_empty());
        }
    }

    #[test]
    fn loth_tends_to_saffman_in_strong_shear_at_low_reynolds_number() {
        // e → ∞: J* → 2·0.3·5/3 = 1, 12.92/π·π/8 = 1.615, spin ½ω adds π/16 ρ d³ u ω
        let s = Shear {
            diameter: 1e-5,
            slip: [1e-6, 0.0, 0.0],
            vorticity: [0.0, 0.0, -100.0],
            kinematic_viscosity: 1e-5,
            density: 1.0,
        };
        let saffman = 1.615 * 1e-10 * (1e-5f64 / 100.0).sqrt() * 1e-4;
        let spin = PI / 16.0 * 1e-15 * 1e-4;
        assert!((Loth.force(&s)[1] / (saffman + spin) - 1.0).abs() < 2e-3, "{}", Loth.force(&s)[1]);
    }
}
