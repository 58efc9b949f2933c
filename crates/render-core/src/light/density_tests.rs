//! Laws of drawing directions, for every kind of light and from several points. Directions come with the stated density
//! (chi-square), which integrates to one, and bring the irradiance that quadrature finds.

use std::collections::BTreeSet;
use std::f64::consts::PI;

use clerestory_film::{SampleStream, SamplerSettings, TrialStream};
use glam::{DVec2, DVec3};
use serde_json::{Value, json};

use super::tests::roofs;
use super::*;
use crate::geometry::{Frame, Ray};
use crate::settings::JsonPath;
use crate::texture::picture_samples::encode_exr;

/// Directions that are drawn for a test.
const SAMPLES: u32 = 40_000;

/// Bins of a test across a light and around its middle.
const BINS: [usize; 2] = [10, 20];

/// Points along an edge of a bin at which its density is read.
const POINTS: usize = 40;

/// Bins that should hold fewer samples than this are taken together.
const LEAST_EXPECTED: f64 = 5.0;

/// Standard deviations of the normal distribution beyond which a chi-square is no accident.
const BEYOND_CHANCE: f64 = 4.0;

const FILE: &str = "sky.exr";

fn random() -> TrialStream {
    SampleStream::new(&SamplerSettings { seed: 8, samples_per_block: 1 }, 0, [3, 4], 0).trials()
}

fn pair(random: &mut TrialStream) -> DVec2 {
    DVec2::new(random.next_f64(), random.next_f64())
}

/// A sky of 12 x 6 texels: blue above and brown below, with a bright patch.
fn sky() -> LightAssets {
    let mut random = random();
    let mut texels = [[0.0_f32; 72]; 3];
    for place in 0..72 {
        let level = if place < 36 { [0.2, 0.4, 1.0] } else { [0.2, 0.1, 0.0] };
        for (channel, level) in texels.iter_mut().zip(level) {
            channel[place] = level * (0.5 + random.next_f64() as f32);
        }
    }
    for (channel, level) in texels.iter_mut().zip([30.0, 25.0, 20.0]) {
        channel[17] = level;
    }
    let file = encode_exr(12, 6, &[("B", &texels[2]), ("G", &texels[1]), ("R", &texels[0])]);
    with_sky(&file)
}

fn with_sky(file: &[u8]) -> LightAssets {
    let environments = EnvironmentMaps::from([(FILE.to_owned(), Arc::new(EnvironmentMap::decode(file).unwrap()))]);
    LightAssets { environments, ..roofs() }
}

fn described(description: Value) -> LightDescription {
    let description: LightDescription = serde_json::from_value(description).unwrap();
    description.check(&JsonPath::Root).unwrap();
    description
}

fn environment(rotate: [f64; 3]) -> LightDescription {
    described(json!({"environment": {
        "name": "sky", "radiance": {"picture": {"file": FILE}}, "rotate": rotate, "scale": 0.5}}))
}

fn descriptions() -> Vec<LightDescription> {
    [
        json!({"point": {"name": "lamp", "position": [0.4, 0.3, 1], "intensity": [1, 2, 3]}}),
        json!({"spot": {
            "name": "spot", "position": [0.4, 0.3, 1], "direction": [-0.2, 0, -1], "intensity": [1, 2, 3],
            "inner_angle": 20, "outer_angle": 50}}),
        json!({"sphere": {"name": "globe", "centre": [0.3, 1, 2], "radius": 0.4, "radiance": [1, 2, 3]}}),
        json!({"rectangle": {
            "name": "panel", "centre": [0.2, 0.1, 1.5], "edge_u": [1, 0, 0], "edge_v": [0, -0.5, 0],
            "radiance": [1, 1, 1]}}),
        json!({"disk": {
            "name": "disk", "centre": [-0.3, 0.4, 1.2], "normal": [0.2, -0.1, -1], "radius": 0.45,
            "radiance": [3, 1, 2]}}),
        json!({"mesh": {"name": "roof", "mesh": "roof", "radiance": [1, 2, 3]}}),
        json!({"mesh": {"name": "painted roof", "mesh": "painted", "radiance": [3, 2, 1]}}),
        json!({"sun": {"name": "sun", "direction": [0.1, 0.2, 1], "angular_radius": 3, "radiance": [1, 1, 1]}}),
        json!({"environment": {"name": "even", "radiance": {"colour": [1, 2, 3]}}}),
        json!({"environment": {"name": "clear", "radiance": {"sky": {
            "model": {"cie": 12}, "up": [0.2, -0.3, 1], "sun": [1, 0.5, 0.7], "illuminance": 2000,
            "ground_luminance": 100}}}}),
    ]
    .into_iter()
    .map(described)
    .chain([environment([0.0; 3]), environment([40.0, -25.0, 70.0])])
    .collect()
}

