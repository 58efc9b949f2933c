//! Between which values a height field and its derivatives lie over a rectangle.
//!
//! Over whole cells they come from the Bernstein coefficients of the cells' polynomials, in a min-max pyramid. Within a
//! cell they come from the Taylor polynomial about the rectangle's middle, with the cells' third derivatives as remainder.

use glam::{DMat2, DVec2};

use super::{FacePoint, HeightField, Patch, cell_of, patches, tensor};
use crate::geometry::{
    Interval, Rect,
    pyramid::{Bounds, CellRange, Pyramid, round_up},
    spline::{THIRD_DERIVATIVE_WEIGHTS, bernstein_curvature_weights, bernstein_slope_weights, bernstein_weights},
};

/// Over rectangles with larger half sides, in cells, the Taylor polynomial's remainder is wider than the hull of the cells.
/// Smaller ones touch no cell more than two columns and rows from that of their middle.
const MOST_CELLS: f64 = 2.0;

/// Rounding error of an evaluation and of a cell's Bernstein coefficients, relative to the largest coefficient that
/// enters it: sums of 16 products of weights with an error of a few units in the last place each.
const ROUNDING: f64 = 32.0 * f64::EPSILON;

/// Bounds of a height field and of its derivatives over a region; the units are those of [`SurfaceJet`](super::SurfaceJet).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JetBounds {
    /// Of h.
    pub height: Interval,
    /// Of dh/dx and dh/dy.
    pub gradient: [Interval; 2],
    /// Of the second derivatives by xx, xy and yy.
    pub hessian: [Interval; 3],
}

/// Bounds of a height field's first and second derivatives over a region, as middles and largest distances from them; the
/// units are those of [`SurfaceJet`](super::SurfaceJet).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ShapeBounds {
    /// Of dh/dx and dh/dy.
    pub(crate) slope: DVec2,
    pub(crate) slope_radius: DVec2,
    /// Of the second derivatives.
    pub(crate) curvature: DMat2,
    pub(crate) curvature_radius: DMat2,
    /// Largest distances from the middle of means of the second derivatives.
    pub(crate) mean_radius: DMat2,
    /// The point in the middle of the region.
    pub(crate) middle: FacePoint,
}

impl ShapeBounds {
    /// The same for the means over any curve in the region.
    pub(crate) fn everywhere(self) -> Self {
        Self { mean_radius: self.curvature_radius, ..self }
    }
}

impl HeightField {
    /// Bounds over `rect`: every evaluation inside gives values between them. A rectangle inside another never has wider
    /// bounds; those of an empty one are empty.
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

