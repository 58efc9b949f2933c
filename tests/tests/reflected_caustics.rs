//! The light that the outside of a pane reflects: `fnee` in two unknowns, `sms` over one vertex, and the path tracer, which finds
//! it by chance.

use std::collections::BTreeMap;

use clerestory_render_core::scene::{Scene, SceneBundle, SceneDescription};
use clerestory_tests::estimate::check_agreement;
use clerestory_tests::rendering::block_means;
use serde_json::{Value, json};

/// Parts of the picture along each edge.
const BLOCKS: usize = 4;

/// A floor seen from above, 0.4 m wide, in a picture of 8 x 8 pixels, below a pane that a lamp on the floor's side lights.
fn scene(light: &Value, integrator: Value) -> Scene {
    let description = json!({
        "version": 1, "name": "reflected caustic", "seed": 3,
        "film": {"width": 8, "height": 8},
        "camera": {"orthographic": {"position": [0, 0, -0.9], "look_at": [0, 0, -1], "up": [0, 1, 0], "height": 0.4}},
        "integrator": integrator,
        "path_filter": "D R L",
        "materials": {"floor": {"diffuse": {"reflectance": {"colour": [0.5, 0.5, 0.5]}}}},
        "meshes": [{"name": "floor", "material": "floor", "source": {"inline": {
            "positions": [[-0.25, -0.25, -1], [0.25, -0.25, -1], [0.25, 0.25, -1], [-0.25, 0.25, -1]], "triangles": [[0, 1, 2], [0, 2, 3]]}}}],
        "panes": [{"name": "pane", "centre": [0.5, 0, 0], "x_axis": [1, 0, 0], "y_axis": [0, 1, 0],
            "width": 0.8, "height": 0.6, "thickness": 0.003,
            "front": {"crown": {"centre": [0.3, 0.4], "wavelength": 0.1, "amplitude": 2e-4}},
            "back": {"hammered": {"wavelength": 0.05, "amplitude": 1e-4}}}],
        "lights": [light],
    });
    let description = SceneDescription::parse(description.to_string().as_bytes()).expect("a valid scene");
    let bundle = SceneBundle::from_parts(description, BTreeMap::new()).expect("no assets are missing");
    Scene::build(&bundle).expect("a scene that can be built")
}

#[test]
fn light_off_a_pane_is_what_the_path_tracer_finds() {
    let panel = json!({"rectangle": {"name": "panel", "centre": [0.7, 0.1, -0.7], "edge_u": [0.36, 0, 0.48], "edge_v": [0, 1.2, 0],
        "radiance": [9, 9, 9]}});
    // From below, past the floor.
    let sun = json!({"sun": {"name": "sun", "direction": [0.5, 0.1, -1], "angular_radius": 15, "radiance": [9, 9, 9]}});
    for (name, light) in [("panel", panel), ("sun", sun)] {
        let chance = block_means(&scene(&light, json!({"path": {}})), 6000, BLOCKS);
        for (method, integrator) in
            [("fnee", json!({"fnee": {"reflected": true}})), ("sms", json!({"sms": {"chains": ["R"]}}))]
        {
            let ours = block_means(&scene(&light, integrator), 100, BLOCKS);
            check_agreement(&format!("{name}, {method}"), &ours, &chance, 0.12);
        }
    }
}
