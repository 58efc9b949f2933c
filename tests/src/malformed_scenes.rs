//! A scene with files of every kind, and what authors of scenes get wrong.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use clerestory_api::ProblemCode::InvalidScene;
use serde_json::{Value, json};

use crate::calls::{BadCall, Call, content_hash, refused};
use crate::exr_files::{picture, with_huge_claim};

/// Pixels across the image.
pub const WIDTH: u32 = 48;

/// Pixels down the image.
pub const HEIGHT: u32 = 32;

/// A PNG file of a few bytes whose header claims 60001 x 60001 pixels of 8-bit grey.
const HUGE_PNG: &[u8] =
    b"\x89PNG\x0d\x0a\x1a\x0a\x00\x00\x00\x0dIHDR\x00\x00\xeaa\x00\x00\xeaa\x08\x00\x00\x00\x00\x81'\x92\x05\
      \x00\x00\x00\x08IDATx\x9c\x03\x00\x00\x00\x00\x01H\x06\x89\xd2";

/// The files of a scene by name.
pub type Files = BTreeMap<&'static str, Vec<u8>>;

/// Writes a scene and its files into a folder, and answers the scene file.
///
/// # Panics
///
/// When the folder cannot be written.
pub fn write_scene(folder: &Path, scene: &Value, files: &Files) -> PathBuf {
    for (name, content) in files {
        std::fs::write(folder.join(name), content).expect("a writable folder");
    }
    let file = folder.join("scene.json");
    std::fs::write(&file, scene.to_string()).expect("a writable folder");
    file
}

/// A scene without a fault: a floor with a texture and a stone on it, under a pane with a measured face.
pub fn sound_scene() -> Value {
    json!({
        "version": 1,
        "name": "stone under glass",
        "film": {"width": WIDTH, "height": HEIGHT},
        "camera": {"orthographic": {"position": [0, 0, 1], "look_at": [0, 0, 0], "up": [0, 1, 0], "height": 0.6}},
        "integrator": {"cone": {}},
        "sampling": {"samples_per_pass": 4, "samples_per_block": 4},
        "materials": {
            "plaster": {"diffuse": {"reflectance": {"texture": {"file": "plaster.exr"}}}},
            "stone": {"diffuse": {"reflectance": {"colour": [0.6, 0.5, 0.4]}}}
        },
        "meshes": [
            {"name": "floor", "material": "plaster", "source": {"ply": {"file": "floor.ply"}}},
            {"name": "stone", "material": "stone", "source": {"inline": {
                "positions": [[-0.1, -0.1, 0.05], [0.1, -0.1, 0.05], [0.1, 0.1, 0.05], [-0.1, 0.1, 0.05]],
                "triangles": [[0, 1, 2], [0, 2, 3]]
            }}}
        ],
        "panes": [{
            "name": "pane", "centre": [0, 0, 1.5], "x_axis": [1, 0, 0], "y_axis": [0, 1, 0],
            "width": 0.3, "height": 0.3, "thickness": 0.002,
            "front": {"height_map": {"file": "front.exr"}},
            "back": {"bump": {"centre": [0, 0], "radius": [0.05, 0.05], "amplitude": 1e-5}}
        }],
        "lights": [
            {"sun": {
                "name": "sun", "direction": [0, 0.2, 1], "angular_radius": 0.267, "radiance": [60000, 56000, 50000]
            }},
            {"sphere": {"name": "lamp", "centre": [0.2, 0.2, 2], "radius": 0.05, "radiance": [90, 80, 70]}}
        ]
    })
}

/// The files that the scene names.
pub fn sound_files() -> Files {
    Files::from([
        ("floor.ply", ply("4", "3 0 1 2\n3 0 2 3\n")),
        ("front.exr", picture(8, 8, &["Y"], 1e-5)),
        ("plaster.exr", picture(4, 4, &["B", "G", "R"], 0.8)),
    ])
}

/// A square with this number of vertices in its header, and these faces.
fn ply(vertices: &str, faces: &str) -> Vec<u8> {
    let count = faces.lines().count();
    let header = format!(
        "ply\nformat ascii 1.0\nelement vertex {vertices}\nproperty float x\nproperty float y\nproperty float z\n\
         property float s\nproperty float t\nelement face {count}\nproperty list uchar int vertex_indices\nend_header\n"
    );
    (header + "-1 -1 0 0 0\n1 -1 0 1 0\n1 1 0 1 1\n-1 1 0 0 1\n" + faces).into_bytes()
}

