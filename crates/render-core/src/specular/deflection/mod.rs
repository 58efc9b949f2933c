//! Where paths through a part of the deflection window end, bounded by interval arithmetic over parts of any size. The
//! *end point* of a place is where the path through that place of the near plane meets the plane of the source.
//!
//! Light travels towards +z (the pane is mirrored if need be). With p, r, q the tangents of the three segments O X1,
//! X1 X2, X2 S, the path ends at a source point S when
//!
//! ```text
//! S_t - O_t = (near + h1) p + gap r + above q = c p + gap r + above (q - p),    c = near + h1 + above
//! ```
//!
//! and in a direction of tangent T when `T = p + (q - p)`. In both cases `q - p = B (g2 grad h2 - g1 grad h1)` with a
//! bounded matrix B and bounded strengths g of refraction. So the place x = O_t + near p where the path crosses the
//! near plane solves
//!
//! ```text
//! x = x0 + L1 grad h1(X1) + L2 grad h2(X2)
//! ```
//!
//! with a vector x0 and matrices L that hardly vary. They are bounded once over the whole window; slopes and
//! curvatures, which decide, are read for each part.

mod stretch;

use glam::{DMat2, DVec2};

use super::{
    direction_bounds::{
        Box2, bend, clamped, directions_of_tangents, refraction_strength, refraction_strength_widest,
        tangents_of_directions,
    },
    side::PaneSide,
};
use crate::geometry::JetBounds;
use crate::math::{Interval, Rect};

/// A shading point and a source as seen from a pane, mirrored so that light travels towards +z.
#[derive(Clone, Copy, Debug)]
pub(in crate::specular) struct Ends {
    /// The shading point's x and y.
    pub(in crate::specular) origin: DVec2,
    /// Height of the undisplaced near face above the shading point.
    pub(in crate::specular) near: f64,
    /// Where the light comes from.
    pub(in crate::specular) source: MirroredSource,
}

/// A source, mirrored with its pane.
#[derive(Clone, Copy, Debug)]
pub(in crate::specular) enum MirroredSource {
    /// Bounds on a point relative to the shading point.
    Offset([Interval; 3]),
    /// Bounds on the tangential part of a direction.
    Direction(Box2),
}

/// For what part of a face bounds are read.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(in crate::specular) enum Detail {
    /// For all of it, without looking.
    WholeFace,
    /// For the part where light from the window goes through.
    Region,
}

/// The map from the near plane to the source, bounded over a window.
#[derive(Clone, Copy, Debug)]
pub(in crate::specular) struct DeflectionBounds<'a> {
    side: PaneSide<'a>,
    /// What leads from a place of the near plane to X1 and to X2.
    to_entry: Box2,
    to_exit: Box2,
    /// How much X1 and X2 move with the place.
    levers: [Lever; 2],
    /// x0: its middle, and how far it may be from that.
    flat: DVec2,
    flat_radius: DVec2,
    /// L1 and L2, by which the slopes of the near and of the far face count.
    weights: [SlopeWeight; 2],
    /// The largest component of a tangent.
    tilt: f64,
    /// The largest thickness of the glass, metres, and its part of the way to a source point.
    gap: f64,
    glass: f64,
}

/// A matrix that is known up to an error in each entry.
#[derive(Clone, Copy, Debug)]
struct SlopeWeight {
    middle: DMat2,
    radius: DMat2,
    /// The largest magnitude of each entry.
    magnitude: DMat2,
}

/// How much a vertex moves with the place where its path crosses the near plane: positive numbers.
#[derive(Clone, Copy, Debug)]
struct Lever {
    middle: f64,
    radius: f64,
    max: f64,
}

/// A part of a window, without what cannot matter of it.
#[derive(Clone, Copy, Debug)]
pub(in crate::specular) struct Part {
    /// The places from which light can reach the source.
    pub(in crate::specular) rect: Rect,
    /// How far an end point may be off, on the near plane's scale, because the slopes vary over the part.
    pub(in crate::specular) spread: DVec2,
}

