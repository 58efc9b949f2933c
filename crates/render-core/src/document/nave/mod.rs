//! A scene to measure how methods scale with the number of panes: a stone nave whose clerestory lets the sun in.
//!
//! Stone, sun, camera and the four openings of the clerestory are the same for any number of panes. The openings are
//! cut into smaller panes, as in leaded lights, with cames between them (`leading`). The waves of the glass keep their
//! lengths (`glazing`). So the receiver gets about the same light, from more panes. The walls are closed (`stonework`):
//! the sun comes in through glass alone. Or the openings have leaded windows of diamonds, as such a nave would have
//! (`diamonds`).

mod diamonds;
mod glazing;
mod leading;
mod stonework;

use std::collections::BTreeMap;
use std::fmt;
use std::str::FromStr;

use self::stonework::WINDOWS;
use super::{SamplingDescription, SceneDescription};
use crate::bsdf::DiffuseMaterial;
use crate::bsdf::MaterialDescription;
use crate::light::LightDescription;
use crate::light::SunLight;
use crate::scene::description::{CameraDescription, FilmDescription};
use crate::settings::{SCENE_FORMAT_VERSION, Triple};
use crate::specular::cone::ConeSettings;
use crate::specular::registry::IntegratorDescription;
use crate::texture::ColourDescription;

/// The rows, and the columns, into which each opening can be cut.
const CUTS: [u32; 4] = [1, 2, 4, 8];

/// Into how many panes the windows of the nave are cut: 4, 16, 64 or 256.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PaneCount {
    /// Panes along each edge of an opening.
    cuts: u32,
}

/// A number of panes into which the windows of the nave cannot be cut alike.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("found {found}, expected 4, 16, 64 or 256: each of the four windows is cut into as many rows as columns")]
pub struct PaneCountError {
    /// What was asked for.
    found: String,
}

impl PaneCount {
    /// All there are, from the fewest panes to the most.
    pub fn all() -> impl Iterator<Item = Self> {
        CUTS.into_iter().map(|cuts| Self { cuts })
    }

    /// The number of panes of all windows.
    pub fn get(self) -> u32 {
        WINDOWS * self.cuts * self.cuts
    }
}

impl FromStr for PaneCount {
    type Err = PaneCountError;

    fn from_str(text: &str) -> Result<Self, PaneCountError> {
        let found = text.parse().ok();
        Self::all().find(|count| Some(count.get()) == found).ok_or_else(|| PaneCountError { found: text.to_owned() })
    }
}

impl fmt::Display for PaneCount {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.get().fmt(formatter)
    }
}

/// The nave: 8 m wide, 14 m long and 13 m high, metres, z up. Four windows of 1 x 2.4 m with their sills at 8 m are in
/// the wall at x = 0; the sun shines through them onto the wall at x = 8, at which the camera looks.
pub fn nave(panes: PaneCount) -> SceneDescription {
    let PaneCount { cuts } = panes;
    let mut scene = building(format!("Nave with {panes} panes"));
    scene.materials.extend([diffuse("lead", [0.22, 0.22, 0.23])]);
    scene.meshes.push(leading::cames(cuts));
    scene.panes = glazing::panes(cuts);
    scene
}

/// The same nave with leaded windows of diamonds, which are cut from crown, cylinder-blown and hammered sheets.
pub fn nave_with_diamonds() -> SceneDescription {
    SceneDescription { windows: diamonds::windows(), ..building("Nave with diamonds".to_owned()) }
}

/// The nave without its glass.
fn building(name: String) -> SceneDescription {
    SceneDescription {
        version: SCENE_FORMAT_VERSION,
        name,
        seed: 1,
        film: FilmDescription { width: 480, height: 360 },
        camera: CameraDescription::Perspective {
            position: [0.8, 4.6, 1.7],
            look_at: [8.0, 7.9, 1.75],
            up: [0.0, 0.0, 1.0],
            vertical_field_of_view: 45.0,
        },
        integrator: IntegratorDescription::Cone(ConeSettings { max_depth: 16 }),
        path_filter: None,
        sampling: SamplingDescription::default(),
        materials: materials(),
        meshes: stonework::meshes(),
        imports: Vec::new(),
        windows: Vec::new(),
        sheets: BTreeMap::new(),
        panes: Vec::new(),
        site: None,
        moment: None,
        daylight: None,
        timeline: Vec::new(),
        lights: vec![LightDescription::Sun(SunLight {
            name: "sun".to_owned(),
            // 40 degrees high, 15 degrees from the normal of the windows.
            direction: [-0.739942, -0.198267, 0.642788],
            angular_radius: 0.27,
            radiance: [41_000.0, 37_000.0, 31_000.0],
        })],
    }
}

fn materials() -> BTreeMap<String, MaterialDescription> {
    BTreeMap::from([
        diffuse("ashlar", [0.62, 0.57, 0.48]),
        diffuse("flagstones", [0.45, 0.42, 0.37]),
        diffuse("oak", [0.34, 0.25, 0.16]),
    ])
}

fn diffuse(name: &str, colour: Triple) -> (String, MaterialDescription) {
    let reflectance = ColourDescription::Colour(colour);
    (name.to_owned(), MaterialDescription::Diffuse(DiffuseMaterial { reflectance }))
}

#[cfg(test)]
mod tests;
