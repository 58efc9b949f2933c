//! The registry of lights.

use super::{DiskLight, LightSettings, PointLight, RectangleLight, SphereLight, SunLight};
use crate::settings::kinds;

kinds! {
    /// A light.
    pub enum LightDescription: dyn LightSettings {
        "point" => Point(PointLight),
        "sphere" => Sphere(SphereLight),
        "rectangle" => Rectangle(RectangleLight),
        "disk" => Disk(DiskLight),
        "sun" => Sun(SunLight),
    }
}
