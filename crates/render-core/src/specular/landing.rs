//! Where light from a part of the deflection window lands, bounded by interval arithmetic over parts of any size.
//!
//! Light travels towards +z (the pane is mirrored if need be). With p, r, q the tangents of the three segments O X1,
//! X1 X2, X2 S, the path ends at a source point S when
//!
//! ```text
//! S_t - O_t = (near + h1) p + gap r + above q = c p + gap r + above (q - p),    c = near + h1 + above
//! ```
//!
//! and in a direction of tangent T when `T = p + (q - p)`. In both cases `q - p = B (g2 grad h2 - g1 grad h1)` with a
//! bounded matrix B and bounded strengths g of refraction, so that the place x = O_t + near p where the path crosses the
//! near plane solves
//!
//! ```text
//! x = x0 + L1 grad h1(X1) + L2 grad h2(X2)
//! ```
//!
//! with a vector x0 and matrices L that hardly vary. They are bounded once over the whole window; slopes and curvatures,
//! which decide, are read for each part.

use glam::{DMat2, DVec2};

use super::{
    direction_bounds::{
        Box2, bend, clamped, directions_of_tangents, refraction_strength, refraction_strength_widest,
        tangents_of_directions,
    },
    side::PaneSide,
};
use crate::{
    counters::Counters,
    geometry::{Interval, JetBounds, Rect, ShapeBounds},
};

/// A shading point and a source as seen from a pane, mirrored so that light travels towards +z.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ends {
    /// The shading point's x and y.
    pub(super) origin: DVec2,
    /// Height of the undisplaced near face above the shading point.
    pub(super) near: f64,
    /// Where the light comes from.
    pub(super) source: MirroredSource,
}

/// A source, mirrored with its pane.
#[derive(Clone, Copy, Debug)]
pub(super) enum MirroredSource {
    /// Bounds on a point relative to the shading point.
    Offset([Interval; 3]),
    /// Bounds on the tangential part of a direction.
    Direction(Box2),
}

/// For what part of a face bounds are read.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Detail {
    /// For all of it, without looking.
    WholeFace,
    /// For the part where light from the window goes through.
    Region,
}

/// The map from the near plane to the source, bounded over a window.
#[derive(Clone, Copy, Debug)]
pub(super) struct Landing<'a> {
    side: PaneSide<'a>,
    outline: Rect,
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
pub(super) struct Part {
    /// The places from which light can reach the source.
    pub(super) rect: Rect,
    /// How far a landing may be off, on the near plane's scale, because the slopes vary over the part.
    pub(super) spread: DVec2,
}

/// How the map stretches a part of the window: the derivative of the landing by the place, on the near plane's scale.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stretch {
    /// Middle of the derivative's bounds.
    derivative: DMat2,
    /// How far each entry, as a mean over a straight line from a shot to any place of the part, may be from its middle.
    mean_error: DMat2,
    /// Inverse of the middle of the derivative's bounds.
    pub(super) inverse: DMat2,
    /// Bounds, entry by entry, on how far `inverse` times the derivative is from the identity anywhere in the part.
    defect: DMat2,
}

/// The derivative of the landing leaves out how the refraction's strength, B and the heights change over the part: terms of
/// the size of a slope times the sine of an angle of incidence times what is kept. This multiple of it is an estimate and
/// no bound, so that what rests on it has to be checked at random. It also stands for using x0, the matrices L and the levers
/// a little outside the window that they are bounded for: by the slack of a shot, and by the height of the relief where the
/// shot goes through it.
const LEFT_OUT: f64 = 1.5;

/// A part is injective when its defect is below 1; this much below, so that rounding cannot matter.
const MOST_DEFECT: f64 = 0.99;

