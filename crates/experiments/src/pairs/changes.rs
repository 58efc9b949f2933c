//! Scenes that differ from those that ship in glass or light.

use std::collections::BTreeMap;

use clerestory_render_core::document::chapel;
use clerestory_render_core::document::{Override, OverrideError, SceneBundle, SceneDescription, apply};
use clerestory_render_core::integrator::PreparedScene;
use clerestory_render_core::scene::Asset;
use clerestory_render_core::scene::SceneError;
use serde_json::{Value, json};

use super::SIZE;
use crate::error::ExperimentError;
use crate::scenes::EmbeddedScene;

/// What a pair changes in a scene.
#[derive(Clone, Copy, Debug)]
pub(super) enum Change {
    /// Another value of a member, as `--set` takes it.
    Set(&'static str),
    /// One more pane.
    AddPane(&'static str),
    /// One more light.
    AddLight(&'static str),
    /// Another relief on one face of all panes that have one, and on the leaded pieces of windows.
    Relief(&'static str),
    /// All glass is taken out; lead and stone stay.
    NoPanes,
}

/// Kinds of glass that windows name and do not describe.
const HISTORICAL: [&str; 7] = ["potash", "cobalt", "ruby", "green", "murrey", "amber", "silver_stain"];

/// Width and height of a sheet of glass with another relief, metres.
const SHEET: f64 = 0.4;

/// A scene that is part of the program, with changes.
pub(super) fn embedded(scene: &EmbeddedScene, changes: &[Change]) -> Result<SceneBundle, ExperimentError> {
    changed(scene.bundle(SIZE)?, scene.name, changes)
}

/// The chapel, with changes.
pub(super) fn chapel(changes: &[Change]) -> Result<SceneBundle, ExperimentError> {
    let chapel = chapel::chapel().map_err(|error| ExperimentError::Picture(error.into()))?;
    let assets = chapel.files.into_iter().map(|(name, bytes)| (name, Asset::new(bytes))).collect();
    let bundle = SceneBundle::from_parts(chapel.scene, assets);
    changed(bundle.map_err(|source| ExperimentError::scene("chapel".as_ref(), source))?, "chapel", changes)
}

/// A table under a lamp with things of glass on it, with changes.
pub(super) fn of_glassware(things: &[Value], changes: &[Change]) -> Result<SceneBundle, ExperimentError> {
    let floor = json!({"name": "table", "material": "plaster", "source": {"inline": {
        "positions": [[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], "triangles": [[0, 1, 2], [0, 2, 3]]}}});
    let meshes: Vec<&Value> = std::iter::once(&floor).chain(things).collect();
    let scene = json!({
        "version": 2,
        "name": "Glass on a table",
        "film": {"width": SIZE[0], "height": SIZE[1]},
        "camera": {"perspective": {"position": [-0.35, -0.75, 0.75], "look_at": [-0.08, 0.05, 0.02],
            "up": [0, 0, 1], "vertical_field_of_view": 32}},
        "integrator": {"sms": {"chains": ["TT"]}},
        "materials": {
            "plaster": {"diffuse": {"reflectance": {"colour": [0.8, 0.8, 0.8]}}},
            "glass": {"dielectric": {"index_of_refraction": 1.5}},
        },
        "meshes": meshes,
        "lights": [{"sphere": {"name": "lamp", "centre": [0.35, -0.3, 1.6], "radius": 0.03,
            "radiance": [500, 450, 380]}}],
    });
    let name = "glass on a table";
    let bundle = SceneDescription::parse(scene.to_string().as_bytes())
        .and_then(|description| SceneBundle::from_parts(description, BTreeMap::new()))
        .map_err(|source| ExperimentError::scene(name.as_ref(), source))?;
    changed(bundle, name, changes)
}

fn changed(bundle: SceneBundle, name: &str, changes: &[Change]) -> Result<SceneBundle, ExperimentError> {
    let failure = |source: SceneError| ExperimentError::scene(name.as_ref(), source);
    let mut bundle = bundle;
    for change in changes {
        let description = match change {
            Change::Set(text) => {
                set(text, bundle.description()).map_err(|error| ExperimentError::Override(Box::new(error)))?
            }
            Change::AddPane(text) => appended(bundle.description(), "panes", text).map_err(failure)?,
            Change::AddLight(text) => appended(bundle.description(), "lights", text).map_err(failure)?,
            Change::Relief(text) => with_relief(bundle.description(), text).map_err(failure)?,
            Change::NoPanes => without_panes(&bundle).map_err(failure)?,
        };
        bundle = bundle.with_description(description).map_err(failure)?;
    }
    Ok(bundle)
}

fn set(text: &str, description: &SceneDescription) -> Result<SceneDescription, OverrideError> {
    apply(&[text.parse::<Override>()?], description)
}

fn appended(description: &SceneDescription, list: &str, text: &str) -> Result<SceneDescription, SceneError> {
    edited(description, |scene| match scene.get_mut(list).and_then(Value::as_array_mut) {
        Some(list) => list.push(constant(text)),
        None => scene[list] = Value::Array(vec![constant(text)]),
    })
}

fn with_relief(description: &SceneDescription, text: &str) -> Result<SceneDescription, SceneError> {
    let relief = constant(text);
    edited(description, |scene| {
        for pane in elements(scene, "panes") {
            let seed = pane
                .get("front")
                .and_then(Value::as_object)
                .and_then(|front| front.values().next()?.get("seed").cloned());
            pane["front"] = seeded(&relief, seed);
            pane["back"] = json!("flat");
        }
        for window in elements(scene, "windows") {
            let sheet = json!({"own": {"width": SHEET, "height": SHEET, "front": relief}});
            let described = window.get("glass").and_then(Value::as_object).filter(|glass| !glass.is_empty()).cloned();
            let kinds = described.unwrap_or_else(|| {
                HISTORICAL.iter().map(|name| ((*name).to_owned(), json!({"colour": name}))).collect()
            });
            for (name, mut kind) in kinds {
                kind["sheet"] = sheet.clone();
                window["glass"][name] = kind;
            }
        }
    })
}

/// A profile with the seed of another one, so that panes differ.
fn seeded(relief: &Value, seed: Option<Value>) -> Value {
    let mut relief = relief.clone();
    let settings = relief.as_object_mut().and_then(|choice| choice.values_mut().next()?.as_object_mut());
    if let (Some(settings), Some(seed)) = (settings, seed) {
        settings.insert("seed".to_owned(), seed);
    }
    relief
}

/// The scene with its windows as panes and meshes, and then without panes.
fn without_panes(bundle: &SceneBundle) -> Result<SceneDescription, SceneError> {
    let description = bundle.description();
    let mut bare = if description.windows.is_empty() {
        description.clone()
    } else {
        PreparedScene::build(bundle)?.description().clone()
    };
    bare.panes.clear();
    bare.sheets.clear();
    Ok(bare)
}

/// The elements of a list of the scene.
fn elements<'a>(scene: &'a mut Value, list: &str) -> impl Iterator<Item = &'a mut Value> {
    scene.get_mut(list).and_then(Value::as_array_mut).into_iter().flatten()
}

fn edited(description: &SceneDescription, edit: impl FnOnce(&mut Value)) -> Result<SceneDescription, SceneError> {
    let mut scene = serde_json::to_value(description).expect("every member of a scene has a form in JSON");
    edit(&mut scene);
    SceneDescription::parse(scene.to_string().as_bytes())
}

/// JSON of this program.
fn constant(text: &str) -> Value {
    serde_json::from_str(text).expect("the program's own JSON is valid")
}
