//! `table1`: FNEE paper, table 1. What the solvers do at equal samples.

use clerestory_film::preview;
use clerestory_render_core::document::SceneBundle;
use clerestory_render_core::geometry::FaceCrossing;
use serde::Serialize;

use crate::error::ExperimentError;
use crate::experiment::{Defaults, Experiment};
use crate::measure;
use crate::report::Report;
use crate::scenes::{FOUR_PANES, changed};
use crate::session::Session;
use crate::snapshot::Snapshot;
use crate::table::{Column, Table, column};
use crate::variant::Variant;

/// FNEE paper, table 1.
pub(crate) const EXPERIMENT: Experiment = Experiment {
    name: "table1",
    title: "Work of the solvers at 100 samples a pixel (FNEE paper, table 1)",
    question: "The window of four panes is rendered with 100 samples a pixel, and everything that the solvers do is \
               counted. Huan et al. 2023 state evaluations of the height field, unique solutions, and success, the \
               ratio of the solver calls that converge to all of them, for FNEE and SMS, both with FNEE's choice of \
               panes (the pane on the straight line), at 256 x 256 pixels. There, rays find the faces by sphere \
               tracing, here by bounds on slopes; the rows with sphere tracing are as in the paper. Estimates of \
               inverse probabilities are cut off after 1000 trials for fnee, as in the paper, and after 10 million for \
               sms, as in its authors' scenes. Whether calls that estimate inverse probabilities count is not said, so \
               success is stated in every sense that the words allow.",
    defaults: Defaults {
        times: None,
        seeds: None,
        size: [256, 256],
        reference_samples: None,
        renders: true,
        references: None,
    },
    run,
};

const SCENE: &str = "four panes";

/// Samples in each pixel, as in the paper.
const SAMPLES: u32 = 100;

/// Seed of the random numbers.
const SEED: u64 = 1;

/// A row of the table. The paper's numbers that follow from its other ones are derived from them.
#[derive(Default, Serialize)]
struct Row {
    solver: String,
    height_evaluations: Option<u64>,
    solver_calls: Option<u64>,
    trials: Option<u64>,
    converged: Option<u64>,
    unique_solutions: Option<u64>,
    truncated: Option<u64>,
    success: Option<f64>,
    unique_per_call: Option<f64>,
    unique_per_estimate: Option<f64>,
    height_evaluations_per_sample: Option<f64>,
    height_evaluations_per_call: Option<f64>,
    height_evaluations_per_solution: Option<f64>,
    unique_solutions_per_core_second: Option<f64>,
    core_seconds: Option<f64>,
}

/// How rays find the faces, and what a row adds to the name of its solver.
const CROSSINGS: [(FaceCrossing, &str); 2] =
    [(FaceCrossing::Proven, ""), (FaceCrossing::SphereTracing, ", sphere tracing")];

const COLUMNS: [Column; 15] = [
    column("solver", "the integrator and its settings, or the paper's name"),
    column(
        "height_evaluations",
        "evaluations of a height field, with or without derivatives, at one point (paper: h_eval)",
    ),
    column(
        "solver_calls",
        "starts of the solver from one seed, those of trials included (paper: total number of calls; its number is \
         unique_solutions / success)",
    ),
    column("trials", "solver calls that estimate an inverse probability"),
    column("converged", "solver calls that converged to a path, whether or not it had been found before"),
    column(
        "unique_solutions",
        "paths that entered an estimate, told apart within it (of fnee, rays that see the light too) (paper: unique \
         solutions discovered)",
    ),
    column("truncated", "estimates of an inverse probability that were cut off at the largest number of trials"),
    column("success", "converged / solver_calls, the paper's definition by its words"),
    column("unique_per_call", "unique_solutions / solver_calls"),
    column(
        "unique_per_estimate",
        "unique_solutions / (solver_calls - trials): how often the first seed of an estimate finds a path that \
         carries light",
    ),
    column("height_evaluations_per_sample", "height_evaluations for each camera sample"),
    column("height_evaluations_per_call", "height_evaluations / solver_calls"),
    column("height_evaluations_per_solution", "height_evaluations / unique_solutions"),
    column("unique_solutions_per_core_second", "unique_solutions for each second of each core"),
    column("core_seconds", "time that all cores together spent, s"),
];

