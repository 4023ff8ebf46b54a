// SPDX-License-Identifier: MIT OR Apache-2.0
//! The command line: arguments, then the library, then an exit code (0 ok, 1 failed, 2 bad input, 130 interrupted).
#![forbid(unsafe_code)]

use clap::{Parser, Subcommand};
use std::path::PathBuf;
use std::process::ExitCode;
use voidage::commands;

/// Couples OpenFOAM with LIGGGHTS or LAMMPS: CFD-DEM with exact action and reaction.
#[derive(Parser)]
#[command(version, propagate_version = true)]
struct Arguments {
    /// error, warn, info, debug or trace
    #[arg(long, global = true, default_value = "info")]
    log: String,
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Runs a case: starts both programs and the coupler, shows progress, stops all when one fails
    Run {
        /// folder with case.toml
        case: PathBuf,
        /// copy the case to this folder and run it there
        #[arg(long)]
        into: Option<PathBuf>,
        /// override a key: section.key=value (repeatable)
        #[arg(long = "set", value_name = "KEY=VALUE")]
        set: Vec<String>,
        /// continue from the newest restart set of the case, or from that of a write time: --restart=0.25
        #[arg(long, value_name = "TIME", num_args = 0..=1, require_equals = true)]
        restart: Option<Option<f64>>,
    },
    /// Validates a case without running it and prints all problems at once
    Check {
        /// folder with case.toml
        case: PathBuf,
        /// override a key: section.key=value (repeatable)
        #[arg(long = "set", value_name = "KEY=VALUE")]
        set: Vec<String>,
    },
    /// The coupler itself, started by `voidage run` under mpirun
    Couple {
        /// folder with case.toml
        case: PathBuf,
        /// read the case as `voidage run` resolved it (logs/case.resolved.toml)
        #[arg(long)]
        resolved: bool,
        /// folder of the restart set to continue from
        #[arg(long)]
        restart: Option<PathBuf>,
    },
    /// Runs the coupling step on a recording, without the partners, and compares its replies with those recorded
    Replay {
        /// recording (made by `voidage run CASE --set record.every=1`)
        file: PathBuf,
        /// override a setting of the recorded case: section.key=value (repeatable)
        #[arg(long = "set", value_name = "KEY=VALUE")]
        set: Vec<String>,
        /// compare with the replies in this recording instead
        #[arg(long, value_name = "FILE2")]
        compare: Option<PathBuf>,
        /// record the replay
        #[arg(long, value_name = "FILE")]
        save: Option<PathBuf>,
    },
    /// Tells what a scene is made of, which terms matter in it, and what should be changed
    Inspect {
        /// recording, or folder with case.toml
        file: PathBuf,
        /// override a setting: section.key=value (repeatable)
        #[arg(long = "set", value_name = "KEY=VALUE")]
        set: Vec<String>,
        /// terms above it are to be modelled
        #[arg(long, default_value_t = 1e-2)]
        accuracy: f64,
    },
    /// Tells the largest fluid step each coupling scheme bears in a recorded scene
    Stability {
        /// recording, or folder of a case with one
        file: PathBuf,
        /// override a setting: section.key=value (repeatable)
        #[arg(long = "set", value_name = "KEY=VALUE")]
        set: Vec<String>,
        /// recorded exchange to look at [default: 8 spread over the recording]
        #[arg(long, value_name = "K")]
        exchange: Option<i64>,
        /// this scheme alone
        #[arg(long, value_name = "NAME")]
        scheme: Option<String>,
        /// also draw growth over fluid step (stability-free.svg, stability-held.svg)
        #[arg(long, value_name = "FOLDER")]
        map: Option<PathBuf>,
        /// also write all numbers to this file
        #[arg(long, value_name = "FILE")]
        json: Option<PathBuf>,
    },
    /// Writes one page (HTML) about a run, to be read in a browser
    Report {
        /// recording, or folder of a case that ran
        file: PathBuf,
        /// folder for report.html and its pictures [default: CASE/report, or beside the recording]
        #[arg(long, value_name = "FOLDER")]
        into: Option<PathBuf>,
        /// terms above it matter
        #[arg(long, default_value_t = 1e-2)]
        accuracy: f64,
        /// show what `voidage tune --json FILE` found
        #[arg(long, value_name = "FILE")]
        tune: Option<PathBuf>,
        /// show what `voidage stability --json FILE` found
        #[arg(long, value_name = "FILE")]
        stability: Option<PathBuf>,
    },
    /// Measures on a recording what the settings cost and how exact they are, and tells the cheapest that are exact enough
    Tune {
        /// recording
        file: PathBuf,
        /// largest numerical error of voidage, forces and momentum source, relative in L2
        #[arg(long)]
        accuracy: f64,
        /// override a setting of all candidates: section.key=value (repeatable)
        #[arg(long = "set", value_name = "KEY=VALUE")]
        set: Vec<String>,
        /// the last exchanges of the recording that are replayed
        #[arg(long, default_value_t = 12)]
        exchanges: usize,
        /// vary only this: mapping, smoother or interpolation (repeatable)
        #[arg(long, value_name = "WHAT")]
        only: Vec<String>,
        /// write the sections of case.toml to this file
        #[arg(long, value_name = "FILE")]
        write: Option<PathBuf>,
        /// also write all numbers to this file (fields: src/tune/table.rs)
        #[arg(long, value_name = "FILE")]
        json: Option<PathBuf>,
        /// print all candidates, not only the front
        #[arg(long)]
        all: bool,
    },
    /// Writes a recording as ParaView series or as tables (CSV, Parquet), with its monitor
    Export {
        /// recording
        file: PathBuf,
        /// folder, new or empty [default: beside the recording, named after it]
        #[arg(long, value_name = "FOLDER")]
        into: Option<PathBuf>,
        /// vtk (.pvd with .vtu and .vtp), csv or parquet
        #[arg(long, default_value = "vtk")]
        format: String,
        /// every n-th recorded exchange
        #[arg(long, default_value_t = 1)]
        every: usize,
    },
    /// Prints the reference of case.toml, or of monitor.csv
    Explain {
        /// case or monitor
        #[arg(default_value = "case")]
        topic: String,
    },
    /// Measures what the coupling step costs on this machine, and the smoothers' speed and error side by side
    Bench {
        /// also write all numbers to this file (fields: src/bench/report.rs)
        #[arg(long, value_name = "FILE")]
        json: Option<PathBuf>,
        /// also draw the smoothers' time over their error (SVG)
        #[arg(long, value_name = "FILE")]
        plot: Option<PathBuf>,
        /// a tenth of the size, for a first look
        #[arg(long)]
        quick: bool,
    },
    /// Prints the versions of this program, its protocol and the partners found
    Version,
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let filter = tracing_subscriber::EnvFilter::try_new(&arguments.log);
    let Ok(filter) = filter else {
        eprintln_exit(&format!("--log {}: use error, warn, info, debug or trace", arguments.log));
        return ExitCode::from(2);
    };
    tracing_subscriber::fmt().with_env_filter(filter).with_writer(std::io::stderr).init();
    let code = match arguments.command {
        Command::Run { case, into, set, restart } => commands::run(&case, into.as_deref(), &set, restart),
        Command::Check { case, set } => commands::check(&case, &set),
        Command::Couple { case, resolved, restart } => commands::couple(&case, resolved, restart.as_deref()),
        Command::Replay { file, set, compare, save } => {
            commands::record::replay(&file, &set, compare.as_deref(), save.as_deref())
        }
        Command::Inspect { file, set, accuracy } => commands::inspect::inspect(&file, &set, accuracy),
        Command::Stability { file, set, exchange, scheme, map, json } => {
            let (map, json) = (map.as_deref(), json.as_deref());
            let options =
                commands::stability::Options { set: &set, exchange, scheme: scheme.as_deref(), map, json };
            commands::stability::stability(&file, &options)
        }
        Command::Report { file, into, accuracy, tune, stability } => {
            let (into, tune, stability) = (into.as_deref(), tune.as_deref(), stability.as_deref());
            let options = commands::report::Options { into, accuracy, tune, stability };
            commands::report::report(&file, &options)
        }
        Command::Tune { file, accuracy, set, exchanges, only, write, json, all } => {
            let (write, json) = (write.as_deref(), json.as_deref());
            let o = commands::tune::Options { set: &set, accuracy, exchanges, only: &only, write, json, all };
            commands::tune::tune(&file, &o)
        }
        Command::Export { file, into, format, every } => {
            commands::export::export(&file, into.as_deref(), &format, every)
        }
        Command::Explain { topic } => commands::explain(&topic),
        Command::Bench { json, plot, quick } => commands::bench(json.as_deref(), plot.as_deref(), quick),
        Command::Version => commands::version(),
    };
    ExitCode::from(code)
}

#[allow(clippy::print_stderr)]
fn eprintln_exit(text: &str) {
    eprintln!("{text}");
}
