//! The things of imported files among those of the scene.

use std::borrow::Cow;

use super::SceneDescription;
use crate::scene::Assets;
use crate::scene::import::{Expansion, expand};
use crate::settings::{JsonPath, SceneError};

impl SceneDescription {
    /// The same scene without imports: their things are among its own.
    ///
    /// # Errors
    ///
    /// When a file makes no sense, or what is in it is no part of a valid scene.
    pub fn expanded(&self, assets: &Assets) -> Result<Cow<'_, Self>, SceneError> {
        if self.imports.is_empty() {
            return Ok(Cow::Borrowed(self));
        }
        let mut scene = self.clone();
        for (index, import) in std::mem::take(&mut scene.imports).iter().enumerate() {
            let root = JsonPath::Root;
            let imports = root.member("imports");
            let Expansion { materials, meshes, panes, lights, .. } = expand(import, assets, &imports.element(index))?;
            scene.materials.extend(materials);
            scene.meshes.extend(meshes);
            scene.panes.extend(panes);
            scene.lights.extend(lights);
        }
        scene.validate().map_err(|error| scene.named(error))?;
        Ok(Cow::Owned(scene))
    }

    /// An error about a thing that the scene file does not have, with its name in place of its number.
    pub(crate) fn named(&self, error: SceneError) -> SceneError {
        let name = |list: &str, index: usize| match list {
            "meshes" => self.meshes.get(index).map(|mesh| mesh.name.clone()),
            "panes" => self.panes.get(index).map(|pane| pane.name.clone()),
            "lights" => self.lights.get(index).map(|light| light.name().to_owned()),
            _ => None,
        };
        error.with_path(|path| {
            let (list, rest) = path.split_once('[')?;
            let (number, rest) = rest.split_once(']')?;
            Some(format!("{list}[{}]{rest}", name(list, number.parse().ok()?)?))
        })
    }
}