    /// Bounds over `rect`, which must not be empty, of the first and second derivatives. Those of [`Self::bounds`] are over
    /// whole cells; these get as narrow as the rectangle does, by the Taylor polynomial about its middle. Along a curve in the
    /// rectangle that is on average within `reach` of its middle, coordinate by coordinate, the means of the second
    /// derivatives are bounded by `mean_radius`.
    #[inline(always)]
    pub(crate) fn shape_bounds(&self, rect: &Rect, reach: DVec2) -> ShapeBounds {
        let half_size = 0.5 * (rect.max - rect.min);
        let cells = half_size * self.density;
        if cells.max_element() > MOST_CELLS {
            let bounds = self.bounds.bounds(&self.cells(rect));
            let JetBounds { gradient: [x, y], hessian, .. } = by_metres(&bounds, self.density);
            let curvature_radius = symmetric(hessian.map(|bounds| 0.5 * (bounds.max - bounds.min)));
            return ShapeBounds {
                slope: 0.5 * DVec2::new(x.min + x.max, y.min + y.max),
                slope_radius: 0.5 * DVec2::new(x.max - x.min, y.max - y.min),
                curvature: symmetric(hessian.map(|bounds| 0.5 * (bounds.min + bounds.max))),
                curvature_radius,
                mean_radius: curvature_radius,
                middle: self.point(rect.centre()),
            };
        }
        // All by the cell coordinates, until the end.
        let place = rect.centre();
        let (cell, middle) = self.cell_jet(place);
        let [xxx, xxy, xyy, yyy] = self.thirds.around(cell, cells.max_element() > 1.0);
        let half_size = cells;
        let [xx, xy, yy] = middle.hessian.map(f64::abs);
        let turned = |DVec2 { x, y }: DVec2| [xxx * x + xxy * y, xxy * x + xyy * y, xyy * x + yyy * y];
        let [turned_xx, turned_xy, turned_yy] = turned(half_size);
        let [mean_xx, mean_xy, mean_yy] = turned(reach * self.density);
        // The mean of the second derivatives on the way to a corner, at most.
        let [xx_there, xy_there, yy_there] = [xx + 0.5 * turned_xx, xy + 0.5 * turned_xy, yy + 0.5 * turned_yy];
        let DVec2 { x, y } = half_size;
        let slope_radius = DVec2::new(xx_there * x + xy_there * y, xy_there * x + yy_there * y);
        let [of_values, of_places] = self.rounding;
        let largest = larger(larger(xxx, xxy), larger(xyy, yyy));
        let slope_rounding = of_values + of_places * (larger(larger(xx, xy), yy) + largest);
        let rounding = of_values + of_places * largest;
        let [by_xx, by_xy, by_yy] = self.squared_density;
        let scaled = |radii: [f64; 3]| {
            let [xx, xy, yy] = radii.map(|radius| radius * (1.0 + 1e-12) + rounding);
            symmetric([xx * by_xx, xy * by_xy, yy * by_yy])
        };
        let [xx, xy, yy] = middle.hessian;
        let gradient = middle.gradient * self.density;
        ShapeBounds {
            middle: FacePoint { place, height: middle.height, gradient },
            slope: gradient,
            slope_radius: (slope_radius * (1.0 + 1e-12) + slope_rounding) * self.density,
            curvature: symmetric([xx * by_xx, xy * by_xy, yy * by_yy]),
            curvature_radius: scaled([turned_xx, turned_xy, turned_yy]),
            mean_radius: scaled([mean_xx, mean_xy, mean_yy]),
        }
    }

    #[inline(always)]
    fn point(&self, place: DVec2) -> FacePoint {
        let (height, gradient) = self.slope(place);
        FacePoint { place, height, gradient }
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

    /// The cells that a rectangle touches. Conservative because [`Self::cell_coordinates`] is monotone, also as rounded.
    #[inline(always)]
    fn cells(&self, rect: &Rect) -> CellRange {
        let cell = |p| cell_of(self.clamped(self.cell_coordinates(p))).map(|i| i as usize);
        CellRange { first: cell(rect.min), last: cell(rect.max) }
    }
}

/// The largest magnitudes of the third derivatives xxx, xxy, xyy and yyy by the cell coordinates around each cell: over it
/// and the 8 cells around it, and over it and the 24 cells around it.
#[derive(Clone, Debug)]
pub(super) struct ThirdDerivatives {
    columns: usize,
    near: Vec<[f32; 4]>,
    wide: Vec<[f32; 4]>,
}

impl ThirdDerivatives {
    /// Of the cells of a padded grid.
    pub(super) fn of_cells(padded: &[f64], grid: [usize; 2]) -> Self {
        let value = bernstein_weights(0.0, 1.0);
        let slope = bernstein_slope_weights(0.0, 1.0);
        let curvature = bernstein_curvature_weights(0.0, 1.0);
        let third = [THIRD_DERIVATIVE_WEIGHTS];
        let cells: Vec<_> = patches(padded, grid)
            .map(|patch| {
                [
                    hull(patch, &tensor(patch, &third, &value)),
                    hull(patch, &tensor(patch, &curvature, &slope)),
                    hull(patch, &tensor(patch, &slope, &curvature)),
                    hull(patch, &tensor(patch, &value, &third)),
                ]
                .map(|bounds| round_up(bounds.magnitude()))
            })
            .collect();
        let columns = grid[0] + 3;
        let near = with_neighbours(&cells, columns);
        Self { columns, wide: with_neighbours(&near, columns), near }
    }

