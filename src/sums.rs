// SPDX-License-Identifier: MIT OR Apache-2.0
//! Compensated sums (Neumaier): checks of conservation must not measure their own rounding.

/// A running sum with its rounding error.
#[derive(Clone, Copy, Debug, Default)]
pub struct Sum {
    sum: f64,
    lost: f64,
}

impl Sum {
    /// Adds a number.
    pub fn add(&mut self, x: f64) {
        let t = self.sum + x;
        self.lost += if self.sum.abs() >= x.abs() { (self.sum - t) + x } else { (x - t) + self.sum };
        self.sum = t;
    }
    /// The sum.
    pub fn value(&self) -> f64 {
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
    fn cancellation_is_exact() {
        assert_eq!(super::sum([1.0, 1e100, 1.0, -1e100]), 2.0);
    }
}
