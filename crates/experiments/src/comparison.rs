//! Variants compared on one scene. Renders with several seeds at the same times give error, bias and cost in each part
//! of the picture.

use clerestory_film::counters::Counters;
use clerestory_film::decomposition::{Decomposition, decompose, mean, standard_error};
use clerestory_film::{FrameImage, RelativeNoise, compare, relative_noise};
use clerestory_render_core::document::SceneBundle;
use serde::Serialize;

use crate::error::ExperimentError;
use crate::figure::{Curve, Figure, Point};
use crate::measure;
use crate::reference::{Reference, noise};
use crate::region::Region;
use crate::scenes::changed;
use crate::session::Session;
use crate::snapshot::Snapshot;
use crate::table::{Column, Table, column, rounded_number};
use crate::variant::Variant;

/// A scene on which variants are compared.
pub(crate) struct Case<'a> {
    /// What tables call it.
    pub(crate) scene: &'a str,
    pub(crate) bundle: &'a SceneBundle,
    pub(crate) reference: &'a Reference,
    pub(crate) regions: &'a [Region],
}

/// One render at one time in one region: a row of `measurements`.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Measurement {
    scene: String,
    variant: String,
    region: String,
    seed: u64,
    time: f64,
    samples_per_pixel: u64,
    wall_seconds: f64,
    core_seconds: f64,
    mse: f64,
    corrected_mse: Option<f64>,
    rel_mse: Option<f64>,
    mean: f64,
    mean_ratio: Option<f64>,
    #[serde(flatten)]
    counters: Counters,
}

/// All seeds of a variant at one time in one region: a row of `summary`.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Summary {
    pub(crate) scene: String,
    pub(crate) variant: String,
    pub(crate) region: String,
    /// The time that was asked for.
    pub(crate) time: f64,
    pub(crate) seeds: usize,
    pub(crate) samples_per_pixel: f64,
    pub(crate) wall_seconds: f64,
    pub(crate) core_seconds: f64,
    pub(crate) mse: f64,
    pub(crate) mse_standard_error: Option<f64>,
    pub(crate) rel_mse: Option<f64>,
    rel_mse_standard_error: Option<f64>,
    pub(crate) variance: Option<f64>,
    pub(crate) bias_squared: Option<f64>,
    pub(crate) bias_squared_standard_error: Option<f64>,
    pub(crate) mean_ratio: Option<f64>,
    pub(crate) mean_ratio_standard_error: Option<f64>,
    pub(crate) variance_times_time: Option<f64>,
    pub(crate) height_evaluations_per_sample: f64,
    pub(crate) seconds_per_sample: f64,
    pub(crate) solver_calls_per_core_second: f64,
    pub(crate) success: Option<f64>,
    pub(crate) truncated: f64,
}

/// The picture of a variant: the first seed at the longest time.
pub(crate) struct VariantPicture {
    pub(crate) scene: String,
    pub(crate) variant: Variant,
    pub(crate) image: FrameImage,
}

/// What a comparison has measured.
#[derive(Default)]
pub(crate) struct Comparison {
    pub(crate) measurements: Vec<Measurement>,
    pub(crate) summaries: Vec<Summary>,
    pub(crate) pictures: Vec<VariantPicture>,
}

