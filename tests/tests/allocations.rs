//! Searches take no memory: they run by the million, and on every core an allocation waits for the others.

use std::hint::black_box;

use allocation_counter::measure;
use clerestory_render_core::counters::Counters;
use clerestory_render_core::geometry::Leaving;
use clerestory_render_core::optics::{LightKind, Source};
use clerestory_render_core::scene::Scene;
use clerestory_render_core::scene::description::{FneeSolver, ManifoldConstraint};
use clerestory_render_core::specular::{ShadingPoint, fnee::PathSearch, side::PaneSide, sms::ManifoldSearch};
use clerestory_tests::random::Random;
use clerestory_tests::solution_lists::{load_case, load_list};
use glam::{DVec2, DVec3};

/// Seeds at each point.
const SEEDS: u32 = 100;

/// Runs a search from seeds in the unit square, and says how many of them lead to a path, and how often memory was taken.
fn run(random: &mut Random, mut search: impl FnMut(&mut dyn FnMut() -> DVec2) -> bool) -> (u32, u64) {
    let mut found = 0;
    let taken = measure(|| {
        for _ in 0..SEEDS {
            found += u32::from(search(&mut || DVec2::new(random.uniform(), random.uniform())));
        }
    });
    (found, taken.count_total)
}

#[test]
fn searches_take_no_memory() {
    assert_eq!(measure(|| drop(black_box(Box::new(1)))).count_total, 1, "the count itself");
    let scene: Scene = load_case("cathedral");
    let points: Vec<DVec3> =
        load_list("cathedral-folds.json").into_iter().map(|point| point.origin.into()).step_by(4).collect();
    let LightKind::Point { position, .. } = scene.lights()[0].kind else { panic!("a point light") };
    let pane = &scene.accelerator().panes()[0];
    let counters = &mut Counters::default();
    let mut random = Random::new(5, 0);

    for solver in [FneeSolver::Complete, FneeSolver::Published] {
        let (mut found, mut tried) = (0, 0);
        for point in &points {
            let origin = pane.frame.point_to_local(*point);
            let side = PaneSide::facing(pane, origin).expect("receivers lie in front of their pane");
            let source = Source::Point(pane.frame.point_to_local(position));
            let Some(search) = PathSearch::new(side, origin, source, solver) else { continue };
            let (paths, taken) = run(&mut random, |seed| search.solve(seed, counters).is_some());
            assert_eq!(taken, 0, "{solver:?} at {point}");
            (found, tried) = (found + paths, tried + SEEDS);
        }
        assert!(0 < found && found < tried, "{solver:?}: {found} of {tried} searches end at a path");
    }
    for constraint in [ManifoldConstraint::AngleDifference, ManifoldConstraint::HalfVector] {
        let (mut found, mut tried) = (0, 0);
        for point in &points {
            let normal = scene.triangle_normal(0);
            let normal = if normal.dot(pane.frame.origin - *point) > 0.0 { normal } else { -normal };
            let point = ShadingPoint { position: *point, normal, leaving: Leaving::Triangle(0), bounces: 0 };
            let source = Source::Point(position);
            let Some(search) = ManifoldSearch::new(&scene, &point, source, 0, constraint) else { continue };
            let (paths, taken) = run(&mut random, |seed| {
                let target = pane.frame.point_to_world(((seed() - 0.5) * pane.size).extend(0.0));
                search.walk_towards(target, counters).is_some()
            });
            assert_eq!(taken, 0, "{constraint:?} at {}", point.position);
            (found, tried) = (found + paths, tried + SEEDS);
        }
        assert!(0 < found && found < tried, "{constraint:?}: {found} of {tried} walks end at a path");
    }
}
