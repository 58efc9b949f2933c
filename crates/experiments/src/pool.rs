//! `pool`: conic paper, section 5. How long specular manifold sampling takes to the errors of the walk along the conic.
//!
//! Each method is rendered with several numbers of samples ([`Method`]); one table has their errors ([`Measured`]). The
//! other has the times of the methods along the conic to the same errors ([`equal`]).

mod equal;
mod measured;

use clerestory_film::FrameImage;
use clerestory_film::decomposition::{decompose, mean};
use clerestory_film::preview::automatic_stops;
use clerestory_render_core::document::SceneBundle;

use self::equal::{At, Equal};
use self::measured::Measured;
use crate::error::ExperimentError;
use crate::experiment::{Defaults, Experiment};
use crate::figure::{Curve, Figure, Point};
use crate::measure;
use crate::reference::{Reference, noise, reference};
use crate::report::Report;
use crate::scenes::{POOL, changed};
use crate::session::Session;
use crate::snapshot::Snapshot;
use crate::table::{Column, Table, column};
use crate::variant::Variant;

/// Granizo-Hidalgo and Holzschuch 2024, section 5.
pub(crate) const EXPERIMENT: Experiment = Experiment {
    name: "pool",
    title: "Time to equal error in a pool, along the conic and by manifold sampling (conic paper, section 5)",
    question: "A pool is rendered along the conic, by the published walk to the first path and by all paths over the \
               water, with and without rays to where it focuses the lamp, and by specular manifold sampling, biased \
               with M = 1 to 32 trials and without bias. Granizo-Hidalgo and Holzschuch 2024 compare pictures of one \
               sample a pixel and find their walk 6 times as fast as biased manifold sampling of the same quality, and \
               more than 100 times as fast as 256 unbiased samples. Here unbiased sampling is rendered with 1, 4, 16, \
               64 and 256 samples a pixel, as there, and all else with 1, 2, 4 and so on up to 256, until a render has \
               taken the longest of the times, in core seconds. The error that biased sampling ends with is mostly \
               bias, which more time does not mend: what counts is when it first comes within 5 percent of it. Each \
               time is that of the samples and of what a method prepares once for each frame, such as the tree of \
               conic.",
    defaults: Defaults {
        times: Some(&[60.0]),
        seeds: Some(5),
        size: [128, 128],
        reference_samples: Some(1024),
        renders: true,
        references: None,
    },
    run,
};

const SCENE: &str = "pool";

/// Numbers of trials of biased sampling.
const TRIALS: [u32; 6] = [1, 2, 4, 8, 16, 32];

/// Samples in each pixel.
const DOUBLED: [u32; 9] = [1, 2, 4, 8, 16, 32, 64, 128, 256];

/// Samples in each pixel of unbiased sampling, as in the paper.
const PAPER: [u32; 5] = [1, 4, 16, 64, 256];

const COLUMNS: [Column; 10] = [
    column("variant", "the integrator and its settings, listed under variants"),
    column("samples_per_pixel", "samples in each pixel"),
    column("core_seconds", "time that all cores together spent on them and on the preparation, mean over the seeds, s"),
    column("preparation_seconds", "what of that the method takes to prepare a frame, beyond what path tracing does, s"),
    column("mse", "mean squared error less the noise of the reference, mean over the seeds"),
    column("mse_standard_error", "standard error of mse by the spread of the seeds"),
    column("bias_squared", "mse less the variance of one render, by the spread of the seeds"),
    column("bias_squared_standard_error", "standard error of bias_squared by the jackknife over the seeds"),
    column("mean_ratio", "mean energy of the picture over that of the reference"),
    column("mean_ratio_standard_error", "standard error of mean_ratio by the spread of the seeds"),
];

fn run(session: &mut Session) -> Result<Report, ExperimentError> {
    let conics = [Variant::conic(), Variant::conic_without_rays(), Variant::conic_published()];
    let method = |variant| Method { variant, counts: DOUBLED.into(), preparation: 0.0, renders: Vec::new() };
    let unbiased = Method { counts: PAPER.into(), ..method(Variant::sms()) };
    let mut methods: Vec<Method> =
        conics.iter().cloned().chain(TRIALS.map(Variant::sms_biased)).map(method).chain([unbiased]).collect();
    session.plan(1 + methods.len() * session.settings.seeds as usize);
    let bundle = POOL.bundle(session.settings.size)?;
    let reference = reference(session, SCENE, &bundle)?;
    for seed in 1..=u64::from(session.settings.seeds) {
        for method in &mut methods {
            method.render(session, &bundle, &reference, seed)?;
        }
    }
    let measured: Vec<Vec<Measured>> = methods.iter().map(|method| method.measured(&reference)).collect();
    let (along_conics, manifold) = measured.split_at(conics.len());
    let (unbiased, biased) = manifold.split_last().expect("unbiased sampling is the last");
    let mut points: Vec<At> = biased.iter().flat_map(|measured| At::of_biased(measured)).collect();
    points.extend(unbiased.iter().map(At::rendered));
    let equals: Vec<Vec<Equal>> = points.iter().map(|at| at.equals(along_conics)).collect();
    let mut report = Report::default();
    report.add_scene(SCENE, &bundle, &reference);
    report.add_figure(&figure(&measured))?;
    report.statements = equals.iter().filter_map(|row| equal::statement(row)).collect();
    let caption = "What manifold sampling reaches, and how long others take to the same error.".to_owned();
    let equal = Table::new("equal_error", caption, &equal::COLUMNS, &equals.concat());
    let caption = "Error and cost of every number of samples: the mean over the seeds.".to_owned();
    report.tables = vec![equal, Table::new("samples", caption, &COLUMNS, &measured.concat())];
    let stops = automatic_stops(&reference.image);
    for method in methods {
        let last = method.renders.into_iter().next().and_then(|mut snapshots| snapshots.pop());
        if let Some(Snapshot { image, .. }) = last {
            report.add_picture(format!("{SCENE}: {}", method.variant.name), image, stops);
        }
        report.variants.push(method.variant);
    }
    Ok(report)
}

