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
    /// atom styles that have what the fix needs, the usual one first
    pub atom_styles: &'static [&'static str],
    /// commands it does not know because they are the other's, and what to type instead; `/` at the end: all styles below
    pub foreign: &'static [(&'static str, &'static str)],
}

/// All, the default first.
pub const PROGRAMS: [Program; 2] = [
    Program {
        name: "liggghts",
        title: "LIGGGHTS",
        executable: "liggghts",
        library: "libvoidageLiggghts.so",
        setup: "./setup build",
        atom_styles: &["granular", "sphere", "hybrid"],
        foreign: &[
            ("comm_modify", "communicate single vel yes"),
            ("pair_style granular", "pair_style gran model hertz tangential history"),
        ],
    },
    Program {
        name: "lammps",
        title: "LAMMPS",
        executable: "lmp",
        library: "libvoidageLammps.so",
        setup: "./setup lammps",
        atom_styles: &["sphere", "hybrid"],
        foreign: &[
            ("communicate", "comm_modify vel yes"),
            ("pair_style gran", "pair_style granular, the material in pair_coeff"),
            ("fix property/global", "the material in pair_coeff"),
            ("fix insert/", "fix pour, fix deposit or create_atoms"),
            ("fix particletemplate/", "set ... diameter ... density, or diam and dens of fix pour"),
            ("fix particledistribution/", "diam poly of fix pour"),
            ("fix mesh/", "fix wall/gran and fix wall/gran/region"),
        ],
    },
];

/// By the name in case.toml.
pub fn by_name(name: &str) -> Option<&'static Program> {
    PROGRAMS.iter().find(|p| p.name == name)
}

impl Program {
    /// What to type instead of a command that is the other program's.
    pub fn instead(&self, command: &str) -> Option<&'static str> {
        let is =
            |foreign: &str| command == foreign || (foreign.ends_with('/') && command.starts_with(foreign));
        self.foreign.iter().find(|f| is(f.0)).map(|f| f.1)
    }

    /// The other one.
    pub fn other(&self) -> &'static Program {
        &PROGRAMS[usize::from(self.name == PROGRAMS[0].name)]
    }
}

impl super::Config {
    /// The particle program; `raw` has refused all other names.
    pub fn program(&self) -> &'static Program {
        by_name(&self.file.dem.program).unwrap_or(&PROGRAMS[0])
    }
}
