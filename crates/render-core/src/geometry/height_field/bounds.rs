//! Between which values a height field and its derivatives lie over a rectangle, by the Bernstein coefficients of whole
//! cells' polynomials in a min-max pyramid. `shape` has bounds that get as narrow as the rectangle does.

use glam::DVec2;

use super::{HeightField, Patch, cell_of, patches, tensor};
use crate::geometry::{
    Interval, Rect,
    pyramid::{Bounds, CellRange, Pyramid},
    spline::{bernstein_curvature_weights, bernstein_slope_weights, bernstein_weights},
};

/// Rounding error of an evaluation and of a cell's Bernstein coefficients, relative to the largest coefficient that
/// enters it: sums of 16 products of weights with an error of a few units in the last place each.
const ROUNDING: f64 = 32.0 * f64::EPSILON;

/// Bounds of a height field and of its derivatives over a region; the units are those of
/// [`SurfaceJet`](super::SurfaceJet).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JetBounds {
    /// Of h.
    pub height: Interval,
    /// Of dh/dx and dh/dy.
    pub gradient: [Interval; 2],
    /// Of the second derivatives by xx, xy and yy.
    pub hessian: [Interval; 3],
}

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

/// Bounds over each cell of a padded grid, by the cell coordinates.
pub(super) fn of_cells(padded: &[f64], [columns, rows]: [usize; 2]) -> Pyramid {
    let (value, slope) = (bernstein_weights(0.0, 1.0), bernstein_slope_weights(0.0, 1.0));
    let curvature = bernstein_curvature_weights(0.0, 1.0);
    let bounds = patches(padded, [columns, rows]).map(|patch| {
        [
            hull(patch, &tensor(patch, &value, &value)),
            hull(patch, &tensor(patch, &slope, &value)),
            hull(patch, &tensor(patch, &value, &slope)),
            hull(patch, &tensor(patch, &curvature, &value)),
            hull(patch, &tensor(patch, &slope, &slope)),
            hull(patch, &tensor(patch, &value, &curvature)),
        ]
    });
    Pyramid::new(columns + 3, rows + 3, bounds)
}

/// Bounds of the values that have the given Bernstein coefficients over a cell, with room for the rounding of an
/// evaluation.
#[inline(always)]
pub(super) fn hull<const X: usize, const Y: usize>(patch: Patch<'_>, values: &[[f64; X]; Y]) -> Interval {
    let bounds =
        values.as_flattened().iter().fold(Interval::EMPTY, |bounds, &value| bounds.union(Interval::new(value, value)));
    let largest = patch.iter().copied().flatten().fold(0f64, |largest, value| largest.max(value.abs()));
    Interval::new(bounds.min - ROUNDING * largest, bounds.max + ROUNDING * largest)
}

/// Rounding errors by the cell coordinates: of sums of coefficients, which may all be far from zero, and of the cell
/// coordinates themselves, which moves a point by so much of a cell.
pub(super) fn rounding(bounds: &Pyramid, end: DVec2) -> [f64; 2] {
    let [heights, ..] = bounds.all();
    [2.0 * ROUNDING * heights.magnitude(), 4.0 * f64::EPSILON * end.max_element()]
}

/// Bounds by cell coordinates as bounds by metres.
#[inline(always)]
pub(super) fn by_metres(&[height, x, y, xx, xy, yy]: &Bounds, density: DVec2) -> JetBounds {
    JetBounds {
        height,
        gradient: [scaled(x, density.x), scaled(y, density.y)],
        hessian: [
            scaled(xx, density.x * density.x),
            scaled(xy, density.x * density.y),
            scaled(yy, density.y * density.y),
        ],
    }
}

/// An interval times a factor, with room for the rounding of the product and of the factor.
#[inline(always)]
fn scaled(bounds: Interval, factor: f64) -> Interval {
    const ROOM: f64 = 4.0 * f64::EPSILON;
    let (min, max) = (bounds.min * factor, bounds.max * factor);
    Interval::new(min - ROOM * min.abs(), max + ROOM * max.abs())
}

#[cfg(test)]
pub(super) mod tests {
    use proptest::prelude::*;

    use super::super::tests::{COLUMNS, ROWS, SIZE, any_point, rough};
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
