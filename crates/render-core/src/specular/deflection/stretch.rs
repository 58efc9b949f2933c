//! The map from places to end points over four parts of the window at once. It contracts the parts, bounds their
//! stretch, and bounds the places of a path from the traced path of their middles.

use glam::{DMat2, DVec2};

use super::{DeflectionBounds, Lever, SlopeWeight, radius};
use crate::geometry::{ShapeBounds, Symmetric};
use crate::math::Rect;
use crate::math::simd::{Instructions, LaneRects, Lanes, Lanes2, Mask};
use crate::specular::direction_bounds::Box2;
use clerestory_film::counters::Counters;

/// The derivative of the end point leaves out how the refraction's strength, B and the heights change over the part:
/// terms of the size of a slope times the sine of an angle of incidence times what is kept. This multiple of it is an
/// estimate and no bound, so that what rests on it has to be checked at random. It also stands for using x0, the
/// matrices L and the levers a little outside the window that they are bounded for: by the slack of a traced path, and
/// by the height of the relief where the traced path goes through it.
const LEFT_OUT: f64 = 1.5;

/// A part is injective when its defect is below 1; this much below, so that rounding cannot matter.
const MOST_DEFECT: f64 = 0.99;

/// Four matrices.
#[derive(Clone, Copy, Debug)]
struct Matrices<S> {
    /// The columns.
    x_axis: Lanes2<S>,
    y_axis: Lanes2<S>,
}

/// How the map stretches four parts of the window: the derivatives of the end point by the place, on the near plane's
/// scale.
#[derive(Clone, Copy, Debug)]
pub(in crate::specular) struct Stretch<S> {
    /// Middles of the derivatives' bounds.
    derivative: Matrices<S>,
    /// How far each entry, as a mean over a straight line from a traced path to any place of the part, may be from its
    /// middle.
    mean_error: Matrices<S>,
    /// Inverses of the middles of the derivatives' bounds.
    inverse: Matrices<S>,
    /// Bounds, entry by entry, on how far `inverse` times the derivative is from the identity anywhere in the part.
    defect: Matrices<S>,
}

impl<'a> DeflectionBounds<'a> {
    /// Which of four rectangles of the near plane send light through the outline of both faces.
    #[inline(always)]
    pub(in crate::specular) fn meets_glass<S: Instructions>(&self, rects: LaneRects<S>) -> Mask<S> {
        let outline = &self.side.pane.outline;
        let entry = rects.shifted(&rect(&self.to_entry));
        let exit = rects.shifted(&rect(&self.to_exit));
        outline.is_beside(entry).or(outline.is_beside(exit)).not()
    }

    /// The shapes of both faces where light from four rectangles of the near plane goes through, also beyond the
    /// outline.
    #[inline(always)]
    pub(in crate::specular) fn shapes<S: Instructions>(
        &self,
        rects: LaneRects<S>,
        live: Mask<S>,
        counters: &mut Counters,
    ) -> [ShapeBounds<S>; 2] {
        counters.height_evaluations += 2 * live.count();
        // On the way from where the traced path starts, at most a radius of `to_entry` from the middle, to any place of
        // the rectangle, the places are on average half as far from the middle as these ends.
        let nearer = rects.half_size() * DVec2::splat(0.5) - radius(&self.to_entry) * 0.5;
        let entry = rects.shifted(&rect(&self.to_entry));
        let exit = rects.shifted(&rect(&self.to_exit));
        [
            self.side.near_surface().shape_bounds(entry, entry.half_size() - nearer, live),
            self.side.far_surface().shape_bounds(exit, exit.half_size() - nearer, live),
        ]
    }

    /// The places of four parts from which light can reach the source, where the faces have the given shapes; empty
    /// where there are none.
    #[inline(always)]
    pub(in crate::specular) fn shaped_parts<S: Instructions>(
        &self,
        parts: LaneRects<S>,
        shapes: &[ShapeBounds<S>; 2],
    ) -> LaneRects<S> {
        let simd = parts.min.x.simd();
        let mut centre = Lanes2::splat(simd, self.flat);
        let mut reach = Lanes2::splat(simd, self.flat_radius);
        for (face, weight) in shapes.iter().zip(&self.weights) {
            centre = centre + product(&weight.middle, face.slope);
            reach = reach + product(&weight.radius, face.slope.abs()) + product(&weight.magnitude, face.slope_radius);
        }
        parts.intersection(LaneRects { min: centre - reach, max: centre + reach })
    }

