// SPDX-License-Identifier: MIT OR Apache-2.0
//! The coupler's side of the channels: one partner per DEM and CFD rank.
//!
//! Gathers hellos, waits for messages with a limit, notices whoever dies or gives up meanwhile. Does not
//! know what the messages mean. Generic over the transport, so tests run it in memory.

use std::time::{Duration, Instant};
use thiserror::Error;
use voidage_wire::transport::{LOOK, send_copy};
use voidage_wire::{
    Frame, Hello, Process, Role, Transport, TransportError, Welcome, WireError, frame, hello, kind,
};

/// Why the partners cannot go on.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum PartnerError {
    /// A partner said why it stops.
    #[error("{who} gave up: {reason}")]
    GaveUp {
        /// role and rank
        who: String,
        /// its words
        reason: String,
    },
    /// A process is gone.
    #[error("{who} (process {pid}) has died or ended{waiting}")]
    Died {
        /// role and rank
        who: String,
        /// its process number
        pid: u32,
        /// what was waited for
        waiting: String,
    },
    /// Nothing came in time.
    #[error(
        "{who} sent no {what} for {seconds:.0} s: it is stalled, or limits.wait = {seconds:.0} s is too short for one step"
    )]
    Silent {
        /// role and rank
        who: String,
        /// what was due
        what: &'static str,
        /// waited, s
        seconds: f64,
    },
    /// Someone did not show up.
    #[error("{who} did not connect within {seconds:.0} s: look at its log")]
    Absent {
        /// role and rank
        who: String,
        /// waited, s
        seconds: f64,
    },
    /// A message is not what it should be.
    #[error("{who}: {source}")]
    Wire {
        /// role and rank
        who: String,
        /// what is wrong
        source: WireError,
    },
    /// The transport failed.
    #[error("{who}: {source}")]
    Transport {
        /// role and rank
        who: String,
        /// what failed
        source: TransportError,
    },
    /// `voidage run` is gone.
    #[error("`voidage run`, which started this run, has ended")]
    Orphaned,
    /// A hello that does not belong here.
    #[error("{who}: {what}")]
    Stranger {
        /// role and rank
        who: String,
        /// what is wrong
        what: String,
    },
}

/// A connected partner rank.
pub struct Partner<T: Transport> {
    transport: T,
    role: Role,
    rank: u32,
    hello: Option<Hello>,
    /// has said its last: may end
    free: bool,
    pending: Option<T::Sample>,
}

/// All partner ranks of a run: DEM ranks first, then CFD ranks.
pub struct Partners<T: Transport> {
    list: Vec<Partner<T>>,
    dem_ranks: usize,
    limit: Duration,
    launcher: Option<Process>,
    looked: Instant,
    /// false: of a recording, whose processes are long gone
    living: bool,
}

impl<T: Transport> Partners<T> {
    /// Takes the coupler's ends of all channels (rank order); `limit` for every wait.
    pub fn new(dem: Vec<T>, cfd: Vec<T>, limit: Duration) -> Self {
        let dem_ranks = dem.len();
        let partner = |role| {
            move |(rank, transport): (usize, T)| Partner {
                transport,
                role,
                rank: rank as u32,
                hello: None,
                free: false,
                pending: None,
            }
        };
        let list = dem.into_iter().enumerate().map(partner(Role::Dem));
        let list = list.chain(cfd.into_iter().enumerate().map(partner(Role::Cfd))).collect();
        Self { list, dem_ranks, limit, launcher: None, looked: Instant::now(), living: true }
    }
    /// The run ends when this process (who launched it) is gone.
    pub fn belongs_to(&mut self, launcher: Process) {
        self.launcher = Some(launcher);
    }
    /// The partners are those of a recording: nobody can die.
    pub fn of_a_recording(&mut self) {
        self.living = false;
    }
    /// Indices of the DEM ranks.
    pub fn dem(&self) -> std::ops::Range<usize> {
        0..self.dem_ranks
    }
    /// Indices of the CFD ranks.
    pub fn cfd(&self) -> std::ops::Range<usize> {
        self.dem_ranks..self.list.len()
    }
    /// "DEM rank 0".
    pub fn who(&self, i: usize) -> String {
        format!("{} rank {}", self.list[i].role.name().to_uppercase(), self.list[i].rank)
    }
    /// The hello of a partner, once met.
    pub fn hello(&self, i: usize) -> Option<&Hello> {
        self.list[i].hello.as_ref()
    }