    /// Of the cells at most 1, or at most 2, columns and rows away.
    #[inline(always)]
    fn around(&self, [column, row]: [u32; 2], wide: bool) -> [f64; 4] {
        let cells = if wide { &self.wide } else { &self.near };
        cells[row as usize * self.columns + column as usize].map(f64::from)
    }
}

/// For each cell the largest of each value in it and its neighbours.
fn with_neighbours(cells: &[[f32; 4]], columns: usize) -> Vec<[f32; 4]> {
    let rows = cells.len() / columns;
    let largest = |row: usize, column: usize| {
        let mut largest = [0f32; 4];
        for row in row.saturating_sub(1)..(row + 2).min(rows) {
            for cell in &cells[row * columns + column.saturating_sub(1)..row * columns + (column + 2).min(columns)] {
                largest = std::array::from_fn(|k| largest[k].max(cell[k]));
            }
        }
        largest
    };
    (0..rows).flat_map(|row| (0..columns).map(move |column| largest(row, column))).collect()
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
fn hull<const X: usize, const Y: usize>(patch: Patch<'_>, values: &[[f64; X]; Y]) -> Interval {
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

/// The larger of two numbers, neither of which is NaN.
#[inline(always)]
fn larger(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

/// The symmetric matrix with the entries 11, 12 and 22.
#[inline(always)]
fn symmetric([xx, xy, yy]: [f64; 3]) -> DMat2 {
    DMat2::from_cols(DVec2::new(xx, xy), DVec2::new(xy, yy))
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
mod tests {
    use proptest::prelude::*;

    use super::super::tests::{COLUMNS, ROWS, SIZE, any_point, rough};
    use super::*;
    use crate::geometry::testing::fixed_seed;
    use glam::dvec2;

    fn check_held(
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
        fn shape_bounds_hold_every_evaluation(
            a in any_point(0.8), b in any_point(0.8), inside in prop::collection::vec((0.0..=1.0f64, 0.0..=1.0f64), 64),
            amplitude in prop::sample::select(vec![1e-9, 1e-3, 1.0, 1e6]), size in 0..60i32,
            (columns, rows) in prop::sample::select(vec![(COLUMNS, ROWS), (700, 5)]),
            offset in prop::sample::select(vec![0.0, 1.0]),
        ) {
            let field = rough(columns, rows, amplitude, SIZE);
            let raised = field.coefficients().map(|value| (value + offset) as f32);
            let field = HeightField::new(raised.collect(), columns, rows, SIZE).unwrap();
            let half = 0.5 * (b - a).abs() * libm::exp2(-f64::from(size));
            let rect = Rect::new(a - half, a + half);
            let shape = field.shape_bounds(&rect, half);
            let around = |middle: f64, radius: f64| Interval::new(middle - radius, middle + radius);
            let (curvature, radius) = (shape.curvature, shape.curvature_radius);
            let bounds = JetBounds {
                height: field.bounds(&rect).height,
                gradient: [0, 1].map(|axis| around(shape.slope[axis], shape.slope_radius[axis])),
                hessian: [(0, 0), (0, 1), (1, 1)]
                    .map(|(row, column)| around(curvature.col(column)[row], radius.col(column)[row])),
            };
            check_held(&field, &rect, &bounds, &inside)?;
            // Straight lines from the middle are on average half as far away as their ends.
            let shape = field.shape_bounds(&rect, 0.5 * half);
            for (s, t) in inside {
                let end = dvec2(s, t) * 2.0 - 1.0;
                let steps = 200;
                let mean = (0..steps).map(|k| field.jet(rect.centre() + end * half * (f64::from(k) + 0.5) / f64::from(steps)));
                let mean = mean.fold([0.0; 3], |sum, jet| std::array::from_fn(|k| sum[k] + jet.hessian[k] / f64::from(steps)));
                for (k, (row, column)) in [(0, 0), (0, 1), (1, 1)].into_iter().enumerate() {
                    let off = (mean[k] - shape.curvature.col(column)[row]).abs();
                    prop_assert!(off <= shape.mean_radius.col(column)[row] * (1.0 + 1e-3) + 1e-9 * amplitude);
                }
            }
        }

        #[test]
        fn shape_bounds_shrink_in_proportion_to_a_small_rectangle(p in any_point(0.4)) {
            let field = rough(COLUMNS, ROWS, 1.0, SIZE);
            let radii = |size: f64| {
                let half = 0.5 * size * field.cell_size();
                let bounds = field.shape_bounds(&Rect::new(p - half, p + half), half);
                bounds.slope_radius.to_array().into_iter().chain(bounds.curvature_radius.to_cols_array())
            };
            for (wide, narrow) in radii(0.1).zip(radii(0.001)) {
                prop_assert!(narrow <= wide * 0.011 + 1e-9, "{} {}", narrow, wide);
            }
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
