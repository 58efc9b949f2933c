//! `flicker`: conic paper, section 5. How much of what changes between the frames of an animation is noise.

use std::path::Path;

use clerestory_render_core::document::SceneBundle;
use clerestory_render_core::document::water::{TriangleCount, WaterSettings, WaterView};
use serde::Serialize;

use crate::error::ExperimentError;
use crate::experiment::{Defaults, Experiment};
use crate::figure::{Curve, Figure, Point};
use crate::measure;
use crate::report::Report;
use crate::scenes::{SAMPLING, changed, computed_pool};
use crate::session::Session;
use crate::table::{Column, Table, column, rounded_number};
use crate::variant::Variant;

/// Granizo-Hidalgo and Holzschuch 2024, section 5.
pub(crate) const EXPERIMENT: Experiment = Experiment {
    name: "flicker",
    title: "Noise between the frames of an animation, along the conic and by manifold sampling (conic paper, section \
            5)",
    question: "The floor of a pool is seen straight from above while the waves move on in slow motion. Frames are \
               rendered along the conic at one sample for each pixel, and by specular manifold sampling in the same \
               time. What a pixel does from frame to frame that is not a straight line is noise, but for what the \
               waves themselves do, which frames of many samples show. Noise is stated against the brightness of a \
               method's own frames and against that of all light: a method that misses light is dark, and its noise is \
               small for that. A frame's time is that of its samples and of what a method prepares for it, such as the \
               tree of conic. Granizo-Hidalgo and Holzschuch 2024 say that their caustics are free of noise, and \
               coherent over the frames of an animation. Each is rendered with the same random numbers in all frames, \
               as one would to keep noise still, and with others in each.",
    defaults: Defaults {
        times: None,
        seeds: None,
        size: [256, 256],
        reference_samples: Some(256),
        renders: true,
        references: None,
    },
    run,
};

/// Triangles of the surface.
const TRIANGLES: &str = "100000";

/// Frames of the animation.
const FRAMES: u32 = 8;

/// From one to the next, seconds: waves of a metre move by a millimetre, an eighth of a pixel.
const STEP: f64 = 1e-3;

/// Whether frames share their random numbers.
const SEEDS: [(&str, u32); 2] = [("the same in all frames", 0), ("others in each frame", 1)];

/// How a method's frames differ.
#[derive(Clone, Debug, Serialize)]
struct Row {
    variant: String,
    random_numbers: &'static str,
    samples_per_pixel: u32,
    core_seconds: f64,
    preparation_seconds: f64,
    light: f64,
    flicker: f64,
    noise: f64,
    noise_at_equal_time: f64,
    noise_of_all_light: f64,
    noise_of_all_light_at_equal_time: f64,
}

const COLUMNS: [Column; 11] = [
    column("variant", "the integrator and its settings, listed under variants"),
    column("random_numbers", "whether frames share them"),
    column("samples_per_pixel", "samples of each pixel in each frame"),
    column(
        "core_seconds",
        "time that all cores together spent on a frame and its preparation, s, mean over the frames",
    ),
    column("preparation_seconds", "what of that the method takes to prepare a frame, beyond what path tracing does, s"),
    column("light", "brightness, the mean radiance over pixels and frames, over that of converged frames by conic"),
    column(
        "flicker",
        "root mean square of the second differences between frames, divided by the square root of 6, over the \
         method's own \
         brightness: the standard deviation of independent noise",
    ),
    column(
        "noise",
        "the same without what the waves do: the root of the difference to the square for converged frames by conic. \
         Of \
         a method that misses light, the waves are taken to move the rest as much; flicker is what it is at the most",
    ),
    column(
        "noise_at_equal_time",
        "the noise if a frame with its preparation took as long as one along the conic, by the root of the samples",
    ),
    column("noise_of_all_light", "noise over the brightness of converged frames by conic: noise times light"),
    column("noise_of_all_light_at_equal_time", "noise_at_equal_time times light"),
];

/// The frames of a method.
struct Animation {
    /// Mean radiance of the channels, for each frame and pixel.
    frames: Vec<Vec<f64>>,
    core_seconds: f64,
}

