// SPDX-License-Identifier: MIT OR Apache-2.0
//! Fuzzes the reader of recordings: changes files of the corpus at random and reads the result in every way.
//!
//! `cargo run --example fuzz_recording -- SECONDS [SEED]`. Plain damage and damage behind right checksums.
//! A file that makes the reader panic, take over 10 s or over 512 MB is written to tests/data/recordings/found and named;
//! then the exit code is 1. The first file of every new kind of error is kept in target/fuzz.
#![allow(clippy::print_stdout)]

use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};
use voidage::record::chunk::{self, FILE_HEAD, HEADER};
use voidage::record::exercise::exercise;
use voidage::record::head::{self, Head};
use voidage::record::{Chunk, Reader};

/// Where the last panic was.
static PLACE: Mutex<String> = Mutex::new(String::new());

struct Random(u64);
impl Random {
    fn next(&mut self) -> u64 {
        // splitmix64
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }
    fn below(&mut self, n: usize) -> usize {
        (self.next() % n.max(1) as u64) as usize
    }
    fn word(&mut self) -> u64 {
        let odd = [0, 1, 2, 3, 7, 255, 1 << 31, 1 << 32, 1 << 40, 1 << 62, 1 << 63, u64::MAX, u64::MAX - 1];
        let floats = [f64::NAN, f64::INFINITY, -1.0, 1e300, 1e-300, 0.5, -0.0];
        match self.below(4) {
            0 => odd[self.below(odd.len())],
            1 => floats[self.below(floats.len())].to_bits(),
            2 => self.next() % 1000,
            _ => self.next(),
        }
    }
}

fn chunks(bytes: &[u8]) -> Vec<Chunk> {
    let mut list = Vec::new();
    if let Ok(mut r) = Reader::new(std::io::Cursor::new(bytes.to_vec()), "corpus") {
        let _ = r.seek(FILE_HEAD as u64);
        while let Ok(Some(c)) = r.next() {
            list.push(c);
        }
    }
    list
}

fn bytes_of(list: &[Chunk]) -> Vec<u8> {
    let mut out = chunk::file_head().to_vec();
    for c in list {
        let payload: &[u8] = bytemuck::cast_slice(&c.words);
        out.extend(chunk::header(&head::encode(&c.head), payload, payload.len() as u64, 0));
        out.extend(payload);
    }
    out
}

/// Damage behind right checksums.
fn deep(list: &mut Vec<Chunk>, r: &mut Random) {
    for _ in 0..=r.below(3) {
        let n = r.below(list.len());
        match r.below(8) {
            0 => {
                list.remove(n);
            }
            1 => list.insert(r.below(list.len() + 1), list[n].clone()),
            2 => {
                let m = r.below(list.len());
                list.swap(n, m);
            }
            3 => {
                let k = r.word() as i64 % 8;
                match &mut list[n].head {
                    Head::Message { partner, kind, step, sent } => match r.below(4) {
                        0 => *partner = r.word() as u32 % 6,
                        1 => *kind = [1, 2, 3, 10, 11, 12, 20, 21, 22, 30][r.below(10)],
                        2 => *step = k,
                        _ => *sent = !*sent,
                    },
                    Head::Exchange { k: at, .. } => *at = k,
                    Head::State { k: at, cells } => (*at, *cells) = (k, r.word()),
                    Head::Session(s) => match r.below(5) {
                        0 => s.dem_ranks = r.word() as u32,
                        1 => s.cfd_ranks = r.word() as u32,
                        2 => s.period = f64::from_bits(r.word()),
                        3 => s.text = r.word(),
                        _ => s.origin = f64::from_bits(r.word()),
                    },
                    Head::Row(row) => row.time = f64::from_bits(r.word()),
                    Head::Choice { k: at, on } => (*at, *on) = (k, r.word() as u32),
                    Head::Index => {}
                }
            }
            4 => {
                let w = &mut list[n].words;
                let keep = r.below(w.len() + 1);
                w.truncate(keep);
            }
            _ => {
                let w = &mut list[n].words;
                if !w.is_empty() {
                    // heads and tables of messages stand at the front
                    let span = if r.below(2) == 0 { w.len().min(60) } else { w.len() };
                    let at = r.below(span);
                    w[at] = if r.below(3) == 0 { w[at] ^ (1 << r.below(64)) } else { r.word() };
                }
            }
        }
        if list.is_empty() {
            return;
        }
    }
}

/// Damage to the bytes.
fn plain(bytes: &mut Vec<u8>, r: &mut Random) {
    for _ in 0..=r.below(3) {
        let n = bytes.len();
        if n == 0 {
            return;
        }
        // the heads are few bytes: hit them more often
        let at = if r.below(3) == 0 { r.below(n.min(FILE_HEAD + 2 * HEADER)) } else { r.below(n) };
        match r.below(5) {
            0 => bytes.truncate(at),
            1 => bytes[at] ^= 1 << r.below(8),
            2 => {
                let w = r.word().to_le_bytes();
                let end = (at + 8).min(n);
                bytes[at..end].copy_from_slice(&w[..end - at]);
            }
            3 => {
                let end = (at + r.below(200)).min(n);
                bytes.drain(at..end);
            }
            _ => {
                let end = (at + r.below(200)).min(n);
                let part = bytes[at..end].to_vec();
                let to = r.below(bytes.len() + 1);
                bytes.splice(to..to, part);
            }
        }
    }
}

