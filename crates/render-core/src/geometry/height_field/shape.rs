//! Slopes and curvatures of a height field over four rectangles at once: at the middle, with bounds of their deviation
//! elsewhere. The bounds come from the Taylor polynomial about the middle, with the cells' third derivatives as
//! remainder.

use glam::DVec2;

use super::cell_bounds::{JetBounds, by_metres};
use super::field::HeightField;
use super::patch::{Patch, cell_of};
use super::third_derivatives::Symmetric;
use crate::geometry::spline::{curvature_weights, slope_weights, weights};
use crate::math::simd::{Instructions, LANES, LaneRects, Lanes, Lanes2, Mask};

/// Over rectangles with larger half sides, in cells, the Taylor polynomial's remainder is wider than the hull of the
/// cells. Smaller ones touch no cell more than two columns and rows from that of their middle.
const MOST_CELLS: f64 = 2.0;

/// By how much sums of radii are enlarged against their own rounding, relative.
const ROOM: f64 = 1.0 + 1e-12;

/// Four points of a height field.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FacePoints<S> {
    /// Their tangential coordinates.
    pub(crate) place: Lanes2<S>,
    /// h, in metres.
    pub(crate) height: Lanes<S>,
    /// dh/dx and dh/dy.
    pub(crate) gradient: Lanes2<S>,
}

/// Bounds of a height field's first and second derivatives over four regions, as middles and largest distances from
/// them; the units are those of [`SurfaceJet`](super::SurfaceJet).
#[derive(Clone, Copy, Debug)]
pub(crate) struct ShapeBounds<S> {
    /// Of dh/dx and dh/dy.
    pub(crate) slope: Lanes2<S>,
    pub(crate) slope_radius: Lanes2<S>,
    /// Of the second derivatives.
    pub(crate) curvature: Symmetric<S>,
    pub(crate) curvature_radius: Symmetric<S>,
    /// Largest distances from the middle of means of the second derivatives.
    pub(crate) mean_radius: Symmetric<S>,
    /// The points in the middle of the regions.
    pub(crate) middle: FacePoints<S>,
}

/// Where four points lie: their cells, and how far along these.
struct Located<S> {
    cells: [[u32; 2]; LANES],
    along: Lanes2<S>,
}

/// The coefficients that control four cells.
struct Patches<'a>([Patch<'a>; LANES]);

impl<S: Instructions> ShapeBounds<S> {
    /// The same for the means over any curve in the region.
    #[inline(always)]
    pub(crate) fn everywhere(self) -> Self {
        Self { mean_radius: self.curvature_radius, ..self }
    }

    /// These where `mask` holds, and `others` elsewhere; the middles stay.
    #[inline(always)]
    fn where_or(self, mask: Mask<S>, others: Self) -> Self {
        Self {
            slope: mask.select2(self.slope, others.slope),
            slope_radius: mask.select2(self.slope_radius, others.slope_radius),
            curvature: self.curvature.where_or(mask, others.curvature),
            curvature_radius: self.curvature_radius.where_or(mask, others.curvature_radius),
            mean_radius: self.mean_radius.where_or(mask, others.mean_radius),
            middle: self.middle,
        }
    }
}