fn run(session: &mut Session) -> Result<Report, ExperimentError> {
    let conic = Variant::conic();
    let sms = [Variant::sms_biased(1), Variant::sms_biased(4), Variant::sms_biased(16), Variant::sms()];
    let variants: Vec<Variant> =
        [conic.clone(), Variant::conic_without_rays(), Variant::conic_published()].into_iter().chain(sms).collect();
    session.plan(1 + variants.len() * (1 + SEEDS.len()));
    let bundles =
        (0..FRAMES).map(|frame| frame_bundle(session, frame)).collect::<Result<Vec<SceneBundle>, ExperimentError>>()?;
    let mut report = Report::default();
    report.note_scene("pool", &bundles[0]);
    let many = session.settings.reference_samples;
    let converged = animation(session, &bundles, &conic, many, 0)?;
    let motion = flicker(&converged.frames);
    let mut costs = Vec::new();
    for variant in &variants {
        costs.push(Cost::of(session, &bundles[0], variant)?);
    }
    // One sample along the conic, and the samples of other methods in the same time.
    let frame_seconds = costs[0].preparation + costs[0].sample;
    let mut rows = Vec::new();
    let mut curves = vec![curve("conic, converged", &converged.frames, 0)];
    for ((variant, cost), colour) in variants.iter().zip(&costs).zip(1..) {
        let samples = cost.samples_in(frame_seconds).round().clamp(1.0, f64::from(many)) as u32;
        for (random_numbers, step) in SEEDS {
            let Animation { frames, core_seconds } = animation(session, &bundles, variant, samples, step)?;
            if step > 0 {
                curves.push(curve(&variant.name, &frames, colour));
            }
            let core_seconds = core_seconds + cost.preparation;
            let conic = rows.iter().find(|row: &&Row| row.random_numbers == random_numbers);
            let conic_seconds = conic.map_or(core_seconds, |conic| conic.core_seconds);
            let cost = Cost { sample: (core_seconds - cost.preparation) / f64::from(samples), ..*cost };
            let light = brightness(&frames) / brightness(&converged.frames);
            let flicker = flicker(&frames);
            let noise = (flicker * flicker - motion * motion).max(0.0).sqrt();
            let noise_at_equal_time = noise * (f64::from(samples) / cost.samples_in(conic_seconds)).sqrt();
            rows.push(Row {
                variant: variant.name.clone(),
                random_numbers,
                samples_per_pixel: samples,
                core_seconds,
                preparation_seconds: cost.preparation,
                light,
                flicker,
                noise,
                noise_at_equal_time,
                noise_of_all_light: noise * light,
                noise_of_all_light_at_equal_time: noise_at_equal_time * light,
            });
        }
    }
    report.add_figure(&Figure {
        title: "Pool: one pixel of the floor".to_owned(),
        axes: ["frame", "radiance, mean of the channels"],
        curves,
    })?;
    report.statements = statements(&rows, motion);
    let caption = "What changes from frame to frame.".to_owned();
    report.tables = vec![Table::new("flicker", caption, &COLUMNS, &rows)];
    report.variants = variants;
    Ok(report)
}

/// What a method takes, core seconds.
#[derive(Clone, Copy, Debug)]
struct Cost {
    /// To prepare a frame.
    preparation: f64,
    /// For a sample of each pixel.
    sample: f64,
}

impl Cost {
    /// Measured on a frame.
    fn of(session: &mut Session, bundle: &SceneBundle, variant: &Variant) -> Result<Self, ExperimentError> {
        let sample = animation(session, std::slice::from_ref(bundle), variant, 1, 0)?.core_seconds;
        let integrator = variant.integrator(&bundle.description().integrator);
        let bundle = changed(bundle, integrator, 1, SAMPLING);
        let bundle = bundle.map_err(|source| ExperimentError::scene(Path::new("pool"), source))?;
        Ok(Self { preparation: measure::preparation_seconds(session, &bundle)?, sample })
    }

    /// Samples of each pixel that fit into a frame of this time: at least a hundredth.
    fn samples_in(&self, seconds: f64) -> f64 {
        ((seconds - self.preparation) / self.sample).max(0.01)
    }
}

fn frame_bundle(session: &Session, frame: u32) -> Result<SceneBundle, ExperimentError> {
    let triangles: TriangleCount = TRIANGLES.parse().expect("a number of triangles");
    let settings = WaterSettings { triangles, time: f64::from(frame) * STEP, view: WaterView::Floor };
    let failure = |source| ExperimentError::scene(Path::new(&format!("pool, frame {frame}")), source);
    computed_pool(&settings, session.settings.size).map_err(failure)
}

