//! The registry of materials.

use super::{
    ConductorMaterial, DielectricMaterial, DiffuseMaterial, DiffuseTransmissionMaterial, MaterialSettings,
    MetallicRoughnessMaterial, MirrorMaterial, RoughDielectricMaterial, ThinWallMaterial,
};
use crate::settings::kinds;

kinds! {
    /// A surface material.
    pub enum MaterialDescription: dyn MaterialSettings {
        "diffuse" => Diffuse(DiffuseMaterial),
        "dielectric" => Dielectric(DielectricMaterial),
        "mirror" => Mirror(MirrorMaterial),
        "conductor" => Conductor(ConductorMaterial),
        "rough_dielectric" => RoughDielectric(RoughDielectricMaterial),
        "thin_wall" => ThinWall(ThinWallMaterial),
        "metallic_roughness" => MetallicRoughness(MetallicRoughnessMaterial),
        "diffuse_transmission" => DiffuseTransmission(DiffuseTransmissionMaterial),
    }
}
