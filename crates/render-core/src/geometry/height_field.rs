//! The displacement of one face of a pane: a uniform cubic tensor-product B-spline over a grid of heights.
//!
//! The grid values are the spline's *coefficients*: the surface approximates them and is C2 everywhere. Value (i, j) sits
//! at `u = (i + 1/2) / columns`, `v = (j + 1/2) / rows`, where `u = x / width + 1/2` and `v = y / height + 1/2` run over the
//! outline from 0 to 1; row 0 is at the smallest v. Beyond the grid the outermost values repeat, so the surface goes on
//! smoothly past the outline and becomes constant two values further out.
//!
//! A *cell* is the square between four neighbouring values, on which the surface is one bicubic polynomial. Bounds come
//! from the Bernstein coefficients of these polynomials in a min-max pyramid.

use glam::{DVec2, dvec2};
use thiserror::Error;

use super::pyramid::{CellRange, Pyramid, round_up};
use super::spline::{
    THIRD_DERIVATIVE_WEIGHTS, bernstein_curvature_weights, bernstein_slope_weights, bernstein_weights,
    curvature_weights, slope_weights, weights,
};
use super::{Interval, Rect};

/// Copies of the outermost value on each side of the grid: with these, the cells from -2 to n read their taps without
/// clamping, and the outermost of them are constant.
const PADDING: usize = 3;

/// Over rectangles with larger half sides, in cells, the Taylor polynomial's remainder is wider than the hull of the cells.
const HALF_A_CELL: f64 = 0.5;

/// Rounding error of an evaluation and of a cell's Bernstein coefficients, relative to the largest coefficient that
/// enters it: sums of 16 products of weights with an error of a few units in the last place each.
const ROUNDING: f64 = 32.0 * f64::EPSILON;

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

/// Bounds of a height field and of its derivatives over a region; the units are those of [`SurfaceJet`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JetBounds {
    /// Of h.
    pub height: Interval,
    /// Of dh/dx and dh/dy.
    pub gradient: [Interval; 2],
    /// Of the second derivatives by xx, xy and yy.
    pub hessian: [Interval; 3],
}

