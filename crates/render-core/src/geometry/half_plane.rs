//! Half planes, and what they leave of a rectangle.

use glam::DVec2;
use smallvec::SmallVec;

use crate::math::Rect;

/// Corners for which no memory is allocated: a quarry that a rectangle cuts.
const USUAL_CORNERS: usize = 8;

/// Corners of a convex polygon, counterclockwise; none where it is empty.
pub(crate) type Corners = SmallVec<[DVec2; USUAL_CORNERS]>;

/// Rounding of a place relative to the largest coordinate.
pub(super) const ROUNDING: f64 = 8.0 * f64::EPSILON;

/// One side of a line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HalfPlane {
    /// Unit normal of the line, into the half plane.
    pub inwards: DVec2,
    /// Distance of the line from the origin along the normal.
    pub offset: f64,
}

impl HalfPlane {
    /// Distance of a place from the line; negative outside.
    #[inline(always)]
    pub fn distance(&self, place: DVec2) -> f64 {
        self.inwards.dot(place) - self.offset
    }

    /// The corner of a rectangle that is farthest inside.
    #[inline(always)]
    fn innermost(&self, rect: &Rect) -> DVec2 {
        DVec2::select(self.inwards.cmpgt(DVec2::ZERO), rect.max, rect.min)
    }

    /// The corner of a rectangle that is farthest outside.
    #[inline(always)]
    fn outermost(&self, rect: &Rect) -> DVec2 {
        DVec2::select(self.inwards.cmpgt(DVec2::ZERO), rect.min, rect.max)
    }

    /// The rectangle around what the half plane leaves of a rectangle: empty when that is nothing.
    #[inline]
    fn narrowed(&self, rect: &Rect) -> Rect {
        let mut narrowed = *rect;
        let innermost = self.innermost(rect);
        for axis in 0..2 {
            let (own, other) = (self.inwards[axis], self.inwards[1 - axis]);
            if own == 0.0 {
                continue;
            }
            // Where the line crosses the side on which most is left.
            let limit = (self.offset - other * innermost[1 - axis]) / own;
            let slack = ROUNDING * (limit.abs() + rect.min.abs().max(rect.max.abs()).max_element());
            if own > 0.0 {
                narrowed.min[axis] = narrowed.min[axis].max(limit - slack);
            } else {
                narrowed.max[axis] = narrowed.max[axis].min(limit + slack);
            }
        }
        narrowed
    }
}

/// The area of a convex polygon.
pub(super) fn area(corners: &[DVec2]) -> f64 {
    let Some((first, rest)) = corners.split_first() else { return 0.0 };
    0.5 * rest.windows(2).map(|pair| (pair[0] - *first).perp_dot(pair[1] - *first)).sum::<f64>()
}

/// What lines leave of a rectangle, to draw places from.
#[derive(Clone, Debug)]
pub(crate) enum Shape {
    /// All of it.
    Whole(Rect),
    /// A polygon with its area.
    Polygon(Corners, f64),
}

impl Shape {
    /// What half planes leave of a rectangle; `None` where that is nothing.
    pub(crate) fn new(rect: Rect, cuts: impl Iterator<Item = HalfPlane>) -> Option<Self> {
        // Of the many edges of an arch, few cut a small rectangle.
        let mut cutting = cuts.filter(|cut| cut.distance(cut.outermost(&rect)) < 0.0).peekable();
        if cutting.peek().is_none() {
            return (!rect.is_empty()).then_some(Self::Whole(rect));
        }
        let corners = clipped(&rect, cutting);
        let area = area(&corners);
        (area > 0.0).then_some(Self::Polygon(corners, area))
    }

    /// Its area in square metres.
    pub(crate) fn area(&self) -> f64 {
        match self {
            Self::Whole(rect) => rect.area(),
            Self::Polygon(_, area) => *area,
        }
    }

    /// A place in it for a pair of numbers in [0, 1): uniform over the area.
    pub(crate) fn sample(&self, random: DVec2) -> DVec2 {
        match self {
            Self::Whole(rect) => within(rect, random),
            Self::Polygon(corners, area) => sample(corners, *area, random),
        }
    }
}

