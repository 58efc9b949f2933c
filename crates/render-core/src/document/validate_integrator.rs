//! What the types cannot say about the settings of an integrator.

use clerestory_film::MOST_LIGHT_PIXELS;

use super::SceneDescription;
use crate::settings::check::{Quoted, check_range};
use crate::settings::{Check, JsonPath, SceneError};
use crate::specular::settings::LightSubpaths;

impl SceneDescription {
    /// Checks the settings of the integrator by themselves.
    pub(super) fn check_integrator(&self, path: &JsonPath<'_>) -> Check {
        let path = path.member(self.integrator.kind());
        check_range(self.integrator.max_depth(), 1, 1000, &path.member("max_depth"))?;
        if matches!(self.integrator.light_subpaths(), LightSubpaths::Alone(_)) && !self.fits_light_plane() {
            let size = format!("a picture of {} x {} pixels", self.film.width, self.film.height);
            let expected = format!("one of at most {MOST_LIGHT_PIXELS} pixels, or another integrator");
            return Err(SceneError::value(&path, size, expected));
        }
        self.integrator.check(&path)
    }

    /// Checks what the integrator says about other parts of the scene.
    pub(super) fn check_integrator_names(&self, path: &JsonPath<'_>) -> Check {
        let Some(scope) = self.integrator.scope() else { return Ok(()) };
        let (specular, others): (Vec<_>, Vec<_>) = self.meshes.iter().partition(|mesh| self.parts().is_specular(mesh));
        let panes = self.panes.iter().map(|pane| pane.name.as_str());
        let specular = specular.iter().map(|mesh| mesh.name.as_str());
        let (specular, kind): (Vec<&str>, _) = if scope.only_meshes {
            (specular.collect(), "a specular mesh")
        } else {
            (panes.chain(specular).collect(), "a pane or a specular mesh")
        };
        let diffuse: Vec<&str> = others.iter().map(|mesh| mesh.name.as_str()).collect();
        let path = path.member(self.integrator.kind());
        check_known(scope.casters, &specular, kind, &path.member("casters"))?;
        check_known(scope.receivers, &diffuse, "a mesh that scatters light", &path.member("receivers"))
    }
}

fn check_known(names: Option<&[String]>, known: &[&str], kind: &str, path: &JsonPath<'_>) -> Check {
    for (index, name) in names.into_iter().flatten().enumerate() {
        if !known.contains(&name.as_str()) {
            let expected = format!("the name of {kind} ({})", known.join(", "));
            return Err(SceneError::value(&path.element(index), Quoted(name), expected));
        }
    }
    Ok(())
}
