// SPDX-License-Identifier: MIT OR Apache-2.0
//! The processes of a run: started, watched, ended by number. Ranks are descendants of mpirun in groups of
//! their own, so all descendants are remembered (number and start time) while they run.

use std::collections::{BTreeMap, HashSet};
use std::fs::File;
use std::io::{BufRead, BufReader, Write};
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::path::PathBuf;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};
use voidage_wire::Process;

/// What to start.
pub struct Group {
    /// couple, dem or cfd
    pub name: &'static str,
    /// program and arguments
    pub command: Vec<String>,
    /// working folder
    pub cwd: PathBuf,
    /// where its output goes
    pub log: PathBuf,
    /// a log the program writes itself: mpirun may lose the last lines of a program that aborts
    pub own_log: Option<PathBuf>,
}

struct Running {
    name: &'static str,
    log: PathBuf,
    own_log: Option<PathBuf>,
    child: Child,
    status: Option<ExitStatus>,
}

/// The started groups.
pub struct Groups {
    list: Vec<Running>,
    family: HashSet<Process>,
    lines: Receiver<String>,
    first_failed: Option<usize>,
}

impl Groups {
    /// Starts all; the first one's output (the coupler's) is also read line by line.
    pub fn start(plan: &[Group]) -> Result<Self, String> {
        let (tx, lines) = channel();
        let mut groups = Self { list: Vec::new(), family: HashSet::new(), lines, first_failed: None };
        for g in plan {
            let log = File::create(&g.log).map_err(|e| format!("{}: {e}", g.log.display()))?;
            let twin = log.try_clone().map_err(|e| e.to_string())?;
            let mut command = Command::new(&g.command[0]);
            command.args(&g.command[1..]).current_dir(&g.cwd).stdin(Stdio::null()).process_group(0);
            let piped = groups.list.is_empty();
            if piped {
                command.stdout(Stdio::piped()).stderr(twin);
            } else {
                command.stdout(log.try_clone().map_err(|e| e.to_string())?).stderr(twin);
            }
            let child = command.spawn();
            let mut child = match child {
                Ok(c) => c,
                Err(e) => {
                    groups.end();
                    return Err(format!("{} could not be started: {e}; type ./setup build", g.command[0]));
                }
            };
            if let Some(out) = child.stdout.take() {
                let tx = tx.clone();
                std::thread::spawn(move || {
                    let mut log = log;
                    for line in BufReader::new(out).lines().map_while(Result::ok) {
                        if !line.starts_with("@progress") {
                            let _ = writeln!(log, "{line}");
                        }
                        let _ = tx.send(line);
                    }
                });
            }
            groups.list.push(Running {
                name: g.name,
                log: g.log.clone(),
                own_log: g.own_log.clone(),
                child,
                status: None,
            });
        }
        groups.remember();
        Ok(groups)
    }

    /// Lines of the coupler since the last call.
    pub fn lines(&self) -> Vec<String> {
        self.lines.try_iter().collect()
    }

    /// Looks who has ended, and remembers new descendants.
    pub fn look(&mut self) {
        self.remember();
        for (i, g) in self.list.iter_mut().enumerate() {
            if g.status.is_none() {
                g.status = g.child.try_wait().ok().flatten();
                if g.status.is_some_and(|s| !s.success()) && self.first_failed.is_none() {
                    self.first_failed = Some(i);
                }
            }
        }
    }
    /// Number of groups still running.
    pub fn running(&self) -> usize {
        self.list.iter().filter(|g| g.status.is_none()).count()
    }
    /// The first group that failed.
    pub fn failed(&self) -> Option<usize> {
        self.first_failed
    }

    /// A group killed by a signal: then the others failed because of it.
    pub fn killed(&self) -> Option<usize> {
        self.list
            .iter()
            .position(|g| g.status.is_some_and(|s| s.signal().is_some() || s.code().is_some_and(|c| c > 128)))
    }

    /// Why the run failed: the coupler's words if it had any, else the end of a log.
    pub fn reason(&self, first: usize, coupler: Option<&str>) -> String {
        // whose end the coupler saw; others ended because of it, perhaps sooner
        let named =
            |g: &Running| coupler.is_some_and(|w| w.contains(&format!("{} rank", g.name.to_uppercase())));
        let g = self.list.iter().find(|g| named(g)).unwrap_or(&self.list[first]);
        let how = match g.status {
            Some(s) if s.signal().is_some() => {
                format!("was killed by signal {}", s.signal().unwrap_or_default())
            }
            // mpirun reports a rank's signal as 128 + number
            Some(s) if s.code().is_some_and(|c| c > 128) => {
                format!("was killed by signal {}", s.code().unwrap_or_default() - 128)
            }
            Some(s) => format!("ended with exit code {}", s.code().unwrap_or_default()),
            None => "is still running".into(),
        };
        let mut text = match coupler {
            Some(words) => words.to_string(),
            None => format!("{} {how}", g.name),
        };
        let logs = g.own_log.iter().chain([&g.log]);
        // not always UTF-8: LIGGGHTS may print freed memory behind its last message
        let read = |l| String::from_utf8_lossy(&std::fs::read(l).unwrap_or_default()).into_owned();
        let tail: String = logs.map(read).collect();
        // "voidage: ", not the "voidage::" of a function's name
        let wanted = |l: &&str| {
            // a line of a stack trace, "#1  Foam::error::abort()", says nothing
            let traced =
                l.trim_start_matches(|c: char| "[] ".contains(c) || c.is_ascii_digit()).starts_with('#');
            !traced
                && (l.contains("ERROR") || l.contains("rror:") || l.contains("voidage: "))
                && !l.contains("ORTE_")
        };
        let lines: Vec<&str> = tail.lines().collect();
        if let Some(at) = lines.iter().rposition(wanted) {
            let line = lines[at].trim();
            // OpenFOAM says what it is in the line after
            let more = lines.get(at + 1).filter(|_| line.ends_with("ERROR:"));
            let told = coupler.and_then(|w| w.lines().next()).is_some_and(|w| line.contains(w));
            if !told && !text.contains(line) {
                text += &format!("\n  {} {how}; its log says: {line}", g.name);
                text.extend(more.map(|l| format!(" {}", l.trim())));
            }
        }
        text + &format!("\n  log: {}", g.log.display())
    }

