//! `pool`: conic paper, section 5. How long specular manifold sampling takes to errors that the walk along the conic reaches.

use serde::Serialize;

use super::comparison::{Case, Comparison, Summary};
use super::reference::reference;
use super::region::Region;
use super::scenes::POOL;
use super::session::Session;
use super::table::{Column, Table, column, rounded_number};
use super::variant::Variant;
use super::{Defaults, Experiment, Report};
use crate::failure::Failure;

/// Granizo-Hidalgo and Holzschuch 2024, section 5.
pub(super) const EXPERIMENT: Experiment = Experiment {
    name: "pool",
    title: "Time to equal error in a pool, along the conic and by manifold sampling (conic paper, section 5)",
    question: "A pool is rendered along the conic, by the published walk to the first path and by all paths over the water, and by \
               specular manifold sampling, biased with M = 1 to 32 trials and without bias. Granizo-Hidalgo and Holzschuch 2024 \
               compare pictures and find their walk 6 times as fast as biased manifold sampling of the same quality, and more \
               than 100 times as fast as 256 unbiased samples. Here each method is rendered for the same times, and what it \
               reaches is compared with the time that the others take to the same error.",
    defaults: Defaults {
        times: Some(&[1.0, 2.0, 4.0, 8.0]),
        seeds: Some(5),
        size: [128, 128],
        reference_samples: Some(1024),
        renders: true,
    },
    run,
};

const SCENE: &str = "pool";

/// An error that manifold sampling reaches, and how long others take to it.
#[derive(Debug, Serialize)]
struct Row {
    variant: String,
    time: f64,
    core_seconds: f64,
    mse: f64,
    mean_ratio: Option<f64>,
    conic_core_seconds: Option<f64>,
    conic_ratio: Option<f64>,
    published_core_seconds: Option<f64>,
    published_ratio: Option<f64>,
}

const COLUMNS: [Column; 9] = [
    column("variant", "the integrator and its settings, listed under variants"),
    column("time", "the render time that was asked for, s"),
    column("core_seconds", "time that all cores together spent, s"),
    column("mse", "mean squared error less the noise of the reference, mean over the seeds"),
    column("mean_ratio", "mean energy of the picture over that of the reference"),
    column("conic_core_seconds", "time that conic takes to the same error, at least that of one sample a pixel"),
    column("conic_ratio", "core_seconds over conic_core_seconds"),
    column("published_core_seconds", "the same for the published walk, where it reaches that error"),
    column("published_ratio", "core_seconds over published_core_seconds"),
];

fn run(session: &mut Session) -> Result<Report, Failure> {
    let walks = [1, 2, 4, 8, 16, 32].map(Variant::sms_biased);
    let manifold: Vec<Variant> = walks.into_iter().chain([Variant::sms()]).collect();
    let variants: Vec<Variant> =
        [Variant::conic(), Variant::conic_published()].into_iter().chain(manifold.clone()).collect();
    session.plan(1 + Comparison::steps(session, &variants));
    let bundle = POOL.bundle(session.settings.size)?;
    let reference = reference(session, SCENE, &bundle)?;
    let regions = [Region::whole(&reference.image)];
    let region = &regions[0].name;
    let mut comparison = Comparison::default();
    let case = Case { scene: SCENE, bundle: &bundle, reference: &reference, regions: &regions };
    comparison.run(session, &[case], &variants)?;
    let mut report = Report::default();
    report.add_scene(SCENE, &bundle, &reference);
    report.add_pictures(SCENE, &reference, &mut comparison);
    report.add_figure(&comparison.error_against_time(SCENE, region, &variants))?;
    report.statements.push(comparison.energies(SCENE, region, &variants));
    let rows = rows(&comparison.summaries, &manifold);
    report.statements.extend(manifold.iter().filter_map(|variant| statement(&rows, variant)));
    let caption = "What manifold sampling reaches, and how long the conic takes to the same error.".to_owned();
    let [summary, measurements] = comparison.tables();
    report.tables = vec![Table::new("equal_error", caption, &COLUMNS, &rows), summary, measurements];
    report.variants = variants;
    Ok(report)
}