impl<'a> Landing<'a> {
    /// The map over a window, and what of the window can matter; `None` when no light from there reaches the source.
    pub(super) fn new(side: &PaneSide<'a>, ends: &Ends, window: &Rect, detail: Detail) -> Option<(Self, Part)> {
        let (pane, sign) = (side.pane, side.sign);
        let index = pane.index_of_refraction;
        let outline = pane.outline();
        let tangents = [
            Interval::new(window.min.x - ends.origin.x, window.max.x - ends.origin.x),
            Interval::new(window.min.y - ends.origin.y, window.max.y - ends.origin.y),
        ]
        .map(|offset| Interval::new(offset.min / ends.near, offset.max / ends.near));
        let directions = directions_of_tangents(&tangents);

        let (near_surface, far_surface) = (side.near_surface(), side.far_surface());
        let (near_everywhere, far_everywhere) =
            (mirrored(near_surface.all_bounds(), sign), mirrored(far_surface.all_bounds(), sign));
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
        let entry = shifted(window, &times(&tangents, near_everywhere.height)).intersection(&outline);
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
        let exit = shifted(&entry, &times(&inner, widest_gap)).intersection(&outline);
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
        let landing = Self {
            side: *side,
            outline,
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
        let part = landing.reached(window, slopes.iter().map(|slopes| (middle(slopes), radius(slopes))))?;
        Some((landing, part))
    }

    /// What of a part of the window can matter; `None` when no light from there reaches the source.
    #[inline(always)]
    pub(super) fn part(&self, rect: &Rect) -> Option<Part> {
        let [entry, exit] = self.regions(rect)?;
        let slopes = [self.side.near_surface().slope_bounds(&entry), self.side.far_surface().slope_bounds(&exit)];
        self.reached(rect, slopes.iter().map(|slopes| (middle(slopes), radius(slopes))))
    }

    /// Whether light from a rectangle of the near plane goes through the outline of both faces.
    #[inline(always)]
    pub(super) fn meets_glass(&self, rect: &Rect) -> bool {
        self.regions(rect).is_some()
    }

    /// The shapes of both faces where light from a rectangle of the near plane goes through, also beyond the outline.
    #[inline(always)]
    pub(super) fn shapes(&self, rect: &Rect, counters: &mut Counters) -> [ShapeBounds; 2] {
        counters.height_evaluations += 2;
        let [entry, exit] = [shifted(rect, &self.to_entry), shifted(rect, &self.to_exit)];
        // On the way from where the shot starts, at most a radius of `to_entry` from the middle, to any place of the
        // rectangle, the places are on average half as far from the middle as these ends.
        let nearer = 0.25 * (rect.max - rect.min) - 0.5 * radius(&self.to_entry);
        let reach = |face: &Rect| 0.5 * (face.max - face.min) - nearer;
        [
            self.side.near_surface().shape_bounds(&entry, reach(&entry)),
            self.side.far_surface().shape_bounds(&exit, reach(&exit)),
        ]
    }

    /// As [`Self::part`], with the shapes of the faces there.
    #[inline(always)]
    pub(super) fn shaped_part(&self, rect: &Rect, shapes: &[ShapeBounds; 2]) -> Option<Part> {
        self.reached(rect, shapes.iter().map(|face| (face.slope, face.slope_radius)))
    }

    /// The pane from the side of the shading point.
    pub(super) fn side(&self) -> &PaneSide<'a> {
        &self.side
    }

    /// By how much rounding errors of a direction grow when its tangent is taken: `d/dx x / sqrt(1 - x^2)`.
    pub(super) fn tangent_rounding(&self) -> f64 {
        let secant_squared = 1.0 + 2.0 * self.tilt * self.tilt;
        secant_squared * secant_squared.sqrt()
    }

    /// Where light from a rectangle of the near plane goes through the near face.
    pub(super) fn entry(&self, rect: &Rect) -> Rect {
        shifted(rect, &self.to_entry)
    }

    /// How far x0 may be off: the source's extent, on the near plane's scale.
    #[inline]
    pub(super) fn extent(&self) -> DVec2 {
        self.flat_radius
    }

    /// The derivative of the landing where the faces have the given shapes; `None` where its middle is singular.
    #[inline(always)]
    pub(super) fn stretch(&self, faces: &[ShapeBounds; 2]) -> Option<Stretch> {
        let (mut derivative, mut error, mut mean_error) = (DMat2::IDENTITY, DMat2::ZERO, DMat2::ZERO);
        let (mut steepest, mut largest, mut bent) = (0.0, 1.0, 0.0);
        for ((face, weight), lever) in faces.iter().zip(&self.weights).zip(&self.levers) {
            let size = magnitude(&face.curvature);
            derivative -= weight.middle * (face.curvature * lever.middle);
            let unsure = weight.magnitude * (size * lever.radius) + weight.radius * (size * lever.middle);
            let varying = weight.magnitude * (face.curvature_radius * lever.max);
            let sizes = weight.magnitude * (size * lever.max) + varying;
            // The near face's curvature turns the ray in the glass, which moves X2.
            let unsure = unsure + sizes * (self.gap * bent);
            error += unsure + varying;
            mean_error += unsure + weight.magnitude * (face.mean_radius * lever.max);
            largest += larger(sizes.x_axis.max_element(), sizes.y_axis.max_element());
            let most = size + face.curvature_radius;
            bent = larger(larger(most.x_axis.x, most.x_axis.y), most.y_axis.y);
            steepest = larger(steepest, (face.slope.abs() + face.slope_radius).max_element());
        }
        let obliquity = (self.tilt + steepest) * (1.0 + self.tilt * self.tilt);
        let left_out = (LEFT_OUT * steepest * obliquity + self.glass) * largest;
        let left_out = DMat2::from_cols(DVec2::splat(left_out), DVec2::splat(left_out));
        let (error, mean_error) = (error + left_out, mean_error + left_out);
        let scale = 1.0 / derivative.determinant();
        let inverse = DMat2::from_cols(
            DVec2::new(derivative.y_axis.y, -derivative.x_axis.y) * scale,
            DVec2::new(-derivative.y_axis.x, derivative.x_axis.x) * scale,
        );
        let defect = magnitude(&inverse) * error;
        inverse.is_finite().then_some(Stretch { derivative, mean_error, inverse, defect })
    }

