// SPDX-License-Identifier: MIT OR Apache-2.0
//! What the programs of a run say to each other, and the contract of what carries it.
//!
//! Reads and writes frames (`frame`), the handshake (`hello`) and the description of a run (`session`);
//! does not know iceoryx2, MPI, meshes or particles. Units: SI everywhere.
#![forbid(unsafe_code)]

pub mod contract;
pub mod frame;
pub mod hello;
pub mod memory;
pub mod process;
pub mod session;
pub mod transport;

pub use frame::{Block, ElementType, Frame, WireError};
pub use hello::{Hello, Role, Welcome};
pub use process::Process;
pub use session::Session;
pub use transport::{Transport, TransportError};

/// Version of frames and handshake. Raised whenever a message changes meaning; both sides must agree.
pub const PROTOCOL: u32 = 1;

/// Message kinds (the numbers of `voidage.h`).
pub mod kind {
    /// First message of a partner: `Hello`.
    pub const HELLO: u32 = 1;
    /// The coupler's answer: `Welcome`.
    pub const WELCOME: u32 = 2;
    /// A partner gives up and says why.
    pub const FAIL: u32 = 3;
    /// DEM to coupler: owned particles.
    pub const PARTICLES: u32 = 10;
    /// Coupler to DEM: what drives the particles for the next interval.
    pub const DRIVE: u32 = 11;
    /// DEM to coupler: the restart file asked for in DRIVE is written.
    pub const WRITTEN: u32 = 12;
    /// CFD to coupler: the mesh of one rank.
    pub const MESH: u32 = 20;
    /// CFD to coupler: the fluid at the end of a step.
    pub const FIELDS: u32 = 21;
    /// Coupler to CFD: voidage and sources of the coming step.
    pub const SOURCES: u32 = 22;
    /// The run ends: empty text = it is complete, else the reason.
    pub const STOP: u32 = 30;
}

/// Names of the arrays in messages (the numbers of `voidage.h`); units there and in `docs/wire.md`.
#[allow(missing_docs)]
pub mod field {
    pub const ID: u32 = 1;
    pub const TYPE: u32 = 2;
    pub const POSITION: u32 = 3;
    pub const VELOCITY: u32 = 4;
    pub const RADIUS: u32 = 5;
    pub const MASS: u32 = 6;
    pub const ANGULAR_VELOCITY: u32 = 7;
    pub const IMPULSE: u32 = 8;
    pub const LEDGER: u32 = 9;
    pub const TOTALS: u32 = 10;
    pub const LAST_DRAG_COEFFICIENT: u32 = 15;
    pub const LAST_DRIVE_VELOCITY: u32 = 16;
    pub const LAST_FORCE: u32 = 17;
    pub const LAST_VELOCITY: u32 = 18;
    pub const LAST_MEMORY: u32 = 19;
    pub const DRAG_COEFFICIENT: u32 = 20;
    pub const DRIVE_VELOCITY: u32 = 21;
    pub const FORCE: u32 = 22;
    pub const CHARGED: u32 = 23;
    pub const RESTART_FILE: u32 = 24;
    pub const ADDED_MASS: u32 = 25;
    pub const ROTATION_COEFFICIENT: u32 = 26;
    pub const ROTATION_RATE: u32 = 27;
    pub const MEMORY: u32 = 28;
    pub const FLUID_VELOCITY: u32 = 30;
    pub const PRESSURE_GRADIENT: u32 = 31;
    pub const STRESS_DIVERGENCE: u32 = 32;
    pub const REACTION: u32 = 33;
    pub const FLAGS: u32 = 34;
    pub const VOIDAGE: u32 = 40;
    pub const SOLIDS_FLUX: u32 = 41;
    pub const SP: u32 = 42;
    pub const SU: u32 = 43;
    pub const VOIDAGE_OLD: u32 = 44;
    pub const POINTS: u32 = 50;
    pub const FACE_STARTS: u32 = 51;
    pub const FACE_POINTS: u32 = 52;
    pub const OWNER: u32 = 53;
    pub const NEIGHBOUR: u32 = 54;
    pub const CELL_IDS: u32 = 55;
    pub const PATCHES: u32 = 56;
    pub const PATCH_SEPARATIONS: u32 = 57;
    pub const PATCH_NAMES: u32 = 58;
    /// Text or an encoded struct (HELLO, WELCOME, FAIL, STOP).
    pub const TEXT: u32 = 90;
}
