//! Specular manifold sampling through old glass, against lists of all paths found by brute force.

use clerestory_film::counters::Counters;
use clerestory_film::{SampleStream, SamplerSettings};
use clerestory_render_core::geometry::SurfaceId;
use clerestory_render_core::integrator::PreparedScene;
use clerestory_render_core::scene::ShadingPoint;
use clerestory_render_core::specular::constraint::ManifoldConstraint;
use clerestory_render_core::specular::fnee::Fnee;
use clerestory_render_core::specular::fnee::FneeSolver;
use clerestory_render_core::specular::manifold::WalkSteps;
use clerestory_render_core::specular::mnee::MissedPaths;
use clerestory_render_core::specular::mnee::Mnee;
use clerestory_render_core::specular::scope::Scope;
use clerestory_render_core::specular::selection::PaneSelection;
use clerestory_render_core::specular::sms::ManifoldEstimator;
use clerestory_render_core::specular::sms::Sms;
use clerestory_render_core::specular::{SpecularMethod, THROUGH_PANE};
use clerestory_tests::estimate::Estimate;
use clerestory_tests::single_connections::Connections;
use clerestory_tests::solution_lists::{load_case, load_list};
use glam::DVec3;

const CONSTRAINTS: [ManifoldConstraint; 2] = [ManifoldConstraint::AngleDifference, ManifoldConstraint::HalfVector];

/// The irradiance at a receiver point, for a light of unit intensity.
fn irradiance(
    scene: &PreparedScene,
    origin: [f64; 3],
    method: &dyn SpecularMethod,
    stream: u32,
    counters: &mut Counters,
) -> f64 {
    let normal = scene.scene().triangle_normal(0);
    let to_pane = scene.scene().accelerator().panes()[0].frame.point_to_world(DVec3::ZERO) - DVec3::from(origin);
    let normal = if normal.dot(to_pane) > 0.0 { normal } else { -normal };
    let point = ShadingPoint { position: origin.into(), normal, surface: SurfaceId::Triangle(0), bounces: 0 };
    let settings = SamplerSettings { seed: 5, samples_per_block: 1 };
    let mut stream = SampleStream::new(&settings, 0, [0, 0], stream);
    let mut sum = 0.0;
    method.sample_li(scene.scene(), &point, 0, &THROUGH_PANE, &mut stream, counters, &mut |arrival| {
        sum += arrival.weight.x * arrival.direction.dot(normal);
    });
    let intensity = scene.scene().lights()[0].emission();
    sum / intensity.x
}

/// Paths that go through one pane.
fn through_panes(scene: &PreparedScene) -> Scope {
    Scope::new(scene.scene(), &["TT".to_owned()], None, None)
}

