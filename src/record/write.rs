// SPDX-License-Identifier: MIT OR Apache-2.0
//! Records a live run: chunks are handed to a thread that packs and writes them, so the exchange only pays for a copy.
//!
//! Each chunk goes to the system in one piece before the next: a run that is killed leaves whole chunks and at most one
//! cut short. What cannot be written ends the run. At most `QUEUE` messages wait; then the run waits for the disk.

use super::head::{self, Head, SessionHead};
use super::{RecordError, chunk, pack::Packer};
use crate::config::{Compression, Config};
use crate::monitor::Row;
use crate::step::CouplingStep;
use std::cell::RefCell;
use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use voidage_wire::{Frame, kind};

/// Messages that may wait for the disk.
const QUEUE: usize = 16;

/// Which exchanges are recorded: any of these.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Selection {
    /// every n-th, from 0 on; 0: none
    pub every: u32,
    /// the first n
    pub first: u32,
    /// the last n before `steps`
    pub last: u32,
    /// fluid steps of the run
    pub steps: u64,
}

impl Selection {
    /// Of a case.
    pub fn of(c: &Config) -> Self {
        let r = &c.file.record;
        Self { every: r.every, first: r.first, last: r.last, steps: c.steps() }
    }
    /// Is anything recorded?
    pub fn any(&self) -> bool {
        self.every + self.first + self.last > 0
    }
    /// Is exchange k recorded?
    pub fn takes(&self, k: i64) -> bool {
        let Ok(n) = u64::try_from(k) else { return false };
        let every = self.every > 0 && n.is_multiple_of(u64::from(self.every));
        every || n < u64::from(self.first) || n + u64::from(self.last) > self.steps
    }
}

/// Where a case is recorded; `from`: fluid time of a restart (s), which begins a file of its own.
pub fn file(c: &Config, from: Option<f64>) -> PathBuf {
    let path = c.folder.join(&c.file.record.file);
    let Some(t) = from else { return path };
    let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let ext = path.extension().map(|e| format!(".{}", e.to_string_lossy())).unwrap_or_default();
    path.with_file_name(format!("{stem}-from-{t}{ext}"))
}

/// One chunk on its way.
struct Job {
    head: Head,
    words: Vec<u64>,
}

struct Inner {
    selection: Selection,
    /// last exchange whose begin was recorded
    last: Option<i64>,
    jobs: Option<SyncSender<Job>>,
    /// used buffers come back
    spare: Receiver<Vec<u64>>,
    thread: Option<JoinHandle<Result<u64, RecordError>>>,
    path: PathBuf,
    /// what recording took of the exchange
    spent: Duration,
}

/// Handle of a recording under way; clones share it.
#[derive(Clone)]
pub struct Recorder(Rc<RefCell<Inner>>);

impl Recorder {
    /// Begins the file, which must not exist; `text`: case.toml, resolved.
    pub fn create(
        path: &Path,
        selection: Selection,
        how: Compression,
        session: SessionHead,
        text: &str,
    ) -> Result<Self, RecordError> {
        let fail = |source| RecordError::File { what: format!("recording {}", path.display()), source };
        if cfg!(target_endian = "big") {
            return Err(RecordError::ByteOrder);
        }
        let mut file = File::create_new(path).map_err(fail)?;
        file.write_all(&chunk::file_head()).map_err(fail)?;
        let (jobs, todo) = sync_channel::<Job>(QUEUE);
        let (back, spare) = sync_channel(QUEUE);
        let target = path.to_path_buf();
        let thread = std::thread::spawn(move || writer(file, target, how, &todo, &back));
        let inner = Inner {
            selection,
            last: None,
            jobs: Some(jobs),
            spare,
            thread: Some(thread),
            path: path.into(),
            spent: Duration::ZERO,
        };
        let this = Self(Rc::new(RefCell::new(inner)));
        let mut words = vec![0u64; text.len().div_ceil(8)];
        bytemuck::cast_slice_mut::<u64, u8>(&mut words)[..text.len()].copy_from_slice(text.as_bytes());
        this.put(Head::Session(SessionHead { text: text.len() as u64, ..session }), words)?;
        Ok(this)
    }

    fn put(&self, head: Head, words: Vec<u64>) -> Result<(), RecordError> {
        let sent = self.0.borrow().jobs.as_ref().is_some_and(|j| j.send(Job { head, words }).is_ok());
        if sent { Ok(()) } else { Err(self.join().err().unwrap_or(RecordError::NoExchange)) }
    }

