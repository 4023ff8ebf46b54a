// SPDX-License-Identifier: MIT OR Apache-2.0
//! The machine's own memory bandwidth: a_i = b_i + s c_i on three arrays, as STREAM does.

use std::time::Instant;

/// GB/s of the triad on `bytes` in all three arrays together; counted: two reads and one write. Best of `times`.
pub fn bandwidth(bytes: usize, threads: usize, times: usize) -> f64 {
    let n = (bytes / 24 / threads.max(1)).max(1000);
    let mut arrays: Vec<_> =
        (0..threads.max(1)).map(|_| [vec![0.0f64; n], vec![1.0; n], vec![2.0; n]]).collect();
    let mut best = f64::INFINITY;
    for k in 0..=times {
        let s = k as f64;
        let begin = Instant::now();
        std::thread::scope(|scope| {
            let mut rest = arrays.iter_mut();
            let first = rest.next();
            rest.for_each(|[a, b, c]| drop(scope.spawn(move || sweep(a, b, c, s))));
            if let Some([a, b, c]) = first {
                sweep(a, b, c, s);
            }
        });
        if k > 0 {
            best = best.min(begin.elapsed().as_secs_f64());
        }
    }
    let sum: f64 = arrays.iter().map(|a| a[0][n / 2]).sum();
    assert!(sum > 0.0, "the compiler must not drop the loop");
    (24 * n * threads.max(1)) as f64 / best / 1e9
}

fn sweep(a: &mut [f64], b: &[f64], c: &[f64], s: f64) {
    for ((a, b), c) in a.iter_mut().zip(b).zip(c) {
        *a = b + s * c;
    }
}
