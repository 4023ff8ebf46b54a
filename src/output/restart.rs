// SPDX-License-Identifier: MIT OR Apache-2.0
//! Restart sets: CASE/voidage/restart/TIME/ with `coupler` (this file's) and `particles` (LIGGGHTS' own).
//!
//! Together with the fluid's fields of the same time a set continues a run. `coupler` is written last: a set
//! without it is incomplete. Layout: a line with the version, a TOML head with its length, voidage (1) and
//! fluid velocity (m/s), with an added mass also that of the step before, by cell slot, and a checksum of all before. Knows no stage and no process.

use crate::balance::Books;
use crate::config::Config;
use crate::couple::Summary;
use crate::monitor::Row;
use crate::particles::Particles;
use serde::{Deserialize, Serialize};
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

/// First line; the number is the version of the layout.
const MAGIC: &[u8] = b"voidage restart 2\n";
/// File of the coupler in a set.
pub const COUPLER: &str = "coupler";
/// File of the DEM in a set.
pub const PARTICLES: &str = "particles";

/// What the coupler needs to go on after an exchange, SI units.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[allow(missing_docs)]
pub struct State {
    /// exchange the set was written in
    pub exchange: i64,
    /// fluid time of it
    pub time: f64,
    /// fluid time of exchange 0
    pub origin: f64,
    /// the DEM's own step number
    pub dem_step: i64,
    pub dem_time_step: f64,
    pub interval: u32,
    pub cfd_ranks: u32,
    /// numbers per particle in the DEM's file for the history force, and whether there is one for the added mass
    pub kept: [f64; 2],
    pub particles: usize,
    /// checksum of what the DEM sent in this exchange
    pub particles_sum: String,
    /// bytes of the DEM's file
    pub particles_file: u64,
    pub cells: usize,
    /// checksum of cell ids and volumes
    pub mesh_sum: String,
    /// ledger of vanished particles so far, N s
    pub left: [f64; 3],
    pub summary: Summary,
    /// the monitor's row of this exchange, closed by the next one
    pub row: Row,
    pub books: Books,
    /// forces `auto` has on from the next exchange on (`Watch::in_force`)
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub in_force: Option<u32>,
    /// ε at the end of the fluid step, by cell slot
    #[serde(skip)]
    pub voidage: Vec<f64>,
    /// U at its end, m/s
    #[serde(skip)]
    pub velocity: Vec<[f64; 3]>,
    /// U one step earlier, m/s; empty where nothing needs it
    #[serde(skip)]
    pub velocity_before: Vec<[f64; 3]>,
}

/// FNV-1a, 64 bits, over words: notices damage and mix-ups, not malice.
#[derive(Clone, Copy)]
pub struct Sum64(u64);
impl Default for Sum64 {
    fn default() -> Self {
        Self(0xcbf2_9ce4_8422_2325)
    }
}
impl Sum64 {
    /// Adds a word.
    pub fn word(&mut self, w: u64) {
        self.0 = (self.0 ^ w).wrapping_mul(0x0100_0000_01b3);
        self.0 ^= self.0 >> 29;
    }
    /// Adds a number, to the bit.
    pub fn number(&mut self, x: f64) {
        self.word(x.to_bits());
    }
    /// Adds bytes.
    pub fn bytes(&mut self, bytes: &[u8]) {
        for c in bytes.chunks(8) {
            let mut w = [0; 8];
            w[..c.len()].copy_from_slice(c);
            self.word(u64::from_le_bytes(w));
        }
    }
    /// As a number.
    pub fn value(self) -> u64 {
        self.0
    }
    /// As text.
    pub fn text(self) -> String {
        format!("{:016x}", self.0)
    }
}

/// Checksum of what a DEM restart brings back to the bit (positions may be wrapped in periodic boxes).
pub fn particles_sum(p: &Particles) -> String {
    let mut order: Vec<usize> = (0..p.len()).collect();
    order.sort_unstable_by_key(|i| p.id[*i]);
    let mut sum = Sum64::default();
    for i in order {
        sum.word(p.id[i] as u64);
        p.velocity[i]
            .iter()
            .chain(&p.ledger[i])
            .chain([&p.radius[i], &p.mass[i]])
            .for_each(|x| sum.number(*x));
    }
    sum.text()
}

