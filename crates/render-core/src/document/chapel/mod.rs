//! A chapel that ships: three lancets of stained glass to the east, and leaded diamonds with protective panes to the
//! south, under a pointed vault. The sun stands in the south-east; candles burn on the altar. Its stone and its wood
//! are pictures, which are computed as well.

mod building;
mod dimensions;
mod masonry;
#[cfg(test)]
mod tests;
mod textures;
mod windows;

use std::collections::BTreeMap;

use image::ImageError;

use self::textures::Texture;
use super::{SamplingDescription, SceneDescription};
use crate::bsdf::{DiffuseMaterial, MaterialDescription};
use crate::light::{EnvironmentLight, EnvironmentRadiance, LightDescription, SphereLight, SunLight};
use crate::scene::description::{CameraDescription, FilmDescription};
use crate::settings::{SCENE_FORMAT_VERSION, Triple};
use crate::specular::registry::IntegratorDescription;
use crate::texture::ColourDescription;

/// A scene, and the files that it names.
#[derive(Clone, Debug)]
pub struct Chapel {
    /// The scene.
    pub scene: SceneDescription,
    /// The contents of its files by their names, which are relative to the scene file.
    pub files: BTreeMap<String, Vec<u8>>,
}

/// The chapel, metres, z up.
///
/// # Errors
///
/// When a picture cannot be encoded.
pub fn chapel() -> Result<Chapel, ImageError> {
    let files = Texture::ALL.into_iter().map(|texture| Ok((texture.file().to_owned(), texture.png()?)));
    Ok(Chapel { scene: scene(), files: files.collect::<Result<_, ImageError>>()? })
}

fn scene() -> SceneDescription {
    SceneDescription {
        version: SCENE_FORMAT_VERSION,
        name: "Chapel".to_owned(),
        seed: 1,
        film: FilmDescription { width: 640, height: 480 },
        camera: CameraDescription::Perspective {
            position: [4.5, 0.5, 2.2],
            look_at: [2.5, 10.0, 2.4],
            up: [0.0, 0.0, 1.0],
            vertical_field_of_view: 60.0,
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
        site: None,
        moment: None,
        daylight: None,
        timeline: Vec::new(),
    }
}

fn materials() -> BTreeMap<String, MaterialDescription> {
    let diffuse = |name: &str, reflectance: ColourDescription| {
        (name.to_owned(), MaterialDescription::Diffuse(DiffuseMaterial { reflectance }))
    };
    let plain = |name: &str, colour: Triple| diffuse(name, ColourDescription::Colour(colour));
    let pictured = |name: &str, texture: Texture| diffuse(name, ColourDescription::picture(texture.file()));
    BTreeMap::from([
        pictured("ashlar", Texture::Ashlar),
        pictured("flagstones", Texture::Flagstones),
        pictured("oak", Texture::Oak),
        plain("limewashed wall", [0.7, 0.66, 0.58]),
        plain("rib stone", [0.58, 0.53, 0.45]),
        plain("altar stone", [0.6, 0.57, 0.52]),
        plain("wax", [0.8, 0.76, 0.65]),
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
            radiance: [32_000.0, 28_500.0, 23_500.0],
        }),
        LightDescription::Environment(EnvironmentLight {
            name: "sky".to_owned(),
            radiance: EnvironmentRadiance::Colour([0.8, 1.0, 1.3]),
            scale: 1.0,
            rotate: [0.0; 3],
        }),
        flame(1, first),
        flame(2, second),
    ]
}
