//! References of pairs of scenes and lights: two halves by two methods, which the bias test compares. Beside light
//! tracing, `auto` has its usual effort, with all techniques: a pilot may choose what `light` does.
//!
//! Each half has 32 independently seeded replicates with the same number of passes. The reference is the mean of both
//! halves, weighted by the inverse of their mean squared errors.

use std::error::Error;
use std::fs;
use std::path::Path;

use clerestory_experiments::pairs::stored::{self, StoredReference, index, picture_name};
use clerestory_experiments::pairs::{Pair, rendered_by};
use clerestory_film::{FrameImage, ImageLayers};
use clerestory_local_render::Clocks;
use clerestory_render_core::document::SceneBundle;
use clerestory_render_core::integrator::PreparedScene;

use crate::bias::{BLOCK, BiasReport, compare};
use crate::comparisons::REPLICATES;
use crate::reference::{Image, Reference};
use crate::rendering::Rendering;

/// Far from the seeds of the renders that are compared with references.
const SEED: u64 = 1_000_000;

/// Edge of the blocks that are compared one by one, pixels.
const EDGE: usize = 2 * BLOCK;

/// Part of the time of a half that goes into finding the number of passes.
const PILOT: f64 = 0.02;

/// Why there is no reference.
pub type Failure = Box<dyn Error + Send + Sync>;

/// A half of a reference.
struct Half {
    replicates: Vec<Image>,
    core_seconds: f64,
}

/// Renders the reference of a pair in a size, `core_seconds` for each half, and stores it in a folder with its entry in
/// the index.
///
/// # Errors
///
/// When the scene cannot be rendered, or a file not written.
pub fn store(
    folder: &Path,
    pair: &Pair,
    size: [u32; 2],
    core_seconds: [f64; 2],
    mut told: impl FnMut(f64),
) -> Result<StoredReference, Failure> {
    let bundle = pair.bundle(size)?;
    let [first, second] = pair.halves;
    let total: f64 = core_seconds.iter().sum();
    let part = core_seconds[0] / total;
    let halves = [
        half(&bundle, [first, second], SEED, core_seconds[0], |done| told(part * done))?,
        half(&bundle, [second, first], 2 * SEED, core_seconds[1], |done| told(part + (1.0 - part) * done))?,
    ];
    let references = halves.each_ref().map(|half| Reference::from_batches(&half.replicates));
    let report = compare(&halves[1].replicates, &references[0], &[], EDGE);
    let variances = references.each_ref().map(|reference| mean_square(&reference.standard_error));
    let weights = weights(variances);
    let [mean, standard_error] = combined(&references, weights);
    let record = StoredReference {
        file: picture_name(pair),
        scene: bundle.scene_hash().to_string(),
        methods: pair.halves.map(str::to_owned),
        core_seconds: halves.each_ref().map(|half| half.core_seconds),
        weights,
        noise: mean_square(&standard_error) / square_of_mean(&mean),
        mean_error: report.mean_error,
        verdict: verdict(&report),
        agrees: report.agrees(),
    };
    let layers =
        ImageLayers { mean: numbers(&mean), standard_error: Some(numbers(&standard_error)), ..ImageLayers::default() };
    let image = FrameImage::new(mean.width as u32, mean.height as u32, layers, None)?;
    fs::create_dir_all(folder)?;
    fs::write(folder.join(&record.file), image.encode()?)?;
    let mut index = index(folder)?;
    index.insert(pair.name.to_owned(), record.clone());
    fs::write(folder.join(stored::INDEX), serde_json::to_string_pretty(&index)? + "\n")?;
    Ok(record)
}

