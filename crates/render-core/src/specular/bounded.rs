//! Numbers that are bounded together with their derivatives by a place: forward differentiation in interval arithmetic.

use std::ops::{Add, Mul, Sub};

use crate::math::Interval;

/// Bounds on a number, and on its derivatives by the two coordinates of a place.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bounded {
    pub(super) value: Interval,
    pub(super) by: [Interval; 2],
}

/// A tangential vector of such.
pub(super) type Bounded2 = [Bounded; 2];

impl Bounded {
    /// A coordinate of the place itself.
    pub(super) fn variable(axis: usize, value: Interval) -> Self {
        Self { value, by: [0, 1].map(|by| Interval::point(if by == axis { 1.0 } else { 0.0 })) }
    }

    #[inline(always)]
    pub(super) fn negative(self) -> Self {
        Self { value: -self.value, by: self.by.map(|by| -by) }
    }

    /// The square root; `None` where the number may be negative or zero.
    #[inline(always)]
    pub(super) fn root(self) -> Option<Self> {
        let value = Interval::new(self.value.min.sqrt(), self.value.max.sqrt());
        let slope = Interval::new(0.5 / value.max, 0.5 / value.min);
        (self.value.min > 0.0).then(|| Self { value, by: self.by.map(|by| by * slope) })
    }

    /// One over the number; `None` where it may be negative or zero.
    #[inline(always)]
    pub(super) fn reciprocal(self) -> Option<Self> {
        let value = Interval::new(1.0 / self.value.max, 1.0 / self.value.min);
        let slope = Interval::new(-value.max * value.max, -value.min * value.min);
        (self.value.min > 0.0).then(|| Self { value, by: self.by.map(|by| by * slope) })
    }

    /// The quotient; `None` where the divisor may be negative or zero.
    #[inline(always)]
    pub(super) fn over(self, divisor: Self) -> Option<Self> {
        Some(self * divisor.reciprocal()?)
    }
}

/// The scalar product.
#[inline(always)]
pub(super) fn dot(first: &Bounded2, second: &Bounded2) -> Bounded {
    first[0] * second[0] + first[1] * second[1]
}

impl Add for Bounded {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self { value: self.value + other.value, by: [0, 1].map(|by| self.by[by] + other.by[by]) }
    }
}

impl Sub for Bounded {
    type Output = Self;

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self { value: self.value - other.value, by: [0, 1].map(|by| self.by[by] - other.by[by]) }
    }
}

impl Mul for Bounded {
    type Output = Self;

    #[inline(always)]
    #[expect(clippy::suspicious_arithmetic_impl, reason = "the rule of products")]
    fn mul(self, other: Self) -> Self {
        let by = [0, 1].map(|by| self.by[by] * other.value + self.value * other.by[by]);
        Self { value: self.value * other.value, by }
    }
}

/// Of a constant.
impl Add<Interval> for Bounded {
    type Output = Self;

    #[inline(always)]
    fn add(self, constant: Interval) -> Self {
        Self { value: self.value + constant, ..self }
    }
}

/// By a constant.
impl Mul<f64> for Bounded {
    type Output = Self;

    #[inline(always)]
    fn mul(self, factor: f64) -> Self {
        let factor = Interval::point(factor);
        Self { value: self.value * factor, by: self.by.map(|by| by * factor) }
    }
}