/// Table 1 of the paper: name, height evaluations, unique solutions, success.
const PAPER: [(&str, u64, u64, f64); 2] =
    [("paper: FNEE", 956_000_000, 76_832, 0.0376), ("paper: SMS", 8_457_000_000, 48_754, 0.0187)];

fn run(session: &mut Session) -> Result<Report, ExperimentError> {
    let variants = [Variant::fnee_published(), Variant::sms_published_sharp(), Variant::sms_sharp(), Variant::fnee()];
    session.plan(variants.len() * CROSSINGS.len());
    let bundle = FOUR_PANES.bundle(session.settings.size)?;
    let mut report = Report::default();
    report.note_scene(SCENE, &bundle);
    let mut rows = Vec::new();
    for ((crossing, suffix), variant) in
        CROSSINGS.iter().flat_map(|crossing| variants.iter().map(move |v| (crossing, v)))
    {
        let solver = format!("{}{suffix}", variant.name);
        session.begin(format!("{solver}, {SAMPLES} samples a pixel"));
        let bundle = with_crossing(&bundle, *crossing)?;
        let description = bundle.description();
        let integrator = variant.integrator(&description.integrator);
        let changed = changed(&bundle, integrator, SEED, description.sampling);
        let changed = changed.map_err(|source| FOUR_PANES.failure(source))?;
        let snapshot = measure::samples(session, &changed, SAMPLES)?;
        let row = Row::of(solver, &snapshot);
        let (evaluations, success) = (snapshot.counters.height_evaluations, row.success.unwrap_or(0.0));
        session.end(&format!(
            "{}: {:.1} M height evaluations, {} unique solutions, {:.2} percent of calls converge, {:.1} s",
            row.solver,
            evaluations as f64 / 1e6,
            snapshot.counters.unique_solutions,
            100.0 * success,
            snapshot.wall_seconds
        ));
        let stops = preview::automatic_stops(&snapshot.image);
        report.add_picture(format!("{SCENE}: {}", row.solver), snapshot.image, stops);
        rows.push(row);
    }
    report.statements = CROSSINGS.iter().flat_map(|(_, suffix)| statements(&rows, suffix)).collect();
    let samples = u64::from(session.settings.size[0]) * u64::from(session.settings.size[1]) * u64::from(SAMPLES);
    rows.extend(PAPER.map(Row::of_paper));
    let caption = format!("Work at {SAMPLES} samples a pixel, {samples} camera samples in all.");
    report.tables = vec![Table::new("work", caption, &COLUMNS, &rows)];
    report.variants = variants.into();
    Ok(report)
}

/// Camera samples of the paper's picture.
const PAPER_SAMPLES: f64 = 256.0 * 256.0 * 100.0;

impl Row {
    fn of(solver: String, snapshot: &Snapshot) -> Self {
        let counters = snapshot.counters;
        let ratio = |part: u64, whole: u64| (whole > 0).then(|| part as f64 / whole as f64);
        let estimates = counters.solver_calls.saturating_sub(counters.trials);
        let seconds = snapshot.core_seconds;
        Self {
            solver,
            height_evaluations: Some(counters.height_evaluations),
            solver_calls: Some(counters.solver_calls),
            trials: Some(counters.trials),
            converged: Some(counters.converged),
            unique_solutions: Some(counters.unique_solutions),
            truncated: Some(counters.truncated),
            success: ratio(counters.converged, counters.solver_calls),
            unique_per_call: ratio(counters.unique_solutions, counters.solver_calls),
            unique_per_estimate: ratio(counters.unique_solutions, estimates),
            height_evaluations_per_sample: ratio(counters.height_evaluations, counters.samples),
            height_evaluations_per_call: ratio(counters.height_evaluations, counters.solver_calls),
            height_evaluations_per_solution: ratio(counters.height_evaluations, counters.unique_solutions),
            unique_solutions_per_core_second: (seconds > 0.0).then(|| counters.unique_solutions as f64 / seconds),
            core_seconds: Some(seconds),
        }
    }

