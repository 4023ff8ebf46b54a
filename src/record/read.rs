// SPDX-License-Identifier: MIT OR Apache-2.0
//! Reads a recording chunk by chunk, in memory bounded by the largest chunk, which is bounded by the file.
//!
//! A file that ends within a chunk, or without its end mark, is that of a run that was killed: it is read to its last
//! whole chunk and `end` says so. Damage is an error that names the byte.

use super::chunk::{self, HEADER, Header};
use super::head::{self, Head, SessionHead};
use super::{RecordError, pack};
use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::path::Path;
use voidage_wire::PROTOCOL;

/// A chunk of a recording.
#[derive(Clone, Debug, PartialEq)]
pub struct Chunk {
    /// what it is
    pub head: Head,
    /// its payload
    pub words: Vec<u64>,
    /// byte at which it begins
    pub offset: u64,
}

/// How a recording ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// With its index and end mark.
    Whole,
    /// The run was killed; what stands from this byte on is no whole chunk, or nothing follows.
    Cut(u64),
}

/// A recording open for reading.
pub struct Reader<R: Read + Seek> {
    source: R,
    at: u64,
    length: u64,
    /// the run
    pub session: SessionHead,
    /// its case.toml, resolved
    pub case: String,
    /// how it ended, once read to the end
    pub end: Option<End>,
    name: String,
}

impl Reader<BufReader<File>> {
    /// Opens a file.
    pub fn open(path: &Path) -> Result<Self, RecordError> {
        let name = path.display().to_string();
        let file = File::open(path).map_err(|source| RecordError::File { what: name.clone(), source })?;
        if file.metadata().is_ok_and(|m| m.is_dir()) {
            return Err(RecordError::NotARecording(format!("{name} is a folder")));
        }
        Self::new(BufReader::with_capacity(1 << 16, file), &name)
    }
}

impl<R: Read + Seek> Reader<R> {
    /// Reads the file head and the session; `name` for messages.
    pub fn new(mut source: R, name: &str) -> Result<Self, RecordError> {
        let fail = |source| RecordError::File { what: name.into(), source };
        let length = source.seek(SeekFrom::End(0)).map_err(fail)?;
        source.seek(SeekFrom::Start(0)).map_err(fail)?;
        let mut first = vec![0; length.min(chunk::FILE_HEAD as u64) as usize];
        source.read_exact(&mut first).map_err(fail)?;
        chunk::check_file_head(&first)?;
        let (session, case) = (SessionHead::default(), String::new());
        let mut r =
            Self { source, at: chunk::FILE_HEAD as u64, length, session, case, end: None, name: name.into() };
        let Some(Chunk { head: Head::Session(s), words, offset }) = r.next()? else {
            return Err(RecordError::NoExchange);
        };
        if s.protocol != PROTOCOL {
            return Err(RecordError::Protocol { theirs: s.protocol, program: s.program });
        }
        let text = usize::try_from(s.text).ok().and_then(|n| bytemuck::cast_slice(&words).get(..n));
        let damaged = || RecordError::Damaged { offset, what: "case.toml".into() };
        r.case = text.and_then(|t| String::from_utf8(t.to_vec()).ok()).ok_or_else(damaged)?;
        if u64::from(s.dem_ranks) + u64::from(s.cfd_ranks) > 1_000_000 {
            return Err(RecordError::Damaged { offset, what: "number of ranks".into() });
        }
        r.session = s;
        Ok(r)
    }

    fn fail(&self, source: std::io::Error) -> RecordError {
        RecordError::File { what: self.name.clone(), source }
    }

    fn cut<T>(&mut self, offset: u64) -> Result<Option<T>, RecordError> {
        self.end = Some(End::Cut(offset));
        Ok(None)
    }

    /// The head of the next chunk and its header; the payload is not read yet.
    fn head(&mut self) -> Result<Option<(Head, Header, u64)>, RecordError> {
        let offset = self.at;
        let left = self.length.saturating_sub(offset);
        if self.end.is_some() || left < HEADER as u64 {
            return if self.end.is_some() { Ok(None) } else { self.cut(offset) };
        }
        let mut bytes = [0; HEADER];
        self.source.read_exact(&mut bytes).map_err(|e| self.fail(e))?;
        let header = Header::parse(&bytes, offset)?;
        if left < (HEADER + header.head) as u64 {
            return self.cut(offset);
        }
        let mut head = vec![0; header.head];
        self.source.read_exact(&mut head).map_err(|e| self.fail(e))?;
        header.check(&bytes, &head, offset)?;
        let begin = offset + (HEADER + header.head) as u64;
        if header.stored > self.length - begin {
            return self.cut(offset);
        }
        let head = head::decode(&head).map_err(|what| RecordError::Damaged { offset, what })?;
        self.at = begin;
        Ok(Some((head, header, offset)))
    }

