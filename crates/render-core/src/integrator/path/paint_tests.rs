//! Painted panes, against closed forms: the mask takes its part of the straight light, and the paint scatters its own.

use std::f64::consts::PI;

use serde_json::{Value, json};

use super::tests::{EDGE, SAMPLES, floor_under_lamp, mean, pane, square};
use super::thin_wall_tests::{Lit, REFLECTANCE, lights};

const INDEX: f64 = 1.5;

/// What so many panes let through at a cosine to their normal, without light that they mirror.
fn transmittance(panes: i32, cosine: f64) -> f64 {
    let behind = (1.0 - (1.0 - cosine * cosine) / (INDEX * INDEX)).sqrt();
    let s = ((cosine - INDEX * behind) / (cosine + INDEX * behind)).powi(2);
    let p = ((INDEX * cosine - behind) / (INDEX * cosine + behind)).powi(2);
    0.5 * ((1.0 - s).powi(2 * panes) + (1.0 - p).powi(2 * panes))
}

const MASK: f64 = 0.5;
const THROUGH: f64 = 0.6;

/// Paint that lets much light through.
fn paint(face: &str) -> Value {
    json!({
        "mask": MASK, "reflectance": {"colour": [0.3, 0.3, 0.3]}, "transmittance": {"colour": [THROUGH, 0, 0]},
        "face": face
    })
}

/// A floor below panes, of which the first is painted on the side of the floor.
fn floor_below(panes: u32, integrator: &Value, light: &Value) -> Value {
    let pane = |number: u32| {
        let mut pane = json!({
            "name": format!("pane {number}"), "centre": [0, 0, 1.0 + 0.05 * f64::from(number)], "x_axis": [1, 0, 0],
            "y_axis": [0, 1, 0], "width": 90, "height": 90, "thickness": 0.004, "index_of_refraction": INDEX
        });
        if number == 0 {
            pane["paint"] = paint("front");
        }
        pane
    };
    let through = "TT".repeat(panes as usize);
    json!({
        "version": 2, "name": "floor", "film": {"width": EDGE, "height": EDGE},
        "camera": {"orthographic": {
            "position": [-0.5, 0.1, 0.4], "look_at": [0, 0, 0], "up": [0, 1, 0], "height": 1e-4}},
        "integrator": integrator, "path_filter": format!("(D|DD){through}L"),
        "sampling": {"samples_per_pass": SAMPLES, "samples_per_block": SAMPLES},
        "materials": {"floor": {"diffuse": {"reflectance": {"colour": [REFLECTANCE, REFLECTANCE, REFLECTANCE]}}}},
        "meshes": [{"name": "floor", "material": "floor", "source": square(50.0, 0.0)}],
        "panes": (0..panes).map(pane).collect::<Vec<_>>(), "lights": [light]
    })
}

#[track_caller]
fn check_floor(panes: u32, method: &str, Lit { light, irradiance }: &Lit) {
    let straight = irradiance(&|cosine| transmittance(panes as i32, cosine)) * REFLECTANCE / PI;
    let expected = straight * (1.0 - MASK + MASK * THROUGH);
    let (found, error) = mean(&floor_below(panes, &json!(method), light));
    let what = format!("{method}: {found} +- {error}, not {expected}: {light}");
    // The panes end at 89 degrees.
    assert!((found - expected).abs() < 4.0 * error + 4e-3 * expected, "{what}");
    assert!(error < 0.01 * expected, "{what}");
}

#[test]
fn every_method_finds_what_paint_leaves_of_the_sun() {
    let [sun, ..] = lights();
    for method in ["cone", "fnee", "mnee"] {
        check_floor(1, method, &sun);
    }
}

#[test]
fn every_method_finds_what_paint_leaves_of_the_sky() {
    let [.., sky] = lights();
    for method in ["path", "cone", "fnee"] {
        check_floor(1, method, &sky);
    }
}

#[test]
fn light_of_the_sun_through_an_outer_pane_reaches_paint() {
    let [sun, ..] = lights();
    check_floor(2, "auto", &sun);
}

#[test]
fn every_method_finds_the_same_light_of_a_lamp_through_a_small_painted_pane() {
    let plaster = json!({"diffuse": {"reflectance": {"colour": [0.5, 0.5, 0.5]}}});
    let of = |method: &Value| {
        let mut painted = pane(0.6, 1.0);
        painted["paint"] = paint("back");
        let mut scene = floor_under_lamp(&plaster, &[], &json!([painted]), method);
        scene["version"] = json!(2);
        mean(&scene)
    };
    let (expected, expected_error) = of(&json!({"path": {"max_depth": 6}}));
    for method in ["cone", "fnee", "sms", "mnee"] {
        let (found, error) = of(&json!({method: {"max_depth": 6}}));
        let errors = (found - expected).abs() / libm::hypot(error, expected_error);
        assert!(errors < 4.0, "{method}: {found} +- {error}, not {expected} +- {expected_error}");
        assert!(error.max(expected_error) < 0.03 * found, "{method}: {found} +- {error}, {expected_error}");
    }
}
