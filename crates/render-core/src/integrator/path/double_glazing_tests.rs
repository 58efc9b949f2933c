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
