//! Cones of directions: the cap that a sphere or a sun subtends.

use std::f64::consts::PI;

use glam::{DVec2, DVec3};

use crate::geometry::Frame;

/// `2 pi (1 - cos)`, without cancellation.
pub(super) fn solid_angle(cos_radius: f64, sin_radius: f64) -> f64 {
    2.0 * PI * one_minus_cos(cos_radius, sin_radius)
}

fn one_minus_cos(cosine: f64, sine: f64) -> f64 {
    if cosine > 0.0 { sine * sine / (1.0 + cosine) } else { 1.0 - cosine }
}

/// A direction uniformly distributed over the cap, and the cap's solid angle.
pub(super) fn sample(axis: DVec3, cos_radius: f64, sin_radius: f64, random: DVec2) -> (DVec3, f64) {
    let height = random.x * one_minus_cos(cos_radius, sin_radius);
    let sine = (height * (2.0 - height)).max(0.0).sqrt();
    let (sin, cos) = libm::sincos(2.0 * PI * random.y);
    let direction = Frame::around(axis).vector_to_world(DVec3::new(sine * cos, sine * sin, 1.0 - height));
    (direction, solid_angle(cos_radius, sin_radius))
}

/// A direction of the upper half space whose density is its cosine over pi.
pub(super) fn cosine_direction(random: DVec2) -> DVec3 {
    let radius = random.x.sqrt();
    let (sin, cos) = libm::sincos(2.0 * PI * random.y);
    DVec3::new(radius * cos, radius * sin, (1.0 - random.x).max(0.0).sqrt())
}
