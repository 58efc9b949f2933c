//! Laws that every light obeys, and what is particular to some.

use std::f64::consts::PI;

use clerestory_film::{SampleStream, SamplerSettings};
use glam::{DVec2, DVec3};

use super::*;
use crate::geometry::{Frame, Ray};
use crate::texture::picture_samples::encode_png;
use crate::texture::{Bitmap, Bitmaps, Encoding, TextureDescription};

fn light(description: LightDescription) -> Light {
    Light::new(&description, &LightAssets::default())
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
    .into_iter()
    .chain([example(), roof()])
    .collect()
}

/// Some triangles above the origin, none of which hides another from below.
fn roof() -> Light {
    let description: LightDescription = serde_json::from_value(serde_json::json!({"mesh": {
        "name": "roof", "mesh": "roof", "radiance": [1, 2, 3]}}))
    .unwrap();
    Light::new(&description, &roofs())
}

/// The surfaces "roof", and "painted" with a picture on it.
pub(super) fn roofs() -> LightAssets {
    let mut random = pseudo_random();
    let place = |x: u32, y: u32| DVec2::new(f64::from(x), f64::from(y)) / 3.0;
    let positions: Vec<DVec3> =
        (0..16).map(|k| ((place(k % 4, k / 4) - 0.5) * 1.2).extend(1.6 + 0.1 * random())).collect();
    let corners_of = |k: u32| {
        let first = 4 * (k / 3) + k % 3;
        [[first, first + 1, first + 5], [first, first + 5, first + 4]]
    };
    let numbers: Vec<[u32; 3]> = (0..9).flat_map(corners_of).collect();
    let corners = numbers.iter().map(|numbers| numbers.map(|number| positions[number as usize])).collect();
    let plain = ShiningSurface { first_triangle: 5, corners, picture: None, coverage: None };
    let picture = image::ImageBuffer::from_fn(5, 4, |x, y| image::Luma([(((x * 7 + y * 3) % 6) * 51) as u8]));
    let description = TextureDescription::of_file("glow.png");
    let key = description.picture(Encoding::Colour);
    let bitmap = Bitmap::decode(&encode_png(picture.into()), Encoding::Colour).unwrap();
    let picture = description.build(Encoding::Colour, &Bitmaps::from([(key, Arc::new(bitmap))]));
    let coordinates = numbers.iter().map(|numbers| numbers.map(|number| place(number % 4, number / 4))).collect();
    let painted = ShiningSurface { picture: Some(ShiningPicture { picture, coordinates }), ..plain.clone() };
    let surfaces = [("roof", plain), ("painted", painted)];
    let surfaces = surfaces.map(|(name, surface)| (name.to_owned(), Arc::new(surface)));
    LightAssets { surfaces: surfaces.into(), ..LightAssets::default() }
}

