//! `basins`: FNEE paper, figures 5 and 13. The path to which the solvers converge from each start.
//!
//! The starts are the points of the pane with `u1 = u2` and `v1 = v2`, as in the paper: a plane through the
//! four-dimensional space of starts. The report has the shares of that plane, and beside them the shares of the seeds
//! that each method draws.

use clerestory_film::counters::Counters;
use clerestory_film::{FrameImage, ImageLayers, SampleStream, SamplerSettings};
use clerestory_render_core::integrator::PreparedScene;
use clerestory_render_core::light::{Source, SourceSample};
use clerestory_render_core::math::Rect;
use clerestory_render_core::scene::ShadingPoint;
use clerestory_render_core::specular::constraint::ManifoldConstraint;
use clerestory_render_core::specular::fermat::Connection;
use clerestory_render_core::specular::fnee::FneeSolver;
use clerestory_render_core::specular::fnee::PathSearch;
use clerestory_render_core::specular::manifold::WalkSteps;
use clerestory_render_core::specular::newton::{Root, SearchRegion, solve_complete, solve_published};
use clerestory_render_core::specular::side::PaneSide;
use clerestory_render_core::specular::sms::ManifoldSearch;
use glam::{DVec2, DVec3};
use rayon::prelude::*;
use serde::Serialize;

use crate::basin_figure::{BasinFigure, COLOURS, NOWHERE, OTHER};
use crate::error::ExperimentError;
use crate::experiment::{Defaults, Experiment};
use crate::region::points;
use crate::report::Report;
use crate::scenes::FOUR_PANES;
use crate::session::Session;
use crate::table::{Column, Table, column};
use crate::text::counted;

/// FNEE paper, figure 5.
pub(crate) const EXPERIMENT: Experiment = Experiment {
    name: "basins",
    title: "Convergence basins of the solvers (FNEE paper, figures 5 and 13)",
    question: "For one point O and one point S of the light, every point of the pane starts each solver on both faces \
               at once (u1 = u2, v1 = v2), and is coloured by the path to which it converges. Huan et al. 2023 show \
               three paths through a blown glass profile, whose basins are highly irregular and nearly cover the pane, \
               and a finely detailed pane with many. The paper gives pictures and no numbers.",
    defaults: Defaults {
        times: None,
        seeds: None,
        size: [256, 256],
        reference_samples: None,
        renders: false,
        references: None,
    },
    run,
};

/// Pixels of the picture of the scene, across and down, whose points are candidates for O.
const CANDIDATES: u32 = 48;

/// Seeds of the kind that a method draws, from which its probabilities are estimated.
const SEEDS: u32 = 20_000;

/// The close-up shows this many times the extent of the found paths.
const CLOSE_UP: f64 = 1.6;

/// What is solved for.
struct Problem<'a> {
    name: &'static str,
    scene: &'a PreparedScene,
    point: ShadingPoint,
    sample: SourceSample,
    pane: u32,
    /// The paths of light that there are.
    paths: Vec<Root>,
}

/// A way to solve it.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Solver {
    Complete,
    Published,
    ManifoldWalk,
}

const SOLVERS: [(Solver, &str); 3] =
    [(Solver::Published, "fnee published"), (Solver::Complete, "fnee complete"), (Solver::ManifoldWalk, "sms")];

#[derive(Serialize)]
struct Row {
    problem: &'static str,
    solver: &'static str,
    path: String,
    kind: &'static str,
    x: Option<f64>,
    y: Option<f64>,
    share_of_pane: f64,
    share_of_close_up: f64,
    share_of_seeds: f64,
    expected_trials: Option<f64>,
    height_evaluations_per_call: f64,
}

const COLUMNS: [Column; 11] = [
    column("problem", "which O, S and pane"),
    column(
        "solver",
        "the solver: Newton's method of fnee, published or complete, or the manifold walk of sms (angle difference)",
    ),
    column(
        "path",
        "the path to which it converges, numbered by what carries most light; other: something that is no path of \
         light through this pane; none: it does not converge",
    ),
    column(
        "kind",
        "whether the optical length of the path is a minimum, a saddle or a maximum, with the stiff coordinates \
         eliminated",
    ),
    column("x", "where the path crosses the near face, tangential coordinate in the pane, m"),
    column("y", "where the path crosses the near face, tangential coordinate in the pane, m"),
    column("share_of_pane", "share of the starts all over the pane (u1 = u2, v1 = v2) that converge to it"),
    column("share_of_close_up", "share of the starts in the close-up that converge to it"),
    column(
        "share_of_seeds",
        "share of 20000 seeds as the method draws them that converge to it: fnee published uniform in [0, 1]^4, fnee \
         complete uniform in the deflection window, sms uniform on the near face",
    ),
    column("expected_trials", "1 / share_of_seeds: the trials that an estimate of the inverse probability takes"),
    column("height_evaluations_per_call", "height evaluations for each of these seeds"),
];

