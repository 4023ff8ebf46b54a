// SPDX-License-Identifier: MIT OR Apache-2.0
//! Numbers of `voidage.h`: roles, message kinds, arrays, patch kinds, element types.

/// role of a particle program
pub const VOIDAGE_DEM: i32 = 1;
/// role of a fluid program
pub const VOIDAGE_CFD: i32 = 2;
/// message kind particles
pub const VOIDAGE_PARTICLES: i32 = 10;
/// message kind drive
pub const VOIDAGE_DRIVE: i32 = 11;
/// message kind written: DEM to coupler, the restart file asked for in VOIDAGE_DRIVE is written
pub const VOIDAGE_WRITTEN: i32 = 12;
/// message kind mesh
pub const VOIDAGE_MESH: i32 = 20;
/// message kind fields
pub const VOIDAGE_FIELDS: i32 = 21;
/// message kind sources
pub const VOIDAGE_SOURCES: i32 = 22;
/// message kind stop
pub const VOIDAGE_STOP: i32 = 30;
/// arrays of VOIDAGE_PARTICLES, n particles, DEM to coupler: particle ids
pub const VOIDAGE_ID: u32 = 1;
/// arrays of VOIDAGE_PARTICLES, n particles, DEM to coupler: particle types
pub const VOIDAGE_TYPE: u32 = 2;
/// arrays of VOIDAGE_PARTICLES, n particles, DEM to coupler: m
pub const VOIDAGE_POSITION: u32 = 3;
/// arrays of VOIDAGE_PARTICLES, n particles, DEM to coupler: m/s
pub const VOIDAGE_VELOCITY: u32 = 4;
/// arrays of VOIDAGE_PARTICLES, n particles, DEM to coupler: m
pub const VOIDAGE_RADIUS: u32 = 5;
/// arrays of VOIDAGE_PARTICLES, n particles, DEM to coupler: kg
pub const VOIDAGE_MASS: u32 = 6;
/// arrays of VOIDAGE_PARTICLES, n particles, DEM to coupler: rad/s
pub const VOIDAGE_ANGULAR_VELOCITY: u32 = 7;
/// arrays of VOIDAGE_PARTICLES, n particles, DEM to coupler: N s, fluid impulse taken in the last interval
pub const VOIDAGE_IMPULSE: u32 = 8;
/// arrays of VOIDAGE_PARTICLES, n particles, DEM to coupler: N s, impulse taken but not charged
pub const VOIDAGE_LEDGER: u32 = 9;
/// arrays of VOIDAGE_PARTICLES, n particles, DEM to coupler: 9 numbers, N s: sums over this rank of impulse taken, impulse charged, old ledger
pub const VOIDAGE_TOTALS: u32 = 10;
/// arrays of VOIDAGE_PARTICLES, n particles, DEM to coupler, if send.history: K of the last interval, kg/s
pub const VOIDAGE_LAST_DRAG_COEFFICIENT: u32 = 15;
/// arrays of VOIDAGE_PARTICLES, n particles, DEM to coupler, if send.history: u of the last interval, m/s
pub const VOIDAGE_LAST_DRIVE_VELOCITY: u32 = 16;
/// arrays of VOIDAGE_PARTICLES, n particles, DEM to coupler, if send.history: f of the last interval, N
pub const VOIDAGE_LAST_FORCE: u32 = 17;
/// arrays of VOIDAGE_PARTICLES, n particles, DEM to coupler, if send.history: velocity at its start, m/s
pub const VOIDAGE_LAST_VELOCITY: u32 = 18;
/// arrays of VOIDAGE_PARTICLES, n particles, DEM to coupler, if drive.memory: VOIDAGE_MEMORY of the last exchange, as it came
pub const VOIDAGE_LAST_MEMORY: u32 = 19;
/// arrays of VOIDAGE_DRIVE, same n and order as the particles sent, coupler to DEM: K, kg/s
pub const VOIDAGE_DRAG_COEFFICIENT: u32 = 20;
/// arrays of VOIDAGE_DRIVE, same n and order as the particles sent, coupler to DEM: u, m/s
pub const VOIDAGE_DRIVE_VELOCITY: u32 = 21;
/// arrays of VOIDAGE_DRIVE, same n and order as the particles sent, coupler to DEM: f, N
pub const VOIDAGE_FORCE: u32 = 22;
/// arrays of VOIDAGE_DRIVE, same n and order as the particles sent, coupler to DEM: impulse charged to the fluid for the coming interval, N s
pub const VOIDAGE_CHARGED: u32 = 23;
/// arrays of VOIDAGE_DRIVE, at the fluid's write times: bytes, the restart file to write; with it VOIDAGE_FLAGS (last step)
pub const VOIDAGE_RESTART_FILE: u32 = 24;
/// arrays of VOIDAGE_DRIVE, same n and order as the particles sent, coupler to DEM, if drive.added_mass: added mass, kg
pub const VOIDAGE_ADDED_MASS: u32 = 25;
/// arrays of VOIDAGE_DRIVE, same n and order as the particles sent, coupler to DEM, if drive.rotation: K_w, N m s: torque K_w (W - w)
pub const VOIDAGE_ROTATION_COEFFICIENT: u32 = 26;
/// arrays of VOIDAGE_DRIVE, same n and order as the particles sent, coupler to DEM, if drive.rotation: W, rotation of the fluid, rad/s
pub const VOIDAGE_ROTATION_RATE: u32 = 27;
/// arrays of VOIDAGE_DRIVE, same n and order as the particles sent, coupler to DEM, if drive.memory: that many numbers per particle, to be kept with it and sent back as VOIDAGE_LAST_MEMORY; 0 for a new particle
pub const VOIDAGE_MEMORY: u32 = 28;
/// arrays of VOIDAGE_FIELDS, c cells, CFD to coupler: m/s
pub const VOIDAGE_FLUID_VELOCITY: u32 = 30;
/// arrays of VOIDAGE_FIELDS, c cells, CFD to coupler: Pa/m, of the last velocity correction
pub const VOIDAGE_PRESSURE_GRADIENT: u32 = 31;
/// arrays of VOIDAGE_FIELDS, c cells, CFD to coupler: N/m3, as put into the matrix
pub const VOIDAGE_STRESS_DIVERGENCE: u32 = 32;
/// arrays of VOIDAGE_FIELDS, c cells, CFD to coupler: 3 numbers, N s: impulse given by the fluid to the particles on this rank in this step
pub const VOIDAGE_REACTION: u32 = 33;
/// arrays of VOIDAGE_FIELDS, c cells, CFD to coupler: 2 numbers: last step, write step
pub const VOIDAGE_FLAGS: u32 = 34;
/// arrays of VOIDAGE_SOURCES, c cells, coupler to CFD: 1
pub const VOIDAGE_VOIDAGE: u32 = 40;
/// arrays of VOIDAGE_SOURCES, c cells, coupler to CFD: eps_s U_s, m/s
pub const VOIDAGE_SOLIDS_FLUX: u32 = 41;
/// arrays of VOIDAGE_SOURCES, c cells, coupler to CFD: kg/(m3 s), >= 0
pub const VOIDAGE_SP: u32 = 42;
/// arrays of VOIDAGE_SOURCES, c cells, coupler to CFD: N/m3
pub const VOIDAGE_SU: u32 = 43;
/// arrays of VOIDAGE_SOURCES, c cells, coupler to CFD: voidage at the start of the step
pub const VOIDAGE_VOIDAGE_OLD: u32 = 44;
/// arrays of VOIDAGE_MESH, CFD to coupler: m, 3 per point
pub const VOIDAGE_POINTS: u32 = 50;
/// arrays of VOIDAGE_MESH, CFD to coupler: n_faces + 1 offsets into FACE_POINTS
pub const VOIDAGE_FACE_STARTS: u32 = 51;
/// arrays of VOIDAGE_MESH, CFD to coupler: point numbers
pub const VOIDAGE_FACE_POINTS: u32 = 52;
/// arrays of VOIDAGE_MESH, CFD to coupler: cell per face
pub const VOIDAGE_OWNER: u32 = 53;
/// arrays of VOIDAGE_MESH, CFD to coupler: cell per internal face
pub const VOIDAGE_NEIGHBOUR: u32 = 54;
/// arrays of VOIDAGE_MESH, CFD to coupler: global id per cell
pub const VOIDAGE_CELL_IDS: u32 = 55;
/// arrays of VOIDAGE_MESH, CFD to coupler: 5 per patch: kind, first face, faces, neighbour rank, neighbour (cyclic) or refer (processorCyclic) patch; -1 if none
pub const VOIDAGE_PATCHES: u32 = 56;
/// arrays of VOIDAGE_MESH, CFD to coupler: m, 3 per patch: a particle leaving at x continues at x + separation
pub const VOIDAGE_PATCH_SEPARATIONS: u32 = 57;
/// arrays of VOIDAGE_MESH, CFD to coupler: bytes, names joined by newlines
pub const VOIDAGE_PATCH_NAMES: u32 = 58;
/// patch kind
pub const VOIDAGE_PATCH_BOUNDARY: i64 = 0;
/// patch kind
pub const VOIDAGE_PATCH_CYCLIC: i64 = 1;
/// patch kind
pub const VOIDAGE_PATCH_PROCESSOR: i64 = 2;
/// patch kind
pub const VOIDAGE_PATCH_PROCESSOR_CYCLIC: i64 = 3;
/// patch kind
pub const VOIDAGE_PATCH_EMPTY: i64 = 4;
/// element type
pub const VOIDAGE_F64: u32 = 0;
/// element type
pub const VOIDAGE_I64: u32 = 1;
/// element type
pub const VOIDAGE_U8: u32 = 2;
