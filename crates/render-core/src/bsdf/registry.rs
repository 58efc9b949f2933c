//! The registry of materials.

use super::{DielectricMaterial, DiffuseMaterial, MaterialSettings, MirrorMaterial};
use crate::settings::kinds;

kinds! {
    /// A surface material.
    pub enum MaterialDescription: dyn MaterialSettings {
        "diffuse" => Diffuse(DiffuseMaterial),
        "dielectric" => Dielectric(DielectricMaterial),
        "mirror" => Mirror(MirrorMaterial),
    }
}
