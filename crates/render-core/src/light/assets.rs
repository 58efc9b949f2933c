//! What lights are made of besides their settings.

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::{DVec2, DVec3};

use super::EnvironmentMaps;
use crate::geometry::Coverage;
use crate::texture::{MappedPicture, TextureCoordinates};

/// What lights are made of besides their settings: decoded pictures, and surfaces of the scene.
#[derive(Clone, Debug, Default)]
pub struct LightAssets {
    /// Pictures of all that is around the scene, by the names of their files.
    pub(crate) environments: EnvironmentMaps,
    /// The surfaces of meshes that are lights, by the names of the meshes.
    pub(crate) surfaces: BTreeMap<String, Arc<ShiningSurface>>,
}

/// The surface of a mesh that is a light.
#[derive(Clone, Debug)]
pub(crate) struct ShiningSurface {
    /// The number of its first triangle in the scene.
    pub(crate) first_triangle: u32,
    /// The corners of its triangles, metres.
    pub(crate) corners: Vec<[DVec3; 3]>,
    /// By what its radiance is multiplied.
    pub(crate) picture: Option<ShiningPicture>,
    /// How much of it is there, if not all.
    pub(crate) coverage: Option<Arc<dyn Coverage>>,
}

/// A picture by which the radiance of a surface is multiplied.
#[derive(Clone, Debug)]
pub(crate) struct ShiningPicture {
    pub(crate) picture: MappedPicture,
    /// Its texture coordinates at the corners of each triangle.
    pub(crate) coordinates: Vec<[DVec2; 3]>,
}

impl ShiningSurface {
    /// By what radiance is multiplied at a point of one of its triangles. The weights of the second and the third
    /// corner are `barycentric`.
    pub(crate) fn part_of_radiance(&self, number: usize, [v, w]: [f64; 2]) -> DVec3 {
        let Some(ShiningPicture { picture, coordinates }) = &self.picture else { return DVec3::ONE };
        let [a, b, c] = coordinates[number];
        picture.at(TextureCoordinates([a * (1.0 - v - w) + b * v + c * w; 2]))
    }

    /// How much of it is there at such a point.
    pub(crate) fn opacity(&self, number: usize, barycentric: [f64; 2]) -> f64 {
        let triangle = self.first_triangle + number as u32;
        self.coverage.as_ref().map_or(1.0, |coverage| coverage.opacity(triangle, barycentric))
    }
}
