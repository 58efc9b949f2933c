//! Polynomials in Bernstein form on `[0, 1]`: where the sign first changes, and all roots.
//!
//! The number of sign changes among the coefficients bounds the number of roots and has the same parity (Descartes'
//! rule in its Bernstein form). No change proves that there is no root. One change proves that there is exactly one.
//! Halving (de Casteljau) separates the other cases. See Farouki, *The Bernstein polynomial basis: a centennial
//! retrospective*, 2012, section 5.

/// Halvings after which two roots that are still together are taken for one double root.
const DEEPEST: u32 = 48;

/// The first `s` in `[0, 1]` where a polynomial that is taken to be positive before 0 becomes negative. Roots that only
/// touch zero are none.
pub(crate) fn first_descent<const N: usize>(coefficients: &[f64; N]) -> Option<f64> {
    descent_within(coefficients, 0.0, 1.0, DEEPEST)
}

/// All roots in `[0, 1]` of a polynomial, ascending, each handed to `found`. Roots that are closer than rounding tells
/// apart, a double root among them, are handed over once. Nothing is found where all coefficients are zero.
pub(crate) fn roots<const N: usize>(coefficients: &[f64; N], found: &mut impl FnMut(f64)) {
    if coefficients.iter().any(|&value| value != 0.0) {
        roots_within(coefficients, 0.0, 1.0, DEEPEST, found);
    }
}

fn roots_within<const N: usize>(b: &[f64; N], from: f64, length: f64, depth: u32, found: &mut impl FnMut(f64)) {
    // A zero at an end is a root; zeros within change no sign.
    let mut changes = 0;
    let mut sign = 0.0;
    for &value in b.iter().filter(|&&value| value != 0.0) {
        changes += usize::from(sign * value < 0.0);
        sign = value.signum();
    }
    match changes {
        0 => {
            if b[0] == 0.0 {
                found(from);
            }
        }
        1 if b[0] != 0.0 && b[N - 1] != 0.0 => {
            let falling = if b[0] > 0.0 { *b } else { b.map(|value| -value) };
            // A start at an end that is all but a root would never leave it.
            found(from + length * single_root(&falling, 0.5));
        }
        _ if depth == 0 => found(from + 0.5 * length),
        _ => {
            let (left, right) = halves(b);
            roots_within(&left, from, 0.5 * length, depth - 1, found);
            roots_within(&right, from + 0.5 * length, 0.5 * length, depth - 1, found);
        }
    }
    // The end is the start of the next part, but for the last.
    if changes == 0 && b[N - 1] == 0.0 && from + length == 1.0 {
        found(1.0);
    }
}

fn descent_within<const N: usize>(b: &[f64; N], from: f64, length: f64, depth: u32) -> Option<f64> {
    if b.iter().find(|&&value| value != 0.0).is_some_and(|&value| value < 0.0) {
        return Some(from);
    }
    let first_negative = b.iter().position(|&value| value < 0.0)?;
    if b[first_negative..].iter().all(|&value| value < 0.0) {
        return Some(from + length * single_root(b, b[0] / (b[0] - b[N - 1])));
    }
    if depth == 0 {
        return (b[N - 1] < 0.0).then_some(from + length);
    }
    let (left, right) = halves(b);
    descent_within(&left, from, 0.5 * length, depth - 1)
        .or_else(|| descent_within(&right, from + 0.5 * length, 0.5 * length, depth - 1))
}

/// The root of a polynomial whose coefficients are first not negative, then negative: Newton's method in a bracket.
fn single_root<const N: usize>(b: &[f64; N], start: f64) -> f64 {
    let (mut low, mut high) = (0.0, 1.0);
    let mut s = start;
    for steps in 0..100 {
        let (value, slope) = evaluate(b, s);
        if value >= 0.0 {
            low = s;
        } else {
            high = s;
        }
        let newton = s - value / slope;
        let trusted = steps < 24 && newton > low && newton < high;
        let next = if trusted { newton } else { 0.5 * (low + high) };
        if (next - s).abs() <= 4.0 * f64::EPSILON * s {
            return next;
        }
        s = next;
    }
    s
}

/// Value and derivative at `s`, by de Casteljau's algorithm.
fn evaluate<const N: usize>(b: &[f64; N], s: f64) -> (f64, f64) {
    let mut points = *b;
    for last in (2..N).rev() {
        for i in 0..last {
            points[i] += s * (points[i + 1] - points[i]);
        }
    }
    let step = points[1] - points[0];
    (points[0] + s * step, (N - 1) as f64 * step)
}

