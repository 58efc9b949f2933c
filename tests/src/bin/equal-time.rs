//! Error against time for every integrator on a scene lit by the sun through old glass.
//!
//! For each angular radius of the sun (its irradiance kept the same) each integrator renders with several seeds until
//! the longest time. The table states the mean squared error against the stored reference, less the noise of the
//! reference. It also states the parts of variance and bias, estimated from the spread of the seeds. References are
//! made by `cone-reference`.

use std::{
    path::PathBuf,
    process::ExitCode,
    time::{Duration, Instant},
};

use clap::Parser;
use clerestory_film::decomposition::{Decomposition, decompose, mean};
use clerestory_render_core::document;
use clerestory_render_core::integrator::PreparedScene;
use clerestory_tests::{
    reference::{Image, Reference},
    rendering::Rendering,
    sun_scene::{self, SunScene},
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
    /// Folder of the references, `reference-ANGLE.exr`, whose size is that of the pictures.
    #[arg(long, default_value = "scenes/room")]
    references: PathBuf,
}

/// A sun of the real one's size, degrees: so small that path tracing hardly finds it through glass.
const SMALL_SUN: f64 = 0.27;

/// Under such a sun, the MSE of `path` over that of the best method at the longest time is at least this.
const LEAST_GAIN: f64 = 100.0;

type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

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
    let bundle = document::load(&arguments.scene)?;
    println!(
        "{}, {} seeds, {} threads; MSE over pixels and channels, less the reference's noise",
        arguments.scene.display(),
        arguments.seeds,
        rayon::current_num_threads()
    );
    for &angle in &arguments.angles {
        let file = sun_scene::reference_file(&arguments.references, angle);
        let reference = Reference::read(&file)?;
        let size = [reference.mean.width as u32, reference.mean.height as u32];
        let variant = |integrator: &str, seed: u64| -> Outcome<PreparedScene> {
            let variant = SunScene { angular_radius: angle, integrator, seed, size, path_filter: None };
            Ok(variant.build(&bundle)?)
        };
        let noise = mean_square(&reference.standard_error);
        let reference_numbers = numbers(&reference.mean);
        let mean = mean(&reference_numbers);
        println!(
            "\nsun of half-angle {angle} degrees, {}x{}: mean of the reference {mean:.5}, its noise {:.2e} \
             (relative to the mean squared)",
            size[0],
            size[1],
            noise / (mean * mean)
        );
        println!(
            "integrator   time s   samples   MSE/mean^2     variance        bias^2   mean ratio   MSE of path / this"
        );
        let mut path_errors: Option<Vec<f64>> = None;
        let mut best = 0.0f64;
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
                let error = error(snapshot, &reference_numbers, noise)?;
                let (seconds, samples) = cost(snapshot);
                errors.push(error.mse);
                let gain = path_errors.as_ref().map_or(1.0, |path: &Vec<f64>| path[mark] / error.mse);
                let scale = 1.0 / (mean * mean);
                println!(
                    "{integrator:<10} {:>8.2} {:>9.1} {:>12.4e} {:>12.4e} {:>13.4e} {:>12.5} {:>12.1}",
                    seconds,
                    samples,
                    error.mse * scale,
                    error.variance.unwrap_or(f64::NAN) * scale,
                    error.bias_squared.unwrap_or(f64::NAN) * scale,
                    error.mean / mean,
                    gain,
                );
            }
            if integrator == "path" {
                path_errors = Some(errors);
            } else if let Some(gain) = path_errors.as_ref().and_then(|path| Some(path.last()? / errors.last()?)) {
                best = best.max(gain);
            }
        }
        if angle <= SMALL_SUN && path_errors.is_some() && best < LEAST_GAIN {
            return Err(format!("the MSE of path is only {best:.1} times the best, not {LEAST_GAIN} times").into());
        }
    }
    Ok(())
}

/// Renders to the last of the times; the image, its seconds and its samples at each.
fn render_until(scene: &PreparedScene, times: &[f64]) -> Outcome<Vec<(Image, f64, u32)>> {
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

/// The mean over renders of what was spent on them.
fn cost(renders: &[(Image, f64, u32)]) -> (f64, f64) {
    let seconds: Vec<f64> = renders.iter().map(|(_, seconds, _)| *seconds).collect();
    let samples: Vec<f64> = renders.iter().map(|(.., samples)| f64::from(*samples)).collect();
    (mean(&seconds), mean(&samples))
}

/// The error of several renders, taken apart.
fn error(renders: &[(Image, f64, u32)], reference: &[f64], noise: f64) -> Outcome<Decomposition> {
    let renders: Vec<Vec<f64>> = renders.iter().map(|(image, ..)| numbers(image)).collect();
    let renders: Vec<&[f64]> = renders.iter().map(Vec::as_slice).collect();
    Ok(decompose(&renders, reference, noise).ok_or("there must be a seed, and images of the size of the reference")?)
}

fn numbers(image: &Image) -> Vec<f64> {
    image.pixels.iter().flat_map(|pixel| pixel.to_array()).collect()
}

fn mean_square(image: &Image) -> f64 {
    image.pixels.iter().map(|pixel| pixel.length_squared()).sum::<f64>() / (3.0 * image.pixels.len() as f64)
}
