//! A certificate that a shading point sees no point of a light on a fold, or even each point once at the most.
//!
//! By Snell's law at both faces, a place of the near plane leads to an end. That is a direction for a light at
//! infinity. For others, it is a place at the height of the light's point. Let the derivative of the end by the place
//! stay near one invertible matrix all over a rectangle. Then no two places of it have the same end. That is Krawczyk's
//! test (1969; Neumaier 1990, "Interval Methods for Systems of Equations", section 5.1). So each point of the light has
//! one path at the most there, and Newton's method finds it. If that holds for each part of a window alone, a point may
//! have several paths, and none of them is on a fold.
//!
//! All of the derivative is bounded, by interval arithmetic on the chain of its steps. These are how the crossing of
//! each face moves, how its slope changes, how strongly it refracts, and how thick the glass is. The faces' curvatures
//! are bounded over the very region that light from the rectangle crosses, and heights over the outline. Rounding is a
//! hundred million times smaller than what is left of the bound ([`MOST_DEFECT`]).

use arrayvec::ArrayVec;
use glam::{DVec2, DVec3};

use super::bounded::{Bounded, Bounded2, dot};
use super::direction_bounds::Box2;
use super::side::PaneSide;
use super::widest::{self, Computation};
use super::window::{SourceBounds, Window};
use crate::geometry::{HeightField, ShapeBounds};
use crate::math::simd::{Instructions, LANES, LaneRects, Lanes2, Mask};
use crate::math::{Interval, Rect};
use clerestory_film::counters::Counters;

/// How far beyond a window the certificate reaches within the outline, as a part of its size. A path that is
/// found there is the only one, too.
const BEYOND: f64 = 0.1;

/// The derivative is near enough to one matrix when its defect is below 1; this much below, so that rounding cannot
/// matter.
const MOST_DEFECT: f64 = 0.99;

/// Parts of a window that are looked at for folds.
pub(super) const MOST_LOOKS: usize = 48;

/// Where the defect of a whole window is above this, so few parts hardly ever have none.
const HOPELESS: f64 = 8.0;

/// What is certain of the paths in the window of a light.
#[derive(Clone, Copy, Debug)]
pub(super) enum Certificate {
    /// Each point of the light has one place at the most in this region.
    OnePath(Rect),
    /// No point of the light lies on a fold of the caustic: paths do not come or go within its extent, and the geometry
    /// factor of each has a bound.
    NoFold,
}

impl Certificate {
    /// For a window, around all of a light; `None` where nothing is certain. It looks for folds at `looks` parts of the
    /// window, [`MOST_LOOKS`] at the most, and with 0 only for certainty of one path.
    pub(super) fn new(
        window: &Window<'_>,
        source: &SourceBounds,
        looks: usize,
        counters: &mut Counters,
    ) -> Option<Self> {
        let rect = window.rect();
        // Heights are bounded over the outline alone.
        let grown = rect.grown(BEYOND * (rect.max - rect.min).max_element());
        let region = if window.outline().holds(&grown) { grown } else { *rect };
        let whole = defect(window, source, region, counters)?;
        if whole <= MOST_DEFECT {
            return Some(Self::OnePath(region));
        }
        if looks == 0 || whole > HOPELESS {
            return None;
        }
        let mut parts: ArrayVec<Rect, { MOST_LOOKS + 1 }> = rect.halves().into_iter().collect();
        for _ in 0..looks {
            let Some(part) = parts.pop() else { return Some(Self::NoFold) };
            // Without what no light reaches the source from.
            let Some(part) = window.part(&part) else { continue };
            if defect(window, source, part.rect, counters).is_some_and(|defect| defect <= MOST_DEFECT) {
                continue;
            }
            if parts.remaining_capacity() < 2 {
                return None;
            }
            parts.extend(part.rect.halves());
        }
        parts.is_empty().then_some(Self::NoFold)
    }
}