    fn of_paper((name, evaluations, solutions, success): (&str, u64, u64, f64)) -> Self {
        let calls = solutions as f64 / success;
        Self {
            solver: name.to_owned(),
            height_evaluations: Some(evaluations),
            solver_calls: Some(calls.round() as u64),
            unique_solutions: Some(solutions),
            success: Some(success),
            height_evaluations_per_sample: Some(evaluations as f64 / PAPER_SAMPLES),
            height_evaluations_per_call: Some(evaluations as f64 / calls),
            height_evaluations_per_solution: Some(evaluations as f64 / solutions as f64),
            ..Self::default()
        }
    }
}

/// The scene with panes whose faces rays find in one way.
fn with_crossing(bundle: &SceneBundle, crossing: FaceCrossing) -> Result<SceneBundle, ExperimentError> {
    let mut description = bundle.description().clone();
    for pane in &mut description.panes {
        pane.crossing = crossing;
    }
    bundle.clone().with_description(description).map_err(|source| FOUR_PANES.failure(source))
}

/// The numbers of the rows whose names end in `suffix` beside the paper's.
fn statements(rows: &[Row], suffix: &str) -> Vec<String> {
    let [fnee, sms] = [Variant::fnee_published(), Variant::sms_published_sharp()]
        .map(|variant| rows.iter().find(|row| row.solver == format!("{}{suffix}", variant.name)));
    let (Some(fnee), Some(sms)) = (fnee, sms) else { return Vec::new() };
    let [(_, paper_fnee, paper_fnee_solutions, fnee_success), (_, paper_sms, paper_sms_solutions, sms_success)] = PAPER;
    let number = |value: Option<f64>| value.unwrap_or(f64::NAN);
    let ratio = |ours: Option<u64>, other: Option<u64>| ours.unwrap_or(0) as f64 / other.unwrap_or(0).max(1) as f64;
    vec![
        format!(
            "Height evaluations of SMS over those of FNEE at equal samples{suffix}: {:.2}; paper: {:.2}.",
            ratio(sms.height_evaluations, fnee.height_evaluations),
            paper_sms as f64 / paper_fnee as f64
        ),
        format!(
            "Height evaluations for each unique solution, SMS over FNEE{suffix}: {:.2}; paper: {:.2}.",
            number(sms.height_evaluations_per_solution) / number(fnee.height_evaluations_per_solution),
            (paper_sms as f64 / paper_sms_solutions as f64) / (paper_fnee as f64 / paper_fnee_solutions as f64)
        ),
        format!(
            "Unique solutions, FNEE over SMS{suffix}: {:.2}; paper: {:.2}.",
            ratio(fnee.unique_solutions, sms.unique_solutions),
            paper_fnee_solutions as f64 / paper_sms_solutions as f64
        ),
        format!(
            "Success, all calls{suffix}: FNEE {:.2} percent, SMS {:.2} percent; paper: {:.2} and {:.2} percent.",
            100.0 * number(fnee.success),
            100.0 * number(sms.success),
            100.0 * fnee_success,
            100.0 * sms_success
        ),
        format!(
            "Success, unique solutions over all calls{suffix}: FNEE {:.2} percent, SMS {:.2} percent; over first \
             seeds alone: \
             {:.2} and {:.2} percent.",
            100.0 * number(fnee.unique_per_call),
            100.0 * number(sms.unique_per_call),
            100.0 * number(fnee.unique_per_estimate),
            100.0 * number(sms.unique_per_estimate)
        ),
    ]
}