/// The coefficients over the two halves of the interval.
fn halves<const N: usize>(b: &[f64; N]) -> ([f64; N], [f64; N]) {
    let mut left = *b;
    let mut right = *b;
    for (i, value) in left.iter_mut().enumerate() {
        *value = right[0];
        for j in 0..N - 1 - i {
            right[j] = 0.5 * (right[j] + right[j + 1]);
        }
    }
    (left, right)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::testing::fixed_seed;
    use proptest::prelude::*;

    /// Bernstein coefficients of the product of `(r_i - s)` over five roots.
    fn from_roots(roots: [f64; 5]) -> [f64; 6] {
        let mut b = vec![1.0];
        for r in roots {
            let n = b.len();
            let factor = [r, r - 1.0];
            let mut product = vec![0.0; n + 1];
            for (i, value) in b.iter().enumerate() {
                product[i] += value * factor[0] * (n - i) as f64 / n as f64;
                product[i + 1] += value * factor[1] * (i + 1) as f64 / n as f64;
            }
            b = product;
        }
        b.try_into().unwrap()
    }

    proptest! {
        #![proptest_config(fixed_seed(512))]

        #[test]
        fn the_smallest_of_several_separated_roots_is_found(
            first in 0.0..0.2f64, gaps in prop::array::uniform4(0.001..0.4f64),
        ) {
            let mut roots = [first; 5];
            for i in 0..4 {
                roots[i + 1] = roots[i] + gaps[i];
            }
            let found = first_descent(&from_roots(roots)).unwrap();
            prop_assert!((found - first).abs() < 1e-6, "{} {}", found, first);
        }

        #[test]
        fn roots_outside_are_not_found(outside in prop::array::uniform5(1.0001..3.0f64)) {
            prop_assert_eq!(first_descent(&from_roots(outside)), None);
        }
    }

    fn all(b: &[f64; 6]) -> Vec<f64> {
        let mut found = Vec::new();
        roots(b, &mut |root| found.push(root));
        found
    }

    proptest! {
        #![proptest_config(fixed_seed(512))]

        #[test]
        fn all_separated_roots_are_found_and_no_others(
            first in -0.5..0.5f64, gaps in prop::array::uniform4(0.001..0.4f64),
        ) {
            let mut planted = [first; 5];
            for i in 0..4 {
                planted[i + 1] = planted[i] + gaps[i];
            }
            let found = all(&from_roots(planted));
            let within: Vec<f64> = planted.into_iter().filter(|root| (0.0..=1.0).contains(root)).collect();
            prop_assert_eq!(found.len(), within.len(), "{:?} {:?}", found, within);
            for (a, b) in found.iter().zip(&within) {
                prop_assert!((a - b).abs() < 1e-6, "{:?} {:?}", found, within);
            }
        }
    }

    #[test]
    fn roots_at_the_ends_and_in_the_middle_are_found_once() {
        for planted in [[0.0, 0.5, 1.0, 2.0, 3.0], [0.25, 0.5, 0.75, 2.0, 3.0]] {
            let found = all(&from_roots(planted));
            assert!(found.len() == 3 && found.iter().zip(planted).all(|(a, b)| (a - b).abs() < 1e-12), "{found:?}");
        }
        assert_eq!(all(&[0.0; 6]), [0.0; 0]);
    }

    #[test]
    fn a_touching_root_is_no_change_of_sign() {
        // (s - 1/4)^2 has the coefficients 1/16, -3/16, 9/16.
        assert_eq!(first_descent(&[0.0625, -0.1875, 0.5625]), None);
        // Lowered by a hair, it is a real change.
        assert!(first_descent(&[0.0625 - 1e-9, -0.1875 - 1e-9, 0.5625 - 1e-9]).is_some());
    }

    #[test]
    fn a_polynomial_that_starts_negative_descends_at_once() {
        assert_eq!(first_descent(&[-1.0, 2.0, 3.0]), Some(0.0));
        assert_eq!(first_descent(&[0.0, -1.0, 3.0]), Some(0.0));
    }

    #[test]
    fn halves_meet_and_keep_the_ends() {
        let (left, right) = halves(&[1.0, -2.0, 3.0, 5.0]);
        assert_eq!((left[0], right[3]), (1.0, 5.0));
        assert_eq!(left[3], right[0]);
        assert_eq!(left[3], evaluate(&[1.0, -2.0, 3.0, 5.0], 0.5).0);
    }
}
