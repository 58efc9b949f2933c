//! `regret`: `auto` against the best single method on many scenes and lights, and what glass costs.

mod markdown;
mod measured;
mod ratios;

use clerestory_film::compare;
use serde::Serialize;

use self::markdown::markdown;
use self::measured::{AUTO, Compared, MEASUREMENT_COLUMNS, METHOD_COLUMNS, Measured, Render};
use self::ratios::{RATIO_COLUMNS, ratios};
use crate::core_time::{self, Job};
use crate::error::ExperimentError;
use crate::experiment::{Defaults, Experiment};
use crate::pairs::stored::{self, StoredReference};
use crate::pairs::{self, Pair, rendered_by};
use crate::report::Report;
use crate::session::Session;
use crate::snapshot::Snapshot;
use crate::table::{Column, Table, column};

/// Of no paper: `auto` beside what it could have chosen.
pub(crate) const EXPERIMENT: Experiment = Experiment {
    name: "regret",
    title: "auto against the best single method on each of many scenes and lights, and what glass costs",
    question: "Each pair of a scene and its light is rendered by auto and by single methods, light tracing included, \
               with several seeds, for the same time of one core each. The error of a method without bias falls as \
               the inverse of the time, so the product of both says how long a method takes to an error. Ratios of \
               such products have intervals of 95 percent by the jackknife over the seeds. The best single method is \
               the one whose mean product is least. Pictures of the same scene with and without panes say what glass \
               costs.",
    defaults: Defaults {
        times: Some(&[10.0]),
        seeds: Some(5),
        size: pairs::SIZE,
        reference_samples: None,
        renders: false,
        references: Some("scenes/pairs"),
    },
    run,
};

/// How the reference of a pair was made: a row of `references`.
#[derive(Serialize)]
struct ReferenceRow {
    pair: &'static str,
    methods: String,
    core_seconds: String,
    noise: f64,
    share_of_mse: Option<f64>,
    share_of_rel_mse: Option<f64>,
    verdict: String,
}

const REFERENCE_COLUMNS: [Column; 7] = [
    column("pair", "the scene and its light"),
    column("methods", "what rendered the halves of the reference"),
    column("core_seconds", "time of one core that each half took, s"),
    column("noise", "mean square of the standard error of the reference, over the square of its mean"),
    column("share_of_mse", "mean square of its standard error over the least MSE that is compared with it"),
    column("share_of_rel_mse", "the same of relMSE"),
    column("verdict", "the bias test of one half against the other"),
];

