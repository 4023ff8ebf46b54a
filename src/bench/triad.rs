// SPDX-License-Identifier: MIT OR Apache-2.0
//! The machine's own memory bandwidth: a_i = b_i + s c_i on three arrays, as STREAM does.

use crate::threads;

/// CPU time of the calling thread so far, s.
pub fn cpu_seconds() -> f64 {
    threads::cpu_seconds(None)
}

/// GB/s of the triad on `bytes` in all three arrays together; counted: two reads and one write. CPU time of the slowest
/// thread, median of `times`.
pub fn bandwidth(bytes: usize, threads: usize, times: usize) -> f64 {
    let n = (bytes / 24 / threads.max(1)).max(1000);
    let one = || {
        let [mut a, b, c] = [vec![0.0f64; n], vec![1.0; n], vec![2.0; n]];
        let run = |k: usize| {
            let begin = cpu_seconds();
            sweep(&mut a, &b, &c, k as f64);
            cpu_seconds() - begin
        };
        let all: Vec<f64> = (0..=times).map(run).skip(1).collect();
        assert!(a[n / 2] > 0.0, "the compiler must not drop the loop");
        super::smoother::median(all)
    };
    let slowest = std::thread::scope(|scope| {
        let others: Vec<_> = (1..threads).map(|_| scope.spawn(one)).collect();
        let mine = one();
        others.into_iter().map(|t| t.join().unwrap_or(f64::NAN)).fold(mine, f64::max)
    });
    (24 * n * threads.max(1)) as f64 / slowest / 1e9
}

fn sweep(a: &mut [f64], b: &[f64], c: &[f64], s: f64) {
    for ((a, b), c) in a.iter_mut().zip(b).zip(c) {
        *a = b + s * c;
    }
}
