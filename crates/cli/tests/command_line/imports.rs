//! Files of other programs: what the commands say of them, and what images and jobs keep of it.

use std::fs;

use clerestory_film::{DecodeBudget, FrameImage, ImageMetadata};
use serde_json::{Value, json};

use crate::support::Folder;

/// A folder with `hall.gltf`: a wall and a window before a camera, and an extension that no program knows.
fn folder() -> Folder {
    let folder = Folder::new();
    let corners: [f32; 12] = [-1.0, -1.0, 0.0, 1.0, -1.0, 0.0, 1.0, 1.0, 0.0, -1.0, 1.0, 0.0];
    let mut bytes: Vec<u8> = corners.iter().flat_map(|value| value.to_le_bytes()).collect();
    bytes.extend([0, 1, 2, 0, 2, 3]);
    fs::write(folder.path("hall.bin"), &bytes).unwrap();
    let hall = json!({
        "asset": {"version": "2.0"},
        "extensionsUsed": ["ACME_moss"],
        "buffers": [{"uri": "hall.bin", "byteLength": 54}],
        "bufferViews": [
            {"buffer": 0, "byteLength": 48}, {"buffer": 0, "byteOffset": 48, "byteLength": 6}
        ],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "min": [-1, -1, 0], "max": [1, 1, 0]},
            {"bufferView": 1, "componentType": 5121, "count": 6, "type": "SCALAR"}
        ],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "cameras": [{"type": "perspective", "perspective": {"yfov": 0.8, "aspectRatio": 1.5}}],
        "nodes": [
            {"name": "Wall", "mesh": 0, "scale": [4, 4, 4], "translation": [0, 0, -3]},
            {"name": "Window", "mesh": 0},
            {"name": "Eye", "camera": 0, "translation": [0, 0, 3]}
        ],
        "scenes": [{"nodes": [0, 1, 2]}],
        "scene": 0
    });
    fs::write(folder.path("hall.gltf"), hall.to_string()).unwrap();
    folder
}

/// What is assumed for the file, and what is left out of it.
const ASSUMED: [&str; 2] = ["\"Window\" look like windows", "The file has no lamp and no sun"];
const LEFT_OUT: &str = "hall.gltf: the extension ACME_moss is left out";

const QUICK: [&str; 4] = ["--size", "8x8", "--spp", "4"];

fn metadata(folder: &Folder, image: &str) -> ImageMetadata {
    let bytes = fs::read(folder.path(image)).unwrap();
    let image = FrameImage::decode(&bytes, DecodeBudget { pixel_bytes: 1 << 20 }).unwrap();
    image.metadata().unwrap().clone()
}

/// Runs a command that succeeds, and returns what it says.
#[track_caller]
fn messages(folder: &Folder, words: &[&str]) -> String {
    let output = folder.run(words);
    let messages = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success(), "{messages}");
    messages
}

#[test]
fn a_render_of_a_building_says_what_it_assumes_and_leaves_out_and_so_does_its_image() {
    let folder = folder();
    let said = messages(&folder, &[&["render", "hall.gltf", "-o", "hall.exr"], &QUICK[..]].concat());
    for line in ASSUMED.iter().chain([&LEFT_OUT]) {
        assert_eq!(said.matches(line).count(), 1, "{line}: {said}");
    }
    let ImageMetadata { import_notes, assumptions, .. } = metadata(&folder, "hall.exr");
    assert!(import_notes == [LEFT_OUT] && assumptions.len() == 2 && assumptions[1].starts_with(ASSUMED[1]));

    let again = messages(&folder, &["render", "hall.gltf", "--like", "hall.exr", "-o", "again.exr"]);
    assert!(again.contains(LEFT_OUT), "{again}");
    assert_eq!(folder.comparison("hall.exr", "again.exr")["bit_identical"], true);

    // A scene file holds what was assumed, and its imports are read again.
    folder.succeeds(&["import", "hall.gltf", "--glaze", "Window=crown"]);
    let said = messages(&folder, &[&["render", "hall.json", "-o", "scene.exr"], &QUICK[..]].concat());
    assert!(said.contains(LEFT_OUT) && !said.contains("no lamp"), "{said}");
    let ImageMetadata { import_notes, assumptions, .. } = metadata(&folder, "scene.exr");
    assert_eq!((import_notes, assumptions), (vec![LEFT_OUT.to_owned()], Vec::new()));
}

#[test]
fn a_farm_keeps_what_was_assumed_for_a_building_and_left_out_of_it() {
    let folder = folder();
    let farm = folder.farm();
    let words = ["submit", "hall.gltf", "--wait", "--json", "-o", "farm.exr", "--coordinator", farm.address()];
    let output = folder.run(&[&words, &QUICK[..]].concat());
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success(), "{said}");
    for line in ASSUMED.iter().chain([&LEFT_OUT]) {
        assert_eq!(said.matches(line).count(), 1, "{line}: {said}");
    }
    let job: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(job["import_notes"], json!([LEFT_OUT]));
    assert!(job["assumptions"][1].as_str().unwrap().starts_with(ASSUMED[1]), "{job}");
    let ImageMetadata { import_notes, assumptions, .. } = metadata(&folder, "farm.exr");
    assert_eq!((import_notes.len(), assumptions.len()), (1, 2));

    let watched = messages(&folder, &["watch", job["id"].as_str().unwrap(), "--coordinator", farm.address()]);
    assert!(watched.contains(LEFT_OUT) && watched.contains(ASSUMED[1]), "{watched}");
}

#[test]
fn an_obj_file_has_the_pictures_of_its_library_and_does_without_those_that_are_not_there() {
    let folder = Folder::new();
    // The picture that render writes is any PNG.
    folder.succeeds(&["render", "scene.json", "--spp", "4", "--png", "-o", "paint.exr"]);
    let wall = "mtllib wall.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nusemtl a\nf 1/1 2/2 3/3\nusemtl b\n\
                f 1/1 3/3 2/2\n";
    fs::write(folder.path("wall.obj"), wall).unwrap();
    fs::write(folder.path("wall.mtl"), "newmtl a\nmap_Kd paint.png\nnewmtl b\nmap_Kd gone.png\n").unwrap();
    let report = folder.succeeds(&["import", "wall.obj"]);
    assert!(report.contains("2 meshes of 2 triangles") && report.contains("the picture gone.png of material b"));
    let scene: Value = serde_json::from_slice(&fs::read(folder.path("wall.json")).unwrap()).unwrap();
    assert_eq!(scene["imports"][0]["source"]["obj"]["files"], json!(["wall.mtl", "paint.png"]));
    folder.succeeds(&[&["render", "wall.json", "-o", "wall.exr"], &QUICK[..]].concat());
}
