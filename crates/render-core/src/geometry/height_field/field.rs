//! A height field, and its values and derivatives.

use glam::{DVec2, dvec2};
use thiserror::Error;
use wide::f64x2;

use super::cell_bounds::{self, JetBounds};
use super::patch::{PADDING, Patch, cell_of, pad, patch, tensor};
use super::third_derivatives::ThirdDerivatives;
use crate::geometry::pyramid::Pyramid;
use crate::geometry::spline::{bernstein_slope_weights, bernstein_weights, curvature_weights, slope_weights, weights};

/// A height field and its derivatives up to the second order at one point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceJet {
    /// h, in metres.
    pub height: f64,
    /// dh/dx and dh/dy.
    pub gradient: DVec2,
    /// The second derivatives by xx, xy and yy, in 1/metre.
    pub hessian: [f64; 3],
}

/// Why a grid is no height field.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum HeightFieldError {
    /// A side of the outline is not a positive finite number.
    #[error("a height field of {0} x {1} metres: both sides must be positive and finite")]
    Size(f64, f64),
    /// The grid has no value.
    #[error("a height grid of {columns} x {rows} values: both numbers must be at least 1")]
    Empty {
        /// Values in a row.
        columns: usize,
        /// Rows.
        rows: usize,
    },
    /// The list of values does not fill the grid.
    #[error("a height grid of {columns} x {rows} values cannot be filled with {values} values")]
    Length {
        /// Values in a row.
        columns: usize,
        /// Rows.
        rows: usize,
        /// Values given.
        values: usize,
    },
    /// A value is infinite or not a number.
    #[error("height {value} in column {column}, row {row}: heights must be finite")]
    NotFinite {
        /// Column of the value.
        column: usize,
        /// Row of the value.
        row: usize,
        /// The value.
        value: f32,
    },
}

/// A height field `h(x, y)` over the tangential plane of a pane, in metres; defined on the whole plane.
#[derive(Clone, Debug)]
pub struct HeightField {
    pub(super) size: DVec2,
    pub(super) grid: [usize; 2],
    /// Values per metre.
    pub(super) density: DVec2,
    /// Padded cell coordinate of the origin.
    pub(super) origin: DVec2,
    /// Largest padded cell coordinate that is evaluated.
    pub(super) end: DVec2,
    pub(super) stride: u32,
    pub(super) coefficients: Vec<f64>,
    /// The density's products xx, xy and yy.
    pub(super) squared_density: [f64; 3],
    /// Rounding errors of bounds.
    pub(super) rounding: [f64; 2],
    /// Heights, and their first and second derivatives by the cell coordinates.
    pub(super) bounds: Pyramid,
    pub(super) thirds: ThirdDerivatives,
    /// Bounds over the whole plane.
    pub(super) all: JetBounds,
}

impl HeightField {
    /// The height field over `size` metres with `rows` rows of `columns` spline coefficients in metres.
    ///
    /// # Errors
    /// [`HeightFieldError`] when the size is not positive, the grid is empty or not filled, or a value is not finite.
    pub fn new(coefficients: Vec<f32>, columns: usize, rows: usize, size: DVec2) -> Result<Self, HeightFieldError> {
        if !(size.is_finite() && size.cmpgt(DVec2::ZERO).all()) {
            return Err(HeightFieldError::Size(size.x, size.y));
        }
        if columns == 0 || rows == 0 {
            return Err(HeightFieldError::Empty { columns, rows });
        }
        if columns.checked_mul(rows) != Some(coefficients.len()) {
            return Err(HeightFieldError::Length { columns, rows, values: coefficients.len() });
        }
        if let Some(at) = coefficients.iter().position(|value| !value.is_finite()) {
            let (column, row) = (at % columns, at / columns);
            return Err(HeightFieldError::NotFinite { column, row, value: coefficients[at] });
        }
        // Cells are counted in 32 bits.
        let stride = (columns + 2 * PADDING) as u32;
        let padded = pad(&coefficients, columns, rows);
        let bounds = cell_bounds::of_cells(&padded, [columns, rows]);
        let thirds = ThirdDerivatives::of_cells(&padded, [columns, rows]);
        let grid = dvec2(columns as f64, rows as f64);
        let (density, end) = (grid / size, grid + 2.5);
        Ok(Self {
            size,
            grid: [columns, rows],
            all: cell_bounds::by_metres(&bounds.all(), density),
            density,
            squared_density: [density.x * density.x, density.x * density.y, density.y * density.y],
            origin: (grid + 3.0) * 0.5,
            end,
            rounding: cell_bounds::rounding(&bounds, end),
            stride,
            coefficients: padded,
            bounds,
            thirds,
        })
    }

