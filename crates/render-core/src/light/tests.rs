//! Laws that every light obeys, and what is particular to some.

use std::f64::consts::PI;

use glam::{DVec2, DVec3};

use super::*;
use crate::geometry::{Frame, Ray};
use crate::settings::Triple;

fn light(description: LightDescription) -> Light {
    Light::new(&description)
}

const DISK_CENTRE: Triple = [-0.3, 0.4, 1.2];
const DISK_NORMAL: Triple = [0.2, -0.1, -1.0];
const DISK_RADIUS: f64 = 0.45;

fn lights() -> Vec<Light> {
    let name = || "test".to_owned();
    [
        LightDescription::Sphere(SphereLight {
            name: name(),
            centre: [0.3, 1.0, 2.0],
            radius: 0.4,
            radiance: [1.0, 2.0, 3.0],
        }),
        LightDescription::Rectangle(RectangleLight {
            name: name(),
            centre: [0.2, 0.1, 1.5],
            edge_u: [1.0, 0.0, 0.0],
            edge_v: [0.0, -0.5, 0.0],
            radiance: [1.0; 3],
        }),
        LightDescription::Disk(DiskLight {
            name: name(),
            centre: DISK_CENTRE,
            normal: DISK_NORMAL,
            radius: DISK_RADIUS,
            radiance: [3.0, 1.0, 2.0],
        }),
        LightDescription::Sun(SunLight {
            name: name(),
            direction: [0.1, 0.2, 1.0],
            angular_radius: 3.0,
            radiance: [1.0; 3],
        }),
    ]
    .map(light)
    .into()
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
            let sample = light.sample_li(point, random).unwrap();
            let ray = Ray::new(point, sample.direction);
            let hit = light.intersect(&ray).expect("a direction inside the cone meets the light");
            assert!((sample.direction.length() - 1.0).abs() < 1e-12);
            let density = light.pdf_li(&ray, &hit);
            assert!((density / sample.pdf.unwrap() - 1.0).abs() < 1e-9, "{light:?}");
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
            .map(|random| light.sample_li(point, random).map_or(0.0, |s| s.weight.x * s.direction.z.max(0.0)))
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
    let LightBounds::Ball { centre, radius } = light.bounds() else { unreachable!() };
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
        assert_eq!(light.sample_li(behind, DVec2::splat(0.3)), None);
        let ray = Ray::new(DVec3::new(x, y, 0.0), DVec3::Z);
        assert_eq!(light.intersect(&ray).unwrap().radiance, light.emission());
    }
}

#[test]
fn a_disk_ends_at_its_radius() {
    let light = &lights()[2];
    let normal = DVec3::from(DISK_NORMAL).normalize();
    let frame = Frame { origin: DVec3::from(DISK_CENTRE), ..Frame::around(normal) };
    let radius = DISK_RADIUS;
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
    let light = light(LightDescription::Disk(DiskLight {
        name: "test".to_owned(),
        centre: [0.0; 3],
        normal: [0.0, 0.0, -1.0],
        radius,
        radiance: [1.0; 3],
    }));
    for distance in [0.3, 1.0, 30.0] {
        let point = DVec3::new(0.0, 0.0, -distance);
        let n = 400;
        let sum: f64 =
            grid(n).map(|random| light.sample_li(point, random).map_or(0.0, |s| s.weight.x * s.direction.z)).sum();
        let irradiance = sum / f64::from(n * n);
        let expected = PI * radius * radius / (radius * radius + distance * distance);
        assert!((irradiance / expected - 1.0).abs() < 1e-4, "{distance}: {irradiance} {expected}");
    }
}

fn corners(light: &Light) -> Vec<DVec3> {
    match light.body() {
        Some(Body::Polygon(corners)) => corners,
        other => panic!("{other:?} is not flat"),
    }
}

#[test]
fn a_rectangle_shines_along_its_edges_cross_product() {
    let light = light(LightDescription::Rectangle(RectangleLight {
        name: "panel".to_owned(),
        centre: [1.0, 2.0, 3.0],
        edge_u: [0.0, 0.0, 4.0],
        edge_v: [2.0, 0.0, 0.0],
        radiance: [1.0; 3],
    }));
    let centre = DVec3::new(1.0, 2.0, 3.0);
    assert_eq!(light.normal_at(Source::Point(centre)), Some(DVec3::Y));
    assert!(corners(&light).contains(&DVec3::new(2.0, 2.0, 5.0)));
}

#[test]
fn a_disk_shines_along_its_normal() {
    let light = light(LightDescription::Disk(DiskLight {
        name: "aperture".to_owned(),
        centre: [1.0, 2.0, 3.0],
        normal: [0.0, -5.0, 0.0],
        radius: 0.5,
        radiance: [1.0; 3],
    }));
    let centre = DVec3::new(1.0, 2.0, 3.0);
    assert_eq!(light.normal_at(Source::Point(centre)), Some(DVec3::NEG_Y));
    assert_eq!(light.bounds(), LightBounds::Ball { centre, radius: 0.5 });
}

#[test]
fn a_sun_keeps_its_angular_radius_and_points_at_it() {
    let light = light(LightDescription::Sun(SunLight {
        name: "sun".to_owned(),
        direction: [0.0, 3.0, 4.0],
        angular_radius: 30.0,
        radiance: [1.0; 3],
    }));
    let LightBounds::Cap { direction, sin_radius } = light.bounds() else { panic!("{light:?} is somewhere") };
    assert!((direction - DVec3::new(0.0, 0.6, 0.8)).length() < 1e-15);
    assert!((sin_radius - 0.5).abs() < 1e-15);
}
