//! Points on lights: drawn for next event estimation, met by rays.

use std::f64::consts::PI;

use glam::{DVec2, DVec3};

use super::light::{Light, LightKind};
use crate::geometry::{Frame, Ray};

/// Where light comes from: a point, or a direction for a light at infinity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Source {
    /// A point, metres.
    Point(DVec3),
    /// A unit vector towards a light at infinity.
    Direction(DVec3),
}

/// A point of a light, drawn at random.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SourceSample {
    /// Where the light comes from.
    pub source: Source,
    /// Unit normal of the light's surface; `None` for a point light and the sun.
    pub normal: Option<DVec3>,
    /// Intensity of a point light [W/sr], else radiance [W/(m2 sr)], divided by the probability density: per area for
    /// surfaces, per solid angle for the sun, 1 for a point light.
    pub weight: DVec3,
}

/// A direction from a shading point straight to a light, drawn at random.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DirectSample {
    /// Unit vector from the shading point to the light.
    pub direction: DVec3,
    /// Distance to the light; infinite for the sun.
    pub distance: f64,
    /// Radiance times solid angle [W/m2]: radiance / density, or intensity / distance squared for a point light.
    pub weight: DVec3,
    /// Density per solid angle; `None` for a point light, which nothing else can find.
    pub density: Option<f64>,
}

/// Where a ray meets a light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightHit {
    /// Distance along the ray; infinite for the sun.
    pub distance: f64,
    /// Radiance towards the ray's origin; zero on the dark side of a rectangle or a disk.
    pub radiance: DVec3,
}

impl Light {
    /// Radiance, or intensity of a point light.
    pub fn emission(&self) -> DVec3 {
        match self.kind {
            LightKind::Point { intensity, .. } => intensity,
            LightKind::Sphere { radiance, .. }
            | LightKind::Rectangle { radiance, .. }
            | LightKind::Disk { radiance, .. }
            | LightKind::Sun { radiance, .. } => radiance,
        }
    }

    /// Draws a point of the light that may be seen from inside a ball. Every point that can be seen from anywhere in
    /// the ball has a positive density, so that light that arrives there by refraction is not lost at a sphere's limb.
    pub fn sample_source(&self, centre: DVec3, radius: f64, random: DVec2) -> SourceSample {
        match self.kind {
            LightKind::Point { position, intensity } => {
                SourceSample { source: Source::Point(position), normal: None, weight: intensity }
            }
            LightKind::Sphere { centre: light_centre, radius: light_radius, radiance } => {
                // A surface point with the normal n is visible from X when (X - C).n > r. Over all X of the ball that is
                // n.d > (r - R)/D. A density linear in n.d - cos_min cancels the cosine at the light.
                let (axis, cos_min) = side_seen(light_centre, light_radius, centre, radius);
                let cosine = cos_min + (1.0 - cos_min) * random.x.sqrt();
                let normal = around(axis, cosine, random.y);
                let source = Source::Point(light_centre + normal * light_radius);
                let density = self.source_density(centre, radius, source);
                let weight = if density > 0.0 { radiance / density } else { DVec3::ZERO };
                SourceSample { source, normal: Some(normal), weight }
            }
            LightKind::Rectangle { frame, half_size, radiance } => {
                let local =
                    DVec3::new((2.0 * random.x - 1.0) * half_size[0], (2.0 * random.y - 1.0) * half_size[1], 0.0);
                SourceSample {
                    source: Source::Point(frame.point_to_world(local)),
                    normal: Some(frame.axes.z_axis),
                    weight: radiance * rectangle_area(half_size),
                }
            }
            LightKind::Disk { frame, radius, radiance } => {
                let (sin, cos) = libm::sincos(2.0 * PI * random.y);
                let local = DVec2::new(cos, sin) * (radius * random.x.sqrt());
                SourceSample {
                    source: Source::Point(frame.point_to_world(local.extend(0.0))),
                    normal: Some(frame.axes.z_axis),
                    weight: radiance * disk_area(radius),
                }
            }
            LightKind::Sun { direction, cos_radius, sin_radius, radiance } => {
                let (direction, solid_angle) = sample_cap(direction, cos_radius, sin_radius, random);
                SourceSample { source: Source::Direction(direction), normal: None, weight: radiance * solid_angle }
            }
        }
    }