    /// The derivatives of the end point where the faces have the given shapes, and where their middles are not
    /// singular.
    #[inline(always)]
    pub(in crate::specular) fn stretch<S: Instructions>(&self, faces: &[ShapeBounds<S>; 2]) -> (Stretch<S>, Mask<S>) {
        let simd = faces[0].slope.x.simd();
        let zero = Lanes::splat(simd, 0.0);
        let one = Lanes::splat(simd, 1.0);
        let nothing = Matrices::filled(zero);
        let mut derivative = Matrices { x_axis: Lanes2 { x: one, y: zero }, y_axis: Lanes2 { x: zero, y: one } };
        let (mut error, mut mean_error) = (nothing, nothing);
        let (mut steepest, mut largest, mut bent) = (zero, one, zero);
        for ((face, weight), lever) in faces.iter().zip(&self.weights).zip(&self.levers) {
            let SlopeWeight { middle, radius, magnitude } = weight;
            let &Lever { middle: lever, radius: lever_radius, max: longest } = lever;
            let size = face.curvature.abs();
            derivative = derivative.minus(Matrices::product(middle, &face.curvature).scaled(lever));
            let varying = Matrices::product(magnitude, &face.curvature_radius).scaled(longest);
            let sized = Matrices::product(magnitude, &size);
            let sizes = sized.scaled(longest).plus(varying);
            // The near face's curvature turns the ray in the glass, which moves X2.
            let turned = bent * self.gap;
            let unsure = sized
                .scaled(lever_radius)
                .plus(Matrices::product(radius, &size).scaled(lever))
                .plus(Matrices { x_axis: sizes.x_axis.scaled(turned), y_axis: sizes.y_axis.scaled(turned) });
            error = error.plus(unsure).plus(varying);
            mean_error = mean_error.plus(unsure).plus(Matrices::product(magnitude, &face.mean_radius).scaled(longest));
            largest = largest + sizes.x_axis.max_element().max(sizes.y_axis.max_element());
            bent = size.plus(face.curvature_radius).largest();
            steepest = steepest.max((face.slope.abs() + face.slope_radius).max_element());
        }
        let obliquity = (steepest + self.tilt) * (1.0 + self.tilt * self.tilt);
        let left_out = Matrices::filled((steepest * obliquity * LEFT_OUT + self.glass) * largest);
        let (error, mean_error) = (error.plus(left_out), mean_error.plus(left_out));
        let Matrices { x_axis, y_axis } = derivative;
        let scale = (x_axis.x * y_axis.y - x_axis.y * y_axis.x).recip();
        let inverse = Matrices {
            x_axis: Lanes2 { x: y_axis.y * scale, y: -x_axis.y * scale },
            y_axis: Lanes2 { x: -y_axis.x * scale, y: x_axis.x * scale },
        };
        let size = inverse.magnitude();
        let defect = Matrices { x_axis: size.times(error.x_axis), y_axis: size.times(error.y_axis) };
        let regular = inverse.x_axis.is_finite().and(inverse.y_axis.is_finite());
        (Stretch { derivative, mean_error, inverse, defect }, regular)
    }
}

impl<S: Instructions> Stretch<S> {
    /// Where a path is, predicted from a traced path that misses by so much, and by how much that may be off if it is
    /// within `away` of the traced path, coordinate by coordinate, and the traced path is off by `error` in each
    /// component.
    #[inline(always)]
    pub(in crate::specular) fn prediction(
        &self,
        traced: Lanes2<S>,
        miss: Lanes2<S>,
        away: Lanes2<S>,
        error: f64,
    ) -> (Lanes2<S>, Lanes2<S>) {
        let unsure = self.mean_error.times(away) + DVec2::splat(error);
        (traced + self.inverse.times(miss), self.inverse.magnitude().times(unsure))
    }

