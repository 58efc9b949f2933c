//! Light through two panes, one close behind the other, against closed forms: every method finds it.

use std::f64::consts::PI;

use serde_json::{Value, json};

use super::tests::{EDGE, SAMPLES, mean, square};
use super::thin_wall_tests::{Lit, REFLECTANCE, lights};

/// Indices of refraction of the panes, from the floor up.
const GLASS: [f64; 2] = [1.5, 1.7];

/// What the panes let through at a cosine to their normal, without light that they mirror.
fn transmittance(cosine: f64) -> f64 {
    let of_pane = |index: f64| {
        let behind = (1.0 - (1.0 - cosine * cosine) / (index * index)).sqrt();
        let s = ((cosine - index * behind) / (cosine + index * behind)).powi(2);
        let p = ((index * cosine - behind) / (index * cosine + behind)).powi(2);
        [s, p].map(|reflected| (1.0 - reflected) * (1.0 - reflected))
    };
    let [[s, p], [t, u]] = GLASS.map(of_pane);
    0.5 * (s * t + p * u)
}

fn floor_below_panes(integrator: &str, light: &Value) -> Value {
    let pane = |index: usize| {
        json!({
            "name": format!("pane {index}"), "centre": [0, 0, 1.0 + 0.05 * index as f64], "x_axis": [1, 0, 0],
            "y_axis": [0, 1, 0], "width": 90, "height": 90, "thickness": 0.004, "index_of_refraction": GLASS[index]
        })
    };
    json!({
        "version": 2, "name": "floor", "film": {"width": EDGE, "height": EDGE},
        "camera": {"orthographic": {
            "position": [-0.5, 0.1, 0.4], "look_at": [0, 0, 0], "up": [0, 1, 0], "height": 1e-4}},
        "integrator": integrator, "path_filter": "D TTTT L",
        "sampling": {"samples_per_pass": SAMPLES, "samples_per_block": SAMPLES},
        "materials": {"floor": {"diffuse": {"reflectance": {"colour": [REFLECTANCE, REFLECTANCE, REFLECTANCE]}}}},
        "meshes": [{"name": "floor", "material": "floor", "source": square(50.0, 0.0)}],
        "panes": [pane(0), pane(1)], "lights": [light]
    })
}

#[test]
fn every_method_finds_light_through_a_window_and_the_pane_before_it() {
    let [sun, _, rectangle, sky] = lights();
    for Lit { light, irradiance } in [sun, rectangle, sky] {
        for method in ["auto", "cone", "fnee", "mnee"] {
            let expected = irradiance(&transmittance) * REFLECTANCE / PI;
            let (found, error) = mean(&floor_below_panes(method, &light));
            let what = format!("{method}: {found} +- {error}, not {expected}: {light}");
            // The panes end at 89 degrees, and bring the lamp nearer by a third of their thickness.
            assert!((found - expected).abs() < 4.0 * error + 4e-3 * expected, "{what}");
            assert!(error < 5e-3 * expected, "{what}");
        }
    }
}

/// A floor lit by a low sun through a pane and, far to its side, an old one behind it. A small pane with this back, of
/// which the floor in view sees nothing, is behind the first, too.
fn floor_below_displaced_panes(small: &Value) -> Value {
    let hammered = json!({"hammered": {"wavelength": 0.02, "amplitude": 0.0006, "seed": 3}});
    let pane = |name: &str, centre: [f64; 3], edge: f64, back: &Value| {
        json!({
            "name": name, "centre": centre, "x_axis": [1, 0, 0], "y_axis": [0, 0, 1], "width": edge, "height": edge,
            "thickness": 0.004, "front": "flat", "back": back
        })
    };
    json!({
        "version": 2, "name": "floor", "film": {"width": EDGE, "height": EDGE},
        "camera": {"orthographic": {
            "position": [-1.87, -1.5, 0.6], "look_at": [-1.87, -1.5, 0], "up": [0, 1, 0], "height": 0.9}},
        "integrator": "cone", "path_filter": "D TTTT L",
        "sampling": {"samples_per_pass": SAMPLES, "samples_per_block": SAMPLES},
        "materials": {"floor": {"diffuse": {"reflectance": {"colour": [REFLECTANCE, REFLECTANCE, REFLECTANCE]}}}},
        "meshes": [{"name": "floor", "material": "floor", "source": square(4.0, 0.0)}],
        "panes": [
            pane("first", [0.0, 0.0, 1.0], 0.1, &json!("flat")),
            pane("small", [-0.03, 0.06, 0.962], 0.02, small),
            pane("old", [0.202, 0.06, 1.0], 0.3, &hammered)
        ],
        "lights": [{"sun": {
            "name": "sun", "direction": [0.75, 0.6, 0.4], "angular_radius": 0.5, "radiance": [1000, 1000, 1000]}}]
    })
}

#[test]
fn light_is_found_through_panes_at_an_angle_whatever_else_is_behind_the_first() {
    let hammered = json!({"hammered": {"wavelength": 0.02, "amplitude": 0.0006, "seed": 3}});
    let [(one, error), (other, other_error)] =
        [json!("flat"), hammered].map(|small| mean(&floor_below_displaced_panes(&small)));
    let error = (error * error + other_error * other_error).sqrt();
    assert!((one - other).abs() < 4.0 * error && error < 0.2 * one, "{one} and {other} +- {error}");
}
