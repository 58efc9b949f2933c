//! The things of a scene file.

use std::collections::BTreeMap;

use super::description::{CameraDescription, FilmDescription, MeshDescription, PaneDescription, SheetDescription};
use super::import::ImportDescription;
use super::window::WindowDescription;
use crate::bsdf::MaterialDescription;
use crate::light::LightDescription;

/// The things of a scene file, of which a scene is built.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SceneParts<'a> {
    /// The camera.
    pub camera: &'a CameraDescription,
    /// Size of the image.
    pub film: FilmDescription,
    /// Materials by name.
    pub materials: &'a BTreeMap<String, MaterialDescription>,
    /// Triangle meshes.
    pub meshes: &'a [MeshDescription],
    /// Files of other programs; none once their things are among the others.
    pub imports: &'a [ImportDescription],
    /// Leaded windows; none once their things are among the others.
    pub windows: &'a [WindowDescription],
    /// Sheets of glass by name.
    pub sheets: &'a BTreeMap<String, SheetDescription>,
    /// Window panes.
    pub panes: &'a [PaneDescription],
    /// Lights.
    pub lights: &'a [LightDescription],
}

impl<'a> SceneParts<'a> {
    /// Whether a mesh refracts or mirrors light, so that specular methods search it.
    pub(crate) fn is_specular(&self, mesh: &MeshDescription) -> bool {
        self.materials.get(&mesh.material).is_some_and(|material| material.is_searched())
    }

    /// The lights that are meshes of the scene, by the names of the meshes.
    pub(super) fn shining(&self) -> BTreeMap<&'a str, &'a LightDescription> {
        self.lights.iter().filter_map(|light| Some((light.mesh()?, light))).collect()
    }

    /// Whether a mesh scatters light into single directions, and no specular method searches it.
    pub(crate) fn is_left_to_chance(&self, mesh: &MeshDescription) -> bool {
        let material = self.materials.get(&mesh.material);
        material.is_some_and(|material| material.is_delta() && !material.is_searched())
    }
}