/// Points from which a law is tried, and that see the front of all lights.
const FROM: [DVec3; 3] = [DVec3::new(0.1, -0.2, 0.3), DVec3::new(-1.0, 0.8, -0.4), DVec3::new(0.3, 0.2, 0.9)];

/// A light, and the cone in which it is seen from a point.
struct Seen {
    light: Light,
    point: DVec3,
    frame: Frame,
    /// One minus the cosine of the cone's half angle.
    height: f64,
}

impl Seen {
    fn new(light: Light, point: DVec3) -> Self {
        let cone = |axis: DVec3, sine: f64| (Frame::around(axis), 1.0 - (1.0 - sine * sine).max(0.0).sqrt());
        let (frame, height) = match light.bounds() {
            LightBounds::Ball { centre, radius } => {
                let offset = centre - point;
                cone(offset.normalize(), (1.001 * radius / offset.length()).min(1.0))
            }
            LightBounds::Cap { direction, sin_radius } => cone(direction, (1.001 * sin_radius).min(1.0)),
            LightBounds::Everywhere => (Frame::WORLD, 2.0),
        };
        Self { light, point, frame, height }
    }

    /// The direction at a place of the unit square: across the cone and around its middle, uniform in solid angle.
    fn direction(&self, place: DVec2) -> DVec3 {
        let height = self.height * place.x;
        let radius = (height * (2.0 - height)).max(0.0).sqrt();
        let (sin, cos) = libm::sincos(2.0 * PI * place.y);
        self.frame.vector_to_world(DVec3::new(radius * cos, radius * sin, 1.0 - height))
    }

    fn place(&self, direction: DVec3) -> DVec2 {
        let local = self.frame.vector_to_local(direction);
        let around = libm::atan2(local.y, local.x) / (2.0 * PI);
        DVec2::new(0.5 * (local - DVec3::Z).length_squared() / self.height, around - around.floor())
    }

    fn solid_angle(&self) -> f64 {
        2.0 * PI * self.height
    }

    /// Means over the bins of a function of directions.
    fn means(&self, value: &dyn Fn(DVec3) -> f64) -> Vec<f64> {
        let of_bin = |bin: usize| {
            let corner = DVec2::new((bin / BINS[1]) as f64, (bin % BINS[1]) as f64);
            let points = (0..POINTS * POINTS).map(|point| {
                let within = DVec2::new((point / POINTS) as f64 + 0.5, (point % POINTS) as f64 + 0.5) / POINTS as f64;
                value(self.direction((corner + within) / DVec2::new(BINS[0] as f64, BINS[1] as f64)))
            });
            points.sum::<f64>() / (POINTS * POINTS) as f64
        };
        (0..BINS[0] * BINS[1]).map(of_bin).collect()
    }

    fn pdf(&self, direction: DVec3) -> f64 {
        pdf_of(&self.light, self.point, direction)
    }