/// How far the derivative of the end strays from one invertible matrix in a region, in the norm in which the region is
/// a unit square. Below 1, no two places of the region have the same end, and it holds no fold. `None` where light may
/// be reflected totally, or run along a face.
fn defect(window: &Window<'_>, source: &SourceBounds, region: Rect, counters: &mut Counters) -> Option<f64> {
    let chain = Chain { side: window.side(), origin: window.origin(), source, region, counters };
    let derivative = widest::run(chain)?;
    let half = (0.5 * (region.max - region.min)).to_array();
    let [[a, b], [c, d]] = derivative.map(|row| row.map(|entry| 0.5 * (entry.min + entry.max)));
    let radius = derivative.map(|row| row.map(|entry| 0.5 * (entry.max - entry.min)));
    let determinant = a * d - b * c;
    let inverse = [[d, -b], [-c, a]].map(|row| row.map(|entry| (entry / determinant).abs()));
    let off = |row: usize| {
        let entry = |column: usize| inverse[row][0] * radius[0][column] + inverse[row][1] * radius[1][column];
        (entry(0) * half[0] + entry(1) * half[1]) / half[row]
    };
    let defect = off(0).max(off(1));
    defect.is_finite().then_some(defect)
}

/// The rows of a matrix of intervals.
type Derivative = [[Interval; 2]; 2];

/// The steps from a place to an end.
struct Chain<'a, 'b> {
    side: &'b PaneSide<'a>,
    origin: DVec3,
    source: &'b SourceBounds,
    region: Rect,
    counters: &'b mut Counters,
}

impl Computation for Chain<'_, '_> {
    type Output = Option<Derivative>;

    /// Light travels towards +z here, and heights are above the shading point.
    #[inline(always)]
    fn run<S: Instructions>(self, simd: S) -> Self::Output {
        let Self { side, origin, source, region, counters } = self;
        let (pane, sign) = (side.pane, side.sign);
        let index = pane.index_of_refraction;
        let index_squared = Interval::point(index * index);
        let one = Interval::point(1.0);
        let above = (side.near_base() - origin.z) * sign;
        let heights = [side.near, side.far].map(|face| signed(pane.bounds(face).height, sign));

        let place = [0, 1].map(|axis| Bounded::variable(axis, Interval::new(region.min[axis], region.max[axis])));
        let tangent = [0, 1].map(|axis| (place[axis] + Interval::point(-origin[axis])) * (1.0 / above));
        let entry_height = Interval::point(above) + heights[0];
        let entry: Box2 = [0, 1].map(|axis| Interval::point(origin[axis]) + tangent[axis].value * entry_height);
        let near = Face::over(side.near_surface(), &entry, sign, simd, counters);
        // X1 = O + t (above + h1), so (I - t g1^T) dX1 = (above + h1) dt.
        let moved = tangent.map(|tangent| tangent.by.map(|by| by * entry_height));
        let entry = crossing(&entry, moved, &tangent, &near)?;
        let (near_height, near_slope) = near.at(&entry, heights[0]);

        let shorter = (dot(&tangent, &tangent) + one).root()?.reciprocal()?;
        let direction = tangent.map(|tangent| tangent * shorter);
        let steepness = (dot(&near_slope, &near_slope) + one).root()?;
        let cosine = (shorter - dot(&near_slope, &direction)).over(steepness)?;
        let strength = ((cosine * cosine + (index_squared - one)).root()? - cosine).over(steepness)?;
        // The direction in the glass, times the index.
        let inner = [0, 1].map(|axis| direction[axis] - strength * near_slope[axis]);
        let inner_height = shorter + strength;
        let inner_tangent = [inner[0].over(inner_height)?, inner[1].over(inner_height)?];

        let gap = Interval::point(pane.thickness) + heights[1] - heights[0];
        let exit: Box2 = [0, 1].map(|axis| entry[axis].value + inner_tangent[axis].value * gap);
        let far = Face::over(side.far_surface(), &exit, sign, simd, counters);
        // X2 = X1 + s (gap + h2 - h1), so (I - s g2^T) dX2 = dX1 + gap ds - s dh1.
        let moved = [0, 1].map(|axis| {
            [0, 1].map(|by| {
                entry[axis].by[by] + inner_tangent[axis].by[by] * gap - inner_tangent[axis].value * near_height.by[by]
            })
        });
        let exit = crossing(&exit, moved, &inner_tangent, &far)?;
        let (far_height, far_slope) = far.at(&exit, heights[1]);

        let steepness = (dot(&far_slope, &far_slope) + one).root()?;
        let cosine = (inner_height - dot(&far_slope, &inner)).over(steepness)?;
        // None where light may be totally reflected.
        let outside = (cosine * cosine + (one - index_squared)).root()?;
        let strength = (cosine - outside).over(steepness)?;
        let last = [0, 1].map(|axis| inner[axis] + strength * far_slope[axis]);
        let last_height = inner_height - strength;
        let last_tangent = [last[0].over(last_height)?, last[1].over(last_height)?];
        let end = match *source {
            SourceBounds::Cap { .. } => last_tangent,
            SourceBounds::Ball { centre, radius } => {
                let light = (centre.z - origin.z) * sign;
                let light = Interval::new(light - radius, light + radius);
                let rest = far_height.negative() + (light - Interval::point(above + pane.thickness));
                [0, 1].map(|axis| exit[axis] + last_tangent[axis] * rest)
            }
        };
        Some(end.map(|coordinate| coordinate.by))
    }
}

