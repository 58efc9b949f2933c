//! Eight numbers in single precision.

use std::ops::{Add, Mul, Sub};

use glam::DVec3;
use pulp::f32x8;

use super::Instructions;

/// How many numbers there are.
pub(crate) const SINGLES: usize = 8;

/// Eight numbers.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Singles<S> {
    simd: S,
    values: f32x8,
}

/// Eight vectors of space.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Singles3<S> {
    pub(crate) x: Singles<S>,
    pub(crate) y: Singles<S>,
    pub(crate) z: Singles<S>,
}

impl<S: Instructions> Singles<S> {
    #[inline(always)]
    pub(crate) fn new(simd: S, values: &[f32; SINGLES]) -> Self {
        Self { simd, values: pulp::cast(*values) }
    }

    #[inline(always)]
    pub(crate) fn splat(simd: S, value: f32) -> Self {
        Self { simd, values: simd.splat_f32s(value) }
    }

    #[inline(always)]
    pub(crate) fn simd(self) -> S {
        self.simd
    }

    #[inline(always)]
    pub(crate) fn abs(self) -> Self {
        Self { values: self.simd.abs_f32s(self.values), ..self }
    }

    #[inline(always)]
    pub(crate) fn sqrt(self) -> Self {
        Self { values: self.simd.sqrt_f32s(self.values), ..self }
    }

    #[inline(always)]
    pub(crate) fn over(self, other: Self) -> Self {
        Self { values: self.simd.div_f32s(self.values, other.values), ..self }
    }

    /// This times a factor plus something, rounded once.
    #[inline(always)]
    pub(crate) fn times_plus(self, factor: Self, summand: Self) -> Self {
        Self { values: self.simd.mul_add_f32s(self.values, factor.values, summand.values), ..self }
    }

    /// This times a factor minus something, rounded once.
    #[inline(always)]
    pub(crate) fn times_minus(self, factor: Self, subtrahend: Self) -> Self {
        let negative = self.simd.neg_f32s(subtrahend.values);
        Self { values: self.simd.mul_add_f32s(self.values, factor.values, negative), ..self }
    }

    /// Zero where negative.
    #[inline(always)]
    pub(crate) fn positive_part(self) -> Self {
        (self + self.abs()) * Self::splat(self.simd, 0.5)
    }

    /// A bit for each lane, that of the first one lowest: whether it is less; not where either is no number.
    #[inline(always)]
    pub(crate) fn less_than(self, other: Self) -> u32 {
        self.simd.bits_of_singles(self.simd.less_than_f32s(self.values, other.values))
    }
}

/// An operator between two.
macro_rules! operator {
    ($trait:ident, $name:ident, $function:ident) => {
        impl<S: Instructions> $trait for Singles<S> {
            type Output = Self;

            #[inline(always)]
            fn $name(self, other: Self) -> Self {
                Self { values: self.simd.$function(self.values, other.values), ..self }
            }
        }
    };
}

operator!(Add, add, add_f32s);
operator!(Sub, sub, sub_f32s);
operator!(Mul, mul, mul_f32s);

impl<S: Instructions> Singles3<S> {
    #[inline(always)]
    pub(crate) fn new(simd: S, [x, y, z]: &[[f32; SINGLES]; 3]) -> Self {
        Self { x: Singles::new(simd, x), y: Singles::new(simd, y), z: Singles::new(simd, z) }
    }

    #[inline(always)]
    pub(crate) fn splat(simd: S, DVec3 { x, y, z }: DVec3) -> Self {
        Self { x: Singles::splat(simd, x as f32), y: Singles::splat(simd, y as f32), z: Singles::splat(simd, z as f32) }
    }

    #[inline(always)]
    pub(crate) fn dot(self, other: Self) -> Singles<S> {
        self.x.times_plus(other.x, self.y.times_plus(other.y, self.z * other.z))
    }

    /// This times a factor plus something, each coordinate rounded once.
    #[inline(always)]
    pub(crate) fn times_plus(self, factor: Singles<S>, summand: Self) -> Self {
        Self {
            x: self.x.times_plus(factor, summand.x),
            y: self.y.times_plus(factor, summand.y),
            z: self.z.times_plus(factor, summand.z),
        }
    }

    #[inline(always)]
    pub(crate) fn cross(self, other: Self) -> Self {
        Self {
            x: self.y.times_minus(other.z, self.z * other.y),
            y: self.z.times_minus(other.x, self.x * other.z),
            z: self.x.times_minus(other.y, self.y * other.x),
        }
    }

    #[inline(always)]
    pub(crate) fn abs(self) -> Self {
        Self { x: self.x.abs(), y: self.y.abs(), z: self.z.abs() }
    }

    /// Zero where negative.
    #[inline(always)]
    pub(crate) fn positive_part(self) -> Self {
        Self { x: self.x.positive_part(), y: self.y.positive_part(), z: self.z.positive_part() }
    }

    #[inline(always)]
    pub(crate) fn length(self) -> Singles<S> {
        self.dot(self).sqrt()
    }
}

impl<S: Instructions> Add for Singles3<S> {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self { x: self.x + other.x, y: self.y + other.y, z: self.z + other.z }
    }
}

impl<S: Instructions> Sub for Singles3<S> {
    type Output = Self;

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self { x: self.x - other.x, y: self.y - other.y, z: self.z - other.z }
    }
}

impl<S: Instructions> Mul<Singles<S>> for Singles3<S> {
    type Output = Self;

    #[inline(always)]
    fn mul(self, factor: Singles<S>) -> Self {
        Self { x: self.x * factor, y: self.y * factor, z: self.z * factor }
    }
}
