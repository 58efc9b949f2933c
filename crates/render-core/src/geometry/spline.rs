//! The uniform cubic B-spline on one cell: weights, their derivatives, their polar form and their Bernstein form.
//!
//! A cell is the stretch between two neighbouring grid values, and `f` in `[0, 1]` runs through it. The four values
//! ("taps") at -1, 0, 1 and 2 relative to its start control it. The curve is a convex combination of the taps and is C2
//! across cells. (Farin, *Curves and Surfaces for CAGD*, chapters 4 to 8, has every formula of this page.)

use std::ops::{Add, Mul, Sub};

use wide::f64x2;

use crate::math::simd::{Instructions, Lanes};

/// Several numbers side by side.
pub(crate) trait Numbers: Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> {
    /// As many times `value`.
    fn all(self, value: f64) -> Self;
}

impl Numbers for f64x2 {
    #[inline(always)]
    fn all(self, value: f64) -> Self {
        Self::splat(value)
    }
}

impl<S: Instructions> Numbers for Lanes<S> {
    #[inline(always)]
    fn all(self, value: f64) -> Self {
        Self::splat(self.simd(), value)
    }
}

/// Weights of the four taps for the value at `f`, lane by lane.
#[inline(always)]
pub(crate) fn weights<T: Numbers>(f: T) -> [T; 4] {
    let (sixth, one, three, four) = (f.all(1.0 / 6.0), f.all(1.0), f.all(3.0), f.all(4.0));
    let r = one - f;
    let (ff, rr) = (f * f, r * r);
    [rr * r * sixth, (four - three * ff * (one + r)) * sixth, (four - three * rr * (one + f)) * sixth, ff * f * sixth]
}

/// Weights of the four taps for the first derivative by `f`.
#[inline(always)]
pub(crate) fn slope_weights<T: Numbers>(f: T) -> [T; 4] {
    let (half, one, three, four) = (f.all(0.5), f.all(1.0), f.all(3.0), f.all(4.0));
    let r = one - f;
    [f.all(-0.5) * r * r, half * f * (three * f - four), half * r * (one + three * f), half * f * f]
}

/// Weights of the four taps for the second derivative by `f`.
#[inline(always)]
pub(crate) fn curvature_weights<T: Numbers>(f: T) -> [T; 4] {
    let (one, two, three) = (f.all(1.0), f.all(2.0), f.all(3.0));
    [one - f, three * f - two, one - three * f, f]
}

/// Weights of the four taps for the third derivative by `f`, which is constant on a cell.
pub(crate) const THIRD_DERIVATIVE_WEIGHTS: [f64; 4] = [-1.0, 3.0, -3.0, 1.0];

/// Weights of the four taps for the polar form (blossom) of the curve at `(r, s, t)`: symmetric, affine in each
/// argument, and equal to [`weights`] on the diagonal. The Bernstein coefficients of the curve over `[a, b]` are the
/// polar values at `aaa`, `aab`, `abb` and `bbb`.
#[inline]
fn polar_weights(r: f64, s: f64, t: f64) -> [f64; 4] {
    let product = r * s * t;
    let pairs = r * s + s * t + t * r;
    let sum = r + s + t;
    [
        (1.0 - r) * (1.0 - s) * (1.0 - t) / 6.0,
        (3.0 * product - 2.0 * pairs + 4.0) / 6.0,
        (1.0 + sum + pairs - 3.0 * product) / 6.0,
        product / 6.0,
    ]
}

/// Weights of the four taps for the polar form of the first derivative by `f` at `(r, s)`.
#[inline]
fn polar_slope_weights(r: f64, s: f64) -> [f64; 4] {
    let (product, mean) = (r * s, 0.5 * (r + s));
    [
        -0.5 * (1.0 - r) * (1.0 - s),
        0.5 * (3.0 * product - 4.0 * mean),
        0.5 * (1.0 + 2.0 * mean - 3.0 * product),
        0.5 * product,
    ]
}

/// For each of the four Bernstein coefficients of the curve over `[from, to]`, the weights of the taps.
#[inline]
pub(crate) fn bernstein_weights(from: f64, to: f64) -> [[f64; 4]; 4] {
    [
        polar_weights(from, from, from),
        polar_weights(from, from, to),
        polar_weights(from, to, to),
        polar_weights(to, to, to),
    ]
}

