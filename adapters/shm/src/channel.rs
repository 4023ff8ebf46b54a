// SPDX-License-Identifier: MIT OR Apache-2.0
//! The iceoryx2 transport: publish-subscribe slices of u64 each way, and an event that wakes the receiver.
//!
//! Zero-copy: a loan lies in the shared segment, a sample is read there. Every run has its own root folder
//! and prefix, so no run sees another's nodes. Segments grow by powers of two; at most four messages exist
//! per direction (two queued, one read, one written), so iceoryx2 reserves 4 x the largest message.

use iceoryx2::config::Config;
use iceoryx2::port::listener::Listener;
use iceoryx2::port::notifier::Notifier;
use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::prelude::*;
use iceoryx2::sample::Sample;
use iceoryx2::sample_mut::SampleMut;
use std::fmt::Display;
use std::ops::{Deref, DerefMut};
use std::time::{Duration, Instant};
use voidage_wire::{Role, Session, Transport, TransportError};

type S = ipc::Service;

/// Words a segment starts with (8 KiB); it grows with the messages.
const FIRST_WORDS: usize = 1024;

fn system<E: Display>(what: &'static str) -> impl Fn(E) -> TransportError {
    move |e| TransportError::System { what, why: e.to_string() }
}

/// This process's place in the run's iceoryx2 world; makes its channels.
pub struct Hub {
    node: Node<S>,
}

impl Hub {
    /// Joins the world of a run. Signals stay with the host program.
    pub fn join(session: &Session) -> Result<Self, TransportError> {
        set_log_level(LogLevel::Fatal);
        let mut config = Config::default();
        let root = Path::new(session.root.join("i").as_os_str().as_encoded_bytes());
        config.global.set_root_path(&root.map_err(system("run folder"))?);
        let prefix = FileName::new(crate::janitor::prefix(&session.token).as_bytes());
        config.global.prefix = prefix.map_err(system("prefix of the run"))?;
        // cleaning up is the janitor's: iceoryx2 must not scan while peers come and go
        config.global.node.cleanup_dead_nodes_on_creation = false;
        config.global.node.cleanup_dead_nodes_on_destruction = false;
        config.global.service.cleanup_dead_nodes_on_open = false;
        let node = NodeBuilder::new()
            .signal_handling_mode(SignalHandlingMode::Disabled)
            .config(&config)
            .create::<S>()
            .map_err(system("join the shared memory of the run"))?;
        Ok(Self { node })
    }

    /// The coupler's end of the channel to a partner rank. Made before `Session::announce`.
    pub fn serve(&self, role: Role, rank: u32) -> Result<Channel, TransportError> {
        self.channel(role, rank, true, format!("{} rank {rank}", role.name().to_uppercase()))
    }

    /// A partner's end of its channel to the coupler.
    pub fn connect(&self, role: Role, rank: u32) -> Result<Channel, TransportError> {
        self.channel(role, rank, false, "the coupler".into())
    }

    fn channel(&self, role: Role, rank: u32, server: bool, peer: String) -> Result<Channel, TransportError> {
        let name = |part: &str| -> Result<ServiceName, TransportError> {
            let text = format!("{}.{rank}/{part}", role.name());
            text.as_str().try_into().map_err(|_| TransportError::System { what: "channel name", why: text })
        };
        let data = |part: &str| {
            let b = self.node.service_builder(&name(part)?).publish_subscribe::<[u64]>();
            let b = b.enable_safe_overflow(false).history_size(0).max_nodes(2);
            let b = b.subscriber_max_buffer_size(2).subscriber_max_borrowed_samples(1);
            let b = b.max_publishers(1).max_subscribers(1);
            if server {
                b.create().map_err(system("make a channel"))
            } else {
                b.open().map_err(system("open a channel"))
            }
        };
        let event = |part: &str| {
            let b = self.node.service_builder(&name(part)?).event();
            let b = b.max_nodes(2).max_notifiers(1).max_listeners(1).event_id_max_value(1);
            if server {
                b.create().map_err(system("make an event"))
            } else {
                b.open().map_err(system("open an event"))
            }
        };
        let (up, down, up_event, down_event) =
            (data("up")?, data("down")?, event("up-event")?, event("down-event")?);
        let (out, inward, bell, ear) =
            if server { (down, up, down_event, up_event) } else { (up, down, up_event, down_event) };
        let publisher = out
            .publisher_builder()
            .initial_max_slice_len(FIRST_WORDS)
            .allocation_strategy(AllocationStrategy::PowerOfTwo)
            .max_loaned_samples(1)
            .backpressure_strategy(BackpressureStrategy::DiscardData)
            .create()
            .map_err(system("publisher"))?;
        let subscriber = inward.subscriber_builder().create().map_err(system("subscriber"))?;
        let notifier = bell.notifier_builder().default_event_id(EventId::new(1)).create();
        let listener = ear.listener_builder().create();
        Ok(Channel {
            peer,
            publisher,
            subscriber,
            notifier: notifier.map_err(system("notifier"))?,
            listener: listener.map_err(system("listener"))?,
        })
    }
}

