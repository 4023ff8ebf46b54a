// SPDX-License-Identifier: MIT OR Apache-2.0
//! One message in memory: a header, a table of blocks, the arrays; all in 64-bit words.
//!
//! ```text
//! word 0  magic (upper 32 bits "VOID") | protocol version (lower 32 bits)
//! word 1  kind            word 2  step (i64)      word 3  time, s (f64)
//! word 4  number of blocks                        word 5  length of the frame in words
//! then per block 3 words: field | type << 32, number of elements, offset of the array in words
//! then the arrays, each starting on a word
//! ```
//! Arrays are written and read in place. Frames never leave the machine, so the byte order is native;
//! `magic` shows a mismatch. Does not know what the arrays mean.

use crate::PROTOCOL;
use thiserror::Error;

const MAGIC: u64 = 0x564f_4944_0000_0000;
const HEADER: usize = 6;
const PER_BLOCK: usize = 3;

/// Type of the elements of an array.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum ElementType {
    /// 64-bit float
    F64 = 0,
    /// 64-bit signed integer
    I64 = 1,
    /// bytes
    U8 = 2,
}

impl ElementType {
    /// From the number of `voidage.h`.
    pub fn from_code(code: u32) -> Option<Self> {
        [Self::F64, Self::I64, Self::U8].into_iter().find(|t| *t as u32 == code)
    }
}

/// An array of a message: which, of what, how many elements.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Block {
    /// Number of `field`.
    pub field: u32,
    /// Element type.
    pub of: ElementType,
    /// Number of elements (not bytes; 3 n for a vector array).
    pub count: usize,
}

impl Block {
    /// Array of floats.
    pub fn f64s(field: u32, count: usize) -> Self {
        Self { field, of: ElementType::F64, count }
    }
    /// Array of integers.
    pub fn i64s(field: u32, count: usize) -> Self {
        Self { field, of: ElementType::I64, count }
    }
    /// Bytes.
    pub fn bytes(field: u32, count: usize) -> Self {
        Self { field, of: ElementType::U8, count }
    }
    fn words(&self) -> usize {
        if self.of == ElementType::U8 { self.count.div_ceil(8) } else { self.count }
    }
}

/// A frame that cannot be read.
#[derive(Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum WireError {
    /// Not a frame of voidage.
    #[error("not a voidage message (first word {0:#018x})")]
    NotAFrame(u64),
    /// Other version.
    #[error(
        "protocol version {theirs}, this program speaks {ours}: install matching parts of voidage (./setup build)"
    )]
    Version {
        /// version of the frame
        theirs: u32,
        /// our version
        ours: u32,
    },
    /// Inconsistent lengths.
    #[error("damaged message: {0}")]
    Damaged(String),
    /// An array is missing or of another type or length.
    #[error("message {kind}: array {field}: {problem}")]
    Array {
        /// message kind
        kind: u32,
        /// array number
        field: u32,
        /// what is wrong
        problem: String,
    },
    /// Wrong kind.
    #[error("message of kind {got} arrived where {expected} was due")]
    Unexpected {
        /// kind received
        got: u32,
        /// kind expected
        expected: u32,
    },
}

/// Words needed for a frame with these blocks.
pub fn words(blocks: &[Block]) -> usize {
    HEADER + PER_BLOCK * blocks.len() + blocks.iter().map(Block::words).sum::<usize>()
}

/// Writes header and block table into `frame` and zeroes the arrays. `frame` has `words(blocks)` words.
pub fn start(frame: &mut [u64], kind: u32, step: i64, time: f64, blocks: &[Block]) {
    frame.fill(0);
    frame[0] = MAGIC | u64::from(PROTOCOL);
    frame[1] = u64::from(kind);
    frame[2] = step as u64;
    frame[3] = time.to_bits();
    frame[4] = blocks.len() as u64;
    frame[5] = frame.len() as u64;
    let mut offset = HEADER + PER_BLOCK * blocks.len();
    for (i, b) in blocks.iter().enumerate() {
        let entry = &mut frame[HEADER + PER_BLOCK * i..][..PER_BLOCK];
        entry[0] = u64::from(b.field) | (b.of as u64) << 32;
        entry[1] = b.count as u64;
        entry[2] = offset as u64;
        offset += b.words();
    }
}