fn run(session: &mut Session) -> Result<Report, ExperimentError> {
    let seconds = session.settings.times.last().copied().unwrap_or(0.0);
    let index = stored::index(&session.references)?;
    let mut report = Report::default();
    let (mut jobs, mut places, mut all, mut bundles) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for (place, pair) in pairs::ALL.iter().enumerate() {
        // To make a scene may take seconds.
        let bundle = index.get(pair.name).map(|_| pair.bundle(session.settings.size)).transpose()?;
        let find = |bundle| stored::find(&session.references, &index, pair, bundle);
        let found = bundle.as_ref().map(find).transpose()?.flatten();
        match bundle.filter(|_| found.is_some()) {
            Some(bundle) => {
                report.note_scene(pair.name, &bundle);
                bundles.push((place, bundle));
            }
            None => session.note(&format!("{}: no reference; pair-references renders it", pair.name)),
        }
        all.push(Compared::new(pair, found));
    }
    // Seeds come one after the other, so that a machine that becomes slower affects all methods.
    for seed in 1..=u64::from(session.settings.seeds) {
        for (place, bundle) in &bundles {
            let compared = &all[*place];
            for (index, method) in methods(compared.pair).enumerate() {
                let bundle = rendered_by(bundle, method, seed).map_err(|source| compared.pair.failure(source))?;
                let name = format!("{}, {method}, seed {seed}", compared.pair.name);
                jobs.push(Job { name, bundle });
                places.push((*place, index));
            }
        }
    }
    session.plan(jobs.len());
    core_time::render_all(session, &jobs, seconds, |job, snapshot| {
        let (place, method) = places[job];
        let seed = jobs[job].bundle.description().seed;
        let render = measure(&all[place], seed, snapshot)?;
        let line = format!(
            "{}: {} samples a pixel in {:.1} s, MSE {:.3e}, relMSE {:.3e}",
            jobs[job].name, render.samples_per_pixel, render.core_seconds, render.mse, render.rel_mse
        );
        all[place].methods[method].renders.push(render);
        Ok(line)
    })?;
    for measured in all.iter_mut().flat_map(|compared| &mut compared.methods) {
        measured.renders.sort_by_key(|render| render.seed);
    }
    let ratios = ratios(&all);
    let references: Vec<ReferenceRow> = all.iter().filter_map(reference_row).collect();
    report.claims = ratios.iter().filter(|ratio| ratio.limit.is_some()).map(|ratio| ratio.is_met()).collect();
    report.statements = ratios.iter().filter(|ratio| ratio.limit.is_some()).map(ToString::to_string).collect();
    let measurements: Vec<_> = all.iter().flat_map(Compared::measurements).collect();
    let methods: Vec<_> = all.iter().flat_map(Compared::summaries).collect();
    report.tables = vec![
        Table::new("ratios", "Error times time of auto over that of others.".to_owned(), &RATIO_COLUMNS, &ratios),
        Table::new("methods", "Error and time: the mean over the seeds.".to_owned(), &METHOD_COLUMNS, &methods),
        Table::new("references", "The references.".to_owned(), &REFERENCE_COLUMNS, &references),
        Table::new("measurements", "Every render.".to_owned(), &MEASUREMENT_COLUMNS, &measurements).off_page(),
    ];
    let page = markdown(session, &ratios, &report.tables);
    report.files.push((format!("{}.md", EXPERIMENT.name), page.into_bytes()));
    Ok(report)
}

/// What renders a pair: `auto`, and the single methods.
fn methods(pair: &Pair) -> impl Iterator<Item = &'static str> {
    std::iter::once(AUTO).chain(pair.methods.iter().copied())
}

fn measure(compared: &Compared, seed: u64, snapshot: &Snapshot) -> Result<Render, ExperimentError> {
    let Some(reference) = &compared.reference else { return Ok(Render::default()) };
    let metrics = compare(&snapshot.image, &reference.image).map_err(ExperimentError::Compare)?;
    Ok(Render {
        seed,
        samples_per_pixel: snapshot.samples,
        core_seconds: snapshot.core_seconds,
        mse: metrics.mse - compared.noise[0],
        rel_mse: metrics.rel_mse.unwrap_or(f64::NAN) - compared.noise[1],
        mean_ratio: metrics.mean_ratio.unwrap_or(f64::NAN),
    })
}

fn reference_row(compared: &Compared) -> Option<ReferenceRow> {
    let reference = compared.reference.as_ref()?;
    let StoredReference { methods, core_seconds: [first, second], noise, verdict, .. } = &reference.record;
    let [share_of_mse, share_of_rel_mse] = compared.shares();
    Some(ReferenceRow {
        pair: compared.pair.name,
        methods: methods.join(", "),
        core_seconds: format!("{first:.0}, {second:.0}"),
        noise: *noise,
        share_of_mse,
        share_of_rel_mse,
        verdict: verdict.clone(),
    })
}

impl Compared {
    fn new(pair: &'static Pair, reference: Option<stored::Found>) -> Self {
        let noise = reference.as_ref().map_or([0.0; 2], |reference| {
            let relative = clerestory_film::relative_noise(&reference.image).map_or(0.0, |noise| noise.mean);
            [crate::reference::noise(&reference.image).unwrap_or(0.0), relative]
        });
        let methods = methods(pair).map(|method| Measured { method, renders: Vec::new() }).collect();
        Self { pair, reference, noise, methods }
    }
}
