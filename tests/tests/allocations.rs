//! Searches take no memory: they run by the million, and on every core an allocation waits for the others.

use std::hint::black_box;

use allocation_counter::measure;
use clerestory_render_core::counters::Counters;
use clerestory_render_core::geometry::Leaving;
use clerestory_render_core::optics::{LightKind, Source};
use clerestory_render_core::scene::Scene;
use clerestory_render_core::scene::description::{FneeSolver, ManifoldConstraint, WalkSteps};
use clerestory_render_core::specular::{ShadingPoint, fnee::PathSearch, side::PaneSide, sms::ManifoldSearch};
use clerestory_tests::random::Random;
use clerestory_tests::solution_lists::{load_case, load_list};
use glam::{DVec2, DVec3};

/// Seeds at each point.
const SEEDS: u32 = 100;

/// Some points behind cathedral glass.
fn points() -> Vec<DVec3> {
    load_list("cathedral-folds.json").into_iter().map(|point| point.origin.into()).step_by(4).collect()
}

/// Where the light of a case is.
fn light(scene: &Scene) -> DVec3 {
    let LightKind::Point { position, .. } = scene.lights()[0].kind else { panic!("a point light") };
    position
}

/// The search from a point through the pane, if a path can be there.
fn search(scene: &Scene, point: DVec3, solver: FneeSolver) -> Option<PathSearch<'_>> {
    let pane = &scene.accelerator().panes()[0];
    let origin = pane.frame.point_to_local(point);
    let side = PaneSide::facing(pane, origin).expect("receivers lie in front of their pane");
    PathSearch::new(side, origin, Source::Point(pane.frame.point_to_local(light(scene))), solver)
}

/// Runs a search from seeds in the unit square, of which some and not all have to lead to a path.
#[derive(Default)]
struct Runs {
    tried: u32,
    found: u32,
}

impl Runs {
    fn run(&mut self, random: &mut Random, mut search: impl FnMut(DVec2) -> bool) {
        let taken = measure(|| {
            for _ in 0..SEEDS {
                self.found += u32::from(search(DVec2::new(random.uniform(), random.uniform())));
            }
        });
        assert_eq!(taken.count_total, 0);
        self.tried += SEEDS;
    }

    fn finish(&self) {
        assert!(0 < self.found && self.found < self.tried, "{} of {} end at a path", self.found, self.tried);
    }
}

#[test]
fn memory_that_is_taken_is_counted() {
    assert_eq!(measure(|| drop(black_box(Box::new(1)))).count_total, 1);
}

#[test]
fn searches_of_stationary_lengths_take_no_memory() {
    let scene = load_case("cathedral");
    let mut random = Random::new(5, 0);
    let counters = &mut Counters::default();
    for solver in [FneeSolver::Complete, FneeSolver::Published] {
        let mut runs = Runs::default();
        for search in points().into_iter().filter_map(|point| search(&scene, point, solver)) {
            runs.run(&mut random, |seed| {
                // The published search takes four numbers, and may have two of them twice.
                search.solve(|| seed, counters).is_some()
            });
        }
        runs.finish();
    }
}

#[test]
fn walks_over_panes_take_no_memory() {
    let scene = load_case("cathedral");
    let pane = &scene.accelerator().panes()[0];
    let mut random = Random::new(5, 0);
    let counters = &mut Counters::default();
    for constraint in [ManifoldConstraint::AngleDifference, ManifoldConstraint::HalfVector] {
        let mut runs = Runs::default();
        for position in points() {
            let normal = scene.triangle_normal(0);
            let normal = if normal.dot(pane.frame.origin - position) > 0.0 { normal } else { -normal };
            let point = ShadingPoint { position, normal, leaving: Leaving::Triangle(0), bounces: 0 };
            let source = Source::Point(light(&scene));
            let Some(search) = ManifoldSearch::new(&scene, &point, source, 0, constraint, WalkSteps::default()) else {
                continue;
            };
            runs.run(&mut random, |seed| {
                let target = pane.frame.point_to_world(((seed - 0.5) * pane.size).extend(0.0));
                search.walk_towards(target, counters).is_some()
            });
        }
        runs.finish();
    }
}

#[test]
fn all_paths_of_a_window_are_found_without_memory_but_for_more_than_four() {
    let scene = load_case("cathedral");
    let counters = &mut Counters::default();
    let points = points();
    let (mut most, mut all) = (0, 0);
    for search in points.iter().filter_map(|point| search(&scene, *point, FneeSolver::Complete)) {
        let mut paths = 0;
        let taken = measure(|| paths = search.enumerate(counters).roots.len());
        assert_eq!(taken.count_total, u64::from(paths > 4), "{paths} paths");
        (most, all) = (most.max(paths), all + paths);
    }
    assert!(most > 2 && all > points.len(), "{all} paths, {most} at the most");
}
