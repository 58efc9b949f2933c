//! `adaptive`: what it gains to share out the passes of a round among the tiles by their noise.

use clerestory_film::compare;
use clerestory_film::decomposition::{mean, standard_error};
use clerestory_render_core::document::SamplingDescription;
use clerestory_render_core::document::SceneBundle;
use serde::Serialize;

use crate::error::ExperimentError;
use crate::experiment::{Defaults, Experiment};
use crate::measure::{self, Sharing};
use crate::reference::{Reference, reference};
use crate::report::Report;
use crate::scenes::{EmbeddedScene, FOUR_PANES, NAVE_4, changed};
use crate::session::Session;
use crate::snapshot::Snapshot;
use crate::table::{Column, Table, column, rounded_number};
use crate::variant::Variant;

/// Of no paper: the gain over the same number of samples in every pixel.
pub(crate) const EXPERIMENT: Experiment = Experiment {
    name: "adaptive",
    title: "Passes shared out among tiles by their noise, against the same in every tile",
    question: "Each scene is rendered with the same passes in every tile, and with passes that are shared out by the \
               noise of a pilot, as `--adaptive` does; the pilot's time counts. The error of both falls as the inverse \
               of the time, so the product of error and time says how long each takes to an equal error.",
    defaults: Defaults {
        times: None,
        seeds: Some(3),
        size: [64, 64],
        reference_samples: Some(2048),
        renders: false,
        references: None,
    },
    run,
};

/// Samples in a pixel of the noisiest tile.
const SAMPLES: u32 = 256;

/// Blocks small enough that shares of so few samples can differ.
const SAMPLING: SamplingDescription = SamplingDescription { samples_per_pass: 4, samples_per_block: 16 };

/// The scenes.
const SCENES: [(&EmbeddedScene, &str); 2] = [(&FOUR_PANES, "four panes"), (&NAVE_4, "nave")];

/// How a scene is rendered with one of both.
#[derive(Clone, Debug, Serialize)]
struct Row {
    scene: &'static str,
    variant: String,
    passes: &'static str,
    samples_per_pixel: f64,
    core_seconds: f64,
    mse: f64,
    mse_standard_error: Option<f64>,
    light: f64,
    mse_times_core_seconds: f64,
    gain: Option<f64>,
}

const COLUMNS: [Column; 10] = [
    column("scene", "the scene"),
    column("variant", "the integrator and its settings, listed under variants"),
    column("passes", "how many each tile gets"),
    column("samples_per_pixel", "samples in the image over its pixels"),
    column("core_seconds", "time that all cores together spent on an image and its pilot, s, mean over the seeds"),
    column("mse", "mean squared error against the reference, corrected for its noise, mean over the seeds"),
    column("mse_standard_error", "standard error of mse by the spread of the seeds"),
    column("light", "sum of the image over that of the reference, mean over the seeds"),
    column("mse_times_core_seconds", "the product of both: the less, the better"),
    column("gain", "how many times as long the same passes in every tile take to the same error"),
];

fn run(session: &mut Session) -> Result<Report, ExperimentError> {
    let variants = [Variant::cone(), Variant::fnee()];
    let renders = SCENES.len() * variants.len() * 2 * session.settings.seeds as usize;
    session.plan(SCENES.len() + renders);
    let mut report = Report::default();
    let mut rows = Vec::new();
    for (file, name) in SCENES {
        let bundle = file.bundle(session.settings.size)?;
        let reference = reference(session, name, &bundle)?;
        report.add_scene(name, &bundle, &reference);
        for variant in &variants {
            let even = row(session, name, &bundle, variant, Sharing::Even, &reference)?;
            let shared = row(session, name, &bundle, variant, Sharing::ByNoise, &reference)?;
            let gain = even.mse_times_core_seconds / shared.mse_times_core_seconds;
            report.statements.push(format!(
                "{name}, {}: shared out by noise, {} of the core time, {} times the error: a gain of {} at equal time.",
                variant.name,
                rounded_number(shared.core_seconds / even.core_seconds),
                rounded_number(shared.mse / even.mse),
                rounded_number(gain),
            ));
            rows.extend([even, Row { gain: Some(gain), ..shared }]);
        }
    }
    let caption = "The same passes in every tile, and shared out by noise.".to_owned();
    report.tables = vec![Table::new("adaptive", caption, &COLUMNS, &rows)];
    report.variants = variants.to_vec();
    Ok(report)
}

fn row(
    session: &mut Session,
    scene: &'static str,
    bundle: &SceneBundle,
    variant: &Variant,
    sharing: Sharing,
    reference: &Reference,
) -> Result<Row, ExperimentError> {
    let passes = match sharing {
        Sharing::Even => "the same in every tile",
        Sharing::ByNoise => "shared out by noise",
    };
    let (mut errors, mut light, mut seconds, mut samples) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for seed in 1..=u64::from(session.settings.seeds) {
        session.begin(format!("{scene}, {}, {passes}, seed {seed}", variant.name));
        let integrator = variant.integrator(&bundle.description().integrator);
        let bundle = changed(bundle, integrator, seed, SAMPLING)
            .map_err(|source| ExperimentError::scene(scene.as_ref(), source))?;
        let Snapshot { image, core_seconds, counters, .. } = measure::shared(session, &bundle, SAMPLES, sharing)?;
        let metrics = compare(&image, &reference.image).map_err(ExperimentError::Compare)?;
        errors.push(metrics.corrected_mse.unwrap_or(metrics.mse));
        light.extend(metrics.mean_ratio);
        seconds.push(core_seconds);
        samples.push(counters.samples as f64 / (f64::from(image.width()) * f64::from(image.height())));
        session.end(&format!("{scene}, {}, {passes}, seed {seed}: {core_seconds:.1} core seconds", variant.name));
    }
    let (mse, core_seconds) = (mean(&errors), mean(&seconds));
    Ok(Row {
        scene,
        variant: variant.name.clone(),
        passes,
        samples_per_pixel: mean(&samples),
        core_seconds,
        mse,
        mse_standard_error: standard_error(&errors),
        light: mean(&light),
        mse_times_core_seconds: mse * core_seconds,
        gain: None,
    })
}