    /// Density with which [`Light::sample_source`] draws a source: per area for surfaces, per solid angle for the sun.
    /// Infinite for a point light, which has only one.
    pub fn source_density(&self, centre: DVec3, radius: f64, source: Source) -> f64 {
        match (self.kind, source) {
            (LightKind::Sphere { centre: light_centre, radius: light_radius, .. }, Source::Point(position)) => {
                let (axis, cos_min) = side_seen(light_centre, light_radius, centre, radius);
                let cosine = (position - light_centre).dot(axis) / light_radius;
                let side = light_radius * (1.0 - cos_min);
                (cosine - cos_min).max(0.0) / (PI * side * side)
            }
            (LightKind::Rectangle { half_size, .. }, _) => 1.0 / rectangle_area(half_size),
            (LightKind::Disk { radius, .. }, _) => 1.0 / disk_area(radius),
            (LightKind::Sun { cos_radius, sin_radius, .. }, _) => 1.0 / cap_solid_angle(cos_radius, sin_radius),
            (LightKind::Point { .. } | LightKind::Sphere { .. }, _) => f64::INFINITY,
        }
    }

    /// The source where a ray meets the light, and the cosine of the angle at which it does; 1 for the sun.
    pub fn met(&self, ray: &Ray, hit: &LightHit) -> (Source, f64) {
        let position = ray.at(hit.distance);
        match self.kind {
            LightKind::Point { .. } => (Source::Point(position), 1.0),
            LightKind::Sphere { centre, radius, .. } => {
                (Source::Point(position), (-(position - centre).dot(ray.direction) / radius).max(0.0))
            }
            LightKind::Rectangle { frame, .. } | LightKind::Disk { frame, .. } => {
                (Source::Point(position), -frame.axes.z_axis.dot(ray.direction))
            }
            LightKind::Sun { .. } => (Source::Direction(ray.direction), 1.0),
        }
    }

    /// The sample that [`Light::sample_source`] would draw where a ray meets the light.
    pub fn sample_met(&self, centre: DVec3, radius: f64, ray: &Ray, hit: &LightHit) -> SourceSample {
        let (source, _) = self.met(ray, hit);
        let normal = match (self.kind, source) {
            (LightKind::Sphere { centre, radius, .. }, Source::Point(position)) => Some((position - centre) / radius),
            (LightKind::Rectangle { frame, .. } | LightKind::Disk { frame, .. }, _) => Some(frame.axes.z_axis),
            _ => None,
        };
        let density = self.source_density(centre, radius, source);
        let weight = if density > 0.0 { hit.radiance / density } else { DVec3::ZERO };
        SourceSample { source, normal, weight }
    }

    /// Draws a direction in which the light is seen from `point` if nothing is in the way; `None` when it cannot be.
    pub fn sample_direct(&self, point: DVec3, random: DVec2) -> Option<DirectSample> {
        match self.kind {
            LightKind::Point { position, intensity } => {
                let offset = position - point;
                let distance = offset.length();
                (distance > 0.0).then(|| DirectSample {
                    direction: offset / distance,
                    distance,
                    weight: intensity / (distance * distance),
                    density: None,
                })
            }
            LightKind::Sphere { centre, radius, radiance } => {
                let (axis, cos_radius, sin_radius) = subtended_cap(point, centre, radius)?;
                let (direction, solid_angle) = sample_cap(axis, cos_radius, sin_radius, random);
                let hit = self.intersect(&Ray::new(point, direction));
                // Rounding can push a direction at the limb past the sphere: the limb is then at the tangent length.
                let offset = centre - point;
                let distance = hit.map_or_else(|| direction.dot(offset), |hit| hit.distance);
                Some(DirectSample {
                    direction,
                    distance,
                    weight: radiance * solid_angle,
                    density: Some(1.0 / solid_angle),
                })
            }
            LightKind::Rectangle { frame, half_size, .. } => {
                self.sample_flat(&frame, rectangle_area(half_size), point, random)
            }
            LightKind::Disk { frame, radius, .. } => self.sample_flat(&frame, disk_area(radius), point, random),
            LightKind::Sun { direction, cos_radius, sin_radius, radiance } => {
                let (direction, solid_angle) = sample_cap(direction, cos_radius, sin_radius, random);
                Some(DirectSample {
                    direction,
                    distance: f64::INFINITY,
                    weight: radiance * solid_angle,
                    density: Some(1.0 / solid_angle),
                })
            }
        }
    }

