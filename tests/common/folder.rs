// SPDX-License-Identifier: MIT OR Apache-2.0
//! Folders of the project, and copies of them to run in.

use std::path::{Path, PathBuf};

/// The checkout.
pub fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

/// Copies a folder with all that is in it.
pub fn copy(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).unwrap();
    for e in std::fs::read_dir(from).unwrap().flatten() {
        let to = to.join(e.file_name());
        if e.path().is_dir() {
            copy(&e.path(), &to);
        } else {
            std::fs::copy(e.path(), to).unwrap();
        }
    }
}

/// What `dem.program` may name.
pub const PROGRAMS: [&str; 2] = ["liggghts", "lammps"];

/// Copies a case, to be run with a particle program: LAMMPS' script takes the place of `particles.in`.
pub fn copy_case(name: &str, to: &Path, program: &str) {
    copy(&root().join("cases").join(name), to);
    let (lammps, toml) = (to.join("lammps.in"), to.join("case.toml"));
    if program == "lammps" {
        assert!(
            root().join("build/lib/libvoidageLammps.so").exists(),
            "the LAMMPS side is not built: type ./setup lammps"
        );
        std::fs::rename(lammps, to.join("particles.in")).unwrap();
        let text = std::fs::read_to_string(&toml).unwrap();
        assert!(text.contains("[dem]\n"));
        std::fs::write(toml, text.replace("[dem]\n", "[dem]\nprogram = \"lammps\"\n")).unwrap();
    }
}

/// A scratch folder, removed at the end.
pub struct Folder(PathBuf);
impl Folder {
    /// New and empty.
    pub fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("voidage-{name}-{}", std::process::id()));
        let _ = std::fs::remove_dir_all(&path);
        std::fs::create_dir_all(&path).unwrap();
        Self(path)
    }
    /// Where it is.
    pub fn path(&self) -> &Path {
        &self.0
    }
}
impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// The name of a scratch file (or folder), removed at the end.
pub struct Scratch(pub PathBuf);
impl Scratch {
    /// There is nothing of that name yet.
    pub fn new(name: &str) -> Self {
        let s = Self(std::env::temp_dir().join(format!("voidage-{name}-{}", std::process::id())));
        s.remove();
        s
    }
    fn remove(&self) {
        let _ = std::fs::remove_file(&self.0);
        let _ = std::fs::remove_dir_all(&self.0);
    }
    /// What was written.
    pub fn bytes(&self) -> Vec<u8> {
        std::fs::read(&self.0).unwrap()
    }
}
impl Drop for Scratch {
    fn drop(&mut self) {
        self.remove();
    }
}