fn run(session: &mut Session) -> Result<Report, ExperimentError> {
    let bundle = FOUR_PANES.bundle([CANDIDATES; 2])?;
    let scene = PreparedScene::build(&bundle).map_err(|source| FOUR_PANES.failure(source))?;
    let problems = problems(&scene);
    session.plan(problems.len() * SOLVERS.len());
    let mut report = Report::default();
    report.note_scene("four panes", &bundle);
    let mut rows = Vec::new();
    for problem in &problems {
        for (solver, name) in SOLVERS {
            session.begin(format!("{}, {name}", problem.name));
            let basins = Basins { problem, solver };
            let (whole, close_up) = (basins.outline(), basins.close_up());
            let size = session.settings.size;
            let [wide, near] = [whole, close_up].map(|part| session.pool.install(|| basins.map(part, size)));
            session.check()?;
            let (seeds, counters) = session.pool.install(|| basins.of_seeds());
            session.check()?;
            rows.extend(basins.rows(name, [&wide, &near, &seeds], &counters));
            let parts = [(wide, whole, "the pane"), (near, close_up, "close-up")];
            for (map, part, title) in parts {
                let title = format!("{}, {name}: {title}", problem.name);
                let image = picture(&map, size)?;
                let shown: Vec<DVec2> = problem.paths.iter().map(|path| path.theta[0]).collect();
                let figure = BasinFigure { title: &title, image: &image, part, paths: &shown };
                report.figures.push(figure.svg()?);
                report.add_files(&title, &image)?;
            }
            session.end(&format!("{}, {name}: {}", problem.name, basins.words(&seeds)));
        }
        report.statements.push(problem.words());
    }
    let caption = "Shares of the basins.".to_owned();
    report.tables = vec![Table::new("basins", caption, &COLUMNS, &rows)];
    Ok(report)
}

/// The places of the paper: a point with three paths, as far from the border of their pane as possible, and a point
/// with the most paths.
fn problems(scene: &PreparedScene) -> Vec<Problem<'_>> {
    let candidates = candidates(scene);
    let off_centre = |paths: &[Root]| paths.iter().map(|path| path.theta[0]).sum::<DVec2>().length();
    let three = candidates.iter().filter(|(_, paths)| paths.len() == 3);
    let first = three.min_by(|(_, one), (_, other)| off_centre(one).total_cmp(&off_centre(other)));
    let most = candidates.iter().rev().max_by_key(|(_, paths)| paths.len());
    let problem = |name, chosen: Option<&(Candidate, Vec<Root>)>| {
        let (candidate, paths) = chosen?;
        let Candidate { point, sample, pane } = *candidate;
        Some(Problem { name, scene, point, sample, pane, paths: paths.clone() })
    };
    [problem("three paths", first), problem("most paths", most)].into_iter().flatten().collect()
}

#[derive(Clone, Copy)]
struct Candidate {
    point: ShadingPoint,
    sample: SourceSample,
    pane: u32,
}

/// The points that the camera sees and the pane between each and the light, with the paths that there are; those that
/// carry most light come first.
fn candidates(scene: &PreparedScene) -> Vec<(Candidate, Vec<Root>)> {
    let (centre, radius) = scene.scene().specular_ball();
    let Some(light) = scene.scene().lights().first() else { return Vec::new() };
    let sample = light.sample_source(centre, radius, DVec2::splat(0.5));
    let candidate = |point: ShadingPoint| {
        let pane =
            scene.scene().first_pane_towards(&point, (sample.source, sample.triangle), &mut Counters::default())?;
        Some(Candidate { point, sample, pane })
    };
    let with_paths = |candidate: Candidate| {
        let (side, origin, source) = local(scene, &candidate)?;
        let search = PathSearch::new(side, origin, source, FneeSolver::Complete)?;
        let counters = &mut Counters::default();
        let mut paths = search.enumerate(counters).roots.into_vec();
        paths.retain(|path| search.transmission(path, counters).is_some());
        let light = |path: &Root| path.path.geometry_factor(path.determinant);
        paths.sort_by(|first, second| light(second).total_cmp(&light(first)));
        Some((candidate, paths))
    };
    points(scene).into_iter().flatten().filter_map(candidate).filter_map(with_paths).collect()
}

