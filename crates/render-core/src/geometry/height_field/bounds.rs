//! Between which values a height field and its derivatives lie over a rectangle, by the Bernstein coefficients of whole
//! cells' polynomials in a min-max pyramid. `shape` has bounds that get as narrow as the rectangle does.

use super::cell_bounds::{JetBounds, by_metres, scaled};
use super::field::HeightField;
use super::patch::cell_of;
use crate::geometry::pyramid::CellRange;
use crate::math::{Interval, Rect};

impl HeightField {
    /// Bounds over `rect`: every evaluation inside gives values between them. A rectangle inside another never has
    /// wider bounds; those of an empty one are empty.
    #[inline]
    pub fn bounds(&self, rect: &Rect) -> JetBounds {
        if rect.is_empty() {
            return JetBounds {
                height: Interval::EMPTY,
                gradient: [Interval::EMPTY; 2],
                hessian: [Interval::EMPTY; 3],
            };
        }
        by_metres(&self.bounds.bounds(&self.cells(rect)), self.density)
    }

    /// Bounds of dh/dx and dh/dy over `rect`, which must not be empty, as in [`Self::bounds`].
    #[inline(always)]
    pub(crate) fn slope_bounds(&self, rect: &Rect) -> [Interval; 2] {
        let [x, y] = self.bounds.slopes(&self.cells(rect));
        [scaled(x, self.density.x), scaled(y, self.density.y)]
    }

    /// Bounds over the whole plane.
    #[inline]
    pub fn all_bounds(&self) -> &JetBounds {
        &self.all
    }

    /// The cells that a rectangle touches. Conservative because [`Self::cell_coordinates`] is monotone, also as
    /// rounded.
    #[inline(always)]
    pub(super) fn cells(&self, rect: &Rect) -> CellRange {
        let cell = |p| cell_of(self.clamped(self.cell_coordinates(p))).map(|i| i as usize);
        CellRange { first: cell(rect.min), last: cell(rect.max) }
    }
}

#[cfg(test)]
pub(super) mod tests {
    use proptest::prelude::*;

    use super::super::field::tests::{COLUMNS, ROWS, SIZE, any_point, rough};
    use super::*;
    use crate::geometry::testing::fixed_seed;
    use glam::dvec2;

    pub(in super::super) fn check_held(
        field: &HeightField,
        rect: &Rect,
        bounds: &JetBounds,
        inside: &[(f64, f64)],
    ) -> Result<(), TestCaseError> {
        let holds = |bounds: Interval, value: f64| bounds.min <= value && value <= bounds.max;
        for (s, t) in inside {
            let p = (rect.min + (rect.max - rect.min) * dvec2(*s, *t)).clamp(rect.min, rect.max);
            let jet = field.jet(p);
            prop_assert!(holds(bounds.height, jet.height));
            prop_assert!(holds(bounds.gradient[0], jet.gradient.x) && holds(bounds.gradient[1], jet.gradient.y));
            prop_assert!((0..3).all(|k| holds(bounds.hessian[k], jet.hessian[k])), "{:?} {:?}", jet, bounds);
        }
        Ok(())
    }

    #[test]
    fn an_empty_rectangle_has_empty_bounds() {
        let field = rough(COLUMNS, ROWS, 1.0, SIZE);
        assert!(field.bounds(&Rect::new(dvec2(0.1, 0.0), dvec2(0.0, 0.1))).height.is_empty());
    }

    proptest! {
        #![proptest_config(fixed_seed(256))]

        #[test]
        fn bounds_hold_every_evaluation(
            a in any_point(0.8), b in any_point(0.8), inside in prop::collection::vec((0.0..=1.0f64, 0.0..=1.0f64), 64),
            amplitude in prop::sample::select(vec![1e-9, 1e-3, 1.0, 1e6]),
        ) {
            let field = rough(COLUMNS, ROWS, amplitude, SIZE);
            let rect = Rect::new(a.min(b), a.max(b));
            let bounds = field.bounds(&rect);
            prop_assert_eq!(field.slope_bounds(&rect), bounds.gradient);
            check_held(&field, &rect, &bounds, &inside)?;
        }

        #[test]
        fn bounds_over_one_point_are_those_of_its_cell(p in any_point(0.5)) {
            // The Bernstein hull of a bicubic cell exceeds the range of its 16 control values nowhere.
            let field = rough(COLUMNS, ROWS, 1.0, SIZE);
            let bounds = field.bounds(&Rect::new(p, p)).height;
            let a = field.cell_coordinates(p);
            let (patch, _, _) = field.within_cell(a, a);
            let low = patch.iter().copied().flatten().copied().fold(f64::INFINITY, f64::min);
            let high = patch.iter().copied().flatten().copied().fold(f64::NEG_INFINITY, f64::max);
            // One part in 10^6 for the rounding of the bounds to single precision.
            prop_assert!(low - 1e-6 <= bounds.min && bounds.max <= high + 1e-6);
        }

        #[test]
        fn bounds_shrink_with_the_rectangle(a in any_point(0.8), b in any_point(0.8), c in any_point(0.8)) {
            let field = rough(COLUMNS, ROWS, 1.0, SIZE);
            let inner = Rect::new(a.min(b), a.max(b));
            let outer = Rect::new(inner.min.min(c), inner.max.max(c));
            let quantities = |bounds: JetBounds| {
                let [x, y] = bounds.gradient;
                let [xx, xy, yy] = bounds.hessian;
                [bounds.height, x, y, xx, xy, yy]
            };
            for (narrow, wide) in quantities(field.bounds(&inner)).into_iter().zip(quantities(field.bounds(&outer))) {
                prop_assert!(wide.min <= narrow.min && narrow.max <= wide.max);
            }
        }
    }
}
