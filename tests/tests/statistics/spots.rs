//! Spot lights through glass: what counts is the direction in which light leaves the light.

use clerestory_film::counters::Counters;
use clerestory_tests::pane_scene::{PaneScene, gather, pane};
use glam::DVec3;
use serde_json::{Value, json};

const POSITION: [f64; 3] = [0.3, 0.1, 1.2];
const DIRECTION: [f64; 3] = [-0.35, -0.1, -1.0];
const ANGLES: [f64; 2] = [4.0, 10.0];

fn point() -> Value {
    json!({"point": {"name": "lamp", "position": POSITION, "intensity": [5, 5, 5]}})
}

fn spot() -> Value {
    json!({"spot": {
        "name": "lamp", "position": POSITION, "direction": DIRECTION, "intensity": [5, 5, 5],
        "inner_angle": ANGLES[0], "outer_angle": ANGLES[1]}})
}

/// The part of the intensity that leaves the light against this direction, as docs/scene-format.md says.
fn falloff(towards_light: DVec3) -> f64 {
    let cosine = -towards_light.dot(DVec3::from(DIRECTION).normalize());
    let [inner, outer] = ANGLES.map(|angle| libm::cos(angle.to_radians()));
    ((cosine - outer) / (inner - outer)).clamp(0.0, 1.0).powi(2)
}

fn behind(relief: &Value, light: Value) -> PaneScene {
    PaneScene::new(vec![pane("glass", [0.0; 3], [0.8, 0.8], 0.02, [relief.clone(), json!("flat")])], light)
}

/// Behind a flat pane, light goes on in the direction in which it has left the light, beside the straight line.
#[test]
fn behind_flat_glass_a_spot_is_a_point_times_the_falloff_where_light_leaves() {
    for integrator in ["fnee", "sms", "mnee"] {
        let [by_point, by_spot] =
            [point(), spot()].map(|light| behind(&json!("flat"), light).build(&json!({integrator: {}}), 1));
        let (mut lit, mut dark) = (0, 0);
        for number in 0..40 {
            let place = [-0.5 + 0.02 * f64::from(number), 0.1];
            let at = behind(&json!("flat"), point()).point(place);
            let all = |scene| gather(scene, &at, 3, &mut Counters::default());
            let expected: f64 = all(&by_point).iter().map(|(towards, weight)| weight * falloff(*towards)).sum();
            let found: f64 = all(&by_spot).iter().map(|(_, weight)| weight).sum();
            assert!(
                (found - expected).abs() < 1e-6 * (1.0 + expected),
                "{integrator} at {place:?}: {found} {expected}"
            );
            if expected > 0.0 { lit += 1 } else { dark += 1 }
        }
        assert!(lit > 10 && dark > 3, "{integrator}: {lit} lit, {dark} dark");
    }
}

/// Behind relief, two methods that share no search find the same light of a spot.
#[test]
fn behind_old_glass_methods_agree_on_a_spot() {
    let relief = json!({"bump": {"centre": [0, 0], "radius": [0.15, 0.12], "amplitude": 2e-3}});
    let scene = PaneScene { edge: 0.5, pixels: 16, ..behind(&relief, spot()) };
    let found = |integrator: &str| scene.irradiance(&json!({integrator: {}}), 4, 16, 4);
    let [fnee, sms] = ["fnee", "sms"].map(found);
    for (place, (fnee, sms)) in fnee.iter().zip(&sms).enumerate() {
        let error = (fnee.variance + sms.variance).sqrt();
        assert!((fnee.mean - sms.mean).abs() <= 4.5 * error + 1e-3 * fnee.mean, "{place}: {fnee}, {sms}");
    }
    let dark = fnee.iter().filter(|estimate| estimate.mean == 0.0).count();
    assert!(dark < 16, "all is dark");
}