/// A scene with a fault, and the expected message of `render` and `submit`.
#[derive(Clone, Debug)]
pub struct BadScene {
    /// What is wrong with it.
    pub what: &'static str,
    /// The scene file.
    pub scene: Value,
    /// The files that it names.
    pub files: Files,
    /// The place in the scene file that must be named.
    pub path: &'static str,
    /// What the message must contain: the value that was found, and what would be right.
    pub says: &'static [&'static str],
}

impl BadScene {
    /// The submission of the scene, once its files have been uploaded.
    pub fn submission(&self) -> Value {
        let assets: BTreeMap<&str, String> =
            self.files.iter().map(|(name, content)| (*name, content_hash(content).to_string())).collect();
        json!({"name": self.what, "scene": self.scene, "assets": assets, "samples_per_pixel": 4})
    }

    /// The submission, which the coordinator refuses.
    pub fn call(&self) -> BadCall {
        let field = if self.path == "$" { "scene".to_owned() } else { format!("scene.{}", self.path) };
        BadCall {
            what: self.what,
            uploads: self.files.values().cloned().collect(),
            call: Call::json("/jobs", self.submission().to_string()),
            refusal: refused(422, InvalidScene, field, self.says),
        }
    }
}

/// Scenes of which the scene file alone shows the fault.
pub fn bad_descriptions() -> Vec<BadScene> {
    let with = |what, pointer: &str, value: Value, path, says| {
        let mut scene = sound_scene();
        let (parent, name) = pointer.rsplit_once('/').expect("a JSON pointer");
        match scene.pointer_mut(parent) {
            Some(Value::Object(members)) => drop(members.insert(name.to_owned(), value)),
            Some(Value::Array(elements)) => elements[name.parse::<usize>().expect("an index")] = value,
            other => panic!("{pointer} is nowhere: {other:?}"),
        }
        BadScene { what, scene, files: sound_files(), path, says }
    };
    let without = |what, parent: &str, name: &str, path, says| {
        let mut scene = sound_scene();
        let members = scene.pointer_mut(parent).and_then(Value::as_object_mut).expect("an object");
        members.remove(name).expect("a member");
        BadScene { what, scene, files: sound_files(), path, says }
    };
    let whole = |what, scene, path, says| BadScene { what, scene, files: sound_files(), path, says };
    vec![
        whole("a list instead of a scene", json!([1, 2]), "$", &["found JSON that is no object", "must be an object"]),
        with("a version of the future", "/version", json!(3), "version", &["version 3", "this build reads 1 to 2"]),
        without("no camera", "", "camera", "$", &["missing field `camera`"]),
        without("a pane without a width", "/panes/0", "width", "panes[0]", &["missing field `width`"]),
        with("a misspelt member", "/integrater", json!({}), "integrater", &["`integrater`", "`integrator`", "`panes`"]),
        with(
            "an integrator of another program",
            "/integrator",
            json!({"bdpt": {}}),
            "integrator",
            &["`bdpt`", "`fnee`"],
        ),
        with("words for a number", "/film/width", json!("wide"), "film.width", &["\"wide\"", "expected u32"]),
        with("a negative number of rows", "/film/height", json!(-3), "film.height", &["`-3`", "expected u32"]),
        with("an image without columns", "/film/width", json!(0), "film.width", &["found 0", "1 to 16384"]),
        with("an image of 60001 columns", "/film/width", json!(60_001), "film.width", &["found 60001", "1 to 16384"]),
        with(
            "two coordinates",
            "/panes/0/centre",
            json!([0, 1]),
            "panes[0].centre",
            &["length 2", "array of length 3"],
        ),
        with(
            "nothing for a coordinate",
            "/panes/0/centre/2",
            json!(null),
            "panes[0].centre[2]",
            &["null", "expected f64"],
        ),
        with(
            "up along the line of sight",
            "/camera/orthographic/up",
            json!([0, 0, 1]),
            "camera.orthographic.up",
            &["found [0.0, 0.0, 1.0]", "not parallel"],
        ),
        with(
            "a block that is no node",
            "/sampling/samples_per_block",
            json!(12),
            "sampling.samples_per_block",
            &["found 12", "a power of two times samples_per_pass (4)"],
        ),
        with("an event that no light path has", "/path_filter", json!("D X L"), "path_filter", &["\"D X L\"", "'X'"]),
        with(
            "an unknown material",
            "/meshes/1/material",
            json!("wood"),
            "meshes[1].material",
            &["\"wood\"", "(plaster, stone)"],
        ),
        with(
            "a triangle of a vertex that there is not",
            "/meshes/1/source/inline/triangles/1",
            json!([0, 2, 4]),
            "meshes[1].source.inline.triangles[1]",
            &["found [0, 2, 4]", "below 4"],
        ),
        with(
            "a triangle on a line",
            "/meshes/1/source/inline/triangles/0",
            json!([1, 1, 2]),
            "meshes[1].source.inline.triangles[0]",
            &["found [1, 1, 2]", "not on one line"],
        ),
        with(
            "glass of no thickness",
            "/panes/0/thickness",
            json!(0),
            "panes[0].thickness",
            &["found 0.0", "more than 0"],
        ),
        with(
            "glass thinner than air",
            "/panes/0/index_of_refraction",
            json!(0.9),
            "panes[0].index_of_refraction",
            &["found 0.9", "1 to 3"],
        ),
        with(
            "light that darkens",
            "/lights/1/sphere/radiance/0",
            json!(-0.5),
            "lights[1].sphere.radiance[0]",
            &["found -0.5", "0 to"],
        ),
        with(
            "two lights of one name",
            "/lights/1/sphere/name",
            json!("sun"),
            "lights[1].sphere.name",
            &["\"sun\"", "no earlier one"],
        ),
        with(
            "a file outside the folder of the scene",
            "/meshes/0/source/ply/file",
            json!("../../etc/passwd"),
            "meshes[0].source.ply.file",
            &["../../etc/passwd", "a path relative to the scene file"],
        ),
    ]
}

