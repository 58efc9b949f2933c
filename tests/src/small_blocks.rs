//! A scene with small passes and blocks, so that rounds, standard errors and shares come soon.

use std::fs;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};

/// The caustic of a crown pane in a folder with its files, with 4 samples in a pass and 16 in a block.
///
/// # Panics
///
/// When it cannot be written.
pub fn crown_sphere(folder: &Path) -> PathBuf {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes/references");
    let text = fs::read_to_string(source.join("crown-sphere.json")).expect("a scene that ships");
    let mut description: Value = serde_json::from_str(&text).expect("JSON");
    description["sampling"] = json!({"samples_per_pass": 4, "samples_per_block": 16});
    fs::create_dir(folder.join("heights")).expect("a writable folder");
    for face in ["heights/crown-front.exr", "heights/crown-back.exr"] {
        fs::copy(source.join(face), folder.join(face)).expect("a face that ships");
    }
    let scene = folder.join("crown-sphere.json");
    fs::write(&scene, description.to_string()).expect("a writable folder");
    scene
}