    /// Waits for all hellos of the run `token`.
    pub fn meet(&mut self, token: &str, limit: Duration) -> Result<(), PartnerError> {
        let start = Instant::now();
        for i in 0..self.list.len() {
            while self.list[i].hello.is_none() {
                let who = self.who(i);
                if start.elapsed() > limit {
                    return Err(PartnerError::Absent { who, seconds: limit.as_secs_f64() });
                }
                let sample = self.list[i].transport.receive(LOOK);
                if let Some(s) =
                    sample.map_err(|source| PartnerError::Transport { who: who.clone(), source })?
                {
                    let frame =
                        Frame::parse(&s).map_err(|source| PartnerError::Wire { who: who.clone(), source })?;
                    if frame.kind() == kind::FAIL {
                        return Err(PartnerError::GaveUp { who, reason: frame.text() });
                    }
                    let stranger = |what: String| PartnerError::Stranger { who: who.clone(), what };
                    let bytes =
                        frame.expect(kind::HELLO).and_then(|()| frame.bytes(voidage_wire::field::TEXT));
                    let h: Hello =
                        hello::decode(bytes.map_err(|e| stranger(e.to_string()))?).map_err(stranger)?;
                    if h.token != token || h.role != self.list[i].role || h.rank != self.list[i].rank {
                        return Err(stranger(format!(
                            "a hello of run {}, {:?} rank {}",
                            h.token, h.role, h.rank
                        )));
                    }
                    self.list[i].hello = Some(h);
                }
                self.look(i, "hello")?;
            }
        }
        Ok(())
    }

    /// Tells a partner the settings.
    pub fn welcome(&mut self, i: usize, settings: &Welcome) -> Result<(), PartnerError> {
        let frame = frame::text_frame(kind::WELCOME, 0, &hello::encode(settings));
        let who = self.who(i);
        send_copy(&mut self.list[i].transport, &frame)
            .map_err(|source| PartnerError::Transport { who, source })
    }

    /// Error if any partner but `except` gave up, or any has died.
    fn look(&mut self, except: usize, what: &'static str) -> Result<(), PartnerError> {
        self.looked = Instant::now();
        if !self.living {
            return Ok(());
        }
        if self.launcher.is_some_and(|l| !l.is_alive()) {
            return Err(PartnerError::Orphaned);
        }
        for j in 0..self.list.len() {
            let who = self.who(j);
            let p = &mut self.list[j];
            if j != except && p.hello.is_some() && p.pending.is_none() {
                p.pending = p.transport.receive(Duration::ZERO).ok().flatten();
            }
            if let Some(f) = p.pending.as_ref().and_then(|s| Frame::parse(s).ok())
                && f.kind() == kind::FAIL
            {
                return Err(PartnerError::GaveUp { who, reason: f.text() });
            }
        }
        for j in 0..self.list.len() {
            if let Some(h) = &self.list[j].hello
                && !self.list[j].free
                && !h.process.is_alive()
                && self.list[j].pending.is_none()
            {
                let (who, pid) = (self.who(j), h.process.pid);
                // last words may have come between
                if let Some(s) = self.list[j].transport.receive(Duration::ZERO).ok().flatten() {
                    self.list[j].pending = Some(s);
                    continue;
                }
                let waiting = if j == except { format!(" before it sent its {what}") } else { String::new() };
                return Err(PartnerError::Died { who, pid, waiting });
            }
        }
        Ok(())
    }

    /// Waits for the next message of partner `i`, which must be of that kind; `what` names it in errors.
    pub fn receive(&mut self, i: usize, kind: u32, what: &'static str) -> Result<T::Sample, PartnerError> {
        let start = Instant::now();
        let who = self.who(i);
        // also when nobody lets us wait
        if self.looked.elapsed() > Duration::from_secs(1) {
            self.look(i, what)?;
        }
        loop {
            let next = match self.list[i].pending.take() {
                Some(s) => Some(s),
                None => {
                    let left = self.limit.saturating_sub(start.elapsed());
                    let r = self.list[i].transport.receive(left.min(LOOK));
                    r.map_err(|source| PartnerError::Transport { who: who.clone(), source })?
                }
            };
            if let Some(sample) = next {
                let wire = |source| PartnerError::Wire { who: who.clone(), source };
                let frame = Frame::parse(&sample).map_err(wire)?;
                if frame.kind() == kind::FAIL {
                    return Err(PartnerError::GaveUp { who, reason: frame.text() });
                }
                frame.expect(kind).map_err(wire)?;
                return Ok(sample);
            }
            self.look(i, what)?;
            if start.elapsed() >= self.limit && self.list[i].pending.is_none() {
                return Err(PartnerError::Silent { who, what, seconds: self.limit.as_secs_f64() });
            }
        }
    }

    /// Room for a message to partner `i`, written in place by `fill`, sent.
    pub fn send(
        &mut self,
        i: usize,
        kind: u32,
        step: i64,
        time: f64,
        blocks: &[voidage_wire::Block],
        fill: impl FnOnce(&mut [u64]),
    ) -> Result<(), PartnerError> {
        let who = self.who(i);
        let transport = &mut self.list[i].transport;
        let work = || {
            let mut loan = transport.loan(frame::words(blocks))?;
            frame::start(&mut loan, kind, step, time, blocks);
            fill(&mut loan);
            transport.send(loan)
        };
        let Err(source) = work() else { return Ok(()) };
        // who takes nothing any more may have said why
        let last = transport.receive(Duration::ZERO).ok().flatten();
        let words = last.as_ref().and_then(|s| Frame::parse(s).ok()).filter(|f| f.kind() == kind::FAIL);
        Err(match words {
            Some(f) => PartnerError::GaveUp { who, reason: f.text() },
            None => PartnerError::Transport { who, source },
        })
    }