    /// Where light from a part of the window enters and leaves the glass; `None` when that is beside the outline.
    #[inline(always)]
    fn regions(&self, part: &Rect) -> Option<[Rect; 2]> {
        let entry = shifted(part, &self.to_entry).intersection(&self.outline);
        let exit = shifted(part, &self.to_exit).intersection(&self.outline);
        (!entry.is_empty() && !exit.is_empty()).then_some([entry, exit])
    }

    /// The places of a part from which light can reach the source when the slopes of each face are within a radius of their
    /// middle.
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

impl Stretch {
    /// By how much the place of a path predicted from a shot may be off, if it is within `away` of the shot, coordinate by
    /// coordinate, and the shot is off by `error` in each component.
    #[inline(always)]
    pub(super) fn error_of_prediction(&self, away: DVec2, error: f64) -> DVec2 {
        magnitude(&self.inverse) * (self.mean_error * away + error)
    }

    /// The places of a part that can land nearer than `slack` to the source, when a shot from `start` misses it by `miss`.
    ///
    /// Near a fold the landing moves hardly at all in one direction, however the place moves: that direction tells most.
    /// Across it, the landing moves like nowhere else, which bounds the places to a strip.
    #[inline(always)]
    pub(super) fn reaching(&self, part: &Rect, start: DVec2, miss: DVec2, slack: f64) -> Rect {
        let squares = self.derivative * self.derivative.transpose();
        // Near a fold, all columns are along the direction in which the landing moves most.
        let stiff = if squares.x_axis.x > squares.y_axis.y { squares.x_axis } else { squares.y_axis };
        let mut left = Rect::new(part.min - start, part.max - start);
        for along in [stiff, DVec2::new(-stiff.y, stiff.x)] {
            let away = left.min.abs().max(left.max.abs());
            let by = self.derivative.transpose() * along;
            let unsure = (self.mean_error * away + slack).dot(along.abs());
            let moved = along.dot(miss);
            let (low, high) = (by * left.min, by * left.max);
            let (low, high) = (low.min(high), low.max(high));
            // What each coordinate has to make up for, whatever the other one does.
            let needed = DVec2::splat(moved) - DVec2::new(high.y, high.x) - unsure;
            let allowed = DVec2::splat(moved) - DVec2::new(low.y, low.x) + unsure;
            if needed.cmpgt(high).any() || allowed.cmplt(low).any() {
                return Rect::new(part.max, part.min);
            }
            let scale = by.recip();
            let (a, b) = (needed * scale, allowed * scale);
            // Where a coordinate has no influence, this is infinite or not a number, which bounds nothing.
            left = left.intersection(&Rect::new(a.min(b), a.max(b)));
        }
        Rect::new(start + left.min, start + left.max).intersection(part)
    }

    /// Whether no two places of a part with these half sides land at the same point: the derivative, brought near the
    /// identity, stays nearer to it than 1 in the norm in which the part is a unit square.
    #[inline(always)]
    pub(super) fn is_injective(&self, half_size: DVec2) -> bool {
        (self.defect * half_size).cmple(half_size * MOST_DEFECT).all()
    }
}

/// Bounds on the thickness of the glass along z.
fn gap(thickness: f64, near_heights: Interval, far_heights: Interval) -> Interval {
    let gap = Interval::point(thickness) + far_heights - near_heights;
    Interval::new(gap.min.max(0.0), gap.max)
}

/// Bounds of a face as seen when z is mirrored for a negative sign.
pub(super) fn mirrored(bounds: &JetBounds, sign: f64) -> JetBounds {
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

/// The larger of two numbers.
#[inline(always)]
fn larger(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

/// One over an interval that is never negative.
fn inverse(interval: Interval) -> Interval {
    Interval::new(1.0 / interval.max, 1.0 / interval.min.max(f64::MIN_POSITIVE))
}
