// SPDX-License-Identifier: MIT OR Apache-2.0
//! The particle programs: what `dem.program` may name, what is started for it, and how their scripts differ.

/// A particle program.
#[derive(Debug)]
pub struct Program {
    /// in case.toml
    pub name: &'static str,
    /// for people
    pub title: &'static str,
    /// what mpirun starts
    pub executable: &'static str,
    /// the fix, below lib/
    pub library: &'static str,
    /// what to type where it is not installed
    pub setup: &'static str,
    /// atom style of spheres
    pub atom_style: &'static str,
}

/// All, the default first.
pub const PROGRAMS: [Program; 2] = [
    Program {
        name: "liggghts",
        title: "LIGGGHTS",
        executable: "liggghts",
        library: "libvoidageLiggghts.so",
        setup: "./setup build",
        atom_style: "granular",
    },
    Program {
        name: "lammps",
        title: "LAMMPS",
        executable: "lmp",
        library: "libvoidageLammps.so",
        setup: "./setup lammps",
        atom_style: "sphere",
    },
];

/// By the name in case.toml.
pub fn by_name(name: &str) -> Option<&'static Program> {
    PROGRAMS.iter().find(|p| p.name == name)
}

impl super::Config {
    /// The particle program; `raw` has refused all other names.
    pub fn program(&self) -> &'static Program {
        by_name(&self.file.dem.program).unwrap_or(&PROGRAMS[0])
    }
}
