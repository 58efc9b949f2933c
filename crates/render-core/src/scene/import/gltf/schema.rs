//! The JSON of a glTF file as types: the members that are read. Other members are ignored, as glTF demands.

use std::borrow::Cow;
use std::collections::BTreeMap;

use serde::Deserialize;
use serde::de::IgnoredAny;
use serde_json::{Map, Value};

use super::fault::fault;
use super::list::List;
use crate::settings::AssetProblem;

/// Extensions of an object, by their names.
pub(super) type Extensions = Map<String, Value>;

/// The whole file.
#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct Document<'a> {
    pub(super) extensions_used: List<String>,
    pub(super) extensions_required: List<String>,
    pub(super) accessors: List<Accessor>,
    pub(super) animations: List<IgnoredAny>,
    #[serde(borrow)]
    pub(super) buffers: List<Buffer<'a>>,
    pub(super) buffer_views: List<BufferView>,
    pub(super) cameras: List<Camera>,
    #[serde(borrow)]
    pub(super) images: List<Image<'a>>,
    pub(super) materials: List<Material>,
    pub(super) meshes: List<Mesh>,
    pub(super) nodes: List<Node>,
    pub(super) samplers: List<Sampler>,
    pub(super) scene: Option<usize>,
    pub(super) scenes: List<Scene>,
    pub(super) skins: List<IgnoredAny>,
    pub(super) textures: List<Texture>,
    pub(super) extensions: Extensions,
    /// The program that wrote the file.
    #[serde(skip)]
    pub(super) generator: String,
}

