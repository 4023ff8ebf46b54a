// SPDX-License-Identifier: MIT OR Apache-2.0
//! The numbers of the sweeps, f64 or f32, as vectors of the machine at hand (pulp): eight lanes of a cell are one
//! vector of AVX-512, two of AVX2. Every operation rounds by itself: the bits are the same on every machine.

use pulp::{Simd, WithSimd};

/// A number of the sweeps, and its vectors (at most eight lanes each) on the machine at hand.
#[allow(missing_docs)]
pub trait Real: Copy + Send + Sync {
    const ZERO: Self;
    /// rounded
    fn from_f64(x: f64) -> Self;
    /// exact
    fn to_f64(self) -> f64;
    type Of<S: Simd>: Copy;
    fn dispatch<W: WithSimd>(work: W) -> W::Output;
    fn vectors<S: Simd>(x: &[Self; 8]) -> &[Self::Of<S>];
    fn vectors_mut<S: Simd>(x: &mut [Self; 8]) -> &mut [Self::Of<S>];
    fn splat<S: Simd>(s: S, x: Self) -> Self::Of<S>;
    fn add<S: Simd>(s: S, a: Self::Of<S>, b: Self::Of<S>) -> Self::Of<S>;
    fn sub<S: Simd>(s: S, a: Self::Of<S>, b: Self::Of<S>) -> Self::Of<S>;
    fn mul<S: Simd>(s: S, a: Self::Of<S>, b: Self::Of<S>) -> Self::Of<S>;
}
impl Real for f64 {
    const ZERO: Self = 0.0;
    fn from_f64(x: f64) -> Self {
        x
    }
    fn to_f64(self) -> f64 {
        self
    }
    type Of<S: Simd> = S::f64s;
    fn dispatch<W: WithSimd>(work: W) -> W::Output {
        pulp::Arch::new().dispatch(work)
    }
    #[inline(always)]
    fn vectors<S: Simd>(x: &[Self; 8]) -> &[S::f64s] {
        S::as_simd_f64s(x).0
    }
    #[inline(always)]
    fn vectors_mut<S: Simd>(x: &mut [Self; 8]) -> &mut [S::f64s] {
        S::as_mut_simd_f64s(x).0
    }
    #[inline(always)]
    fn splat<S: Simd>(s: S, x: Self) -> S::f64s {
        s.splat_f64s(x)
    }
    #[inline(always)]
    fn add<S: Simd>(s: S, a: S::f64s, b: S::f64s) -> S::f64s {
        s.add_f64s(a, b)
    }
    #[inline(always)]
    fn sub<S: Simd>(s: S, a: S::f64s, b: S::f64s) -> S::f64s {
        s.sub_f64s(a, b)
    }
    #[inline(always)]
    fn mul<S: Simd>(s: S, a: S::f64s, b: S::f64s) -> S::f64s {
        s.mul_f64s(a, b)
    }
}
impl Real for f32 {
    const ZERO: Self = 0.0;
    fn from_f64(x: f64) -> Self {
        x as f32
    }
    fn to_f64(self) -> f64 {
        f64::from(self)
    }
    type Of<S: Simd> = S::f32s;
    /// Not by the widest vectors: a cell has eight lanes, AVX-512 would want sixteen.
    fn dispatch<W: WithSimd>(work: W) -> W::Output {
        #[cfg(target_arch = "x86_64")]
        if let Some(v) = pulp::x86::V3::try_new() {
            return Simd::vectorize(v, work);
        }
        Simd::vectorize(pulp::Scalar::new(), work)
    }
    #[inline(always)]
    fn vectors<S: Simd>(x: &[Self; 8]) -> &[S::f32s] {
        S::as_simd_f32s(x).0
    }
    #[inline(always)]
    fn vectors_mut<S: Simd>(x: &mut [Self; 8]) -> &mut [S::f32s] {
        S::as_mut_simd_f32s(x).0
    }
    #[inline(always)]
    fn splat<S: Simd>(s: S, x: Self) -> S::f32s {
        s.splat_f32s(x)
    }
    #[inline(always)]
    fn add<S: Simd>(s: S, a: S::f32s, b: S::f32s) -> S::f32s {
        s.add_f32s(a, b)
    }
    #[inline(always)]
    fn sub<S: Simd>(s: S, a: S::f32s, b: S::f32s) -> S::f32s {
        s.sub_f32s(a, b)
    }
    #[inline(always)]
    fn mul<S: Simd>(s: S, a: S::f32s, b: S::f32s) -> S::f32s {
        s.mul_f32s(a, b)
    }
}
