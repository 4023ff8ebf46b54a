// SPDX-License-Identifier: MIT OR Apache-2.0
//! exp in plain arithmetic, the same bits on every machine: a loop over it becomes vectors of the machine at hand. To 2 units in
//! the last place; below −700 it stays at exp(−700), above 700 at exp(700).

/// 1.5 × 2⁵²: added, the integer part is left in the lowest bits.
const ROUND: f64 = 6_755_399_441_055_744.0;
/// ln 2, and the rest of it; the first has its lower bits zero, so that k × it is exact.
const LN2: [f64; 2] = [6.931_471_803_691_238e-1, 1.908_214_929_270_587_7e-10];
/// 1 / n!, n from 2 on
const TERMS: [f64; 12] = [
    1.0 / 2.0,
    1.0 / 6.0,
    1.0 / 24.0,
    1.0 / 120.0,
    1.0 / 720.0,
    1.0 / 5040.0,
    1.0 / 40_320.0,
    1.0 / 362_880.0,
    1.0 / 3_628_800.0,
    1.0 / 39_916_800.0,
    1.0 / 479_001_600.0,
    1.0 / 6_227_020_800.0,
];

/// exp(x): 2^k exp(r), |r| ≤ ln 2 / 2, by 13 terms of the series.
#[inline(always)]
pub(super) fn exp(x: f64) -> f64 {
    let x = if x > -700.0 { x } else { -700.0 };
    let x = if x < 700.0 { x } else { 700.0 };
    let shifted = x * std::f64::consts::LOG2_E + ROUND;
    let k = shifted - ROUND;
    let r = (x - k * LN2[0]) - k * LN2[1];
    let mut p = TERMS[11];
    for n in (0..11).rev() {
        p = p * r + TERMS[n];
    }
    let e = 1.0 + (r + (r * r) * p);
    f64::from_bits(e.to_bits().wrapping_add(shifted.to_bits() << 52))
}

#[cfg(test)]
mod tests {
    use super::exp;

    #[test]
    fn exp_is_exact_to_rounding() {
        let mut worst = 0.0f64;
        for i in -200_000..200_000 {
            let x = 0.003_499_7 * f64::from(i);
            worst = worst.max((exp(x) / x.exp() - 1.0).abs());
        }
        println!("off by {worst:.1e}");
        assert!(worst < 5e-16, "{worst}");
        assert_eq!(exp(0.0), 1.0);
        assert!(exp(-1e300) > 0.0 && exp(1e300).is_finite());
    }
}
