//! A room with one window, whose glass is one pane or is cut into many, under an even sky.

use std::collections::BTreeMap;

use clerestory_render_core::document::{SceneBundle, SceneDescription};
use clerestory_render_core::integrator::PreparedScene;
use serde_json::{Value, json};

/// Edge of the picture, pixels.
pub const EDGE: u32 = 32;

/// Size of the room, metres: from wall to wall, along the wall with the window, and high.
const ROOM: [f64; 3] = [5.0, 4.0, 3.0];

/// The window: along the wall, and up.
const WINDOW: [[f64; 2]; 2] = [[1.0, 3.0], [0.9, 2.4]];

/// The room with its glass cut into `columns` by `rows` panes. `samples` are those of a pass.
///
/// # Panics
///
/// When the scene is not valid.
pub fn daylit_room([columns, rows]: [u32; 2], integrator: &str, samples: u32, seed: u64) -> PreparedScene {
    let [x, y, z] = ROOM;
    let [[left, right], [low, high]] = WINDOW;
    let walls = [
        ("floor", [[0.0, 0.0, 0.0], [x, 0.0, 0.0], [x, y, 0.0], [0.0, y, 0.0]]),
        ("ceiling", [[0.0, 0.0, z], [0.0, y, z], [x, y, z], [x, 0.0, z]]),
        ("back", [[x, 0.0, 0.0], [x, 0.0, z], [x, y, z], [x, y, 0.0]]),
        ("side", [[0.0, 0.0, 0.0], [0.0, 0.0, z], [x, 0.0, z], [x, 0.0, 0.0]]),
        ("other side", [[0.0, y, 0.0], [x, y, 0.0], [x, y, z], [0.0, y, z]]),
        ("beside the window", [[0.0, 0.0, 0.0], [0.0, left, 0.0], [0.0, left, z], [0.0, 0.0, z]]),
        ("behind the window", [[0.0, right, 0.0], [0.0, y, 0.0], [0.0, y, z], [0.0, right, z]]),
        ("below the window", [[0.0, left, 0.0], [0.0, right, 0.0], [0.0, right, low], [0.0, left, low]]),
        ("above the window", [[0.0, left, high], [0.0, right, high], [0.0, right, z], [0.0, left, z]]),
    ];
    let mesh = |(name, positions): (&str, [[f64; 3]; 4])| {
        json!({"name": name, "material": "plaster", "source": {"inline": {
            "positions": positions, "triangles": [[0, 1, 2], [0, 2, 3]]}}})
    };
    let [width, height] = [(right - left) / f64::from(columns), (high - low) / f64::from(rows)];
    let pane = |number: u32| {
        let (column, row) = (number % columns, number / columns);
        let centre = [0.0, left + width * (f64::from(column) + 0.5), low + height * (f64::from(row) + 0.5)];
        json!({
            "name": format!("pane {number}"), "centre": centre, "x_axis": [0, 1, 0], "y_axis": [0, 0, 1],
            "width": width, "height": height, "thickness": 0.002, "index_of_refraction": 1.52
        })
    };
    let panes: Vec<Value> = (0..columns * rows).map(pane).collect();
    let scene = json!({
        "version": 2, "name": "A room in daylight", "seed": seed, "film": {"width": EDGE, "height": EDGE},
        "camera": {"perspective": {
            "position": [4.6, 3.6, 1.6], "look_at": [0.5, 0.8, 0.9], "up": [0, 0, 1], "vertical_field_of_view": 55
        }},
        "integrator": {integrator: {"max_depth": 8}},
        "sampling": {"samples_per_pass": samples, "samples_per_block": samples},
        "materials": {"plaster": {"diffuse": {"reflectance": {"colour": [0.7, 0.7, 0.7]}}}},
        "meshes": walls.map(mesh), "panes": panes,
        "lights": [{"environment": {"name": "sky", "radiance": {"colour": [1, 1, 1]}}}]
    });
    let description = SceneDescription::parse(scene.to_string().as_bytes()).expect("a valid scene");
    let bundle = SceneBundle::from_parts(description, BTreeMap::new()).expect("a complete scene");
    PreparedScene::build(&bundle).expect("a scene that can be built")
}
