// SPDX-License-Identifier: MIT OR Apache-2.0
//! What runs leave behind, and whether there is room: /dev/shm and the folder of private run folders.
//!
//! iceoryx2 leaves files after a clean exit and after SIGKILL. Every file of a run carries the run's
//! prefix, so they can be removed exactly, and never while the run's launcher lives.

use std::io;
use std::os::unix::fs::MetadataExt;
use std::path::Path;
use voidage_wire::{Session, session};

/// Where POSIX shared memory lives on Linux.
pub const SHARED_MEMORY: &str = "/dev/shm";

/// Start of the names of all files of a run.
pub fn prefix(token: &str) -> String {
    format!("voidage_{token}_")
}

/// Free bytes in /dev/shm.
pub fn free_bytes() -> io::Result<u64> {
    let s = rustix::fs::statvfs(SHARED_MEMORY)?;
    Ok(s.f_bavail * s.f_frsize)
}

/// Error if a message of `bytes` cannot be placed: writing beyond the free space would be a SIGBUS.
pub fn room_for(bytes: usize) -> Result<(), String> {
    let need = 2 * bytes as u64;
    match free_bytes() {
        Ok(free) if free < need => Err(format!(
            "{SHARED_MEMORY} has {:.1} MB free, {:.1} MB are needed; enlarge it, e.g. `mount -o remount,size=2G \
             {SHARED_MEMORY}` (docker: --shm-size=2g)",
            free as f64 / 1e6,
            need as f64 / 1e6
        )),
        _ => Ok(()),
    }
}

/// Removes the shared memory and the private folder of a run that has ended. Number of files removed.
pub fn clean(session: &Session) -> io::Result<usize> {
    let removed = remove_shared(&session.token)?;
    remove(&session.root)?;
    Ok(removed)
}

/// Removes a folder in which an mpirun that ends may still be at work.
fn remove(folder: &Path) -> io::Result<()> {
    let mut result = Ok(());
    for _ in 0..20 {
        result = std::fs::remove_dir_all(folder);
        if !folder.exists() {
            return Ok(());
        }
        std::thread::sleep(std::time::Duration::from_millis(50));
    }
    result
}

fn remove_shared(token: &str) -> io::Result<usize> {
    let (prefix, mut n) = (prefix(token), 0);
    for entry in std::fs::read_dir(SHARED_MEMORY)? {
        let entry = entry?;
        if entry.file_name().to_string_lossy().starts_with(&prefix) {
            // the folder holds what MPI ranks share; Open MPI leaves it behind when a rank is killed
            let gone = if entry.path().is_dir() {
                std::fs::remove_dir_all(entry.path())
            } else {
                std::fs::remove_file(entry.path())
            };
            match gone {
                Ok(()) => n += 1,
                Err(e) if e.kind() == io::ErrorKind::NotFound => {}
                Err(e) => return Err(e),
            }
        }
    }
    Ok(n)
}

/// Removes what runs of this user whose launcher has died left behind. Their tokens.
pub fn clean_dead() -> io::Result<Vec<String>> {
    let home = session::home();
    let mut gone = Vec::new();
    let Ok(entries) = std::fs::read_dir(&home) else { return Ok(gone) };
    for entry in entries.flatten() {
        let token = entry.file_name().to_string_lossy().into_owned();
        let root = entry.path();
        let dead = match Session::read(&root.join("session.toml")) {
            Ok(s) => !s.launcher.is_alive(),
            Err(_) => is_old(&root), // being made, or damaged
        };
        if dead && !token.is_empty() {
            remove_shared(&token)?;
            remove(&root)?;
            gone.push(token);
        }
    }
    Ok(gone)
}

fn is_old(path: &Path) -> bool {
    let now =
        std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).unwrap_or_default().as_secs();
    std::fs::metadata(path).is_ok_and(|m| (m.mtime().max(0) as u64) + 60 < now)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_files_of_dead_runs_are_removed() {
        let s = Session::create(Path::new("/c"), 1, 1, 1.0, 1.0).unwrap();
        let file = Path::new(SHARED_MEMORY).join(format!("{}x", prefix(&s.token)));
        std::fs::write(&file, b"x").unwrap();
        assert!(!clean_dead().unwrap().contains(&s.token) && file.exists(), "its launcher lives");
        let text = std::fs::read_to_string(s.file()).unwrap();
        let dead = text.replace(&format!("started = {}", s.launcher.started), "started = 1");
        std::fs::write(s.file(), dead).unwrap();
        assert!(clean_dead().unwrap().contains(&s.token));
        assert!(!file.exists() && !s.root.exists());
    }

    #[test]
    fn a_message_beyond_the_free_space_is_refused_with_advice() {
        assert!(room_for(8).is_ok());
        assert!(room_for(usize::MAX / 4).unwrap_err().contains("--shm-size"));
    }
}