fn entry(frame: &[u64], i: usize) -> Result<(u32, ElementType, usize, std::ops::Range<usize>), WireError> {
    let e = &frame[HEADER + PER_BLOCK * i..][..PER_BLOCK];
    let damaged = |what: &str| WireError::Damaged(format!("block {i}: {what}"));
    let of = ElementType::from_code((e[0] >> 32) as u32).ok_or_else(|| damaged("unknown element type"))?;
    let count = usize::try_from(e[1]).map_err(|_| damaged("length"))?;
    let offset = usize::try_from(e[2]).map_err(|_| damaged("offset"))?;
    let words = if of == ElementType::U8 { count.div_ceil(8) } else { count };
    let end =
        offset.checked_add(words).filter(|e| *e <= frame.len()).ok_or_else(|| damaged("beyond the end"))?;
    Ok((e[0] as u32, of, count, offset..end))
}

/// The words of an array of a frame under construction; `None` if it was not declared.
pub fn array_mut(frame: &mut [u64], field: u32) -> Option<&mut [u64]> {
    let n = usize::try_from(frame[4]).ok()?;
    let (.., range) = (0..n).filter_map(|i| entry(frame, i).ok()).find(|e| e.0 == field)?;
    Some(&mut frame[range])
}

/// The floats of an array under construction.
pub fn f64s_mut(frame: &mut [u64], field: u32) -> Option<&mut [f64]> {
    array_mut(frame, field).map(bytemuck::cast_slice_mut)
}

/// A message received, read in place.
#[derive(Clone, Copy, Debug)]
pub struct Frame<'a> {
    words: &'a [u64],
    n_blocks: usize,
}

impl<'a> Frame<'a> {
    /// Checks magic, version and all lengths.
    pub fn parse(words: &'a [u64]) -> Result<Self, WireError> {
        let first = words.first().copied().unwrap_or(0);
        if first >> 32 << 32 != MAGIC {
            return Err(WireError::NotAFrame(first));
        }
        if first as u32 != PROTOCOL {
            return Err(WireError::Version { theirs: first as u32, ours: PROTOCOL });
        }
        if words.len() < HEADER || words[5] != words.len() as u64 {
            let told = words.get(5).copied().unwrap_or(0);
            return Err(WireError::Damaged(format!("{} words, header says {told}", words.len())));
        }
        let n_blocks = usize::try_from(words[4]).unwrap_or(usize::MAX);
        if n_blocks > (words.len() - HEADER) / PER_BLOCK {
            return Err(WireError::Damaged(format!("{n_blocks} blocks in {} words", words.len())));
        }
        for i in 0..n_blocks {
            entry(words, i)?;
        }
        Ok(Self { words, n_blocks })
    }
    /// Message kind.
    pub fn kind(&self) -> u32 {
        self.words[1] as u32
    }
    /// Exchange number.
    pub fn step(&self) -> i64 {
        self.words[2] as i64
    }
    /// Physical time, s.
    pub fn time(&self) -> f64 {
        f64::from_bits(self.words[3])
    }
    /// All arrays in it.
    pub fn blocks(&self) -> impl Iterator<Item = Block> + '_ {
        (0..self.n_blocks).filter_map(|i| entry(self.words, i).ok()).map(|(field, of, count, _)| Block {
            field,
            of,
            count,
        })
    }
    fn find(&self, field: u32, of: ElementType) -> Result<(&'a [u64], usize), WireError> {
        let fail = |problem: &str| WireError::Array { kind: self.kind(), field, problem: problem.into() };
        let (_, got, count, range) = (0..self.n_blocks)
            .filter_map(|i| entry(self.words, i).ok())
            .find(|e| e.0 == field)
            .ok_or_else(|| fail("is missing"))?;
        if got != of { Err(fail("has another element type")) } else { Ok((&self.words[range], count)) }
    }
    /// An array of any type as words, its type and length.
    pub fn raw(&self, field: u32) -> Option<(&'a [u64], ElementType, usize)> {
        let (_, of, count, range) =
            (0..self.n_blocks).filter_map(|i| entry(self.words, i).ok()).find(|e| e.0 == field)?;
        Some((&self.words[range], of, count))
    }
    /// An array of floats.
    pub fn f64s(&self, field: u32) -> Result<&'a [f64], WireError> {
        Ok(bytemuck::cast_slice(self.find(field, ElementType::F64)?.0))
    }
    /// An array of floats that must have `count` elements.
    pub fn f64s_of(&self, field: u32, count: usize) -> Result<&'a [f64], WireError> {
        let a = self.f64s(field)?;
        if a.len() == count {
            return Ok(a);
        }
        let problem = format!("has {} elements, {count} are due", a.len());
        Err(WireError::Array { kind: self.kind(), field, problem })
    }
    /// An array of 3-vectors, `count` of them.
    pub fn vectors_of(&self, field: u32, count: usize) -> Result<&'a [[f64; 3]], WireError> {
        Ok(bytemuck::cast_slice(self.f64s_of(field, 3 * count)?))
    }
    /// An array of integers.
    pub fn i64s(&self, field: u32) -> Result<&'a [i64], WireError> {
        Ok(bytemuck::cast_slice(self.find(field, ElementType::I64)?.0))
    }
    /// Bytes.
    pub fn bytes(&self, field: u32) -> Result<&'a [u8], WireError> {
        let (words, count) = self.find(field, ElementType::U8)?;
        Ok(&bytemuck::cast_slice(words)[..count])
    }
    /// Text (HELLO, FAIL, STOP …), damaged UTF-8 replaced.
    pub fn text(&self) -> String {
        self.bytes(crate::field::TEXT).map(|b| String::from_utf8_lossy(b).into_owned()).unwrap_or_default()
    }
    /// Refuses any other kind.
    pub fn expect(&self, kind: u32) -> Result<(), WireError> {
        if self.kind() == kind {
            Ok(())
        } else {
            Err(WireError::Unexpected { got: self.kind(), expected: kind })
        }
    }
}