    /// As [`Light::sample_direct`], for a flat light of the given area that shines along the z axis of `frame`.
    fn sample_flat(&self, frame: &Frame, area: f64, point: DVec3, random: DVec2) -> Option<DirectSample> {
        let sample = self.sample_source(point, 0.0, random);
        let Source::Point(position) = sample.source else { return None };
        let offset = position - point;
        let distance_squared = offset.length_squared();
        let distance = distance_squared.sqrt();
        let direction = offset / distance;
        let cosine = -direction.dot(frame.axes.z_axis);
        (cosine > 0.0).then(|| {
            let solid_angle = area * cosine / distance_squared;
            DirectSample {
                direction,
                distance,
                weight: self.emission() * solid_angle,
                density: Some(1.0 / solid_angle),
            }
        })
    }

    /// Density per solid angle with which [`Light::sample_direct`] draws, from `point`, the direction of a ray that
    /// meets the light at `hit`.
    pub fn direct_density(&self, ray: &Ray, hit: &LightHit) -> f64 {
        match self.kind {
            LightKind::Point { .. } => 0.0,
            LightKind::Sphere { centre, radius, .. } => subtended_cap(ray.origin, centre, radius)
                .map_or(0.0, |(_, cos_radius, sin_radius)| 1.0 / cap_solid_angle(cos_radius, sin_radius)),
            LightKind::Rectangle { frame, half_size, .. } => flat_density(&frame, rectangle_area(half_size), ray, hit),
            LightKind::Disk { frame, radius, .. } => flat_density(&frame, disk_area(radius), ray, hit),
            LightKind::Sun { cos_radius, sin_radius, .. } => 1.0 / cap_solid_angle(cos_radius, sin_radius),
        }
    }

    /// Where the ray meets the light from outside; `None` when it misses. A point light is never met.
    pub fn intersect(&self, ray: &Ray) -> Option<LightHit> {
        match self.kind {
            LightKind::Point { .. } => None,
            LightKind::Sphere { centre, radius, radiance } => {
                let offset = centre - ray.origin;
                let along = offset.dot(ray.direction);
                // The distance from the centre to the ray, without cancellation for a far sphere.
                let across_squared = (offset - ray.direction * along).length_squared();
                if along <= 0.0 || across_squared > radius * radius || offset.length_squared() <= radius * radius {
                    return None;
                }
                Some(LightHit { distance: along - (radius * radius - across_squared).sqrt(), radiance })
            }
            LightKind::Rectangle { frame, half_size, radiance } => intersect_flat(&frame, radiance, ray, |point| {
                point.x.abs() <= half_size[0] && point.y.abs() <= half_size[1]
            }),
            LightKind::Disk { frame, radius, radiance } => {
                intersect_flat(&frame, radiance, ray, |point| point.length_squared() <= radius * radius)
            }
            LightKind::Sun { direction, sin_radius, radiance, .. } => {
                // |r x d| is exact for small angles where the cosine is not.
                let sine_squared = ray.direction.cross(direction).length_squared();
                (ray.direction.dot(direction) > 0.0 && sine_squared <= sin_radius * sin_radius)
                    .then_some(LightHit { distance: f64::INFINITY, radiance })
            }
        }
    }
}

/// Area of a rectangle, from half its extent along x and y.
fn rectangle_area(half_size: [f64; 2]) -> f64 {
    4.0 * half_size[0] * half_size[1]
}

fn disk_area(radius: f64) -> f64 {
    PI * radius * radius
}

/// Density per solid angle of points that are uniform over a flat light of the given area.
fn flat_density(frame: &Frame, area: f64, ray: &Ray, hit: &LightHit) -> f64 {
    let cosine = -ray.direction.dot(frame.axes.z_axis);
    if cosine > 0.0 { hit.distance * hit.distance / (area * cosine) } else { 0.0 }
}