    /// An exchange begins. What the step carries into it is recorded if the exchange before was not.
    pub fn begin(&self, k: i64, time: f64, step: &CouplingStep) -> Result<(), RecordError> {
        let (takes, follows) = {
            let inner = self.0.borrow();
            (inner.selection.takes(k), inner.last.is_some_and(|l| l + 1 == k))
        };
        if !takes {
            return Ok(());
        }
        self.0.borrow_mut().last = Some(k);
        self.put(Head::Exchange { k, time }, Vec::new())?;
        if let Some(on) = step.in_force() {
            self.put(Head::Choice { k, on }, Vec::new())?;
        }
        if k == 0 || follows {
            return Ok(());
        }
        let (voidage, velocity, before) = step.carried();
        let mut words: Vec<u64> = Vec::with_capacity(7 * voidage.len());
        words.extend(voidage.iter().map(|x| x.to_bits()));
        words.extend(velocity.iter().chain(before).flatten().map(|x| x.to_bits()));
        self.put(Head::State { k, cells: voidage.len() as u64 }, words)
    }

    /// A message as it came (`sent`: as it goes). Those of exchanges not selected are left out.
    pub fn message(&self, partner: u32, sent: bool, words: &[u64]) -> Result<(), RecordError> {
        let Ok(frame) = Frame::parse(words) else { return Ok(()) };
        let (kind, step) = (frame.kind(), frame.step());
        let of_exchange =
            [kind::PARTICLES, kind::DRIVE, kind::FIELDS, kind::SOURCES, kind::WRITTEN].contains(&kind);
        if of_exchange && !self.0.borrow().selection.takes(step) {
            return Ok(());
        }
        let begin = Instant::now();
        let mut copy = self.0.borrow().spare.try_recv().unwrap_or_default();
        copy.clear();
        copy.extend_from_slice(words);
        self.put(Head::Message { partner, sent, kind, step }, copy)?;
        self.0.borrow_mut().spent += begin.elapsed();
        Ok(())
    }

    /// A row of the monitor.
    pub fn row(&self, row: &Row) -> Result<(), RecordError> {
        self.put(Head::Row(*row), Vec::new())
    }

    fn join(&self) -> Result<u64, RecordError> {
        let thread = {
            let mut inner = self.0.borrow_mut();
            inner.jobs = None;
            inner.thread.take()
        };
        match thread.map(JoinHandle::join) {
            Some(Ok(r)) => r,
            Some(Err(_)) => Err(self.broken("its thread panicked")),
            None => Err(self.broken("it is closed")),
        }
    }

    fn broken(&self, why: &str) -> RecordError {
        let what = format!("recording {}", self.0.borrow().path.display());
        RecordError::File { what, source: std::io::Error::other(why.to_string()) }
    }

    /// Ends the file with its index; bytes written, and what recording took of the exchanges.
    pub fn finish(&self) -> Result<(u64, Duration), RecordError> {
        Ok((self.join()?, self.0.borrow().spent))
    }
}

/// Writes chunks in the order they come, then the index.
fn writer(
    mut file: File,
    path: PathBuf,
    how: Compression,
    jobs: &Receiver<Job>,
    back: &SyncSender<Vec<u64>>,
) -> Result<u64, RecordError> {
    let fail = |source| RecordError::File { what: format!("recording {}", path.display()), source };
    let (mut at, mut packer) = (chunk::FILE_HEAD as u64, Packer::default());
    let mut places: Vec<(i64, u64)> = Vec::new();
    let mut begins = Vec::new();
    let mut put = |file: &mut File, head: &Head, words: &[u64]| {
        let (packing, stored) = packer.pack(words, how);
        let first = chunk::header(&head::encode(head), stored, 8 * words.len() as u64, packing);
        file.write_all(&first)?;
        file.write_all(stored)?;
        Ok(first.len() as u64 + stored.len() as u64)
    };
    for job in jobs {
        // a message may come before the begin of its exchange is told
        match job.head {
            Head::Message { step, kind, .. }
                if [kind::PARTICLES, kind::FIELDS].contains(&kind)
                    && begins.last().is_none_or(|b: &(i64, u64)| b.0 < step) =>
            {
                begins.push((step, at));
            }
            Head::Exchange { k, .. } => match begins.last() {
                Some(b) if b.0 == k => places.push(*b),
                _ => {
                    begins.push((k, at));
                    places.push((k, at));
                }
            },
            _ => {}
        }
        begins.drain(..begins.len().saturating_sub(1));
        at += put(&mut file, &job.head, &job.words).map_err(fail)?;
        let _ = back.try_send(job.words);
    }
    let index: Vec<u64> = places.iter().flat_map(|p| [p.0 as u64, p.1]).collect();
    let size = put(&mut file, &Head::Index, &index).map_err(fail)?;
    file.write_all(&chunk::end(at)).map_err(fail)?;
    Ok(at + size + chunk::END as u64)
}