/// Bounds of a height field's first and second derivatives over a region; the units are those of [`SurfaceJet`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ShapeBounds {
    /// Of dh/dx and dh/dy.
    pub(crate) gradient: [Interval; 2],
    /// Of the second derivatives by xx, xy and yy.
    pub(crate) hessian: [Interval; 3],
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
    size: DVec2,
    grid: [usize; 2],
    /// Values per metre.
    density: DVec2,
    /// Padded cell coordinate of the origin.
    origin: DVec2,
    /// Largest padded cell coordinate that is evaluated.
    end: DVec2,
    stride: usize,
    coefficients: Vec<f64>,
    /// Heights, and their first and second derivatives by the cell coordinates.
    bounds: Pyramid,
    /// For each cell, the largest magnitudes of the third derivatives xxx, xxy, xyy and yyy by the cell coordinates.
    thirds: Vec<[f32; 4]>,
    /// Bounds over the whole plane.
    all: JetBounds,
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
        let stride = columns + 2 * PADDING;
        let padded = pad(&coefficients, columns, rows);
        let (value, slope) = (bernstein_weights(0.0, 1.0), bernstein_slope_weights(0.0, 1.0));
        let curvature = bernstein_curvature_weights(0.0, 1.0);
        let bounds = patches(&padded, [columns, rows]).map(|patch| {
            [
                hull(patch, &tensor(patch, &value, &value)),
                hull(patch, &tensor(patch, &slope, &value)),
                hull(patch, &tensor(patch, &value, &slope)),
                hull(patch, &tensor(patch, &curvature, &value)),
                hull(patch, &tensor(patch, &slope, &slope)),
                hull(patch, &tensor(patch, &value, &curvature)),
            ]
        });
        let bounds = Pyramid::new(columns + 3, rows + 3, bounds);
        let third = [THIRD_DERIVATIVE_WEIGHTS];
        let thirds = patches(&padded, [columns, rows]).map(|patch| {
            [
                hull(patch, &tensor(patch, &third, &value)),
                hull(patch, &tensor(patch, &curvature, &slope)),
                hull(patch, &tensor(patch, &slope, &curvature)),
                hull(patch, &tensor(patch, &value, &third)),
            ]
            .map(|bounds| round_up(bounds.magnitude()))
        });
        let thirds = thirds.collect();
        let grid = dvec2(columns as f64, rows as f64);
        let density = grid / size;
        Ok(Self {
            size,
            grid: [columns, rows],
            all: jet_bounds(&bounds.all(), density),
            density,
            origin: (grid + 3.0) * 0.5,
            end: grid + 2.5,
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
        let rows = self.coefficients.chunks(self.stride).skip(PADDING).take(self.grid[1]);
        rows.flat_map(|row| row[PADDING..PADDING + self.grid[0]].iter().copied())
    }

    /// The height at `p`, in metres.
    #[inline]
    pub fn height(&self, p: DVec2) -> f64 {
        let (patch, f) = self.locate(p);
        dot(&weights(f.x), &columns_sum(patch, &weights(f.y)))
    }

    /// The height and its gradient at `p`.
    #[inline]
    pub fn slope(&self, p: DVec2) -> (f64, DVec2) {
        let (patch, f) = self.locate(p);
        let wx = weights(f.x);
        let value = columns_sum(patch, &weights(f.y));
        let along_y = columns_sum(patch, &slope_weights(f.y));
        let [height, x] = dots([&wx, &slope_weights(f.x)], [&value, &value]);
        (height, dvec2(x, dot(&wx, &along_y)) * self.density)
    }

    /// The height and its first and second derivatives at `p`.
    #[inline]
    pub fn jet(&self, p: DVec2) -> SurfaceJet {
        let (patch, f) = self.locate(p);
        let (wx, dx) = (weights(f.x), slope_weights(f.x));
        let value = columns_sum(patch, &weights(f.y));
        let along_y = columns_sum(patch, &slope_weights(f.y));
        let curved_y = columns_sum(patch, &curvature_weights(f.y));
        let [height, x] = dots([&wx, &dx], [&value, &value]);
        let [y, xy] = dots([&wx, &dx], [&along_y, &along_y]);
        let [xx, yy] = dots([&curvature_weights(f.x), &wx], [&value, &curved_y]);
        let density = self.density;
        SurfaceJet {
            height,
            gradient: dvec2(x, y) * density,
            hessian: [xx * (density.x * density.x), xy * (density.x * density.y), yy * (density.y * density.y)],
        }
    }

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
        jet_bounds(&self.bounds.bounds(&self.cells(rect)), self.density)
    }

    /// Bounds over `rect`, which must not be empty, of the first and second derivatives. Those of [`Self::bounds`] are over
    /// whole cells; these get as narrow as the rectangle does, by the Taylor polynomial about its middle.
    pub(crate) fn shape_bounds(&self, rect: &Rect) -> ShapeBounds {
        let half_size = 0.5 * (rect.max - rect.min);
        let cells = self.cells(rect);
        if (half_size * self.density).max_element() > HALF_A_CELL {
            let JetBounds { gradient, hessian, .. } = jet_bounds(&self.bounds.bounds(&cells), self.density);
            return ShapeBounds { gradient, hessian };
        }
        let mut thirds = [0f32; 4];
        for row in cells.first[1]..=cells.last[1] {
            let start = row * (self.grid[0] + 3);
            for cell in &self.thirds[start + cells.first[0]..=start + cells.last[0]] {
                thirds = std::array::from_fn(|k| thirds[k].max(cell[k]));
            }
        }
        let [xxx, xxy, xyy, yyy] = thirds.map(f64::from);
        let DVec2 { x: dx, y: dy } = self.density;
        let DVec2 { x, y } = half_size * self.density;
        let middle = self.jet(rect.centre());
        let [xx, xy, yy] = middle.hessian.map(f64::abs);
        let second_order =
            [0.5 * (xxx * x * x + xyy * y * y) + xxy * x * y, 0.5 * (xxy * x * x + yyy * y * y) + xyy * x * y];
        // Rounding, by the cell coordinates: of sums of coefficients, which may all be far from zero, and of the cell
        // coordinates themselves, which moves a point by a little of a cell.
        let of_sums = 2.0 * ROUNDING * self.all.height.magnitude();
        let moved = 4.0 * f64::EPSILON * self.end.max_element();
        let [xx_cell, xy_cell, yy_cell] = [xx / (dx * dx), xy / (dx * dy), yy / (dy * dy)];
        let around = |middle: f64, radius: f64, steepness: f64, scale: f64| {
            let radius = radius * (1.0 + 1e-12) + (of_sums + moved * steepness) * scale;
            Interval::new(middle - radius, middle + radius)
        };
        let [slope_x, slope_y] = [xx_cell * x + xy_cell * y, xy_cell * x + yy_cell * y];
        let largest = xxx.max(xxy).max(xyy).max(yyy);
        let bent = xx_cell.max(xy_cell).max(yy_cell) + largest;
        ShapeBounds {
            gradient: [
                around(middle.gradient.x, (slope_x + second_order[0]) * dx, bent, dx),
                around(middle.gradient.y, (slope_y + second_order[1]) * dy, bent, dy),
            ],
            hessian: [
                around(middle.hessian[0], (xxx * x + xxy * y) * dx * dx, largest, dx * dx),
                around(middle.hessian[1], (xxy * x + xyy * y) * dx * dy, largest, dx * dy),
                around(middle.hessian[2], (xyy * x + yyy * y) * dy * dy, largest, dy * dy),
            ],
        }
    }

    /// Bounds of dh/dx and dh/dy over `rect`, which must not be empty, as in [`Self::bounds`].
    #[inline]
    pub(crate) fn slope_bounds(&self, rect: &Rect) -> [Interval; 2] {
        let [x, y] = self.bounds.slopes(&self.cells(rect));
        [scaled(x, self.density.x), scaled(y, self.density.y)]
    }

    /// Bounds over the whole plane.
    #[inline]
    pub fn all_bounds(&self) -> &JetBounds {
        &self.all
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
    fn within_cell(&self, from: DVec2, to: DVec2) -> (Patch<'_>, DVec2, DVec2) {
        let (from, to) = (self.clamped(from), self.clamped(to));
        let cell = cell_of(0.5 * (from + to));
        let corner = dvec2(f64::from(cell[0]), f64::from(cell[1]));
        (self.patch(cell), from - corner, to - corner)
    }

    #[inline(always)]
    fn locate(&self, p: DVec2) -> (Patch<'_>, DVec2) {
        let a = self.clamped(self.cell_coordinates(p));
        let cell = cell_of(a);
        (self.patch(cell), dvec2(a.x - f64::from(cell[0]), a.y - f64::from(cell[1])))
    }

    #[inline(always)]
    fn patch(&self, [column, row]: [u32; 2]) -> Patch<'_> {
        patch(&self.coefficients, self.stride, row as usize * self.stride + column as usize)
    }

    /// Cell coordinates, moved to the nearest place where there are coefficients: the surface is constant from there on.
    #[inline(always)]
    fn clamped(&self, a: DVec2) -> DVec2 {
        dvec2(a.x.max(0.0).min(self.end.x), a.y.max(0.0).min(self.end.y))
    }

    /// The cells that a rectangle touches. Conservative because [`Self::cell_coordinates`] is monotone, also as rounded.
    #[inline(always)]
    fn cells(&self, rect: &Rect) -> CellRange {
        let cell = |p| cell_of(self.clamped(self.cell_coordinates(p))).map(|i| i as usize);
        CellRange { first: cell(rect.min), last: cell(rect.max) }
    }
}