impl<'a> DeflectionBounds<'a> {
    /// The map over a window, and what of the window can matter; `None` when no light from there reaches the source.
    pub(in crate::specular) fn new(
        side: &PaneSide<'a>,
        ends: &Ends,
        window: &Rect,
        detail: Detail,
    ) -> Option<(Self, Part)> {
        let (pane, sign) = (side.pane, side.sign);
        let index = pane.index_of_refraction;
        let outline = &pane.outline;
        let tangents = [
            Interval::new(window.min.x - ends.origin.x, window.max.x - ends.origin.x),
            Interval::new(window.min.y - ends.origin.y, window.max.y - ends.origin.y),
        ]
        .map(|offset| Interval::new(offset.min / ends.near, offset.max / ends.near));
        let directions = directions_of_tangents(&tangents);

        let (near_surface, far_surface) = (side.near_surface(), side.far_surface());
        let (near_everywhere, far_everywhere) =
            (mirrored(pane.bounds(side.near), sign), mirrored(pane.bounds(side.far), sign));
        if let MirroredSource::Direction(last) = &ends.source {
            // Most shading points see the sun through no pane. The steepest slopes of the faces already say so.
            let steepest =
                |axis: usize| near_everywhere.gradient[axis].magnitude() + far_everywhere.gradient[axis].magnitude();
            let strength = refraction_strength_widest(index).max;
            let beside = |axis: usize| {
                let most = Interval::new(-strength * steepest(axis), strength * steepest(axis));
                (last[axis] - most).intersection(directions[axis]).is_empty()
            };
            if beside(0) || beside(1) {
                return None;
            }
        }
        let entry = outline.narrowed(&shifted(window, &times(&tangents, near_everywhere.height)));
        if entry.is_empty() {
            return None;
        }
        let near = match detail {
            Detail::WholeFace => near_everywhere,
            Detail::Region => mirrored(&near_surface.bounds(&entry), sign),
        };
        let near_strength = refraction_strength(index, &directions, &near.gradient);
        // n b_t = a_t - g1 grad h1
        let inner: Box2 = std::array::from_fn(|axis| {
            let momentum = directions[axis] - near_strength * near.gradient[axis];
            Interval::new(momentum.min / index, momentum.max / index)
        });
        let inner = tangents_of_directions(&inner);
        let widest_gap = gap(pane.thickness, near.height, far_everywhere.height);
        let exit = outline.narrowed(&shifted(&entry, &times(&inner, widest_gap)));
        if exit.is_empty() {
            return None;
        }
        let far = match detail {
            Detail::WholeFace => far_everywhere,
            Detail::Region => mirrored(&far_surface.bounds(&exit), sign),
        };
        // The far face's cosine in air is that of w, which the deflection itself bounds: the widest strength is safe.
        let widest = refraction_strength_widest(index);
        let loose: Box2 = std::array::from_fn(|axis| {
            directions[axis] - near_strength * near.gradient[axis] + widest * far.gradient[axis]
        });
        let strengths = [near_strength, refraction_strength(index, &clamped(&loose), &far.gradient)];
        let deflection: Box2 =
            std::array::from_fn(|axis| strengths[1] * far.gradient[axis] - strengths[0] * near.gradient[axis]);
        let gap = gap(pane.thickness, near.height, far.height);
        let to_face = Interval::point(ends.near) + near.height;

        // T / c, and the part of c that is above the glass.
        let (bend, flat, share, glass) = match ends.source {
            MirroredSource::Direction(last) => {
                let first: Box2 =
                    std::array::from_fn(|axis| (last[axis] - deflection[axis]).intersection(directions[axis]));
                if first.iter().any(Interval::is_empty) {
                    return None;
                }
                let hull = std::array::from_fn(|axis| first[axis].union(last[axis]));
                (bend(&clamped(&hull)), tangents_of_directions(&last), Interval::point(1.0), 0.0)
            }
            MirroredSource::Offset(offset) => {
                let above = (offset[2] - to_face - gap).intersection(Interval::new(0.0, f64::INFINITY));
                if above.is_empty() {
                    return None;
                }
                let hull = std::array::from_fn(|axis| directions[axis].union(directions[axis] + deflection[axis]));
                let inverse = inverse(to_face + above);
                let flat = std::array::from_fn(|axis| (offset[axis] - gap * inner[axis]) * inverse);
                let share = (Interval::point(1.0) - to_face * inverse).intersection(Interval::new(0.0, 1.0));
                (bend(&clamped(&hull)), flat, share, gap.max * inverse.max)
            }
        };
        let flat = flat.map(|tangent| Interval::point(ends.near) * tangent);
        let weight = |strength: Interval, sign: f64| {
            let factor = strength * share * Interval::point(ends.near);
            SlopeWeight::new(bend.map(|entry| Interval::point(sign) * factor * entry))
        };
        let to_entry = times(&tangents, near.height);
        let to_glass = times(&inner, gap);
        let near_lever = Interval::new(to_face.min / ends.near, to_face.max / ends.near);
        let deflection = Self {
            side: *side,
            to_entry,
            to_exit: std::array::from_fn(|axis| to_entry[axis] + to_glass[axis]),
            // In the glass a tangent changes by at most as much as in air.
            levers: [
                Lever::new(near_lever),
                Lever::new(Interval::new(near_lever.min, near_lever.max + gap.max / ends.near)),
            ],
            flat: ends.origin + middle(&flat),
            flat_radius: radius(&flat),
            // Slopes are read as they are, and not as mirrored.
            weights: [weight(strengths[0], sign), weight(strengths[1], -sign)],
            tilt: tangents[0].magnitude().max(tangents[1].magnitude()),
            gap: gap.max,
            glass,
        };
        let slopes = [near.gradient, far.gradient].map(|slopes| unmirrored(&slopes, sign));
        let part = deflection.reached(window, slopes.iter().map(|slopes| (middle(slopes), radius(slopes))))?;
        Some((deflection, part))
    }