impl HeightField {
    /// Bounds over four rectangles, of which the `live` ones must not be empty, of the first and second derivatives.
    /// Those of [`Self::bounds`] are over whole cells; these get as narrow as the rectangle does. Along a curve in a
    /// rectangle that is on average within `reach` of its middle, coordinate by coordinate, the means of the second
    /// derivatives are bounded by `mean_radius`.
    #[inline(always)]
    pub(crate) fn shape_bounds<S: Instructions>(
        &self,
        rects: LaneRects<S>,
        reach: Lanes2<S>,
        live: Mask<S>,
    ) -> ShapeBounds<S> {
        let simd = reach.x.simd();
        // All by the cell coordinates, until the end.
        let half_size = rects.half_size() * self.density;
        let larger_side = half_size.max_element();
        let place = rects.centre();
        let located = self.locate_all(place);
        let patches = self.patches_at(&located);
        let wide = Lanes::splat(simd, 1.0).less_than(larger_side);
        let thirds = self.thirds.around(simd, &located.cells, wide);

        let Lanes2 { x: along_x, y: along_y } = located.along;
        let (values, slopes) = (weights(along_y), slope_weights(along_y));
        let value = patches.weighted(simd, &values);
        let slope = patches.weighted(simd, &slopes);
        let curved = patches.weighted(simd, &curvature_weights(along_y));
        let (values, slopes) = (weights(along_x), slope_weights(along_x));
        let (height, x, xx) = (dot(&value, &values), dot(&value, &slopes), dot(&value, &curvature_weights(along_x)));
        let (y, xy, yy) = (dot(&slope, &values), dot(&slope, &slopes), dot(&curved, &values));

        let size = Symmetric { xx, xy, yy }.abs();
        let turned = thirds.times(half_size);
        // The mean of the second derivatives on the way to a corner, at most.
        let there = size.plus(turned.scaled(0.5));
        let slope_radius = Lanes2 {
            x: there.xx * half_size.x + there.xy * half_size.y,
            y: there.xy * half_size.x + there.yy * half_size.y,
        };
        let [of_values, of_places] = self.rounding;
        let largest = thirds.largest();
        let slope_rounding = (size.largest() + largest) * of_places + of_values;
        let rounding = largest * of_places + of_values;
        let gradient = Lanes2 { x, y } * self.density;
        let slope_radius =
            Lanes2 { x: slope_radius.x * ROOM + slope_rounding, y: slope_radius.y * ROOM + slope_rounding };
        let shape = ShapeBounds {
            slope: gradient,
            slope_radius: slope_radius * self.density,
            curvature: Symmetric { xx, xy, yy }.by_metres(self.squared_density),
            curvature_radius: turned.scaled(ROOM).increased(rounding).by_metres(self.squared_density),
            mean_radius: thirds
                .times(reach * self.density)
                .scaled(ROOM)
                .increased(rounding)
                .by_metres(self.squared_density),
            middle: FacePoints { place, height, gradient },
        };
        let too_large = Lanes::splat(simd, MOST_CELLS).less_than(larger_side).and(live);
        if too_large.any() { self.shapes_of_cells(rects, too_large, shape).where_or(too_large, shape) } else { shape }
    }

    /// Bounds over the cells that rectangles touch, where `mask` asks for them.
    fn shapes_of_cells<S: Instructions>(
        &self,
        rects: LaneRects<S>,
        mask: Mask<S>,
        shape: ShapeBounds<S>,
    ) -> ShapeBounds<S> {
        let simd = rects.min.x.simd();
        let rects = rects.to_array();
        let asked = mask.to_array();
        // Middles and radii of x, y, xx, xy and yy, lane by lane.
        let mut quantities = [[[0.0; LANES]; 2]; 5];
        for lane in (0..LANES).filter(|&lane| asked[lane]) {
            let bounds = self.bounds.bounds(&self.cells(&rects[lane]));
            let JetBounds { gradient: [x, y], hessian: [xx, xy, yy], .. } = by_metres(&bounds, self.density);
            for ([middles, radii], bounds) in quantities.iter_mut().zip([x, y, xx, xy, yy]) {
                middles[lane] = 0.5 * (bounds.min + bounds.max);
                radii[lane] = 0.5 * (bounds.max - bounds.min);
            }
        }
        let [[x, y, xx, xy, yy], radii] =
            [0, 1].map(|kind| quantities.map(|quantity| Lanes::new(simd, quantity[kind])));
        let curvature_radius = Symmetric { xx: radii[2], xy: radii[3], yy: radii[4] };
        ShapeBounds {
            slope: Lanes2 { x, y },
            slope_radius: Lanes2 { x: radii[0], y: radii[1] },
            curvature: Symmetric { xx, xy, yy },
            curvature_radius,
            mean_radius: curvature_radius,
            middle: shape.middle,
        }
    }

