// SPDX-License-Identifier: MIT OR Apache-2.0
//! Settings of a coupling step for tests: Koch–Hill's drag in air, all that a case with Archimedes' force has.

use voidage::interpolate::FluidVelocity;
use voidage::step::Setup;
use voidage::{forces, scheme};

/// A period of 1 ms.
pub fn setup(scheme: &str, fluid_velocity: FluidVelocity, model_b: bool) -> Setup {
    Setup {
        drag: forces::by_name("koch-hill").unwrap(),
        scheme: scheme::by_name(scheme).unwrap(),
        fluid_velocity,
        model_b,
        two_way: true,
        pressure_force: !model_b,
        archimedes: [0.0, 0.0, -9.81],
        mean_pressure_gradient: [0.0; 3],
        gravity: [0.0, 0.0, -9.81],
        solids_flux: true,
        density: 1.2,
        kinematic_viscosity: 1.5e-5,
        period: 1e-3,
        voidage_min: 0.0,
        exclude_outside: false,
        extra: forces::Extra::default(),
        average: None,
    }
}
