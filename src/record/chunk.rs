// SPDX-License-Identifier: MIT OR Apache-2.0
//! The container: a file head, then chunks, each a fixed header, a head (`head`) and a payload of words.
//!
//! ```text
//! file head   8 bytes "VOIDREC\n", u32 0x01020304, u32 format
//! chunk       u32 marker, u32 bytes of the head, u64 bytes stored, u64 bytes of the payload, u32 packing (`pack`), u32 0,
//!             u64 checksum of the stored payload, u64 checksum of header and head; head; stored payload
//! end         8 bytes "VOIDEND\n", u64 byte at which the index chunk begins, u64 checksum of both
//! ```
//! All numbers little-endian. A header whose checksum is right and whose payload is cut short is the end of a run that was
//! killed; anything else that does not fit is damage. Does not know what chunks mean.

use super::{FORMAT, RecordError, head};
use crate::output::restart::Sum64;

/// First bytes of a recording.
pub const MAGIC: &[u8; 8] = b"VOIDREC\n";
const ORDER: u32 = 0x0102_0304;
const MARKER: u32 = 0x4b4e_4843;
/// Bytes of the file head.
pub const FILE_HEAD: usize = 16;
/// Bytes of a chunk's header.
pub const HEADER: usize = 48;
/// First bytes of the end mark.
const LAST: &[u8; 8] = b"VOIDEND\n";
/// Bytes of the end mark.
pub const END: usize = 24;

/// The first bytes of the file.
pub fn file_head() -> [u8; FILE_HEAD] {
    let mut b = [0; FILE_HEAD];
    b[..8].copy_from_slice(MAGIC);
    b[8..12].copy_from_slice(&ORDER.to_le_bytes());
    b[12..].copy_from_slice(&FORMAT.to_le_bytes());
    b
}

/// Refuses what is not a recording of this format.
pub fn check_file_head(bytes: &[u8]) -> Result<(), RecordError> {
    let short = || RecordError::NotARecording(format!("it has {} bytes", bytes.len()));
    let head = bytes.get(..FILE_HEAD).ok_or_else(short)?;
    if &head[..8] != MAGIC {
        let begin = String::from_utf8_lossy(&head[..8]).escape_debug().to_string();
        return Err(RecordError::NotARecording(format!("it begins with \"{begin}\"")));
    }
    match u32_at(head, 8) {
        ORDER => {}
        o if o == ORDER.swap_bytes() => return Err(RecordError::ByteOrder),
        _ => return Err(RecordError::Damaged { offset: 8, what: "byte order mark".into() }),
    }
    match u32_at(head, 12) {
        FORMAT => Ok(()),
        theirs => Err(RecordError::Version { theirs }),
    }
}

fn u32_at(b: &[u8], at: usize) -> u32 {
    u32::from_le_bytes(std::array::from_fn(|i| b[at + i]))
}
fn u64_at(b: &[u8], at: usize) -> u64 {
    u64::from_le_bytes(std::array::from_fn(|i| b[at + i]))
}

/// Checksum of bytes and their number: four sums side by side, each over every fourth word, so that it is as fast as
/// memory; any change of one word changes it.
pub fn sum(parts: &[&[u8]]) -> u64 {
    let mut lanes = [Sum64::default(); 4];
    let mut whole = Sum64::default();
    for p in parts {
        let blocks = p.chunks_exact(32);
        let rest = blocks.remainder();
        for b in blocks {
            for (i, lane) in lanes.iter_mut().enumerate() {
                lane.word(u64_at(b, 8 * i));
            }
        }
        whole.bytes(rest);
        whole.word(p.len() as u64);
    }
    lanes.iter().for_each(|l| whole.word(l.value()));
    whole.value()
}

/// Header of a chunk.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Header {
    /// bytes of the head
    pub head: usize,
    /// bytes of the payload in the file
    pub stored: u64,
    /// bytes of the payload
    pub raw: u64,
    /// code of `pack`
    pub packing: u32,
    /// of the payload in the file
    pub sum: u64,
    /// of header and head
    own: u64,
}

/// Header and head of a chunk, to be followed by `stored`.
pub fn header(head: &[u8], stored: &[u8], raw: u64, packing: u32) -> Vec<u8> {
    let mut b = Vec::with_capacity(HEADER + head.len());
    b.extend(MARKER.to_le_bytes());
    b.extend((head.len() as u32).to_le_bytes());
    b.extend((stored.len() as u64).to_le_bytes());
    b.extend(raw.to_le_bytes());
    b.extend(packing.to_le_bytes());
    b.extend([0; 4]);
    b.extend(sum(&[stored]).to_le_bytes());
    b.extend(sum(&[&b, head]).to_le_bytes());
    b.extend(head);
    b
}

impl Header {
    /// Reads `HEADER` bytes; lengths are believed only after `check`.
    pub fn parse(b: &[u8; HEADER], offset: u64) -> Result<Self, RecordError> {
        let damaged = |what: &str| RecordError::Damaged { offset, what: what.into() };
        if u32_at(b, 0) != MARKER {
            return Err(damaged("no chunk begins here"));
        }
        let head = u32_at(b, 4) as usize;
        if head > head::LONGEST {
            return Err(damaged("the length of a head"));
        }
        Ok(Self {
            head,
            stored: u64_at(b, 8),
            raw: u64_at(b, 16),
            packing: u32_at(b, 24),
            sum: u64_at(b, 32),
            own: u64_at(b, 40),
        })
    }
    /// Do header and head belong together?
    pub fn check(&self, header: &[u8; HEADER], head: &[u8], offset: u64) -> Result<(), RecordError> {
        if sum(&[&header[..40], head]) == self.own {
            return Ok(());
        }
        Err(RecordError::Damaged { offset, what: "the checksum of a chunk's header is wrong".into() })
    }
}

/// The end mark of a file whose index begins at `index`.
pub fn end(index: u64) -> [u8; END] {
    let mut b = [0; END];
    b[..8].copy_from_slice(LAST);
    b[8..16].copy_from_slice(&index.to_le_bytes());
    let s = sum(&[&b[..16]]);
    b[16..].copy_from_slice(&s.to_le_bytes());
    b
}

/// Where the index begins, if these bytes are an end mark.
pub fn index_of(end: &[u8]) -> Option<u64> {
    let good = end.len() == END && &end[..8] == LAST && u64_at(end, 16) == sum(&[&end[..16]]);
    good.then(|| u64_at(end, 8))
}
