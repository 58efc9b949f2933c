//! `triangles`: conic paper, section 5. What more triangles of water cost.

use std::path::Path;

use clerestory_render_core::document::SceneBundle;
use clerestory_render_core::document::water::{WaterSettings, WaterView};
use serde::Serialize;

use crate::error::ExperimentError;
use crate::experiment::{Defaults, Experiment};
use crate::figure::{Curve, Figure, Point};
use crate::measure;
use crate::report::Report;
use crate::scenes::{SAMPLING, changed, computed_pool};
use crate::session::Session;
use crate::snapshot::Snapshot;
use crate::table::{Column, Table, column, rounded_number};
use crate::variant::Variant;

/// Granizo-Hidalgo and Holzschuch 2024, section 5.
pub(crate) const EXPERIMENT: Experiment = Experiment {
    name: "triangles",
    title: "Cost with 1000 to 2 million triangles of water (conic paper, section 5)",
    question: "The same water of a pool is cut into more and more triangles. For each number its floor, seen straight \
               from above, is rendered with the light that the walk along the conic finds, published and complete, and \
               by path tracing alone, which does not find it: the difference is what the caustic costs. \
               Granizo-Hidalgo and Holzschuch 2024 show an animated pool with up to two million triangles, whose \
               caustic takes at most a third of the time of a frame on a GPU; the published walk should slow down with \
               about the square root of the number. Frames of a view from above the pool, with light of all kinds at \
               one sample for each pixel, show what the caustic adds to a picture, and to a frame of an animation, for \
               which the water is computed and the scene built anew.",
    defaults: Defaults {
        times: None,
        seeds: Some(5),
        size: [960, 720],
        reference_samples: None,
        renders: true,
        references: None,
    },
    run,
};

/// Triangles of the surfaces above the floor.
const SURFACES: [&str; 6] = ["1000", "10000", "100000", "500000", "1000000", "2000000"];

/// Triangles of the surfaces in the frames.
const FRAMES: [&str; 2] = ["100000", "1000000"];

/// What their view is called.
const FRAME: &str = "frame";

/// The floor is rendered in a part of the size of the frames, with more samples.
const FLOOR_PART: u32 = 4;

/// Samples for each pixel of the floor.
const FLOOR_SAMPLES: u32 = 16;

/// What a method costs on a surface.
#[derive(Clone, Debug, Serialize)]
struct Row {
    view: &'static str,
    triangles: u32,
    variant: String,
    seconds_per_sample: f64,
    caustic_seconds_per_sample: Option<f64>,
    growth: Option<f64>,
    ratio_to_path: Option<f64>,
    caustic_share: Option<f64>,
    build_seconds: Option<f64>,
    caustic_share_animated: Option<f64>,
    paths_per_sample: f64,
}

const COLUMNS: [Column; 11] = [
    column(
        "view",
        "floor: the floor with the light that comes through the water; frame: the pool from above, one sample a pixel",
    ),
    column("triangles", "triangles of the water's surface, about"),
    column("variant", "the integrator and its settings, listed under variants"),
    column("seconds_per_sample", "core seconds for each camera sample, the shortest of the renders"),
    column("caustic_seconds_per_sample", "what of that path tracing alone does not take"),
    column("growth", "caustic_seconds_per_sample over that with the fewest triangles"),
    column("ratio_to_path", "seconds_per_sample over that of path tracing alone"),
    column("caustic_share", "caustic_seconds_per_sample over seconds_per_sample"),
    column("build_seconds", "core seconds to compute the water and build the scene, the shortest; of frames"),
    column(
        "caustic_share_animated",
        "as caustic_share, where building counts for each frame, and what it takes longer than for path tracing",
    ),
    column("paths_per_sample", "paths of light over the water that were found and not blocked, for each camera sample"),
];

fn run(session: &mut Session) -> Result<Report, ExperimentError> {
    let variants = [Variant::path(), Variant::conic(), Variant::conic_published()];
    let repetitions = session.settings.seeds as usize;
    let cases = cases(session.settings.size)?;
    session.plan(cases.len() * variants.len() * repetitions);
    let mut report = Report::default();
    let mut rows = Vec::new();
    for case in &cases {
        report.note_scene(&case.name, &case.bundle);
        rows.extend(measured(session, case, &variants)?);
    }
    for row in (0..rows.len()).rev() {
        rows[row].growth = growth(&rows, &rows[row]);
    }
    report.add_figure(&figure(&rows, &variants))?;
    report.statements = statements(&rows);
    let caption = "Cost against the number of triangles.".to_owned();
    report.tables = vec![Table::new("triangles", caption, &COLUMNS, &rows)];
    report.variants = variants.into();
    Ok(report)
}

/// A scene, and how it is rendered.
struct Case {
    name: String,
    view: &'static str,
    triangles: u32,
    samples: u32,
    bundle: SceneBundle,
}

fn cases([width, height]: [u32; 2]) -> Result<Vec<Case>, ExperimentError> {
    let floor_size = [width, height].map(|edge| (edge / FLOOR_PART).max(1));
    let floors = SURFACES.map(|triangles| (triangles, "floor", WaterView::Floor, floor_size, FLOOR_SAMPLES));
    let frames = FRAMES.map(|triangles| (triangles, FRAME, WaterView::Above, [width, height], 1));
    floors
        .into_iter()
        .chain(frames)
        .map(|(triangles, view, from, size, samples)| {
            let name = format!("pool of {triangles} triangles, {view}");
            let failure = |source| ExperimentError::scene(Path::new(&name), source);
            let settings =
                WaterSettings { triangles: triangles.parse().expect("a number of triangles"), time: 0.0, view: from };
            let bundle = computed_pool(&settings, size).map_err(failure)?;
            Ok(Case { triangles: triangles.parse().expect("a number"), name: name.clone(), view, samples, bundle })
        })
        .collect()
}

