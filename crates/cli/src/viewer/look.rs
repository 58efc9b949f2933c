//! The view of a scene: its camera, and the direction of its first distant light.

use clerestory_render_core::document::{SceneBundle, SceneDescription};
use clerestory_render_core::scene::SceneError;
use clerestory_render_core::scene::description::CameraDescription;
use clerestory_render_core::settings::Triple;
use serde::{Deserialize, Serialize};

/// What the page can change.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Look {
    /// As in a scene file.
    pub(super) camera: CameraDescription,
    /// Direction towards the first distant light; `None` where the scene has none.
    pub(super) sun: Option<Triple>,
}

impl Look {
    /// The view of a scene file.
    pub(super) fn of(description: &SceneDescription) -> Self {
        let sun = description.lights.iter().find_map(|light| light.direction());
        Self { camera: description.camera.clone(), sun }
    }

    /// The scene with this view.
    pub(super) fn applied(&self, bundle: &SceneBundle) -> Result<SceneBundle, SceneError> {
        let mut description = bundle.description().clone();
        description.camera = self.camera.clone();
        let direction = description.lights.iter_mut().find_map(|light| light.direction_mut());
        if let (Some(direction), Some(sun)) = (direction, self.sun) {
            *direction = sun;
        }
        bundle.clone().with_description(description)
    }
}
