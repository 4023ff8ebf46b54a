// SPDX-License-Identifier: MIT OR Apache-2.0
//! A partner rank's connection to the coupler: handshake, one message out, one message in. Safe code only.
//!
//! Reads the session, waits with limits, notices a dead coupler. Does not know what arrays mean.

use std::ffi::CString;
use std::time::Duration;
use voidage_shm::Hub;
use voidage_shm::channel::{Channel, Loan, Received};
use voidage_wire::transport::{send_copy, wait};
use voidage_wire::{
    Block, Frame, Hello, Process, Role, Session, Transport, TransportError, Welcome, frame, hello, kind,
};

/// The connection of this process.
pub struct Link {
    channel: Channel,
    _hub: Hub,
    coupler: Process,
    limit: Duration,
    settings: Welcome,
    loan: Option<Loan>,
    sample: Option<Received>,
    stop_reason: CString,
}

/// What `Link::open` is told about this program.
pub struct Me<'a> {
    /// DEM or CFD
    pub role: Role,
    /// rank in the program's MPI world
    pub rank: u32,
    /// its size
    pub size: u32,
    /// own time step, s
    pub time_step: f64,
    /// own step number
    pub step: i64,
    /// own time, s
    pub time: f64,
    /// name and version
    pub program: &'a str,
}

fn c_text(text: &str) -> CString {
    CString::new(text.replace('\0', " ")).unwrap_or_default()
}

impl Link {
    /// Finds the run, waits for the coupler, shakes hands.
    pub fn open(me: &Me) -> Result<Self, String> {
        let session = Session::from_environment()?;
        let ranks = if me.role == Role::Dem { session.dem_ranks } else { session.cfd_ranks };
        if me.size != ranks || me.rank >= me.size {
            return Err(format!(
                "{} runs with rank {} of {}, the case says {ranks} ranks: set run.{}_ranks",
                me.program,
                me.rank,
                me.size,
                me.role.name()
            ));
        }
        let coupler = session.wait_for_coupler()?;
        let text = |e: TransportError| e.to_string();
        let hub = Hub::join(&session).map_err(text)?;
        let mut channel = hub.connect(me.role, me.rank).map_err(text)?;
        let hello = Hello {
            token: session.token.clone(),
            role: me.role,
            rank: me.rank,
            size: me.size,
            time_step: me.time_step,
            step: me.step,
            time: me.time,
            program: me.program.into(),
            process: Process::own(),
        };
        send_copy(&mut channel, &frame::text_frame(kind::HELLO, 0, &hello::encode(&hello))).map_err(text)?;
        // the coupler waits `wait` for others before it can serve us, so we wait longer
        let mut link = Self {
            channel,
            _hub: hub,
            coupler,
            limit: Duration::from_secs_f64(session.start + 10.0),
            settings: Welcome::default(),
            loan: None,
            sample: None,
            stop_reason: CString::default(),
        };
        if link.receive()? == kind::STOP {
            return Err(link.stop_reason.to_string_lossy().into_owned());
        }
        let received = link.frame()?;
        received.expect(kind::WELCOME).map_err(|e| e.to_string())?;
        link.settings = hello::decode(received.bytes(voidage_wire::field::TEXT).map_err(|e| e.to_string())?)?;
        link.limit = Duration::from_secs_f64(2.0 * session.wait + 10.0);
        link.release();
        Ok(link)
    }
    /// A number told by the coupler.
    pub fn setting(&self, name: &str) -> Option<f64> {
        self.settings.settings.get(name).copied()
    }
    /// Room for a message.
    pub fn begin(&mut self, kind: u32, step: i64, time: f64, blocks: &[Block]) -> Result<(), String> {
        self.loan = None;
        let mut loan = self.channel.loan(frame::words(blocks)).map_err(|e| e.to_string())?;
        frame::start(&mut loan, kind, step, time, blocks);
        self.loan = Some(loan);
        Ok(())
    }
    /// Where to write an array of the message begun.
    pub fn array(&mut self, field: u32) -> Option<&mut [u64]> {
        frame::array_mut(self.loan.as_mut()?, field)
    }
    /// Sends the message begun.
    pub fn send(&mut self) -> Result<(), String> {
        let loan = self.loan.take().ok_or("voidage_send without voidage_begin")?;
        self.channel.send(loan).map_err(|e| e.to_string())
    }
    /// Waits for the next message; its kind.
    pub fn receive(&mut self) -> Result<u32, String> {
        self.sample = None;
        let coupler = self.coupler;
        let peer: String = self.channel.peer().into();
        let check = || {
            if coupler.is_alive() {
                Ok(())
            } else {
                Err(TransportError::Died { peer: peer.clone(), pid: coupler.pid })
            }
        };
        let sample = wait(&mut self.channel, self.limit, check).map_err(|e| e.to_string())?;
        let (kind, text) = {
            let f = Frame::parse(&sample).map_err(|e| e.to_string())?;
            (f.kind(), if f.kind() == kind::STOP { f.text() } else { String::new() })
        };
        self.stop_reason = c_text(&text);
        self.sample = Some(sample);
        Ok(kind)
    }
    /// The message received.
    pub fn frame(&self) -> Result<Frame<'_>, String> {
        let sample = self.sample.as_ref().ok_or("no message is being read")?;
        Frame::parse(sample).map_err(|e| e.to_string())
    }
    /// Why the run ends; empty: it is complete.
    pub fn stop_reason(&self) -> &CString {
        &self.stop_reason
    }
    /// Gives the message received back.
    pub fn release(&mut self) {
        self.sample = None;
    }
    /// Tells the coupler why this program gives up; best effort.
    pub fn fail(&mut self, reason: &str) {
        self.loan = None;
        let _ = send_copy(&mut self.channel, &frame::text_frame(kind::FAIL, 0, reason.as_bytes()));
    }
}
