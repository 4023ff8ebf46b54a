// SPDX-License-Identifier: MIT OR Apache-2.0
//! The real programs while particles change rank, appear and vanish: ledgers and impulses close in every exchange.
//! Needs `./setup build`.

mod common;

use common::folder::{PROGRAMS, copy_case, root};
use std::collections::HashMap;
use std::path::PathBuf;
use std::process::{Command, Stdio};

type Row = HashMap<String, f64>;

struct Run {
    folder: PathBuf,
    log: String,
    rows: Vec<Row>,
}
impl Drop for Run {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.folder);
    }
}

/// The box of `settling` with other particles; `script` stands between `fix motion` and the end.
fn run(program: &str, name: &str, particles: &str, script: &str, end: f64, options: &[&str]) -> Run {
    assert!(root().join("build/bin/voidageFoam").exists(), "the C++ sides are not built: type ./setup build");
    let folder =
        std::env::temp_dir().join(format!("voidage-come-and-go-{program}-{name}-{}", std::process::id()));
    let _ = std::fs::remove_dir_all(&folder);
    copy_case("settling", &folder, program);
    let control = folder.join("fluid/system/controlDict");
    let text = std::fs::read_to_string(&control).unwrap();
    std::fs::write(&control, text.replace("endTime 0.24;", &format!("endTime {end};"))).unwrap();
    let (style, velocities, contacts) = if program == "lammps" {
        (
            "sphere",
            "comm_modify vel yes",
            "pair_style granular\npair_coeff * * hertz/material 5e6 0.9 0.45 tangential mindlin NULL 1.0 0.3 damping tsuji\n",
        )
    } else {
        (
            "granular",
            "communicate single vel yes",
            "fix m1 all property/global youngsModulus peratomtype 5.e6\n\
             fix m2 all property/global poissonsRatio peratomtype 0.45\n\
             fix m3 all property/global coefficientRestitution peratomtypepair 1 0.9\n\
             fix m4 all property/global coefficientFriction peratomtypepair 1 0.3\n\
             pair_style gran model hertz tangential history\npair_coeff * *\n",
        )
    };
    let head = format!(
        "atom_style {style}\natom_modify map array\nboundary f f f\nnewton off\n{velocities}\n\
         units si\nprocessors * 1 1\nregion box block 0 0.09 0 0.1 0 0.1 units box\ncreate_box 1 box\nneighbor 0.002 bin\n\
         neigh_modify delay 0\n{contacts}timestep 1e-5\n"
    );
    let middle = "fix gravity all gravity 9.81 vector 0.0 0.0 -1.0\nfix motion all nve/sphere\n";
    std::fs::write(folder.join("particles.in"), format!("{head}{particles}{middle}{script}")).unwrap();
    let mut c = Command::new(env!("CARGO_BIN_EXE_voidage"));
    c.env("VOIDAGE_HOME", root().join("build")).stdin(Stdio::null());
    c.arg("run").arg(&folder).args(["--set", "run.dem_ranks=2"]).args(options);
    let out = c.output().unwrap();
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    let text = std::fs::read_to_string(folder.join("monitor.csv")).unwrap();
    let mut lines = text.lines().map(|l| l.split(',').map(str::to_owned).collect::<Vec<_>>());
    let names = lines.next().unwrap();
    let number = |c: (&String, &String)| (c.0.clone(), c.1.parse().unwrap_or(f64::NAN));
    let rows: Vec<Row> = lines.map(|l| names.iter().zip(&l).map(number).collect()).collect();
    for r in &rows {
        assert!(
            r["action_reaction_error"] <= 1e-12,
            "exchange {}: {}",
            r["step"],
            r["action_reaction_error"]
        );
        assert!(r["solid_volume_error"] <= 1e-12, "exchange {}", r["step"]);
    }
    let log = std::fs::read_to_string(folder.join("logs/dem.log")).unwrap();
    Run { folder, log, rows }
}

/// Counts of particles of both ranks that the DEM prints at the end of each `run`.
fn on_ranks(log: &str) -> Vec<String> {
    let of = |l: &&str| l.contains("Nlocal:") || l.starts_with("Histogram:");
    // the two programs put other spaces between the words
    log.lines().filter(of).map(|l| l.split_whitespace().collect::<Vec<_>>().join(" ")).collect()
}

const ONE: &str =
    "create_atoms 1 single 0.0445 0.0523 0.05 units box\nset group all diameter 1e-4 density 3000\n";