fn rows(summaries: &[Summary], manifold: &[Variant]) -> Vec<Row> {
    let of = |variant: &Variant| -> Vec<&Summary> {
        summaries.iter().filter(|summary| summary.variant == variant.name).collect()
    };
    let reached = |variant: &Variant| of(variant).into_iter().map(Reached::of).collect::<Vec<_>>();
    let (conic, published) = (reached(&Variant::conic()), reached(&Variant::conic_published()));
    let mut rows = Vec::new();
    for variant in manifold {
        for summary in of(variant) {
            let conic = core_seconds_to(&conic, summary.mse);
            let published = core_seconds_to(&published, summary.mse);
            let ratio = |seconds: Option<f64>| seconds.map(|seconds| summary.core_seconds / seconds);
            rows.push(Row {
                variant: summary.variant.clone(),
                time: summary.time,
                core_seconds: summary.core_seconds,
                mse: summary.mse,
                mean_ratio: summary.mean_ratio,
                conic_core_seconds: conic,
                conic_ratio: ratio(conic),
                published_core_seconds: published,
                published_ratio: ratio(published),
            });
        }
    }
    rows
}

/// What a method had reached at some time.
#[derive(Clone, Copy, Debug)]
struct Reached {
    core_seconds: f64,
    samples_per_pixel: f64,
    mse: f64,
    variance: f64,
}

impl Reached {
    fn of(summary: &Summary) -> Self {
        let Summary { core_seconds, samples_per_pixel, mse, variance, .. } = *summary;
        Self { core_seconds, samples_per_pixel, mse, variance: variance.unwrap_or(mse).clamp(0.0, mse) }
    }
}

/// Core seconds after which a method has an error, by what it had at the last of some times: its variance falls with the
/// inverse of the time, and the rest of its error does not. At least those of a sample for each pixel; `None` where the rest
/// alone is more.
fn core_seconds_to(measured: &[Reached], mse: f64) -> Option<f64> {
    let Reached { core_seconds, samples_per_pixel, mse: last, variance } = *measured.last()?;
    let rest = last - variance;
    (mse > rest).then(|| (core_seconds * variance / (mse - rest)).max(core_seconds / samples_per_pixel))
}

fn statement(rows: &[Row], variant: &Variant) -> Option<String> {
    let last = rows.iter().rfind(|row| row.variant == variant.name)?;
    let faster = |name: &str, ratio: Option<f64>| match ratio {
        Some(ratio) => format!("{name} is {} times as fast to the same error", rounded_number(ratio)),
        None => format!("{name} does not reach that error"),
    };
    Some(format!(
        "{}: MSE {} after {} core seconds; {}, {}.",
        variant.name,
        rounded_number(last.mse),
        rounded_number(last.core_seconds),
        faster("conic", last.conic_ratio),
        faster("the published walk", last.published_ratio),
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn variance_falls_with_time_and_what_a_method_misses_does_not() {
        // 128 samples a pixel after 8 s, with a variance of 1/2 and what is missing 1/4.
        let last = Reached { core_seconds: 8.0, samples_per_pixel: 128.0, mse: 0.75, variance: 0.5 };
        let earlier = Reached { core_seconds: 4.0, samples_per_pixel: 64.0, mse: 1.25, variance: 1.0 };
        let to = |mse| core_seconds_to(&[earlier, last], mse);
        assert_eq!((to(1.25), to(0.5)), (Some(4.0), Some(16.0)));
        assert_eq!(to(1e9), Some(8.0 / 128.0), "one sample");
        assert_eq!((to(0.25), to(0.125), core_seconds_to(&[], 1.0)), (None, None, None));
    }
}
