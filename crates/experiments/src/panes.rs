//! `panes`: FNEE paper, figure 11. What more panes cost.

use serde::Serialize;

use crate::comparison::{Case, Comparison};
use crate::error::ExperimentError;
use crate::experiment::{Defaults, Experiment};
use crate::figure::{Curve, Figure, Point};
use crate::reference::{Reference, reference};
use crate::region::Region;
use crate::report::Report;
use crate::scenes::{EmbeddedScene, NAVE_4, NAVE_16, NAVE_64, NAVE_256};
use crate::session::Session;
use crate::table::{Column, Table, column, rounded_number};
use crate::variant::Variant;

/// FNEE paper, figure 11.
pub(crate) const EXPERIMENT: Experiment = Experiment {
    name: "panes",
    title: "Cost and error with 4 to 256 panes (FNEE paper, figure 11)",
    question: "A stone nave with 4, 16, 64 and 256 panes in the same windows is rendered by each method for the same \
               time. Huan et al. 2023 show an interior after 100 s and say that the speed of FNEE \"remains \
               practically constant with the number of windows used\", while SMS with a random choice of panes \
               suffers; the paper gives pictures and no numbers. What a method costs whatever the time is its variance \
               times its time.",
    defaults: Defaults {
        times: Some(&[4.0]),
        seeds: Some(5),
        size: [96, 72],
        reference_samples: Some(512),
        renders: true,
        references: None,
    },
    run,
};

/// The scenes by their number of panes.
const SCENES: [(&EmbeddedScene, u32); 4] = [(&NAVE_4, 4), (&NAVE_16, 16), (&NAVE_64, 64), (&NAVE_256, 256)];

/// A row of the table of growth.
#[derive(Serialize)]
struct Row {
    panes: u32,
    variant: String,
    seconds_per_sample: f64,
    height_evaluations_per_sample: f64,
    mse: f64,
    reference_mean: f64,
    variance_times_time: Option<f64>,
    growth: Option<f64>,
    relative_growth: Option<f64>,
    bias_squared: Option<f64>,
    bias_squared_standard_error: Option<f64>,
    mean_ratio: Option<f64>,
    mean_ratio_standard_error: Option<f64>,
}

const COLUMNS: [Column; 13] = [
    column("panes", "panes in the windows of the nave"),
    column("variant", "the integrator and its settings, listed under variants"),
    column("seconds_per_sample", "core seconds for each camera sample; whole picture"),
    column("height_evaluations_per_sample", "height evaluations for each camera sample; whole picture"),
    column("mse", "mean squared error at the longest time less the noise of the reference, mean over the seeds"),
    column("reference_mean", "mean of the reference, W/(m2 sr): lead cames take some of the light"),
    column("variance_times_time", "variance of one render times core seconds: what the method costs whatever the time"),
    column("growth", "variance_times_time over that with the fewest panes"),
    column("relative_growth", "the same, of variance_times_time over the square of reference_mean"),
    column("bias_squared", "mse less variance: the squared bias, below zero as often as above where there is none"),
    column("bias_squared_standard_error", "standard error of bias_squared by the jackknife over the seeds"),
    column("mean_ratio", "mean energy of the picture over that of the reference"),
    column(
        "mean_ratio_standard_error",
        "standard error of mean_ratio by the spread of the seeds and the noise of the reference",
    ),
];

