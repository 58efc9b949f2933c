//! Flat lights of uniform radiance, which shine along the z axis of their frame.

use glam::{DVec2, DVec3};

use super::{Emitter, LiSample, LightHit, Source};
use crate::geometry::{Frame, Ray};

/// Draws a direction from `point` to a flat light of the given area, by a point that is uniform over it.
pub(super) fn sample_li(
    light: &impl Emitter,
    frame: &Frame,
    area: f64,
    point: DVec3,
    random: DVec2,
) -> Option<LiSample> {
    let sample = light.sample_source(point, 0.0, random);
    let Source::Point(position) = sample.source else { return None };
    let offset = position - point;
    let distance_squared = offset.length_squared();
    let distance = distance_squared.sqrt();
    let direction = offset / distance;
    let cosine = -direction.dot(frame.axes.z_axis);
    (cosine > 0.0).then(|| {
        let solid_angle = area * cosine / distance_squared;
        LiSample { direction, distance, weight: light.emission() * solid_angle, pdf: Some(1.0 / solid_angle) }
    })
}

/// Density per solid angle of points that are uniform over a flat light of the given area.
pub(super) fn pdf_li(frame: &Frame, area: f64, ray: &Ray, hit: &LightHit) -> f64 {
    let cosine = -ray.direction.dot(frame.axes.z_axis);
    if cosine > 0.0 { hit.distance * hit.distance / (area * cosine) } else { 0.0 }
}

/// Where the ray meets the flat light that `holds` the points of the plane through `frame`.
pub(super) fn intersect(frame: &Frame, radiance: DVec3, ray: &Ray, holds: impl Fn(DVec2) -> bool) -> Option<LightHit> {
    let origin = frame.point_to_local(ray.origin);
    let direction = frame.vector_to_local(ray.direction);
    let distance = -origin.z / direction.z;
    if !(distance > 0.0 && distance.is_finite()) {
        return None;
    }
    let point = origin + direction * distance;
    let radiance = if direction.z < 0.0 { radiance } else { DVec3::ZERO };
    holds(point.truncate()).then_some(LightHit { distance, radiance })
}

/// The largest solid angle, up to 2 pi, of a light with this area whose points are within `extent` of `centre`.
pub(super) fn largest_solid_angle(area: f64, centre: DVec3, extent: f64, [min, max]: [DVec3; 2]) -> f64 {
    let whole = 2.0 * std::f64::consts::PI;
    let nearest = centre.distance(centre.clamp(min, max)) - extent;
    // From no nearer than this, the area can be seen at no larger angle than if it were all there, seen head on.
    if nearest > 0.0 { (area / (nearest * nearest)).min(whole) } else { whole }
}