/// For each of the three Bernstein coefficients of the curve's first derivative over `[from, to]`, the weights of the
/// taps.
#[inline]
pub(crate) fn bernstein_slope_weights(from: f64, to: f64) -> [[f64; 4]; 3] {
    [polar_slope_weights(from, from), polar_slope_weights(from, to), polar_slope_weights(to, to)]
}

/// For each of the two Bernstein coefficients of the curve's second derivative over `[from, to]`, the weights of the
/// taps.
#[inline]
pub(crate) fn bernstein_curvature_weights(from: f64, to: f64) -> [[f64; 4]; 2] {
    let weights = curvature_weights(f64x2::new([from, to])).map(f64x2::to_array);
    [0, 1].map(|end| weights.map(|weight| weight[end]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::testing::fixed_seed;
    use proptest::prelude::*;

    fn first(weights: [f64x2; 4]) -> [f64; 4] {
        weights.map(|weight| weight.to_array()[0])
    }

    fn weights(f: f64) -> [f64; 4] {
        first(super::weights(f64x2::new([f, 0.3])))
    }

    fn slope_weights(f: f64) -> [f64; 4] {
        first(super::slope_weights(f64x2::new([f, 0.3])))
    }

    fn curvature_weights(f: f64) -> [f64; 4] {
        first(super::curvature_weights(f64x2::new([f, 0.3])))
    }

    fn close(a: f64, b: f64) -> bool {
        (a - b).abs() < 1e-14
    }

    fn combine(weights: [f64; 4], taps: [f64; 4]) -> f64 {
        weights.iter().zip(taps).map(|(w, c)| w * c).sum()
    }

    proptest! {
        #![proptest_config(fixed_seed(256))]

        #[test]
        fn weights_are_those_of_the_uniform_cubic_b_spline(f in 0.0..=1.0f64) {
            let expected = [
                (1.0 - f) * (1.0 - f) * (1.0 - f) / 6.0,
                (3.0 * f * f * f - 6.0 * f * f + 4.0) / 6.0,
                (-3.0 * f * f * f + 3.0 * f * f + 3.0 * f + 1.0) / 6.0,
                f * f * f / 6.0,
            ];
            for (got, want) in weights(f).into_iter().zip(expected) {
                prop_assert!(got >= 0.0 && close(got, want));
            }
        }

        #[test]
        fn weights_sum_to_one_and_reproduce_lines(f in 0.0..=1.0f64) {
            prop_assert!(close(combine(weights(f), [1.0; 4]), 1.0));
            prop_assert!(close(combine(weights(f), [-1.0, 0.0, 1.0, 2.0]), f));
            prop_assert!(close(combine(slope_weights(f), [1.0; 4]), 0.0));
            prop_assert!(close(combine(slope_weights(f), [-1.0, 0.0, 1.0, 2.0]), 1.0));
            prop_assert!(close(combine(curvature_weights(f), [1.0; 4]), 0.0));
            prop_assert!(close(combine(curvature_weights(f), [-1.0, 0.0, 1.0, 2.0]), 0.0));
            // The second derivative of the spline with coefficients i^2 is 2 everywhere.
            prop_assert!(close(combine(curvature_weights(f), [1.0, 0.0, 1.0, 4.0]), 2.0));
        }

        #[test]
        fn polar_forms_agree_with_the_curve_on_the_diagonal(f in 0.0..=1.0f64) {
            for i in 0..4 {
                prop_assert!(close(polar_weights(f, f, f)[i], weights(f)[i]));
                prop_assert!(close(polar_slope_weights(f, f)[i], slope_weights(f)[i]));
            }
        }

        #[test]
        fn bernstein_form_is_the_curve(
            taps in prop::array::uniform4(-1.0..1.0f64), from in 0.0..0.5f64, to in 0.5..1.0f64, s in 0.0..=1.0f64,
        ) {
            let f = from + (to - from) * s;
            let r = 1.0 - s;
            let b = bernstein_weights(from, to).map(|w| combine(w, taps));
            let cubic = b[0] * r * r * r + 3.0 * b[1] * r * r * s + 3.0 * b[2] * r * s * s + b[3] * s * s * s;
            prop_assert!(close(cubic, combine(weights(f), taps)));
            let d = bernstein_slope_weights(from, to).map(|w| combine(w, taps));
            let quadratic = d[0] * r * r + 2.0 * d[1] * r * s + d[2] * s * s;
            prop_assert!(close(quadratic, combine(slope_weights(f), taps)));
        }
    }
}
