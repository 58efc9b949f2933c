//! Four numbers side by side, or eight in single precision ([`singles`]), computed with one instruction where the
//! processor can.
//!
//! A value carries the token of the instructions that it is computed with (`pulp`): AVX2, or plain code for other
//! processors. Both compute the same bits. Nothing is fused but where it says so ([`singles::Singles::times_plus`]),
//! and the smaller or larger of two numbers is chosen by comparing them.

pub(crate) mod singles;

use std::ops::{Add, Mul, Neg, Sub};

use glam::DVec2;
use pulp::{Scalar256b, Simd, f32x8, f64x4, m32x8, m64, m64x4};

use crate::math::Rect;

/// How many numbers there are.
pub(crate) const LANES: usize = 4;

/// Instructions for four numbers, or eight in single precision.
pub(crate) trait Instructions: Simd<f64s = f64x4, m64s = m64x4, f32s = f32x8, m32s = m32x8> {
    /// `a` where it is less than `b`, else `b`.
    fn lesser(self, a: f64x4, b: f64x4) -> f64x4;

    /// `a` where it is greater than `b`, else `b`.
    fn greater(self, a: f64x4, b: f64x4) -> f64x4;

    /// A bit for each lane, that of the first one lowest.
    fn bits(self, mask: m64x4) -> u32;

    /// As [`Self::bits`], for eight lanes.
    fn bits_of_singles(self, mask: m32x8) -> u32;
}

#[cfg(target_arch = "x86_64")]
impl Instructions for pulp::x86::V3 {
    #[inline(always)]
    fn lesser(self, a: f64x4, b: f64x4) -> f64x4 {
        self.min_f64s(a, b)
    }

    #[inline(always)]
    fn greater(self, a: f64x4, b: f64x4) -> f64x4 {
        self.max_f64s(a, b)
    }

    #[inline(always)]
    fn bits(self, mask: m64x4) -> u32 {
        self.avx._mm256_movemask_pd(pulp::cast(mask)) as u32
    }

    #[inline(always)]
    fn bits_of_singles(self, mask: m32x8) -> u32 {
        self.avx._mm256_movemask_ps(pulp::cast(mask)) as u32
    }
}

impl Instructions for Scalar256b {
    #[inline(always)]
    fn lesser(self, a: f64x4, b: f64x4) -> f64x4 {
        let lesser = |a: f64, b: f64| if a < b { a } else { b };
        f64x4(lesser(a.0, b.0), lesser(a.1, b.1), lesser(a.2, b.2), lesser(a.3, b.3))
    }

    #[inline(always)]
    fn greater(self, a: f64x4, b: f64x4) -> f64x4 {
        let greater = |a: f64, b: f64| if a > b { a } else { b };
        f64x4(greater(a.0, b.0), greater(a.1, b.1), greater(a.2, b.2), greater(a.3, b.3))
    }

    #[inline(always)]
    fn bits(self, m64x4(a, b, c, d): m64x4) -> u32 {
        [a, b, c, d].iter().rev().fold(0, |bits, lane| bits << 1 | u32::from(lane.is_set()))
    }

    #[inline(always)]
    fn bits_of_singles(self, m32x8(a, b, c, d, e, f, g, h): m32x8) -> u32 {
        [a, b, c, d, e, f, g, h].iter().rev().fold(0, |bits, lane| bits << 1 | u32::from(lane.is_set()))
    }
}

/// Four numbers.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lanes<S> {
    simd: S,
    values: f64x4,
}

/// Whether something holds, lane by lane.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Mask<S> {
    simd: S,
    values: m64x4,
}

/// Four vectors of the plane.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lanes2<S> {
    pub(crate) x: Lanes<S>,
    pub(crate) y: Lanes<S>,
}

/// Four vectors of space.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lanes3<S> {
    pub(crate) x: Lanes<S>,
    pub(crate) y: Lanes<S>,
    pub(crate) z: Lanes<S>,
}

/// Four rectangles.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LaneRects<S> {
    pub(crate) min: Lanes2<S>,
    pub(crate) max: Lanes2<S>,
}

impl<S: Instructions> Lanes<S> {
    #[inline(always)]
    pub(crate) fn new(simd: S, [a, b, c, d]: [f64; LANES]) -> Self {
        Self { simd, values: f64x4(a, b, c, d) }
    }

    #[inline(always)]
    pub(crate) fn splat(simd: S, value: f64) -> Self {
        Self { simd, values: simd.splat_f64s(value) }
    }

    #[inline(always)]
    pub(crate) fn to_array(self) -> [f64; LANES] {
        let f64x4(a, b, c, d) = self.values;
        [a, b, c, d]
    }