/// Largest memory of this process so far, MB.
fn peak() -> u64 {
    let text = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = text.lines().find_map(|l| l.strip_prefix("VmHWM:"));
    line.and_then(|l| l.trim().trim_end_matches(" kB").parse::<u64>().ok()).unwrap_or(0) / 1000
}

fn main() {
    let mut arguments = std::env::args().skip(1);
    let seconds: u64 = arguments.next().and_then(|a| a.parse().ok()).unwrap_or(60);
    let seed: u64 = arguments.next().and_then(|a| a.parse().ok()).unwrap_or(1);
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/recordings");
    let found = folder.join("found");
    let kept = Path::new(env!("CARGO_MANIFEST_DIR")).join("target/fuzz");
    std::fs::create_dir_all(&kept).expect("target/fuzz");
    let mut files: Vec<PathBuf> =
        std::fs::read_dir(&folder).expect("the corpus").flatten().map(|e| e.path()).collect();
    files.retain(|f| f.extension().is_some_and(|e| e == "voidage"));
    files.sort();
    let corpus: Vec<(Vec<u8>, Vec<Chunk>)> = files
        .iter()
        .map(|f| std::fs::read(f).expect("a file of the corpus"))
        .map(|b| (b.clone(), chunks(&b)))
        .filter(|c| c.1.len() > 4)
        .collect();
    assert!(!corpus.is_empty(), "no whole recording in {}", folder.display());
    let now = Arc::new(Mutex::new((Instant::now(), Vec::new())));
    let watched = Arc::clone(&now);
    let stuck = found.clone();
    std::thread::spawn(move || {
        loop {
            std::thread::sleep(Duration::from_secs(1));
            let w = watched.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
            if w.0.elapsed() > Duration::from_secs(10) {
                std::fs::create_dir_all(&stuck).expect("folder");
                std::fs::write(stuck.join("hang.voidage"), &w.1).expect("file");
                println!("over 10 s: {}", stuck.join("hang.voidage").display());
                std::process::exit(1);
            }
        }
    });
    std::panic::set_hook(Box::new(|p| {
        if let Some(l) = p.location() {
            *PLACE.lock().unwrap_or_else(std::sync::PoisonError::into_inner) =
                format!("{}:{}", l.file(), l.line());
        }
    }));
    let (begin, mut r) = (Instant::now(), Random(seed));
    let (mut n, mut bad, mut good) = (0u64, 0u64, 0u64);
    let mut kinds: BTreeMap<String, u64> = BTreeMap::new();
    while begin.elapsed().as_secs() < seconds {
        let (bytes, list) = &corpus[r.below(corpus.len())];
        let mut bytes = if r.below(2) == 0 {
            let mut list = list.clone();
            deep(&mut list, &mut r);
            bytes_of(&list)
        } else {
            bytes.clone()
        };
        if r.below(3) > 0 {
            plain(&mut bytes, &mut r);
        }
        *now.lock().unwrap_or_else(std::sync::PoisonError::into_inner) = (Instant::now(), bytes.clone());
        n += 1;
        let kind = match catch_unwind(AssertUnwindSafe(|| exercise(&bytes))) {
            Ok(Ok(_)) => {
                good += 1;
                continue;
            }
            Ok(Err(e)) => {
                // what the file says is not part of the kind
                let text = e.to_string();
                let text: String = text.split('"').step_by(2).collect();
                let plain = text.chars().filter(|c| c.is_ascii_lowercase() || *c == ' ');
                plain.take(40).collect::<String>()
            }
            Err(p) => {
                let why = p.downcast_ref::<String>().cloned();
                let why = why.or_else(|| p.downcast_ref::<&str>().map(|s| (*s).to_string()));
                bad += 1;
                let place = PLACE.lock().unwrap_or_else(std::sync::PoisonError::into_inner).clone();
                let why: String = why.unwrap_or_default().chars().filter(|c| !c.is_ascii_digit()).collect();
                format!("PANIC {place}: {why}")
            }
        };
        let count = kinds.entry(kind.clone()).or_default();
        *count += 1;
        if *count == 1 {
            let to = if kind.starts_with("PANIC") { &found } else { &kept };
            std::fs::create_dir_all(to).expect("folder");
            std::fs::write(to.join(format!("{seed}-{n}.voidage")), &bytes).expect("file");
            if kind.starts_with("PANIC") {
                println!("{n}: {kind}");
            }
        }
        if n % 1000 == 0 && peak() > 512 {
            println!("{} MB", peak());
            bad += 1;
            break;
        }
    }
    println!(
        "{n} files in {seconds} s (seed {seed}): {good} read whole, {} kinds of errors, {bad} panics, at most {} MB",
        kinds.len(),
        peak()
    );
    std::process::exit(i32::from(bad > 0));
}