    /// How often directions fall into the bins.
    fn counts(&self) -> Vec<f64> {
        let mut counts = vec![0.0; BINS[0] * BINS[1]];
        let mut random = random();
        for _ in 0..SAMPLES {
            let sample = self
                .light
                .sample_li(&Receiver::anywhere(self.point), pair(&mut random))
                .expect("the light is in front");
            let place = self.place(sample.direction);
            let [row, column] = [0, 1].map(|axis| ((place[axis] * BINS[axis] as f64) as usize).min(BINS[axis] - 1));
            counts[row * BINS[1] + column] += 1.0;
        }
        counts
    }

    /// How far the chi-square of samples under a density is from what chance explains, in standard deviations of the
    /// normal distribution (Wilson and Hilferty 1931).
    fn surprise(&self, density: &dyn Fn(DVec3) -> f64) -> f64 {
        let expected = self.means(density);
        let scale = f64::from(SAMPLES) / expected.iter().sum::<f64>();
        let (mut chi_square, mut bins, mut rest) = (0.0, 0.0, [0.0; 2]);
        let mut add = |found: f64, expected: f64| {
            chi_square += (found - expected) * (found - expected) / expected;
            bins += 1.0;
        };
        for (found, expected) in self.counts().into_iter().zip(expected) {
            let expected = expected * scale;
            if expected < LEAST_EXPECTED {
                rest = [rest[0] + found, rest[1] + expected];
            } else {
                add(found, expected);
            }
        }
        if rest[1] > 0.0 {
            add(rest[0], rest[1]);
        }
        let freedom: f64 = bins - 1.0;
        let spread = 2.0 / (9.0 * freedom);
        (libm::cbrt(chi_square / freedom) - (1.0 - spread)) / spread.sqrt()
    }
}

fn pdf_of(light: &Light, point: DVec3, direction: DVec3) -> f64 {
    let ray = Ray::new(point, direction);
    light.intersect(&ray).map_or(0.0, |hit| light.pdf_li(&Receiver::anywhere(ray.origin), &ray, &hit))
}

/// All lights that have an extent, from all points.
fn seen() -> Vec<Seen> {
    let maps = sky();
    let lights = descriptions().into_iter().filter(|description| !description.is_delta());
    lights.flat_map(|light| FROM.map(|point| Seen::new(Light::new(&light, &maps), point))).collect()
}

#[test]
fn every_kind_of_light_is_here() {
    let kinds: BTreeSet<&str> = descriptions().iter().map(LightDescription::kind).collect();
    assert_eq!(kinds, LightDescription::NAMES.iter().copied().collect());
    for description in descriptions() {
        let light = Light::new(&description, &sky());
        assert_eq!(description.is_delta(), light.is_delta(), "{light:?}");
        assert_eq!(description.is_environment(), light.is_environment(), "{light:?}");
        assert_eq!(description.place().is_none(), light.body().is_none(), "{light:?}");
    }
}

#[test]
fn directions_are_drawn_with_the_stated_density() {
    for seen in seen() {
        let surprise = seen.surprise(&|direction| seen.pdf(direction));
        assert!(surprise < BEYOND_CHANCE, "{surprise} for {} from {}", seen.light.name, seen.point);
    }
}

#[test]
fn a_density_without_the_sine_of_the_angle_is_noticed() {
    for seen in seen() {
        let axis = seen.frame.axes.z_axis;
        let surprise = seen.surprise(&|direction| seen.pdf(direction) * axis.cross(direction).length());
        assert!(surprise > 2.0 * BEYOND_CHANCE, "{surprise} for {} from {}", seen.light.name, seen.point);
    }
}

#[test]
fn a_picture_that_is_turned_the_wrong_way_is_noticed() {
    let maps = sky();
    let light = |rotate| Light::new(&environment(rotate), &maps);
    let seen = Seen::new(light([0.0, 0.0, 30.0]), DVec3::ZERO);
    let other = light([0.0, 0.0, -30.0]);
    assert!(seen.surprise(&|direction| seen.pdf(direction)) < BEYOND_CHANCE);
    assert!(seen.surprise(&|direction| pdf_of(&other, DVec3::ZERO, direction)) > 2.0 * BEYOND_CHANCE);
}

