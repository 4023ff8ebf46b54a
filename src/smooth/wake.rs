// SPDX-License-Identifier: MIT OR Apache-2.0
//! How far the wake of a particle reaches, and the bandwidth that follows (Sun & Xiao 2015, §4.1 and Fig. 10).
//!
//! The support of the kernel, about 3 b, is to cover the wake: b = x/3, x the distance behind the particle at which the
//! velocity defect û on its axis has fallen to 20 % of the slip U. The level is that at which Sun & Xiao's bed (Re about
//! 70) gets the 4 to 6 diameters they use. Works in diameters; reads Re = U d/ν; does not know meshes or cases.
//!
//! * Re ≤ 5, laminar: û/U = C_d Re/32 · d/x, the far wake that carries the drag's momentum defect (Batchelor 1967, §5.12).
//! * Re ≥ 50, turbulent: û/U = 2.23 (θ/x)^⅔, θ² = C_d d²/8: the self-preserving wake of a round body (Tennekes & Lumley
//!   1972, §4.2), the form Wu & Faeth (1993, AIAA J. 31, 1448) give for spheres.
//! * Between, as neither is right: the logarithm of b linear in the logarithm of Re. Fig. 10 draws Re = 0.5 and 5 as
//!   laminar, 50 and 500 as turbulent.
//!
//! C_d of Schiller & Naumann. An estimate of size, not of the second digit: in a bed wakes overlap.

/// û/U at which the wake ends.
const LEVEL: f64 = 0.2;
/// û/U (x/θ)^⅔, and l (θ² x)^−⅓ of its Gaussian profile exp(−r²/2l²).
const TURBULENT: (f64, f64) = (2.23, 0.47);
/// Reynolds numbers up to which wakes are laminar and from which they are turbulent.
const REGIMES: (f64, f64) = (5.0, 50.0);
/// Support of the Gaussian in bandwidths.
const SUPPORT: f64 = 3.0;
/// The bandwidths of Sun & Xiao 2015, in diameters.
pub const USED: (f64, f64) = (4.0, 6.0);

/// C_d Re of a sphere alone.
fn drag(re: f64) -> f64 {
    (24.0 * (1.0 + 0.15 * re.powf(0.687))).max(0.44 * re)
}

/// Velocity defect on the axis at x (diameters), û/U; in the laminar or the turbulent form.
pub fn defect(re: f64, x: f64, turbulent: bool) -> f64 {
    if turbulent {
        TURBULENT.0 * ((drag(re) / re / 8.0).sqrt() / x).powf(2.0 / 3.0)
    } else {
        drag(re) / 32.0 / x
    }
}

/// Where the wake ends, in diameters, for Re ≥ 0.
pub fn length(re: f64) -> f64 {
    let laminar = |re: f64| drag(re) / 32.0 / LEVEL;
    let turbulent = |re: f64| (drag(re) / re / 8.0).sqrt() * (TURBULENT.0 / LEVEL).powf(1.5);
    let (low, high) = REGIMES;
    if re <= low {
        return laminar(re);
    }
    if re >= high {
        return turbulent(re);
    }
    let part = (re / low).ln() / (high / low).ln();
    (laminar(low).ln() * (1.0 - part) + turbulent(high).ln() * part).exp()
}

/// The bandwidth whose support is the wake, in diameters.
pub fn bandwidth(re: f64) -> f64 {
    length(re) / SUPPORT
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    #[test]
    fn both_wakes_carry_the_momentum_the_drag_takes() {
        // ρ U ∫ û 2π r dr = C_d π/8 ρ U² d²; û Gaussian in r
        for (re, x) in [(0.5, 10.0), (5.0, 20.0), (50.0, 10.0), (500.0, 20.0)] {
            let lost = drag(re) / re * PI / 8.0;
            // laminar: exp(−U r²/4νx), ∫ = 4π ν x/U
            let laminar = defect(re, x, false) * 4.0 * PI * x / re;
            assert!((laminar / lost - 1.0).abs() < 1e-12);
            let theta = (drag(re) / re / 8.0).sqrt();
            let l = TURBULENT.1 * (theta * theta * x).powf(1.0 / 3.0);
            // the two constants are rounded: 2 · 2.23 · 0.47² = 0.985
            let turbulent = defect(re, x, true) * 2.0 * PI * l * l;
            assert!((turbulent / lost - 1.0).abs() < 0.02, "{}", turbulent / lost);
        }
    }

    #[test]
    fn the_bed_of_sun_and_xiao_gets_the_bandwidth_they_used() {
        // d 1.2 mm, 0.9 m/s, ν = 1.8e-5/1.2
        let b = bandwidth(0.9 * 1.2e-3 / 1.5e-5);
        assert!(b > USED.0 && b < USED.1, "{b}");
        // creeping flow: û/U = ¾ d/x
        assert!((length(0.0) - 3.75).abs() < 1e-12);
    }

    #[test]
    fn it_ends_where_the_defect_is_a_fifth_and_has_no_jumps() {
        for (re, turbulent) in [(0.5, false), (5.0, false), (50.0, true), (500.0, true)] {
            assert!((defect(re, length(re), turbulent) - LEVEL).abs() < 1e-12);
        }
        for re in [5.0, 50.0] {
            assert!((length(re * (1.0 + 1e-9)) / length(re) - 1.0).abs() < 1e-8);
        }
    }
}