/// Checksum of a mesh.
pub fn mesh_sum(ids: &[i64], volume: &[f64]) -> String {
    let mut sum = Sum64::default();
    ids.iter().for_each(|i| sum.word(*i as u64));
    volume.iter().for_each(|v| sum.number(*v));
    sum.text()
}

impl State {
    /// The file's bytes.
    pub fn encode(&self) -> Result<Vec<u8>, String> {
        let head = toml::to_string(self).map_err(|e| e.to_string())?;
        let mut out = MAGIC.to_vec();
        out.extend((head.len() as u64).to_le_bytes());
        out.extend(head.as_bytes());
        out.extend((self.voidage.len() as u64).to_le_bytes());
        for x in self.voidage.iter().chain(self.velocity.iter().chain(&self.velocity_before).flatten()) {
            out.extend(x.to_le_bytes());
        }
        let mut sum = Sum64::default();
        sum.bytes(&out);
        out.extend(sum.0.to_le_bytes());
        Ok(out)
    }

    /// Reads the file's bytes; the error says what is wrong with them.
    pub fn decode(bytes: &[u8]) -> Result<Self, String> {
        let line = bytes.iter().position(|b| *b == b'\n').map_or(&[][..], |i| &bytes[..=i]);
        if line != MAGIC {
            let what =
                String::from_utf8_lossy(line.get(..line.len().min(40)).unwrap_or_default()).into_owned();
            return Err(format!(
                "it begins with {:?}; this version reads {:?}",
                what.trim(),
                "voidage restart 2"
            ));
        }
        let damaged = || "it is damaged (checksum or length)".to_string();
        let (body, end) = bytes.split_at_checked(bytes.len().saturating_sub(8)).ok_or_else(damaged)?;
        let mut sum = Sum64::default();
        sum.bytes(body);
        if end != sum.0.to_le_bytes() {
            return Err(damaged());
        }
        let word = |at: usize| {
            let b = body.get(at..at + 8)?;
            Some(u64::from_le_bytes(b.try_into().ok()?))
        };
        let at = MAGIC.len();
        let length = word(at).ok_or_else(damaged)? as usize;
        let head = body.get(at + 8..at + 8 + length).ok_or_else(damaged)?;
        let head = std::str::from_utf8(head).map_err(|_| damaged())?;
        let mut state: Self = toml::from_str(head).map_err(|e| e.message().to_string())?;
        let at = at + 8 + length;
        let n = word(at).ok_or_else(damaged)? as usize;
        let fits = |b: &&[u8]| [32, 56].iter().any(|bytes| n.checked_mul(*bytes) == Some(b.len()));
        let numbers = body.get(at + 8..).filter(fits).ok_or_else(damaged)?;
        let mut numbers = numbers.chunks_exact(8).map(|c| c.try_into().map_or(f64::NAN, f64::from_le_bytes));
        state.voidage = numbers.by_ref().take(n).collect();
        let rest: Vec<f64> = numbers.collect();
        let mut vectors = rest.chunks_exact(3).map(|v| [v[0], v[1], v[2]]);
        state.velocity = vectors.by_ref().take(n).collect();
        state.velocity_before = vectors.collect();
        Ok(state)
    }

    /// Reads a set's file.
    pub fn read(set: &Path) -> Result<Self, String> {
        let file = set.join(COUPLER);
        let bytes = fs::read(&file).map_err(|e| format!("{}: {e}", file.display()))?;
        Self::decode(&bytes).map_err(|e| format!("{}: {e}", file.display()))
    }
}

/// `State::kept` of a case.
pub fn kept(c: &Config) -> [f64; 2] {
    let told = crate::setup::welcome(c, None).settings;
    ["drive.memory", "drive.added_mass"].map(|key| told.get(key).copied().unwrap_or(0.0))
}

/// Folder of all sets of a case.
pub fn folder(case: &Path) -> PathBuf {
    case.join("voidage/restart")
}