#[test]
fn densities_integrate_to_one() {
    for seen in seen() {
        let means = seen.means(&|direction| seen.pdf(direction));
        let integral = means.iter().sum::<f64>() / means.len() as f64 * seen.solid_angle();
        assert!((integral - 1.0).abs() < 0.005, "{integral} for {} from {}", seen.light.name, seen.point);
    }
}

#[test]
fn sampling_brings_the_irradiance_that_quadrature_finds() {
    let normal = DVec3::new(0.3, 0.2, 1.0).normalize();
    for seen in seen() {
        let radiance = |direction: DVec3| {
            let hit = seen.light.intersect(&Ray::new(seen.point, direction));
            hit.map_or(0.0, |hit| hit.radiance.x) * direction.dot(normal).max(0.0)
        };
        let means = seen.means(&radiance);
        let expected = means.iter().sum::<f64>() / means.len() as f64 * seen.solid_angle();
        let mut random = random();
        let around = Frame::around(normal);
        // As the path tracer does: together with directions that a diffuse surface draws, by the balance heuristic.
        let estimates: Vec<f64> = (0..SAMPLES)
            .map(|_| {
                let sample = seen.light.sample_li(&Receiver::anywhere(seen.point), pair(&mut random)).unwrap();
                let (pdf, cosine) = (sample.pdf.unwrap(), sample.direction.dot(normal).max(0.0));
                let by_light = sample.weight.x * cosine * pdf / (pdf + cosine / PI);
                let drawn = pair(&mut random);
                let (sin, cos) = libm::sincos(2.0 * PI * drawn.y);
                let cosine = (1.0 - drawn.x).sqrt();
                let local = DVec3::new(drawn.x.sqrt() * cos, drawn.x.sqrt() * sin, cosine);
                let direction = around.vector_to_world(local);
                by_light + radiance(direction) / (seen.pdf(direction) + cosine / PI)
            })
            .collect();
        let count = estimates.len() as f64;
        let mean = estimates.iter().sum::<f64>() / count;
        let variance = estimates.iter().map(|estimate| (estimate - mean) * (estimate - mean)).sum::<f64>() / count;
        let error = (variance / count).sqrt();
        assert!(
            (mean - expected).abs() < BEYOND_CHANCE * error + 0.005 * expected,
            "{mean} +- {error}, not {expected}, for {} from {}",
            seen.light.name,
            seen.point
        );
    }
}

#[test]
fn sources_at_infinity_are_drawn_with_the_stated_density_and_without_compensation() {
    let maps = sky();
    let light = Light::new(&environment([40.0, -25.0, 70.0]), &maps);
    let mut random = random();
    let (mut power, mut largest) = (0.0, 0.0_f64);
    for _ in 0..SAMPLES {
        let sample = light.sample_source(DVec3::ZERO, 0.0, pair(&mut random));
        let Source::Direction(direction) = sample.source else { panic!("{sample:?}") };
        let hit = light.intersect(&Ray::new(DVec3::ZERO, direction)).unwrap();
        let density = light.source_density(DVec3::ZERO, 0.0, sample.source);
        assert!((sample.weight * density - hit.radiance).length() < 1e-9);
        let brought = sample.weight.element_sum() / 3.0;
        power += brought;
        largest = largest.max(brought);
    }
    let power = power / f64::from(SAMPLES);
    assert!((power / light.power() - 1.0).abs() < 0.01, "{power} {}", light.power());
    // No direction brings many times what the mean does.
    assert!(largest < 10.0 * power, "{largest}");
}

