// SPDX-License-Identifier: MIT OR Apache-2.0
//! Payloads of a chunk: words as they are, or LZ4 over their bytes sorted by significance.
//!
//! Doubles of one field share sign, exponent and first digits; sorted, these are long runs, the last digits stay as they
//! are. LZ4 expands at most 255 times, which bounds what a file can claim.

use super::RecordError;
use crate::config::Compression;

/// The code in a chunk's header.
pub const PLAIN: u32 = 0;
/// The code in a chunk's header.
pub const SORTED_LZ4: u32 = 1;

/// Byte b of word i goes to place b·n + i. A block of words at a time stays in the cache.
fn sort(words: &[u64], out: &mut Vec<u8>) {
    let n = words.len();
    out.clear();
    out.resize(8 * n, 0);
    let mut planes = out.chunks_exact_mut(n.max(1));
    let planes: [&mut [u8]; 8] = std::array::from_fn(|_| planes.next().unwrap_or_default());
    for (i, w) in words.iter().enumerate() {
        let bytes = w.to_le_bytes();
        for b in 0..8 {
            planes[b][i] = bytes[b];
        }
    }
}

fn unsort(bytes: &[u8], words: &mut Vec<u64>) {
    let n = bytes.len() / 8;
    words.clear();
    words.extend((0..n).map(|i| u64::from_le_bytes(std::array::from_fn(|b| bytes[b * n + i]))));
}

/// Scratch memory of a packer.
#[derive(Default)]
pub struct Packer {
    sorted: Vec<u8>,
    packed: Vec<u8>,
}

impl Packer {
    /// Code and bytes to store; plain where packing gains nothing.
    pub fn pack<'a>(&'a mut self, words: &'a [u64], how: Compression) -> (u32, &'a [u8]) {
        let plain = bytemuck::cast_slice(words);
        if how == Compression::None || words.len() < 16 {
            return (PLAIN, plain);
        }
        sort(words, &mut self.sorted);
        self.packed.resize(lz4_flex::block::get_maximum_output_size(self.sorted.len()), 0);
        match lz4_flex::block::compress_into(&self.sorted, &mut self.packed) {
            Ok(n) if n < plain.len() => (SORTED_LZ4, &self.packed[..n]),
            _ => (PLAIN, plain),
        }
    }
}

/// The words of a payload of `raw` bytes, stored as `bytes`; `offset`: its chunk, for errors.
pub fn unpack(code: u32, bytes: &[u8], raw: u64, offset: u64) -> Result<Vec<u64>, RecordError> {
    let damaged = |what: String| RecordError::Damaged { offset, what };
    let n = usize::try_from(raw).ok().filter(|n| n.is_multiple_of(8));
    let n = n.ok_or_else(|| damaged(format!("{raw} bytes are no whole words")))?;
    let mut words = Vec::new();
    match code {
        PLAIN if bytes.len() == n => {
            words.resize(n / 8, 0);
            bytemuck::cast_slice_mut::<u64, u8>(&mut words).copy_from_slice(bytes);
        }
        SORTED_LZ4 if n / 255 <= bytes.len() => {
            let mut sorted = vec![0; n];
            let got = lz4_flex::block::decompress_into(bytes, &mut sorted);
            if got.as_ref().ok() != Some(&n) {
                return Err(damaged(format!("{got:?} of {n} bytes could be unpacked")));
            }
            unsort(&sorted, &mut words);
        }
        PLAIN | SORTED_LZ4 => return Err(damaged(format!("{} bytes stored for {n}", bytes.len()))),
        _ => return Err(damaged(format!("unknown compression {code}"))),
    }
    Ok(words)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_come_back_and_fields_shrink() {
        let field: Vec<u64> = (0..5000).map(|i| (1.0 + 1e-3 * f64::from(i).sin()).to_bits()).collect();
        let mut p = Packer::default();
        for words in [&field[..], &field[..3], &[]] {
            for how in [Compression::None, Compression::Lz4] {
                let (code, bytes) = p.pack(words, how);
                let bytes = bytes.to_vec();
                assert_eq!(unpack(code, &bytes, 8 * words.len() as u64, 0).unwrap(), words);
                assert!(unpack(code, &bytes, 8 * words.len() as u64 + 8, 0).is_err());
            }
        }
        let (code, bytes) = p.pack(&field, Compression::Lz4);
        assert!(code == SORTED_LZ4 && bytes.len() < 36_000, "{}", bytes.len());
    }
}