/// Scenes of which only their files show the fault.
pub fn bad_files() -> Vec<BadScene> {
    const FLOOR: &str = "meshes[0].source.ply.file";
    const FRONT: &str = "panes[0].front.height_map.file";
    const PLASTER: &str = "materials.plaster.diffuse.reflectance.texture.file";
    let with = |what, name, content, path, says| {
        let mut files = sound_files();
        files.insert(name, content);
        BadScene { what, scene: sound_scene(), files, path, says }
    };
    let cut = |mut file: Vec<u8>| {
        file.truncate(file.len() - 5);
        file
    };
    let huge_limit = &["60001 x 60001 pixels", "at most 16384 x 16384 pixels"];
    vec![
        with(
            "a mesh that is none",
            "floor.ply",
            b"solid floor".to_vec(),
            FLOOR,
            &["\"floor.ply\"", "not a readable PLY file"],
        ),
        with(
            "a mesh that claims four thousand million vertices",
            "floor.ply",
            ply("4000000000", "3 0 1 2\n"),
            FLOOR,
            &["claims 4000000000 elements \"vertex\"", "too short to hold"],
        ),
        with(
            "a mesh with a face of a vertex that there is not",
            "floor.ply",
            ply("4", "3 0 1 7\n"),
            FLOOR,
            &["\"3 0 1 7\": face 0 has the vertex 7", "indices below 4"],
        ),
        with(
            "a height map that claims 60001 pixels each way",
            "front.exr",
            with_huge_claim(&picture(8, 8, &["Y"], 0.0)),
            FRONT,
            huge_limit,
        ),
        with(
            "a texture that claims 60001 pixels each way",
            "plaster.exr",
            with_huge_claim(&picture(4, 4, &["B", "G", "R"], 0.5)),
            PLASTER,
            huge_limit,
        ),
        with("a PNG texture that claims 60001 pixels each way", "plaster.exr", HUGE_PNG.to_vec(), PLASTER, huge_limit),
        with(
            "a height map that is cut off",
            "front.exr",
            cut(picture(8, 8, &["Y"], 0.0)),
            FRONT,
            &["\"front.exr\"", "damaged"],
        ),
        with(
            "a height map without heights",
            "front.exr",
            picture(8, 8, &["Z"], 0.0),
            FRONT,
            &["\"front.exr\"", "must have a channel Y or R"],
        ),
        with(
            "a height map of what is no number",
            "front.exr",
            picture(8, 8, &["Y"], f32::NAN),
            FRONT,
            &["height NaN m in column 0 of row 0", "must be -1 to 1 m"],
        ),
        with(
            "a texture that is brighter than white",
            "plaster.exr",
            picture(4, 4, &["B", "G", "R"], 1.5),
            PLASTER,
            &["reflectance [1.5, 1.5, 1.5] in column 0 of row 0", "must be 0 to 1"],
        ),
        with(
            "a height map on which the faces touch",
            "front.exr",
            picture(8, 8, &["Y"], 0.01),
            "panes[0].thickness",
            &["thickness 0.002 metres", "must exceed the depth of the relief"],
        ),
    ]
}