fn run(session: &mut Session) -> Result<Report, ExperimentError> {
    let variants =
        [Variant::fnee(), Variant::cone(), Variant::fnee_published(), Variant::sms_sharp(), Variant::sms_random()];
    session.plan(SCENES.len() * (1 + Comparison::steps(session, &variants)));
    let mut report = Report::default();
    let mut comparison = Comparison::default();
    let mut rows: Vec<Row> = Vec::new();
    let mut scenes = Vec::new();
    for (file, panes) in SCENES {
        let name = format!("nave of {panes} panes");
        let bundle = file.bundle(session.settings.size)?;
        let reference = reference(session, &name, &bundle)?;
        let regions = [Region::whole(&reference.image)];
        scenes.push((panes, name, bundle, reference, regions));
    }
    let cases =
        scenes.iter().map(|(_, name, bundle, reference, regions)| Case { scene: name, bundle, reference, regions });
    comparison.run(session, &cases.collect::<Vec<_>>(), &variants)?;
    for (panes, name, bundle, reference, regions) in &scenes {
        report.add_scene(name, bundle, reference);
        report.add_pictures(name, reference, &mut comparison);
        for variant in &variants {
            let fewest = rows.iter().find(|row| row.variant == variant.name);
            let new = row(&comparison, name, &regions[0].name, *panes, variant, reference, fewest);
            rows.extend(new);
        }
    }
    type Value = fn(&Row) -> Option<f64>;
    let figures: [(&'static str, Value); 4] = [
        ("core seconds for each sample", |row| Some(row.seconds_per_sample)),
        ("height evaluations for each sample", |row| Some(row.height_evaluations_per_sample)),
        ("mean squared error", |row| Some(row.mse)),
        ("variance times core seconds", |row| row.variance_times_time),
    ];
    for (label, value) in figures {
        report.add_figure(&figure(&rows, &variants, label, value))?;
    }
    report.statements = variants.iter().filter_map(|variant| growth(&rows, variant)).collect();
    let [summary, measurements] = comparison.tables();
    let caption = "Cost and error against the number of panes.".to_owned();
    report.tables = vec![Table::new("panes", caption, &COLUMNS, &rows), summary, measurements];
    report.variants = variants.into();
    Ok(report)
}

fn row(
    comparison: &Comparison,
    scene: &str,
    region: &str,
    panes: u32,
    variant: &Variant,
    reference: &Reference,
    fewest: Option<&Row>,
) -> Option<Row> {
    let last = comparison.last(scene, region, &variant.name)?;
    let growth =
        last.variance_times_time.map(|cost| cost / fewest.and_then(|row| row.variance_times_time).unwrap_or(cost));
    let dimmed = fewest.map_or(1.0, |row| row.reference_mean / reference.record.mean);
    Some(Row {
        panes,
        variant: variant.name.clone(),
        seconds_per_sample: last.seconds_per_sample,
        height_evaluations_per_sample: last.height_evaluations_per_sample,
        mse: last.mse,
        reference_mean: reference.record.mean,
        variance_times_time: last.variance_times_time,
        growth,
        relative_growth: growth.map(|growth| growth * dimmed * dimmed),
        bias_squared: last.bias_squared,
        bias_squared_standard_error: last.bias_squared_standard_error,
        mean_ratio: last.mean_ratio,
        mean_ratio_standard_error: last.mean_ratio_standard_error,
    })
}

fn figure(rows: &[Row], variants: &[Variant], label: &'static str, value: fn(&Row) -> Option<f64>) -> Figure {
    let points = |variant: &Variant| {
        let rows = rows.iter().filter(|row| row.variant == variant.name);
        rows.filter_map(|row| Some(Point { x: f64::from(row.panes), y: value(row)?, error: 0.0 })).collect()
    };
    let curve =
        |(colour, variant): (usize, &Variant)| Curve { label: variant.name.clone(), points: points(variant), colour };
    let curves = variants.iter().enumerate().map(curve).collect();
    Figure { title: format!("Nave: {label}"), axes: ["panes", label], curves }
}

fn growth(rows: &[Row], variant: &Variant) -> Option<String> {
    let mut of_variant = rows.iter().filter(|row| row.variant == variant.name);
    let fewest = of_variant.next()?;
    let most = of_variant.next_back()?;
    Some(format!(
        "{}: from {} to {} panes, variance times time grows by a factor of {} (relative to the square of the light, \
         {}), \
         core seconds for each sample by {}, height evaluations for each sample by {}.",
        variant.name,
        fewest.panes,
        most.panes,
        rounded_number(most.growth?),
        rounded_number(most.relative_growth?),
        rounded_number(most.seconds_per_sample / fewest.seconds_per_sample),
        rounded_number(most.height_evaluations_per_sample / fewest.height_evaluations_per_sample.max(1.0)),
    ))
}