    /// Heights and gradients at four points.
    #[inline(always)]
    pub(crate) fn points<S: Instructions>(&self, place: Lanes2<S>) -> FacePoints<S> {
        let simd = place.x.simd();
        let located = self.locate_all(place);
        let patches = self.patches_at(&located);
        let Lanes2 { x: along_x, y: along_y } = located.along;
        let value = patches.weighted(simd, &weights(along_y));
        let slope = patches.weighted(simd, &slope_weights(along_y));
        let values = weights(along_x);
        let (height, x, y) = (dot(&value, &values), dot(&value, &slope_weights(along_x)), dot(&slope, &values));
        FacePoints { place, height, gradient: Lanes2 { x, y } * self.density }
    }

    #[inline(always)]
    fn locate_all<S: Instructions>(&self, place: Lanes2<S>) -> Located<S> {
        let simd = place.x.simd();
        let coordinates = place * self.density + self.origin;
        let coordinates = Lanes2::splat(simd, DVec2::ZERO).max(coordinates).min(Lanes2::splat(simd, self.end));
        let [a, b, c, d] = coordinates.to_array();
        let cells = [cell_of(a), cell_of(b), cell_of(c), cell_of(d)];
        let corners = [corner(cells[0]), corner(cells[1]), corner(cells[2]), corner(cells[3])];
        Located { cells, along: coordinates - Lanes2::new(simd, corners) }
    }

    #[inline(always)]
    fn patches_at<S>(&self, located: &Located<S>) -> Patches<'_> {
        let [a, b, c, d] = located.cells;
        Patches([self.patch(a), self.patch(b), self.patch(c), self.patch(d)])
    }
}

impl Patches<'_> {
    /// For each column, the weighted sum along it.
    #[inline(always)]
    fn weighted<S: Instructions>(&self, simd: S, weights: &[Lanes<S>; 4]) -> [Lanes<S>; 4] {
        [
            dot(&self.column(simd, 0), weights),
            dot(&self.column(simd, 1), weights),
            dot(&self.column(simd, 2), weights),
            dot(&self.column(simd, 3), weights),
        ]
    }

    #[inline(always)]
    fn column<S: Instructions>(&self, simd: S, column: usize) -> [Lanes<S>; 4] {
        [self.taps(simd, 0, column), self.taps(simd, 1, column), self.taps(simd, 2, column), self.taps(simd, 3, column)]
    }

    #[inline(always)]
    fn taps<S: Instructions>(&self, simd: S, row: usize, column: usize) -> Lanes<S> {
        let [a, b, c, d] = &self.0;
        Lanes::new(simd, [a[row][column], b[row][column], c[row][column], d[row][column]])
    }
}

#[inline(always)]
fn corner([column, row]: [u32; 2]) -> DVec2 {
    DVec2::new(f64::from(column), f64::from(row))
}

#[inline(always)]
fn dot<S: Instructions>(taps: &[Lanes<S>; 4], weights: &[Lanes<S>; 4]) -> Lanes<S> {
    (taps[0] * weights[0] + taps[1] * weights[1]) + (taps[2] * weights[2] + taps[3] * weights[3])
}

#[cfg(test)]
mod tests {
    use glam::dvec2;
    use proptest::prelude::*;
    use pulp::Scalar256b;

    use super::super::bounds::tests::check_held;
    use super::super::field::tests::{COLUMNS, ROWS, SIZE, any_point, rough};
    use super::*;
    use crate::geometry::testing::fixed_seed;
    use crate::math::{Interval, Rect};

    /// Rectangles around one point, each half as large as the one before.
    fn halved(centre: DVec2, half: DVec2) -> [Rect; LANES] {
        [1.0, 0.5, 0.25, 0.125].map(|part| Rect::new(centre - half * part, centre + half * part))
    }

    /// Bounds over rectangles, with such reaches.
    fn bounds(field: &HeightField, rects: &[Rect; LANES], reach: f64) -> ShapeBounds<Scalar256b> {
        let lanes = LaneRects::new(Scalar256b, rects);
        let reach = lanes.half_size() * DVec2::splat(reach);
        field.shape_bounds(lanes, reach, Mask::new(Scalar256b, [true; LANES]))
    }

