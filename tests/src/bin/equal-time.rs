//! Error against time for every integrator on a scene lit by the sun through old glass.
//!
//! For each angular radius of the sun (its irradiance kept the same) a reference is rendered with `cone`, then each
//! integrator renders with several seeds until the longest time. The table states the mean squared error less the
//! reference's noise, and what of it is variance and what is bias, estimated from the spread of the seeds.

use std::{
    path::PathBuf,
    process::ExitCode,
    time::{Duration, Instant},
};

use clap::Parser;
use clerestory_render_core::scene::{
    self, Scene, SceneBundle,
    description::{LightDescription, SamplingDescription},
};
use clerestory_tests::{
    reference::{Image, Reference},
    rendering::Rendering,
};

/// Prints error against time for every integrator on a scene lit by the sun through old glass.
#[derive(Parser)]
struct Arguments {
    /// The scene file; it must have a sun.
    #[arg(default_value = "scenes/room.json")]
    scene: PathBuf,
    /// Angular radii of the sun, degrees.
    #[arg(long, value_delimiter = ',', default_value = "0.27,1,3")]
    angles: Vec<f64>,
    /// Integrators to compare.
    #[arg(long, value_delimiter = ',', default_value = "path,cone,fnee")]
    integrators: Vec<String>,
    /// Render times, seconds.
    #[arg(long, value_delimiter = ',', default_value = "2,4,8,16")]
    times: Vec<f64>,
    /// Independent renders of each integrator.
    #[arg(long, default_value_t = 5)]
    seeds: u64,
    /// Size of the image.
    #[arg(long, value_delimiter = 'x', default_value = "96x64")]
    size: Vec<u32>,
    /// Samples in each pixel of a reference.
    #[arg(long, default_value_t = 4096)]
    reference_samples: u32,
    /// Light path expression that both reference and renders are restricted to.
    #[arg(long)]
    path_filter: Option<String>,
}

type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

/// Independent batches of a reference, for its standard error.
const BATCHES: u32 = 16;