const MEASUREMENT_COLUMNS: [Column; 21] = [
    column("scene", "the scene"),
    column("variant", "the integrator and its settings, listed under variants"),
    column("region", "the part of the picture"),
    column("seed", "seed of the random numbers"),
    column("time", "the render time that was asked for, s"),
    column("samples_per_pixel", "samples in each pixel by then"),
    column("wall_seconds", "time that the whole passes up to then took, s"),
    column("core_seconds", "time that all cores together spent on them, s"),
    column("mse", "1/N sum (x - r)^2 over the pixels and channels of the region, as in the FNEE paper"),
    column("corrected_mse", "mse less the noise of the reference"),
    column("rel_mse", "1/N sum (x - r)^2 / (r^2 + 0.01 m^2), m being the mean of |r| over the region"),
    column("mean", "mean of the region's numbers, W/(m2 sr)"),
    column("mean_ratio", "mean over that of the reference"),
    column(
        "height_evaluations",
        "evaluations of a height field, with or without derivatives, at one point; whole picture",
    ),
    column("solver_calls", "starts of the solver from one seed, those of trials included; whole picture"),
    column("converged", "solver calls that converged; whole picture"),
    column(
        "unique_solutions",
        "paths that entered an estimate, told apart within it (of fnee, rays that see the light too); whole picture",
    ),
    column("trials", "solver calls spent on estimating inverse probabilities; whole picture"),
    column("truncated", "estimates of an inverse probability that were cut off; whole picture"),
    column("rays", "rays traced against the scene; whole picture"),
    column("samples", "camera samples; whole picture"),
];

const SUMMARY_COLUMNS: [Column; 23] = [
    column("scene", "the scene"),
    column("variant", "the integrator and its settings, listed under variants"),
    column("region", "the part of the picture"),
    column("time", "the render time that was asked for, s"),
    column("seeds", "renders with independent random numbers"),
    column("samples_per_pixel", "samples in each pixel, mean over the seeds"),
    column("wall_seconds", "time that the whole passes up to then took, mean over the seeds, s"),
    column("core_seconds", "time that all cores together spent on them, mean over the seeds, s"),
    column(
        "mse",
        "1/N sum (x - r)^2 over the pixels and channels of the region less the noise of the reference, mean over the \
         seeds",
    ),
    column("mse_standard_error", "standard error of mse by the spread of the seeds"),
    column(
        "rel_mse",
        "1/N sum (x - r)^2 / (r^2 + 0.01 m^2), m being the mean of |r| over the region, less the noise of the \
         reference; mean over the seeds",
    ),
    column(
        "rel_mse_standard_error",
        "standard error of rel_mse by the spread of the seeds and the noise of the reference",
    ),
    column("variance", "variance of one render, by the spread of the seeds"),
    column("bias_squared", "mse less variance: the squared bias, below zero as often as above where there is none"),
    column("bias_squared_standard_error", "standard error of bias_squared by the jackknife over the seeds"),
    column("mean_ratio", "mean energy of the region over that of the reference"),
    column(
        "mean_ratio_standard_error",
        "standard error of mean_ratio by the spread of the seeds and the noise of the reference",
    ),
    column("variance_times_time", "variance times core_seconds: what the method costs whatever the time"),
    column("height_evaluations_per_sample", "height evaluations for each camera sample; whole picture"),
    column("seconds_per_sample", "core seconds for each camera sample; whole picture"),
    column("solver_calls_per_core_second", "starts of the solver for each second of each core; whole picture"),
    column("success", "part of the solver calls that converge, mean over the seeds; whole picture"),
    column("truncated", "estimates of an inverse probability that were cut off, mean over the seeds; whole picture"),
];

impl Comparison {
    /// Steps of the progress that [`Comparison::run`] takes.
    pub(crate) fn steps(session: &Session, variants: &[Variant]) -> usize {
        variants.len() * session.settings.seeds as usize
    }