    #[inline(always)]
    pub(crate) fn simd(self) -> S {
        self.simd
    }

    #[inline(always)]
    pub(crate) fn abs(self) -> Self {
        Self { values: self.simd.abs_f64s(self.values), ..self }
    }

    #[inline(always)]
    pub(crate) fn sqrt(self) -> Self {
        Self { values: self.simd.sqrt_f64s(self.values), ..self }
    }

    #[inline(always)]
    pub(crate) fn recip(self) -> Self {
        let one = self.simd.splat_f64s(1.0);
        Self { values: self.simd.div_f64s(one, self.values), ..self }
    }

    #[inline(always)]
    pub(crate) fn less_than(self, other: Self) -> Mask<S> {
        Mask { simd: self.simd, values: self.simd.less_than_f64s(self.values, other.values) }
    }

    /// The smaller one; `other` where either is not a number.
    #[inline(always)]
    pub(crate) fn min(self, other: Self) -> Self {
        Self { values: self.simd.lesser(self.values, other.values), ..self }
    }

    /// The larger one; `other` where either is not a number.
    #[inline(always)]
    pub(crate) fn max(self, other: Self) -> Self {
        Self { values: self.simd.greater(self.values, other.values), ..self }
    }

    /// Whether each is neither infinite nor not a number.
    #[inline(always)]
    pub(crate) fn is_finite(self) -> Mask<S> {
        self.abs().less_than(Self::splat(self.simd, f64::INFINITY))
    }
}

/// An operator between two, and between one and the same number in each lane.
macro_rules! operator {
    ($trait:ident, $name:ident, $function:ident) => {
        impl<S: Instructions> $trait for Lanes<S> {
            type Output = Self;

            #[inline(always)]
            fn $name(self, other: Self) -> Self {
                Self { values: self.simd.$function(self.values, other.values), ..self }
            }
        }

        impl<S: Instructions> $trait<f64> for Lanes<S> {
            type Output = Self;

            #[inline(always)]
            fn $name(self, other: f64) -> Self {
                self.$name(Self::splat(self.simd, other))
            }
        }

        impl<S: Instructions> $trait for Lanes2<S> {
            type Output = Self;

            #[inline(always)]
            fn $name(self, other: Self) -> Self {
                Self { x: self.x.$name(other.x), y: self.y.$name(other.y) }
            }
        }

        impl<S: Instructions> $trait<DVec2> for Lanes2<S> {
            type Output = Self;

            #[inline(always)]
            fn $name(self, other: DVec2) -> Self {
                Self { x: self.x.$name(other.x), y: self.y.$name(other.y) }
            }
        }
    };
}

operator!(Add, add, add_f64s);
operator!(Sub, sub, sub_f64s);
operator!(Mul, mul, mul_f64s);

impl<S: Instructions> Neg for Lanes<S> {
    type Output = Self;

    #[inline(always)]
    fn neg(self) -> Self {
        Self { values: self.simd.neg_f64s(self.values), ..self }
    }
}

impl<S: Instructions> Mask<S> {
    #[inline(always)]
    pub(crate) fn new(simd: S, [a, b, c, d]: [bool; LANES]) -> Self {
        Self { simd, values: m64x4(m64::new(a), m64::new(b), m64::new(c), m64::new(d)) }
    }

    #[inline(always)]
    pub(crate) fn to_array(self) -> [bool; LANES] {
        let bits = self.simd.bits(self.values);
        [bits & 1 != 0, bits & 2 != 0, bits & 4 != 0, bits & 8 != 0]
    }

    #[inline(always)]
    pub(crate) fn and(self, other: Self) -> Self {
        Self { values: self.simd.and_m64s(self.values, other.values), ..self }
    }

    #[inline(always)]
    pub(crate) fn or(self, other: Self) -> Self {
        Self { values: self.simd.or_m64s(self.values, other.values), ..self }
    }

    #[inline(always)]
    pub(crate) fn not(self) -> Self {
        Self { values: self.simd.not_m64s(self.values), ..self }
    }

    #[inline(always)]
    pub(crate) fn and_not(self, other: Self) -> Self {
        self.and(other.not())
    }

    #[inline(always)]
    pub(crate) fn select(self, holds: Lanes<S>, fails: Lanes<S>) -> Lanes<S> {
        Lanes { simd: self.simd, values: self.simd.select_f64s(self.values, holds.values, fails.values) }
    }

    #[inline(always)]
    pub(crate) fn select2(self, holds: Lanes2<S>, fails: Lanes2<S>) -> Lanes2<S> {
        Lanes2 { x: self.select(holds.x, fails.x), y: self.select(holds.y, fails.y) }
    }

