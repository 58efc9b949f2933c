//! What many lights cost, and how well a light is chosen among them.
//!
//! The first figure is the core time of a sample under 4,096 equal lights, over that under 16. The second is the
//! relative error of the direct light of 300 candles. It compares the light tree with a choice by power, at equal time.
//! Both are medians of some runs.

use std::error::Error;
use std::time::{Duration, Instant};

use clap::Parser;
use clerestory_film::counters::Counters;
use clerestory_film::{SampleStream, SamplerSettings};
use clerestory_render_core::document::{SceneBundle, SceneDescription};
use clerestory_render_core::geometry::{Ray, Surface, SurfaceId};
use clerestory_render_core::integrator::PreparedScene;
use clerestory_render_core::light::{Receiver, Side};
use clerestory_render_core::scene::Scene;
use clerestory_tests::rendering::Rendering;
use glam::{DVec2, DVec3};
use serde_json::{Value, json};

/// Prints what many lights cost, and how well a light is chosen among them.
#[derive(Parser)]
struct Arguments {
    /// Runs of which the median is printed.
    #[arg(long, default_value_t = 5)]
    runs: usize,
    /// Seconds of each measurement.
    #[arg(long, default_value_t = 2.0)]
    seconds: f64,
}

/// Few and many lights, whose time is compared.
const COUNTS: [u32; 2] = [16, 4096];

/// Candles on the chandeliers.
const CANDLES: u32 = 300;

/// Edge of the pictures, pixels.
const EDGE: u32 = 64;

/// Samples of each candle in each pixel of the reference.
const REFERENCE_SAMPLES: u32 = 8;

fn main() -> Result<(), Box<dyn Error + Send + Sync>> {
    let arguments = Arguments::parse();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread().build()?;
    pool.install(|| {
        let limit = Duration::from_secs_f64(arguments.seconds);
        let mut times = Vec::new();
        let [few, many] = COUNTS.map(|count| hall(&ceiling(count)));
        let [few, many] = [few?, many?];
        for _ in 0..arguments.runs {
            let [few, many] = [microseconds(&few, limit)?, microseconds(&many, limit)?];
            println!("{few:.2} us a sample under {} lights, {many:.2} us under {}", COUNTS[0], COUNTS[1]);
            times.push(many / few);
        }
        println!("4096 lights: {:.2} times the core time of 16 (goal: at most 3)", median(&mut times));

        let prepared = hall(&chandeliers(CANDLES))?;
        let points = Points::seen_in(prepared.scene());
        let reference = points.under_all_lights();
        let mut errors = Vec::new();
        for run in 0..arguments.runs {
            let seed = run as u64;
            let tree = points.relative_error(&reference, limit, seed, &|receiver, stream, _| {
                prepared
                    .scene()
                    .light_sampler()
                    .ask(receiver, stream)
                    .first()
                    .map(|asked| (asked.light, asked.probability))
            });
            let power = points.relative_error(&reference, limit, seed, &|_, _, random| points.by_power(random));
            println!("relMSE of {CANDLES} candles: {tree:.3e} by the tree, {power:.3e} by power");
            errors.push(tree / power);
        }
        println!("300 candles: {:.3} times the relMSE of power sampling (goal: below 1)", median(&mut errors));
        Ok(())
    })
}

fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// Core time of a sample, microseconds.
fn microseconds(scene: &PreparedScene, limit: Duration) -> Result<f64, Box<dyn Error + Send + Sync>> {
    let mut rendering = Rendering::new(scene);
    let start = Instant::now();
    while start.elapsed() < limit {
        rendering.render_pass()?;
    }
    let samples = f64::from(rendering.samples()) * f64::from(EDGE * EDGE);
    Ok(start.elapsed().as_secs_f64() * 1e6 / samples)
}

