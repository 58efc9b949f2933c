//! Scenes of water: a pool (`pool`) and a lagoon (`lagoon`), seen from above, from below the surface, or straight onto
//! the floor. They show how methods scale with the triangles of the surface, and how caustics move.
//!
//! Whatever the number of triangles and the time, basin, floating things, light and cameras are the same. So pictures
//! at times one twenty-fifth of a second apart are the frames of an animation.

mod lagoon;
mod pool;

use std::fmt;
use std::str::FromStr;

pub use self::lagoon::lagoon;
pub use self::pool::pool;

use crate::bsdf::MaterialDescription;
use crate::bsdf::{DielectricMaterial, DiffuseMaterial};
use crate::light::LightDescription;
use crate::light::SunLight;
use crate::scene::description::{CameraDescription, MeshDescription, MeshSource, WaveDescription};
use crate::settings::Triple;
use crate::specular::conic::ConicSearch;
use crate::specular::conic::{ConicSettings, through_one_interface};
use crate::specular::registry::IntegratorDescription;
use crate::texture::ColourDescription;

/// Index of refraction of water.
const WATER: f64 = 1.33;

/// Fewest and most triangles.
const TRIANGLES: [u32; 2] = [8, 20_000_000];

/// How water is to be seen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WaterSettings {
    /// Approximate number of triangles of the surface.
    pub triangles: TriangleCount,
    /// When, seconds.
    pub time: f64,
    /// From where.
    pub view: WaterView,
}

/// About how many triangles a surface of water has: 8 to 20 million.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TriangleCount(u32);

/// A number of triangles that no surface of water is cut into.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("found {0}, expected a whole number from 8 to 20000000")]
pub struct TriangleCountError(String);

impl FromStr for TriangleCount {
    type Err = TriangleCountError;

    fn from_str(text: &str) -> Result<Self, TriangleCountError> {
        let [fewest, most] = TRIANGLES;
        let found = text.parse().ok().filter(|count| (fewest..=most).contains(count));
        found.map(Self).ok_or_else(|| TriangleCountError(text.to_owned()))
    }
}

impl fmt::Display for TriangleCount {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(formatter)
    }
}

/// From where water is looked at.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum WaterView {
    /// From above the surface.
    #[default]
    Above,
    /// From below the surface.
    Below,
    /// The floor alone, straight from above it, with the light of paths `D T L` only: for comparing methods.
    Floor,
}

impl TriangleCount {
    /// Cells of two triangles along the edges of a rectangle, nearly square.
    fn cells(self, [width, length]: [f64; 2]) -> [u32; 2] {
        let all = 0.5 * f64::from(self.0);
        let across = (all * width / length).sqrt().round().max(1.0);
        [across as u32, (all / across).round().max(1.0) as u32]
    }
}

/// The surface of water.
fn surface(waves: WaveDescription, level: f64) -> MeshDescription {
    MeshDescription {
        name: "water".to_owned(),
        material: "water".to_owned(),
        matrix: None,
        source: MeshSource::Waves(waves),
        scale: 1.0,
        rotate: [0.0; 3],
        translate: [0.0, 0.0, level],
    }
}

/// The integrator that finds all light over one surface.
fn integrator() -> IntegratorDescription {
    IntegratorDescription::Conic(ConicSettings {
        max_depth: 12,
        search: ConicSearch::Complete,
        chains: through_one_interface(),
        casters: None,
        receivers: None,
    })
}

fn sun(direction: Triple) -> LightDescription {
    LightDescription::Sun(SunLight {
        name: "sun".to_owned(),
        direction,
        angular_radius: 0.27,
        radiance: [41_000.0, 37_000.0, 31_000.0],
    })
}

/// Parallel rays straight down onto a square of the floor in the middle, from just above it.
fn onto_the_floor(edge: f64, height: f64) -> CameraDescription {
    CameraDescription::Orthographic {
        position: [0.0, 0.0, height],
        look_at: [0.0, 0.0, 0.0],
        up: [0.0, 1.0, 0.0],
        height: edge,
    }
}

fn looking(position: Triple, look_at: Triple, vertical_field_of_view: f64) -> CameraDescription {
    CameraDescription::Perspective { position, look_at, up: [0.0, 0.0, 1.0], vertical_field_of_view }
}

fn diffuse(name: &str, colour: Triple) -> (String, MaterialDescription) {
    (name.to_owned(), MaterialDescription::Diffuse(DiffuseMaterial { reflectance: ColourDescription::Colour(colour) }))
}

fn water() -> (String, MaterialDescription) {
    (
        "water".to_owned(),
        MaterialDescription::Dielectric(DielectricMaterial {
            index_of_refraction: WATER,
            absorption: [0.0; 3],
            priority: 0,
        }),
    )
}

#[cfg(test)]
mod tests;