/// What each variant costs, by the shortest of renders that take turns.
fn measured(session: &mut Session, case: &Case, variants: &[Variant]) -> Result<Vec<Row>, ExperimentError> {
    let film = case.bundle.description().film;
    let all = f64::from(film.width) * f64::from(film.height) * f64::from(case.samples);
    let mut shortest: Vec<Option<Snapshot>> = vec![None; variants.len()];
    let mut built: Vec<Option<f64>> = vec![None; variants.len()];
    for seed in 1..=session.settings.seeds {
        for ((variant, shortest), built) in variants.iter().zip(&mut shortest).zip(&mut built) {
            session.begin(format!("{}, {}, seed {seed}", case.name, variant.name));
            let integrator = variant.integrator(&case.bundle.description().integrator);
            let bundle = changed(&case.bundle, integrator, u64::from(seed), SAMPLING);
            let bundle = bundle.map_err(|source| ExperimentError::scene(Path::new(&case.name), source))?;
            if case.view == FRAME {
                let seconds = measure::build_seconds(session, &bundle)?;
                *built = Some(built.map_or(seconds, |shortest: f64| shortest.min(seconds)));
            }
            let snapshot = measure::samples(session, &bundle, case.samples)?;
            session.end(&format!("{:.3} core seconds", snapshot.core_seconds));
            if shortest.as_ref().is_none_or(|shortest| snapshot.core_seconds < shortest.core_seconds) {
                *shortest = Some(snapshot);
            }
        }
    }
    let seconds =
        |snapshot: &Option<Snapshot>| snapshot.as_ref().map_or(f64::NAN, |snapshot| snapshot.core_seconds / all);
    let path = seconds(&shortest[0]);
    Ok(variants
        .iter()
        .zip(&shortest)
        .enumerate()
        .map(|(index, (variant, snapshot))| {
            let seconds_per_sample = seconds(snapshot);
            let caustic = (index > 0).then_some(seconds_per_sample - path);
            let frame = |index: usize| Some(built[index]? + all * seconds(&shortest[index]));
            let share = |whole: f64, without: f64| (whole - without) / whole;
            Row {
                view: case.view,
                triangles: case.triangles,
                variant: variant.name.clone(),
                seconds_per_sample,
                caustic_seconds_per_sample: caustic,
                growth: None,
                ratio_to_path: caustic.map(|_| seconds_per_sample / path),
                caustic_share: caustic.map(|_| share(seconds_per_sample, path)),
                build_seconds: built[index],
                caustic_share_animated: caustic.and_then(|_| Some(share(frame(index)?, frame(0)?))),
                paths_per_sample: snapshot.as_ref().map_or(0.0, |shot| shot.counters.unique_solutions as f64 / all),
            }
        })
        .collect())
}

fn growth(rows: &[Row], row: &Row) -> Option<f64> {
    let fewest = rows.iter().find(|first| first.view == row.view && first.variant == row.variant)?;
    Some(row.caustic_seconds_per_sample? / fewest.caustic_seconds_per_sample?)
}

fn figure(rows: &[Row], variants: &[Variant]) -> Figure {
    let points = |variant: &Variant| {
        let rows = rows.iter().filter(|row| row.view == "floor" && row.variant == variant.name);
        let point =
            |row: &Row| Some(Point { x: f64::from(row.triangles), y: row.caustic_seconds_per_sample?, error: 0.0 });
        rows.filter_map(point).collect()
    };
    let curve =
        |(colour, variant): (usize, &Variant)| Curve { label: variant.name.clone(), points: points(variant), colour };
    let label = "core seconds of the caustic for each sample";
    Figure {
        title: "Pool: what the caustic costs".to_owned(),
        axes: ["triangles of the water", label],
        curves: variants.iter().enumerate().map(curve).collect(),
    }
}

fn statements(rows: &[Row]) -> Vec<String> {
    let mut statements = Vec::new();
    for variant in [Variant::conic(), Variant::conic_published()] {
        let of = |view: &'static str| {
            rows.iter().filter(move |row| row.view == view).filter(|row| row.variant == variant.name)
        };
        if let (Some(fewest), Some(most)) = (of("floor").next(), of("floor").next_back()) {
            statements.push(format!(
                "{}: from {} to {} triangles the caustic costs {} times as much ({} and {} microseconds for each \
                 sample, {} and {} paths).",
                variant.name,
                fewest.triangles,
                most.triangles,
                rounded_number(most.growth.unwrap_or(f64::NAN)),
                rounded_number(1e6 * fewest.caustic_seconds_per_sample.unwrap_or(f64::NAN)),
                rounded_number(1e6 * most.caustic_seconds_per_sample.unwrap_or(f64::NAN)),
                rounded_number(fewest.paths_per_sample),
                rounded_number(most.paths_per_sample),
            ));
        }
        statements.extend(of(FRAME).map(|row| {
            format!(
                "{}: a frame with {} triangles takes {} times as long as by path tracing alone; the caustic is {} of \
                 it, {} where the scene is built for each frame.",
                variant.name,
                row.triangles,
                rounded_number(row.ratio_to_path.unwrap_or(f64::NAN)),
                rounded_number(row.caustic_share.unwrap_or(f64::NAN)),
                rounded_number(row.caustic_share_animated.unwrap_or(f64::NAN)),
            )
        }));
    }
    statements
}
