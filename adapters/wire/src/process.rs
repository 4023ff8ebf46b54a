// SPDX-License-Identifier: MIT OR Apache-2.0
//! Is a process of this machine still alive? Reads /proc; a zombie counts as dead, a reused pid too.

use serde::{Deserialize, Serialize};

/// A process: its number and its start (clock ticks since boot), which together are unique.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct Process {
    /// process number
    pub pid: u32,
    /// field 22 of /proc/PID/stat
    pub started: u64,
}

impl Process {
    /// This process.
    pub fn own() -> Self {
        let pid = std::process::id();
        Self { pid, started: stat(pid).map_or(0, |s| s.1) }
    }
    /// A process by number, if it lives.
    pub fn find(pid: u32) -> Option<Self> {
        stat(pid).filter(|s| s.0 != 'Z' && s.0 != 'X').map(|s| Self { pid, started: s.1 })
    }
    /// Still the same process and not a zombie.
    pub fn is_alive(&self) -> bool {
        Self::find(self.pid).is_some_and(|p| p.started == self.started)
    }
}

/// State letter and start time of a process. The name in the second field may hold blanks and brackets.
fn stat(pid: u32) -> Option<(char, u64)> {
    let text = std::fs::read_to_string(format!("/proc/{pid}/stat")).ok()?;
    let rest = &text[text.rfind(')')? + 2..];
    let mut fields = rest.split(' ');
    let state = fields.next()?.chars().next()?;
    Some((state, fields.nth(18)?.parse().ok()?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_zombie_and_a_reused_number_are_dead() {
        assert!(Process::own().is_alive());
        assert!(!Process { started: 1, ..Process::own() }.is_alive());
        let mut child = std::process::Command::new("true").spawn().unwrap();
        let p = Process { pid: child.id(), started: stat(child.id()).unwrap().1 };
        let end = std::time::Instant::now() + std::time::Duration::from_secs(5);
        while p.is_alive() && std::time::Instant::now() < end {
            std::thread::sleep(std::time::Duration::from_millis(5));
        }
        assert!(!p.is_alive(), "not waited for yet, so a zombie");
        child.wait().unwrap();
        assert!(!p.is_alive());
    }
}