    /// Renders every variant of every case with every seed until the longest time, and measures at each time.
    ///
    /// Seeds come one after the other, so that a machine that becomes slower affects all cases and variants.
    pub(crate) fn run(
        &mut self,
        session: &mut Session,
        cases: &[Case<'_>],
        variants: &[Variant],
    ) -> Result<(), ExperimentError> {
        let times = session.settings.times.clone();
        let parts = cases.iter().map(Parts::new).collect::<Result<Vec<_>, ExperimentError>>()?;
        let pairs = || cases.iter().zip(&parts).flat_map(|pair| variants.iter().map(move |variant| (pair, variant)));
        let mut renders: Vec<Vec<Vec<Snapshot>>> = pairs().map(|_| Vec::new()).collect();
        for seed in 1..=u64::from(session.settings.seeds) {
            for (((case, parts), variant), renders) in pairs().zip(&mut renders) {
                session.begin(format!("{}, {}, seed {seed}", case.scene, variant.name));
                let description = case.bundle.description();
                let integrator = variant.integrator(&description.integrator);
                let bundle = changed(case.bundle, integrator, seed, description.sampling)
                    .map_err(|source| ExperimentError::scene(case.scene.as_ref(), source))?;
                let snapshots = measure::until(session, &bundle, &times, &case.reference.asset)?;
                for (&time, snapshot) in times.iter().zip(&snapshots) {
                    self.measurements.extend(parts.measure(case, variant, seed, time, snapshot)?);
                }
                session.end(&line(case, variant, seed, snapshots.last()));
                renders.push(snapshots);
            }
        }
        for (((case, parts), variant), renders) in pairs().zip(renders) {
            for (index, &time) in times.iter().enumerate() {
                let at_time: Vec<&Snapshot> = renders.iter().map(|snapshots| &snapshots[index]).collect();
                self.summaries.extend(parts.summarise(case, variant, time, &at_time)?);
            }
            let last = renders.into_iter().next().and_then(|mut snapshots| snapshots.pop());
            self.pictures.extend(last.map(|Snapshot { image, .. }| VariantPicture {
                scene: case.scene.to_owned(),
                variant: variant.clone(),
                image,
            }));
        }
        Ok(())
    }

    /// The tables of all measurements and of their summary.
    pub(crate) fn tables(&self) -> [Table; 2] {
        let caption = "Every render in every region at every time.".to_owned();
        let measurements = Table::new("measurements", caption, &MEASUREMENT_COLUMNS, &self.measurements).off_page();
        let caption = "Error and cost at equal time: the mean over the seeds.".to_owned();
        [Table::new("summary", caption, &SUMMARY_COLUMNS, &self.summaries), measurements]
    }

    /// Error against time in a region of a scene: a curve for each variant that was rendered there.
    pub(crate) fn error_against_time(&self, scene: &str, region: &str, variants: &[Variant]) -> Figure {
        let of = |variant: &Variant| {
            let rows = self.summaries.iter().filter(|row| row.scene == scene && row.region == region);
            rows.filter(|row| row.variant == variant.name)
                .map(|row| Point { x: row.wall_seconds, y: row.mse, error: row.mse_standard_error.unwrap_or(0.0) })
                .collect()
        };
        let curves = variants.iter().enumerate().map(|(colour, variant)| Curve {
            label: variant.name.clone(),
            points: of(variant),
            colour,
        });
        let curves = curves.filter(|curve| !curve.points.is_empty());
        let title = format!("{scene}: {region}");
        Figure { title, axes: ["render time, s", "mean squared error"], curves: curves.collect() }
    }

    /// The mean energy of each variant over that of the reference, in a region of a scene at the longest time.
    pub(crate) fn energies(&self, scene: &str, region: &str, variants: &[Variant]) -> String {
        let of = |variant: &Variant| {
            let row = self.last(scene, region, &variant.name)?;
            let error = row.mean_ratio_standard_error.map_or_else(String::new, |error| format!(" ± {error:.4}"));
            Some(format!("{} {:.4}{error}", variant.name, row.mean_ratio?))
        };
        let energies: Vec<String> = variants.iter().filter_map(of).collect();
        format!("{scene}, {region}: mean energy over that of the reference: {}.", energies.join(", "))
    }

    /// Relative error times time and the speed of the solver, in a region of a scene at the longest time.
    pub(crate) fn efficiency(&self, scene: &str, region: &str, variant: &Variant) -> Option<String> {
        let row = self.last(scene, region, &variant.name)?;
        let mut text = format!(
            "{scene}, {}: relMSE {}{} after {} core seconds, relMSE times core seconds {}",
            variant.name,
            rounded_number(row.rel_mse?),
            row.rel_mse_standard_error.map_or_else(String::new, |error| format!(" ± {}", rounded_number(error))),
            rounded_number(row.core_seconds),
            rounded_number(row.rel_mse? * row.core_seconds),
        );
        if let Some(success) = row.success {
            let starts = rounded_number(row.solver_calls_per_core_second);
            let percent = rounded_number(100.0 * success);
            text.push_str(&format!("; {starts} starts a core second, {percent} percent of which converge"));
        }
        Some(text + ".")
    }

    /// The summary of a variant in a region of a scene at the longest time.
    pub(crate) fn last(&self, scene: &str, region: &str, variant: &str) -> Option<&Summary> {
        let is_wanted = |row: &&Summary| row.scene == scene && row.region == region && row.variant == variant;
        self.summaries.iter().rfind(is_wanted)
    }
}

/// A line about a finished render.
fn line(case: &Case<'_>, variant: &Variant, seed: u64, last: Option<&Snapshot>) -> String {
    let Some(last) = last else { return String::new() };
    let error = compare(&last.image, &case.reference.image).ok();
    let mse = error.map_or_else(String::new, |error| format!(", MSE {:.3e}", error.corrected_mse.unwrap_or(error.mse)));
    let Snapshot { samples, wall_seconds, .. } = last;
    format!("{}, {}, seed {seed}: {samples} samples a pixel in {wall_seconds:.1} s{mse}", case.scene, variant.name)
}

/// The reference, cut into the regions.
struct Parts<'a> {
    parts: Vec<Part<'a>>,
}

