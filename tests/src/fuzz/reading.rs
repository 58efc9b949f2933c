//! What a command does with the files of a user before it renders: reading, counting and building.

use std::fs;
use std::path::Path;

use clerestory_render_core::document::{ModelOptions, SceneBundle, SceneDescription, is_model, scene_around};
use clerestory_render_core::integrator::PreparedScene;
use clerestory_render_core::scene::import::GlazeRule;
use clerestory_render_core::scene::{Asset, Assets};
use serde_json::{Value, json};

use super::Case;

/// Memory that a scene of a case may take, bytes. Those that take more are refused, as on a machine with less.
const MEMORY: u64 = 256 << 20;

/// Reads the files of a case. What a command would say is an error.
///
/// # Errors
///
/// When the files are refused.
///
/// # Panics
///
/// When the folder cannot be written, and where a reader has a fault.
pub fn read(case: &Case, folder: &Path) -> Result<(), String> {
    let path = folder.join(&case.main);
    let bundle = if is_model(&path) {
        for (name, bytes) in &case.files {
            fs::write(folder.join(name), bytes).expect("a folder that can be written");
        }
        // Panes of what looks like windows, so that the rules of glazing see the corners.
        let options = ModelOptions { glaze: vec![GlazeRule::flat("Win*")], ..ModelOptions::default() };
        let model = scene_around(&path, &options);
        case.files.keys().for_each(|name| fs::remove_file(folder.join(name)).expect("a file of ours"));
        model.map_err(|error| error.to_string())?.bundle
    } else {
        around(case)?
    };
    let memory = bundle.memory().map_err(|error| error.to_string())?;
    memory.check(MEMORY, "a larger machine").map_err(|error| error.to_string())?;
    PreparedScene::build(&bundle).map(drop).map_err(|error| error.to_string())
}

/// A scene that names the file.
fn around(case: &Case) -> Result<SceneBundle, String> {
    let name = &case.main;
    let description = SceneDescription::parse(scene(name).to_string().as_bytes()).expect("a scene of ours");
    let assets: Assets = case.files.iter().map(|(name, bytes)| (name.clone(), Asset::new(bytes.clone()))).collect();
    SceneBundle::from_parts(description, assets).map_err(|error| error.to_string())
}

/// A scene that uses a file for all that it may be: a mesh, an environment, colours, a relief.
fn scene(file: &str) -> Value {
    let wall = json!({"name": "wall", "material": "white", "source": {"inline": {
        "positions": [[-1, -1, 0], [1, -1, 0], [1, 1, 0]], "triangles": [[0, 1, 2]],
        "texture_coordinates": [[0, 0], [1, 0], [1, 1]]
    }}});
    let mut scene = json!({
        "version": 2,
        "name": "file",
        "film": {"width": 8, "height": 8},
        "camera": {"perspective": {
            "position": [0, 0, 3], "look_at": [0, 0, 0], "up": [0, 1, 0], "vertical_field_of_view": 60
        }},
        "integrator": "path",
        "materials": {"white": {"diffuse": {"reflectance": {"colour": [0.8, 0.8, 0.8]}}}},
        "meshes": [wall],
        "lights": [{"point": {"name": "lamp", "position": [1, 1, 2], "intensity": [5, 5, 5]}}]
    });
    let ending = file.rsplit('.').next().unwrap_or_default();
    if ending == "ply" {
        scene["meshes"][0]["source"] = json!({"ply": {"file": file}});
    }
    if file.starts_with("relief") {
        scene["panes"] = json!([{
            "name": "pane", "centre": [0, 0, 1], "x_axis": [1, 0, 0], "y_axis": [0, 1, 0], "width": 0.1, "height": 0.1,
            "thickness": 1.0, "front": {"height_map": {"file": file}}
        }]);
        return scene;
    }
    if ["png", "jpg", "webp", "exr"].contains(&ending) {
        scene["materials"]["white"]["diffuse"]["reflectance"] = json!({"texture": {"file": file}});
    }
    if ["hdr", "exr"].contains(&ending) {
        scene["lights"] = json!([{"environment": {"name": "sky", "radiance": {"picture": {"file": file}}}}]);
    }
    scene
}