    /// All descendants of the groups, by number and start time.
    fn remember(&mut self) {
        let mut children: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
        for entry in std::fs::read_dir("/proc").into_iter().flatten().flatten() {
            let Some(pid) = entry.file_name().to_str().and_then(|n| n.parse::<u32>().ok()) else { continue };
            let Ok(stat) = std::fs::read_to_string(format!("/proc/{pid}/stat")) else { continue };
            let parent = stat.rfind(')').and_then(|i| stat[i + 2..].split(' ').nth(1)?.parse().ok());
            children.entry(parent.unwrap_or(0)).or_default().push(pid);
        }
        let mut next: Vec<u32> = self.list.iter().map(|g| g.child.id()).collect();
        next.extend(self.family.iter().filter(|p| p.is_alive()).map(|p| p.pid));
        let mut seen = HashSet::new();
        while let Some(pid) = next.pop() {
            if seen.insert(pid) {
                self.family.extend(Process::find(pid));
                next.extend(children.get(&pid).into_iter().flatten());
            }
        }
    }

    fn signal(&self, signal: rustix::process::Signal) {
        for p in self.family.iter().filter(|p| p.is_alive()) {
            if let Some(pid) = i32::try_from(p.pid).ok().and_then(rustix::process::Pid::from_raw) {
                let _ = rustix::process::kill_process(pid, signal);
            }
        }
    }

    /// Ends whoever is left: SIGTERM, and SIGKILL after two seconds.
    pub fn end(&mut self) {
        self.look();
        let alive = |g: &Self| g.family.iter().any(Process::is_alive);
        if !alive(self) {
            return;
        }
        self.signal(rustix::process::Signal::TERM);
        let begin = Instant::now();
        while alive(self) && begin.elapsed() < Duration::from_secs(2) {
            std::thread::sleep(Duration::from_millis(20));
            self.look();
        }
        let begin = Instant::now();
        while alive(self) && begin.elapsed() < Duration::from_secs(3) {
            self.signal(rustix::process::Signal::KILL);
            std::thread::sleep(Duration::from_millis(20));
            self.look();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn start(scripts: [&str; 2]) -> Groups {
        let folder = std::env::temp_dir();
        let log =
            |i: usize| folder.join(format!("voidage-groups-{}-{i}-{:p}.log", std::process::id(), scripts[0]));
        let group = |i: usize| Group {
            name: ["couple", "dem"][i],
            command: ["sh", "-c", scripts[i]].map(String::from).to_vec(),
            cwd: folder.clone(),
            log: log(i),
            own_log: None,
        };
        Groups::start(&[group(0), group(1)]).unwrap()
    }

    fn wait(g: &mut Groups, until: impl Fn(&Groups) -> bool) {
        let begin = Instant::now();
        while !until(g) {
            assert!(begin.elapsed() < Duration::from_secs(10));
            std::thread::sleep(Duration::from_millis(10));
            g.look();
        }
    }

    #[test]
    fn who_fails_first_is_named_and_grandchildren_are_ended() {
        let mut g = start([
            "echo '@error DEM rank 0 has died'; (sleep 1000 & wait)",
            "sleep 0.3; echo ERROR: lost atoms; exit 3",
        ]);
        wait(&mut g, |g| g.failed().is_some());
        assert_eq!(g.failed(), Some(1));
        let reason = g.reason(1, None);
        assert!(reason.contains("dem ended with exit code 3") && reason.contains("lost atoms"), "{reason}");
        let family: Vec<_> = g.family.iter().copied().collect();
        assert!(family.len() >= 4, "mother, child and sleep of the first, the second");
        g.end();
        assert!(family.iter().all(|p| !p.is_alive()));
        assert_eq!(g.lines(), ["@error DEM rank 0 has died"]);
        g.list.iter().for_each(|g| std::fs::remove_file(&g.log).unwrap());
    }

    #[test]
    fn a_kill_is_told_apart_from_an_exit_code_and_stubborn_children_end() {
        let mut g = start(["trap '' TERM; sleep 1000; sleep 1000", "kill -9 $$"]);
        wait(&mut g, |g| g.failed().is_some());
        assert!(g.reason(1, None).contains("dem was killed by signal 9"));
        g.end();
        assert_eq!(g.running(), 0);
        g.list.iter().for_each(|g| std::fs::remove_file(&g.log).unwrap());
    }
}