/// Renders each frame with `samples` samples. The first frame has the seed 1, and each later one the seed before it
/// plus `step`.
fn animation(
    session: &mut Session,
    bundles: &[SceneBundle],
    variant: &Variant,
    samples: u32,
    step: u32,
) -> Result<Animation, ExperimentError> {
    let count = bundles.len();
    session.begin(format!("{}, {count} frames of {samples} samples", variant.name));
    let mut animation = Animation { frames: Vec::new(), core_seconds: 0.0 };
    for (frame, bundle) in (0u32..).zip(bundles) {
        let integrator = variant.integrator(&bundle.description().integrator);
        let bundle = changed(bundle, integrator, u64::from(1 + frame * step), SAMPLING);
        let bundle = bundle.map_err(|source| ExperimentError::scene(Path::new("pool"), source))?;
        let snapshot = measure::samples(session, &bundle, samples)?;
        animation.core_seconds += snapshot.core_seconds / count as f64;
        let mean = |pixel: &[f32; 3]| pixel.iter().copied().map(f64::from).sum::<f64>() / 3.0;
        animation.frames.push(snapshot.image.layers().mean.iter().map(mean).collect());
    }
    session.end(&format!("{}: {:.3} core seconds for each frame", variant.name, animation.core_seconds));
    Ok(animation)
}

fn brightness(frames: &[Vec<f64>]) -> f64 {
    let pixels = frames.iter().flatten();
    pixels.clone().sum::<f64>() / pixels.count() as f64
}

/// Standard deviation of the noise of a pixel over its mean, by the second differences between frames. Their
/// coefficients 1, -2 and 1 have 6 as the sum of squares, and an even change has no second difference.
fn flicker(frames: &[Vec<f64>]) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for three in frames.windows(3) {
        for ((before, now), after) in three[0].iter().zip(&three[1]).zip(&three[2]) {
            sum += (before - 2.0 * now + after).powi(2);
            count += 1.0;
        }
    }
    (sum / (6.0 * count)).sqrt() / brightness(frames)
}

/// The radiance of the pixel in the middle of the picture.
fn curve(label: &str, frames: &[Vec<f64>], colour: usize) -> Curve {
    let point = |(frame, pixels): (usize, &Vec<f64>)| {
        let edge = pixels.len().isqrt();
        Point { x: (frame + 1) as f64, y: pixels[edge / 2 * edge + edge / 2], error: 0.0 }
    };
    Curve { label: label.to_owned(), points: frames.iter().enumerate().map(point).collect(), colour }
}

fn statements(rows: &[Row], motion: f64) -> Vec<String> {
    let percent = |part: f64| rounded_number(100.0 * part);
    let mut statements =
        vec![format!("The waves themselves make a pixel flicker by {} percent of the brightness.", percent(motion))];
    for row in rows {
        let first = rows.iter().find(|first| first.random_numbers == row.random_numbers);
        let ratio = |value: fn(&Row) -> f64| rounded_number(first.map_or(f64::NAN, |first| value(row) / value(first)));
        statements.push(format!(
            "{}, random numbers {}: noise of {} percent of its brightness and {} of that of all light with {} \
             samples in {} core seconds; at equal time {} and {} times those of conic.",
            row.variant,
            row.random_numbers,
            percent(row.noise),
            percent(row.noise_of_all_light),
            row.samples_per_pixel,
            rounded_number(row.core_seconds),
            ratio(|row| row.noise_at_equal_time),
            ratio(|row| row.noise_of_all_light_at_equal_time),
        ));
    }
    statements
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_changes_evenly_does_not_flicker_and_noise_does() {
        let evenly: Vec<Vec<f64>> = (0..5).map(|frame| vec![1.0 + 0.25 * f64::from(frame), 3.0]).collect();
        assert_eq!(flicker(&evenly), 0.0);
        // Independent values 0 and 2: mean and standard deviation 1.
        let mut state = 1u32;
        let mut next = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            2.0 * f64::from(state >> 31)
        };
        let noise: Vec<Vec<f64>> = (0..10).map(|_| (0..10_000).map(|_| next()).collect()).collect();
        assert!((flicker(&noise) - 1.0).abs() < 0.02, "{}", flicker(&noise));
    }
}