/// The cell of clamped cell coordinates.
#[inline(always)]
fn cell_of(a: DVec2) -> [u32; 2] {
    [a.x as u32, a.y as u32]
}

/// The 4 x 4 coefficients that control a cell, row by row.
type Patch<'a> = [&'a [f64; 4]; 4];

#[inline(always)]
fn patch(coefficients: &[f64], stride: usize, start: usize) -> Patch<'_> {
    let block = &coefficients[start..start + 3 * stride + 4];
    let row = |j: usize| block[j * stride..].first_chunk().expect("the block ends with a row of four");
    [row(0), row(1), row(2), row(3)]
}

#[inline(always)]
fn columns_sum(patch: Patch<'_>, weights: &[f64; 4]) -> [f64; 4] {
    let mut sum = [0.0; 4];
    for (i, sum) in sum.iter_mut().enumerate() {
        *sum = (patch[0][i] * weights[0] + patch[1][i] * weights[1])
            + (patch[2][i] * weights[2] + patch[3][i] * weights[3]);
    }
    sum
}

/// Two dot products side by side.
#[inline(always)]
fn dots(a: [&[f64; 4]; 2], b: [&[f64; 4]; 2]) -> [f64; 2] {
    let mut sums = [0.0; 2];
    for (lane, sum) in sums.iter_mut().enumerate() {
        *sum = dot(a[lane], b[lane]);
    }
    sums
}