fn main() -> ExitCode {
    match run(&Arguments::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run(arguments: &Arguments) -> Outcome<()> {
    let bundle = scene::load(&arguments.scene)?;
    let [width, height] = arguments.size[..] else { return Err("--size takes WIDTHxHEIGHT".into()) };
    println!(
        "{}, {width}x{height}, {} seeds, {} threads; MSE over pixels and channels, less the reference's noise",
        arguments.scene.display(),
        arguments.seeds,
        rayon::current_num_threads()
    );
    for &angle in &arguments.angles {
        let variant = |integrator: &str, seed: u64| -> Outcome<Scene> {
            let mut description = bundle
                .description()
                .clone()
                .with_integrator_named(integrator)?
                .with_seed(seed)
                .with_size(width, height)?;
            description.sampling = SamplingDescription { samples_per_pass: 1, samples_per_block: 256 };
            if arguments.path_filter.is_some() {
                description.path_filter.clone_from(&arguments.path_filter);
            }
            set_sun(&mut description.lights, angle)?;
            let bundle: SceneBundle = bundle.clone().with_description(description)?;
            Ok(Scene::build(&bundle)?)
        };
        let reference = reference(&variant("cone", 1_000_000)?, arguments.reference_samples)?;
        let noise = mean_square(&reference.standard_error);
        let mean = mean_value(&reference.mean);
        println!(
            "\nsun of half-angle {angle} degrees: reference by cone, {} samples, mean {mean:.5}, noise {:.2e} (relative to the mean squared)",
            arguments.reference_samples,
            noise / (mean * mean)
        );
        println!(
            "integrator   time s   samples   MSE/mean^2     variance        bias^2   mean ratio   MSE of path / this"
        );
        let mut path_errors: Option<Vec<f64>> = None;
        for integrator in &arguments.integrators {
            let mut snapshots: Vec<Vec<(Image, f64, u32)>> = vec![Vec::new(); arguments.times.len()];
            for seed in 0..arguments.seeds {
                let scene = variant(integrator, seed + 1)?;
                for (mark, snapshot) in render_until(&scene, &arguments.times)?.into_iter().enumerate() {
                    snapshots[mark].push(snapshot);
                }
            }
            let mut errors = Vec::new();
            for (mark, snapshot) in snapshots.iter().enumerate() {
                let error = Decomposition::new(snapshot, &reference, noise);
                errors.push(error.mse);
                let gain = path_errors.as_ref().map_or(1.0, |path: &Vec<f64>| path[mark] / error.mse);
                let scale = 1.0 / (mean * mean);
                println!(
                    "{integrator:<10} {:>8.2} {:>9.1} {:>12.4e} {:>12.4e} {:>13.4e} {:>12.5} {:>12.1}",
                    error.seconds,
                    error.samples,
                    error.mse * scale,
                    error.variance * scale,
                    error.bias_squared * scale,
                    error.mean / mean,
                    gain,
                );
            }
            if integrator == "path" {
                path_errors = Some(errors);
            }
        }
    }
    Ok(())
}

/// Gives every sun the angular radius `angle`, at the same irradiance.
fn set_sun(lights: &mut [LightDescription], angle: f64) -> Outcome<()> {
    let mut found = false;
    for light in lights {
        if let LightDescription::Sun { angular_radius, radiance, .. } = light {
            let ratio = libm::sin(angular_radius.to_radians()) / libm::sin(angle.to_radians());
            *radiance = radiance.map(|channel| channel * ratio * ratio);
            *angular_radius = angle;
            found = true;
        }
    }
    if found { Ok(()) } else { Err("the scene has no sun".into()) }
}

/// A reference of at least `samples` in each pixel, in batches of whole blocks, whose scrambles are independent.
fn reference(scene: &Scene, samples: u32) -> Outcome<Reference> {
    let block = scene.sampling().samples_per_block();
    let blocks_per_batch = samples.div_ceil(block * BATCHES).max(1);
    let mut rendering = Rendering::new(scene);
    let mut before = rendering.image();
    let mut batches = Vec::new();
    for batch in 1..=BATCHES {
        let first = rendering.samples();
        while rendering.samples() < batch * blocks_per_batch * block {
            rendering.render_pass()?;
        }
        let sum = rendering.image().scaled(f64::from(rendering.samples()));
        let count = f64::from(rendering.samples() - first);
        let pixels = sum.pixels.iter().zip(&before.pixels).map(|(&now, &then)| (now - then) / count).collect();
        batches.push(Image { pixels, ..sum.clone() });
        before = sum;
    }
    Ok(Reference::from_batches(&batches))
}

/// Renders to the last of the times; the image, its seconds and its samples at each.
fn render_until(scene: &Scene, times: &[f64]) -> Outcome<Vec<(Image, f64, u32)>> {
    let mut rendering = Rendering::new(scene);
    let start = Instant::now();
    let mut snapshots = Vec::new();
    let mut aside = Duration::ZERO;
    for &time in times {
        while (start.elapsed() - aside).as_secs_f64() < time {
            rendering.render_pass()?;
        }
        let seconds = (start.elapsed() - aside).as_secs_f64();
        let copying = Instant::now();
        snapshots.push((rendering.image(), seconds, rendering.samples()));
        aside += copying.elapsed();
    }
    Ok(snapshots)
}

/// The error of several renders, taken apart. All in squared radiance.
struct Decomposition {
    seconds: f64,
    samples: f64,
    mean: f64,
    mse: f64,
    variance: f64,
    bias_squared: f64,
}

impl Decomposition {
    fn new(renders: &[(Image, f64, u32)], reference: &Reference, noise: f64) -> Self {
        let count = renders.len() as f64;
        let mean_image = Image::mean(renders.iter().map(|(image, ..)| image));
        let spread: f64 = renders.iter().map(|(image, ..)| mean_squared_difference(image, &mean_image)).sum();
        let variance = spread / (count - 1.0);
        let mse = renders.iter().map(|(image, ..)| mean_squared_difference(image, &reference.mean)).sum::<f64>()
            / count
            - noise;
        let bias_squared = mean_squared_difference(&mean_image, &reference.mean) - variance / count - noise;
        Self {
            seconds: renders.iter().map(|(_, seconds, _)| seconds).sum::<f64>() / count,
            samples: renders.iter().map(|(.., samples)| f64::from(*samples)).sum::<f64>() / count,
            mean: mean_value(&mean_image),
            mse,
            variance,
            bias_squared,
        }
    }
}

fn mean_squared_difference(first: &Image, second: &Image) -> f64 {
    let sum: f64 = first.pixels.iter().zip(&second.pixels).map(|(&a, &b)| (a - b).length_squared()).sum();
    sum / (3.0 * first.pixels.len() as f64)
}

fn mean_square(image: &Image) -> f64 {
    image.pixels.iter().map(|pixel| pixel.length_squared()).sum::<f64>() / (3.0 * image.pixels.len() as f64)
}

fn mean_value(image: &Image) -> f64 {
    image.pixels.iter().map(|pixel| pixel.element_sum()).sum::<f64>() / (3.0 * image.pixels.len() as f64)
}