/// A small message with one array of bytes, ready to be copied into a loan.
pub fn text_frame(kind: u32, step: i64, text: &[u8]) -> Vec<u64> {
    let blocks = [Block::bytes(crate::field::TEXT, text.len())];
    let mut frame = vec![0; words(&blocks)];
    start(&mut frame, kind, step, 0.0, &blocks);
    if let Some(array) = array_mut(&mut frame, crate::field::TEXT) {
        bytemuck::cast_slice_mut::<u64, u8>(array)[..text.len()].copy_from_slice(text);
    }
    frame
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample() -> Vec<u64> {
        let blocks = [Block::f64s(3, 6), Block::i64s(1, 2), Block::bytes(90, 5)];
        let mut f = vec![0; words(&blocks)];
        start(&mut f, 10, -7, 0.25, &blocks);
        f64s_mut(&mut f, 3).unwrap().copy_from_slice(&[1., 2., 3., 4., 5., 6.]);
        array_mut(&mut f, 1).unwrap()[1] = (-4i64) as u64;
        f
    }

    #[test]
    fn arrays_come_back_as_written() {
        let words = sample();
        let f = Frame::parse(&words).unwrap();
        assert_eq!((f.kind(), f.step(), f.time()), (10, -7, 0.25));
        assert_eq!(f.vectors_of(3, 2).unwrap()[1], [4., 5., 6.]);
        assert_eq!(f.i64s(1).unwrap(), [0, -4]);
        assert_eq!(f.bytes(90).unwrap().len(), 5);
        assert!(f.f64s(1).unwrap_err().to_string().contains("another element type"));
        assert!(f.f64s_of(3, 7).unwrap_err().to_string().contains("has 6 elements, 7 are due"));
        assert!(f.f64s(99).unwrap_err().to_string().contains("is missing"));
    }

    #[test]
    fn damaged_frames_are_errors_not_panics() {
        let good = sample();
        for word in 0..15 {
            for value in [0, 1, 7, 1 << 40, u64::MAX] {
                let mut bad = good.clone();
                bad[word] = value;
                let _ = Frame::parse(&bad).map(|f| (f.blocks().count(), f.f64s(3).is_ok(), f.text()));
            }
        }
        assert!(Frame::parse(&good[..4]).is_err());
        assert!(Frame::parse(&[]).is_err());
        assert!(Frame::parse(&good[..good.len() - 1]).is_err());
    }

    #[test]
    fn another_protocol_version_is_named() {
        let mut f = sample();
        f[0] += 1;
        let e = Frame::parse(&f).unwrap_err();
        assert_eq!(e, WireError::Version { theirs: PROTOCOL + 1, ours: PROTOCOL });
        assert!(e.to_string().contains("./setup build"));
    }
}