    /// The field of height zero over `size` metres.
    ///
    /// # Errors
    /// [`HeightFieldError::Size`] when the size is not positive.
    pub fn flat(size: DVec2) -> Result<Self, HeightFieldError> {
        Self::new(vec![0.0], 1, 1, size)
    }

    /// Width and height of the outline in metres.
    #[inline]
    pub fn size(&self) -> DVec2 {
        self.size
    }

    /// Number of columns and rows of the grid.
    pub fn grid(&self) -> [usize; 2] {
        self.grid
    }

    /// Width and height of a cell in metres.
    pub fn cell_size(&self) -> DVec2 {
        self.density.recip()
    }

    /// The spline's coefficients, metres, row by row.
    pub fn coefficients(&self) -> impl Iterator<Item = f64> + '_ {
        let rows = self.coefficients.chunks(self.stride as usize).skip(PADDING).take(self.grid[1]);
        rows.flat_map(|row| row[PADDING..PADDING + self.grid[0]].iter().copied())
    }

    /// The height at `p`, in metres.
    #[inline(always)]
    pub fn height(&self, p: DVec2) -> f64 {
        let (cell, f) = self.locate(p);
        let weights = ByAxis::new(weights(f));
        let [first, second] = columns_sum(&pairs(self.patch(cell)), &weights.y);
        let [a, b] = [weights.x[0] * first, weights.x[1] * second].map(f64x2::to_array);
        (a[0] + a[1]) + (b[0] + b[1])
    }

    /// The height and its gradient at `p`.
    #[inline(always)]
    pub fn slope(&self, p: DVec2) -> (f64, DVec2) {
        let (cell, f) = self.locate(p);
        let patch = pairs(self.patch(cell));
        let (w, d) = (ByAxis::new(weights(f)), ByAxis::new(slope_weights(f)));
        let value = columns_sum(&patch, &w.y);
        let [height, x] = dots([&w.x, &d.x], [&value, &value]);
        let [y, _] = dots([&w.x, &w.x], [&columns_sum(&patch, &d.y), &value]);
        (height, dvec2(x, y) * self.density)
    }

    /// The height and its first and second derivatives at `p`.
    #[inline(always)]
    pub fn jet(&self, p: DVec2) -> SurfaceJet {
        let (cell, f) = self.locate(p);
        let patch = pairs(self.patch(cell));
        let (w, d) = (ByAxis::new(weights(f)), ByAxis::new(slope_weights(f)));
        let c = ByAxis::new(curvature_weights(f));
        let value = columns_sum(&patch, &w.y);
        let along_y = columns_sum(&patch, &d.y);
        let curved_y = columns_sum(&patch, &c.y);
        let [height, x] = dots([&w.x, &d.x], [&value, &value]);
        let [y, xy] = dots([&w.x, &d.x], [&along_y, &along_y]);
        let [xx, yy] = dots([&c.x, &w.x], [&value, &curved_y]);
        let [by_xx, by_xy, by_yy] = self.squared_density;
        SurfaceJet { height, gradient: dvec2(x, y) * self.density, hessian: [xx * by_xx, xy * by_xy, yy * by_yy] }
    }

    /// The padded cell coordinates of `p`: cell (i, j) of the padded grid covers `[i, i + 1] x [j, j + 1]`, and the
    /// surface is constant along an axis below 1 and above n + 2.
    #[inline(always)]
    pub(crate) fn cell_coordinates(&self, p: DVec2) -> DVec2 {
        p * self.density + self.origin
    }

    /// Number of cell coordinates per metre.
    #[inline]
    pub(crate) fn density(&self) -> DVec2 {
        self.density
    }

    /// Bernstein coefficients, row by row, of the height over the rectangle between two points of one cell, given in
    /// padded cell coordinates. The first coefficient belongs to `from`, the last one to `to`.
    pub(crate) fn bernstein(&self, from: DVec2, to: DVec2) -> [[f64; 4]; 4] {
        let (patch, from, to) = self.within_cell(from, to);
        tensor(patch, &bernstein_weights(from.x, to.x), &bernstein_weights(from.y, to.y))
    }

    /// As [`Self::bernstein`], of the derivatives by the two cell coordinates.
    pub(crate) fn bernstein_slopes(&self, from: DVec2, to: DVec2) -> ([[f64; 3]; 4], [[f64; 4]; 3]) {
        let (patch, from, to) = self.within_cell(from, to);
        (
            tensor(patch, &bernstein_slope_weights(from.x, to.x), &bernstein_weights(from.y, to.y)),
            tensor(patch, &bernstein_weights(from.x, to.x), &bernstein_slope_weights(from.y, to.y)),
        )
    }

    /// The control values of the cell in the middle of two points, and both points relative to its start.
    pub(super) fn within_cell(&self, from: DVec2, to: DVec2) -> (Patch<'_>, DVec2, DVec2) {
        let (from, to) = (self.clamped(from), self.clamped(to));
        let cell = cell_of(0.5 * (from + to));
        let corner = dvec2(f64::from(cell[0]), f64::from(cell[1]));
        (self.patch(cell), from - corner, to - corner)
    }

    #[inline(always)]
    fn locate(&self, p: DVec2) -> ([u32; 2], f64x2) {
        let a = self.clamped(self.cell_coordinates(p));
        let cell = cell_of(a);
        (cell, f64x2::new([a.x, a.y]) - f64x2::new(cell.map(f64::from)))
    }

    #[inline(always)]
    pub(super) fn patch(&self, cell: [u32; 2]) -> Patch<'_> {
        patch(&self.coefficients, self.stride, cell)
    }

    /// Cell coordinates, moved to the nearest place where there are coefficients: the surface is constant from there
    /// on.
    #[inline(always)]
    pub(super) fn clamped(&self, a: DVec2) -> DVec2 {
        dvec2(a.x.max(0.0).min(self.end.x), a.y.max(0.0).min(self.end.y))
    }
}