#[test]
fn a_particle_that_changes_rank_keeps_its_ledger() {
    for program in PROGRAMS {
        // x = 0.045 parts the two ranks: the particle crosses it, going at 1 m/s, within 0.5 ms
        let moving = format!("{ONE}velocity all set 1.0 0.0 0.0\n");
        let script = "fix voidage all voidage\nrun 1000000000\n";
        let two = run(program, "cross", &moving, script, 0.004, &[]);
        // where it is at the end: in the second rank
        assert!(on_ranks(&two.log).iter().any(|l| l.contains("1 max 0 min")), "{:?}", on_ranks(&two.log));
        // nothing shows that it crossed: a run on one rank gives the same rows to the last digit written
        let one = run(program, "stay", &moving, script, 0.004, &["--set", "run.dem_ranks=1"]);
        assert_eq!(one.rows.len(), two.rows.len());
        for (a, b) in one.rows.iter().zip(&two.rows) {
            for c in ["particles", "ledger_momentum", "given_x", "given_y", "given_z"] {
                assert_eq!(a[c], b[c], "{c} of exchange {}", a["step"]);
            }
        }
        assert!(two.rows.iter().any(|r| r["ledger_momentum"] > 1e-13));
        // rounding apart (N s)
        assert!(two.rows.iter().all(|r| r["ledger_left"] < 1e-22));
    }
}

#[test]
fn inserted_particles_feel_the_fluid_from_the_next_exchange_on() {
    for program in PROGRAMS {
        let one = "create_atoms 1 single 0.0495 0.0523 0.05 units box\nset group all diameter 1e-4 density 3000\n\
            region inlet block 0.02 0.08 0.02 0.08 0.06 0.07 units box\n";
        let sizes = "fix sphere all particletemplate/sphere 15485863 atom_type 1 volume_limit 1e-14 density constant 3000 radius constant 5e-5\n\
            fix sizes all particledistribution/discrete 15485867 1 sphere 1.0\n";
        let pack = "fix in all insert/pack seed 32452843 distributiontemplate sizes vel constant 1.0 0. 0. \
            start 105 insert_every once overlapcheck yes all_in yes particles_in_region 20 region inlet\n\
            fix voidage all voidage\ndump d all custom 1 speeds.txt id vx\nrun 1000000000\n";
        let pour = "fix voidage all voidage\ndump d all custom 1 speeds.txt id vx\ndump_modify d format float %.17g\nrun 104\n\
            fix in all pour 20 1 32452843 region inlet diam one 1e-4 dens 3000 3000 vel 1.0 1.0 0.0 0.0 0.0\nrun 1000000000\n";
        let (particles, script) =
            if program == "lammps" { (one.to_owned(), pour) } else { (format!("{one}{sizes}"), pack) };
        let r = run(program, "insert", &particles, script, 0.004, &[]);
        let n: Vec<f64> = r.rows.iter().map(|r| r["particles"]).collect();
        assert!(n[0] == 1.0 && n[n.len() - 1] >= 20.0, "{n:?}");
        // inserted at 1 m/s, no gravity in x: as fast until the first exchange that knows it (20 steps apart), slower
        // afterwards; the half kick of that exchange is not yet in the speed written at its own step
        let text = std::fs::read_to_string(r.folder.join("speeds.txt")).unwrap();
        let (mut step, mut seen) = (0, HashMap::<u32, Vec<(u32, f64)>>::new());
        let mut lines = text.lines();
        while let Some(l) = lines.next() {
            if l.starts_with("ITEM: TIMESTEP") {
                step = lines.next().unwrap().trim().parse().unwrap();
            } else if !l.starts_with("ITEM") && l.split_whitespace().count() == 2 {
                let (id, v) = l.trim().split_once(' ').unwrap();
                if let (Ok(id), Ok(v)) = (id.parse(), v.trim().parse()) {
                    seen.entry(id).or_default().push((step, v));
                }
            }
        }
        let inserted: Vec<_> = seen.values().filter(|s| s[0].0 > 1).collect();
        assert!(inserted.len() >= 20);
        for s in inserted {
            let exchange = s[0].0.next_multiple_of(20);
            for (step, v) in s {
                if *step <= exchange {
                    assert_eq!(*v, 1.0, "step {step}, exchange {exchange}");
                } else if *step > exchange + 2 {
                    assert!(*v < 1.0, "step {step}, exchange {exchange}");
                }
            }
        }
    }
}

#[test]
fn the_ledger_of_a_deleted_particle_is_booked() {
    for program in PROGRAMS {
        // the DEM drops a particle that leaves its box (smaller than the mesh): its ledger goes to ledger_left
        let leaving = "create_atoms 1 single 0.0495 0.0523 0.05 units box\ncreate_atoms 1 single 0.0885 0.0523 0.05 units box\n\
        set group all diameter 1e-4 density 3000\nvelocity all set 1.0 0.0 0.0\n";
        let script = "fix voidage all voidage\nthermo_modify lost ignore\nrun 1000000000\n";
        let r = run(program, "delete", leaving, script, 0.004, &[]);
        let n: Vec<f64> = r.rows.iter().map(|r| r["particles"]).collect();
        assert!(n[0] == 2.0 && n[n.len() - 1] == 1.0, "{n:?}");
        let left: Vec<f64> = r.rows.iter().map(|r| r["ledger_left"]).collect();
        let gone = n.iter().position(|n| *n == 1.0).unwrap();
        // booked in the row of the interval in which it vanished, and never changed again
        assert!(left[gone - 2] < 1e-22 && left[left.len() - 1] > 1e-13, "{left:?}");
        assert!(left[gone..].iter().all(|l| (l - left[gone]).abs() < 1e-22), "{left:?}");
    }
}