    /// What of a part of the window can matter; `None` when no light from there reaches the source.
    #[inline(always)]
    pub(in crate::specular) fn part(&self, rect: &Rect) -> Option<Part> {
        let [entry, exit] = self.regions(rect)?;
        let slopes = [self.side.near_surface().slope_bounds(&entry), self.side.far_surface().slope_bounds(&exit)];
        self.reached(rect, slopes.iter().map(|slopes| (middle(slopes), radius(slopes))))
    }

    /// The pane from the side of the shading point.
    pub(in crate::specular) fn side(&self) -> &PaneSide<'a> {
        &self.side
    }

    /// By how much rounding errors of a direction grow when its tangent is taken: `d/dx x / sqrt(1 - x^2)`.
    pub(in crate::specular) fn tangent_rounding(&self) -> f64 {
        let secant_squared = 1.0 + 2.0 * self.tilt * self.tilt;
        secant_squared * secant_squared.sqrt()
    }

    /// Where light from a rectangle of the near plane goes through the near face.
    pub(in crate::specular) fn entry(&self, rect: &Rect) -> Rect {
        shifted(rect, &self.to_entry)
    }

    /// How far x0 may be off: the source's extent, on the near plane's scale.
    #[inline]
    pub(in crate::specular) fn extent(&self) -> DVec2 {
        self.flat_radius
    }

    /// Where light from a part of the window enters and leaves the glass; `None` when that is beside the outline.
    #[inline(always)]
    fn regions(&self, part: &Rect) -> Option<[Rect; 2]> {
        let outline = &self.side.pane.outline;
        let entry = outline.narrowed(&shifted(part, &self.to_entry));
        let exit = outline.narrowed(&shifted(part, &self.to_exit));
        (!entry.is_empty() && !exit.is_empty()).then_some([entry, exit])
    }

    /// The places of a part from which light can reach the source when the slopes of each face are within a radius of
    /// their middle.
    #[inline(always)]
    fn reached(&self, part: &Rect, slopes: impl Iterator<Item = (DVec2, DVec2)>) -> Option<Part> {
        let (mut centre, mut radius, mut spread) = (self.flat, self.flat_radius, DVec2::ZERO);
        for ((slope, slope_radius), weight) in slopes.zip(&self.weights) {
            centre += weight.middle * slope;
            radius += weight.radius * slope.abs();
            spread += weight.magnitude * slope_radius;
        }
        let reach = radius + spread;
        let rect = Rect::new(centre - reach, centre + reach).intersection(part);
        (!rect.is_empty()).then_some(Part { rect, spread })
    }
}