/// A method and what it has rendered.
struct Method {
    variant: Variant,
    /// Samples in each pixel; after the first seed those for which there was time.
    counts: Vec<u32>,
    /// Core seconds that it takes to prepare a frame.
    preparation: f64,
    /// For each seed and number of samples.
    renders: Vec<Vec<Snapshot>>,
}

impl Method {
    fn render(
        &mut self,
        session: &mut Session,
        bundle: &SceneBundle,
        reference: &Reference,
        seed: u64,
    ) -> Result<(), ExperimentError> {
        session.begin(format!("{SCENE}, {}, seed {seed}", self.variant.name));
        let description = bundle.description();
        let integrator = self.variant.integrator(&description.integrator);
        let bundle = changed(bundle, integrator, seed, description.sampling).map_err(|source| POOL.failure(source))?;
        let is_first = self.renders.is_empty();
        if is_first {
            self.preparation = measure::preparation_seconds(session, &bundle)?;
        }
        let longest = session.settings.times.last().copied().filter(|_| is_first).unwrap_or(f64::INFINITY);
        let snapshots = measure::counts(session, &bundle, &self.counts, longest, &reference.asset)?;
        self.counts.truncate(snapshots.len());
        if let Some(Snapshot { samples, core_seconds, .. }) = snapshots.last() {
            let name = &self.variant.name;
            session.end(&format!("{name}, seed {seed}: {samples} samples a pixel in {core_seconds:.1} core seconds"));
        }
        self.renders.push(snapshots);
        Ok(())
    }

    fn measured(&self, reference: &Reference) -> Vec<Measured> {
        let numbers = |image: &FrameImage| -> Vec<f64> {
            image.layers().mean.as_flattened().iter().map(|number| f64::from(*number)).collect()
        };
        let right = numbers(&reference.image);
        let ratio = |value: f64| value / mean(&right);
        let row = |index: usize| {
            let snapshots: Vec<&Snapshot> = self.renders.iter().map(|snapshots| &snapshots[index]).collect();
            let renders: Vec<Vec<f64>> = snapshots.iter().map(|snapshot| numbers(&snapshot.image)).collect();
            let renders: Vec<&[f64]> = renders.iter().map(Vec::as_slice).collect();
            let error = decompose(&renders, &right, noise(&reference.image).unwrap_or(0.0))?;
            let over_seeds =
                |value: fn(&Snapshot) -> f64| mean(&snapshots.iter().map(|one| value(one)).collect::<Vec<_>>());
            Some(Measured {
                variant: self.variant.name.clone(),
                samples_per_pixel: over_seeds(|snapshot| snapshot.samples as f64),
                core_seconds: self.preparation + over_seeds(|snapshot| snapshot.core_seconds),
                preparation_seconds: self.preparation,
                mse: error.mse,
                mse_standard_error: error.mse_standard_error,
                bias_squared: error.bias_squared,
                bias_squared_standard_error: error.bias_squared_standard_error,
                mean_ratio: ratio(error.mean),
                mean_ratio_standard_error: error.mean_standard_error.map(ratio),
            })
        };
        (0..self.counts.len()).filter_map(row).collect()
    }
}

fn figure(measured: &[Vec<Measured>]) -> Figure {
    let point =
        |row: &Measured| Point { x: row.core_seconds, y: row.mse, error: row.mse_standard_error.unwrap_or(0.0) };
    let curve = |(colour, rows): (usize, &Vec<Measured>)| {
        let label = rows.first()?.variant.clone();
        Some(Curve { label, points: rows.iter().map(point).collect(), colour })
    };
    Figure {
        title: "Pool: whole picture".to_owned(),
        axes: ["core seconds with the preparation", "mean squared error"],
        curves: measured.iter().enumerate().filter_map(curve).collect(),
    }
}