#[test]
fn a_spot_has_its_whole_intensity_inside_and_none_outside() {
    let light = Light::new(&descriptions()[1], &LightAssets::default());
    let axis = DVec3::new(-0.2, 0.0, -1.0).normalize();
    let across = axis.any_orthonormal_vector();
    let at = |degrees: f64| {
        let (sin, cos) = libm::sincos(degrees.to_radians());
        light.falloff(-(axis * cos + across * sin))
    };
    for (degrees, expected) in [(0.0, 1.0), (19.9, 1.0), (50.1, 0.0), (120.0, 0.0), (180.0, 0.0)] {
        assert_eq!(at(degrees), expected, "{degrees}");
    }
    let cosine = |degrees: f64| libm::cos(degrees.to_radians());
    let part = (cosine(35.0) - cosine(50.0)) / (cosine(20.0) - cosine(50.0));
    assert!((at(35.0) - part * part).abs() < 1e-12);
    // The power is the integral of the intensity.
    let n = 200_000;
    let sum: f64 = (0..n).map(|k| at(libm::acos(1.0 - 2.0 * (f64::from(k) + 0.5) / f64::from(n)).to_degrees())).sum();
    let power = 4.0 * PI * 2.0 * sum / f64::from(n);
    assert!((power / light.power() - 1.0).abs() < 1e-6, "{power} {}", light.power());
}

#[test]
fn a_spot_lights_what_it_points_at() {
    let light = Light::new(&descriptions()[1], &LightAssets::default());
    let position = DVec3::new(0.4, 0.3, 1.0);
    let below = position + DVec3::new(-0.4, 0.0, -2.0);
    let sample = light.sample_li(&Receiver::anywhere(below), DVec2::ZERO).unwrap();
    let distance = below.distance(position);
    assert!((sample.direction - (position - below) / distance).length() < 1e-15);
    assert!((sample.weight - DVec3::new(1.0, 2.0, 3.0) / (distance * distance)).length() < 1e-12);
    assert_eq!(light.sample_li(&Receiver::anywhere(position + DVec3::Z), DVec2::ZERO), None);
    assert_eq!(light.sample_li(&Receiver::anywhere(position), DVec2::ZERO), None);
    let sharp = described(json!({"spot": {
        "name": "sharp", "position": [0, 0, 0], "direction": [0, 0, 1], "intensity": [1, 1, 1],
        "inner_angle": 30, "outer_angle": 30}}));
    let sharp = Light::new(&sharp, &LightAssets::default());
    let at = |x: f64| sharp.sample_li(&Receiver::anywhere(DVec3::new(x, 0.0, 1.0)), DVec2::ZERO).is_some();
    assert!(at(0.577) && !at(0.578));
}

/// The picture with the directions in which its texels are written, as Mitsuba and Blender have them.
#[test]
fn pictures_lie_as_blender_has_them_and_a_rotation_makes_them_mitsubas() {
    let [width, height] = [8, 4];
    let values: Vec<f32> = (0..32).map(|value| value as f32).collect();
    let file = encode_exr(width, height, &[("Y", &values)]);
    let maps = with_sky(&file);
    let light = |rotate| Light::new(&environment(rotate), &maps);
    let [blender, mitsuba] = [light([0.0; 3]), light([-90.0, -90.0, 0.0])];
    for row in 0..height {
        for column in 0..width {
            let (u, v) = ((column as f64 + 0.5) / width as f64, (row as f64 + 0.5) / height as f64);
            let ((sin_u, cos_u), (sin_v, cos_v)) = (libm::sincos(2.0 * PI * u), libm::sincos(PI * v));
            let azimuth = PI - 2.0 * PI * u;
            for (light, direction) in [
                (&blender, DVec3::new(libm::cos(azimuth) * sin_v, libm::sin(azimuth) * sin_v, cos_v)),
                (&mitsuba, DVec3::new(sin_u * sin_v, cos_v, -cos_u * sin_v)),
            ] {
                let hit = light.intersect(&Ray::new(DVec3::ZERO, direction)).unwrap();
                let expected = 0.5 * (row * width + column) as f64;
                assert!((hit.radiance.x - expected).abs() < 1e-9, "{} {expected}", hit.radiance.x);
            }
        }
    }
}