    /// The next chunk; `None` at the end (`end` says which).
    #[allow(clippy::should_implement_trait)] // fallible
    pub fn next(&mut self) -> Result<Option<Chunk>, RecordError> {
        let Some((head, header, offset)) = self.head()? else { return Ok(None) };
        // not more than the file has: checked above
        let mut stored = vec![0; header.stored as usize];
        self.source.read_exact(&mut stored).map_err(|e| self.fail(e))?;
        if chunk::sum(&[&stored]) != header.sum {
            let what = "the checksum of a payload is wrong".into();
            return Err(RecordError::Damaged { offset, what });
        }
        let words = pack::unpack(header.packing, &stored, header.raw, offset)?;
        self.at += header.stored;
        if head == Head::Index {
            return self.last(offset);
        }
        Ok(Some(Chunk { head, words, offset }))
    }

    /// After the index there is the end mark, and nothing else.
    fn last(&mut self, index: u64) -> Result<Option<Chunk>, RecordError> {
        let offset = self.at;
        let left = self.length - offset;
        if left < chunk::END as u64 {
            return self.cut(offset);
        }
        let mut end = [0; chunk::END];
        self.source.read_exact(&mut end).map_err(|e| self.fail(e))?;
        if chunk::index_of(&end) != Some(index) || left > chunk::END as u64 {
            return Err(RecordError::Damaged { offset, what: "the end mark is wrong".into() });
        }
        self.at = self.length;
        self.end = Some(End::Whole);
        Ok(None)
    }

    /// Goes to a chunk by its byte.
    pub fn seek(&mut self, offset: u64) -> Result<(), RecordError> {
        self.source.seek(SeekFrom::Start(offset)).map_err(|e| self.fail(e))?;
        self.at = offset;
        self.end = None;
        Ok(())
    }

    /// Recorded exchanges and the bytes at which they begin: from the index, else from the heads of all chunks. The
    /// reader stands at the first chunk after the session again.
    pub fn exchanges(&mut self) -> Result<(Vec<(i64, u64)>, End), RecordError> {
        let back = self.at;
        let found = match self.index()? {
            Some(list) => (list, End::Whole),
            None => self.scan(back)?,
        };
        self.seek(back)?;
        Ok(found)
    }

    fn index(&mut self) -> Result<Option<Vec<(i64, u64)>>, RecordError> {
        let Some(begin) = self.length.checked_sub(chunk::END as u64) else { return Ok(None) };
        self.source.seek(SeekFrom::Start(begin)).map_err(|e| self.fail(e))?;
        let mut end = [0; chunk::END];
        self.source.read_exact(&mut end).map_err(|e| self.fail(e))?;
        let Some(at) = chunk::index_of(&end).filter(|at| *at < begin) else { return Ok(None) };
        self.seek(at)?;
        let Some((Head::Index, header, offset)) = self.head()? else { return Ok(None) };
        let mut stored = vec![0; header.stored as usize];
        self.source.read_exact(&mut stored).map_err(|e| self.fail(e))?;
        let words = pack::unpack(header.packing, &stored, header.raw, offset)?;
        let list: Vec<(i64, u64)> = words.chunks_exact(2).map(|w| (w[0] as i64, w[1])).collect();
        let good = chunk::sum(&[&stored]) == header.sum
            && list.iter().all(|e| e.1 < at)
            && list.is_sorted_by(|a, b| a.0 < b.0);
        if good {
            Ok(Some(list))
        } else {
            Err(RecordError::Damaged { offset, what: "the index is wrong".into() })
        }
    }

    fn scan(&mut self, from: u64) -> Result<(Vec<(i64, u64)>, End), RecordError> {
        self.seek(from)?;
        let (mut list, mut early) = (Vec::new(), None::<(i64, u64)>);
        while let Some((head, header, offset)) = self.head()? {
            match head {
                Head::Message { step, sent: false, .. } if early.is_none_or(|e| e.0 < step) => {
                    early = Some((step, offset));
                }
                Head::Exchange { k, .. } => {
                    let at = early.filter(|e| e.0 == k).map_or(offset, |e| e.1);
                    list.push((k, at));
                }
                Head::Index => {
                    self.end = Some(End::Cut(offset));
                    break;
                }
                _ => {}
            }
            let next = self.at + header.stored;
            self.seek(next)?;
        }
        let end = self.end.unwrap_or(End::Cut(self.at));
        Ok((list, end))
    }
}
