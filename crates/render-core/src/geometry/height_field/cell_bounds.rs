//! Between which values a height field and its derivatives lie over each cell, by Bernstein coefficients.

use glam::DVec2;

use super::patch::{Patch, patches, tensor};
use crate::geometry::pyramid::{Bounds, Pyramid};
use crate::geometry::spline::{bernstein_curvature_weights, bernstein_slope_weights, bernstein_weights};
use crate::math::Interval;

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
pub(super) fn scaled(bounds: Interval, factor: f64) -> Interval {
    const ROOM: f64 = 4.0 * f64::EPSILON;
    let (min, max) = (bounds.min * factor, bounds.max * factor);
    Interval::new(min - ROOM * min.abs(), max + ROOM * max.abs())
}