/// The slopes and curvatures of a face where light crosses it.
struct Face {
    slope: Box2,
    /// By xx, xy and yy.
    curvature: [Interval; 3],
}

impl Face {
    #[inline(always)]
    fn over<S: Instructions>(
        surface: &HeightField,
        region: &Box2,
        sign: f64,
        simd: S,
        counters: &mut Counters,
    ) -> Self {
        counters.height_evaluations += 1;
        let rect = Rect::new(DVec2::new(region[0].min, region[1].min), DVec2::new(region[0].max, region[1].max));
        let rects = LaneRects::new(simd, &[rect; LANES]);
        let live = Mask::new(simd, [true, false, false, false]);
        let shape: ShapeBounds<S> = surface.shape_bounds(rects, Lanes2::splat(simd, DVec2::ZERO), live);
        let around = |middle: f64, radius: f64| signed(Interval::new(middle - radius, middle + radius), sign);
        let ([slope, ..], [slope_radius, ..]) = (shape.slope.to_array(), shape.slope_radius.to_array());
        let (middle, radius) = (shape.curvature, shape.curvature_radius);
        let curvature = [(middle.xx, radius.xx), (middle.xy, radius.xy), (middle.yy, radius.yy)]
            .map(|(middle, radius)| around(middle.to_array()[0], radius.to_array()[0]));
        Self { slope: [0, 1].map(|axis| around(slope[axis], slope_radius[axis])), curvature }
    }

    /// Its height and its slope at a place that moves.
    #[inline(always)]
    fn at(&self, place: &Bounded2, height: Interval) -> (Bounded, Bounded2) {
        let [xx, xy, yy] = self.curvature;
        let rows = [[xx, xy], [xy, yy]];
        let along = |factors: &[Interval; 2], by: usize| factors[0] * place[0].by[by] + factors[1] * place[1].by[by];
        let height = Bounded { value: height, by: [0, 1].map(|by| along(&self.slope, by)) };
        let slope = [0, 1].map(|axis| Bounded { value: self.slope[axis], by: [0, 1].map(|by| along(&rows[axis], by)) });
        (height, slope)
    }
}

/// Where a ray with a tangent crosses a face, with `moved` the derivative of where it would cross a plane at that
/// height; `None` where it may run along the face.
#[inline(always)]
fn crossing(place: &Box2, moved: [[Interval; 2]; 2], tangent: &Bounded2, face: &Face) -> Option<Bounded2> {
    let [x, y] = [tangent[0].value, tangent[1].value];
    let rise = Interval::point(1.0) - face.slope[0] * x - face.slope[1] * y;
    if rise.min <= 0.0 {
        return None;
    }
    let slower = Interval::new(1.0 / rise.max, 1.0 / rise.min);
    let higher = [0, 1].map(|by| (face.slope[0] * moved[0][by] + face.slope[1] * moved[1][by]) * slower);
    Some([0, 1].map(|axis| Bounded {
        value: place[axis],
        by: [0, 1].map(|by| moved[axis][by] + tangent[axis].value * higher[by]),
    }))
}

/// Bounds as seen when z is mirrored for a negative sign.
fn signed(bounds: Interval, sign: f64) -> Interval {
    if sign > 0.0 { bounds } else { -bounds }
}

#[cfg(test)]
mod tests;
