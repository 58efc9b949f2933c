//! Light through panes, against what Fresnel's equations say of it.

use std::collections::BTreeMap;
use std::sync::atomic::AtomicBool;

use serde_json::{Value, json};

use super::*;
use crate::document::{SceneBundle, SceneDescription};
use crate::integrator::render_node;
use clerestory_film::{NodeAddress, TileGrid};

/// Edge of the images, pixels.
const EDGE: u32 = 16;

/// Samples of a pixel.
const SAMPLES: u32 = 256;

/// Mean of the red channel, and its standard error.
fn mean(scene: &Value) -> (f64, f64) {
    let description = SceneDescription::parse(scene.to_string().as_bytes()).unwrap();
    let scene = PreparedScene::build(&SceneBundle::from_parts(description, BTreeMap::new()).unwrap()).unwrap();
    let grid = TileGrid { width: EDGE, height: EDGE, tile_size: EDGE };
    let address = NodeAddress { frame: 0, tile: 0, level: 0, index: 0 };
    let rendered = render_node(&scene, &grid, address, &AtomicBool::new(false)).unwrap();
    let sums = &rendered.node.layers().beauty;
    let means: Vec<f64> = sums.iter().map(|sum| f64::from(sum[0]) / f64::from(SAMPLES)).collect();
    let count = means.len() as f64;
    let mean = means.iter().sum::<f64>() / count;
    let variance = means.iter().map(|value| (value - mean) * (value - mean)).sum::<f64>() / (count - 1.0);
    (mean, (variance / count).sqrt())
}

/// A camera that looks straight through two flat panes at a panel of radiance 1.
fn two_panes(gap: f64, at: f64) -> Value {
    let thickness = 0.003;
    let pane = |name: &str, z: f64| {
        json!({
            "name": name, "centre": [0, 0, at + z], "x_axis": [1, 0, 0], "y_axis": [0, 1, 0],
            "width": 0.3, "height": 0.3, "thickness": thickness
        })
    };
    json!({
        "version": 1, "name": "two panes", "film": {"width": EDGE, "height": EDGE},
        "camera": {"orthographic": {
            "position": [0, 0, at - 1.0], "look_at": [0, 0, at], "up": [0, 1, 0], "height": 0.1}},
        "integrator": {"path": {"max_depth": 1000}},
        "sampling": {"samples_per_pass": SAMPLES, "samples_per_block": SAMPLES},
        "panes": [pane("near", 0.0), pane("far", thickness + gap)],
        "lights": [{"rectangle": {
            "name": "panel", "centre": [0, 0, at + 1.0], "edge_u": [0, 2, 0], "edge_v": [2, 0, 0], "radiance": [1, 1, 1]
        }}]
    })
}

#[test]
fn two_panes_let_through_what_fresnel_says_however_near_they_are() {
    let reflected = ((1.52 - 1.0) / (1.52 + 1.0_f64)).powi(2);
    // Over all reflections between the four faces.
    let expected = (1.0 - reflected) / (1.0 + 3.0 * reflected);
    for (gap, at) in [(1e-3, 0.0), (1e-6, 0.0), (1e-9, 1.0), (1e-6, 1e3), (1e-9, 1e3)] {
        let (mean, error) = mean(&two_panes(gap, at));
        assert!(error < 0.002, "{error}");
        assert!((mean - expected).abs() < 4.0 * error, "{gap} m apart at {at} m: {mean} +- {error}, not {expected}");
    }
}

#[test]
fn a_lamp_that_lies_on_the_ceiling_shines_as_one_just_below_it_does() {
    let room = |gap: f64| {
        let square = |z: f64| {
            json!({"inline": {
                "positions": [[-2, -2, z], [2, -2, z], [2, 2, z], [-2, 2, z]], "triangles": [[0, 1, 2], [0, 2, 3]]
            }})
        };
        let mesh = |name: &str, z: f64| json!({"name": name, "material": "plaster", "source": square(z)});
        json!({
            "version": 1, "name": "room", "film": {"width": EDGE, "height": EDGE},
            "camera": {"perspective": {
                "position": [0, -1.5, 1], "look_at": [0, 0, 1.2], "up": [0, 0, 1], "vertical_field_of_view": 120
            }},
            "integrator": {"path": {}},
            "sampling": {"samples_per_pass": SAMPLES, "samples_per_block": SAMPLES},
            "materials": {"plaster": {"diffuse": {"reflectance": {"colour": [0.5, 0.5, 0.5]}}}},
            "meshes": [mesh("floor", 0.0), mesh("ceiling", 2.7)],
            "lights": [{"rectangle": {
                "name": "lamp", "centre": [0.13, 0.21, 2.7 - gap], "edge_u": [0, 1, 0], "edge_v": [1, 0, 0],
                "radiance": [1, 1, 1]
            }}]
        })
    };
    let ((on, _), (below, _)) = (mean(&room(0.0)), mean(&room(1e-6)));
    assert!(below > 0.02 && (on / below - 1.0).abs() < 1e-3, "{on} on the ceiling, {below} below it");
}