/// A hall of 40 m by 40 m with pillars, under these lights.
fn hall(lights: &[Value]) -> Result<PreparedScene, Box<dyn Error + Send + Sync>> {
    let square = |half: f64| {
        json!({"inline": {
            "positions": [[-half, -half, 0], [half, -half, 0], [half, half, 0], [-half, half, 0]],
            "triangles": [[0, 1, 2], [0, 2, 3]]
        }})
    };
    let side = |name: &str, rotate: [f64; 3], translate: [f64; 3], half: f64| {
        let source = square(half);
        json!({
            "name": name, "material": "stone", "source": source, "rotate": rotate, "translate": translate
        })
    };
    let mut meshes =
        vec![side("floor", [0.0; 3], [0.0; 3], 20.0), side("vault", [180.0, 0.0, 0.0], [0.0, 0.0, 9.0], 20.0)];
    for (column, row) in (0..4).flat_map(|column| (0..4).map(move |row| (column, row))) {
        let [x, y] = [column, row].map(|place: u32| -15.0 + 10.0 * f64::from(place));
        for (number, turn) in [0.0, 90.0, 180.0, 270.0].into_iter().enumerate() {
            let outward = DVec3::new(f64::cos(f64::to_radians(turn)), f64::sin(f64::to_radians(turn)), 0.0);
            let place = DVec3::new(x, y, 4.5) + 0.5 * outward;
            let mut wall = side(&format!("pillar {column} {row} {number}"), [0.0, 90.0, turn], place.to_array(), 0.5);
            wall["source"] = json!({"inline": {
                "positions": [[-4.5, -0.5, 0], [4.5, -0.5, 0], [4.5, 0.5, 0], [-4.5, 0.5, 0]],
                "triangles": [[0, 1, 2], [0, 2, 3]]
            }});
            meshes.push(wall);
        }
    }
    let scene = json!({
        "version": 2, "name": "A hall with many lights", "film": {"width": EDGE, "height": EDGE},
        "camera": {"perspective": {
            "position": [-17, -18, 3], "look_at": [10, 8, 1.5], "up": [0, 0, 1], "vertical_field_of_view": 60
        }},
        "integrator": {"path": {"max_depth": 4}}, "sampling": {"samples_per_pass": 4, "samples_per_block": 4},
        "materials": {"stone": {"diffuse": {"reflectance": {"colour": [0.6, 0.55, 0.5]}}}},
        "meshes": meshes, "lights": lights
    });
    let description = SceneDescription::parse(scene.to_string().as_bytes())?;
    Ok(PreparedScene::build(&SceneBundle::from_parts(description, std::collections::BTreeMap::new())?)?)
}

fn flame(number: u32, centre: DVec3, radiance: f64) -> Value {
    json!({"sphere": {
        "name": format!("light {number}"), "centre": centre.to_array(), "radius": 0.02,
        "radiance": [radiance, 0.8 * radiance, 0.5 * radiance]
    }})
}

/// Equal lights in a square under the vault.
fn ceiling(count: u32) -> Vec<Value> {
    let along = count.isqrt();
    let place = |step: u32| 38.0 * (f64::from(step) + 0.5) / f64::from(along) - 19.0;
    let light = |number: u32| flame(number, DVec3::new(place(number % along), place(number / along), 7.0), 2000.0);
    (0..count).map(light).collect()
}

/// Candles in rings of twelve, of three strengths.
fn chandeliers(count: u32) -> Vec<Value> {
    let light = |number: u32| {
        let (ring, place) = (number / 12, number % 12);
        let middle = DVec2::new(f64::from(ring % 5), f64::from(ring / 5)) * 8.0 - 16.0;
        let angle = f64::from(place) * std::f64::consts::TAU / 12.0;
        let centre = middle.extend(3.5) + 0.6 * DVec3::new(angle.cos(), angle.sin(), 0.0);
        flame(number, centre, [1000.0, 2000.0, 4000.0][ring as usize % 3])
    };
    (0..count).map(light).collect()
}

/// Chooses a light for a point, with a random number or those of a stream; with the probability of the choice.
type Choose<'a> = dyn Fn(&Receiver, &mut SampleStream, f64) -> Option<(u32, f64)> + 'a;

/// What the middle of each pixel shows.
struct Points<'a> {
    scene: &'a Scene,
    points: Vec<(DVec3, DVec3, SurfaceId)>,
    /// The power of all lights up to each.
    power: Vec<f64>,
}

