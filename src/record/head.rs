// SPDX-License-Identifier: MIT OR Apache-2.0
//! What stands at the head of a chunk; the only user of bincode in recordings. New kinds are added at the end: the number
//! of a kind is its place here.

use crate::monitor::Row;
use serde::{Deserialize, Serialize};

/// The run that was recorded; payload: its case.toml, resolved.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SessionHead {
    /// version of voidage that wrote it
    pub program: String,
    /// version of the messages
    pub protocol: u32,
    /// token of the run
    pub token: String,
    /// number of DEM ranks
    pub dem_ranks: u32,
    /// number of CFD ranks
    pub cfd_ranks: u32,
    /// fluid time of exchange 0, s
    pub origin: f64,
    /// fluid time at which the run was to end, s
    pub end: f64,
    /// fluid step = coupling period, s
    pub period: f64,
    /// exchange of the restart set the run went on from; its messages are recorded, and not answered anew
    pub resumed: Option<i64>,
    /// bytes of case.toml in the payload
    pub text: u64,
}

/// What a chunk is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Head {
    /// First chunk.
    Session(SessionHead),
    /// A message; payload: its words.
    Message {
        /// DEM ranks, then CFD ranks
        partner: u32,
        /// true: sent by the coupler
        sent: bool,
        /// kind of the message
        kind: u32,
        /// its exchange
        step: i64,
    },
    /// A recorded exchange begins; no payload.
    Exchange {
        /// its number
        k: i64,
        /// fluid time at its end, s
        time: f64,
    },
    /// What the coupler carries into exchange `k`, where the one before is not recorded. Payload: voidage (cells), fluid
    /// velocity (3 x cells), fluid velocity one step earlier (3 x cells, or nothing).
    State {
        /// the coming exchange
        k: i64,
        /// number of cells
        cells: u64,
    },
    /// A row of the monitor, of every exchange; no payload.
    Row(Row),
    /// Where recorded exchanges begin. Payload: pairs of exchange and byte.
    Index,
    /// Forces in force in exchange `k`, behind its begin, if `auto` may switch them; no payload.
    Choice {
        /// the exchange
        k: i64,
        /// bits in the order of `auto::SWITCHES`
        on: u32,
    },
}

/// Longest head, bytes.
pub const LONGEST: usize = 4096;

/// As bytes.
pub fn encode(head: &Head) -> Vec<u8> {
    bincode::serde::encode_to_vec(head, bincode::config::standard()).expect("heads always encode")
}

/// From bytes; never takes more memory than `LONGEST`.
pub fn decode(bytes: &[u8]) -> Result<Head, String> {
    let config = bincode::config::standard().with_limit::<LONGEST>();
    match bincode::serde::decode_from_slice(bytes, config) {
        Ok((head, used)) if used == bytes.len() => Ok(head),
        Ok((_, used)) => Err(format!("{} bytes left over in a head", bytes.len() - used)),
        Err(e) => Err(format!("head: {e}")),
    }
}