/// Four numbers in pairs of lanes.
type Pairs = [f64x2; 2];

#[inline(always)]
fn pairs(patch: Patch<'_>) -> [Pairs; 4] {
    patch.map(|row| [f64x2::new([row[0], row[1]]), f64x2::new([row[2], row[3]])])
}

/// Weights for the four columns, side by side, and for the four rows, each in both lanes.
struct ByAxis {
    x: Pairs,
    y: [f64x2; 4],
}

impl ByAxis {
    #[inline(always)]
    fn new(weights: [f64x2; 4]) -> Self {
        let [a, b, c, d] = weights;
        let ([first, _], [second, _]) = (f64x2::transpose([a, b]), f64x2::transpose([c, d]));
        Self { x: [first, second], y: weights.map(|weight| f64x2::transpose([weight, weight])[1]) }
    }
}

/// For each column of a patch, the weighted sum along it.
#[inline(always)]
fn columns_sum(patch: &[Pairs; 4], weights: &[f64x2; 4]) -> Pairs {
    let sum = |k: usize| {
        (patch[0][k] * weights[0] + patch[1][k] * weights[1]) + (patch[2][k] * weights[2] + patch[3][k] * weights[3])
    };
    [sum(0), sum(1)]
}

/// Two dot products side by side.
#[inline(always)]
fn dots(a: [&Pairs; 2], b: [&Pairs; 2]) -> [f64; 2] {
    let half = |k: usize| {
        let [even, odd] = f64x2::transpose([a[0][k] * b[0][k], a[1][k] * b[1][k]]);
        even + odd
    };
    (half(0) + half(1)).to_array()
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::geometry::testing::fixed_seed;
    use crate::math::Interval;
    use proptest::prelude::*;

    pub(in super::super) const COLUMNS: usize = 17;
    pub(in super::super) const ROWS: usize = 11;
    pub(in super::super) const SIZE: DVec2 = dvec2(0.6, 0.45);

    /// A grid of heights of at most `amplitude`, without any structure.
    pub(in super::super) fn rough(columns: usize, rows: usize, amplitude: f64, size: DVec2) -> HeightField {
        let values = (0..columns * rows).map(|i| (amplitude * libm::sin((i * i) as f64 * 0.7 + i as f64)) as f32);
        HeightField::new(values.collect(), columns, rows, size).unwrap()
    }

    fn linear(slope: DVec2) -> HeightField {
        let values = (0..COLUMNS * ROWS).map(|i| {
            let u = dvec2(((i % COLUMNS) as f64 + 0.5) / COLUMNS as f64, ((i / COLUMNS) as f64 + 0.5) / ROWS as f64);
            (u - 0.5).dot(slope * SIZE) as f32
        });
        HeightField::new(values.collect(), COLUMNS, ROWS, SIZE).unwrap()
    }

    /// The spline straight from its definition, with clamped indices.
    fn by_definition(values: &[f32], columns: usize, rows: usize, size: DVec2, p: DVec2) -> f64 {
        let tap = |i: i64, n: usize| i.clamp(0, n as i64 - 1) as usize;
        let a = (p / size + 0.5) * dvec2(columns as f64, rows as f64) - 0.5;
        let k = a.floor();
        let weights = weights(f64x2::new((a - k).to_array())).map(f64x2::to_array);
        let [wx, wy] = [0, 1].map(|axis| weights.map(|weight| weight[axis]));
        let mut sum = 0.0;
        for (j, wy) in (0..).zip(wy) {
            for (i, wx) in (0..).zip(wx) {
                let column = tap(k.x as i64 + i - 1, columns);
                let row = tap(k.y as i64 + j - 1, rows);
                sum += wx * wy * f64::from(values[row * columns + column]);
            }
        }
        sum
    }

    pub(in super::super) fn any_point(reach: f64) -> impl Strategy<Value = DVec2> {
        (-reach..reach, -reach..reach).prop_map(|(x, y)| dvec2(x, y) * SIZE)
    }

    #[test]
    fn a_constant_grid_is_a_constant_surface() {
        let field = HeightField::new(vec![0.25; COLUMNS * ROWS], COLUMNS, ROWS, SIZE).unwrap();
        let jet = field.jet(dvec2(0.1, -0.2));
        assert!((jet.height - 0.25).abs() < 1e-15);
        assert!(jet.gradient.length() < 1e-13);
        assert!(jet.hessian.iter().all(|h| h.abs() < 1e-11));
    }

    #[test]
    fn a_linear_grid_is_a_plane_away_from_the_border() {
        let slope = dvec2(0.25, -0.5);
        let field = linear(slope);
        for p in [dvec2(0.0, 0.0), dvec2(0.2, -0.1), dvec2(-0.21, 0.13)] {
            let jet = field.jet(p);
            // The grid is in single precision: relative error 2^-24 of heights of 0.2 m, over cells of 3 to 4 cm.
            assert!((jet.height - slope.dot(p)).abs() < 1.2e-8, "{jet:?}");
            assert!((jet.gradient - slope).abs().max_element() < 1e-6, "{jet:?}");
            assert!(jet.hessian.iter().all(|h| h.abs() < 1e-4), "{jet:?}");
        }
    }

    #[test]
    fn a_grid_of_one_value_is_flat_with_exact_bounds() {
        let field = HeightField::flat(SIZE).unwrap();
        assert_eq!(field.jet(dvec2(0.1, 9.0)), SurfaceJet { height: 0.0, gradient: DVec2::ZERO, hessian: [0.0; 3] });
        let nothing = Interval::new(0.0, 0.0);
        assert_eq!(*field.all_bounds(), JetBounds { height: nothing, gradient: [nothing; 2], hessian: [nothing; 3] });
    }

    #[test]
    fn bad_grids_are_refused() {
        let check = |values: Vec<f32>, columns, rows, size, expected| {
            assert_eq!(HeightField::new(values, columns, rows, size).unwrap_err(), expected);
        };
        check(vec![], 0, 3, SIZE, HeightFieldError::Empty { columns: 0, rows: 3 });
        check(vec![0.0; 5], 2, 3, SIZE, HeightFieldError::Length { columns: 2, rows: 3, values: 5 });
        check(vec![0.0; 5], usize::MAX, 2, SIZE, HeightFieldError::Length { columns: usize::MAX, rows: 2, values: 5 });
        check(vec![0.0; 6], 2, 3, dvec2(0.0, 1.0), HeightFieldError::Size(0.0, 1.0));
        check(vec![0.0; 6], 2, 3, dvec2(1.0, f64::INFINITY), HeightFieldError::Size(1.0, f64::INFINITY));
        let infinite = HeightFieldError::NotFinite { column: 1, row: 2, value: f32::INFINITY };
        check(vec![0.0, 0.0, 0.0, 0.0, 0.0, f32::INFINITY], 2, 3, SIZE, infinite);
    }

    #[test]
    fn the_surface_is_twice_continuously_differentiable_across_cells() {
        let field = rough(COLUMNS, ROWS, 1.0, SIZE);
        for i in -4..COLUMNS as i32 + 4 {
            let x = ((f64::from(i) + 0.5) / COLUMNS as f64 - 0.5) * SIZE.x;
            let step = 1e-12;
            let (before, after) = (field.jet(dvec2(x - step, 0.03)), field.jet(dvec2(x + step, 0.03)));
            // Third derivatives are at most 8 / cell^3 = 2e5, so 2e-12 m change the second ones by 4e-7.
            assert!((before.height - after.height).abs() < 1e-9);
            assert!((before.gradient - after.gradient).length() < 1e-7);
            for k in 0..3 {
                assert!((before.hessian[k] - after.hessian[k]).abs() < 1e-5, "{before:?} {after:?}");
            }
        }
    }

    proptest! {
        #![proptest_config(fixed_seed(256))]

        #[test]
        fn evaluation_agrees_with_the_definition(p in any_point(0.8), columns in 1usize..7, rows in 1usize..7) {
            let values: Vec<f32> = (0..columns * rows).map(|i| libm::sin(i as f64 * 1.9 + 0.3) as f32).collect();
            let expected = by_definition(&values, columns, rows, SIZE, p);
            let field = HeightField::new(values, columns, rows, SIZE).unwrap();
            prop_assert!((field.height(p) - expected).abs() < 1e-14);
        }

        #[test]
        fn all_forms_of_evaluation_agree(p in any_point(0.7)) {
            let field = rough(COLUMNS, ROWS, 1.0, SIZE);
            let jet = field.jet(p);
            prop_assert_eq!(field.height(p), jet.height);
            prop_assert_eq!(field.slope(p), (jet.height, jet.gradient));
        }

        #[test]
        fn derivatives_agree_with_central_differences(p in any_point(0.6)) {
            let field = rough(COLUMNS, ROWS, 1.0, SIZE);
            let jet = field.jet(p);
            let cell = field.cell_size();
            // Steps of 1e-4 cells: truncation 1e-8 / 6 of the third derivative (below 8 per cell), rounding 1e-16 /
            // 1e-4.
            let step = 1e-4;
            let tolerance = 1.5e-8;
            for (axis, direction) in [dvec2(cell.x, 0.0), dvec2(0.0, cell.y)].into_iter().enumerate() {
                let (before, after) = (field.jet(p - direction * step), field.jet(p + direction * step));
                let slope = (after.height - before.height) / (2.0 * step);
                prop_assert!((slope - jet.gradient.dot(direction)).abs() < tolerance);
                let turn = (after.gradient - before.gradient) * cell / (2.0 * step);
                let row = [
                    jet.hessian[axis] * cell[axis] * cell.x,
                    jet.hessian[axis + 1] * cell[axis] * cell.y,
                ];
                // The third derivative jumps at cell borders, so the difference is only of first order there.
                prop_assert!((turn.x - row[0]).abs() < 8.0 * step && (turn.y - row[1]).abs() < 8.0 * step);
            }
        }
    }
}