    fn entries(matrices: Symmetric<Scalar256b>, lane: usize) -> [f64; 3] {
        [matrices.xx, matrices.xy, matrices.yy].map(|entry| entry.to_array()[lane])
    }

    proptest! {
        #![proptest_config(fixed_seed(256))]

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
            let rects = halved(a, 0.5 * (b - a).abs() * libm::exp2(-f64::from(size)));
            let shape = bounds(&field, &rects, 1.0);
            // Straight lines from the middle are on average half as far away as their ends.
            let nearer = bounds(&field, &rects, 0.5);
            for (lane, rect) in rects.iter().enumerate() {
                let around = |middle: f64, radius: f64| Interval::new(middle - radius, middle + radius);
                let (slope, slope_radius) = (shape.slope.to_array()[lane], shape.slope_radius.to_array()[lane]);
                let (curvature, radius) = (entries(shape.curvature, lane), entries(shape.curvature_radius, lane));
                let held = JetBounds {
                    height: field.bounds(rect).height,
                    gradient: [0, 1].map(|axis| around(slope[axis], slope_radius[axis])),
                    hessian: [0, 1, 2].map(|entry| around(curvature[entry], radius[entry])),
                };
                check_held(&field, rect, &held, &inside)?;
                prop_assert_eq!(shape.middle.place.to_array()[lane], rect.centre());
                let (height, gradient) = field.slope(rect.centre());
                prop_assert!((shape.middle.height.to_array()[lane] - height).abs() <= 1e-14 * (amplitude + offset));
                let off = shape.middle.gradient.to_array()[lane] - gradient;
                prop_assert!((off * field.cell_size()).abs().max_element() <= 1e-14 * (amplitude + offset));

                let (middle, mean_radius) = (entries(nearer.curvature, lane), entries(nearer.mean_radius, lane));
                for (s, t) in &inside[..8] {
                    let end = (dvec2(*s, *t) * 2.0 - 1.0) * 0.5 * (rect.max - rect.min);
                    let steps = 200;
                    let place = |k: i32| rect.centre() + end * (f64::from(k) + 0.5) / f64::from(steps);
                    let jets = (0..steps).map(|k| field.jet(place(k)));
                    let mean = jets.fold([0.0; 3], |sum, jet| {
                        std::array::from_fn(|k| sum[k] + jet.hessian[k] / f64::from(steps))
                    });
                    for k in 0..3 {
                        let off = (mean[k] - middle[k]).abs();
                        prop_assert!(off <= mean_radius[k] * (1.0 + 1e-3) + 1e-9 * amplitude);
                    }
                }
            }
        }

        #[test]
        fn shape_bounds_shrink_in_proportion_to_a_small_rectangle(p in any_point(0.4)) {
            let field = rough(COLUMNS, ROWS, 1.0, SIZE);
            let radii = |size: f64| {
                let shape = bounds(&field, &halved(p, 0.5 * size * field.cell_size()), 1.0);
                let slope = shape.slope_radius.to_array()[0].to_array();
                slope.into_iter().chain(entries(shape.curvature_radius, 0))
            };
            for (wide, narrow) in radii(0.1).zip(radii(0.001)) {
                prop_assert!(narrow <= wide * 0.011 + 1e-9, "{} {}", narrow, wide);
            }
        }

        #[test]
        fn one_lane_says_nothing_of_another(a in any_point(0.8), b in any_point(0.8), size in 0..12i32) {
            let field = rough(COLUMNS, ROWS, 1.0, SIZE);
            let rects = halved(a, 0.5 * (b - a).abs() * libm::exp2(-f64::from(size)));
            let together = bounds(&field, &rects, 1.0);
            for (lane, rect) in rects.iter().enumerate() {
                let alone = bounds(&field, &[*rect; LANES], 1.0);
                prop_assert_eq!(entries(alone.curvature, 0), entries(together.curvature, lane));
                prop_assert_eq!(entries(alone.curvature_radius, 0), entries(together.curvature_radius, lane));
                prop_assert_eq!(alone.slope_radius.to_array()[0], together.slope_radius.to_array()[lane]);
            }
        }
    }
}