/// The side of the pane, O and S in the pane's frame.
fn local<'a>(scene: &'a PreparedScene, candidate: &Candidate) -> Option<(PaneSide<'a>, DVec3, Source)> {
    let pane = &scene.scene().panes()[candidate.pane as usize];
    let origin = pane.frame.point_to_local(candidate.point.position);
    let source = match candidate.sample.source {
        Source::Point(position) => Source::Point(pane.frame.point_to_local(position)),
        Source::Direction(direction) => Source::Direction(pane.frame.vector_to_local(direction)),
    };
    Some((PaneSide::facing(pane, origin)?, origin, source))
}

impl Problem<'_> {
    fn words(&self) -> String {
        let pane = &self.scene.scene().panes()[self.pane as usize].name;
        let [x, y, z] = self.point.position.to_array();
        let kinds: Vec<&str> = self.paths.iter().map(kind).collect();
        let count = |wanted: &str| kinds.iter().filter(|kind| **kind == wanted).count() as u64;
        format!(
            "{}: O at ({x:.4}, {y:.4}, {z:.4}) m behind the pane {pane}: {}, {}, {}.",
            self.name,
            counted(count("minimum"), "minimum", "minima"),
            counted(count("saddle"), "saddle", "saddles"),
            counted(count("maximum"), "maximum", "maxima")
        )
    }
}

/// Minimum, saddle or maximum of the optical length once X2 is eliminated.
fn kind(root: &Root) -> &'static str {
    let hessian = root.path.hessian();
    let schur = hessian.near - hessian.mixed * hessian.far.inverse() * hessian.mixed.transpose();
    match (schur.determinant() < 0.0, schur.x_axis.x + schur.y_axis.y > 0.0) {
        (true, _) => "saddle",
        (false, true) => "minimum",
        (false, false) => "maximum",
    }
}

/// Paths that enter the pane closer together than this part of its thickness are the same.
const SAME_PLACE: f64 = 1e-4;

/// What became of a start.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum End {
    /// It converged to this path.
    Path(usize),
    /// It converged to something else.
    Other,
    /// It did not converge.
    Nowhere,
}

/// A solver on a problem.
struct Basins<'a> {
    problem: &'a Problem<'a>,
    solver: Solver,
}