/// A place of a rectangle for a pair of numbers in [0, 1].
pub(super) fn within(rect: &Rect, random: DVec2) -> DVec2 {
    rect.min + (rect.max - rect.min) * random
}

/// A place of a convex polygon, counterclockwise, for a pair of numbers in [0, 1): uniform over its area. Numbers that
/// differ little give places that do, so even spacing is kept.
pub(super) fn sample(corners: &[DVec2], area: f64, random: DVec2) -> DVec2 {
    let count = corners.len();
    let leftmost = (1..count).fold(0, |least, index| if corners[index].x < corners[least].x { index } else { least });
    // The ends of the edges below and above, which are followed from left to right.
    let mut edges = [leftmost; 2];
    let next = |side: usize, index: usize| if side == 0 { (index + 1) % count } else { (index + count - 1) % count };
    let mut left = [corners[leftmost]; 2];
    let mut rest = random.x * area;
    for remaining in (0..count).rev() {
        let ends = [0, 1].map(|side| corners[next(side, edges[side])]);
        let x = ends[0].x.min(ends[1].x);
        let right = [0, 1].map(|side| {
            let (from, to) = (left[side], ends[side]);
            let along = if to.x > from.x { (x - from.x) / (to.x - from.x) } else { 1.0 };
            if along < 1.0 { from + (to - from) * along } else { to }
        });
        let (width, heights) = (x - left[0].x, [left[1].y - left[0].y, right[1].y - right[0].y]);
        let trapezoid = 0.5 * width * (heights[0] + heights[1]);
        if width > 0.0 && (rest < trapezoid || remaining == 0) {
            // rest = width (heights[0] t + (heights[1] - heights[0]) t^2 / 2)
            let rest = rest.min(trapezoid) / width;
            let root = (heights[0] * heights[0] + 2.0 * (heights[1] - heights[0]) * rest).max(0.0).sqrt();
            let at = if rest > 0.0 { (2.0 * rest / (heights[0] + root)).min(1.0) } else { 0.0 };
            let [low, high] = [0, 1].map(|side| left[side] + (right[side] - left[side]) * at);
            return low + (high - low) * random.y;
        }
        rest -= trapezoid.max(0.0);
        for side in 0..2 {
            if ends[side].x <= x {
                edges[side] = next(side, edges[side]);
            }
        }
        left = right;
    }
    0.5 * (left[0] + left[1])
}

/// A rectangle around what half planes leave of a rectangle.
#[inline]
pub(super) fn narrowed(cuts: impl Iterator<Item = HalfPlane> + Clone, rect: Rect) -> Rect {
    let mut narrowed = rect;
    for cut in cuts {
        if narrowed.is_empty() {
            break;
        }
        narrowed = cut.narrowed(&narrowed);
    }
    narrowed
}

/// The corners of what half planes leave of a rectangle.
pub(super) fn clipped(rect: &Rect, cuts: impl Iterator<Item = HalfPlane>) -> Corners {
    let Rect { min, max } = *rect;
    if rect.is_empty() {
        return Corners::new();
    }
    cut(Corners::from_slice(&[min, DVec2::new(max.x, min.y), max, DVec2::new(min.x, max.y)]), cuts)
}

/// What half planes leave of a convex polygon (Sutherland and Hodgman 1974).
pub(super) fn cut(mut corners: Corners, cuts: impl Iterator<Item = HalfPlane>) -> Corners {
    for cut in cuts {
        let mut kept = Corners::new();
        let Some(mut before) = corners.last().copied() else { break };
        let mut was = cut.distance(before);
        for &corner in &corners {
            let is = cut.distance(corner);
            if (was < 0.0) != (is < 0.0) {
                kept.push(before + (corner - before) * (was / (was - is)));
            }
            if is >= 0.0 {
                kept.push(corner);
            }
            (before, was) = (corner, is);
        }
        corners = kept;
    }
    corners
}
