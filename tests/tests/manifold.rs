//! Specular manifold sampling through old glass, against lists of all paths found by brute force.

use clerestory_render_core::counters::Counters;
use clerestory_render_core::film::{SampleStream, SamplerSettings};
use clerestory_render_core::geometry::Leaving;
use clerestory_render_core::optics::LightKind;
use clerestory_render_core::scene::Scene;
use clerestory_render_core::scene::description::{ManifoldConstraint, ManifoldEstimator};
use clerestory_render_core::specular::{ShadingPoint, SpecularMethod, sms::Sms};
use clerestory_tests::solution_lists::{load_case, load_list};
use glam::DVec3;

const CONSTRAINTS: [ManifoldConstraint; 2] = [ManifoldConstraint::AngleDifference, ManifoldConstraint::HalfVector];

/// The irradiance at a receiver point, for a light of unit intensity.
fn irradiance(scene: &Scene, origin: [f64; 3], method: &Sms, stream: u32, counters: &mut Counters) -> f64 {
    let normal = scene.triangle_normal(0);
    let to_pane = scene.accelerator().panes()[0].frame.point_to_world(DVec3::ZERO) - DVec3::from(origin);
    let normal = if normal.dot(to_pane) > 0.0 { normal } else { -normal };
    let point = ShadingPoint { position: origin.into(), normal, leaving: Leaving::Triangle(0), bounces: 0 };
    let settings = SamplerSettings { seed: 5, samples_per_block: 1 };
    let mut stream = SampleStream::new(&settings, 0, [0, 0], stream);
    let mut sum = 0.0;
    method.gather(scene, &point, 0, &mut stream, counters, &mut |arrival| {
        sum += arrival.weight.x * arrival.direction.dot(normal);
    });
    let LightKind::Point { intensity, .. } = scene.lights()[0].kind else { panic!("a point light") };
    sum / intensity.x
}

/// Checks that many walks find light of the listed paths only, and almost all of it.
#[track_caller]
fn check(case: &str, list: &str, least: f64) {
    let scene = load_case(case);
    for constraint in CONSTRAINTS {
        let method = Sms { constraint, estimator: ManifoldEstimator::Biased { trials: 2000 } };
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
