//! Four numbers side by side, computed with one instruction where the processor can.
//!
//! A value carries the token of the instructions that it is computed with (`pulp`): AVX2, or plain code for other processors.
//! Both compute the same bits. Nothing is fused, and the smaller or larger of two numbers is chosen by comparing them.

use std::ops::{Add, Mul, Neg, Sub};

use glam::DVec2;
use pulp::{Simd, f64x4, m64, m64x4};

use crate::geometry::Rect;

/// How many numbers there are.
pub(crate) const LANES: usize = 4;

/// Instructions for four numbers.
pub(crate) trait FourLanes: Simd<f64s = f64x4, m64s = m64x4> {}

impl<S: Simd<f64s = f64x4, m64s = m64x4>> FourLanes for S {}

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

impl<S: FourLanes> Lanes<S> {
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
        self.less_than(other).select(self, other)
    }

    /// The larger one; `other` where either is not a number.
    #[inline(always)]
    pub(crate) fn max(self, other: Self) -> Self {
        other.less_than(self).select(self, other)
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
        impl<S: FourLanes> $trait for Lanes<S> {
            type Output = Self;

            #[inline(always)]
            fn $name(self, other: Self) -> Self {
                Self { values: self.simd.$function(self.values, other.values), ..self }
            }
        }

        impl<S: FourLanes> $trait<f64> for Lanes<S> {
            type Output = Self;

            #[inline(always)]
            fn $name(self, other: f64) -> Self {
                self.$name(Self::splat(self.simd, other))
            }
        }

        impl<S: FourLanes> $trait for Lanes2<S> {
            type Output = Self;

            #[inline(always)]
            fn $name(self, other: Self) -> Self {
                Self { x: self.x.$name(other.x), y: self.y.$name(other.y) }
            }
        }

        impl<S: FourLanes> $trait<DVec2> for Lanes2<S> {
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

impl<S: FourLanes> Neg for Lanes<S> {
    type Output = Self;

    #[inline(always)]
    fn neg(self) -> Self {
        Self { values: self.simd.neg_f64s(self.values), ..self }
    }
}

impl<S: FourLanes> Mask<S> {
    #[inline(always)]
    pub(crate) fn new(simd: S, [a, b, c, d]: [bool; LANES]) -> Self {
        Self { simd, values: m64x4(m64::new(a), m64::new(b), m64::new(c), m64::new(d)) }
    }

    #[inline(always)]
    pub(crate) fn to_array(self) -> [bool; LANES] {
        let m64x4(a, b, c, d) = self.values;
        [a.is_set(), b.is_set(), c.is_set(), d.is_set()]
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
        self.simd.first_true_m64s(self.values) < LANES
    }

    /// In how many lanes it holds.
    #[inline(always)]
    pub(crate) fn count(self) -> u64 {
        let [a, b, c, d] = self.to_array();
        u64::from(a) + u64::from(b) + u64::from(c) + u64::from(d)
    }
}

impl<S: FourLanes> Lanes2<S> {
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

impl<S: FourLanes> Lanes3<S> {
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

impl<S: FourLanes> LaneRects<S> {
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

    #[inline(always)]
    pub(crate) fn contains(self, point: Lanes2<S>) -> Mask<S> {
        let before = point.x.less_than(self.min.x).or(point.y.less_than(self.min.y));
        let behind = self.max.x.less_than(point.x).or(self.max.y.less_than(point.y));
        before.or(behind).not()
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
