//! The scene file: the type that its JSON is read into.

use std::collections::BTreeMap;
use std::fmt;
use std::marker::PhantomData;

use schemars::JsonSchema;
use serde::de::{Error as _, MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize};
use serde_json::Value;

use super::daylight_description::{DaylightDescription, MomentDescription, SiteDescription};
use crate::bsdf::MaterialDescription;
use crate::light::LightDescription;
use crate::scene::SceneParts;
use crate::scene::description::{
    CameraDescription, FilmDescription, MeshDescription, PaneDescription, SheetDescription,
};
use crate::scene::import::ImportDescription;
use crate::scene::window::WindowDescription;
use crate::specular::registry::IntegratorDescription;

/// A scene: geometry, materials, panes, lights, camera, integrator settings and seed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SceneDescription {
    /// Version of the format: 2, or 1 for scenes whose hash is to be that of earlier builds.
    #[schemars(range(min = 1, max = 2))]
    pub version: u32,
    /// A short name, shown in lists; at most 200 bytes.
    #[schemars(length(min = 1, max = 200))]
    pub name: String,
    /// Seed of every random number.
    #[serde(default)]
    pub seed: u64,
    /// Size of the image.
    pub film: FilmDescription,
    /// The camera.
    pub camera: CameraDescription,
    /// The integrator and its settings, or its name alone.
    #[serde(default, deserialize_with = "IntegratorDescription::or_name")]
    #[schemars(schema_with = "IntegratorDescription::schema_or_name")]
    pub integrator: IntegratorDescription,
    /// Light path expression over D (diffuse), R (specular reflection), T (specular transmission) and L (light), from
    /// the camera to the light, for instance `D TT L`: only matching paths are rendered. Default: all paths.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub path_filter: Option<String>,
    /// How samples are grouped.
    #[serde(default)]
    pub sampling: SamplingDescription,
    /// Materials by name.
    #[serde(default, deserialize_with = "materials_with_unique_names")]
    pub materials: BTreeMap<String, MaterialDescription>,
    /// Triangle meshes.
    #[serde(default)]
    pub meshes: Vec<MeshDescription>,
    /// Files of other programs, whose meshes, materials and lights are in the scene.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub imports: Vec<ImportDescription>,
    /// Leaded windows, whose panes, lead, iron and stone are in the scene.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schemars(length(max = 1024))]
    pub windows: Vec<WindowDescription>,
    /// Sheets of glass by name, from which panes are cut.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty", deserialize_with = "sheets_with_unique_names")]
    pub sheets: BTreeMap<String, SheetDescription>,
    /// Window panes, at most 131072.
    #[serde(default)]
    #[schemars(length(max = 131_072))]
    pub panes: Vec<PaneDescription>,
    /// Lights, at most 4096.
    #[serde(default)]
    #[schemars(length(max = 4096))]
    pub lights: Vec<LightDescription>,
    /// Where the scene is on earth.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub site: Option<SiteDescription>,
    /// When the scene is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub moment: Option<MomentDescription>,
    /// The light of the sun and of the sky there and then, as two more lights: `sun` and `sky`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub daylight: Option<DaylightDescription>,
    /// Frames, at most 65536: how each differs from the scene. Without any, there is one frame: the scene as it is.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schemars(length(max = 65_536))]
    pub timeline: Vec<FrameDescription>,
}

/// How a frame differs from the scene.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FrameDescription {
    /// A short name, such as an hour, shown in lists; at most 200 bytes.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    #[schemars(length(max = 200))]
    pub name: String,
    /// Other values for members of the scene, by their paths: `lights[sun].direction`, `panes[*].thickness`.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty", deserialize_with = "changes_with_unique_paths")]
    pub set: BTreeMap<String, Value>,
}

/// How samples are grouped. Both numbers decide the order of summation and so the last bits of the image.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SamplingDescription {
    /// Samples per pixel in a pass, 1 to 65536.
    #[schemars(range(min = 1, max = 65_536))]
    pub samples_per_pass: u32,
    /// Samples per pixel that share one scramble of the low-discrepancy sequence: a power of two times
    /// `samples_per_pass`, at most 65536. The standard error is estimated from the means of such blocks.
    #[schemars(range(min = 1, max = 65_536))]
    pub samples_per_block: u32,
}

impl Default for SamplingDescription {
    fn default() -> Self {
        Self { samples_per_pass: 16, samples_per_block: 256 }
    }
}

impl SceneDescription {
    /// The things of the scene, without what says how they are rendered.
    pub fn parts(&self) -> SceneParts<'_> {
        SceneParts {
            camera: &self.camera,
            film: self.film,
            materials: &self.materials,
            meshes: &self.meshes,
            imports: &self.imports,
            windows: &self.windows,
            sheets: &self.sheets,
            panes: &self.panes,
            lights: &self.lights,
        }
    }
}

fn materials_with_unique_names<'de, D: Deserializer<'de>>(
    deserializer: D,
) -> Result<BTreeMap<String, MaterialDescription>, D::Error> {
    deserializer.deserialize_map(ByName { thing: "material", things: PhantomData })
}

fn sheets_with_unique_names<'de, D: Deserializer<'de>>(
    deserializer: D,
) -> Result<BTreeMap<String, SheetDescription>, D::Error> {
    deserializer.deserialize_map(ByName { thing: "sheet", things: PhantomData })
}

fn changes_with_unique_paths<'de, D: Deserializer<'de>>(deserializer: D) -> Result<BTreeMap<String, Value>, D::Error> {
    deserializer.deserialize_map(ByName { thing: "change", things: PhantomData })
}

/// Reads a map of things by name. A name that stands there twice is an error; a plain map would keep the last.
struct ByName<T> {
    thing: &'static str,
    things: PhantomData<T>,
}

impl<'de, T: Deserialize<'de>> Visitor<'de> for ByName<T> {
    type Value = BTreeMap<String, T>;

    fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "an object of {}s by name", self.thing)
    }

    fn visit_map<A: MapAccess<'de>>(self, mut members: A) -> Result<Self::Value, A::Error> {
        let mut things = BTreeMap::new();
        while let Some((name, thing)) = members.next_entry()? {
            if things.contains_key(&name) {
                return Err(A::Error::custom(format_args!("duplicate {} `{name}`", self.thing)));
            }
            things.insert(name, thing);
        }
        Ok(things)
    }
}