/// The light of docs/extending.md, read as scene files are.
fn example() -> Light {
    let description: example::EllipseLight = serde_json::from_value(serde_json::json!({
        "name": "ellipse", "centre": [0.1, -0.3, 1.4], "normal": [0.1, 0.2, -1], "half_axes": [0.3, 0.5],
        "radiance": [1, 2, 1]
    }))
    .unwrap();
    assert!(description.check(&JsonPath::Root).is_ok());
    Light { name: description.name().to_owned(), emitter: description.build(&LightAssets::default()) }
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
            let sample = light.sample_li(&Receiver::anywhere(point), random).unwrap();
            let ray = Ray::new(point, sample.direction);
            let hit = light.intersect(&ray).expect("a direction inside the cone meets the light");
            assert!((sample.direction.length() - 1.0).abs() < 1e-12);
            let density = light.pdf_li(&Receiver::anywhere(ray.origin), &ray, &hit);
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
            .map(|random| {
                light.sample_li(&Receiver::anywhere(point), random).map_or(0.0, |s| s.weight.x * s.direction.z.max(0.0))
            })
            .sum();
        let by_area: f64 = grid(n)
            .map(|random| {
                let sample = light.sample_source(point, 0.05, random);
                let Source::Point(position) = sample.source else { unreachable!() };
                let offset = position - point;
                let direction = offset.normalize();
                let cosine = sample.cosine(direction);
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
        assert_eq!(light.sample_li(&Receiver::anywhere(behind), DVec2::splat(0.3)), None);
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
        let sum: f64 = grid(n)
            .map(|random| {
                light.sample_li(&Receiver::anywhere(point), random).map_or(0.0, |s| s.weight.x * s.direction.z)
            })
            .sum();
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
    assert_eq!(light.sample_source(DVec3::ZERO, 0.0, DVec2::splat(0.5)).normal, Some(DVec3::Y));
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
    assert_eq!(light.sample_source(DVec3::ZERO, 0.0, DVec2::splat(0.5)).normal, Some(DVec3::NEG_Y));
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

/// Lamps of all kinds in a room, and two suns.
fn many_lights() -> Vec<Light> {
    let mut random = pseudo_random();
    let mut triple = |low: f64, high: f64| [(); 3].map(|()| low + (high - low) * random());
    let name = || "lamp".to_owned();
    let mut lights = Vec::new();
    for _ in 0..60 {
        let (centre, radiance) = (triple(-4.0, 4.0), triple(0.1, 9.0));
        let normal = triple(-1.0, 1.0);
        let radius = triple(0.01, 0.3)[0];
        lights.push(LightDescription::Point(PointLight { name: name(), position: centre, intensity: radiance }));
        let centre = triple(-4.0, 4.0);
        lights.push(LightDescription::Sphere(SphereLight { name: name(), centre, radius, radiance }));
        let centre = triple(-4.0, 4.0);
        lights.push(LightDescription::Disk(DiskLight { name: name(), centre, normal, radius, radiance }));
    }
    for direction in [[0.0, 0.3, 1.0], [1.0, 0.2, 0.4]] {
        let (angular_radius, radiance) = (2.0, triple(10.0, 90.0));
        lights.push(LightDescription::Sun(SunLight { name: name(), direction, angular_radius, radiance }));
    }
    lights.into_iter().map(light).collect()
}

/// Numbers in [0, 1), the same every time.
fn pseudo_random() -> impl FnMut() -> f64 {
    let settings = SamplerSettings { seed: 5, samples_per_block: 1 };
    let mut trials = SampleStream::new(&settings, 0, [0, 0], 0).trials();
    move || trials.next_f64()
}

#[test]
fn one_of_many_lights_is_asked_with_the_stated_probability_and_brings_the_light_of_all() {
    let lights = many_lights();
    let sampler = LightSampler::new(&lights);
    for (position, side) in [
        (DVec3::new(0.3, -0.2, 0.1), Side::Front(DVec3::Z)),
        (DVec3::new(-3.0, 3.9, 1.0), Side::Front(DVec3::new(0.6, 0.0, -0.8))),
        (DVec3::new(0.3, -0.2, 0.1), Side::Both(DVec3::Z)),
        (DVec3::new(9.0, 0.0, 0.0), Side::Anywhere),
    ] {
        let receiver = Receiver { position, side };
        let probability = |light: u32| sampler.probability(light, &receiver);
        // Where parts of the tree turn out to bring nothing, no lamp is asked.
        let asked_lamp = (0..180).map(probability).sum::<f64>();
        assert!(asked_lamp < 1.0 + 1e-9 && (side != Side::Anywhere || asked_lamp > 1.0 - 1e-9), "{asked_lamp}");
        assert!(((180..182).map(probability).sum::<f64>() - 1.0).abs() < 1e-12);
        // What each light brings, from one point of it.
        let brought = |light: u32| {
            let sample = lights[light as usize].sample_li(&Receiver::anywhere(position), DVec2::splat(0.4));
            sample.map_or(0.0, |sample| sample.weight.x * side.cosine(sample.direction).unwrap_or(1.0).max(0.0))
        };
        let expected: f64 = (0..182).map(brought).sum();
        let estimates: Vec<f64> = (0..20_000)
            .map(|sample| {
                let settings = SamplerSettings { seed: 9, samples_per_block: 1 };
                let mut stream = SampleStream::new(&settings, 0, [3, 4], sample);
                let asked = sampler.ask(&receiver, &mut stream);
                for asked in &asked {
                    assert!((asked.probability / probability(asked.light) - 1.0).abs() < 1e-9, "{asked:?}");
                }
                asked.iter().map(|asked| brought(asked.light) / asked.probability).sum()
            })
            .collect();
        let count = estimates.len() as f64;
        let mean = estimates.iter().sum::<f64>() / count;
        let variance = estimates.iter().map(|estimate| (estimate - mean) * (estimate - mean)).sum::<f64>() / count;
        let error = (variance / count).sqrt();
        assert!(error < 0.03 * expected, "{error} {expected}");
        assert!((mean - expected).abs() < 4.0 * error, "{mean} {expected} {error}");
    }
}

#[test]
fn the_tree_finds_the_lights_on_a_ray() {
    let lights = many_lights();
    let sampler = LightSampler::new(&lights);
    let mut random = pseudo_random();
    let mut met = 0;
    for _ in 0..20_000 {
        let mut triple = || DVec3::new(random(), random(), random()) * 2.0 - 1.0;
        let ray = Ray::new(triple() * 5.0, triple().normalize());
        let end = if met % 2 == 0 { f64::INFINITY } else { 3.0 };
        let is_met = |light: u32| {
            let hit = lights[light as usize].intersect(&ray);
            hit.is_some_and(|hit| hit.distance.is_finite() && hit.distance < end)
        };
        let mut found = Vec::new();
        sampler.on_ray(&ray, end, &mut |light| {
            found.push(light);
            false
        });
        for light in (0..182).filter(|light| is_met(*light)) {
            assert!(found.contains(&light), "{light} is not in {found:?}");
            met += 1;
        }
    }
    assert!(met > 300, "{met}");
}

#[test]
fn few_lights_are_all_asked_without_a_random_number() {
    let lights = lights();
    let sampler = LightSampler::new(&lights[..MOST_ASKED]);
    let settings = SamplerSettings { seed: 9, samples_per_block: 1 };
    let mut stream = SampleStream::new(&settings, 0, [3, 4], 0);
    let first = stream.clone().next_1d();
    let asked = sampler.ask(&Receiver { position: DVec3::ZERO, side: Side::Front(DVec3::Z) }, &mut stream);
    let asked: Vec<(u32, f64)> = asked.iter().map(|asked| (asked.light, asked.probability)).collect();
    assert_eq!(asked, [(0, 1.0), (1, 1.0), (2, 1.0), (3, 1.0)]);
    assert_eq!(stream.next_1d(), first);
}

#[test]
fn a_cone_around_two_cones_holds_both() {
    let mut random = pseudo_random();
    for case in 0..4000 {
        let mut unit = || (DVec3::new(random(), random(), random()) - 0.5).normalize();
        let first = unit();
        let second = match case % 4 {
            0 => -first,
            1 => (-first + unit() * 1e-6).normalize(),
            2 => first,
            _ => unit(),
        };
        let third = unit();
        let cone = EmissionCone::from_plane(first).union(EmissionCone::from_plane(second));
        let cone = cone.union(EmissionCone::from_plane(third));
        for normal in [first, second, third] {
            let cosine = cone.axis.dot(normal);
            assert!(cosine >= cone.cos_normals - 1e-9, "{cone:?} lacks {normal}");
            // Light straight along the normal leaves within the bound.
            assert!(cone.largest_cosine(cosine, 1.0) > 1.0 - 1e-4, "{cone:?} {normal}");
        }
    }
}

#[test]
fn a_cone_of_both_sides_holds_the_opposite_of_each_normal() {
    let mut random = pseudo_random();
    for case in 0..4000 {
        let mut unit = || (DVec3::new(random(), random(), random()) - 0.5).normalize();
        let normals = [unit(), unit(), unit()];
        let of = |index: usize| {
            let is_both = index != case % 4;
            let normal = normals[index];
            if is_both { EmissionCone::from_both_sides(normal) } else { EmissionCone::from_plane(normal) }
        };
        let cone = of(0).union(of(1)).union(of(2));
        for normal in normals.into_iter().flat_map(|normal| [normal, -normal]) {
            assert!(cone.largest_cosine(cone.axis.dot(normal), 1.0) > 1.0 - 1e-4, "{cone:?} {normal}");
        }
    }
    let [first, second] = [DVec3::Z, DVec3::new(0.1, 0.0, -1.0).normalize()].map(EmissionCone::from_both_sides);
    assert!(first.union(second).cos_normals > 0.99);
}

#[test]
fn a_mesh_brings_the_same_light_however_its_triangles_are_chosen() {
    let light = roof();
    let normal = DVec3::new(0.8, 0.1, 0.6).normalize();
    for side in [Side::Anywhere, Side::Front(normal), Side::Both(normal), Side::Front(-normal)] {
        let receiver = Receiver { position: DVec3::new(0.1, -0.2, 1.1), side };
        let brought = |receiver: &Receiver| {
            let mut random = pseudo_random();
            let mut of = || {
                let sample = light.sample_li(receiver, DVec2::new(random(), random()))?;
                let ray = Ray::new(receiver.position, sample.direction);
                let pdf = light.pdf_li(receiver, &ray, &light.intersect(&ray)?);
                assert!((pdf / sample.pdf? - 1.0).abs() < 1e-9, "{pdf} {sample:?}");
                Some(sample.weight.x * side.cosine(sample.direction).unwrap_or(1.0).max(0.0))
            };
            let count = 60_000;
            let (sum, squares) = (0..count).fold((0.0, 0.0), |(sum, squares), _| {
                let value = of().unwrap_or(0.0);
                (sum + value, squares + value * value)
            });
            let mean = sum / f64::from(count);
            (mean, ((squares / f64::from(count) - mean * mean) / f64::from(count)).sqrt())
        };
        let (found, error) = brought(&receiver);
        let (expected, other_error) = brought(&Receiver::anywhere(receiver.position));
        let error = libm::hypot(error, other_error);
        assert!(
            error < 0.02 * expected && (found - expected).abs() < 4.0 * error,
            "{found} {expected} {error}: {side:?}"
        );
    }
}

#[test]
fn lights_behind_a_surface_are_not_asked() {
    let lamp = |number: u32, height: f64| {
        light(LightDescription::Point(PointLight {
            name: number.to_string(),
            position: [f64::from(number), 0.0, height],
            intensity: [1.0; 3],
        }))
    };
    let lights: Vec<Light> = (0..6).map(|k| lamp(k, if k < 3 { 3.0 } else { -0.3 })).collect();
    let sampler = LightSampler::new(&lights);
    let probability = |side| {
        let receiver = Receiver { position: DVec3::new(2.5, 0.0, 0.0), side };
        (0..6).map(|light| sampler.probability(light, &receiver)).collect::<Vec<f64>>()
    };
    let front = probability(Side::Front(DVec3::Z));
    assert!(front[3..].iter().all(|probability| *probability == 0.0), "{front:?}");
    assert!(probability(Side::Both(DVec3::Z))[3] > 0.1);
    assert!(probability(Side::Anywhere)[0] > 1e-6);
}

#[test]
fn a_weak_light_beside_a_very_strong_one_is_still_asked() {
    let lamp = |number: u32, intensity: f64| {
        light(LightDescription::Point(PointLight {
            name: number.to_string(),
            position: [f64::from(number), 0.0, 2.0],
            intensity: [intensity; 3],
        }))
    };
    let lights: Vec<Light> = (0..8).map(|k| lamp(k, if k == 7 { 1e30 } else { 1.0 })).collect();
    let sampler = LightSampler::new(&lights);
    let receiver = Receiver { position: DVec3::ZERO, side: Side::Front(DVec3::Z) };
    for light in 0..8 {
        assert!(sampler.probability(light, &receiver) > 1e-8, "{light}");
    }
}

#[test]
fn lights_ever_nearer_to_one_place_make_a_tree_that_is_walked() {
    let lamp = |number: u32| {
        let mut position = [0.0; 3];
        position[number as usize % 3] = libm::pow(13.0, 10.0 - f64::from(number / 3));
        light(LightDescription::Point(PointLight { name: number.to_string(), position, intensity: [1.0; 3] }))
    };
    let sampler = LightSampler::new(&(0..800).map(lamp).collect::<Vec<Light>>());
    let receiver = Receiver::anywhere(DVec3::ONE);
    let sum: f64 = (0..800).map(|light| sampler.probability(light, &receiver)).sum();
    assert!((sum - 1.0).abs() < 1e-9, "{sum}");
}

/// Lights at infinity and surfaces of the scene send no rays.
#[test]
fn rays_that_leave_a_light_carry_its_power_and_lead_back_to_it() {
    let name = || "test".to_owned();
    let points = [
        LightDescription::Point(PointLight { name: name(), position: [0.1, 0.2, 1.0], intensity: [1.0, 2.0, 3.0] }),
        LightDescription::Spot(SpotLight {
            name: name(),
            position: [0.1, 0.2, 1.0],
            direction: [0.3, 0.1, -1.0],
            intensity: [3.0, 2.0, 1.0],
            inner_angle: 20.0,
            outer_angle: 40.0,
        }),
    ]
    .map(light);
    let mut sending = 0;
    for light in lights().iter().chain(&points) {
        let (mut power, mut count) = (0.0, 0.0);
        for (place, direction) in grid(12).flat_map(|place| grid(12).map(move |direction| (place, direction))) {
            let Some(emission) = light.emit(place, direction) else { continue };
            let back = Ray::new(emission.ray.at(2.0), -emission.ray.direction);
            assert_eq!(light.emission_density(&back), emission.density);
            if !light.is_delta() {
                let hit = light.intersect(&back).expect("the ray leads back");
                assert!((hit.distance - 2.0).abs() < 1e-9, "{}", hit.distance);
                assert_eq!(hit.radiance, emission.radiance);
            }
            power += emission.radiance.element_sum() / 3.0 / emission.density;
            count += 1.0;
        }
        if count > 0.0 {
            sending += 1;
            let mean = power / count;
            assert!((mean / light.power() - 1.0).abs() < 2e-3, "{mean}, not {}: {light:?}", light.power());
        }
    }
    assert_eq!(sending, 6);
}
