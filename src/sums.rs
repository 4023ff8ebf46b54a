// SPDX-License-Identifier: MIT OR Apache-2.0
//! Compensated sums (Neumaier): checks of conservation must not measure their own rounding.

/// N running sums: blocks of 32 plainly, the blocks with their rounding error.
#[derive(Clone, Copy, Debug)]
pub struct Sums<const N: usize> {
    block: [f64; N],
    count: u32,
    sum: [f64; N],
    lost: [f64; N],
}

impl<const N: usize> Default for Sums<N> {
    fn default() -> Self {
        Self { block: [0.0; N], count: 0, sum: [0.0; N], lost: [0.0; N] }
    }
}

impl<const N: usize> Sums<N> {
    /// Adds one number to each.
    #[inline]
    pub fn add(&mut self, x: [f64; N]) {
        (0..N).for_each(|a| self.block[a] += x[a]);
        self.count += 1;
        if self.count == 32 {
            self.close();
        }
    }
    fn close(&mut self) {
        let block = std::mem::replace(&mut self.block, [0.0; N]);
        self.plus(block);
        self.count = 0;
    }
    fn plus(&mut self, x: [f64; N]) {
        for a in 0..N {
            let (sum, x) = (self.sum[a], x[a]);
            let t = sum + x;
            self.lost[a] += if sum.abs() >= x.abs() { (sum - t) + x } else { (x - t) + sum };
            self.sum[a] = t;
        }
    }
    /// The sums.
    pub fn value(mut self) -> [f64; N] {
        self.close();
        std::array::from_fn(|a| self.sum[a] + self.lost[a])
    }
    /// Sums of parts, in their order.
    pub fn total(parts: impl IntoIterator<Item = Self>) -> [f64; N] {
        let mut all = Self::default();
        for mut part in parts {
            part.close();
            all.plus(part.sum);
            (0..N).for_each(|a| all.lost[a] += part.lost[a]);
        }
        all.value()
    }
}

/// Sum of an iterator.
pub fn sum(values: impl IntoIterator<Item = f64>) -> f64 {
    let mut s = Sums::default();
    values.into_iter().for_each(|x| s.add([x]));
    s.value()[0]
}

/// Sum of vectors.
pub fn sum3(values: impl IntoIterator<Item = [f64; 3]>) -> [f64; 3] {
    let mut s = Sums::default();
    values.into_iter().for_each(|v| s.add(v));
    s.value()
}

/// Is every number finite?
pub fn finite(values: &[f64]) -> bool {
    // NaN or infinity times zero is NaN; eight chains at once
    let (lanes, rest) = values.as_chunks::<8>();
    let mut sum = [0.0; 8];
    lanes.iter().for_each(|l| (0..8).for_each(|a| sum[a] += l[a] * 0.0));
    sum.iter().sum::<f64>() + rest.iter().map(|x| x * 0.0).sum::<f64>() == 0.0
}

/// Length of a vector.
pub fn norm(v: [f64; 3]) -> f64 {
    (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt()
}

#[cfg(test)]
mod tests {
    #[test]
    fn a_number_that_is_none_is_found_anywhere() {
        for n in [1, 8, 21] {
            assert!(super::finite(&vec![-3.0; n]));
            for (i, bad) in (0..n).flat_map(|i| [f64::NAN, f64::NEG_INFINITY].map(|b| (i, b))) {
                let mut v = vec![1e300; n];
                v[i] = bad;
                assert!(!super::finite(&v), "{i} of {n}");
            }
        }
    }

    #[test]
    fn a_million_tenths_lose_nothing() {
        let exact = 100_000.0;
        assert!((super::sum((0..1_000_000).map(|_| 0.1)) - exact).abs() < 1e-9);
        assert_eq!(super::sum((0..64).map(|i| if i < 32 { 1e16 } else { -1e16 })), 0.0);
        let part = |x: f64| {
            let mut s = super::Sums::default();
            s.add([x, 1.0]);
            s
        };
        assert_eq!(super::Sums::total([1.0, 1e100, 1.0, -1e100].map(part)), [2.0, 4.0]);
    }
}