/// One end of a channel.
pub struct Channel {
    peer: String,
    publisher: Publisher<S, [u64], ()>,
    subscriber: Subscriber<S, [u64], ()>,
    notifier: Notifier<S>,
    listener: Listener<S>,
}

/// Room in the shared segment.
pub struct Loan(SampleMut<S, [u64], ()>);
/// A message in the shared segment.
pub struct Received(Sample<S, [u64], ()>);

impl Deref for Loan {
    type Target = [u64];
    fn deref(&self) -> &[u64] {
        self.0.payload()
    }
}
impl DerefMut for Loan {
    fn deref_mut(&mut self) -> &mut [u64] {
        self.0.payload_mut()
    }
}
impl Deref for Received {
    type Target = [u64];
    fn deref(&self) -> &[u64] {
        self.0.payload()
    }
}

impl Transport for Channel {
    type Loan = Loan;
    type Sample = Received;
    fn peer(&self) -> &str {
        &self.peer
    }
    fn loan(&mut self, words: usize) -> Result<Loan, TransportError> {
        let bytes = 8 * words;
        let no_room = |e: &dyn Display| TransportError::NoRoom { bytes, why: e.to_string() };
        crate::janitor::room_for(bytes).map_err(|e| no_room(&e))?;
        Ok(Loan(self.publisher.loan_slice(words).map_err(|e| no_room(&e))?))
    }
    fn send(&mut self, loan: Loan) -> Result<(), TransportError> {
        let taken = loan.0.send().map_err(system("send"))?;
        if taken == 0 {
            return Err(TransportError::NotTaken { peer: self.peer.clone() });
        }
        self.notifier.notify().map_err(system("wake the receiver"))?;
        Ok(())
    }
    fn receive(&mut self, limit: Duration) -> Result<Option<Received>, TransportError> {
        let start = Instant::now();
        loop {
            if let Some(sample) = self.subscriber.receive().map_err(system("receive"))? {
                return Ok(Some(Received(sample)));
            }
            let left = limit.saturating_sub(start.elapsed());
            if left.is_zero() {
                return Ok(None);
            }
            self.listener.timed_wait(|_| (), left).map_err(system("wait"))?;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keeps_the_contract() {
        let session = Session::create(std::path::Path::new("/c"), 1, 1, 1.0, 1.0).unwrap();
        let hub = Hub::join(&session).unwrap();
        let mut rank = 0;
        voidage_wire::contract::all(|| {
            rank += 1;
            let served = hub.serve(Role::Dem, rank).unwrap();
            (hub.connect(Role::Dem, rank).unwrap(), served)
        });
        drop(hub);
        crate::janitor::clean(&session).unwrap();
        let prefix = crate::janitor::prefix(&session.token);
        let left = std::fs::read_dir(crate::janitor::SHARED_MEMORY).unwrap().flatten();
        assert_eq!(left.filter(|e| e.file_name().to_string_lossy().starts_with(&prefix)).count(), 0);
        assert!(!session.root.exists());
    }
}