    /// Whether it holds anywhere.
    #[inline(always)]
    pub(crate) fn any(self) -> bool {
        self.simd.bits(self.values) != 0
    }

    /// In how many lanes it holds.
    #[inline(always)]
    pub(crate) fn count(self) -> u64 {
        self.simd.bits(self.values).count_ones().into()
    }
}

impl<S: Instructions> Lanes2<S> {
    #[inline(always)]
    pub(crate) fn new(simd: S, [a, b, c, d]: [DVec2; LANES]) -> Self {
        Self { x: Lanes::new(simd, [a.x, b.x, c.x, d.x]), y: Lanes::new(simd, [a.y, b.y, c.y, d.y]) }
    }

    #[inline(always)]
    pub(crate) fn splat(simd: S, DVec2 { x, y }: DVec2) -> Self {
        Self { x: Lanes::splat(simd, x), y: Lanes::splat(simd, y) }
    }

    #[inline(always)]
    pub(crate) fn to_array(self) -> [DVec2; LANES] {
        let (x, y) = (self.x.to_array(), self.y.to_array());
        [DVec2::new(x[0], y[0]), DVec2::new(x[1], y[1]), DVec2::new(x[2], y[2]), DVec2::new(x[3], y[3])]
    }

    #[inline(always)]
    pub(crate) fn scaled(self, factor: Lanes<S>) -> Self {
        Self { x: self.x * factor, y: self.y * factor }
    }

    #[inline(always)]
    pub(crate) fn dot(self, other: Self) -> Lanes<S> {
        self.x * other.x + self.y * other.y
    }

    #[inline(always)]
    pub(crate) fn abs(self) -> Self {
        Self { x: self.x.abs(), y: self.y.abs() }
    }

    #[inline(always)]
    pub(crate) fn min(self, other: Self) -> Self {
        Self { x: self.x.min(other.x), y: self.y.min(other.y) }
    }

    #[inline(always)]
    pub(crate) fn max(self, other: Self) -> Self {
        Self { x: self.x.max(other.x), y: self.y.max(other.y) }
    }

    #[inline(always)]
    pub(crate) fn max_element(self) -> Lanes<S> {
        self.x.max(self.y)
    }

    #[inline(always)]
    pub(crate) fn is_finite(self) -> Mask<S> {
        self.x.is_finite().and(self.y.is_finite())
    }
}

impl<S: Instructions> Lanes3<S> {
    #[inline(always)]
    pub(crate) fn dot(self, other: Self) -> Lanes<S> {
        self.x * other.x + self.y * other.y + self.z * other.z
    }

    #[inline(always)]
    pub(crate) fn scaled(self, factor: Lanes<S>) -> Self {
        Self { x: self.x * factor, y: self.y * factor, z: self.z * factor }
    }

    #[inline(always)]
    pub(crate) fn plus(self, other: Self) -> Self {
        Self { x: self.x + other.x, y: self.y + other.y, z: self.z + other.z }
    }

    #[inline(always)]
    pub(crate) fn normalised(self) -> Self {
        self.scaled(self.dot(self).sqrt().recip())
    }

    #[inline(always)]
    pub(crate) fn truncated(self) -> Lanes2<S> {
        Lanes2 { x: self.x, y: self.y }
    }
}

impl<S: Instructions> LaneRects<S> {
    #[inline(always)]
    pub(crate) fn new(simd: S, [a, b, c, d]: &[Rect; LANES]) -> Self {
        let (min, max) = ([a.min, b.min, c.min, d.min], [a.max, b.max, c.max, d.max]);
        Self { min: Lanes2::new(simd, min), max: Lanes2::new(simd, max) }
    }

    #[inline(always)]
    pub(crate) fn to_array(self) -> [Rect; LANES] {
        let ([a, b, c, d], [e, f, g, h]) = (self.min.to_array(), self.max.to_array());
        [Rect::new(a, e), Rect::new(b, f), Rect::new(c, g), Rect::new(d, h)]
    }

    #[inline(always)]
    pub(crate) fn is_empty(self) -> Mask<S> {
        self.max.x.less_than(self.min.x).or(self.max.y.less_than(self.min.y))
    }

    /// Whether nothing is in both.
    #[inline(always)]
    pub(crate) fn is_beside(self, other: Self) -> Mask<S> {
        let before = self.max.x.less_than(other.min.x).or(self.max.y.less_than(other.min.y));
        let behind = other.max.x.less_than(self.min.x).or(other.max.y.less_than(self.min.y));
        before.or(behind)
    }

    /// These where `mask` holds, and `others` elsewhere.
    #[inline(always)]
    pub(crate) fn where_or(self, mask: Mask<S>, others: Self) -> Self {
        Self { min: mask.select2(self.min, others.min), max: mask.select2(self.max, others.max) }
    }