/// A text without escapes is not copied: it may be a picture.
#[derive(Debug, Deserialize)]
pub(super) struct Text<'a>(#[serde(borrow)] pub(super) Cow<'a, str>);

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Buffer<'a> {
    #[serde(borrow, default)]
    pub(super) uri: Option<Text<'a>>,
    pub(super) byte_length: usize,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct BufferView {
    pub(super) buffer: usize,
    #[serde(default)]
    pub(super) byte_offset: usize,
    pub(super) byte_length: usize,
    #[serde(default)]
    pub(super) byte_stride: Option<usize>,
    #[serde(default)]
    pub(super) extensions: Extensions,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Accessor {
    #[serde(default)]
    pub(super) buffer_view: Option<usize>,
    #[serde(default)]
    pub(super) byte_offset: usize,
    pub(super) component_type: u32,
    #[serde(default)]
    pub(super) normalized: bool,
    pub(super) count: usize,
    #[serde(rename = "type")]
    pub(super) shape: String,
    #[serde(default)]
    pub(super) sparse: Option<Sparse>,
}

#[derive(Debug, Deserialize)]
pub(super) struct Sparse {
    pub(super) count: usize,
    pub(super) indices: SparseIndices,
    pub(super) values: SparseValues,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct SparseIndices {
    pub(super) buffer_view: usize,
    #[serde(default)]
    pub(super) byte_offset: usize,
    pub(super) component_type: u32,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct SparseValues {
    pub(super) buffer_view: usize,
    #[serde(default)]
    pub(super) byte_offset: usize,
}

#[derive(Debug, Deserialize)]
pub(super) struct Mesh {
    #[serde(default)]
    pub(super) name: Option<String>,
    pub(super) primitives: List<Primitive>,
    #[serde(default)]
    pub(super) extras: Value,
    #[serde(default)]
    pub(super) extensions: Extensions,
}

#[derive(Debug, Deserialize)]
pub(super) struct Primitive {
    pub(super) attributes: BTreeMap<String, usize>,
    #[serde(default)]
    pub(super) indices: Option<usize>,
    #[serde(default)]
    pub(super) material: Option<usize>,
    #[serde(default)]
    pub(super) mode: Option<u32>,
    #[serde(default)]
    pub(super) targets: List<IgnoredAny>,
    #[serde(default)]
    pub(super) extensions: Extensions,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Scene {
    pub(super) nodes: List<usize>,
    pub(super) extensions: Extensions,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Node {
    pub(super) name: Option<String>,
    pub(super) children: List<usize>,
    pub(super) mesh: Option<usize>,
    pub(super) camera: Option<usize>,
    pub(super) matrix: Option<[f64; 16]>,
    pub(super) translation: Option<[f64; 3]>,
    pub(super) rotation: Option<[f64; 4]>,
    pub(super) scale: Option<[f64; 3]>,
    pub(super) extras: Value,
    pub(super) extensions: Extensions,
}

#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct Material {
    pub(super) name: Option<String>,
    pub(super) pbr_metallic_roughness: MetallicRoughness,
    pub(super) normal_texture: Option<TextureInfo>,
    pub(super) emissive_texture: Option<TextureInfo>,
    pub(super) emissive_factor: [f64; 3],
    pub(super) alpha_mode: Option<String>,
    pub(super) alpha_cutoff: Option<f64>,
    pub(super) double_sided: bool,
    pub(super) extras: Value,
    pub(super) extensions: Extensions,
}

#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct MetallicRoughness {
    pub(super) base_color_factor: Option<[f64; 4]>,
    pub(super) base_color_texture: Option<TextureInfo>,
    pub(super) metallic_factor: Option<f64>,
    pub(super) roughness_factor: Option<f64>,
    pub(super) metallic_roughness_texture: Option<TextureInfo>,
}

/// The use of a texture by a material.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct TextureInfo {
    pub(super) index: usize,
    #[serde(default)]
    pub(super) tex_coord: usize,
    /// Of normal textures alone.
    #[serde(default)]
    pub(super) scale: Option<f64>,
    #[serde(default)]
    pub(super) extensions: Extensions,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Texture {
    pub(super) sampler: Option<usize>,
    pub(super) source: Option<usize>,
    pub(super) extensions: Extensions,
}

#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct Sampler {
    pub(super) mag_filter: Option<u32>,
    pub(super) wrap_s: Option<u32>,
    pub(super) wrap_t: Option<u32>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct Image<'a> {
    pub(super) name: Option<String>,
    #[serde(borrow)]
    pub(super) uri: Option<Text<'a>>,
    pub(super) buffer_view: Option<usize>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Camera {
    pub(super) name: Option<String>,
    #[serde(rename = "type")]
    pub(super) kind: String,
    pub(super) perspective: Option<Perspective>,
    pub(super) orthographic: Option<Orthographic>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Perspective {
    pub(super) yfov: f64,
    #[serde(default)]
    pub(super) aspect_ratio: Option<f64>,
}

#[derive(Debug, Deserialize)]
pub(super) struct Orthographic {
    pub(super) xmag: f64,
    pub(super) ymag: f64,
}

/// The member `asset`, which says how to read the others.
#[derive(Debug, Default, Deserialize)]
#[serde(default)]
struct Head {
    asset: Option<Version>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
struct Version {
    version: Value,
    min_version: Value,
    generator: Value,
}

impl<'a> Document<'a> {
    /// Reads the JSON of a file of version 2.
    pub(super) fn parse(json: &'a [u8]) -> Result<Self, AssetProblem> {
        let head: Head = serde_json::from_slice(json).map_err(|error| match error.is_data() {
            true => fault("asset", error),
            false => fault("JSON", error),
        })?;
        let asset = head.asset.unwrap_or_default();
        check_version(&asset)?;
        let mut deserializer = serde_json::Deserializer::from_slice(json);
        let document: Self =
            serde_path_to_error::deserialize(&mut deserializer).map_err(|error| fault(error.path(), error.inner()))?;
        let generator = asset.generator.as_str().unwrap_or_default().to_owned();
        Ok(Self { generator, ..document })
    }
}

fn check_version(Version { version, min_version, .. }: &Version) -> Result<(), AssetProblem> {
    let text = |version: &Value| match version {
        Value::String(text) => text.clone(),
        other => other.to_string(),
    };
    let found = text(version);
    let major = found.split('.').next().unwrap_or_default();
    if version.is_null() || major != "2" {
        let message = format!("found {found}, must be \"2.0\": export the scene as glTF 2.0");
        return Err(fault("asset.version", message));
    }
    if !min_version.is_null() && text(min_version) != "2.0" {
        let message = format!("found {}, must be at most \"2.0\"", text(min_version));
        return Err(fault("asset.minVersion", message));
    }
    Ok(())
}

/// Reads an extension of an object; `None` when the object does not have it.
pub(super) fn extension<T: for<'de> Deserialize<'de>>(
    extensions: &Extensions,
    name: &str,
    place: &str,
) -> Result<Option<T>, AssetProblem> {
    let Some(value) = extensions.get(name) else { return Ok(None) };
    let read = serde_path_to_error::deserialize(value);
    let place = |path: &serde_path_to_error::Path| match path.to_string().as_str() {
        "." => format!("{place}.extensions.{name}"),
        path => format!("{place}.extensions.{name}.{path}"),
    };
    read.map(Some).map_err(|error| fault(place(error.path()), error.inner()))
}
