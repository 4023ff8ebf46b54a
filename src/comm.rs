// SPDX-License-Identifier: MIT OR Apache-2.0
//! MPI between coupler ranks, behind one narrow type. One rank for now: more are refused, not ignored.

use mpi::environment::Universe;
use mpi::traits::Communicator;

/// The coupler's MPI world.
pub struct World {
    _universe: Universe,
}

impl World {
    /// Initialises MPI; refuses more than one coupler rank.
    pub fn join() -> Result<Self, String> {
        let universe =
            mpi::initialize().ok_or("MPI could not be initialised (is it initialised already?)")?;
        match universe.world().size() {
            1 => Ok(Self { _universe: universe }),
            n => {
                Err(format!("{n} coupler ranks were started, this version works with 1: use `mpirun -np 1`"))
            }
        }
    }
}
