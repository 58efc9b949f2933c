//! A chapel that ships: three lancets of stained glass to the east, and leaded diamonds with protective panes to the
//! south, under a pointed vault. The sun stands in the south-east; candles burn on the altar.

mod building;
mod windows;

use std::collections::BTreeMap;

use super::{SamplingDescription, SceneDescription};
use crate::bsdf::{DiffuseMaterial, MaterialDescription};
use crate::light::{EnvironmentLight, EnvironmentRadiance, LightDescription, SphereLight, SunLight};
use crate::scene::description::{CameraDescription, FilmDescription};
use crate::settings::{SCENE_FORMAT_VERSION, Triple};
use crate::specular::registry::IntegratorDescription;
use crate::texture::ColourDescription;

/// The chapel, metres, z up.
pub fn chapel() -> SceneDescription {
    SceneDescription {
        version: SCENE_FORMAT_VERSION,
        name: "Chapel".to_owned(),
        seed: 1,
        film: FilmDescription { width: 600, height: 800 },
        camera: CameraDescription::Perspective {
            position: [2.2, 0.4, 1.6],
            look_at: [3.1, 10.0, 2.9],
            up: [0.0, 0.0, 1.0],
            vertical_field_of_view: 68.0,
        },
        integrator: IntegratorDescription::default(),
        path_filter: None,
        sampling: SamplingDescription::default(),
        materials: materials(),
        meshes: building::meshes(),
        imports: Vec::new(),
        windows: windows::windows(),
        sheets: BTreeMap::new(),
        panes: Vec::new(),
        lights: lights(),
    }
}

fn materials() -> BTreeMap<String, MaterialDescription> {
    let diffuse = |name: &str, colour: Triple| {
        let reflectance = ColourDescription::Colour(colour);
        (name.to_owned(), MaterialDescription::Diffuse(DiffuseMaterial { reflectance }))
    };
    BTreeMap::from([
        diffuse("flagstones", [0.42, 0.38, 0.33]),
        diffuse("limewashed wall", [0.7, 0.66, 0.58]),
        diffuse("rib stone", [0.58, 0.53, 0.45]),
        diffuse("oak", [0.3, 0.2, 0.12]),
        diffuse("altar stone", [0.6, 0.57, 0.52]),
        diffuse("wax", [0.8, 0.76, 0.65]),
    ])
}

fn lights() -> Vec<LightDescription> {
    let flame = |number: usize, place: Triple| {
        LightDescription::Sphere(SphereLight {
            name: format!("candle {number}"),
            centre: place,
            radius: 0.012,
            radiance: [60.0, 34.0, 14.0],
        })
    };
    let [first, second] = building::CANDLES.map(|[x, y]| [x, y, building::FLAME]);
    vec![
        LightDescription::Sun(SunLight {
            name: "sun".to_owned(),
            // 32 degrees high, in the south-east.
            direction: [0.66, 0.53, 0.53],
            angular_radius: 0.27,
            radiance: [41_000.0, 37_000.0, 31_000.0],
        }),
        LightDescription::Environment(EnvironmentLight {
            name: "sky".to_owned(),
            radiance: EnvironmentRadiance::Colour([0.35, 0.45, 0.6]),
            scale: 1.0,
            rotate: [0.0; 3],
        }),
        flame(1, first),
        flame(2, second),
    ]
}
