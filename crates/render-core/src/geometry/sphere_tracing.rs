//! Sphere tracing (Hart 1996) of a height field, as Huan et al. 2023 (section 3) find where rays cross a face.
//!
//! A ray advances by steps that the steepest slope of the surface proves to be free. It ends when it is near enough to
//! the surface. It needs only heights and a bound on slopes, and takes many steps where `crossing` takes a few. It is
//! here to count what the published methods cost with it. Its lengths are absolute, as in published code: it is for
//! glass that is much thicker than a micrometre.

use glam::DVec3;

use super::crossing::{Crossing, Side, Start};
use super::{HeightField, JetBounds, Ray};
use crate::math::Interval;
use clerestory_film::counters::Counters;

/// A ray that is so near to the surface, metres, has arrived.
const ARRIVED: f64 = 1e-9;

/// What leaves the surface starts so far from it along the ray, metres.
const OFFSET: f64 = 1e-6;

/// A ray that has not arrived after this many steps runs along the surface and counts as gone past it.
const MOST_STEPS: usize = 4096;

impl HeightField {
    /// As [`HeightField::first_crossing`], by sphere tracing. The point is improved by one step of Newton's method,
    /// which leaves it on the surface to the last digits.
    #[expect(clippy::too_many_arguments, reason = "the ray, the surface, and what is known of both")]
    pub(super) fn sphere_traced(
        &self,
        bounds: &JetBounds,
        base: f64,
        ray: &Ray,
        range: Interval,
        side: Side,
        start: Start,
        counters: &mut Counters,
    ) -> Option<Crossing> {
        let sign = match side {
            Side::Above => 1.0,
            Side::Below => -1.0,
        };
        let [x, y] = bounds.gradient.map(|slope| slope.magnitude());
        let steepness = (1.0 + x * x + y * y).sqrt();
        let (origin, direction) = (ray.origin - DVec3::new(0.0, 0.0, base), ray.direction);
        let first = if start == Start::OnSurface { OFFSET } else { range.min };
        let range = over_heights(origin.z, direction.z, bounds.height).intersection(Interval::new(first, range.max));
        let mut t = range.min;
        let mut arrived = false;
        for _ in 0..MOST_STEPS {
            if t > range.max {
                return None;
            }
            counters.height_evaluations += 1;
            let place = origin + direction * t;
            let clearance = sign * (place.z - self.height(place.truncate())) / steepness;
            if clearance < ARRIVED {
                arrived = true;
                break;
            }
            t += clearance;
        }
        if !arrived {
            return None;
        }
        counters.height_evaluations += 1;
        let place = origin + direction * t;
        let (height, gradient) = self.slope(place.truncate());
        let rate = direction.z - gradient.dot(direction.truncate());
        let step = (height - place.z) / rate;
        // Along the surface, one step of Newton's method may lead anywhere.
        let step = if step.abs() < OFFSET { step } else { 0.0 };
        let at = (place + direction * step).truncate();
        let point = at.extend(height + step * gradient.dot(direction.truncate()) + base);
        Some(Crossing { distance: t + step, point, gradient })
    }
}

/// Where a line with these z lies between heights; with a margin, so that it comes from outside.
fn over_heights(origin: f64, rate: f64, heights: Interval) -> Interval {
    let (low, high) = (heights.min - 2.0 * ARRIVED, heights.max + 2.0 * ARRIVED);
    if rate == 0.0 {
        let within = low <= origin && origin <= high;
        return if within { Interval::new(f64::NEG_INFINITY, f64::INFINITY) } else { Interval::EMPTY };
    }
    let (a, b) = ((low - origin) / rate, (high - origin) / rate);
    Interval::new(a.min(b), a.max(b))
}

#[cfg(test)]
mod tests {
    use glam::{DVec2, dvec2};
    use proptest::prelude::*;

    use super::*;
    use crate::geometry::testing::{Glass, fixed_seed};

    proptest! {
        #![proptest_config(fixed_seed(2000))]

        #[test]
        fn finds_the_proven_crossings_with_more_height_evaluations(
            kind in prop::sample::select(Glass::ALL.to_vec()),
            (x, y, towards_x, towards_y) in (-0.2f64..0.2, -0.2f64..0.2, -0.2f64..0.2, -0.2f64..0.2),
            above in any::<bool>(),
        ) {
            let field = kind.face(DVec2::splat(0.5), 0.004, 0.3);
            let (side, sign) = if above { (Side::Above, 1.0) } else { (Side::Below, -1.0) };
            let origin = DVec3::new(x, y, 0.1 * sign);
            let ray = Ray::new(origin, (DVec3::new(towards_x, towards_y, 0.0) - origin).normalize());
            let range = Interval::new(0.0, f64::INFINITY);
            let [mut few, mut many] = [Counters::default(); 2];
            let bounds = field.all_bounds();
            let proven = field.first_crossing(bounds, 0.0, &ray, range, side, Start::Free, &mut few);
            let proven = proven.expect("a crossing");
            let traced = field.sphere_traced(bounds, 0.0, &ray, range, side, Start::Free, &mut many);
            let traced = traced.expect("a crossing");
            prop_assert!((traced.point - proven.point).length() < 1e-8, "{traced:?} {proven:?}");
            prop_assert!((traced.gradient - proven.gradient).length() < 1e-5);
            prop_assert!(matches!(kind, Glass::Flat) || many.height_evaluations >= few.height_evaluations);
            // It goes on without meeting the surface where it stands.
            let onward = Ray::new(proven.point, ray.direction);
            let other = if above { Side::Below } else { Side::Above };
            let proven = field.first_crossing(bounds, 0.0, &onward, range, other, Start::OnSurface, &mut few);
            let traced = field.sphere_traced(bounds, 0.0, &onward, range, other, Start::OnSurface, &mut many);
            let distance = |crossing: Option<Crossing>| crossing.map_or(1.0, |crossing| crossing.distance);
            prop_assert!((distance(traced) - distance(proven)).abs() < 1e-6, "{traced:?} {proven:?}");
        }
    }

    #[test]
    fn misses_what_it_does_not_reach() {
        let field = Glass::Flat.face(DVec2::splat(0.5), 0.0, 0.0);
        let ray = Ray::new(DVec3::new(0.0, 0.0, 0.1), DVec3::new(0.0, 0.6, -0.8));
        let trace = |range| {
            field.sphere_traced(
                field.all_bounds(),
                0.0,
                &ray,
                range,
                Side::Above,
                Start::Free,
                &mut Counters::default(),
            )
        };
        assert!(trace(Interval::new(0.0, 0.12)).is_none());
        let found = trace(Interval::new(0.0, 0.13)).expect("it reaches the surface at 0.125 m");
        assert!((found.point.truncate() - dvec2(0.0, 0.075)).length() < 1e-12);
    }
}