impl Lever {
    fn new(bounds: Interval) -> Self {
        Self { middle: middle_of(bounds), radius: radius_of(bounds), max: bounds.max }
    }
}

impl SlopeWeight {
    /// The symmetric matrix with the entries 11, 12 and 22.
    fn new(entries: [Interval; 3]) -> Self {
        let (middle, radius) = (symmetric(entries.map(middle_of)), symmetric(entries.map(radius_of)));
        Self { middle, radius, magnitude: magnitude(&middle) + radius }
    }
}

/// Bounds on the thickness of the glass along z.
fn gap(thickness: f64, near_heights: Interval, far_heights: Interval) -> Interval {
    let gap = Interval::point(thickness) + far_heights - near_heights;
    Interval::new(gap.min.max(0.0), gap.max)
}

/// Bounds of a face as seen when z is mirrored for a negative sign.
pub(in crate::specular) fn mirrored(bounds: &JetBounds, sign: f64) -> JetBounds {
    if sign > 0.0 {
        return *bounds;
    }
    JetBounds {
        height: -bounds.height,
        gradient: bounds.gradient.map(|slope| -slope),
        hessian: bounds.hessian.map(|curvature| -curvature),
    }
}

fn unmirrored(slopes: &Box2, sign: f64) -> Box2 {
    if sign > 0.0 { *slopes } else { slopes.map(|slope| -slope) }
}

/// A box times an interval.
fn times(vectors: &Box2, factor: Interval) -> Box2 {
    vectors.map(|vector| vector * factor)
}

/// `rect` moved by any vector of a box.
#[inline(always)]
fn shifted(rect: &Rect, by: &Box2) -> Rect {
    Rect::new(rect.min + DVec2::new(by[0].min, by[1].min), rect.max + DVec2::new(by[0].max, by[1].max))
}

#[inline(always)]
fn middle(vectors: &Box2) -> DVec2 {
    DVec2::new(middle_of(vectors[0]), middle_of(vectors[1]))
}

#[inline(always)]
fn radius(vectors: &Box2) -> DVec2 {
    DVec2::new(radius_of(vectors[0]), radius_of(vectors[1]))
}

#[inline(always)]
fn middle_of(interval: Interval) -> f64 {
    0.5 * (interval.min + interval.max)
}

#[inline(always)]
fn radius_of(interval: Interval) -> f64 {
    0.5 * (interval.max - interval.min)
}

#[inline]
fn symmetric([xx, xy, yy]: [f64; 3]) -> DMat2 {
    DMat2::from_cols(DVec2::new(xx, xy), DVec2::new(xy, yy))
}

#[inline(always)]
fn magnitude(matrix: &DMat2) -> DMat2 {
    DMat2::from_cols(matrix.x_axis.abs(), matrix.y_axis.abs())
}

/// One over an interval that is never negative.
fn inverse(interval: Interval) -> Interval {
    Interval::new(1.0 / interval.max, 1.0 / interval.min.max(f64::MIN_POSITIVE))
}