struct Part<'a> {
    region: &'a Region,
    reference: FrameImage,
    numbers: Vec<f64>,
    noise: f64,
    mean: f64,
    mean_standard_error: f64,
}

impl<'a> Parts<'a> {
    fn new(case: &Case<'a>) -> Result<Self, ExperimentError> {
        let part = |region: &'a Region| {
            let reference = region.of(&case.reference.image)?;
            let numbers = numbers(&reference);
            Ok(Part {
                region,
                noise: noise(&reference).unwrap_or(0.0),
                mean: mean(&numbers),
                mean_standard_error: mean_standard_error(&reference),
                numbers,
                reference,
            })
        };
        let parts = case.regions.iter().filter(|region| !region.pixels.is_empty()).map(part);
        Ok(Self { parts: parts.collect::<Result<_, ExperimentError>>()? })
    }

    fn measure(
        &self,
        case: &Case<'_>,
        variant: &Variant,
        seed: u64,
        time: f64,
        snapshot: &Snapshot,
    ) -> Result<Vec<Measurement>, ExperimentError> {
        let measurement = |part: &Part<'_>| {
            let image = part.region.of(&snapshot.image)?;
            let metrics = compare(&image, &part.reference).map_err(ExperimentError::Compare)?;
            Ok(Measurement {
                scene: case.scene.to_owned(),
                variant: variant.name.clone(),
                region: part.region.name.clone(),
                seed,
                time,
                samples_per_pixel: snapshot.samples,
                wall_seconds: snapshot.wall_seconds,
                core_seconds: snapshot.core_seconds,
                mse: metrics.mse,
                corrected_mse: metrics.corrected_mse,
                rel_mse: metrics.rel_mse,
                mean: mean(&numbers(&image)),
                mean_ratio: metrics.mean_ratio,
                counters: snapshot.counters,
            })
        };
        self.parts.iter().map(measurement).collect()
    }

    fn summarise(
        &self,
        case: &Case<'_>,
        variant: &Variant,
        time: f64,
        snapshots: &[&Snapshot],
    ) -> Result<Vec<Summary>, ExperimentError> {
        let over_seeds = |value: &dyn Fn(&Snapshot) -> f64| {
            mean(&snapshots.iter().map(|snapshot| value(snapshot)).collect::<Vec<_>>())
        };
        let per_sample = |snapshot: &Snapshot, value: f64| value / snapshot.counters.samples.max(1) as f64;
        let core_seconds = over_seeds(&|snapshot| snapshot.core_seconds);
        let mut summaries = Vec::new();
        for part in &self.parts {
            let images: Vec<FrameImage> =
                snapshots.iter().map(|snapshot| part.region.of(&snapshot.image)).collect::<Result<_, _>>()?;
            let rel_mses: Option<Vec<f64>> =
                images.iter().map(|image| compare(image, &part.reference).ok()?.rel_mse).collect();
            let noise = relative_noise(&part.reference).unwrap_or(RelativeNoise { mean: 0.0, deviation: 0.0 });
            let rel_mse = rel_mses.as_deref().map(|values| mean(values) - noise.mean);
            let rel_mse_standard_error =
                rel_mses.as_deref().and_then(standard_error).zip(rel_mse).map(|(spread, error)| {
                    // Errors of the reference also multiply those of the renders, twice, and are equal in three
                    // channels.
                    let product = 2.0 * (3.0 * error.max(0.0) * noise.mean / part.numbers.len() as f64).sqrt();
                    spread.hypot(noise.deviation).hypot(product)
                });
            let renders: Vec<Vec<f64>> = images.iter().map(numbers).collect();
            let renders: Vec<&[f64]> = renders.iter().map(Vec::as_slice).collect();
            let Some(error) = decompose(&renders, &part.numbers, part.noise) else { continue };
            let Decomposition { mse, mse_standard_error, variance, bias_squared, .. } = error;
            let ratio = |value: f64| (part.mean > 0.0).then(|| value / part.mean);
            summaries.push(Summary {
                scene: case.scene.to_owned(),
                variant: variant.name.clone(),
                region: part.region.name.clone(),
                time,
                seeds: snapshots.len(),
                samples_per_pixel: over_seeds(&|snapshot| snapshot.samples as f64),
                wall_seconds: over_seeds(&|snapshot| snapshot.wall_seconds),
                core_seconds,
                mse,
                mse_standard_error,
                rel_mse,
                rel_mse_standard_error,
                variance,
                bias_squared,
                bias_squared_standard_error: error.bias_squared_standard_error,
                mean_ratio: ratio(error.mean),
                mean_ratio_standard_error: error
                    .mean_standard_error
                    .and_then(|own| ratio(own.hypot(part.mean_standard_error))),
                variance_times_time: variance.map(|variance| variance * core_seconds),
                height_evaluations_per_sample: over_seeds(&|snapshot| {
                    per_sample(snapshot, snapshot.counters.height_evaluations as f64)
                }),
                seconds_per_sample: over_seeds(&|snapshot| per_sample(snapshot, snapshot.core_seconds)),
                solver_calls_per_core_second: over_seeds(&|snapshot| {
                    snapshot.counters.solver_calls as f64 / snapshot.core_seconds
                }),
                success: (snapshots.iter().all(|snapshot| snapshot.counters.solver_calls > 0)).then(|| {
                    over_seeds(&|snapshot| snapshot.counters.converged as f64 / snapshot.counters.solver_calls as f64)
                }),
                truncated: over_seeds(&|snapshot| snapshot.counters.truncated as f64),
            });
        }
        Ok(summaries)
    }
}

fn numbers(image: &FrameImage) -> Vec<f64> {
    image.layers().mean.as_flattened().iter().map(|number| f64::from(*number)).collect()
}

/// Standard error of the mean of an image's numbers. Pixels are independent. The channels of a pixel are assumed to
/// deviate in the same direction.
fn mean_standard_error(image: &FrameImage) -> f64 {
    let Some(errors) = &image.layers().standard_error else { return 0.0 };
    let squares: f64 = errors.iter().map(|error| error.iter().map(|&one| f64::from(one)).sum::<f64>().powi(2)).sum();
    squares.sqrt() / (3 * errors.len().max(1)) as f64
}
