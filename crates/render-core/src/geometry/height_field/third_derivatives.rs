//! How much the second derivatives of a height field change around each cell.

use super::cell_bounds::hull;
use super::patch::{patches, tensor};
use crate::geometry::pyramid::round_up;
use crate::geometry::spline::{
    THIRD_DERIVATIVE_WEIGHTS, bernstein_curvature_weights, bernstein_slope_weights, bernstein_weights,
};
use crate::math::simd::{Instructions, LANES, Lanes, Lanes2, Mask};

/// Four symmetric matrices.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Symmetric<S> {
    pub(crate) xx: Lanes<S>,
    pub(crate) xy: Lanes<S>,
    pub(crate) yy: Lanes<S>,
}

impl<S: Instructions> Symmetric<S> {
    #[inline(always)]
    pub(crate) fn abs(self) -> Self {
        Self { xx: self.xx.abs(), xy: self.xy.abs(), yy: self.yy.abs() }
    }

    #[inline(always)]
    pub(crate) fn plus(self, other: Self) -> Self {
        Self { xx: self.xx + other.xx, xy: self.xy + other.xy, yy: self.yy + other.yy }
    }

    /// The largest entry.
    #[inline(always)]
    pub(crate) fn largest(self) -> Lanes<S> {
        self.xx.max(self.xy).max(self.yy)
    }

    #[inline(always)]
    pub(super) fn scaled(self, factor: f64) -> Self {
        self.by_metres([factor; 3])
    }

    #[inline(always)]
    pub(super) fn increased(self, by: Lanes<S>) -> Self {
        self.plus(Self { xx: by, xy: by, yy: by })
    }

    /// Each entry times the density's product.
    #[inline(always)]
    pub(super) fn by_metres(self, [xx, xy, yy]: [f64; 3]) -> Self {
        Self { xx: self.xx * xx, xy: self.xy * xy, yy: self.yy * yy }
    }

    #[inline(always)]
    pub(super) fn where_or(self, mask: Mask<S>, other: Self) -> Self {
        Self {
            xx: mask.select(self.xx, other.xx),
            xy: mask.select(self.xy, other.xy),
            yy: mask.select(self.yy, other.yy),
        }
    }
}

/// The largest magnitudes of the third derivatives xxx, xxy, xyy and yyy by the cell coordinates around each cell: over
/// it and the 8 cells around it, and over it and the 24 cells around it.
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

    /// Of the cells at most 1, or where `wide` at most 2, columns and rows away.
    #[inline(always)]
    pub(super) fn around<S: Instructions>(&self, simd: S, cells: &[[u32; 2]; LANES], wide: Mask<S>) -> Thirds<S> {
        let wide = wide.to_array();
        let all = [
            self.at(cells[0], wide[0]),
            self.at(cells[1], wide[1]),
            self.at(cells[2], wide[2]),
            self.at(cells[3], wide[3]),
        ];
        Thirds {
            xxx: entry(simd, &all, 0),
            xxy: entry(simd, &all, 1),
            xyy: entry(simd, &all, 2),
            yyy: entry(simd, &all, 3),
        }
    }

    #[inline(always)]
    pub(super) fn at(&self, [column, row]: [u32; 2], wide: bool) -> &[f32; 4] {
        let cells = if wide { &self.wide } else { &self.near };
        &cells[row as usize * self.columns + column as usize]
    }
}

#[inline(always)]
fn entry<S: Instructions>(simd: S, [a, b, c, d]: &[&[f32; 4]; LANES], entry: usize) -> Lanes<S> {
    let [a, b, c, d] = [a[entry], b[entry], c[entry], d[entry]];
    Lanes::new(simd, [f64::from(a), f64::from(b), f64::from(c), f64::from(d)])
}

/// Magnitudes of four times the third derivatives by the cell coordinates.
pub(super) struct Thirds<S> {
    xxx: Lanes<S>,
    xxy: Lanes<S>,
    xyy: Lanes<S>,
    yyy: Lanes<S>,
}

impl<S: Instructions> Thirds<S> {
    /// By how much second derivatives change, at most, over such distances.
    #[inline(always)]
    pub(super) fn times(&self, Lanes2 { x, y }: Lanes2<S>) -> Symmetric<S> {
        Symmetric { xx: self.xxx * x + self.xxy * y, xy: self.xxy * x + self.xyy * y, yy: self.xyy * x + self.yyy * y }
    }

    #[inline(always)]
    pub(super) fn largest(&self) -> Lanes<S> {
        self.xxx.max(self.xxy).max(self.xyy.max(self.yyy))
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