    /// These where `mask` holds, and empty ones elsewhere.
    #[inline(always)]
    pub(crate) fn where_or_empty(self, mask: Mask<S>) -> Self {
        self.where_or(mask, Self { min: self.max + DVec2::ONE, max: self.max })
    }

    /// Which hold a point; none holds what is no number.
    #[inline(always)]
    pub(crate) fn contains(self, point: Lanes2<S>) -> Mask<S> {
        let before = point.x.less_than(self.min.x).or(point.y.less_than(self.min.y));
        let behind = self.max.x.less_than(point.x).or(self.max.y.less_than(point.y));
        before.or(behind).not().and(point.is_finite())
    }

    /// What both have in common; where a bound of `other` is not a number, it bounds nothing.
    #[inline(always)]
    pub(crate) fn intersection(self, other: Self) -> Self {
        Self { min: other.min.max(self.min), max: other.max.min(self.max) }
    }

    /// Grown by `margin` on every side.
    #[inline(always)]
    pub(crate) fn grown(self, margin: f64) -> Self {
        self.shifted(&Rect::new(DVec2::splat(-margin), DVec2::splat(margin)))
    }

    /// Moved by any vector of a rectangle.
    #[inline(always)]
    pub(crate) fn shifted(self, by: &Rect) -> Self {
        Self { min: self.min + by.min, max: self.max + by.max }
    }

    /// Half of each side.
    #[inline(always)]
    pub(crate) fn half_size(self) -> Lanes2<S> {
        (self.max - self.min) * DVec2::splat(0.5)
    }

    #[inline(always)]
    pub(crate) fn centre(self) -> Lanes2<S> {
        self.min + self.half_size()
    }

    #[inline(always)]
    pub(crate) fn area(self) -> Lanes<S> {
        let size = self.max - self.min;
        size.x * size.y
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SPECIAL: [f64; 8] = [0.0, -0.0, 1.5, -2.25, 1e-310, f64::INFINITY, f64::NEG_INFINITY, f64::NAN];

    /// What all operations make of two numbers in one lane, beside others: bits, with one pattern for all that is no
    /// number.
    fn results<S: Instructions>(simd: S, [a, b]: [f64; 2], lane: usize) -> Vec<u64> {
        let beside = |value: f64| std::array::from_fn(|at| if at == lane { value } else { 0.5 });
        let (x, y) = (Lanes::new(simd, beside(a)), Lanes::new(simd, beside(b)));
        let values = [x + y, x - y, x * y, -x, x.abs(), x.sqrt(), x.recip(), x.min(y), x.max(y), x * 3.0];
        let (less, finite) = (x.less_than(y), x.is_finite());
        let masks = [less, finite, less.not(), less.and(finite), less.or(finite), finite.and_not(less)];
        let chosen = less.select(x, y);
        let bits = |values: Lanes<S>| {
            let value = values.to_array()[lane];
            if value.is_nan() { u64::MAX } else { value.to_bits() }
        };
        let held = |mask: &Mask<S>| u64::from(mask.to_array()[lane]);
        let counts = masks.iter().flat_map(|mask| [mask.count(), u64::from(mask.any())]);
        values.into_iter().chain([chosen]).map(bits).chain(masks.iter().map(held)).chain(counts).collect()
    }

    #[test]
    fn all_instructions_compute_the_same_bits_in_every_lane() {
        for a in SPECIAL {
            for b in SPECIAL {
                let plain = results(Scalar256b, [a, b], 0);
                for lane in 0..LANES {
                    assert_eq!(results(Scalar256b, [a, b], lane), plain, "{a} {b}, lane {lane}");
                    #[cfg(target_arch = "x86_64")]
                    if let Some(avx2) = pulp::x86::V3::try_new() {
                        assert_eq!(results(avx2, [a, b], lane), plain, "{a} {b}, lane {lane}, AVX2");
                    }
                }
            }
        }
    }

    #[test]
    fn what_is_no_number_bounds_nothing() {
        let rect = |min: f64, max: f64| {
            let both = |value: f64| Lanes2::splat(Scalar256b, DVec2::splat(value));
            LaneRects { min: both(min), max: both(max) }
        };
        let left = rect(1.0, 2.0).intersection(rect(f64::NAN, f64::NAN)).to_array()[0];
        assert_eq!(left, Rect::new(DVec2::ONE, DVec2::splat(2.0)));
        assert!(rect(1.0, 2.0).where_or_empty(Mask::new(Scalar256b, [false; LANES])).is_empty().to_array()[3]);
    }
}