    /// The places of parts whose paths can end nearer than `slack` to the source, when traced paths from `start` miss
    /// it by `miss`; empty where there are none.
    ///
    /// Near a fold the end point moves hardly at all in one direction, however the place moves: that direction tells
    /// most. Across it, it moves most, which bounds the places to a strip.
    #[inline(always)]
    pub(in crate::specular) fn reaching(
        &self,
        parts: LaneRects<S>,
        start: Lanes2<S>,
        miss: Lanes2<S>,
        slack: f64,
    ) -> LaneRects<S> {
        let Matrices { x_axis, y_axis } = self.derivative;
        // The derivative times its transpose. Near a fold, all columns are along the direction in which the end point
        // moves most.
        let squares = [
            x_axis.x * x_axis.x + y_axis.x * y_axis.x,
            x_axis.x * x_axis.y + y_axis.x * y_axis.y,
            x_axis.y * x_axis.y + y_axis.y * y_axis.y,
        ];
        let [xx, xy, yy] = squares;
        let stiff = yy.less_than(xx).select2(Lanes2 { x: xx, y: xy }, Lanes2 { x: xy, y: yy });
        let mut left = LaneRects { min: parts.min - start, max: parts.max - start };
        let mut beside = parts.is_empty();
        for along in [stiff, Lanes2 { x: -stiff.y, y: stiff.x }] {
            let away = left.min.abs().max(left.max.abs());
            let by = Lanes2 { x: x_axis.dot(along), y: y_axis.dot(along) };
            let unsure = (self.mean_error.times(away) + DVec2::splat(slack)).dot(along.abs());
            let moved = along.dot(miss);
            let (low, high) = (by * left.min, by * left.max);
            let (low, high) = (low.min(high), low.max(high));
            // What each coordinate has to make up for, whatever the other one does.
            let (least, most) = (moved - unsure, moved + unsure);
            let needed = Lanes2 { x: least - high.y, y: least - high.x };
            let allowed = Lanes2 { x: most - low.y, y: most - low.x };
            beside = beside.or(high.x.less_than(needed.x)).or(high.y.less_than(needed.y));
            beside = beside.or(allowed.x.less_than(low.x)).or(allowed.y.less_than(low.y));
            let scale = Lanes2 { x: by.x.recip(), y: by.y.recip() };
            let (a, b) = (needed * scale, allowed * scale);
            let bounded = left.intersection(LaneRects { min: a.min(b), max: a.max(b) });
            // A coordinate without influence is not bounded.
            let (x, y) = (scale.x.is_finite(), scale.y.is_finite());
            left = LaneRects {
                min: Lanes2 { x: x.select(bounded.min.x, left.min.x), y: y.select(bounded.min.y, left.min.y) },
                max: Lanes2 { x: x.select(bounded.max.x, left.max.x), y: y.select(bounded.max.y, left.max.y) },
            };
        }
        let left = parts.intersection(LaneRects { min: start + left.min, max: start + left.max });
        left.where_or_empty(beside.not())
    }

    /// Whether no two places of parts with these half sides have the same end point: the derivative, brought near the
    /// identity, stays nearer to it than 1 in the norm in which the part is a unit square.
    #[inline(always)]
    pub(in crate::specular) fn is_injective(&self, half_size: Lanes2<S>) -> Mask<S> {
        let off = self.defect.times(half_size);
        let most = half_size * DVec2::splat(MOST_DEFECT);
        most.x.less_than(off.x).or(most.y.less_than(off.y)).not().and(off.is_finite())
    }

    /// These where `mask` holds, and `others` elsewhere.
    #[inline(always)]
    pub(in crate::specular) fn where_or(self, mask: Mask<S>, others: Self) -> Self {
        Self {
            derivative: self.derivative.where_or(mask, others.derivative),
            mean_error: self.mean_error.where_or(mask, others.mean_error),
            inverse: self.inverse.where_or(mask, others.inverse),
            defect: self.defect.where_or(mask, others.defect),
        }
    }
}

impl<S: Instructions> Matrices<S> {
    #[inline(always)]
    fn filled(value: Lanes<S>) -> Self {
        let both = Lanes2 { x: value, y: value };
        Self { x_axis: both, y_axis: both }
    }

    /// A matrix times four symmetric ones.
    #[inline(always)]
    fn product(matrix: &DMat2, Symmetric { xx, xy, yy }: &Symmetric<S>) -> Self {
        Self { x_axis: product(matrix, Lanes2 { x: *xx, y: *xy }), y_axis: product(matrix, Lanes2 { x: *xy, y: *yy }) }
    }

    #[inline(always)]
    fn plus(self, other: Self) -> Self {
        Self { x_axis: self.x_axis + other.x_axis, y_axis: self.y_axis + other.y_axis }
    }

    #[inline(always)]
    fn minus(self, other: Self) -> Self {
        Self { x_axis: self.x_axis - other.x_axis, y_axis: self.y_axis - other.y_axis }
    }

    #[inline(always)]
    fn scaled(self, factor: f64) -> Self {
        let factor = DVec2::splat(factor);
        Self { x_axis: self.x_axis * factor, y_axis: self.y_axis * factor }
    }

    #[inline(always)]
    fn times(self, vectors: Lanes2<S>) -> Lanes2<S> {
        self.x_axis.scaled(vectors.x) + self.y_axis.scaled(vectors.y)
    }

    #[inline(always)]
    fn where_or(self, mask: Mask<S>, other: Self) -> Self {
        Self { x_axis: mask.select2(self.x_axis, other.x_axis), y_axis: mask.select2(self.y_axis, other.y_axis) }
    }

    #[inline(always)]
    fn magnitude(self) -> Self {
        Self { x_axis: self.x_axis.abs(), y_axis: self.y_axis.abs() }
    }
}

/// A matrix times four vectors.
#[inline(always)]
fn product<S: Instructions>(matrix: &DMat2, vectors: Lanes2<S>) -> Lanes2<S> {
    let (x, y) = (matrix.x_axis, matrix.y_axis);
    Lanes2 { x: vectors.x * x.x + vectors.y * y.x, y: vectors.x * x.y + vectors.y * y.y }
}

#[inline(always)]
fn rect([x, y]: &Box2) -> Rect {
    Rect::new(DVec2::new(x.min, y.min), DVec2::new(x.max, y.max))
}
