// SPDX-License-Identifier: MIT OR Apache-2.0
//! The description of a run that all its processes read: a private folder with `session.toml`.
//!
//! `voidage run` writes it, $VOIDAGE_SESSION names the file. The coupler adds `ready.toml` (its process)
//! when its channels exist; partners wait for that file. Does not know what is exchanged.

use crate::{PROTOCOL, Process};
use serde::{Deserialize, Serialize};
use std::io::Write;
use std::os::unix::fs::{DirBuilderExt, OpenOptionsExt};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Environment variable that names the session file.
pub const VARIABLE: &str = "VOIDAGE_SESSION";

/// A run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Session {
    /// Wire protocol of the programs of this run.
    pub protocol: u32,
    /// Unique name of the run; in every handshake and in the names of its shared memory.
    pub token: String,
    /// Private folder of the run (0700).
    pub root: PathBuf,
    /// Case folder with `case.toml`.
    pub case: PathBuf,
    /// Longest wait for a peer, s.
    pub wait: f64,
    /// Longest wait for all programs to show up, s.
    pub start: f64,
    /// Number of DEM ranks.
    pub dem_ranks: u32,
    /// Number of CFD ranks.
    pub cfd_ranks: u32,
    /// The process that launched the run.
    pub launcher: Process,
}

/// Folder above the private folders of this user's runs; short, because iceoryx2 limits paths.
pub fn home() -> PathBuf {
    let own = std::fs::metadata("/proc/self").map(|m| std::os::unix::fs::MetadataExt::uid(&m)).unwrap_or(0);
    PathBuf::from(format!("/tmp/voidage-{own}"))
}

impl Session {
    /// Makes the private folder and `session.toml`. `wait`, `start` in s.
    pub fn create(
        case: &Path,
        dem_ranks: u32,
        cfd_ranks: u32,
        wait: f64,
        start: f64,
    ) -> std::io::Result<Self> {
        let home = home();
        if !home.is_dir() {
            std::fs::DirBuilder::new().mode(0o700).recursive(true).create(&home)?;
        }
        let own = std::fs::metadata("/proc/self").map(|m| std::os::unix::fs::MetadataExt::uid(&m))?;
        let owner = std::os::unix::fs::MetadataExt::uid(&std::fs::symlink_metadata(&home)?);
        if own != owner {
            let text = format!("{} belongs to user {owner}, not to {own}: remove it", home.display());
            return Err(std::io::Error::new(std::io::ErrorKind::PermissionDenied, text));
        }
        let launcher = Process::own();
        let now = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).unwrap_or_default();
        for attempt in 0..1000u32 {
            let token = format!("{:x}{:x}{attempt:x}", launcher.pid, now.as_micros() & 0xffff_ffff);
            let root = home.join(&token);
            match std::fs::DirBuilder::new().mode(0o700).create(&root) {
                Err(e) if e.kind() == std::io::ErrorKind::AlreadyExists => {}
                Err(e) => return Err(e),
                Ok(()) => {
                    let case = case.to_path_buf();
                    let protocol = PROTOCOL;
                    let s = Self { protocol, token, root, case, wait, start, dem_ranks, cfd_ranks, launcher };
                    let text = toml::to_string(&s).map_err(std::io::Error::other)?;
                    write_whole(&s.file(), text.as_bytes())?;
                    return Ok(s);
                }
            }
        }
        Err(std::io::Error::other(format!("no free name for a run below {}", home.display())))
    }
    /// The session file, the value of $VOIDAGE_SESSION.
    pub fn file(&self) -> PathBuf {
        self.root.join("session.toml")
    }
    /// Reads the session this process belongs to.
    pub fn from_environment() -> Result<Self, String> {
        let file = std::env::var_os(VARIABLE).ok_or(format!(
            "${VARIABLE} is not set: this program takes part in a coupled run, start it by `voidage run CASE`"
        ))?;
        Self::read(Path::new(&file))
    }
    /// Reads a session file.
    pub fn read(file: &Path) -> Result<Self, String> {
        let text = std::fs::read_to_string(file).map_err(|e| format!("session {}: {e}", file.display()))?;
        let s: Self = toml::from_str(&text).map_err(|e| format!("session {}: {e}", file.display()))?;
        if s.protocol == PROTOCOL {
            return Ok(s);
        }
        let theirs = s.protocol;
        Err(crate::WireError::Version { theirs, ours: PROTOCOL }.to_string())
    }
    /// The coupler says that its channels exist.
    pub fn announce(&self) -> std::io::Result<()> {
        let text = toml::to_string(&Process::own()).map_err(std::io::Error::other)?;
        write_whole(&self.root.join("ready.toml"), text.as_bytes())
    }
    /// Waits for the coupler to be ready; who it is.
    pub fn wait_for_coupler(&self) -> Result<Process, String> {
        let (begin, file) = (Instant::now(), self.root.join("ready.toml"));
        loop {
            if let Ok(text) = std::fs::read_to_string(&file) {
                return toml::from_str(&text).map_err(|e| format!("{}: {e}", file.display()));
            }
            if begin.elapsed().as_secs_f64() > self.start {
                return Err(format!("the coupler did not show up in {:.0} s", self.start));
            }
            if !self.launcher.is_alive() {
                return Err("`voidage run`, which started this program, has ended".into());
            }
            std::thread::sleep(Duration::from_millis(20));
        }
    }
}

/// Writes a file so that a reader sees all of it or nothing; readable by the user alone.
fn write_whole(file: &Path, bytes: &[u8]) -> std::io::Result<()> {
    let part = file.with_extension("part");
    let mut f =
        std::fs::OpenOptions::new().write(true).create(true).truncate(true).mode(0o600).open(&part)?;
    f.write_all(bytes)?;
    std::fs::rename(&part, file)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_session_is_private_unique_and_read_back() {
        use std::os::unix::fs::PermissionsExt;
        let (a, b) = (
            Session::create(Path::new("/c"), 1, 2, 3.0, 4.0),
            Session::create(Path::new("/c"), 1, 2, 3.0, 4.0),
        );
        let (a, b) = (a.unwrap(), b.unwrap());
        assert_ne!(a.token, b.token);
        assert_eq!(Session::read(&a.file()).unwrap(), a);
        let mode = |p: &Path| std::fs::metadata(p).unwrap().permissions().mode() & 0o777;
        assert_eq!((mode(&a.root), mode(&a.file())), (0o700, 0o600));
        a.announce().unwrap();
        assert_eq!(a.wait_for_coupler().unwrap(), Process::own());
        std::fs::write(b.file(), "protocol = 99\n").unwrap();
        assert!(Session::read(&b.file()).is_err());
        std::fs::remove_dir_all(a.root).unwrap();
        std::fs::remove_dir_all(b.root).unwrap();
    }
}