impl<'a> Points<'a> {
    fn seen_in(scene: &'a Scene) -> Self {
        let pixels = (0..EDGE * EDGE).map(|pixel| DVec2::new(f64::from(pixel % EDGE), f64::from(pixel / EDGE)) + 0.5);
        let seen = |pixel: DVec2| {
            let ray = scene.camera().ray(pixel);
            let hit =
                scene.accelerator().closest_hit(&ray, f64::INFINITY, SurfaceId::Nothing, &mut Counters::default())?;
            let Surface::Triangle { index, .. } = hit.surface else { return None };
            let normal = scene.triangle_normal(index);
            let normal = if normal.dot(ray.direction) > 0.0 { -normal } else { normal };
            Some((ray.at(hit.distance), normal, SurfaceId::Triangle(index)))
        };
        let mut power = Vec::new();
        for light in scene.lights() {
            power.push(power.last().unwrap_or(&0.0) + light.power());
        }
        Self { scene, points: pixels.filter_map(seen).collect(), power }
    }

    /// A light chosen by its power, and the probability.
    fn by_power(&self, random: f64) -> Option<(u32, f64)> {
        let total = self.power.last()?;
        let index = self.power.partition_point(|power| *power <= random * total).min(self.power.len() - 1);
        let before = if index == 0 { 0.0 } else { self.power[index - 1] };
        Some((index as u32, (self.power[index] - before) / total))
    }

    /// One estimate of the irradiance of a light, as the red channel.
    fn irradiance(&self, point: usize, light: u32, random: DVec2) -> f64 {
        let (position, normal, ray_origin) = self.points[point];
        let Some(sample) = self.scene.lights()[light as usize].sample_li(&Receiver::anywhere(position), random) else {
            return 0.0;
        };
        let cosine = normal.dot(sample.direction);
        let ray = Ray::new(position, sample.direction);
        let counters = &mut Counters::default();
        if cosine <= 0.0 || self.scene.blocked(&ray, sample.distance, ray_origin, None, Some(light), counters) {
            return 0.0;
        }
        sample.weight.x * cosine
    }

    fn under_all_lights(&self) -> Vec<f64> {
        let of = |point: usize| {
            let settings = SamplerSettings { seed: u64::MAX, samples_per_block: REFERENCE_SAMPLES };
            let samples = (0..REFERENCE_SAMPLES).map(|sample| {
                let mut stream = SampleStream::new(&settings, 0, [point as u32, 0], sample);
                let random = stream.next_2d();
                (0..self.power.len() as u32).map(|light| self.irradiance(point, light, random)).sum::<f64>()
            });
            samples.sum::<f64>() / f64::from(REFERENCE_SAMPLES)
        };
        (0..self.points.len()).map(of).collect()
    }

    /// The mean of squared errors over squared values of the reference, after this time.
    fn relative_error(&self, reference: &[f64], limit: Duration, seed: u64, choose: &Choose<'_>) -> f64 {
        let settings = SamplerSettings { seed, samples_per_block: 1 << 16 };
        let mut sums = vec![0.0; self.points.len()];
        let (start, mut samples) = (Instant::now(), 0u32);
        while start.elapsed() < limit {
            for (point, sum) in sums.iter_mut().enumerate() {
                let (position, normal, _) = self.points[point];
                let mut stream = SampleStream::new(&settings, 0, [point as u32, 0], samples);
                let (random, place) = (stream.next_1d(), stream.next_2d());
                let receiver = Receiver { position, side: Side::Front(normal) };
                if let Some((light, probability)) = choose(&receiver, &mut stream, random) {
                    *sum += self.irradiance(point, light, place) / probability;
                }
            }
            samples += 1;
        }
        let mean = reference.iter().sum::<f64>() / reference.len() as f64;
        let error = |(sum, reference): (&f64, &f64)| {
            (sum / f64::from(samples) - reference).powi(2) / (reference.powi(2) + (0.01 * mean).powi(2))
        };
        sums.iter().zip(reference).map(error).sum::<f64>() / reference.len() as f64
    }
}
