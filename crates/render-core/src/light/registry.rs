//! The registry of lights.

use super::{
    DiskLight, EnvironmentLight, LightSettings, MeshLight, PointLight, RectangleLight, SphereLight, SpotLight, SunLight,
};
use crate::settings::kinds;

kinds! {
    /// A light.
    pub enum LightDescription: dyn LightSettings {
        "point" => Point(PointLight),
        "spot" => Spot(SpotLight),
        "sphere" => Sphere(SphereLight),
        "rectangle" => Rectangle(RectangleLight),
        "disk" => Disk(DiskLight),
        "mesh" => Mesh(MeshLight),
        "sun" => Sun(SunLight),
        "environment" => Environment(EnvironmentLight),
    }
}
