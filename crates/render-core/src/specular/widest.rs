//! Computations that are compiled more than once, for what processors can do, and run as the one at hand can.
//!
//! Wider instructions compute the same bits: sums keep their order, and products and sums are rounded each for itself,
//! or together in all versions.

use pulp::{Scalar256b, Simd, WithSimd};

use crate::math::simd::Instructions;

/// A computation whose code, with all that it calls, is inlined into each of the versions.
pub(super) trait Computation {
    type Output;

    /// Runs it with the given instructions; always inlined.
    fn run<S: Instructions>(self, simd: S) -> Self::Output;
}

/// A computation with the instructions to run it with.
struct Compiled<C, S>(C, S);

impl<C: Computation, S: Instructions> WithSimd for Compiled<C, S> {
    type Output = C::Output;

    /// The token is the one that the computation has already, of a type that says how many lanes there are.
    #[inline(always)]
    fn with_simd<T: Simd>(self, _: T) -> Self::Output {
        self.0.run(self.1)
    }
}

/// Runs a computation in the version for this processor.
pub(super) fn run<C: Computation>(computation: C) -> C::Output {
    #[cfg(target_arch = "x86_64")]
    if let Some(avx2) = pulp::x86::V3::try_new() {
        return Simd::vectorize(avx2, Compiled(computation, avx2));
    }
    Simd::vectorize(Scalar256b, Compiled(computation, Scalar256b))
}