impl Basins<'_> {
    fn outline(&self) -> Rect {
        *self.problem.scene.scene().panes()[self.problem.pane as usize].outline.bounds()
    }

    /// A square around the paths, no larger than the pane.
    fn close_up(&self) -> Rect {
        let outline = self.outline();
        let places = self.problem.paths.iter().map(|path| path.theta[0]);
        let bounds = places.fold(None, |bounds: Option<[DVec2; 2]>, place| {
            let [min, max] = bounds.unwrap_or([place; 2]);
            Some([min.min(place), max.max(place)])
        });
        let Some([min, max]) = bounds else { return outline };
        let thickness = self.problem.scene.scene().panes()[self.problem.pane as usize].thickness;
        let half = (0.5 * CLOSE_UP * (max - min).max_element()).max(4.0 * thickness);
        let half = half.min(0.5 * (outline.max - outline.min).min_element());
        let middle = ((min + max) * 0.5).clamp(outline.min + half, outline.max - half);
        Rect { min: middle - half, max: middle + half }
    }

    /// What becomes of each start of a grid over a part of the pane, in rows from the top.
    fn map(&self, part: Rect, [width, height]: [u32; 2]) -> Vec<End> {
        let row = |y: u32| {
            (0..width).into_par_iter().map(move |x| {
                let u = (f64::from(x) + 0.5) / f64::from(width);
                let v = 1.0 - (f64::from(y) + 0.5) / f64::from(height);
                let place = part.min + (part.max - part.min) * DVec2::new(u, v);
                self.end(&self.solve_from(place, &mut Counters::default()))
            })
        };
        (0..height).into_par_iter().flat_map(row).collect()
    }

    /// Solves from a place on both faces.
    fn solve_from(&self, place: DVec2, counters: &mut Counters) -> Option<DVec2> {
        let Problem { scene, point, sample, pane, .. } = self.problem;
        let candidate = Candidate { point: *point, sample: *sample, pane: *pane };
        let (side, origin, source) = local(scene, &candidate)?;
        let connection = Connection::new(&side, origin, source);
        let region = SearchRegion::around(side.pane.outline.bounds(), side.pane.thickness);
        match self.solver {
            Solver::Complete => solve_complete(&connection, [place; 2], &region, counters).map(|root| root.theta[0]),
            Solver::Published => solve_published(&connection, [place; 2], &region, counters).map(|root| root.theta[0]),
            Solver::ManifoldWalk => {
                let constraint = ManifoldConstraint::AngleDifference;
                let frame = &side.pane.frame;
                let height = side.near_base() + side.near_surface().height(place);
                let search =
                    ManifoldSearch::new(scene.scene(), point, sample.source, *pane, constraint, WalkSteps::default())?;
                let entry = search.walk_towards(frame.point_to_world(place.extend(height)), counters)?;
                Some(frame.point_to_local(entry).truncate())
            }
        }
    }

    /// What becomes of seeds as the method draws them.
    fn of_seeds(&self) -> (Vec<End>, Counters) {
        let settings = SamplerSettings { seed: 1, samples_per_block: 1 };
        let solve = |index: u32| {
            let mut trials = SampleStream::new(&settings, 0, [0, 0], index).trials();
            let mut random = || DVec2::new(trials.next_f64(), trials.next_f64());
            let mut counters = Counters::default();
            let root = match self.solver {
                Solver::ManifoldWalk => {
                    let outline = self.outline();
                    self.solve_from(outline.min + (outline.max - outline.min) * random(), &mut counters)
                }
                Solver::Complete => self.search(FneeSolver::Complete, random, &mut counters),
                Solver::Published => self.search(FneeSolver::Published, random, &mut counters),
            };
            (self.end(&root), counters)
        };
        let ends: Vec<(End, Counters)> = (0..SEEDS).into_par_iter().map(solve).collect();
        let mut counters = Counters::default();
        ends.iter().for_each(|(_, one)| counters += *one);
        (ends.into_iter().map(|(end, _)| end).collect(), counters)
    }

    fn search(&self, solver: FneeSolver, random: impl FnMut() -> DVec2, counters: &mut Counters) -> Option<DVec2> {
        let Problem { scene, point, sample, pane, .. } = self.problem;
        let (side, origin, source) = local(scene, &Candidate { point: *point, sample: *sample, pane: *pane })?;
        PathSearch::new(side, origin, source, solver)?.solve(random, counters).map(|root| root.theta[0])
    }

    fn end(&self, place: &Option<DVec2>) -> End {
        let Some(place) = place else { return End::Nowhere };
        let limit = SAME_PLACE * self.problem.scene.scene().panes()[self.problem.pane as usize].thickness;
        let is_here = |path: &Root| (path.theta[0] - *place).length() < limit;
        self.problem.paths.iter().position(is_here).map_or(End::Other, End::Path)
    }

    /// A row for each path, and for what is none.
    fn rows(&self, solver: &'static str, [wide, near, seeds]: [&Vec<End>; 3], counters: &Counters) -> Vec<Row> {
        let share = |ends: &[End], wanted: End| {
            ends.iter().filter(|end| **end == wanted).count() as f64 / ends.len().max(1) as f64
        };
        let row = |end: End, path: String, root: Option<&Root>| {
            let share_of_seeds = share(seeds, end);
            Row {
                problem: self.problem.name,
                solver,
                path,
                kind: root.map_or("", kind),
                x: root.map(|root| root.theta[0].x),
                y: root.map(|root| root.theta[0].y),
                share_of_pane: share(wide, end),
                share_of_close_up: share(near, end),
                share_of_seeds,
                expected_trials: (root.is_some() && share_of_seeds > 0.0).then(|| 1.0 / share_of_seeds),
                height_evaluations_per_call: counters.height_evaluations as f64 / f64::from(SEEDS),
            }
        };
        let paths = self.problem.paths.iter().enumerate();
        let mut rows: Vec<Row> =
            paths.map(|(index, root)| row(End::Path(index), (index + 1).to_string(), Some(root))).collect();
        rows.push(row(End::Other, "other".to_owned(), None));
        rows.push(row(End::Nowhere, "none".to_owned(), None));
        rows
    }

    fn words(&self, seeds: &[End]) -> String {
        let found = seeds.iter().filter(|end| matches!(end, End::Path(_))).count();
        format!(
            "{:.1} percent of the method's seeds lead to one of {} paths",
            100.0 * found as f64 / seeds.len().max(1) as f64,
            self.problem.paths.len()
        )
    }
}

/// The ends in colours.
fn picture(ends: &[End], [width, height]: [u32; 2]) -> Result<FrameImage, ExperimentError> {
    let colour = |end: &End| match end {
        End::Path(index) => COLOURS[index % COLOURS.len()],
        End::Other => OTHER,
        End::Nowhere => NOWHERE,
    };
    let layers = ImageLayers { mean: ends.iter().map(colour).collect(), ..ImageLayers::default() };
    FrameImage::new(width, height, layers, None).map_err(ExperimentError::BadImage)
}
