//! The scenes that ship follow the schema and can be built.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use serde_json::Value;

use super::schema::tests::Validator;
use super::{SceneBundle, SceneDescription, load};

/// All JSON files in and below a folder that hold a scene.
fn scene_files(folder: &Path) -> Vec<PathBuf> {
    let mut files = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            files.extend(scene_files(&path));
        } else if path.extension().is_some_and(|extension| extension == "json") {
            files.push(path);
        }
    }
    files.retain(|file| read(file).get("camera").is_some());
    files.sort();
    files
}

pub(super) fn read(file: &Path) -> Value {
    serde_json::from_slice(&fs::read(file).unwrap()).unwrap()
}

pub(super) fn shipped() -> Vec<PathBuf> {
    scene_files(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes"))
}

#[test]
fn shipped_scenes_follow_the_schema() {
    let validator = Validator::new();
    assert!(!shipped().is_empty());
    for file in shipped() {
        assert_eq!(validator.validate(&read(&file)), Ok(()), "{}", file.display());
    }
}

#[test]
fn shipped_scenes_can_be_built() {
    for file in shipped() {
        let bundle = load(&file).unwrap_or_else(|error| panic!("{}: {error}", file.display()));
        bundle.build_scene().unwrap_or_else(|error| panic!("{}: {error}", file.display()));
    }
}

#[test]
fn the_example_of_the_manual_can_be_built() {
    let manual = include_str!("../../../../docs/scene-format.md");
    let (_, rest) = manual.split_once("```json\n").unwrap();
    let (example, _) = rest.split_once("```").unwrap();
    let description = SceneDescription::parse(example.as_bytes()).unwrap();
    let scene = SceneBundle::from_parts(description, BTreeMap::new()).unwrap().build_scene().unwrap();
    assert_eq!(scene.panes().len(), 1);
}