#[inline(always)]
fn dot(a: &[f64; 4], b: &[f64; 4]) -> f64 {
    (a[0] * b[0] + a[1] * b[1]) + (a[2] * b[2] + a[3] * b[3])
}

fn pad(coefficients: &[f32], columns: usize, rows: usize) -> Vec<f64> {
    let mut padded = Vec::with_capacity((columns + 2 * PADDING) * (rows + 2 * PADDING));
    for row in 0..rows + 2 * PADDING {
        let line = row.saturating_sub(PADDING).min(rows - 1) * columns;
        for column in 0..columns + 2 * PADDING {
            padded.push(f64::from(coefficients[line + column.saturating_sub(PADDING).min(columns - 1)]));
        }
    }
    padded
}

/// The patch in another basis on each axis.
#[inline(always)]
fn tensor<const X: usize, const Y: usize>(
    patch: Patch<'_>,
    along_x: &[[f64; 4]; X],
    along_y: &[[f64; 4]; Y],
) -> [[f64; X]; Y] {
    along_y.map(|wy| {
        let line = columns_sum(patch, &wy);
        along_x.map(|wx| dot(&wx, &line))
    })
}

/// The patches of all cells of a padded grid, row by row: `columns + 3` times `rows + 3`.
fn patches(padded: &[f64], [columns, rows]: [usize; 2]) -> impl Iterator<Item = Patch<'_>> {
    let stride = columns + 2 * PADDING;
    let cells = (0..rows + 3).flat_map(move |row| (0..columns + 3).map(move |column| row * stride + column));
    cells.map(move |start| patch(padded, stride, start))
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

/// Bounds by cell coordinates as bounds by metres.
#[inline(always)]
fn jet_bounds(&[height, x, y, xx, xy, yy]: &[Interval; 6], density: DVec2) -> JetBounds {
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
    use super::*;
    use crate::geometry::testing::fixed_seed;
    use proptest::prelude::*;

    const COLUMNS: usize = 17;
    const ROWS: usize = 11;
    const SIZE: DVec2 = dvec2(0.6, 0.45);

    /// A grid of heights of at most `amplitude`, without any structure.
    fn rough(columns: usize, rows: usize, amplitude: f64, size: DVec2) -> HeightField {
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
        let (wx, wy) = (weights(a.x - k.x), weights(a.y - k.y));
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

    fn any_point(reach: f64) -> impl Strategy<Value = DVec2> {
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
            // Steps of 1e-4 cells: truncation 1e-8 / 6 of the third derivative (below 8 per cell), rounding 1e-16 / 1e-4.
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
            let ShapeBounds { gradient, hessian } = field.shape_bounds(&rect);
            let height = field.bounds(&rect).height;
            check_held(&field, &rect, &JetBounds { height, gradient, hessian }, &inside)?;
        }

        #[test]
        fn shape_bounds_shrink_in_proportion_to_a_small_rectangle(p in any_point(0.4)) {
            let field = rough(COLUMNS, ROWS, 1.0, SIZE);
            let width = |size: f64| {
                let half = 0.5 * size * field.cell_size();
                let bounds = field.shape_bounds(&Rect::new(p - half, p + half));
                let width = |i: Interval| i.max - i.min;
                (bounds.gradient.map(width), bounds.hessian.map(width))
            };
            let ((wide_slopes, wide), (narrow_slopes, narrow)) = (width(0.1), width(0.001));
            for (wide, narrow) in wide_slopes.into_iter().chain(wide).zip(narrow_slopes.into_iter().chain(narrow)) {
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

    #[test]
    fn an_empty_rectangle_has_empty_bounds() {
        let field = rough(COLUMNS, ROWS, 1.0, SIZE);
        assert!(field.bounds(&Rect::new(dvec2(0.1, 0.0), dvec2(0.0, 0.1))).height.is_empty());
    }
}
