// SPDX-License-Identifier: MIT OR Apache-2.0
//! Compensated sums (Neumaier): checks of conservation must not measure their own rounding.

/// A running sum: blocks of 32 plainly, the blocks with their rounding error.
#[derive(Clone, Copy, Debug, Default)]
pub struct Sum {
    block: f64,
    count: u32,
    sum: f64,
    lost: f64,
}

impl Sum {
    /// Adds a number.
    #[inline]
    pub fn add(&mut self, x: f64) {
        self.block += x;
        self.count += 1;
        if self.count == 32 {
            self.close();
        }
    }
    fn close(&mut self) {
        let (x, t) = (self.block, self.sum + self.block);
        self.lost += if self.sum.abs() >= x.abs() { (self.sum - t) + x } else { (x - t) + self.sum };
        (self.sum, self.block, self.count) = (t, 0.0, 0);
    }
    /// The sum.
    pub fn value(mut self) -> f64 {
        self.close();
        self.sum + self.lost
    }
}

/// Sum of an iterator.
pub fn sum(values: impl IntoIterator<Item = f64>) -> f64 {
    let mut s = Sum::default();
    values.into_iter().for_each(|x| s.add(x));
    s.value()
}

/// Sum of vectors.
pub fn sum3(values: impl IntoIterator<Item = [f64; 3]>) -> [f64; 3] {
    let mut s = [Sum::default(); 3];
    for v in values {
        (0..3).for_each(|a| s[a].add(v[a]));
    }
    s.map(|x| x.value())
}

/// Length of a vector.
pub fn norm(v: [f64; 3]) -> f64 {
    (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt()
}

#[cfg(test)]
mod tests {
    #[test]
    fn a_million_tenths_lose_nothing() {
        let exact = 100_000.0;
        assert!((super::sum((0..1_000_000).map(|_| 0.1)) - exact).abs() < 1e-9);
        assert_eq!(super::sum((0..64).map(|i| if i < 32 { 1e16 } else { -1e16 })), 0.0);
    }
}
