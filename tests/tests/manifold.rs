//! Specular manifold sampling through old glass, against lists of all paths found by brute force.

use clerestory_render_core::counters::Counters;
use clerestory_render_core::film::{SampleStream, SamplerSettings};
use clerestory_render_core::geometry::Leaving;
use clerestory_render_core::optics::LightKind;
use clerestory_render_core::scene::Scene;
use clerestory_render_core::scene::description::{ManifoldConstraint, ManifoldEstimator, MissedPaths, PaneSelection};
use clerestory_render_core::specular::{
    ShadingPoint, SpecularMethod, THROUGH_PANE, mnee::Mnee, scope::Scope, sms::Sms,
};
use clerestory_tests::solution_lists::{load_case, load_list};
use glam::DVec3;

const CONSTRAINTS: [ManifoldConstraint; 2] = [ManifoldConstraint::AngleDifference, ManifoldConstraint::HalfVector];

/// The irradiance at a receiver point, for a light of unit intensity.
fn irradiance(
    scene: &Scene,
    origin: [f64; 3],
    method: &dyn SpecularMethod,
    stream: u32,
    counters: &mut Counters,
) -> f64 {
    let normal = scene.triangle_normal(0);
    let to_pane = scene.accelerator().panes()[0].frame.point_to_world(DVec3::ZERO) - DVec3::from(origin);
    let normal = if normal.dot(to_pane) > 0.0 { normal } else { -normal };
    let point = ShadingPoint { position: origin.into(), normal, leaving: Leaving::Triangle(0), bounces: 0 };
    let settings = SamplerSettings { seed: 5, samples_per_block: 1 };
    let mut stream = SampleStream::new(&settings, 0, [0, 0], stream);
    let mut sum = 0.0;
    method.gather(scene, &point, 0, &THROUGH_PANE, &mut stream, counters, &mut |arrival| {
        sum += arrival.weight.x * arrival.direction.dot(normal);
    });
    let LightKind::Point { intensity, .. } = scene.lights()[0].kind else { panic!("a point light") };
    sum / intensity.x
}

/// Paths that go through one pane.
fn through_panes(scene: &Scene) -> Scope {
    Scope::new(scene, &["TT".to_owned()], None, None)
}

/// Checks that many walks find light of the listed paths only, and almost all of it.
#[track_caller]
fn check(case: &str, list: &str, least: f64) {
    let scene = load_case(case);
    for constraint in CONSTRAINTS {
        let method = Sms {
            constraint,
            estimator: ManifoldEstimator::Biased { trials: 2000 },
            selection: PaneSelection::All,
            scope: through_panes(&scene),
        };
        let counters = &mut Counters::default();
        let (mut listed, mut found) = (0.0, 0.0);
        for (index, point) in (0..).zip(load_list(list)).step_by(4) {
            let expected: f64 = point.solutions.iter().map(|solution| solution.irradiance).sum();
            let ours = irradiance(&scene, point.origin, &method, index, counters);
            assert!(ours <= expected * (1.0 + 1e-5) + 1e-12, "{list}, point {index}: {ours} is more than {expected}");
            listed += expected;
            found += ours;
        }
        println!(
            "{list}, {constraint:?}: {:.3} percent of the light; {:.1} percent of walks converge, {:.1} height evaluations each",
            100.0 * found / listed,
            100.0 * counters.converged as f64 / counters.solver_calls as f64,
            counters.height_evaluations as f64 / counters.solver_calls as f64,
        );
        assert!(found > least * listed, "{list}, {constraint:?}: {found} of {listed}");
    }
}

#[test]
fn walks_find_the_listed_paths_and_no_others() {
    check("flat", "flat.json", 0.99999);
    check("crown", "crown.json", 0.9999);
    check("bump", "bump.json", 0.9999);
    check("cathedral", "cathedral.json", 0.95);
}

/// Mean and its variance.
fn mean_and_variance(values: &[f64]) -> (f64, f64) {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    (mean, values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / (count * (count - 1.0)))
}

/// The largest of a few hundred normal deviates exceeds this once in a thousand times.
const DEVIATES: f64 = 5.0;

#[test]
fn few_walks_lack_the_light_that_theory_says_and_weighted_ones_none() {
    const ESTIMATES: u32 = 400;
    for case in ["crown", "bump", "cathedral"] {
        let scene = load_case(case);
        let several = load_list(&format!("{case}-folds.json")).into_iter().filter(|point| point.solutions.len() > 2);
        for (index, point) in several.take(6).enumerate() {
            let all: f64 = point.solutions.iter().map(|solution| solution.irradiance).sum();
            let estimates = |estimator| {
                let constraint = ManifoldConstraint::AngleDifference;
                let method = Sms { constraint, estimator, selection: PaneSelection::All, scope: through_panes(&scene) };
                let counters = &mut Counters::default();
                let one = |stream| irradiance(&scene, point.origin, &method, stream, counters);
                mean_and_variance(&(0..ESTIMATES).map(one).collect::<Vec<_>>())
            };
            // The mean over runs of one walk each is the sum over paths of p times their light.
            let (one, one_variance) = estimates(ManifoldEstimator::Biased { trials: 1 });
            let (four, four_variance) = estimates(ManifoldEstimator::Biased { trials: 4 });
            let (weighted, weighted_variance) = estimates(ManifoldEstimator::Unbiased { max_trials: 1_000_000 });
            println!(
                "{case}, point {index}: 1 walk {:.3}, 4 walks {:.3}, weighted {:.3}",
                one / all,
                four / all,
                weighted / all
            );
            assert!(four < all && one < four, "{case}, point {index}: {one}, {four} of {all}");
            // 1 - (1 - p)^4 <= 4 p for each path.
            let excess = (four - 4.0 * one) / (four_variance + 16.0 * one_variance).sqrt();
            assert!(excess < DEVIATES, "{case}, point {index}: {four} from four walks, {one} from one");
            let deviation = (weighted - all) / weighted_variance.sqrt();
            assert!(deviation.abs() < DEVIATES, "{case}, point {index}: {weighted} of {all}, {deviation} deviates");
        }
    }
}

#[test]
fn the_walk_from_the_straight_line_finds_one_listed_path() {
    for (case, least) in [("flat", 0.99999), ("crown", 0.5), ("bump", 0.5)] {
        let scene = load_case(case);
        let method = Mnee { missed: MissedPaths::Dropped, scope: through_panes(&scene) };
        let (mut listed, mut found) = (0.0, 0.0);
        for point in load_list(&format!("{case}.json")) {
            let ours = irradiance(&scene, point.origin, &method, 0, &mut Counters::default());
            let is_one = |expected: f64| (ours - expected).abs() <= 1e-5 * expected;
            let known = ours == 0.0 || point.solutions.iter().any(|solution| is_one(solution.irradiance));
            assert!(known, "{case}: {ours} is the light of no path to {:?}", point.origin);
            listed += point.solutions.iter().map(|solution| solution.irradiance).sum::<f64>();
            found += ours;
        }
        println!("{case}: {:.1} percent of the light by one walk", 100.0 * found / listed);
        assert!(found > least * listed, "{case}: {found} of {listed}");
    }
}
