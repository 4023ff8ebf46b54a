// SPDX-License-Identifier: MIT OR Apache-2.0
//! Loops over particles and rows, split over the threads of the pool they are called in; outside of a pool they run
//! on the calling thread. The pieces do not depend on the number of threads, and what they return is combined in
//! their order: threads do not change a bit.

use rayon::prelude::*;
use rustix::time::{ClockId, clock_gettime};
use std::ops::Range;

/// Rows per piece of a loop over cells.
const ROWS: usize = 4096;

/// Threads of the pool this is called in; 1 outside of a pool.
pub fn count() -> usize {
    if rayon::current_thread_index().is_some() { rayon::current_num_threads() } else { 1 }
}

/// Cores this process may use.
pub fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}

/// That many threads; none if one is enough.
pub fn pool(count: usize) -> Result<Option<rayon::ThreadPool>, String> {
    let pool = || rayon::ThreadPoolBuilder::new().num_threads(count).build();
    (count > 1).then(pool).transpose().map_err(|e| format!("{count} threads: {e}"))
}

/// Runs `work` on the threads of the pool, or on the calling thread.
pub fn within<R: Send>(pool: Option<&rayon::ThreadPool>, work: impl FnOnce() -> R + Send) -> R {
    match pool {
        Some(pool) => pool.install(work),
        None => work(),
    }
}

/// CPU time so far of the calling thread and of the threads of a pool, s.
pub fn cpu_seconds(pool: Option<&rayon::ThreadPool>) -> f64 {
    let own = || {
        let t = clock_gettime(ClockId::ThreadCPUTime);
        t.tv_sec as f64 + 1e-9 * t.tv_nsec as f64
    };
    own() + pool.map_or(0.0, |p| p.broadcast(|_| own()).iter().sum())
}

/// `f` of every part; the results in the order of the parts.
pub fn map<T: Send, R: Send>(parts: Vec<T>, f: impl Fn(T) -> R + Sync) -> Vec<R> {
    if count() == 1 || parts.len() < 2 {
        return parts.into_iter().map(f).collect();
    }
    parts.into_par_iter().map(&f).collect()
}

/// Both, at the same time if there are threads.
pub fn both(a: impl FnOnce() + Send, b: impl FnOnce() + Send) {
    if count() == 1 {
        a();
        return b();
    }
    rayon::join(a, b);
}

/// 0..count in pieces of `size`.
pub fn pieces(count: usize, size: usize) -> Vec<Range<usize>> {
    (0..count).step_by(size).map(|i| i..count.min(i + size)).collect()
}

/// `slice` cut at `ends` (ascending); an empty one into empty parts.
pub fn cut<T>(mut slice: &mut [T], ends: impl IntoIterator<Item = usize>) -> Vec<&mut [T]> {
    let (mut at, none) = (0, slice.is_empty());
    let part = |end: usize| {
        let (part, rest) = std::mem::take(&mut slice).split_at_mut(if none { 0 } else { end - at });
        (slice, at) = (rest, end);
        part
    };
    ends.into_iter().map(part).collect()
}

/// Ascending rows in pieces: entries of `rows`, and the range of slots that holds them; the ranges cover 0..cells.
pub fn rows(rows: &[u32], cells: usize) -> Vec<(&[u32], Range<usize>)> {
    let mut begin = 0;
    let last = rows.len().div_ceil(ROWS).max(1) - 1;
    let piece = |(k, part): (usize, &'_ [u32])| {
        let end = if k == last { cells } else { part[part.len() - 1] as usize + 1 };
        let slots = begin..end;
        begin = end;
        slots
    };
    let ranges: Vec<_> = rows.chunks(ROWS).enumerate().map(piece).collect();
    rows.chunks(ROWS).zip(ranges).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pieces_cover_everything_once_on_any_number_of_threads() {
        let list: Vec<u32> = (0..20_000).filter(|i| i % 3 != 0).collect();
        let sum = || {
            let mut field = vec![0u32; 20_000];
            let pieces = rows(&list, field.len());
            let parts = cut(&mut field, pieces.iter().map(|p| p.1.end));
            let work = pieces.into_iter().zip(parts).collect();
            let counts = map(work, |((rows, slots), part)| {
                rows.iter().for_each(|j| part[*j as usize - slots.start] += j);
                rows.len()
            });
            (field, counts)
        };
        let one = sum();
        assert!(one.0.iter().enumerate().all(|(i, x)| *x == if i % 3 == 0 { 0 } else { i as u32 }));
        for threads in [2, 4] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            assert_eq!(pool.install(sum), one);
        }
        assert_eq!(rows(&[], 5).len(), 0);
    }
}
