//! What a scene has, in words that other programs know.

use clerestory_render_core::exchange::{CameraModel, CoverModel, LightModel, SurfaceModel};
use clerestory_render_core::scene::description::FilmDescription;
use clerestory_render_core::texture::RadiancePicture;
use glam::DVec3;
use serde::Serialize;

use crate::approximation::Approximation;

/// Everything but pixels and triangles. Places are seen from `origin`.
#[derive(Debug, Serialize)]
pub(crate) struct Contents {
    pub(crate) name: String,
    /// The point of the scene that is the origin here, metres.
    pub(crate) origin: [f64; 3],
    pub(crate) film: FilmDescription,
    pub(crate) camera: CameraModel,
    /// Largest number of vertices between camera and light.
    pub(crate) max_depth: u32,
    pub(crate) materials: Vec<Material>,
    pub(crate) lights: Vec<Light>,
    pub(crate) meshes: Vec<Mesh>,
    pub(crate) panes: Vec<Pane>,
    /// What others render in another way.
    pub(crate) notes: Vec<String>,
    /// What Mitsuba has no twin for.
    pub(crate) mitsuba_approximations: Vec<Approximation>,
    /// Centre and radius of a ball around everything but distant lights, metres.
    #[serde(skip)]
    pub(crate) ball: (DVec3, f64),
}

#[derive(Debug, Serialize)]
pub(crate) struct Material {
    pub(crate) name: String,
    /// Its name where few characters are allowed.
    #[serde(skip)]
    pub(crate) id: String,
    /// Which of two sets of texture coordinates its pictures use, if it has any.
    #[serde(skip)]
    pub(crate) coordinates: Option<usize>,
    #[serde(flatten)]
    pub(crate) model: SurfaceModel<String>,
    #[serde(flatten)]
    pub(crate) cover: CoverModel<String>,
}

#[derive(Debug, Serialize)]
pub(crate) struct Light {
    pub(crate) name: String,
    #[serde(flatten)]
    pub(crate) model: LightModel<String>,
    /// The picture of an environment.
    #[serde(skip)]
    pub(crate) picture: Option<RadiancePicture>,
}

#[derive(Debug, Serialize)]
pub(crate) struct Mesh {
    pub(crate) name: String,
    pub(crate) file: String,
    /// Name of a material.
    pub(crate) material: String,
    /// Whether vertices have normals; if not, triangles are flat.
    pub(crate) normals: bool,
    /// Which of two sets of texture coordinates its vertices have.
    pub(crate) coordinates: usize,
}

#[derive(Debug, Serialize)]
pub(crate) struct Pane {
    pub(crate) name: String,
    /// Both faces: a boundary between air and glass, with normals into the air.
    pub(crate) faces: String,
    /// The black edge.
    pub(crate) edge: String,
    pub(crate) index_of_refraction: f64,
    /// Of red, green and blue light, per metre.
    pub(crate) absorption: [f64; 3],
    /// Largest distance of a triangle from its face, metres.
    pub(crate) error: f64,
}

impl Pane {
    /// Whether its glass has a colour.
    pub(crate) fn is_absorbing(&self) -> bool {
        self.absorption != [0.0; 3]
    }
}
