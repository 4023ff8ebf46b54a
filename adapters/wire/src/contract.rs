// SPDX-License-Identifier: MIT OR Apache-2.0
//! What every `Transport` must do, as generic tests that each implementation runs on pairs of ends.

use crate::transport::{Transport, TransportError, send_copy, wait};
use std::time::{Duration, Instant};

const SOON: Duration = Duration::from_millis(300);
const LATER: Duration = Duration::from_secs(10);

/// Runs the whole suite; `pair` gives two connected ends of a fresh channel.
pub fn all<A: Transport, B: Transport>(mut pair: impl FnMut() -> (A, B)) {
    carries_both_ways_in_order(pair());
    loans_are_zeroed_and_grow(pair());
    waits_end_in_time_and_name_the_peer(pair());
    a_full_queue_does_not_block(pair());
    a_peer_that_left_is_noticed(pair());
    last_words_are_heard(pair());
}

fn carries_both_ways_in_order<A: Transport, B: Transport>((mut a, mut b): (A, B)) {
    for i in 0..20u64 {
        send_copy(&mut a, &[i, 1]).unwrap();
        send_copy(&mut a, &[i, 2]).unwrap();
        assert_eq!(&*b.receive(LATER).unwrap().unwrap(), [i, 1]);
        assert_eq!(&*b.receive(LATER).unwrap().unwrap(), [i, 2]);
        send_copy(&mut b, &[i, 3, i]).unwrap();
        assert_eq!(&*a.receive(LATER).unwrap().unwrap(), [i, 3, i]);
    }
}

fn loans_are_zeroed_and_grow<A: Transport, B: Transport>((mut a, mut b): (A, B)) {
    for words in [1usize, 1000, 10, 300_000, 5] {
        let mut loan = a.loan(words).unwrap();
        assert_eq!(loan.len(), words);
        assert!(loan.iter().all(|w| *w == 0), "loan of {words} words is not zeroed");
        loan.fill(7);
        a.send(loan).unwrap();
        let sample = b.receive(LATER).unwrap().unwrap();
        assert!(sample.len() == words && sample.iter().all(|w| *w == 7));
    }
}

fn waits_end_in_time_and_name_the_peer<A: Transport, B: Transport>((mut a, _b): (A, B)) {
    let start = Instant::now();
    assert!(a.receive(SOON).unwrap().is_none());
    assert!(start.elapsed() < Duration::from_secs(5));
    let Err(e) = wait(&mut a, SOON, || Ok(())) else { panic!("a message from nowhere") };
    assert!(matches!(e, TransportError::Silent { .. }) && e.to_string().contains(a.peer()), "{e}");
}

fn a_full_queue_does_not_block<A: Transport, B: Transport>((mut a, _b): (A, B)) {
    let start = Instant::now();
    let sent = (0..10).take_while(|i| send_copy(&mut a, &[*i]).is_ok()).count();
    assert!((2..10).contains(&sent), "{sent} messages fit");
    assert!(start.elapsed() < Duration::from_secs(5));
}

fn a_peer_that_left_is_noticed<A: Transport, B: Transport>((mut a, b): (A, B)) {
    drop(b);
    let start = Instant::now();
    let gone = || Err(TransportError::Died { peer: "b".into(), pid: 1 });
    assert!(wait(&mut a, LATER, gone).is_err());
    assert!(start.elapsed() < Duration::from_secs(5));
    assert!(send_copy(&mut a, &[1]).is_err(), "sent to nobody");
}

fn last_words_are_heard<A: Transport, B: Transport>((mut a, mut b): (A, B)) {
    send_copy(&mut b, &[42]).unwrap();
    let gone = || Err(TransportError::Died { peer: "b".into(), pid: 1 });
    assert_eq!(&*wait(&mut a, LATER, gone).unwrap(), [42]);
}
