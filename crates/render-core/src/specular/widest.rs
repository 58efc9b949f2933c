//! Computations that are compiled more than once, for what processors can do, and run as the one at hand can.
//!
//! Wider instructions compute the same bits: sums keep their order, and products and sums are rounded each for itself.

use pulp::{Arch, Simd, WithSimd};

/// A computation whose code, with all that it calls, is inlined into each of the versions.
pub(super) trait Computation {
    type Output;

    /// Runs it; always inlined.
    fn run(self) -> Self::Output;
}

struct Compiled<C>(C);

impl<C: Computation> WithSimd for Compiled<C> {
    type Output = C::Output;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> Self::Output {
        self.0.run()
    }
}

/// Runs a computation in the version for this processor.
pub(super) fn run<C: Computation>(computation: C) -> C::Output {
    Arch::new().dispatch(Compiled(computation))
}