    /// The fluid has sent its last: its ranks may end, nobody waits for them.
    pub fn release_cfd(&mut self) {
        for i in self.cfd() {
            self.list[i].free = true;
        }
    }

    /// Tells everyone that the run ends; empty reason: it is complete. Best effort.
    pub fn stop(&mut self, reason: &str) {
        for p in &mut self.list {
            let _ = send_copy(&mut p.transport, &frame::text_frame(kind::STOP, 0, reason.as_bytes()));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use voidage_wire::memory;

    fn hello(role: Role, rank: u32, process: Process) -> Vec<u64> {
        let program = "test".into();
        let h = Hello {
            token: "t".into(),
            role,
            rank,
            size: 1,
            time_step: 1.0,
            step: 0,
            time: 0.0,
            program,
            process,
        };
        frame::text_frame(kind::HELLO, 0, &hello::encode(&h))
    }

    fn run(dem: Process, cfd: Process) -> (Partners<memory::Memory>, memory::Memory, memory::Memory) {
        let ((mut a, sa), (mut b, sb)) = (memory::pair("DEM", "coupler"), memory::pair("CFD", "coupler"));
        send_copy(&mut a, &hello(Role::Dem, 0, dem)).unwrap();
        send_copy(&mut b, &hello(Role::Cfd, 0, cfd)).unwrap();
        let mut p = Partners::new(vec![sa], vec![sb], Duration::from_millis(500));
        p.meet("t", Duration::from_secs(5)).unwrap();
        (p, a, b)
    }

    fn error(p: &mut Partners<memory::Memory>, i: usize) -> String {
        p.receive(i, kind::FIELDS, "fields").err().unwrap().to_string()
    }

    #[test]
    fn the_silent_the_dead_and_those_who_give_up_are_named() {
        let (own, dead) = (Process::own(), Process { pid: 1, started: 1 });
        let (mut p, _a, _b) = run(own, own);
        assert!(error(&mut p, 1).starts_with("CFD rank 0 sent no fields for 0"), "limit");
        let (mut p, _a, _b) = run(own, own);
        p.list[0].hello.as_mut().unwrap().process = dead;
        let e = error(&mut p, 1);
        assert!(e.starts_with("DEM rank 0 (process 1) has died"), "{e}");
        let (mut p, mut a, _b) = run(own, own);
        send_copy(&mut a, &frame::text_frame(kind::FAIL, 0, b"out of atoms")).unwrap();
        assert_eq!(error(&mut p, 1), "DEM rank 0 gave up: out of atoms");
        let (mut p, _a, mut b) = run(own, own);
        send_copy(&mut b, &frame::text_frame(kind::FAIL, 0, b"no sources")).unwrap();
        drop(b);
        let e = p.send(1, kind::SOURCES, 1, 0.0, &[], |_| {}).unwrap_err().to_string();
        assert_eq!(e, "CFD rank 0 gave up: no sources");
        let (mut p, _a, mut b) = run(own, own);
        send_copy(&mut b, &frame::text_frame(kind::MESH, 0, b"")).unwrap();
        assert!(error(&mut p, 1).contains("kind 20 arrived where 21 was due"));
    }

    #[test]
    fn a_stranger_and_another_version_are_refused() {
        let (mut a, sa) = memory::pair("DEM", "coupler");
        send_copy(&mut a, &hello(Role::Dem, 0, Process::own())).unwrap();
        let mut p = Partners::new(vec![sa], vec![], Duration::from_secs(1));
        let e = p.meet("other", Duration::from_secs(1)).unwrap_err().to_string();
        assert!(e.contains("a hello of run t"), "{e}");
        let (mut a, sa) = memory::pair("DEM", "coupler");
        let mut h = hello(Role::Dem, 0, Process::own());
        h[0] += 1;
        send_copy(&mut a, &h).unwrap();
        let mut p = Partners::new(vec![sa], vec![], Duration::from_secs(1));
        let e = p.meet("t", Duration::from_secs(1)).unwrap_err().to_string();
        assert!(e.contains("protocol version 2, this program speaks 1"), "{e}");
        let (_a, sa) = memory::pair("DEM", "coupler");
        let mut p = Partners::new(vec![sa], vec![], Duration::from_secs(1));
        let e = p.meet("t", Duration::from_millis(300)).unwrap_err().to_string();
        assert!(e.starts_with("DEM rank 0 did not connect"), "{e}");
    }
}