/// Where the ray meets the flat light that `holds` the points of the plane through `frame`.
fn intersect_flat(frame: &Frame, radiance: DVec3, ray: &Ray, holds: impl Fn(DVec2) -> bool) -> Option<LightHit> {
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

/// The middle of the side of a sphere that may be seen from inside a ball, and the cosine of its edge.
fn side_seen(sphere: DVec3, sphere_radius: f64, ball: DVec3, ball_radius: f64) -> (DVec3, f64) {
    let offset = ball - sphere;
    let distance = offset.length();
    if distance > 0.0 {
        (offset / distance, ((sphere_radius - ball_radius) / distance).clamp(-1.0, 1.0))
    } else {
        (DVec3::Z, -1.0)
    }
}

/// The unit vector at an angle of the given cosine to `axis`, at the azimuth `2 pi turn`.
fn around(axis: DVec3, cosine: f64, turn: f64) -> DVec3 {
    let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
    let (sin, cos) = libm::sincos(2.0 * PI * turn);
    Frame::around(axis).vector_to_world(DVec3::new(sine * cos, sine * sin, cosine))
}

/// `2 pi (1 - cos)`, without cancellation.
pub(crate) fn cap_solid_angle(cos_radius: f64, sin_radius: f64) -> f64 {
    2.0 * PI * one_minus_cos(cos_radius, sin_radius)
}

fn one_minus_cos(cosine: f64, sine: f64) -> f64 {
    if cosine > 0.0 { sine * sine / (1.0 + cosine) } else { 1.0 - cosine }
}

/// A direction uniformly distributed over the cap, and the cap's solid angle.
fn sample_cap(axis: DVec3, cos_radius: f64, sin_radius: f64, random: DVec2) -> (DVec3, f64) {
    let height = random.x * one_minus_cos(cos_radius, sin_radius);
    let sine = (height * (2.0 - height)).max(0.0).sqrt();
    let (sin, cos) = libm::sincos(2.0 * PI * random.y);
    let direction = Frame::around(axis).vector_to_world(DVec3::new(sine * cos, sine * sin, 1.0 - height));
    (direction, cap_solid_angle(cos_radius, sin_radius))
}

/// Axis, cosine and sine of the cone that a sphere subtends; `None` from inside.
fn subtended_cap(point: DVec3, centre: DVec3, radius: f64) -> Option<(DVec3, f64, f64)> {
    let offset = centre - point;
    let distance = offset.length();
    if distance <= radius {
        return None;
    }
    let sine = radius / distance;
    Some((offset / distance, (1.0 - sine * sine).sqrt(), sine))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lights() -> Vec<Light> {
        let angle = 3f64.to_radians();
        [
            LightKind::Sphere { centre: DVec3::new(0.3, 1.0, 2.0), radius: 0.4, radiance: DVec3::new(1.0, 2.0, 3.0) },
            LightKind::Rectangle {
                frame: Frame::new(DVec3::new(0.2, 0.1, 1.5), DVec3::X, DVec3::NEG_Y),
                half_size: [0.5, 0.25],
                radiance: DVec3::ONE,
            },
            LightKind::Disk {
                frame: Frame {
                    origin: DVec3::new(-0.3, 0.4, 1.2),
                    ..Frame::around(DVec3::new(0.2, -0.1, -1.0).normalize())
                },
                radius: 0.45,
                radiance: DVec3::new(3.0, 1.0, 2.0),
            },
            LightKind::Sun {
                direction: DVec3::new(0.1, 0.2, 1.0).normalize(),
                cos_radius: libm::cos(angle),
                sin_radius: libm::sin(angle),
                radiance: DVec3::ONE,
            },
        ]
        .into_iter()
        .map(|kind| Light { name: "test".into(), kind })
        .collect()
    }

    fn grid(n: u32) -> impl Iterator<Item = DVec2> {
        let centre = move |k: u32| (f64::from(k) + 0.5) / f64::from(n);
        (0..n * n).map(move |k| DVec2::new(centre(k % n), centre(k / n)))
    }

    #[test]
    fn direct_samples_meet_the_light_with_the_stated_density() {
        let point = DVec3::new(0.1, -0.2, 0.3);
        for light in lights() {
            for random in grid(24) {
                let sample = light.sample_direct(point, random).unwrap();
                let ray = Ray::new(point, sample.direction);
                let hit = light.intersect(&ray).expect("a direction inside the cone meets the light");
                assert!((sample.direction.length() - 1.0).abs() < 1e-12);
                let density = light.direct_density(&ray, &hit);
                assert!((density / sample.density.unwrap() - 1.0).abs() < 1e-9, "{light:?}");
                assert!((sample.weight * density - light.emission()).length() < 1e-9);
            }
        }
    }

    /// Irradiance on a plane, once by directions and once by points of the surface: two measures, one number.
    #[test]
    fn area_and_solid_angle_sampling_give_the_same_irradiance() {
        let point = DVec3::new(0.1, -0.2, 0.3);
        for light in &lights()[..3] {
            let n = 400;
            let by_direction: f64 = grid(n)
                .map(|random| light.sample_direct(point, random).map_or(0.0, |s| s.weight.x * s.direction.z.max(0.0)))
                .sum();
            let by_area: f64 = grid(n)
                .map(|random| {
                    let sample = light.sample_source(point, 0.05, random);
                    let Source::Point(position) = sample.source else { unreachable!() };
                    let offset = position - point;
                    let direction = offset.normalize();
                    let cosine = -direction.dot(sample.normal.unwrap());
                    sample.weight.x * cosine.max(0.0) * direction.z.max(0.0) / offset.length_squared()
                })
                .sum();
            assert!((by_area / by_direction - 1.0).abs() < 1e-3, "{by_area} {by_direction}");
        }
    }

    #[test]
    fn every_limb_point_seen_from_the_ball_can_be_drawn() {
        let light = &lights()[0];
        let LightKind::Sphere { centre, radius, .. } = light.kind else { unreachable!() };
        let (ball_centre, ball_radius) = (DVec3::new(0.0, 0.0, 0.2), 0.3);
        let axis = (ball_centre - centre).normalize();
        let drawn = grid(64).map(|random| {
            let Source::Point(position) = light.sample_source(ball_centre, ball_radius, random).source else {
                unreachable!()
            };
            (position - centre).dot(axis) / radius
        });
        let lowest = drawn.fold(f64::INFINITY, f64::min);
        let limit = (radius - ball_radius) / (ball_centre - centre).length();
        assert!(lowest > limit - 1e-12 && lowest < limit + 0.1, "{lowest} {limit}");
    }

    #[test]
    fn flat_lights_are_dark_behind() {
        for (light, x, y) in [(&lights()[1], 0.2, 0.1), (&lights()[2], -0.3, 0.4)] {
            let behind = DVec3::new(x, y, 3.0);
            let hit = light.intersect(&Ray::new(behind, DVec3::NEG_Z)).unwrap();
            assert_eq!(hit.radiance, DVec3::ZERO);
            assert_eq!(light.sample_direct(behind, DVec2::splat(0.3)), None);
            let ray = Ray::new(DVec3::new(x, y, 0.0), DVec3::Z);
            assert_eq!(light.intersect(&ray).unwrap().radiance, light.emission());
        }
    }

    #[test]
    fn a_disk_ends_at_its_radius() {
        let light = &lights()[2];
        let LightKind::Disk { frame, radius, .. } = light.kind else { unreachable!() };
        let from_below = |local: DVec2| {
            let ray = Ray::new(frame.point_to_world(local.extend(0.7)), -frame.axes.z_axis);
            light.intersect(&ray).map(|hit| hit.distance)
        };
        for turn in 0..16 {
            let direction = DVec2::new(libm::cos(f64::from(turn)), libm::sin(f64::from(turn)));
            assert!((from_below(direction * (0.999 * radius)).unwrap() - 0.7).abs() < 1e-12);
            assert_eq!(from_below(direction * (1.001 * radius)), None);
        }
    }

    /// The irradiance on the axis of a disk of radiance L is pi L sin^2 of the angle that its radius subtends.
    #[test]
    fn a_disk_makes_the_irradiance_of_a_disk() {
        let radius = 0.45;
        let light = Light {
            name: "test".into(),
            kind: LightKind::Disk { frame: Frame::around(DVec3::NEG_Z), radius, radiance: DVec3::ONE },
        };
        for distance in [0.3, 1.0, 30.0] {
            let point = DVec3::new(0.0, 0.0, -distance);
            let n = 400;
            let sum: f64 = grid(n)
                .map(|random| light.sample_direct(point, random).map_or(0.0, |s| s.weight.x * s.direction.z))
                .sum();
            let irradiance = sum / f64::from(n * n);
            let expected = PI * radius * radius / (radius * radius + distance * distance);
            assert!((irradiance / expected - 1.0).abs() < 1e-4, "{distance}: {irradiance} {expected}");
        }
    }
}
