//! Bodies that meet, in white surroundings: none of them can be seen, whatever looks for the light.

use std::collections::BTreeMap;

use serde_json::{Value, json};

use super::media_tests::{ball, block, clear, pane, vessel};
use super::tests::{EDGE, SAMPLES, mean};
use crate::document::{SceneBundle, SceneDescription};

fn furnace(meshes: &[Value], panes: &[Value], method: &str) -> Value {
    let mut materials = clear();
    materials["white"] = json!({"diffuse": {"reflectance": {"colour": [1, 1, 1]}}});
    // A wall that gathers light behind the things, and a pane beside them that meets nothing.
    let wall = json!({"name": "wall", "material": "white", "source": super::tests::square(0.3, 0.6)});
    let mut beside = pane("beside", 0.45, 40.0);
    beside["front"] = json!("flat");
    let (meshes, panes) = ([meshes, &[wall]].concat(), [panes, &[beside]].concat());
    json!({
        "version": 1, "name": "furnace", "film": {"width": EDGE, "height": EDGE},
        "camera": {"perspective": {
            "position": [0.1, -0.2, -0.6], "look_at": [0, 0, 0.1], "up": [0, 1, 0], "vertical_field_of_view": 40}},
        "integrator": {method: {"max_depth": 1000}},
        "sampling": {"samples_per_pass": SAMPLES, "samples_per_block": SAMPLES},
        "materials": materials,
        "meshes": meshes,
        "panes": panes,
        "lights": [{"environment": {"name": "sky", "radiance": {"colour": [1, 1, 1]}}}]
    })
}

/// The names of the bodies that meet others.
fn immersed(scene: &Value) -> String {
    let description = SceneDescription::parse(scene.to_string().as_bytes()).unwrap();
    let scene = SceneBundle::from_parts(description, BTreeMap::new()).unwrap().build_scene().unwrap();
    scene.immersed_names(9).unwrap_or_default()
}

#[test]
fn bodies_that_meet_cannot_be_seen_in_a_white_furnace() {
    let water = || block("water", "water", 0.2, [-0.1, 0.1]);
    let wide = |name: &str, z: f64| pane(name, z, 40.0);
    // Only parallel faces: what a wedge sends along a pane is lost at its black edge.
    let sea = block("sea", "water", 20.0, [-0.1, 0.1]);
    let hidden = block("syrup", "syrup", 0.2, [-0.1, 0.1]);
    let scenes: [(&str, Vec<Value>, Vec<Value>); 8] = [
        ("touching panes", vec![], vec![wide("one", 0.0), wide("two", 0.003), wide("three", 0.006)]),
        ("overlapping panes", vec![], vec![wide("one", 0.0), wide("two", 0.002), wide("three", 0.0045)]),
        ("a pane half in water", vec![sea], vec![wide("pane", 0.0985)]),
        ("a pane with its edge in what goes before it", vec![hidden], vec![pane("pane", 0.0, 0.1)]),
        ("a ball on a pane", vec![ball("ball", "glass", [0.0, 0.0], 0.1, 0.003, 8)], vec![wide("pane", 0.0)]),
        ("a block on a pane", vec![block("block", "glass", 0.1, [0.003, 0.1])], vec![wide("pane", 0.0)]),
        (
            "balls in water",
            vec![
                water(),
                ball("ball", "glass", [0.03, 0.02], 0.07, -0.05, 8),
                ball("bubble", "air", [0.03, 0.05], 0.03, -0.03, 8),
                ball("half out", "glass", [0.0, -0.05], 0.06, 0.05, 8),
            ],
            vec![],
        ),
        (
            "a bottle of water",
            vec![
                vessel("bottle", "glass", [(0.12, [-0.06, 0.06]), (0.1, [-0.05, 0.05])]),
                block("liquid", "water", 0.105, [-0.055, 0.02]),
            ],
            vec![],
        ),
    ];
    for (what, meshes, panes) in scenes {
        let names = immersed(&furnace(&meshes, &panes, "path"));
        let all = [&meshes[..], &panes].concat();
        assert!(all.iter().all(|body| names.contains(&body["name"].to_string())), "{what}: only {names} meet others");
        let is_asked = ["touching panes", "a ball on a pane", "balls in water"].contains(&what);
        let methods: &[&str] = if is_asked { &["path", "auto", "cone", "fnee"] } else { &["path"] };
        for method in methods {
            let (mean, error) = mean(&furnace(&meshes, &panes, method));
            assert!(error < 0.005, "{what}, {method}: no power, +- {error}");
            assert!((mean - 1.0).abs() < 4.0 * error + 1e-5, "{what}, {method}: {mean} +- {error}");
        }
    }
}
