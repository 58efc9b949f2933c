//! Eight numbers in single precision.

use std::ops::{Add, Mul, Sub};

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

/// Eight vectors of a plane.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Singles2<S> {
    pub(crate) x: Singles<S>,
    pub(crate) y: Singles<S>,
}

/// Tells the processor that numbers will be needed soon.
#[inline(always)]
pub(crate) fn prefetch<T>(values: &T) {
    #[cfg(target_arch = "x86_64")]
    safe_arch::prefetch_t0(values);
    #[cfg(not(target_arch = "x86_64"))]
    let _ = values;
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

    /// Products and sums are fused.
    #[inline(always)]
    pub(crate) fn dot(self, other: Self) -> Singles<S> {
        self.x.times_plus(other.x, self.y.times_plus(other.y, self.z * other.z))
    }

    /// Products and differences are fused.
    #[inline(always)]
    pub(crate) fn cross(self, other: Self) -> Self {
        Self {
            x: self.y.times_minus(other.z, self.z * other.y),
            y: self.z.times_minus(other.x, self.x * other.z),
            z: self.x.times_minus(other.y, self.y * other.x),
        }
    }

    /// The first two coordinates of the cross product.
    #[inline(always)]
    pub(crate) fn cross_xy(self, other: Self) -> Singles2<S> {
        Singles2 { x: self.y.times_minus(other.z, self.z * other.y), y: self.z.times_minus(other.x, self.x * other.z) }
    }

    #[inline(always)]
    pub(crate) fn abs(self) -> Self {
        Self { x: self.x.abs(), y: self.y.abs(), z: self.z.abs() }
    }

    #[inline(always)]
    pub(crate) fn length(self) -> Singles<S> {
        self.dot(self).sqrt()
    }
}

impl<S: Instructions> Singles2<S> {
    /// This times a factor plus something, each coordinate rounded once.
    #[inline(always)]
    pub(crate) fn times_plus(self, factor: Singles<S>, summand: Self) -> Self {
        Self { x: self.x.times_plus(factor, summand.x), y: self.y.times_plus(factor, summand.y) }
    }

    /// The determinant of the matrix with this and another as columns. Products and differences are fused.
    #[inline(always)]
    pub(crate) fn determinant(self, other: Self) -> Singles<S> {
        self.x.times_minus(other.y, self.y * other.x)
    }

    #[inline(always)]
    pub(crate) fn length(self) -> Singles<S> {
        self.x.times_plus(self.x, self.y * self.y).sqrt()
    }
}

impl<S: Instructions> Add for Singles2<S> {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self { x: self.x + other.x, y: self.y + other.y }
    }
}

impl<S: Instructions> Sub for Singles2<S> {
    type Output = Self;

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self { x: self.x - other.x, y: self.y - other.y }
    }
}

impl<S: Instructions> Mul<Singles<S>> for Singles2<S> {
    type Output = Self;

    #[inline(always)]
    fn mul(self, factor: Singles<S>) -> Self {
        Self { x: self.x * factor, y: self.y * factor }
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

#[cfg(test)]
mod tests {
    use pulp::Scalar256b;

    use super::*;

    const SPECIAL: [f32; 9] = [0.0, -0.0, 1.5, -2.25, 0.1, 1e-40, f32::INFINITY, f32::NEG_INFINITY, f32::NAN];

    /// What all operations make of three numbers in one lane, beside others: bits, with one pattern for all that is no
    /// number.
    fn results<S: Instructions>(simd: S, [a, b, c]: [f32; 3], lane: usize) -> Vec<u32> {
        let beside = |value: f32| std::array::from_fn(|at| if at == lane { value } else { 0.5 });
        let (x, y, z) =
            (Singles::new(simd, &beside(a)), Singles::new(simd, &beside(b)), Singles::new(simd, &beside(c)));
        let vector = Singles3 { x, y, z };
        let other = Singles3 { x: y, y: z, z: x };
        let crossed = vector.cross(other);
        let across = vector.cross_xy(other);
        let values = [
            x + y,
            x - y,
            x * y,
            x.abs(),
            x.sqrt(),
            x.over(y),
            x.positive_part(),
            x.times_plus(y, z),
            x.times_minus(y, z),
            vector.dot(other),
            crossed.x,
            crossed.y,
            crossed.z,
            across.x,
            across.y,
            across.times_plus(y, Singles2 { x, y }).y,
            across.determinant(Singles2 { x: z, y: x }),
            across.length(),
        ];
        let bits = |values: Singles<S>| {
            let value = pulp::cast::<_, [f32; SINGLES]>(values.values)[lane];
            if value.is_nan() { u32::MAX } else { value.to_bits() }
        };
        values.into_iter().map(bits).chain([x.less_than(y) >> lane & 1]).collect()
    }

    #[test]
    fn all_instructions_compute_the_same_bits_in_every_lane() {
        for a in SPECIAL {
            for b in SPECIAL {
                for c in SPECIAL {
                    let plain = results(Scalar256b, [a, b, c], 0);
                    for lane in 0..SINGLES {
                        assert_eq!(results(Scalar256b, [a, b, c], lane), plain, "{a} {b} {c}, lane {lane}");
                        #[cfg(target_arch = "x86_64")]
                        if let Some(avx2) = pulp::x86::V3::try_new() {
                            assert_eq!(results(avx2, [a, b, c], lane), plain, "{a} {b} {c}, lane {lane}, AVX2");
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn fused_products_and_sums_are_rounded_once() {
        // The square is 1 + 2^-11 + 2^-24, whose last part a product would lose.
        let (near_one, small) = (1.0 + 2f32.powi(-12), 2f32.powi(-24));
        let fused = Singles::splat(Scalar256b, near_one)
            .times_minus(Singles::splat(Scalar256b, near_one), Singles::splat(Scalar256b, 1.0 + 2f32.powi(-11)));
        assert_eq!(pulp::cast::<_, [f32; SINGLES]>(fused.values), [small; SINGLES]);
    }
}