/// Checks that many walks find light of the listed paths only, and almost all of it.
#[track_caller]
fn check(case: &str, list: &str, least: f64) {
    let scene = load_case(case);
    for constraint in CONSTRAINTS {
        let method = Sms {
            constraint,
            steps: WalkSteps::default(),
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
            "{list}, {constraint:?}: {:.3} percent of the light; {:.1} percent of walks converge, {:.1} height \
             evaluations each",
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

/// A search that finds each path with some probability p. With `trials` searches, it finds the part 1 - (1 - p)^trials
/// of the light on average. Examples are manifold walks whose distinct paths are summed, and the search of the FNEE
/// paper with estimates of 1/p that are cut off.
type Searches<'a> = dyn Fn(u32) -> Box<dyn SpecularMethod> + 'a;

/// The light of each path over many single trials, as its probabilities, by the paths' listed light.
fn probabilities(
    scene: &PreparedScene,
    searches: &Searches<'_>,
    origin: [f64; 3],
    listed: &[f64],
    runs: u32,
) -> Vec<f64> {
    let method = searches(1);
    let mut found = vec![0.0; listed.len()];
    for stream in 0..runs {
        let light = irradiance(scene, origin, &*method, stream, &mut Counters::default());
        let known = listed.iter().position(|expected| (light - expected).abs() <= 1e-4 * expected);
        assert!(light == 0.0 || known.is_some(), "{light} is the light of no path to {origin:?}: {listed:?}");
        if let Some(path) = known {
            found[path] += 1.0;
        }
    }
    found.into_iter().map(|found| found / f64::from(runs)).collect()
}

/// Checks that `trials` find the light that follows from the probabilities, and with `unbiased` all of it.
#[track_caller]
fn check_missing_light(name: &str, case: &str, searches: &Searches<'_>, unbiased: &dyn SpecularMethod) {
    const RUNS: u32 = 4000;
    let scene = load_case(case);
    let several = load_list(&format!("{case}-folds.json")).into_iter().filter(|point| point.solutions.len() > 2);
    let mut lacking = [0.0; TRIALS.len()];
    let (mut points, mut largest_fault): (f64, f64) = (0.0, 0.0);
    for (index, point) in several.take(6).enumerate() {
        let listed: Vec<f64> = point.solutions.iter().map(|solution| solution.irradiance).collect();
        let all: f64 = listed.iter().sum();
        let mean = |method: &dyn SpecularMethod, first: u32| {
            let one = |stream| irradiance(&scene, point.origin, method, stream, &mut Counters::default());
            Estimate::of(&(first..first + RUNS / 4).map(one).collect::<Vec<_>>())
        };
        let probabilities = probabilities(&scene, searches, point.origin, &listed, RUNS);
        for (lacking, trials) in lacking.iter_mut().zip(TRIALS) {
            let paths = || listed.iter().zip(&probabilities);
            let of_theory =
                |trials: u32| -> f64 { paths().map(|(light, p)| light * (1.0 - (1.0 - p).powi(trials as i32))).sum() };
            let expected = of_theory(trials);
            // One trial finds one path: the counts are multinomial.
            let slope = |p: f64| f64::from(trials) * (1.0 - p).powi(trials as i32 - 1);
            let [squares, mean_slope] = paths().fold([0.0; 2], |[squares, mean], (light, p)| {
                let slope = light * slope(*p);
                [squares + slope * slope * p, mean + slope * p]
            });
            let variance = (squares - mean_slope * mean_slope).max(0.0) / f64::from(RUNS);
            let predicted = Estimate { mean: expected, variance, degrees: f64::from(RUNS) };
            let found = mean(&*searches(trials), RUNS);
            let deviates = found.deviates(&predicted);
            println!(
                "{name}, {case}, point {index}, {trials} trials: {:.4} of the light, by theory {:.4} ({deviates:+.1})",
                found.mean / all,
                expected / all
            );
            assert!(deviates.abs() < DEVIATES, "{name}, {case}, point {index}: {found}, by theory {predicted}");
            // A search that makes one trial too few.
            let faulty = Estimate { mean: of_theory(trials - 1), ..predicted };
            largest_fault = largest_fault.max(found.deviates(&faulty));
            *lacking += 1.0 - found.mean / all;
        }
        let found = mean(unbiased, RUNS);
        let listed = Estimate { variance: (LIST_ERROR * all).powi(2), ..Estimate::exact(all) };
        let deviates = found.deviates(&listed);
        assert!(deviates.abs() < DEVIATES, "{name}, {case}, point {index}: {found} of {all}, {deviates} deviates");
        points += 1.0;
    }
    assert!(largest_fault > DEVIATES, "{name}, {case}: a missing trial is not noticed: {largest_fault}");
    let lacking = lacking.map(|sum| sum / points);
    assert!(lacking[0] > 0.05 && lacking.is_sorted_by(|fewer, more| fewer > more), "{name}, {case}: {lacking:?}");
}

/// Relative error of the light in the lists.
const LIST_ERROR: f64 = 1e-5;

/// Numbers of trials whose light is predicted.
const TRIALS: [u32; 2] = [3, 12];

/// The largest of a few hundred normal deviates exceeds this once in a thousand times.
const DEVIATES: f64 = 5.0;

#[test]
#[ignore = "takes a minute; `tests/run long` has it"]
fn few_walks_lack_the_light_that_theory_says_and_weighted_ones_none() {
    for case in ["crown", "bump", "cathedral"] {
        let scene = load_case(case);
        for (name, constraint, steps) in [
            ("sms", ManifoldConstraint::AngleDifference, WalkSteps::OnPanes),
            ("sms, half vector", ManifoldConstraint::HalfVector, WalkSteps::OnPanes),
            ("sms, published", ManifoldConstraint::AngleDifference, WalkSteps::Published),
        ] {
            let scope = through_panes(&scene);
            let sms =
                |estimator| Sms { constraint, steps, estimator, selection: PaneSelection::All, scope: scope.clone() };
            let biased = |trials| Box::new(sms(ManifoldEstimator::Biased { trials })) as Box<dyn SpecularMethod>;
            check_missing_light(name, case, &biased, &sms(ManifoldEstimator::Unbiased { max_trials: 1_000_000 }));
        }
    }
}

#[test]
fn estimates_that_are_cut_off_lack_the_light_that_theory_says() {
    for case in ["crown", "bump", "cathedral"] {
        let fnee = |solver, max_trials| Fnee { solver, selection: PaneSelection::All, max_trials, reflected: false };
        let published = |trials| Box::new(fnee(FneeSolver::Published, trials)) as Box<dyn SpecularMethod>;
        // The search of the paper finds some paths so rarely that no affordable number of runs has all of the light.
        check_missing_light("fnee, published", case, &published, &fnee(FneeSolver::Complete, 1_000_000));
    }
}

/// Part of the light that a missing Fresnel factor takes away.
const FRESNEL: f64 = 0.042;

/// Compares the light that walks find with that of all paths, connection by connection.
#[track_caller]
fn check_connections(case: &str, light: &str, method: &str) {
    let connections = Connections::new(case, light, method);
    let light = connections.relative_light(400_000, 3);
    println!("{}: {light}", connections.name);
    assert!(light.agrees() && light.would_notice(FRESNEL), "{}: {light}", connections.name);
}

/// Lights larger than a point, and what finds them. Behind cathedral glass they take the samples of the binary `bias`.
const EXTENDED: [[&str; 2]; 2] = [["sphere", "sms, half vector"], ["sun", "sms"]];

#[test]
#[ignore = "takes a minute; `tests/run long` has it"]
fn walks_find_the_light_of_each_connection_without_bias() {
    for case in ["flat", "bump", "crown", "cathedral"] {
        check_connections(case, "point", "sms");
    }
    for [light, method] in EXTENDED {
        check_connections("crown", light, method);
    }
}

#[test]
#[ignore = "takes a minute; `tests/run long` has it"]
fn walks_find_the_light_of_each_connection_to_larger_lights_without_bias() {
    for case in ["flat", "bump"] {
        for [light, method] in EXTENDED {
            check_connections(case, light, method);
        }
    }
}

/// Compares manifold walks through any pane of the room with the light of all paths that scouts reach.
#[track_caller]
fn check_room(method: &str) {
    let connections = Connections::new("room", "sun", method);
    let light = connections.relative_light(100_000, 3);
    println!("{}: {light}", connections.name);
    assert!(light.agrees() && light.would_notice(FRESNEL), "{}: {light}", connections.name);
    assert!(light.left_out > 0.1 && light.unreached < 0.04, "{}: {light}", connections.name);
}

#[test]
#[ignore = "takes a minute; `tests/run long` has it"]
fn walks_through_all_panes_of_the_room_find_the_light_that_scouts_reach() {
    check_room("sms");
}

#[test]
#[ignore = "takes a minute; `tests/run long` has it"]
fn published_walks_through_all_panes_of_the_room_find_the_light_that_scouts_reach() {
    check_room("sms, published");
}

#[test]
fn estimates_that_are_cut_off_have_the_light_that_as_many_searches_find() {
    for method in ["fnee, 16 trials", "sms, 4 trials"] {
        let connections = Connections::new("cathedral", "point", method);
        let light = connections.relative_light(100_000, 3);
        println!("{}: {light}", connections.name);
        assert!(light.agrees() && light.would_notice(FRESNEL), "{}: {light}", connections.name);
        assert!(
            light.theirs.mean < 0.99 && light.unreached < 0.05 && light.elsewhere < 0.01,
            "{}: {light}",
            connections.name
        );
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