/// Complete sets of a case: (time, folder), oldest first.
pub fn sets(case: &Path) -> Vec<(f64, PathBuf)> {
    let entries = fs::read_dir(folder(case)).into_iter().flatten().flatten();
    let complete = entries.filter(|e| e.path().join(COUPLER).exists());
    let mut list: Vec<(f64, PathBuf)> =
        complete.filter_map(|e| Some((e.file_name().to_str()?.parse().ok()?, e.path()))).collect();
    list.sort_by(|a, b| a.0.total_cmp(&b.0));
    list
}

/// Writes sets and keeps the newest.
pub struct Sets {
    case: PathBuf,
    keep: u32,
    head: State,
    /// false: names are given, nothing is written
    real: bool,
}

impl Sets {
    /// `None`: none are to be written.
    pub fn new(c: &Config) -> Option<Self> {
        let f = &c.file;
        let head = State {
            dem_time_step: f.dem.time_step,
            interval: f.coupling.interval,
            cfd_ranks: f.run.cfd_ranks,
            kept: kept(c),
            ..State::default()
        };
        (f.output.restarts > 0).then(|| Self {
            case: c.folder.clone(),
            keep: f.output.restarts,
            head,
            real: true,
        })
    }

    /// Names sets as the run did, and writes none: for a replay.
    pub fn named_only(c: &Config) -> Option<Self> {
        Self::new(c).map(|s| Self { real: false, ..s })
    }

    /// Makes room for a set: its folder, below the case.
    pub fn begin(&self, time: f64) -> io::Result<PathBuf> {
        let digits: f64 = format!("{time:.11e}").parse().unwrap_or(time);
        let set = PathBuf::from("voidage/restart").join(digits.to_string());
        let whole = self.case.join(&set);
        if !self.real {
            return Ok(set);
        }
        if whole.exists() {
            fs::remove_dir_all(&whole)?;
        }
        fs::create_dir_all(&whole)?;
        Ok(set)
    }

    /// Completes a set after the DEM has written its file, and removes old ones.
    pub fn finish(&self, set: &Path, state: State) -> io::Result<()> {
        if !self.real {
            return Ok(());
        }
        let whole = self.case.join(set);
        let size = fs::metadata(whole.join(PARTICLES))?.len();
        let (h, mut state) = (&self.head, state);
        (state.dem_time_step, state.interval, state.cfd_ranks) = (h.dem_time_step, h.interval, h.cfd_ranks);
        state.kept = h.kept;
        state.particles_file = size;
        let part = whole.join("coupler.part");
        fs::write(&part, state.encode().map_err(io::Error::other)?)?;
        fs::rename(&part, whole.join(COUPLER))?;
        let all = sets(&self.case);
        for (_, old) in all.iter().rev().skip(self.keep as usize) {
            fs::remove_dir_all(old)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn state() -> State {
        let row = Row {
            step: 7,
            action_reaction_error: Some(1e-15),
            given: [1.0 / 3.0, 0.0, -2e-30],
            ..Row::default()
        };
        State {
            exchange: 7,
            time: 0.1 + 0.2,
            row,
            left: [1e-300, 0.1, 3.0],
            voidage: vec![0.4, 1.0 / 3.0],
            velocity: vec![[1.0, 2.0, 1e-17], [0.0, -0.0, 7.0]],
            ..State::default()
        }
    }

    #[test]
    fn a_state_comes_back_to_the_bit() {
        for velocity_before in [vec![], vec![[5.0, 6.0, 7.0], [1e-9, 2.0, 3.0]]] {
            let s = State { velocity_before, ..state() };
            assert_eq!(State::decode(&s.encode().unwrap()).unwrap(), s);
        }
    }

    #[test]
    fn damage_and_other_versions_are_named() {
        let whole = state().encode().unwrap();
        for cut in 0..whole.len() {
            assert!(State::decode(&whole[..cut]).is_err());
            let mut bad = whole.clone();
            bad[cut] ^= 4;
            assert!(State::decode(&bad).is_err(), "byte {cut}");
        }
        let e = State::decode(b"voidage restart 9\nxxxxxxxxxxxx").unwrap_err();
        assert!(e.contains("voidage restart 9") && e.contains("voidage restart 2"), "{e}");
    }
}
