//! Directions to a rectangle that are uniform in solid angle.
//!
//! The rectangle is seen as a part of the sphere between four great circles. A strip of it is chosen so that the area
//! on one side grows evenly, and then a place along the strip.
//!
//! The equations are those of Ureña, Fajardo and King 2013, "An Area-Preserving Parametrization for Spherical
//! Rectangles".

use std::f64::consts::PI;

use glam::DVec2;

use crate::math::Rect;

/// A rectangle whose half diagonal is below this part of its distance is sampled by area: solid angle hardly varies.
const FAR: f64 = 0.1;

/// Solid angles below this are differences of angles that rounding dominates, steradians.
const SMALLEST: f64 = 1e-6;

/// A rectangle as a viewer sees it who stands over the origin of its plane.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SphericalRectangle {
    rect: Rect,
    /// From the viewer to the plane.
    distance: f64,
    /// Solid angle, and the sum of the two angles at x = `max`, less a full turn, where places are uniform in solid
    /// angle.
    even: Option<[f64; 2]>,
}

/// The sine of the slope of the plane through the viewer and a line at this distance from the origin.
fn slope(offset: f64, distance: f64) -> f64 {
    offset / (offset * offset + distance * distance).sqrt()
}

impl SphericalRectangle {
    /// The rectangle of a plane at a distance above 0, with an area.
    pub(crate) fn new(rect: Rect, distance: f64) -> Self {
        let from_viewer = rect.centre().extend(distance).length();
        if 0.5 * (rect.max - rect.min).length() < FAR * from_viewer {
            return Self { rect, distance, even: None };
        }
        let [left, right] = [rect.min.x, rect.max.x].map(|x| slope(x, distance));
        let [bottom, top] = [rect.min.y, rect.max.y].map(|y| slope(y, distance));
        // Inner angles of the spherical rectangle, counterclockwise from the corner at the right and the bottom.
        let angle = |cosine: f64| libm::acos(cosine.clamp(-1.0, 1.0));
        let [a, b, c, d] = [angle(bottom * right), angle(-right * top), angle(top * left), angle(-left * bottom)];
        let solid_angle = a + b + c + d - 2.0 * PI;
        Self { rect, distance, even: (solid_angle > SMALLEST).then_some([solid_angle, 2.0 * PI - c - d]) }
    }

    /// The density, per solid angle, with which [`Self::sample`] draws a place of the rectangle.
    pub(crate) fn density(&self, place: DVec2) -> f64 {
        let Some([solid_angle, _]) = self.even else {
            let length = place.extend(self.distance).length();
            return length * length * length / (self.rect.area() * self.distance);
        };
        1.0 / solid_angle
    }

    /// Draws a place of the rectangle.
    pub(crate) fn sample(&self, random: DVec2) -> DVec2 {
        let Rect { min, max } = self.rect;
        let Some([solid_angle, start]) = self.even else { return min + (max - min) * random };
        let [bottom, top] = [min.y, max.y].map(|y| slope(y, self.distance));
        let (sine, cosine) = libm::sincos(random.x * solid_angle + start);
        let turned = (-cosine * bottom - top) / sine;
        let across = (1.0 / (turned * turned + bottom * bottom).sqrt()).copysign(turned).clamp(-1.0, 1.0);
        let x = (across * self.distance / (1.0 - across * across).sqrt()).clamp(min.x, max.x);
        let height = (x * x + self.distance * self.distance).sqrt();
        let [low, high] = [min.y, max.y].map(|y| slope(y, height));
        let along = low + random.y * (high - low);
        let y = (along * height / (1.0 - along * along).max(0.0).sqrt()).clamp(min.y, max.y);
        DVec2::new(x, y)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rect([x0, x1]: [f64; 2], [y0, y1]: [f64; 2]) -> Rect {
        Rect::new(DVec2::new(x0, y0), DVec2::new(x1, y1))
    }

    fn grid(n: u32) -> impl Iterator<Item = DVec2> {
        (0..n * n).map(move |k| DVec2::new(f64::from(k % n) + 0.5, f64::from(k / n) + 0.5) / f64::from(n))
    }

    #[test]
    fn a_face_of_a_cube_is_a_sixth_of_the_sphere() {
        let face = SphericalRectangle::new(rect([-0.5, 0.5], [-0.5, 0.5]), 0.5);
        let density = face.density(face.sample(DVec2::splat(0.3)));
        assert!((density * 4.0 * PI / 6.0 - 1.0).abs() < 1e-12, "{density}");
    }

    /// The integral of a function over the solid angle, once by places of equal area and once as sampled.
    #[test]
    fn places_have_the_stated_density() {
        for (x, y, distance) in [
            ([-0.5, 0.5], [-0.5, 0.5], 0.5),
            ([0.2, 1.7], [-3.0, -1.0], 0.4),
            ([-2.0, 0.0], [0.0, 1.0], 1.0),
            ([-1.0, 1.0], [-1.0, 1.0], 0.01),
            ([3.0, 3.2], [-0.1, 0.3], 5.0),
            ([3.0, 3.2], [-0.1, 0.3], 0.5),
        ] {
            let rect = rect(x, y);
            let value = |place: DVec2| {
                let local = (place - rect.min) / (rect.max - rect.min);
                1.0 + local.x + 2.0 * local.y * local.y
            };
            let n = 600;
            let per_area = |place: DVec2| distance / place.extend(distance).length().powi(3);
            let by_area: f64 = grid(n)
                .map(|random| {
                    let place = rect.min + (rect.max - rect.min) * random;
                    value(place) * per_area(place) * rect.area()
                })
                .sum();
            let sampled = SphericalRectangle::new(rect, distance);
            let found: f64 = grid(n)
                .map(|random| {
                    let place = sampled.sample(random);
                    assert!(rect.contains(place), "{place}");
                    value(place) / sampled.density(place)
                })
                .sum();
            assert!((found / by_area - 1.0).abs() < 2e-3, "{x:?} {y:?} {distance}: {found} {by_area}");
        }
    }
}
