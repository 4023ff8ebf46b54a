// SPDX-License-Identifier: MIT OR Apache-2.0
//! Handshake: what a partner rank says first, and what the coupler answers.
//!
//! Encoded with serde and bincode (this module is the only user). Does not know configuration files.

use crate::Process;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Which side of the coupling a partner is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Role {
    /// Particles.
    Dem,
    /// Fluid.
    Cfd,
}

impl Role {
    /// Channel and log name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Dem => "dem",
            Self::Cfd => "cfd",
        }
    }
}

/// First message of a partner rank.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Hello {
    /// Token of the run: a partner of another run is refused.
    pub token: String,
    /// Which side.
    pub role: Role,
    /// Rank in this program's MPI world.
    pub rank: u32,
    /// Size of this program's MPI world.
    pub size: u32,
    /// Own time step, s.
    pub time_step: f64,
    /// Own step number at the start.
    pub step: i64,
    /// Own physical time at the start, s.
    pub time: f64,
    /// Program name and version, for messages.
    pub program: String,
    /// Who it is, to notice its death.
    pub process: Process,
}

/// The coupler's answer: numbers by name (`fluid.density` …, see `docs/wire.md`).
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Welcome {
    /// Settings by name, SI units.
    pub settings: BTreeMap<String, f64>,
}

/// Encodes a handshake struct.
pub fn encode<T: Serialize>(value: &T) -> Vec<u8> {
    bincode::serde::encode_to_vec(value, bincode::config::standard())
        .expect("handshake structs always encode")
}

/// Decodes a handshake struct; never takes more memory than 64 KiB.
pub fn decode<T: for<'a> Deserialize<'a>>(bytes: &[u8]) -> Result<T, String> {
    let config = bincode::config::standard().with_limit::<65_536>();
    match bincode::serde::decode_from_slice(bytes, config) {
        Ok((value, used)) if used == bytes.len() => Ok(value),
        Ok((_, used)) => Err(format!("{} bytes left over", bytes.len() - used)),
        Err(e) => Err(e.to_string()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn handshake_survives_the_wire_and_damage_is_an_error() {
        let hello = Hello {
            token: "t".into(),
            role: Role::Dem,
            rank: 1,
            size: 2,
            time_step: 1e-5,
            step: 7,
            time: 0.5,
            program: "LIGGGHTS".into(),
            process: Process { pid: 3, started: 4 },
        };
        let bytes = encode(&hello);
        assert_eq!(decode::<Hello>(&bytes).unwrap(), hello);
        for cut in 0..bytes.len() {
            assert!(decode::<Hello>(&bytes[..cut]).is_err());
        }
        let huge = [0xfd; 40];
        assert!(decode::<Hello>(&huge).is_err());
    }
}
