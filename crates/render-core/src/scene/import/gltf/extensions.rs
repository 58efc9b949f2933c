//! The extensions of glTF: which ones are read, and what to do about others.

use super::fault::fault;
use super::schema::Document;
use crate::settings::AssetProblem;

/// Lights.
pub(super) const LIGHTS: &str = "KHR_lights_punctual";
/// A factor of emitted light.
pub(super) const EMISSIVE_STRENGTH: &str = "KHR_materials_emissive_strength";
/// The index of refraction of a material.
pub(super) const IOR: &str = "KHR_materials_ior";
/// Specular reflection of dielectrics.
pub(super) const SPECULAR: &str = "KHR_materials_specular";
/// Light that goes through a surface.
pub(super) const TRANSMISSION: &str = "KHR_materials_transmission";
/// Surfaces that show their colour whatever the light.
pub(super) const UNLIT: &str = "KHR_materials_unlit";
/// What lies behind a surface.
pub(super) const VOLUME: &str = "KHR_materials_volume";
/// Moves, turns and scales texture coordinates.
pub(super) const TRANSFORM: &str = "KHR_texture_transform";
/// Gives a texture a WebP picture.
pub(super) const WEBP: &str = "EXT_texture_webp";
/// Allows attributes of integers.
pub(super) const QUANTIZATION: &str = "KHR_mesh_quantization";

/// Extensions that are read.
pub(super) const SUPPORTED: [&str; 10] =
    [LIGHTS, EMISSIVE_STRENGTH, IOR, SPECULAR, TRANSMISSION, UNLIT, VOLUME, TRANSFORM, WEBP, QUANTIZATION];

/// Replaces the attributes of a primitive by compressed ones.
pub(super) const DRACO: &str = "KHR_draco_mesh_compression";

/// Extensions that a file may require although they are left out: it is the same scene without.
const HARMLESS: [&str; 3] = ["KHR_materials_variants", "KHR_xmp_json_ld", "KHR_xmp"];

/// How to get a file that does not require an extension.
fn way_out(name: &str) -> &'static str {
    match name {
        DRACO => "re-export without Draco compression",
        "EXT_meshopt_compression" | "KHR_meshopt_compression" => "re-export without meshopt compression",
        "KHR_texture_basisu" | "EXT_texture_avif" => "re-export with PNG, JPEG or WebP pictures",
        "EXT_mesh_gpu_instancing" => "re-export with one node for each instance",
        "KHR_materials_pbrSpecularGlossiness" => "re-export with metallic-roughness materials",
        _ => "re-export without it",
    }
}

/// What follows from leaving an extension out.
pub(super) fn consequence(name: &str) -> &'static str {
    match name {
        DRACO | "EXT_meshopt_compression" | "KHR_meshopt_compression" => ": its uncompressed copy is read",
        "KHR_materials_variants" => ": meshes have their default materials",
        "KHR_materials_pbrSpecularGlossiness" => ": materials are metallic-roughness instead",
        "EXT_mesh_gpu_instancing" => ": its meshes stand once each",
        _ => "",
    }
}

/// Checks that the file requires no extension that is left out.
pub(super) fn check_required(document: &Document<'_>) -> Result<(), AssetProblem> {
    let is_read = |name: &str| SUPPORTED.contains(&name) || HARMLESS.contains(&name);
    match document.extensions_required.iter().find(|name| !is_read(name)) {
        Some(name) => {
            let message = format!("the file needs {name}, which this build does not read: {}", way_out(name));
            Err(fault("extensionsRequired", message))
        }
        None => Ok(()),
    }
}