/// Renders a half by one method, beside another, on all cores.
fn half(
    bundle: &SceneBundle,
    [method, other]: [&str; 2],
    seed: u64,
    core_seconds: f64,
    mut told: impl FnMut(f64),
) -> Result<Half, Failure> {
    let threads = rayon::current_num_threads();
    let mut scene = PreparedScene::build(&rendered_by(bundle, method, seed)?)?;
    if other == "light" {
        // A pilot may choose for `auto` what `light` does, and both halves would be one method.
        scene = scene.without_pilot();
    }
    let passes = {
        let mut pilot = Rendering::new(&scene);
        // `auto` chooses before its first pass, once for all replicates.
        pilot.render_pass()?;
        let clocks = Clocks::now();
        while pilot.passes() == 1 || clocks.spent(threads).core.as_secs_f64() < PILOT * core_seconds {
            pilot.render_pass()?;
        }
        let each = clocks.spent(threads).core.as_secs_f64() / f64::from(pilot.passes() - 1);
        (core_seconds / each / REPLICATES as f64).round().max(1.0) as u32
    };
    let clocks = Clocks::now();
    let mut replicates = Vec::new();
    for replicate in 1..=REPLICATES {
        scene = scene.changed(&rendered_by(bundle, method, seed + replicate)?)?;
        let mut rendering = Rendering::new(&scene);
        for _ in 0..passes {
            rendering.render_pass()?;
        }
        replicates.push(rendering.image());
        told(replicate as f64 / REPLICATES as f64);
    }
    Ok(Half { replicates, core_seconds: clocks.spent(threads).core.as_secs_f64() })
}

/// Weights by the inverse of the variances; even where these are zero.
fn weights([first, second]: [f64; 2]) -> [f64; 2] {
    let sum = first + second;
    if sum > 0.0 { [second / sum, first / sum] } else { [0.5; 2] }
}

/// The weighted mean of two halves and its standard error.
fn combined([first, second]: &[Reference; 2], weights: [f64; 2]) -> [Image; 2] {
    let mut mean = first.mean.clone().scaled(weights[0]);
    let mut standard_error = first.standard_error.clone().scaled(weights[0]);
    let errors = mean.pixels.iter_mut().zip(&mut standard_error.pixels);
    for ((mean, error), (other, other_error)) in
        errors.zip(second.mean.pixels.iter().zip(&second.standard_error.pixels))
    {
        *mean += *other * weights[1];
        let other_error = *other_error * weights[1];
        let squares = *error * *error + other_error * other_error;
        *error = glam::DVec3::new(squares.x.sqrt(), squares.y.sqrt(), squares.z.sqrt());
    }
    [mean, standard_error]
}

fn verdict(report: &BiasReport) -> String {
    format!(
        "{}: mean {:+.3} % (se {:.3} %), {} blocks (se95 {:.2} %), chi2 {:.2}",
        if report.agrees() { "agrees" } else { "BIASED" },
        (report.mean_ratio.iter().sum::<f64>() / 3.0 - 1.0) * 100.0,
        report.mean_error * 100.0,
        report.blocks,
        report.block_error * 100.0,
        report.chi_square,
    )
}

fn mean_square(image: &Image) -> f64 {
    image.pixels.iter().map(|pixel| pixel.length_squared()).sum::<f64>() / (3.0 * image.pixels.len() as f64)
}

fn square_of_mean(image: &Image) -> f64 {
    let sum: f64 = image.pixels.iter().map(|pixel| pixel.element_sum()).sum();
    (sum / (3.0 * image.pixels.len() as f64)).powi(2)
}

fn numbers(image: &Image) -> Vec<[f32; 3]> {
    image.pixels.iter().map(|pixel| pixel.to_array().map(|number| number as f32)).collect()
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    #[test]
    fn the_better_half_has_the_larger_weight_and_errors_add_up_as_variances() {
        let image = |number: f64| Image { width: 1, height: 1, pixels: vec![DVec3::splat(number)] };
        let half = |mean: f64, error: f64| Reference {
            mean: image(mean),
            halves: [image(mean), image(mean)],
            standard_error: image(error),
        };
        let weights = weights([0.01, 0.03]);
        assert_eq!(weights, [0.75, 0.25]);
        let [mean, error] = combined(&[half(1.0, 0.1), half(2.0, 0.03_f64.sqrt())], weights);
        assert!((mean.pixels[0].x - 1.25).abs() < 1e-12);
        assert!((error.pixels[0].x.powi(2) - 0.0075).abs() < 1e-12, "the inverse of 1/0.01 + 1/0.03");
        assert_eq!(super::weights([0.0; 2]), [0.5; 2]);
    }
}
